"""The runs of a scene compared: errors, noise, the Pareto front, and lines of runs that differ by one knob."""

from collections import defaultdict
from collections.abc import Callable, Container
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from common.errors import InputError
from verification.studies import Study
from verification.tradeoff.knobs import KNOBS, SEISMIC, changed, label
from verification.tradeoff.measures import ITSELF, MEASURES, Limit, Measure, richardson
from verification.tradeoff.points import Point, Points
from workflow.accuracy import PRESETS, STANDARD

MIN_WORK = 0.1  # Less processor time cannot be told from the start of a process, s.
MIN_SPEEDUP = 1.05  # A run counts as faster from here on, however little repeated runs scatter.
MAX_CHEAP_CHANGE = 0.01  # Change of the main measure up to which a gain in speed is cheap, as a share.
MIN_ERROR_GAIN = 0.1  # Share by which an error has to be smaller before accuracy counts as gained.


def pareto_front(cost: ArrayLike, error: ArrayLike) -> NDArray[np.bool_]:
    """Points (point,) bool on the Pareto front: no other has at most their cost and error, and less of one of them.

    Equal points are all on the front. Points whose cost or error is not finite are not, and dominate no other.
    """
    cost, error = np.asarray(cost, float), np.asarray(error, float)
    front = np.zeros(len(cost), bool)
    usable = np.flatnonzero(np.isfinite(cost) & np.isfinite(error))
    best = np.inf  # Least error of all points that cost less.
    order = usable[np.lexsort((error[usable], cost[usable]))]
    for index in order:
        same = front & (cost == cost[index]) & (error == error[index])
        front[index] = error[index] < best or same.any()
        best = min(best, error[index])
    return front


@dataclass(frozen=True)
class Line:
    """Runs that differ by one knob alone, in the order of its values.

    anchor: the run with the base's value of the knob. beside: other settings that the whole line changes, in words.
    """

    knob: str
    members: list[Point]
    anchor: Point
    beside: str

    @property
    def others(self) -> list[Point]:
        """The members beside the anchor."""
        return [member for member in self.members if member is not self.anchor]


