"""The record compared with the mine's own runs, and the factor that multiplies the numbers of a plan's runs.

With a record the factor is the number recorded over that modelled in the recorded steps. It contains what the cells and
the model get wrong in all steps alike. Steps differ, too: ln of the ratio scatters about its mean mu with a standard
deviation tau, whose prior is half-normal with STEP_SCATTER. A step that is ahead has its own scatter. Without a record
the factor is 1, and uncertain by what cells of twice the size change. Rock of the posterior multiplies either.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import norm

from catalogs.compare.comparison import record_clusters
from catalogs.compare.exposure import Exposure, common_period, window
from catalogs.compare.grid_convergence import MIN_ERROR_SHARE, SAFETY_FACTOR
from catalogs.records.times import parse_time
from catalogs.settings import DatedStep
from catalogs.sources.completeness import next_edge, rounding
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.sizes import log_potency
from common.errors import InputError
from plans.layout import COARSE, DRAW, LIKE_OWN, OWN
from plans.runs import StepResult, read_run
from plans.settings import OutcomeSlice

STEP_SCATTER = 0.5  # Standard deviation of the half-normal prior of the scatter of ln ratio between steps.
SCATTERS = np.linspace(0.0, 4.0 * STEP_SCATTER, 201)
MIN_DRAWS = 3  # Draws of the rock that a spread needs.
CHANCE, CELLS, RECORD, ROCK, RUNS, LAW = "chance", "cells", "record", "rock", "runs", "law"


@dataclass(frozen=True)
class RecordedNumbers:
    """Events from a floor on in the recorded steps.

    recorded (step,); modelled (run, step): of the mine's own run and its members; draws (draw, step): of runs in rock
    of the posterior, and own: of the mine's own run, all steps, both from the shared floor on; dispersion_index:
    variance of the recorded number over its mean, at least 1; sizes (event,): log10 potency of the recorded ones, m3;
    width: of the bins that these are rounded to; potency: of all recorded events of these steps, m3.
    """

    recorded: NDArray
    modelled: NDArray
    draws: NDArray
    own: float
    dispersion_index: float
    sizes: NDArray
    width: float
    potency: float


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
        own = [step.floor for run, kind in zip(self.runs, self.kinds, strict=True) if kind in LIKE_OWN for step in run]
        highest = float(np.fmax.reduce([floor, self.cut, *own]))
        return next_edge(self._sizes, highest, rounding(self._sizes))

    def numbers(self, floor: float, shared: float) -> RecordedNumbers:
        """Recorded and modelled numbers from a floor on; those of draws from the shared floor on."""
        sizes, time = self._sizes, self.record["time"].values
        exposure = Exposure.of(self.steps, None)
        step = exposure.step(time) if self.steps else np.full(len(time), -1)
        counted = (self.record["resolved"].values == 1) & (step >= 0)
        used = counted & (sizes >= floor)
        dispersion_index = 1.0
        if used.any():
            clusters = record_clusters(self.record, used, step)
            dispersion_index = exposure.dispersion_index(time[used], clusters[used])

        def table(kinds: Sequence[str], least: float) -> NDArray:
            rows = [
                [len(step.from_floor(least).potency) for step in run]
                for run, kind in zip(self.runs, self.kinds, strict=True)
                if kind in kinds
            ]
            return np.array(rows, float).reshape(len(rows), len(self.steps))

        return RecordedNumbers(
            np.bincount(step[used], minlength=len(self.steps)).astype(float),
            table(LIKE_OWN, floor),
            table([DRAW], shared),
            float(table([OWN], shared).sum()),
            dispersion_index,
            sizes[used],
            rounding(sizes),
            float(np.nansum(self.record["potency"].values[counted])),
        )


def read_recorded(settings: OutcomeSlice, record: xr.Dataset, comparison: xr.Dataset) -> RecordedSteps:
    """The record and results of the mine's own runs in the steps that it covers. Raises InputError for another mine."""
    for name, one in (("record", record), ("comparison", comparison)):
        if one.attrs["mine"] != settings.mine:
            raise InputError(f"plans: {name} is of mine {one.attrs['mine']}, not of {settings.mine}")
    runs = [read_run(run, settings.recorded_steps, settings.mine, has_states=False) for run in settings.recorded_runs]
    covered = [number for number, step in enumerate(settings.recorded_steps) if is_covered(record, step)]
    return RecordedSteps(
        record,
        tuple(settings.recorded_steps[number] for number in covered) if runs else (),
        known_until(record),
        float(comparison["cut"]),
        [[run[number] for number in covered] for run in runs],
        [run.kind for run in settings.recorded_runs],
    )


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


@dataclass(frozen=True)
class Factors:
    """Draws of the factor: ln of the part that all steps share (draw,) and of that of each step (step, draw).

    contains, lacks: those of CHANCE, CELLS, RECORD, ROCK and RUNS that it does; text: a sentence, empty without record.
    """

    common: NDArray
    own: NDArray
    contains: tuple[str, ...]
    lacks: tuple[str, ...]
    text: str = ""

    def of(self, period: NDArray, number: NDArray) -> NDArray:
        """The factor (draw,) of a period (step,) bool; number (step,): events by which its steps are weighed."""
        weights = number[period] + 1e-9  # without an event all steps weigh alike
        return np.exp(self.common) * ((weights / weights.sum()) @ np.exp(self.own[period]))


