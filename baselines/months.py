"""The record predicts itself: maps and numbers of a month's events, from what was known before the month.

All maps are in plan and smoothed in the same way, so that they differ in where their events are and in nothing else. A
record is moved with the face: each earlier event keeps its place relative to the face of its own time, and is put where
the face stands at some time of the month. The times are spread evenly over the month. Without a face events stay where
they are.

The number of a month follows from earlier ones by metres of the face or by days: a rate is the earlier number over the
earlier metres or days. The test is the N test of forecasts with the chance of both numbers: counts are Poisson numbers
of equal groups of events (catalogs.compare.exposure.total_ratio), whose size is the dispersion index of the record up
to the end of the month. A month alone holds too few clusters to know it from.
"""

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from baselines.map_scores import MIN_CLUSTERS, MapScores, coarser_clusters
from baselines.models import Counted, ModelComparison, run_gains
from baselines.settings import BaselineReportSlice
from catalogs.compare.blocks import cluster_labels
from catalogs.compare.exposure import DAY, Exposure, Total, common_period, total_ratio
from catalogs.compare.face import Face
from catalogs.compare.locations import UNIFORM_SHARE, information_gain, location_errors
from catalogs.sources.jackknife import effective_blocks
from catalogs.sources.sizes import log_potency

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0  # Its multiples, less their whole part, fill 0 to 1 evenly at any number.
TIMES_IN_STEP = 200  # Times of a step at which the face is looked at.
PLACES_ON_LINE = 41
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

    recorded: events of the dated steps that count, with their step and cluster (event,) and the standard deviation of
    their place along each axis, deviation (event,), m; record: all events that count, earlier ones too; box (2, xy): of
    the uniform rate; models: by label, the pipeline's own first.
    """

    recorded: Places
    step: NDArray
    cluster: NDArray
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

    def scores(self, share: float = UNIFORM_SHARE, error: float = 1.0) -> MapScores:
        """Gain of each map. share: of the uniform rate; error: factor of the location error."""
        scaled = replace(self, deviation=self.deviation * error)
        runs = {label: model.runs for label, model in self.models.items()}
        runs["mixed"] = next(iter(runs.values()), 1)
        gains = {label: np.full((runs.get(label, 1), len(self.step)), np.nan) for label in self.labels}
        for step in np.unique(self.step):
            own = self.step == step
            for label, gain in scaled._of_step(int(step), own, share).items():
                gains[label][:, own] = gain
        return MapScores(tuple(gains), tuple(gains.values()), self.step, self.cluster)

    def _of_step(self, step: int, own: NDArray, share: float) -> dict[str, NDArray]:
        """Gain of each map that has a forecast at the events of one step (run, event), by label."""
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
            gains[label] = run_gains(model, place, np.full(len(place), step), deviation, self.box, share)
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
        return gains


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
    """Number expected of a step by earlier periods, and the p-value of the recorded one (N test); NaN where unknown."""

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
    period = Exposure(periods.start, periods.end).step(record.time)
    numbers = np.array([np.count_nonzero(period == one) for one in range(len(amounts))])
    clusters = cluster_labels(record.time, record.place, period)
    rows = []
    for step in range(len(periods.start) - periods.before):
        own = periods.before + step
        counted = (period >= 0) & (period <= own)
        sizes = np.unique(coarser_clusters(clusters[counted], record.time[counted]), return_counts=True)[1]
        known = Exposure(periods.start[: own + 1], periods.end[: own + 1])
        dispersion = known.dispersion_index(record.time, clusters)
        dispersion = dispersion if effective_blocks(sizes) >= MIN_CLUSTERS else np.nan

        def rates(first: int, own: int = own, dispersion: float = dispersion) -> dict[str, Rate]:
            return {
                measure: n_test(
                    int(numbers[own]),
                    amounts[own][measure],
                    int(numbers[first:own].sum()),
                    float(sum(one[measure] for one in amounts[first:own])),
                    dispersion,
                )
                for measure in MEASURES
            }

        potency = float(record.potency[period == own].sum())
        rows.append(StepRates(amounts[own], int(numbers[own]), potency, rates(0), rates(max(own - 1, 0))))
    return rows


def n_test(number: int, amount: float, earlier: int, earlier_amount: float, dispersion: float = 1.0) -> Rate:
    """The number expected of an amount (metres, days) after an earlier number of an earlier amount, and the chance of
    one as far from it: the N test of forecasts (Zechar et al. 2010), which here includes the chance of both numbers.

    dispersion: dispersion index of both numbers; NaN: there are too few independent clusters, and no p-value.
    """
    if not (earlier_amount > 0.0 and amount > 0.0 and earlier > 0):
        return Rate(np.nan, np.nan)
    scale = amount / earlier_amount
    if not np.isfinite(dispersion):
        return Rate(earlier * scale, np.nan)
    ratio = total_ratio(Total(float(number), dispersion), Total(earlier * scale, dispersion * scale))
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
    scores: MapScores
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
        models.scores.cluster,
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
