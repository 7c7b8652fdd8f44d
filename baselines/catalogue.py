"""Catalogues of the baselines: what the record asks of them, and events in the form of common.event_table."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.comparison_settings import DatedStep
from catalogs.exposure import Exposure, common_period
from common.errors import InputError
from common.event_table import new_catalog
from common.modelled_events import spread_in_time

RUNS = 10  # Catalogues that each baseline draws at random: one that stands for it, and the others for its chance.
RUN = "run"  # variable that tells the runs of one file apart


@dataclass(frozen=True)
class Asked:
    """What a baseline takes from the record.

    number: of recorded events from `cut`, m3, on; sizes (event,) their potencies, m3; floor: that of the mine's own
    catalogue, m3, so that all models are compared from the same cut on; weight (step,): the share of each dated step in
    which both catalogues are known.
    """

    cut: float
    floor: float
    number: int
    sizes: NDArray
    weight: NDArray

    @classmethod
    def of(cls, record: xr.Dataset, comparison: xr.Dataset, steps: Sequence[DatedStep]) -> "Asked":
        """From the record and its comparison with the mine's own catalogue. Raises InputError for a record without an
        event to scale to."""
        sizes = record["potency"].values[comparison["record_used"].values == 1]
        if not len(sizes):
            raise InputError(
                f"record: no event that is compared ({comparison.attrs['cut_text']}); baselines are scaled to their "
                "number, so give a record with events in the dated steps"
            )
        shared, whole = (Exposure.of(tuple(steps), period) for period in (common_period(record), None))
        weight = (shared.end - shared.start) / (whole.end - whole.start)
        cut, floor = (10.0 ** float(comparison[name]) for name in ("cut", "model_floor"))
        return cls(cut, floor, len(sizes), sizes, weight)

    def of_states(self, states: int) -> NDArray:
        """The weight of each state (state,): the dated steps are the last ones."""
        return np.concatenate([np.zeros(states - len(self.weight)), self.weight])


def make_catalogue(
    mine: str, steps: Sequence[DatedStep], step: NDArray, attributes: dict, **values: NDArray
) -> xr.Dataset:
    """Events of the dated steps, by time.

    step (event,): index of each one's step; values (event, ...): variables of the event table, in the order in which
    the events of a step happen.
    """
    order = np.argsort(step, kind="stable")
    step = step[order]
    values = {name: array[order] for name, array in values.items()}
    times = [
        spread_in_time((one.start, one.end), int(np.sum(step == index)), f"step {one.name}")
        for index, one in enumerate(steps)
    ]
    values |= {name: np.concatenate([part[name] for part in times]) for name in times[0]}
    values["step"] = np.array([one.name for one in steps], object)[step]
    known = {"mine": mine, "kind": "synthetic", "steps": json.dumps([one.name for one in steps])}
    return new_catalog(len(step), known | attributes, **values)


def join_runs(runs: Sequence[xr.Dataset]) -> xr.Dataset:
    """Catalogues in one, with the number of each event's run."""
    joined = xr.concat([run.drop_attrs(deep=False) for run in runs], "event").assign_attrs(runs[0].attrs)
    number = np.repeat(np.arange(len(runs)), [run.sizes["event"] for run in runs])
    joined[RUN] = ("event", number.astype(np.int32), {"units": "1", "long_name": "number of the run, from 0"})
    return joined.assign_attrs(runs=len(runs))


def split_runs(joined: xr.Dataset) -> list[xr.Dataset]:
    """The catalogues that join_runs has joined."""
    number = joined[RUN].values
    return [joined.isel(event=number == run).drop_vars(RUN) for run in range(int(joined.attrs["runs"]))]
