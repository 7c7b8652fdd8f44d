"""The steps that a record covers, and numbers of recorded events in these, with those of the mine's own runs."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.comparison import record_clusters
from catalogs.compare.exposure import DAY, Exposure, common_period, window
from catalogs.records.times import parse_time
from catalogs.settings import DatedStep
from catalogs.sources.completeness import next_edge, rounding
from catalogs.sources.sizes import log_potency
from common.errors import InputError
from plans.layout import DRAW, LIKE_OWN, OWN
from plans.runs import StepResult, has_collapsed, read_run
from plans.settings import OutcomeSlice

MONTH = 30.0  # days
MIN_DRAWS = 3  # Draws of the rock that a spread needs.
CELL_CHANGE_FACTOR = 1.25  # On the change of ln of a number, or of a ratio, from cells of twice the size.
MIN_CELL_CHANGE = 0.1  # Share that the cells leave a number of events uncertain by, however little it changed.
CHANCE, CELLS, RECORD, ROCK, RUNS, LAW = "chance", "cells", "record", "rock", "runs", "law"


@dataclass(frozen=True)
class RecordedNumbers:
    """Events from a floor on in the recorded steps.

    recorded (step,); modelled (run, step): of the mine's own run and its members, as far as they stand; draws (draw,
    step): of runs in rock of the posterior, NaN of those that have collapsed, and own: of the mine's own run, all
    steps, both from the shared floor on; dispersion_index: variance of the recorded number over its mean, at least 1;
    sizes (event,): log10 potency of the recorded ones, m3; width: of the bins that these are rounded to; potency: of
    all recorded events of these steps, m3; days (step,): the middle of each step, days since 1970, a month apart if not
    given; least_dispersion: the index by the times alone, if known. Clusters may join what does not belong together,
    and times miss long sequences, so the truth is between the two.
    """

    recorded: NDArray
    modelled: NDArray
    draws: NDArray
    own: float
    dispersion_index: float
    sizes: NDArray
    width: float
    potency: float
    days: NDArray | None = None
    least_dispersion: float | None = None

    @property
    def middles(self) -> NDArray:
        """Middle of each step (step,), days."""
        return MONTH * np.arange(len(self.recorded)) if self.days is None else self.days

    @property
    def dispersion_bounds(self) -> tuple[float, float]:
        """Bounds of the variance of the recorded number over its mean."""
        least = self.dispersion_index if self.least_dispersion is None else self.least_dispersion
        return min(least, self.dispersion_index), self.dispersion_index


@dataclass(frozen=True)
class RecordedSteps:
    """A record, the steps that it covers from start to end, and the events of the mine's own runs in these.

    until: end of what is known to be recorded (`known_until`); cut: of the comparison, log10 m3.
    """

    record: xr.Dataset
    steps: tuple[DatedStep, ...]
    until: np.datetime64
    cut: float
    runs: Sequence[Sequence[StepResult]]
    kinds: Sequence[str]

    @property
    def _sizes(self) -> NDArray:
        return log_potency(self.record["potency"].values)

    def floor_above(self, floor: float) -> float:
        """The lowest floor at which runs with this floor, the mine's own runs and the record are complete."""
        like_own = (run for run, kind in zip(self.runs, self.kinds, strict=True) if kind in LIKE_OWN)
        own = [step.floor for run in like_own if not has_collapsed(run) for step in run]
        highest = float(np.fmax.reduce([floor, self.cut, *own]))
        return next_edge(self._sizes, highest, rounding(self._sizes))

    def numbers(self, floor: float, shared: float) -> RecordedNumbers:
        """Recorded and modelled numbers from a floor on; those of draws from the shared floor on."""
        sizes, time = self._sizes, self.record["time"].values
        exposure = Exposure.of(self.steps, None)
        step = exposure.step(time) if self.steps else np.full(len(time), -1)
        counted = (self.record["resolved"].values == 1) & (step >= 0)
        used = counted & (sizes >= floor)
        dispersion_index = least_dispersion = 1.0
        if used.any():
            clusters = record_clusters(self.record, counted, step)[counted]
            known = time[counted]
            dispersion_index = exposure.dispersion_index(known, clusters, used[counted])
            # each event by itself
            least_dispersion = exposure.dispersion_index(known, np.arange(len(known)), used[counted])

        def table(kinds: Sequence[str], least: float) -> NDArray:
            rows = [
                [np.nan if has_collapsed(run) else len(step.from_floor(least).potency) for step in run]
                for run, kind in zip(self.runs, self.kinds, strict=True)
                if kind in kinds
            ]
            return np.array(rows, float).reshape(len(rows), len(self.steps))

        modelled = table(LIKE_OWN, floor)
        return RecordedNumbers(
            np.bincount(step[used], minlength=len(self.steps)).astype(float),
            modelled[np.isfinite(modelled).all(axis=1)],
            table([DRAW], shared),
            float(table([OWN], shared).sum()),
            dispersion_index,
            sizes[used],
            rounding(sizes),
            float(np.nansum(self.record["potency"].values[counted])),
            middles(self.steps),
            least_dispersion,
        )


