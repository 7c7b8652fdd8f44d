"""Modelled events of all runs, and how their number varies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.spread import all_runs
from catalogs.compare.sum_measures import MIN_RUNS_FOR_VARIANCE
from catalogs.run_numbers import run_dispersion, widened
from common.source_tensors import moment_magnitude
from shaking.relations import sizes_of

MAGNITUDE_CLASS = 0.5  # width of a class of Mw
MAX_MAGNITUDE_CLASSES = 12


@dataclass(frozen=True)
class RunEvents:
    """Resolved events of all runs: step (event,) index, location (event, 3) m, size as the relation has it, Mw, and
    numbers (run, step) of events."""

    step: NDArray
    location: NDArray
    size: NDArray
    magnitude: NDArray
    number: NDArray

    @classmethod
    def of(
        cls, kind: str, step: NDArray, run: NDArray, runs: int, steps: int, location: NDArray, potency: NDArray,
        moment: NDArray,
    ) -> "RunEvents":  # fmt: skip
        """Events by step and run, each (event,) an index; potency (event,) m3, moment (event,) N m."""
        known = np.flatnonzero((potency > 0.0) & (moment > 0.0))  # without a size there is no shaking
        step, run, potency, moment = step[known], run[known], potency[known], moment[known]
        number = np.zeros((runs, steps))
        np.add.at(number, (run, step), 1.0)
        return cls(step, location[known], sizes_of(kind, potency, moment), moment_magnitude(moment), number)

    @classmethod
    def of_catalogues(
        cls, kind: str, catalog: xr.Dataset, members: Sequence[xr.Dataset], steps: Sequence[str]
    ) -> "RunEvents":
        """Resolved events of a catalogue and of those of members, in these steps."""
        events, run = all_runs(catalog, list(members))
        run = np.zeros(events.sizes["event"], np.int64) if run is None else run
        place = {name: number for number, name in enumerate(steps)}
        step = np.array([place.get(str(name), -1) for name in events["step"].values], np.int64)
        kept = (events["resolved"].values == 1) & (step >= 0)
        values = (events[name].values[kept] for name in ("location", "potency", "moment"))
        return cls.of(kind, step[kept], run[kept], 1 + len(members), len(steps), *values)


def dispersions(number: NDArray, record: xr.Dataset | None) -> tuple[float, float]:
    """Variance over mean of the number of events of the process, and of the number between runs, for intervals.

    number (run, step). That of the process is the record's where it is larger. That of intervals is raised to what
    Student's t with the degrees of freedom of the runs asks for.
    """
    of_runs = run_dispersion(number)
    process = of_runs
    if record is not None and np.isfinite(record["dispersion_index"]):
        process = max(process, float(record["dispersion_index"]))
    freedom = (len(number) - 1) * number.shape[1] if len(number) >= MIN_RUNS_FOR_VARIANCE else 0
    return process, widened(of_runs, freedom)


def magnitude_edges(magnitude: NDArray) -> NDArray:
    """Edges of classes of Mw that hold all events; the lowest class is open below where there would be too many."""
    if not len(magnitude):
        return np.array([0.0, MAGNITUDE_CLASS])
    high = (np.floor(magnitude.max() / MAGNITUDE_CLASS) + 1.0) * MAGNITUDE_CLASS
    low = np.floor(magnitude.min() / MAGNITUDE_CLASS) * MAGNITUDE_CLASS
    count = min(round((high - low) / MAGNITUDE_CLASS), MAX_MAGNITUDE_CLASSES)
    return high - MAGNITUDE_CLASS * np.arange(count, -1, -1.0)
