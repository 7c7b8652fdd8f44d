"""Numbers and potencies of the dated steps, each forecast from the steps before it: by a law of a measure, and by
simpler rules.

A law (baselines.rate_law) needs MIN_PERIODS earlier steps, and its measure in one of them. The laws of all measures are
one forecast together, each with the probability of the numbers seen before as its weight. So the choice among measures
is made on earlier steps only. Simpler rules are forecasts of their own, whose scatter is learnt from their own earlier
steps, so that none is judged by a scatter that it does not have.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from baselines.map_scores import Estimate, Variance
from baselines.month_maps import Periods, Places
from baselines.rate_law import MIN_PERIODS, PRIOR_EVENTS, NumberForecast, RateLaw, control_forecasts
from catalogs.compare.blocks import cluster_labels
from catalogs.compare.exposure import DAY, Exposure
from catalogs.compare.face import Face
from catalogs.compare.sum_measures import potency_variance_factor
from catalogs.sources.jackknife import INTERVAL_95

ALL_LAWS = "all_measures"
LAST, LAST_BY_METRES, ALL_BY_METRES, LAST_BY_DAYS, ALL_BY_DAYS = CONTROLS = (
    "last",
    "last_by_metres",
    "all_by_metres",
    "last_by_moving_days",
    "all_by_days",
)
TIMES_IN_STEP = 1000  # Times of a step at which it is looked whether the face moves.
MIN_SCORED = 3  # Steps that an interval of a score needs.


@dataclass(frozen=True)
class RecordedSteps:
    """What is recorded of the dated steps, and by what its chance is measured before each of them.

    number, potency (step,), m3; days (step,): recorded ones; time (step,): their middle, days; share (step,): of the
    step that is recorded; dispersion (step, 2): bounds of the dispersion index of the events before the step, by their
    times alone and by clusters, too; scale (step,): potency of equal events before it by the lower bound, m3, NaN
    without any; potency_dispersion (step, 2): bounds of the dispersion index of these.
    """

    number: NDArray
    potency: NDArray
    days: NDArray
    time: NDArray
    share: NDArray
    dispersion: NDArray
    scale: NDArray
    potency_dispersion: NDArray

    @classmethod
    def of(cls, record: Places, periods: Periods, whole: NDArray) -> "RecordedSteps":
        """Of all events of a record that count; periods: their last ones are the dated steps, of `whole` days."""
        start, end = periods.start[periods.before :], periods.end[periods.before :]
        step = Exposure(start, end).step(record.time)
        own = step >= 0
        number = np.bincount(step[own], minlength=len(start)).astype(float)
        potency = np.bincount(step[own], record.potency[own], minlength=len(start))
        days = (end - start) / DAY
        middle = (start + (end - start) // 2).astype(np.int64) / DAY.astype(np.int64)
        chance = [_chance_before(record, periods, start[place]) for place in range(len(start))]
        least, most, scale, factor = np.array(chance).reshape(-1, 4).T
        bounds = np.column_stack([least, most]), np.column_stack([np.ones(len(factor)), factor])
        return cls(number, potency, days, middle, days / whole, bounds[0], scale, bounds[1])

    def potency_in_events(self, step: int) -> NDArray:
        """Potency of each step (step,) in equal events, as those before a step are."""
        return self.potency / self.scale[step]


def _chance_before(record: Places, periods: Periods, until: np.datetime64) -> tuple[float, float, float, float]:
    """Bounds of the dispersion index of the events before a time, the potency of equal events by the lower one, m3, and
    the factor by which the upper one makes it larger; 1, 1, NaN and 1 without any."""
    known = record.between(periods.start[0], until)
    if not len(known.time):
        return 1.0, 1.0, np.nan, 1.0
    before = periods.end <= until
    exposure = Exposure(periods.start[before], periods.end[before])
    clusters = cluster_labels(known.time, known.place, exposure.step(known.time))
    most = exposure.dispersion_index(known.time, clusters)
    least = exposure.dispersion_index(known.time, np.arange(len(known.time)))  # each event by itself
    equal = float(np.sum(known.potency**2) / known.potency.sum())
    factors = [potency_variance_factor(known.potency, one) for one in (least, most)]
    return least, most, equal * factors[0], factors[1] / factors[0]


def moving_days(face: Face, start: np.datetime64, end: np.datetime64) -> float:
    """Days of a period on which a face moves."""
    span = end - start
    time = start + span // (2 * TIMES_IN_STEP) * (2 * np.arange(TIMES_IN_STEP) + 1)
    moves = np.zeros(TIMES_IN_STEP, bool)
    for panel in face.panels:
        length = np.linalg.norm(np.diff(panel.ends.mean(axis=1), axis=0), axis=1)
        part = np.searchsorted(panel.time, time, side="right") - 1
        inside = (part >= 0) & (part < len(length))
        moves[inside] |= length[part[inside]] > 0.0
    return float(span / DAY) * float(moves.mean())


def control_rules(recorded: RecordedSteps, face: Face | None, periods: Periods) -> dict[str, NDArray]:
    """Amounts (step,) by which the rules of CONTROLS that a mine has expect a number."""
    start, end = periods.start[periods.before :], periods.end[periods.before :]
    if face is None:
        return {LAST: recorded.share, ALL_BY_DAYS: recorded.days}
    metres = np.array([face.metres(*ends) for ends in zip(start, end, strict=True)])
    moving = np.array([moving_days(face, *ends) for ends in zip(start, end, strict=True)])
    return {
        LAST: recorded.share,
        LAST_BY_METRES: metres,
        ALL_BY_METRES: metres,
        LAST_BY_DAYS: moving,
        ALL_BY_DAYS: recorded.days,
    }


def expected_by_rule(label: str, number: NDArray, amount: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Number that a rule states of each step (step,), NaN without an earlier amount; the mean of what may come; and how
    much more its variance is by that of the earlier number.

    A rule of the last step takes the last one that has an amount: metres say nothing after a step without any. What may
    come is as after half an event more (PRIOR_EVENTS, which laws have, too): a step without events does not make the
    next ones impossible.
    """
    is_last = label.startswith("last")
    stated, expected, spread = np.full((3, len(number)), np.nan)
    for step in range(1, len(number)):
        having = np.flatnonzero(amount[:step] > 0.0)[-1:] if is_last else np.arange(step)
        earlier, amounts = number[having].sum(), amount[having].sum()
        if amounts > 0.0:
            stated[step] = earlier * amount[step] / amounts
            expected[step] = (earlier + PRIOR_EVENTS) * amount[step] / amounts
            spread[step] = 1.0 + amount[step] / amounts
    return stated, expected, spread


