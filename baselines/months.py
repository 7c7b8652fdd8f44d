"""The record predicts itself: maps and numbers of a month's events, from what was known before the month.

All maps are in plan and smoothed in the same way, so that they differ in where their events are and in nothing else. A
record is moved with the face: each earlier event keeps its place relative to the face of its own time, and is put where
the face stands at some time of the month. The times are spread evenly over the month. Without a face events stay where
they are.

The number of a month follows from earlier ones by metres of the face or by days: a rate is the earlier number over the
earlier metres or days. The test is the number test of forecasts with the chance of both numbers: counts are Poisson
numbers of equal groups of events, whose size is the dispersion index of the record
(catalogs.compare.exposure.total_ratio). So the p-values of months that fit are uniform between 0 and 1.
"""

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import t

from baselines.models import Counted, ModelComparison
from baselines.settings import BaselineReportSlice
from catalogs.compare.blocks import MIN_BLOCKS, cluster_labels
from catalogs.compare.exposure import DAY, Exposure, Total, common_period, total_ratio
from catalogs.compare.face import Face
from catalogs.compare.locations import UNIFORM_SHARE, information_gain, location_errors
from catalogs.sources.jackknife import INTERVAL_95, effective_blocks
from catalogs.sources.sizes import log_potency

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0  # Its multiples, less their whole part, fill 0 to 1 evenly at any number.
TIMES_IN_STEP = 200  # Times of a step at which the face is looked at.
PLACES_ON_LINE = 41
DAYS_IN_BLOCK = 7
MODEL_SHARE = 0.5  # Of the pipeline's own model in its mixture with the record.
ERROR_FACTOR = 2.0  # By which the table of nuisances changes the location error, either way.
MEASURES = ("metres", "days")  # A rate is a number of events per one of these.


@dataclass(frozen=True)
class Places:
    """Recorded events that count: time (event,) ns, place in plan (event, xy) m, potency (event,) m3."""

    time: NDArray
    place: NDArray
    potency: NDArray

    def between(self, start: np.datetime64, end: np.datetime64) -> "Places":
        """The events with start <= time < end."""
        inside = (self.time >= start) & (self.time < end)
        return Places(self.time[inside], self.place[inside], self.potency[inside])


