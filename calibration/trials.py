"""Outputs of trials by term, what a record says of the same, and what finer cells change in them.

The catalogues of a trial differ in the settings with which events were extracted from its rock. Each is a run of its
own here, and of each dated step it has a potency, a number of events, places and sizes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from calibration.recorded import mean_excess
from calibration.settings import INSTRUMENTS
from catalogs.compare.exposure import Exposure
from catalogs.compare.locations import box_around, information_gain, location_errors
from catalogs.sources.completeness import next_edge, rounding
from catalogs.sources.sizes import log_potency

POTENCY, NUMBER, PLACES, SIZES = ("potency", "number", "places", "sizes")
TERMS = (POTENCY, NUMBER, PLACES, SIZES, INSTRUMENTS)
MEAN_POTENCY = "mean potency"  # Potency over number: what potency says beside the number.
MIN_DEVIATION = 1.0  # m, along each axis: places are never known better.
BOX_MARGIN = 3.0  # Deviations by which the box of uniform events is larger than what events take up.
AXES = 3
MIN_EVENTS = 10  # Modelled events of a step whose density is compared with that of other runs.
SAMPLES = 8  # Of the events of a run, over which its gain is averaged.
SEED = 1  # Of these samples.
MIN_PAIRS = 2  # Pairs of runs on two sizes of cells that a scatter needs.


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
    places, nats, by step. sizes: ln of the mean of log10 potency above the cut, one output. instruments: scores of what
    the model gives at the readings (calibration.instruments). Without steps there is none of a catalogue.
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
    """Correction of trials for their cells: shift (output,) that finer cells add to the outputs; errors, by term.

    scatter: standard deviation (output of the term,) of the error of each output of instruments, whose errors are not
    alike as those of the steps of a catalogue. share (step,): recorded part of each step, which is in the shift.
    """

    shift: NDArray
    errors: dict[str, Discrepancy] = field(default_factory=dict)
    scatter: NDArray | None = None
    share: NDArray | None = None

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
        shifts, errors, scatter = [], {}, None
        differences = {term: finer.by_term[term] - coarse for term, coarse in trials.by_term.items()}
        shifted = list(differences)
        if POTENCY in differences and NUMBER in differences:
            differences[MEAN_POTENCY] = differences[POTENCY] - differences[NUMBER]
        for term, of_rows in differences.items():
            if not of_rows.shape[1]:  # no record counts
                continue
            difference = of_rows.reshape(pairs, -1, of_rows.shape[1]).mean(axis=1)
            mean = difference.mean(axis=0)
            off = difference - mean
            widened = np.sqrt(1.0 + 1.0 / pairs)  # the mean itself is known from these pairs only
            if term == INSTRUMENTS:
                shifts.append(mean)
                scatter = off.std(axis=0, ddof=1) * widened if pairs >= MIN_PAIRS else None
                continue
            common = off.mean(axis=1).std(ddof=1) * widened if pairs >= MIN_PAIRS else 0.0
            own = np.sqrt(np.mean((off - off.mean(axis=1, keepdims=True)) ** 2) * pairs / max(pairs - 1, 1)) * widened
            if term in shifted:
                shifts.append(mean)
            errors[term] = Discrepancy(float(common), float(own))
        return cls(np.concatenate(shifts), errors, scatter)

    def during(self, share: NDArray, trials: Outputs) -> "CellCorrection":
        """Correction that also scales potency and number by the share (step,) of each step that is recorded."""
        shift = self.shift.copy()
        for term in (POTENCY, NUMBER):
            shift[trials.columns[term]] += np.log(share)
        return CellCorrection(shift, self.errors, self.scatter, share)


def common_cut(catalogues: Sequence[xr.Dataset], complete_above: float, sizes: NDArray) -> float:
    """log10 potency (m3) from which every trial and the record are complete; complete_above: that of the record.

    sizes (event,): of the record, log10 m3. If they are rounded, the cut is the lower edge of a bin: of the one that
    holds complete_above, or of the next one above the trials' floors.
    """
    width, floors = rounding(sizes), [float(one.attrs["potency_floor"]) for one in catalogues]
    own = next_edge(sizes, complete_above - (1.0 - 1e-3) * width, width)
    return max([own, *(next_edge(sizes, float(log_potency(one)), width) for one in floors if np.isfinite(one))])


def counted_sizes(catalogues: Sequence[xr.Dataset], steps: Sequence[str], cut: float) -> NDArray:
    """log10 potency (event,) of the resolved events of all catalogues in these steps from the cut on."""
    found = [np.empty(0)]
    for events in catalogues:
        x = log_potency(events["potency"].values)
        found.append(x[(events["resolved"].values == 1) & (x >= cut) & np.isin(events["step"].values, list(steps))])
    return np.concatenate(found)


def counted_events(events: xr.Dataset, steps: Sequence[str], cut: float) -> tuple[NDArray, NDArray]:
    """Location (event, xyz) and number of the step (event,) of the resolved events of these steps from the cut on."""
    step = np.full(events.sizes["event"], -1)
    for index, name in enumerate(steps):
        step[events["step"].values == name] = index
    used = (events["resolved"].values == 1) & (log_potency(events["potency"].values) >= cut) & (step >= 0)
    return events["location"].values[used], step[used]


def gains(catalogues: Sequence[xr.Dataset], steps: Sequence[str], cut: float, places: Places) -> NDArray:
    """Mean information gain of each catalogue at recorded places, nats, (run, step).

    The smoothed density of many events predicts places better than that of few of the same law, and would favour runs
    with more events. So each step has one number of events for all runs, that of the run with fewest, or MIN_EVENTS:
    the gain of a run with more is the mean over SAMPLES drawn from its events.
    """
    generator, gain = np.random.default_rng(SEED), np.zeros((len(catalogues), len(steps)))
    counted = [counted_events(events, steps, cut) for events in catalogues]
    for index in range(len(steps)):
        by_run = [location[step == index] for location, step in counted]
        common = max(MIN_EVENTS, min((len(location) for location in by_run), default=0))
        for run, location in enumerate(by_run):
            samples = [location]
            if len(location) > common:
                samples = [generator.choice(location, common, replace=False) for _ in range(SAMPLES)]
            gain[run, index] = np.mean([places.gain(sample, index) for sample in samples])
    return gain


def outputs(
    catalogues: Sequence[xr.Dataset], steps: Sequence[str], cut: float, places: Places | None = None
) -> Outputs:
    """Outputs of catalogues: potency, number and sizes always, places where they count.

    A step without potency counts as the smallest resolvable event, one without events as half an event. One event a
    decade above the cut is added to the sizes, so that a run without events has some.
    """
    shape = (len(catalogues), len(steps))
    values = {POTENCY: np.zeros(shape), NUMBER: np.zeros(shape)}
    values |= {PLACES: gains(catalogues, steps, cut, places)} if places is not None else {}
    values[SIZES] = np.zeros((len(catalogues), min(len(steps), 1)))
    for run, events in enumerate(catalogues):
        size, step = events["potency"].values, events["step"].values
        x = log_potency(size)
        counted = (events["resolved"].values == 1) & (x >= cut)
        for index, name in enumerate(steps):
            values[POTENCY][run, index] = size[step == name].sum()
            values[NUMBER][run, index] = np.count_nonzero(counted & (step == name))
        values[SIZES][run] = mean_excess(x[counted & np.isin(step, list(steps))] - cut)
    values[POTENCY] = np.log(np.maximum(values[POTENCY], 10.0**cut))
    values[NUMBER] = np.log(np.maximum(values[NUMBER], 0.5))
    return Outputs(values)


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