def read_recorded(settings: OutcomeSlice, record: xr.Dataset, comparison: xr.Dataset) -> RecordedSteps:
    """The record and results of the mine's own runs in the steps that it covers. Raises InputError for another mine."""
    for name, one in (("record", record), ("comparison", comparison)):
        if one.attrs["mine"] != settings.mine:
            raise InputError(f"plans: {name} is of mine {one.attrs['mine']}, not of {settings.mine}")
    covered = [number for number, step in enumerate(settings.recorded_steps) if is_covered(record, step)]
    every = [read_run(run, settings.recorded_steps, settings.mine, has_states=False) for run in settings.recorded_runs]
    runs = [[run[number] for number in covered] for run in every]
    is_compared = bool(runs) and not has_collapsed(runs[0])  # the mine's own run stands for the record
    return RecordedSteps(
        record,
        tuple(settings.recorded_steps[number] for number in covered) if is_compared else (),
        known_until(record),
        float(comparison["cut"]),
        runs if is_compared else [],
        [run.kind for run in settings.recorded_runs] if is_compared else [],
    )


def middles(steps: Sequence[DatedStep]) -> NDArray:
    """Middle of each dated step (step,), days since 1970."""
    windows = np.array([window(step.model_dump()) for step in steps], "datetime64[ns]").reshape(-1, 2)
    return (windows.astype(np.int64) / DAY.astype(np.int64)).mean(axis=1)


def last_event(record: xr.Dataset) -> np.datetime64:
    """Time of the last event that the record's file has, also of one that is not compared."""
    recorded = json.loads(record.attrs.get("period", "{}")).get("recorded")
    known = record["time"].values[~np.isnat(record["time"].values)]
    if recorded:
        return parse_time(recorded[1], "record")
    return known.max() if len(known) else np.datetime64("1678-01-01", "ns")


def known_until(record: xr.Dataset) -> np.datetime64:
    """Time up to which the record is known to reach: its last event, or the end that the configuration states for it
    (record.filter.end), as far as that leaves no longer silence than chance may (catalogs.settings)."""
    last, common = last_event(record), common_period(record)
    stated = record.attrs.get("stated_end")
    return max(last, np.datetime64(common[1], "ns")) if stated and common else last


def mean_wait(record: xr.Dataset) -> np.timedelta64:
    """Mean time between days with events; none of fewer than two such days."""
    time = record["time"].values
    days = np.unique(time[~np.isnat(time)].astype("datetime64[D]"))
    if len(days) < 2:
        return np.timedelta64(0, "ns")
    return (days[-1] - days[0]).astype("timedelta64[ns]") // (len(days) - 1)


def is_ahead(step: DatedStep, until: np.datetime64 | None) -> bool:
    """True if a step begins after what is known to be recorded, or without a record."""
    return until is None or bool(window(step.model_dump())[0] >= until)


def is_covered(record: xr.Dataset, step: DatedStep) -> bool:
    """True if the network is known to have recorded during all of a step.

    After the last event nobody knows whether the network still recorded. A step that begins there is not covered. One
    that ends there is, if what is left of it is no longer than the mean wait for an event.
    """
    until = known_until(record)
    if is_ahead(step, until):
        return False
    start, end = window(step.model_dump())
    if common := common_period(record):
        first, last = (np.datetime64(text, "ns") for text in common)
        if start < first or end > last:
            return False
    return bool(end <= max(until, last_event(record) + mean_wait(record)))