@dataclass(frozen=True)
class Periods:
    """The time of a record in pieces, start and end (period,) ns: those before the first dated step, then the steps.

    Pieces before the first step are as long as the first step that is recorded.
    """

    start: NDArray
    end: NDArray
    before: int

    @classmethod
    def of(cls, start: NDArray, end: NDArray, since: np.datetime64 | None) -> "Periods":
        """Periods of the dated steps, and of the time before them back to `since`, in whole pieces as long as the
        first step of nonzero length.

        start, end (step,) datetime64; since: time from which on the record is known, None: from the first step on.
        """
        lengths = end - start
        piece = lengths[lengths > np.timedelta64(0, "ns")][0]
        count = 0 if since is None else int(max((start[0] - since) // piece, 0))
        edges = start[0] - piece * np.arange(count, -1, -1)
        return cls(np.concatenate([edges[:-1], start]), np.concatenate([edges[1:], end]), count)


def times_with_face(face: Face, start: np.datetime64, end: np.datetime64) -> NDArray:
    """Times of a step, the middles of equal parts of it, at which a face stands."""
    time = start + (end - start) // (2 * TIMES_IN_STEP) * (2 * np.arange(TIMES_IN_STEP) + 1)
    return time[np.isfinite(face.at(time).ahead).all(axis=1)]


def move(events: Places, face: Face, start: np.datetime64, end: np.datetime64) -> NDArray:
    """Places (event, xy), m, of earlier events in a step; without those that had no face, none if the step has none."""
    times = times_with_face(face, start, end)
    coordinates = face.at(events.time).coordinates(events.place)
    coordinates = coordinates[np.isfinite(coordinates).all(axis=1)]
    if not len(times):
        return np.zeros((0, 2))
    index = np.floor(np.arange(len(coordinates)) * GOLDEN % 1.0 * len(times)).astype(int)
    return face.at(times[index]).places(coordinates)


def line_places(face: Face, start: np.datetime64, end: np.datetime64) -> NDArray:
    """Places (place, xy), m, all along the face at all times of a step."""
    ends = face.at(times_with_face(face, start, end)).ends
    share = np.linspace(0.0, 1.0, PLACES_ON_LINE)[:, None, None]
    return (ends[:, 0] + share * (ends[:, 1] - ends[:, 0])).reshape(-1, 2)


@dataclass(frozen=True)
class MonthMaps:
    """Maps of the dated steps, and the recorded events that they are scored by.

    recorded: events of the dated steps that count, with their step (event,) and the standard deviation of their place
    along each axis, deviation (event,), m; record: all events that count, earlier ones too; box (2, xy): of the uniform
    rate; models: by label, the pipeline's own first.
    """

    recorded: Places
    step: NDArray
    deviation: NDArray
    record: Places
    periods: Periods
    face: Face | None
    box: NDArray
    models: dict[str, Counted]

    @property
    def labels(self) -> dict[str, str]:
        """Name of each map by its label; the order of all results."""
        moved = "moved with the face" if self.face else "as they are"
        names = {
            "all_earlier": f"all earlier months, {moved}",
            "last": f"last month, {moved}",
            **({"line": "line of the face"} if self.face else {}),
            **{label: label.lower() for label in self.models},
            "mixed": "all earlier months and the pipeline, half each",
            "ceiling": "ceiling: odd days predict even ones, and these odd ones",
        }
        return names if self.models else {key: name for key, name in names.items() if key != "mixed"}

    def scores(self, share: float = UNIFORM_SHARE, error: float = 1.0) -> "MonthScores":
        """Gain of each map. share: of the uniform rate; error: factor of the location error."""
        scaled = replace(self, deviation=self.deviation * error)
        gain = np.full((len(self.labels), len(self.step)), np.nan)
        for step in np.unique(self.step):
            own = self.step == step
            gain[:, own] = scaled._of_step(int(step), own, share)
        first = self.periods.start[self.periods.before]
        block = (self.recorded.time - first) // (DAYS_IN_BLOCK * DAY)
        return MonthScores(tuple(self.labels), gain, self.step, block.astype(int))

    def _of_step(self, step: int, own: NDArray, share: float) -> NDArray:
        """Gain of each map at the events of one step (map, event)."""
        number = self.periods.before + step
        start, end = self.periods.start[number], self.periods.end[number]
        place, deviation = self.recorded.place[own], self.deviation[own]

        def gain(events: NDArray) -> NDArray:
            if not len(events):
                return np.full(len(place), np.nan)
            return information_gain(place, events, deviation, self.box, share)

        def earlier(first: np.datetime64) -> NDArray:
            known = self.record.between(first, start)
            return known.place if self.face is None else move(known, self.face, start, end)

        gains = {}
        if number:
            gains["all_earlier"] = gain(earlier(self.periods.start[0]))
            gains["last"] = gain(earlier(self.periods.start[number - 1]))
        if self.face is not None:
            gains["line"] = gain(line_places(self.face, start, end))
        for label, model in self.models.items():
            gains[label] = information_gain(place, model.place[model.step == step][:, :2], deviation, self.box, share)
        if self.models and "all_earlier" in gains:
            parts = (
                np.log(MODEL_SHARE) + gains[next(iter(self.models))],
                np.log1p(-MODEL_SHARE) + gains["all_earlier"],
            )
            gains["mixed"] = np.logaddexp(*parts)
        day = (self.recorded.time[own] - start) // DAY + 1  # the step begins with day 1
        is_odd = day % 2 == 1
        ceiling = np.full(len(place), np.nan)
        if is_odd.any() and not is_odd.all():
            for half in (is_odd, ~is_odd):
                ceiling[half] = information_gain(place[half], place[~half], deviation[half], self.box, share)
        gains["ceiling"] = ceiling
        return np.array([gains.get(label, np.full(len(place), np.nan)) for label in self.labels])


@dataclass(frozen=True)
class MonthScores:
    """Gain of each map at recorded events (map, event), nats, NaN where a map has no forecast of the event's step; step
    and block of weeks of each event (event,)."""

    labels: tuple[str, ...]
    gain: NDArray
    step: NDArray
    block: NDArray

    @property
    def common(self) -> NDArray:
        """Events (event,) bool for which every map has a forecast, of the maps that have any: what all steps together
        are scored by."""
        any_forecast = np.isfinite(self.gain).any(axis=1)
        return np.isfinite(self.gain[any_forecast]).all(axis=0)

    def mean(self, step: int | None = None) -> NDArray:
        """Mean gain of each map (map,), nats per event, of one step or of those that all maps forecast; NaN without."""
        own = self._own(step)
        return self.gain[:, own].mean(axis=1) if own.any() else np.full(len(self.gain), np.nan)

    def interval(self, step: int | None = None) -> NDArray:
        """95 % interval of the mean gain (map, 2)."""
        own = self._own(step)
        return mean_interval(self.gain[:, own], self.block[own])

    def lead(self, one: str, other: str) -> tuple[float, NDArray]:
        """Mean gain of a map less that of another, nats per event, with its 95 % interval (2,)."""
        own = self.common
        rows = [self.labels.index(label) for label in (one, other)]
        difference = (self.gain[rows[0]] - self.gain[rows[1]])[None, own]
        mean = float(difference.mean()) if own.any() else np.nan
        return mean, mean_interval(difference, self.block[own])[0]

    def _own(self, step: int | None) -> NDArray:
        return self.common if step is None else self.step == step


def mean_interval(values: NDArray, block: NDArray) -> NDArray:
    """95 % interval (row, 2) of means of values (row, event) whose blocks (event,) are independent.

    The differences d between the mean without a block and the mean are squared and summed (catalogs.sources.jackknife).
    Student's t has the degrees of freedom of such a sum of squares, (sum d^2)^2 / sum d^4, at most those of the blocks:
    gains are skewed and blocks few, and the blocks alone make intervals that are too narrow. NaN with fewer than
    MIN_BLOCKS blocks, or where one has nearly all events.
    """
    labels = np.unique(block, return_inverse=True)[1].reshape(-1)
    count = np.bincount(labels) if len(labels) else np.zeros(0)
    worth = effective_blocks(count)
    if len(count) < MIN_BLOCKS or worth < 2.0:
        return np.full((len(values), 2), np.nan)
    sums = np.array([np.bincount(labels, row) for row in values])
    mean = values.mean(axis=1)
    squared = ((sums.sum(axis=1, keepdims=True) - sums) / (count.sum() - count) - mean[:, None]) ** 2
    total = squared.sum(axis=1)
    freedom = np.minimum(total**2 / np.maximum(np.sum(squared**2, axis=1), np.finfo(float).tiny), worth - 1.0)
    half = t.ppf(INTERVAL_95[1], np.maximum(freedom, 1.0)) * np.sqrt(total)
    return np.stack([mean - half, mean + half], axis=1)


def nuisances(maps: MonthMaps) -> list[tuple[str, NDArray]]:
    """Mean gain of each map (map,) for other uniform shares and location errors, with their names."""
    choices = {
        "as stated": {},
        "uniform share 1 %": {"share": 0.01},
        "uniform share 20 %": {"share": 0.2},
        "half the location error": {"error": 1.0 / ERROR_FACTOR},
        "twice the location error": {"error": ERROR_FACTOR},
    }
    return [(name, maps.scores(**choice).mean()) for name, choice in choices.items()]


@dataclass(frozen=True)
class Rate:
    """Number expected of a step by earlier periods, and the p-value of the recorded one; NaN where unknown."""

    expected: float
    p_value: float


@dataclass(frozen=True)
class StepRates:
    """Events of a step, and what earlier periods predict of their number.

    amount: metres (NaN without a face) and days; number; potency, m3; all_earlier, last: rates by each measure of all
    earlier periods and of the last one.
    """

    amount: dict[str, float]
    number: int
    potency: float
    all_earlier: dict[str, Rate]
    last: dict[str, Rate]


def step_rates(record: Places, periods: Periods, face: Face | None) -> list[StepRates]:
    """Numbers and rates of each dated step. Earlier days without a face do not count, nor do their events."""
    if face is not None:
        has_face = np.isfinite(face.at(record.time).ahead).all(axis=1)
        record = Places(record.time[has_face], record.place[has_face], record.potency[has_face])
    amounts = [_amount(face, start, end) for start, end in zip(periods.start, periods.end, strict=True)]
    inside = [record.between(start, end) for start, end in zip(periods.start, periods.end, strict=True)]
    numbers = np.array([len(one.time) for one in inside])
    clusters = cluster_labels(record.time, record.place, Exposure(periods.start, periods.end).step(record.time))
    rows = []
    for step in range(len(periods.start) - periods.before):
        own = periods.before + step
        every, last = np.arange(own), np.arange(own)[-1:]

        def rates(earlier: NDArray, own: int = own) -> dict[str, Rate]:
            now, before = (
                Exposure(periods.start[chosen], periods.end[chosen]).dispersion_index(record.time, clusters)
                for chosen in (np.array([own]), earlier)
            )
            return {
                measure: n_test(
                    int(numbers[own]),
                    amounts[own][measure],
                    int(numbers[earlier].sum()),
                    float(sum(amounts[one][measure] for one in earlier)),
                    (now, before),
                )
                for measure in MEASURES
            }

        potency = float(inside[own].potency.sum())
        rows.append(StepRates(amounts[own], int(numbers[own]), potency, rates(every), rates(last)))
    return rows


def n_test(
    number: int, amount: float, earlier: int, earlier_amount: float, dispersion: tuple[float, float] = (1.0, 1.0)
) -> Rate:
    """The number expected of an amount (metres, days) after an earlier number of an earlier amount, and the chance of
    one as far from it. dispersion: dispersion indices of the number and of the earlier one."""
    if not (earlier_amount > 0.0 and amount > 0.0 and earlier > 0):
        return Rate(np.nan, np.nan)
    scale = amount / earlier_amount
    ratio = total_ratio(Total(float(number), dispersion[0]), Total(earlier * scale, dispersion[1] * scale))
    return Rate(earlier * scale, ratio.p_value)


def _amount(face: Face | None, start: np.datetime64, end: np.datetime64) -> dict[str, float]:
    days = float((end - start) / DAY)
    if face is None:
        return {"metres": np.nan, "days": days}
    return {"metres": face.metres(start, end), "days": days * len(times_with_face(face, start, end)) / TIMES_IN_STEP}


@dataclass(frozen=True)
class Months:
    """Maps and rates of the dated steps, and the mean gains of the maps under other assumptions (nuisances)."""

    steps: tuple[str, ...]
    maps: MonthMaps
    scores: MonthScores
    rates: list[StepRates]
    nuisances: list[tuple[str, NDArray]]


def compare_with_months(
    models: ModelComparison, earlier: xr.Dataset, cell: float, settings: BaselineReportSlice
) -> Months:
    """Compare the dated steps with maps and rates of the months before them.

    earlier: the record from an earlier date on, or the record itself; cell: edge of the finest cells, m.
    """
    own = models.models[0].comparison
    exposure = Exposure.of(settings.comparison.steps, common_period(models.record))
    used, cut = own["record_used"].values == 1, float(own["cut"])
    counted = (earlier["resolved"].values == 1) & (log_potency(earlier["potency"].values) >= cut)
    common = common_period(earlier) if settings.since else None
    face = Face.of(settings.comparison.face) if settings.comparison.face else None
    maps = MonthMaps(
        _places(models.record, used),
        exposure.step(models.record["time"].values)[used],
        np.hypot(location_errors(models.record)[used], cell) / np.sqrt(3.0),
        _places(earlier, counted),
        Periods.of(exposure.start, exposure.end, np.datetime64(common[0], "ns") if common else None),
        face,
        np.array(settings.box),
        {model.label: model.counted for model in models.models},
    )
    return Months(models.steps, maps, maps.scores(), step_rates(maps.record, maps.periods, face), nuisances(maps))


def _places(events: xr.Dataset, chosen: NDArray) -> Places:
    """The events that `chosen` (event,) bool marks, in plan."""
    time = events["time"].values.astype("datetime64[ns]")
    return Places(time[chosen], events["location"].values[chosen][:, :2], events["potency"].values[chosen])
