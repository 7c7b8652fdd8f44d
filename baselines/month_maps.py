"""Maps of a month's events, from what was known before the month.

All maps are in plan and smoothed in the same way, so that they differ in where their events are and in nothing else. A
record is moved with the face: each earlier event keeps its place relative to the face of its own time, and is put where
the face stands at some time of the month. The times are spread evenly over the month. Without a face events stay where
they are.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.map_scores import CEILING, MapScores
from baselines.models import Counted
from catalogs.compare.exposure import DAY
from catalogs.compare.face import Face
from catalogs.compare.locations import UNIFORM_SHARE, information_gain

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0  # Its multiples, less their whole part, fill 0 to 1 evenly at any number.
TIMES_IN_STEP = 200  # Times of a step at which the face is looked at.
PLACES_ON_LINE = 41
MODEL_SHARE = 0.5  # Of the pipeline's own model in its mixture with the record.
PRIOR_MODEL, PRIOR_LINE = "record_and_model", "record_and_line"  # the record joined with a prior map
PRIOR_NAMES = {
    PRIOR_MODEL: "all earlier months, with the pipeline as a prior",
    PRIOR_LINE: "all earlier months, with the line of the face as a prior",
}
PRIOR_EVENTS = np.array([1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0])
FIRST_PRIOR_EVENTS = 50.0  # before a step has shown what a prior is worth
ERROR_FACTOR = 2.0  # By which the table of nuisances changes the location error, either way.


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


def prior_share(worth: ArrayLike, count: ArrayLike) -> NDArray:
    """Share of a prior map that is worth so many events beside a record of `count` events."""
    return np.asarray(worth / (np.asarray(worth) + np.asarray(count)))


def times_with_face(face: Face, start: np.datetime64, end: np.datetime64) -> NDArray:
    """Times of a step, the middles of equal parts of it, at which a face stands."""
    time = start + (end - start) // (2 * TIMES_IN_STEP) * (2 * np.arange(TIMES_IN_STEP) + 1)
    return time[np.isfinite(face.at(time).ahead).all(axis=1)]


def spans_of_face(face: Face | None, start: np.datetime64, end: np.datetime64) -> NDArray:
    """Start and end (span, 2) of the parts of a step in which a face stands; all of it where the mine has none."""
    if face is None:
        return np.array([[start, end]])
    times, half = times_with_face(face, start, end), (end - start) // (2 * TIMES_IN_STEP)
    parts = np.split(times, np.flatnonzero(np.diff(times) > 3 * half) + 1)
    return np.array([[one[0] - half, one[-1] + half] for one in parts if len(one)], times.dtype).reshape(-1, 2)


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
    the uniform rate; models: by label, the pipeline's own first; prior_events (step,): number of recorded events that a
    prior map is worth in each step, by label of the mixture (`with_learned_priors`).
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
    prior_events: Mapping[str, NDArray] = field(default_factory=dict)

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
            **({label: PRIOR_NAMES[label] for label in self.prior_events}),
            CEILING: "ceiling: odd days predict even ones, and these odd ones",
        }
        return names if self.models else {key: name for key, name in names.items() if key != "mixed"}

    @property
    def runs(self) -> dict[str, int]:
        """Number of runs of each map; a map without mechanics has one."""
        counts = {label: model.runs for label, model in self.models.items()}
        counts["mixed"] = counts[PRIOR_MODEL] = next(iter(counts.values()), 1)
        return {label: counts.get(label, 1) for label in self.labels}

    def window(self, step: int) -> tuple[np.datetime64, np.datetime64]:
        """Start and end of a dated step."""
        number = self.periods.before + step
        return self.periods.start[number], self.periods.end[number]

    def points(self, step: int) -> dict[str, list[NDArray]]:
        """Points of each map that has a forecast of a step, by label: an array (point, xy), m, for each of its runs.

        A run without a point is uniform. Mixtures of maps have no points of their own (`mixtures`).
        """
        number, (start, end) = self.periods.before + step, self.window(step)
        found: dict[str, list[NDArray]] = {}

        def add_earlier(label: str, first: np.datetime64) -> None:
            known = self.record.between(first, start)
            places = known.place if self.face is None else move(known, self.face, start, end)
            if len(places):
                found[label] = [places]

        if number:
            add_earlier("all_earlier", self.periods.start[0])
            add_earlier("last", self.periods.start[number - 1])
        if self.face is not None and len(line := line_places(self.face, start, end)):
            found["line"] = [line]
        for label, model in self.models.items():
            own = model.step == step
            found[label] = [model.place[own & (model.run == run)][:, :2] for run in range(model.runs)]
        return found

    def mixtures(self, step: int, points: Mapping[str, list[NDArray]]) -> dict[str, tuple[str, str, float]]:
        """Maps that are made of two others with a forecast of a step: labels of these, and the share of the first."""
        if "all_earlier" not in points:
            return {}
        found = {"mixed": (next(iter(self.models)), "all_earlier", MODEL_SHARE)} if self.models else {}
        for label, worth in self.prior_events.items():
            prior = self.prior_of(label)
            if prior in points and np.isfinite(worth[step]):
                share = prior_share(worth[step], len(points["all_earlier"][0]))
                found[label] = (prior, "all_earlier", float(share))
        return found

    def prior_of(self, label: str) -> str:
        """Label of the map that is the prior of a mixture."""
        return "line" if label == PRIOR_LINE else next(iter(self.models), "")

    def with_learned_priors(self) -> "MonthMaps":
        """The same maps, and the record joined with the pipeline's map, and with the line of the face, as a prior.

        A prior is worth a number of recorded events. In each step it is that of PRIOR_EVENTS under which the events of
        the steps before it were most probable, and FIRST_PRIOR_EVENTS where there is none before.
        """
        labels = ([PRIOR_MODEL] if self.models else []) + ([PRIOR_LINE] if self.face is not None else [])
        gains = dict(zip(self.labels, self.scores().gains, strict=True))
        steps = len(self.periods.start) - self.periods.before
        known = {int(step): self.points(int(step)).get("all_earlier", []) for step in np.unique(self.step)}
        count = np.array([sum(map(len, known[int(step)])) for step in self.step])
        worth = {}
        for label in labels:
            prior, record = gains[self.prior_of(label)], gains["all_earlier"]
            share = prior_share(PRIOR_EVENTS[:, None, None], np.maximum(count, 1))
            with np.errstate(invalid="ignore"):  # NaN where there is no forecast
                mixed = np.logaddexp(np.log(share) + prior, np.log1p(-share) + record).mean(axis=1)
            total = np.array([np.nansum(mixed[:, self.step < step], axis=1) for step in range(steps)])
            seen = np.array([np.isfinite(mixed[:, self.step < step]).any() for step in range(steps)])
            worth[label] = np.where(seen, PRIOR_EVENTS[total.argmax(axis=1)], FIRST_PRIOR_EVENTS)
        return replace(self, prior_events=worth)

    def scores(self, share: float = UNIFORM_SHARE, error: float = 1.0) -> MapScores:
        """Gain of each map. share: of the uniform rate; error: factor of the location error."""
        scaled = replace(self, deviation=self.deviation * error)
        gains = {label: np.full((runs, len(self.step)), np.nan) for label, runs in self.runs.items()}
        for step in np.unique(self.step):
            own = self.step == step
            for label, gain in scaled._of_step(int(step), own, share).items():
                gains[label][:, own] = gain
        return MapScores(tuple(gains), tuple(gains.values()), self.step, self.cluster)

    def _of_step(self, step: int, own: NDArray, share: float) -> dict[str, NDArray]:
        """Gain of each map that has a forecast at the events of one step (run, event), by label."""
        start, _ = self.window(step)
        place, deviation, points = self.recorded.place[own], self.deviation[own], self.points(step)
        gains = {
            label: np.array([information_gain(place, run, deviation, self.box, share) for run in runs])
            for label, runs in points.items()
        }
        for label, (one, other, part) in self.mixtures(step, points).items():
            gains[label] = np.logaddexp(np.log(part) + gains[one], np.log1p(-part) + gains[other])
        day = (self.recorded.time[own] - start) // DAY + 1  # the step begins with day 1
        is_odd = day % 2 == 1
        ceiling = np.full(len(place), np.nan)
        if is_odd.any() and not is_odd.all():
            for half in (is_odd, ~is_odd):
                ceiling[half] = information_gain(place[half], place[~half], deviation[half], self.box, share)
        gains[CEILING] = ceiling
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