@dataclass(frozen=True)
class NumberScores:
    """Forecasts of the number of each dated step, or of its potency in equal events, and their scores.

    number (step,): what came; forecasts: by label, one of each step, None where there is none; weights: of the measures
    in the forecast of all together (measure, step), NaN without it; unit (step,): potency of an equal event, m3, or 1;
    mined (step,) bool: something is mined.
    """

    number: NDArray
    forecasts: Mapping[str, list[NumberForecast | None]]
    weights: Mapping[str, NDArray]
    unit: NDArray
    mined: NDArray

    @property
    def common(self) -> NDArray:
        """Steps (step,) bool of which every forecast that has any says a number, and whose number is known."""
        rows = [[one is not None for one in row] for row in self.forecasts.values()]
        known = [row for row in rows if any(row)]
        return np.all(known, axis=0) & np.isfinite(self.number) if known else np.zeros(len(self.number), bool)

    def values(self, label: str) -> NDArray:
        """The number that stands for each forecast (step,), NaN where there is none."""
        return np.array([np.nan if one is None else one.value for one in self.forecasts[label]]) * self.unit

    def intervals(self, label: str) -> NDArray:
        """95 % interval of each forecast (step, 2)."""
        found = [np.full(2, np.nan) if one is None else one.interval for one in self.forecasts[label]]
        return np.array(found).reshape(-1, 2) * self.unit[:, None]

    def errors(self, label: str, steps: NDArray) -> NDArray:
        """ln of the forecast over what came, half an event added to either, for those of some steps (step,) bool that
        have a forecast."""
        known = zip(self.forecasts[label], self.number, steps, strict=True)
        pairs = [(one.value, value) for one, value, own in known if own and one is not None]
        expected, number = np.array(pairs, float).reshape(-1, 2).T
        return np.log((expected + 0.5) / (number + 0.5))

    def misses(self, label: str, steps: NDArray) -> tuple[float, NDArray]:
        """Root mean square of `errors` and its 95 % interval (2,), for some steps (step,) bool.

        That of a normal error, with the degrees of freedom that the squares have (Satterthwaite 1946).
        """
        squares = self.errors(label, steps) ** 2
        if not len(squares):
            return np.nan, np.full(2, np.nan)
        mean = float(squares.mean())
        if len(squares) < MIN_SCORED or not mean > 0.0:
            return float(np.sqrt(mean)), np.full(2, np.nan)
        freedom = min(2.0 * len(squares) * mean**2 / max(float(squares.var(ddof=1)), 1e-300), float(len(squares)))
        ends = mean * freedom / scipy.stats.chi2.ppf(INTERVAL_95[::-1], freedom)
        return float(np.sqrt(mean)), np.sqrt(ends)

    def scores(self, label: str, steps: NDArray) -> NDArray:
        """ln of the probability of what came, for some steps (step,) bool."""
        known = zip(self.forecasts[label], self.number, steps, strict=True)
        return np.array([one.score(value) for one, value, own in known if own and one is not None])

    def lead(self, label: str, other: str, steps: NDArray) -> Estimate:
        """Mean of `scores` of a forecast less that of another one, with Student's interval over steps."""
        difference = self.scores(label, steps) - self.scores(other, steps)
        if len(difference) < MIN_SCORED:
            value = float(difference.mean()) if len(difference) else np.nan
            return Estimate(value, np.full(2, np.nan), np.nan)
        variance = Variance(float(difference.var(ddof=1)) / len(difference), len(difference) - 1.0)
        return Estimate.of(float(difference.mean()), variance)

    def inside(self, label: str, steps: NDArray) -> int:
        """Steps whose number lies within the 95 % interval of its forecast."""
        known = zip(self.forecasts[label], self.number, steps, strict=True)
        return sum(one.interval[0] <= value <= one.interval[1] for one, value, own in known if own and one is not None)


