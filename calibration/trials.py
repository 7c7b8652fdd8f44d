"""Outputs of trials by term, what a record says of the same, and what finer cells change in them.

The catalogues of a trial differ in the settings with which events were extracted from its rock. Each is a run of its
own here, and of each dated step it has a potency, a number of events, places and sizes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.comparison import record_clusters
from catalogs.compare.exposure import Exposure
from catalogs.compare.locations import box_around, information_gain, location_errors
from catalogs.compare.sum_measures import potency_variance_factor
from catalogs.settings import DatedStep
from catalogs.sources.completeness import completeness
from catalogs.sources.sizes import log_potency
from common.errors import InputError

BOOTSTRAPS = 2000  # Resamplings of the record's potency.
POTENCY, NUMBER, PLACES, SIZES = TERMS = ("potency", "number", "places", "sizes")
MIN_DEVIATION = 1.0  # m, along each axis: places are never known better.
BOX_MARGIN = 3.0  # Deviations by which the box of uniform events is larger than what events take up.
AXES = 3
MIN_PAIRS = 2  # Pairs of runs on two sizes of cells that a scatter needs.


@dataclass(frozen=True)
class RecordedOutputs:
    """Outputs of the record, of each step in order.

    log_potency (step,) ln m3, covariance (step, step) of it; number (step,) of events above the common cut;
    dispersion_index: variance over mean of that number, at least 1; log_excess: ln of the mean of log10 potency above
    the cut; excess_error: its standard error.
    """

    log_potency: NDArray
    covariance: NDArray
    number: NDArray
    dispersion_index: float = 1.0
    log_excess: float = 0.0
    excess_error: float = 1.0


@dataclass(frozen=True)
class Places:
    """Places of recorded events above the cut: location (event, xyz) m, step (event,) by number.

    deviation (event,): standard deviation, m, along each axis of a recorded from a modelled place; error (event,): that
    of the record alone; box: corners (2, xyz), m, of the rock in which an event may lie anywhere.
    """

    location: NDArray
    step: NDArray
    deviation: NDArray
    error: NDArray
    box: NDArray

    @classmethod
    def of_events(cls, location: NDArray, step: NDArray, like: "Places", generator: np.random.Generator) -> "Places":
        """Places of modelled events, located with errors like those of a record."""
        if not len(like.error):
            return cls(location[:0], step[:0], like.deviation, like.error, like.box)
        index = generator.integers(len(like.error), size=len(location))
        error = like.error[index]
        moved = location + error[:, None] * generator.standard_normal(location.shape)
        return cls(moved, step, like.deviation[index], error, like.box)

    def gain(self, events: NDArray, step: int) -> float:
        """Mean information gain of modelled events (event, xyz) of a step at the recorded ones; 0 without these."""
        of_step = self.step == step
        if not of_step.any():
            return 0.0
        return float(information_gain(self.location[of_step], events, self.deviation[of_step], self.box).mean())


class Outputs:
    """Outputs of runs: for each term an array (run, output of the term), and all of them in one array.

    potency: ln m3 by step. number: ln of events from the cut on, by step. places: mean information gain at recorded
    places, nats, by step. sizes: ln of the mean of log10 potency above the cut, one output.
    """

    def __init__(self, by_term: dict[str, NDArray]):
        self.by_term = {term: by_term[term] for term in TERMS if term in by_term}

    @property
    def all(self) -> NDArray:
        """(run, output), the terms in the order of TERMS."""
        return np.concatenate(list(self.by_term.values()), axis=1)

    @property
    def columns(self) -> dict[str, slice]:
        """Columns of each term in `all`."""
        ends = np.cumsum([values.shape[1] for values in self.by_term.values()])
        starts = np.concatenate([[0], ends[:-1]])
        return {term: slice(int(a), int(b)) for term, a, b in zip(self.by_term, starts, ends, strict=True)}

    def of_runs(self, runs: slice | NDArray) -> "Outputs":
        """Outputs of these runs only."""
        return Outputs({term: values[runs] for term, values in self.by_term.items()})


@dataclass(frozen=True)
class Discrepancy:
    """Error of the model itself: standard deviations of an output of a step.

    common: that of an error which all steps share, such as that of the cells; own: that of an independent error of each
    step.
    """

    common: float = 0.0
    own: float = 0.0

    def covariance(self, steps: int) -> NDArray:
        """Covariance (step, step) of the errors of so many steps."""
        return np.full((steps, steps), self.common**2) + self.own**2 * np.eye(steps)

    def with_own(self, other: float) -> "Discrepancy":
        """Discrepancy with a further independent error of each step added, as the root of the sum of squares."""
        return Discrepancy(self.common, float(np.hypot(self.own, other)))


@dataclass(frozen=True)
class CellCorrection:
    """Correction of trials for their cells: shift (output,) that finer cells add to the outputs; errors, by term."""

    shift: NDArray
    errors: dict[str, Discrepancy] = field(default_factory=dict)

    @classmethod
    def none(cls, trials: Outputs) -> "CellCorrection":
        """No correction, for trials on the cells of the mine."""
        return cls(np.zeros(trials.all.shape[1]))

    @classmethod
    def of(cls, trials: Outputs, finer: Outputs, pairs: int) -> "CellCorrection":
        """The correction that trials run on both cells give: mean differences, and the scatter of the differences.

        The scatter of a run's mean over its steps is an error that all steps share, the rest is each step's own. pairs:
        number of trials, each of as many rows: rows of one rock are one pair.
        """
        shifts, errors = [], {}
        for term, coarse in trials.by_term.items():
            difference = (finer.by_term[term] - coarse).reshape(pairs, -1, coarse.shape[1]).mean(axis=1)
            mean = difference.mean(axis=0)
            off = difference - mean
            widened = np.sqrt(1.0 + 1.0 / pairs)  # the mean itself is known from these pairs only
            common = off.mean(axis=1).std(ddof=1) * widened if pairs >= MIN_PAIRS else 0.0
            own = np.sqrt(np.mean((off - off.mean(axis=1, keepdims=True)) ** 2) * pairs / max(pairs - 1, 1)) * widened
            shifts.append(mean)
            errors[term] = Discrepancy(float(common), float(own))
        return cls(np.concatenate(shifts), errors)

    def during(self, share: NDArray, trials: Outputs) -> "CellCorrection":
        """Correction that also scales potency and number by the share (step,) of each step that is recorded."""
        shift = self.shift.copy()
        for term in (POTENCY, NUMBER):
            shift[trials.columns[term]] += np.log(share)
        return CellCorrection(shift, self.errors)


def common_cut(catalogues: Sequence[xr.Dataset], record: xr.Dataset) -> float:
    """log10 potency (m3) from which every trial and the record are complete."""
    sizes = log_potency(record["potency"].values[record["resolved"].values == 1])
    floors = [float(one.attrs["potency_floor"]) for one in catalogues]
    floors = [float(log_potency(floor)) for floor in floors if np.isfinite(floor)]
    return float(np.nanmax([completeness(sizes), *floors]))


def counted_events(events: xr.Dataset, steps: Sequence[str], cut: float) -> tuple[NDArray, NDArray]:
    """Location (event, xyz) and number of the step (event,) of the resolved events of these steps from the cut on."""
    step = np.full(events.sizes["event"], -1)
    for index, name in enumerate(steps):
        step[events["step"].values == name] = index
    used = (events["resolved"].values == 1) & (log_potency(events["potency"].values) >= cut) & (step >= 0)
    return events["location"].values[used], step[used]


def gains(catalogues: Sequence[xr.Dataset], steps: Sequence[str], cut: float, places: Places) -> NDArray:
    """Mean information gain of each catalogue at recorded places, nats, (run, step)."""
    gain = np.zeros((len(catalogues), len(steps)))
    for run, events in enumerate(catalogues):
        location, step = counted_events(events, steps, cut)
        for index in range(len(steps)):
            gain[run, index] = places.gain(location[step == index], index)
    return gain


def outputs(
    catalogues: Sequence[xr.Dataset], steps: Sequence[str], cut: float, terms: Sequence[str], places: Places | None
) -> Outputs:
    """Outputs of catalogues: potency and number always, the other terms where they count.

    A step without potency counts as the smallest resolvable event, one without events as half an event. One event a
    decade above the cut is added to the sizes, so that a run without events has some.
    """
    shape = (len(catalogues), len(steps))
    values = {POTENCY: np.zeros(shape), NUMBER: np.zeros(shape)}
    values |= {PLACES: gains(catalogues, steps, cut, places)} if PLACES in terms and places is not None else {}
    values |= {SIZES: np.zeros((len(catalogues), 1))} if SIZES in terms else {}
    for run, events in enumerate(catalogues):
        size, step = events["potency"].values, events["step"].values
        x = log_potency(size)
        counted = (events["resolved"].values == 1) & (x >= cut)
        for index, name in enumerate(steps):
            values[POTENCY][run, index] = size[step == name].sum()
            values[NUMBER][run, index] = np.count_nonzero(counted & (step == name))
        if SIZES in terms:
            excess = x[counted & np.isin(step, list(steps))] - cut
            values[SIZES][run, 0] = np.log((excess.sum() + 1.0) / (len(excess) + 1.0))
    values[POTENCY] = np.log(np.maximum(values[POTENCY], 10.0**cut))
    values[NUMBER] = np.log(np.maximum(values[NUMBER], 0.5))
    return Outputs(values)


def read_record(
    record: xr.Dataset, exposure: Exposure, cut: float, seed: int, terms: Sequence[str] = (POTENCY,)
) -> RecordedOutputs:
    """Outputs of the record in each dated step, with a covariance of potency by bootstrap of its events.

    Events of a day are drawn together in effect: the variance is raised by the dispersion of their numbers. A step
    without recorded potency counts as the cut where potency is no term. Raises InputError where it is one.
    """
    step, potency = exposure.step(record["time"].values), record["potency"].values
    used = (step >= 0) & (record["resolved"].values == 1)
    clusters = record_clusters(record, used, step)
    dispersion_index = exposure.dispersion_index(record["time"].values[used], clusters[used])
    counted = used & (log_potency(potency) >= cut)
    generator, steps = np.random.default_rng(seed), len(exposure.start)
    logs, variances = np.zeros(steps), np.zeros(steps)
    for index in range(steps):
        sizes = potency[(step == index) & np.isfinite(potency)]
        if not sizes.sum() > 0.0 and POTENCY not in terms:
            logs[index], variances[index] = cut * np.log(10.0), 1.0
            continue
        if not sizes.sum() > 0.0:
            raise InputError(
                f"record: no potency in dated step number {index + 1}; calibrate to steps with recorded events, or "
                "leave potency out of calibration.terms"
            )
        logs[index] = np.log(sizes.sum())
        drawn = generator.poisson(1.0, (BOOTSTRAPS, len(sizes))) @ sizes  # numbers vary as well as sizes
        drawn = drawn[drawn > 0.0]
        variances[index] = np.log(drawn).var() * potency_variance_factor(sizes, dispersion_index)
    number = np.array([np.count_nonzero(counted & (step == index)) for index in range(steps)])
    excess = log_potency(potency[counted]) - cut
    return RecordedOutputs(logs, np.diag(variances), number, dispersion_index, *mean_excess(excess))


def mean_excess(excess: NDArray) -> tuple[float, float]:
    """ln of the mean of sizes above the cut (event,), log10 potency, one decade added as in `outputs`; its error.

    Of a power law that mean is 1 / (b ln 10), with a standard error of 1 / sqrt(number) of itself.
    """
    number = len(excess) + 1.0
    return float(np.log((excess.sum() + 1.0) / number)), float(1.0 / np.sqrt(number))


def covered(exposure: Exposure, steps: Sequence[DatedStep]) -> NDArray:
    """Share of each dated step (step,) during which the record was taken. Raises InputError for a step without any."""
    whole = Exposure.of(tuple(steps), None)
    share = (exposure.end - exposure.start) / (whole.end - whole.start)
    for step, part in zip(steps, share, strict=True):
        if not part > 0.0:
            raise InputError(
                f"record: covers nothing of step {step.name}; calibrate to a mine file whose dated steps are recorded, "
                "or mine this step without dates"
            )
    return np.asarray(share, float)


def read_places(record: xr.Dataset, exposure: Exposure, cut: float, catalogues: Sequence[xr.Dataset]) -> Places:
    """Places of recorded events of dated steps above the cut, to be compared with these catalogues."""
    step = exposure.step(record["time"].values)
    location = record["location"].values
    used = (step >= 0) & (record["resolved"].values == 1) & (log_potency(record["potency"].values) >= cut)
    used &= np.isfinite(location).all(axis=1)
    own = [float(one.attrs["location_error"]) for one in catalogues]
    modelled = max((error for error in own if np.isfinite(error)), default=0.0)
    error = location_errors(record)[used] / np.sqrt(AXES)
    deviation = np.maximum(np.hypot(error, modelled / np.sqrt(AXES)), MIN_DEVIATION)
    every = [location[used], *(one["location"].values for one in catalogues)]
    box = box_around(*every, margin=BOX_MARGIN * float(deviation.max(initial=MIN_DEVIATION)))
    return Places(location[used], step[used], deviation, error, box)


def nothing_fails_before_record(catalogues: Sequence[xr.Dataset]) -> bool:
    """True if no rock fails before the record in any of the trials, as where cells do not resolve its openings."""
    return all(float(one.attrs["potency_before_record"]) == 0.0 for one in catalogues)