def find_factors(
    settings: OutcomeSlice,
    values: Mapping[str, NDArray],
    recorded: RecordedNumbers | None,
    counted: NDArray,
    draws: int,
    generator: np.random.Generator,
) -> Factors:
    """The factor of a plan; values: results of its runs (plans.layout); counted (step,): the steps that it is for."""
    kinds = np.array([run.kind for run in settings.runs])
    shared = values["shared_number"][:, counted].sum(axis=1)
    steps = len(settings.steps)
    common, own = np.zeros(draws), np.zeros((steps, draws))
    contains, lacks, text = [CHANCE], [], ""
    if np.sum(~np.isnan(values["number"][:, 0, 0])) < 2:
        lacks.append(RUNS)
    if recorded is not None and recorded.modelled.any() and recorded.recorded.size:
        ratio = step_ratios(recorded)
        common, tau = draw_ratio(*ratio, draws, generator)
        own = tau * generator.standard_normal((steps, draws))
        contains.append(RECORD)
        text = ratio_text(recorded, common)
    elif (kinds == COARSE).any():
        change = abs(np.log((shared[kinds == OWN][0] + 0.5) / (shared[kinds == COARSE][0] + 0.5)))
        half = max(SAFETY_FACTOR * change, np.log1p(MIN_ERROR_SHARE))
        common = half / norm.ppf(INTERVAL_95[1]) * generator.standard_normal(draws)
        contains.append(CELLS)
    else:
        lacks += [CELLS, RECORD]
    rock = _rock(shared[kinds == DRAW], shared[kinds == OWN][0], recorded if RECORD in contains else None)
    if rock is not None:
        shift, deviation, freedom = rock
        common = common + shift + deviation * generator.standard_t(freedom, draws)
        contains.append(ROCK)
    else:
        lacks.append(ROCK)
    return Factors(common, own, tuple(contains), tuple(lacks), text)


def _rock(draws: NDArray, own: float, recorded: RecordedNumbers | None) -> tuple[float, float, int] | None:
    """Mean and standard deviation of ln of the number (draw,) over that of the mine's own rock, for one more draw, and
    degrees of freedom. With a record: those of this ratio over the ratio of the recorded steps. Numbers count from the
    shared floor on."""
    if len(draws) < MIN_DRAWS:
        return None
    values = np.log((draws + 0.5) / (own + 0.5))
    if recorded is not None:
        if len(recorded.draws) != len(draws):
            return None
        # the record's ratio is that of the mine's own rock: other rock makes both, the plan and the recorded steps
        values -= np.log((recorded.draws.sum(axis=1) + 0.5) / (recorded.own + 0.5))
    return float(values.mean()), float(values.std(ddof=1) * np.sqrt(1.0 + 1.0 / len(draws))), len(draws) - 1


def step_ratios(recorded: RecordedNumbers) -> tuple[NDArray, NDArray]:
    """ln of recorded over modelled number of each step (step,), and its variance by chance; half an event more each.

    The variance is that of the number which the ratio of all steps makes expected: by its own number, a step with few
    events would count less because they are few.
    """
    number, modelled = recorded.recorded + 0.5, recorded.modelled.sum(axis=0) + 0.5
    mean = modelled / len(recorded.modelled)
    expected = mean * number.sum() / mean.sum()
    return np.log(number / mean), recorded.dispersion_index / expected + 1.0 / modelled


def draw_ratio(
    value: NDArray, variance: NDArray, draws: int, generator: np.random.Generator
) -> tuple[NDArray, NDArray]:
    """Draws of the mean mu (draw,) and scatter tau (draw,) of values (step,) that have these variances by chance.

    Value_j is normal about mu with the variance tau^2 + v_j. The prior of mu is uniform, that of tau half-normal.
    """
    total = SCATTERS[:, None] ** 2 + variance
    weight = 1.0 / total
    mean = (weight * value).sum(axis=1) / weight.sum(axis=1)
    log_posterior = -0.5 * (
        np.log(total).sum(axis=1)
        + np.log(weight.sum(axis=1))
        + (weight * (value - mean[:, None]) ** 2).sum(axis=1)
        + (SCATTERS / STEP_SCATTER) ** 2
    )
    index = generator.choice(len(SCATTERS), draws, p=np.exp(log_posterior - logsumexp(log_posterior)))
    spread = np.sqrt(1.0 / weight.sum(axis=1))[index]
    return mean[index] + spread * generator.standard_normal(draws), SCATTERS[index]


def ratio_text(recorded: RecordedNumbers, common: NDArray) -> str:
    """State the number of events recorded for each modelled one, in a sentence."""
    low, middle, high = np.exp(np.quantile(common, [INTERVAL_95[0], 0.5, INTERVAL_95[1]]))
    steps = len(recorded.recorded)
    return (
        f"In {steps} recorded step{'s' * (steps != 1)} {recorded.recorded.sum():.0f} events are recorded and "
        f"{recorded.modelled.mean(axis=0).sum():.0f} modelled. Numbers of the plans are multiplied by {middle:.2g} "
        f"({low:.2g} to {high:.2g})"
    )