def law_before(
    step: int, number: NDArray, amount: NDArray, recorded: RecordedSteps, dispersion: NDArray
) -> RateLaw | None:
    """The law of a measure by the steps before one; None where they are too few, or without the measure."""
    past = np.flatnonzero((recorded.days[:step] > 0.0) & np.isfinite(amount[:step]))
    if len(past) < MIN_PERIODS or not amount[past].any():
        return None
    if not (np.isfinite(number[past]).all() and np.isfinite(amount[step])):
        return None
    ahead = float(amount[step]), float(recorded.days[step])
    least, most = dispersion.tolist()
    return RateLaw.fit(number[past], amount[past], recorded.days[past], recorded.time[past], (least, most), ahead)


def laws_of_all(recorded: RecordedSteps, measures: Mapping[str, NDArray]) -> dict[str, RateLaw]:
    """The law of the number by all recorded steps, by label of its measure; without those that have too few steps.

    The dispersion index is that before the last step.
    """
    found = {}
    for label, amount in measures.items():
        known = (recorded.days > 0.0) & np.isfinite(amount)
        if known.sum() >= MIN_PERIODS and np.any(amount[known] > 0.0):
            least, most = recorded.dispersion[known][-1].tolist()
            found[label] = RateLaw.fit(
                recorded.number[known], amount[known], recorded.days[known], recorded.time[known], (least, most)
            )
    return found


def score_numbers(
    recorded: RecordedSteps, measures: Mapping[str, NDArray], rules: Mapping[str, NDArray]
) -> NumberScores:
    """Forecasts of the number of each step. measures, rules: amounts (step,) of its recorded part by label."""
    return _scored(recorded, measures, rules, lambda step: recorded.number, recorded.dispersion, False)


def score_potency(
    recorded: RecordedSteps, measures: Mapping[str, NDArray], rules: Mapping[str, NDArray]
) -> NumberScores:
    """Forecasts of the summed potency of each step, as a number of equal events."""
    return _scored(recorded, measures, rules, recorded.potency_in_events, recorded.potency_dispersion, True)


def _scored(
    recorded: RecordedSteps,
    measures: Mapping[str, NDArray],
    rules: Mapping[str, NDArray],
    numbers: Callable[[int], NDArray],
    dispersion: NDArray,
    is_potency: bool,
) -> NumberScores:
    """Forecasts of each step; numbers: of all steps, as they count before a step."""
    count = len(recorded.number)
    usable = {label: amount for label, amount in measures.items() if np.any(amount > 0.0)}
    forecasts: dict[str, list[NumberForecast | None]] = {label: [] for label in (ALL_LAWS, *usable)}
    weights = {label: np.full(count, np.nan) for label in usable}
    for step in range(count):
        evidence, found = {}, {}
        for label, amount in usable.items():
            law = law_before(step, numbers(step), amount, recorded, dispersion[step])
            one = law and law.forecast(float(amount[step]), float(recorded.days[step]), float(recorded.time[step]))
            forecasts[label].append(one or None)
            if law and one:
                evidence[label], found[label] = law.evidence, one
        logs = np.array(list(evidence.values()))
        forecasts[ALL_LAWS].append(NumberForecast.together(list(found.values()), logs) if len(logs) else None)
        for label, log in evidence.items():
            weights[label][step] = np.exp(log - scipy.special.logsumexp(logs))
    own = np.array([numbers(step)[step] for step in range(count)])
    for label, amount in rules.items():
        found_by_rule = np.full((3, count), np.nan)
        for step in range(count):
            found_by_rule[:, step] = [one[step] for one in expected_by_rule(label, numbers(step), amount)]
        stated, expected, spread = found_by_rule
        forecasts[label] = control_forecasts(own, stated, expected, spread, dispersion)
    known = recorded.days > 0.0
    kept = {
        label: [one if is_known else None for one, is_known in zip(row, known, strict=True)]
        for label, row in forecasts.items()
    }
    unit = recorded.scale if is_potency else np.ones(count)
    mined = np.any([amount > 0.0 for amount in measures.values()], axis=0) if measures else known
    return NumberScores(own, kept, weights, unit, mined & known)