class SceneRuns:
    """A study's points and what follows from them. Raises InputError where its base or limit names no variant."""

    def __init__(self, study: Study, points: Points):
        self.study, self.points, self.exact = study, points.points, points.exact
        by_name = {point.variant: point for point in self.points}
        series = study.settings.get("limit", [])
        for name in [study.settings["base"], *series]:
            if name not in by_name:
                raise InputError(f"{study.name}: settings: no variant '{name}'; there are {', '.join(by_name)}")
        self.base = by_name[study.settings["base"]]
        self.series = [by_name[name] for name in series]
        self.main = MEASURES[study.settings["main"]]

    @property
    def start(self) -> float:
        """Upper bound of the processor time of a process's start, s: that of the quickest stage."""
        said = [point.least for point in self.points if np.isfinite(point.least)]
        return min(said, default=0.0)

    def work(self, point: Point) -> float:
        """Processor time of a run's stages less the starts of their processes, at least MIN_WORK, s.

        NaN where a log does not state it.
        """
        return float(np.maximum(MIN_WORK, point.seconds - point.stages * self.start))  # max() would drop a NaN

    @cached_property
    def noise(self) -> float:
        """Scatter of processor time: slowest over quickest run with the base's rock; NaN where there are no two."""
        repeats = self._works(self.base)
        return max(repeats) / min(repeats) if len(repeats) > 1 else np.nan

    @property
    def clear(self) -> float:
        """Speed over the base's from which a run counts as faster: beyond the noise, and at least MIN_SPEEDUP."""
        return float(np.fmax(MIN_SPEEDUP, self.noise))

    @cached_property
    def _of_rock(self) -> dict[tuple, list[Point]]:
        """Runs grouped by their rock: repeated runs share it, and those that differ only in how they count events."""
        return _grouped(self.points, _rock)

    def _works(self, point: Point) -> list[float]:
        """Work of all runs with the rock of this one whose logs state it."""
        return [work for same in self._of_rock[_rock(point)] if np.isfinite(work := self.work(same))]

    def cost(self, point: Point) -> float:
        """Cost by which a run is compared, s: the median work of all runs with its rock; NaN without one."""
        works = self._works(point)
        return float(np.median(works)) if works else np.nan

    @property
    def measures(self) -> list[Measure]:
        """Measures that the runs have."""
        return [measure for key, measure in MEASURES.items() if key in self.base.measures]

    @cached_property
    def truths(self) -> dict[str, Limit]:
        """Truth of each measure: its closed form, the limit of the series of cells, or the value of the finest run.

        NaN where there is none of these.
        """
        found = {}
        for measure in self.measures:
            values = [point.measures[measure.key] for point in self.series]
            if measure.key in self.exact:
                found[measure.key] = Limit(self.exact[measure.key])
            elif measure.kind == ITSELF:
                found[measure.key] = Limit(0.0)
            elif measure.smooth and len(values) > 1:
                found[measure.key] = richardson([point.settings["cell"] for point in self.series], values)
            else:
                found[measure.key] = Limit(values[-1] if values else np.nan)
        return found

    def error(self, point: Point, measure: Measure) -> float:
        """Error of a run in a measure; NaN of the run that is the truth itself."""
        limit = self.truths[measure.key]
        is_truth = measure.key not in self.exact and measure.kind != ITSELF and np.isnan(limit.order)
        if is_truth and self.series and point is self.series[-1]:
            return np.nan
        return measure.error(point.measures[measure.key], limit.value)

    @cached_property
    def front(self) -> list[Point]:
        """Runs on the Pareto front of cost and main error, the quickest first. At most one run of each rock is."""
        firsts = [group[0] for group in self._of_rock.values()]
        found = pareto_front([self.cost(point) for point in firsts], [self.error(point, self.main) for point in firsts])
        return sorted((point for point, is_front in zip(firsts, found, strict=True) if is_front), key=self.cost)

    @property
    def presets(self) -> list[Point]:
        """Runs by the key `accuracy`, the quickest preset first; the base is standard."""
        order = list(PRESETS)
        others = [point for point in self.points if point.accuracy != STANDARD]
        return sorted([*others, self.base], key=lambda point: order.index(point.accuracy))

    def beaten_by(self, point: Point) -> Point | None:
        """The quickest run on the front with at most the cost and error of this one; None for a run on the front."""
        cost, error = self.cost(point), self.error(point, self.main)
        if not np.isfinite([cost, error]).all() or any(_rock(other) == _rock(point) for other in self.front):
            return None
        return next(other for other in self.front if self.cost(other) <= cost and self.error(other, self.main) <= error)

    def speed(self, line: Line, member: Point) -> float:
        """Ratio of the cost of the line's anchor to that of a member: above 1 where the member is faster."""
        return self.cost(line.anchor) / self.cost(member)

    def change(self, line: Line, member: Point) -> float:
        """Signed change of the main measure as a share of the anchor's; a difference where the measure is an error."""
        before, after = (point.measures[self.main.key] for point in (line.anchor, member))
        return after - before if self.main.kind == ITSELF else after / before - 1.0 if before else np.nan

    def buys(self, line: Line, member: Point) -> str:
        """Text on what a member gains over the line's anchor beyond the noise: speed, accuracy or nothing."""
        if line.knob in SEISMIC:
            return "another count of events"
        speed = self.speed(line, member)
        if speed > self.clear:
            is_cheap = abs(self.change(line, member)) <= MAX_CHEAP_CHANGE
            return f"speed, for {'less' if is_cheap else 'more'} than {100 * MAX_CHEAP_CHANGE:g} %"
        was, now = self.error(line.anchor, self.main), self.error(member, self.main)
        return "accuracy" if speed < 1 / self.clear and 1.0 - now / (was or np.nan) > MIN_ERROR_GAIN else "nothing"

    def label(self, point: Point) -> str:
        """Settings that a run changes, in words, after the name of its preset."""
        text = label(point.settings, changed(point.settings, self.base.settings)) or "base"
        return text if point.accuracy == STANDARD else f"accuracy {point.accuracy} ({text})"

    @cached_property
    def distinct(self) -> list[Point]:
        """The first of all runs with the same settings."""
        return [group[0] for group in _grouped(self.points, _settings_without).values()]

    @cached_property
    def lines(self) -> list[Line]:
        """The line of each knob that runs change: that through the base, else the one with the most members."""
        return [line for knob in KNOBS if (line := self._line(knob.key))]

    def _line(self, knob: str) -> Line | None:
        base, found = self.base.settings, []
        for members in _grouped(self.distinct, lambda point: _settings_without(point, {knob})).values():
            anchors = [point for point in members if point.settings[knob] == base[knob]]
            if len(members) > 1 and anchors:
                others = [key for key in changed(anchors[0].settings, base) if key != knob]
                members = sorted(members, key=lambda point: _place(point.settings[knob]))
                found.append(Line(knob, members, anchors[0], label(anchors[0].settings, others)))
        return min(found, key=lambda line: (bool(line.beside), -len(line.members)), default=None)


def _grouped(points: list[Point], key: Callable[[Point], tuple]) -> dict[tuple, list[Point]]:
    """Points by their key, groups in the order of their first points."""
    groups = defaultdict(list)
    for point in points:
        groups[key(point)].append(point)
    return groups


def _settings_without(point: Point, knobs: Container[str] = ()) -> tuple:
    """Settings of a run but those of these knobs."""
    return tuple(value for key, value in point.settings.items() if key not in knobs)


def _rock(point: Point) -> tuple:
    """Settings that determine the rock of a run."""
    return _settings_without(point, SEISMIC)


def _place(value: float | str) -> tuple:
    """Sort key: numbers by size, then words."""
    return (1, value) if isinstance(value, str) else (0, value)
