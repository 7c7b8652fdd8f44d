"""Difference between two plans: a ratio of totals, its interval, and whether chance explains it.

The ratio r of the mean totals of two plans is uncertain for three reasons, and each has an interval of ln r: chance,
the cells (the change of the ratio on cells of twice the size) and the rock (its scatter over draws of a posterior). On
each side of the ratio the distances to their ends are added in quadrature (Zou and Donner 2008).

**Chance.** Runs of one number have the same random strength, so they come in pairs of sums a_i, b_i. The interval holds
each r for which the differences a_i - r b_i have a mean that Student's t does not tell from 0 (Fieller 1954). If both
plans are one, a_i - b_i is as likely as b_i - a_i, whatever clusters and heavy tails the sums have and whatever the
pairs have in common, so that t rejects r = 1 about as often as it states. Few runs may agree by chance: each sum varies
at least as a Poisson number of equal events does. Fewer than MIN_RUNS runs say too little of the variance for an
interval.

Rows that compare plans at once for many steps or openings would differ by chance somewhere: a verdict is that of an
interval of a higher level (plans.comparisons).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import f, norm, t

from catalogs.compare.sum_measures import MIN_RUNS_FOR_VARIANCE
from common.errors import InputError
from plans.layout import ANY, COARSE, DRAW, LIKE_OWN, OWN
from plans.record import CELL_CHANGE_FACTOR, CELLS, CHANCE, MIN_DRAWS, ROCK, RUNS

NUMBER, POTENCY = "number", "potency"
MIN_RUNS = MIN_RUNS_FOR_VARIANCE  # of each plan, its own among them
SIGNIFICANCE = 0.05
OTHER_CAUSES = {CELLS: "cell size", ROCK: "rock"}  # of a difference, in words
OF_ALL_RUNS = {NUMBER: "shared_number", POTENCY: "whole_potency"}  # what runs on other cells can be compared by


@dataclass(frozen=True)
class Difference:
    """Ratio of a plan to another.

    value: NaN where the other has nothing. interval (2,): of 95 %, NaN of fewer than MIN_RUNS runs. judged (2,) and
    judged_by_chance (2,): ends of the intervals, of all causes and of chance alone, whose level allows for the other
    comparisons that are made at once. is_shared: both plans are the same runs here; is_empty: neither has anything.
    contains, lacks: those of CHANCE, CELLS and ROCK that the interval does, and RUNS where there are too few.
    """

    value: float
    interval: NDArray
    judged: NDArray
    judged_by_chance: NDArray
    contains: tuple[str, ...]
    lacks: tuple[str, ...]
    is_shared: bool = False
    is_empty: bool = False

    @property
    def is_significant(self) -> bool:
        """True if the interval that allows for the other comparisons excludes 1."""
        return _excludes_one(self.judged)

    @property
    def verdict(self) -> str:
        """The difference in words."""
        if self.is_shared:
            return "the same runs in both plans"
        if self.is_empty:
            return "neither plan makes anything"
        if RUNS in self.lacks:
            return "too few runs to say"
        if self.is_significant:
            return "larger than chance explains"
        if _excludes_one(self.judged_by_chance):
            others = " and ".join(OTHER_CAUSES[one] for one in self.contains if one != CHANCE)
            return f"larger than chance explains, but {others} may explain it"
        return "difference within chance"


def _excludes_one(interval: NDArray) -> bool:
    """True if an interval (2,) excludes 1; not if it is not known."""
    return bool(interval[0] > 1.0 or interval[1] < 1.0)


def steps_with_other_runs(plan: xr.Dataset, other: xr.Dataset) -> list[str]:
    """Names of the steps of a plan whose runs are not those of the other plan, in order."""
    digests = dict(zip(other["step"].values, other["made_by"].values, strict=True))
    return [
        str(step)
        for step, digest in zip(plan["step"].values, plan["made_by"].values, strict=True)
        if not digest or digests.get(step) != digest
    ]


def compare_plans(
    plan: xr.Dataset,
    other: xr.Dataset,
    quantity: str,
    steps: tuple[Sequence[str], Sequence[str]],
    opening: str = ANY,
    comparisons: int = 1,
) -> Difference:
    """The ratio of number or potency of a plan to another's, over steps of each (by name), near one opening or all.

    plan, other: outcomes (plans.layout); comparisons: how many are judged at once. Without steps, or in steps that are
    the same runs in both, there is nothing to compare. Raises InputError for plans whose events are counted from
    different floors.
    """
    both = steps_of_both(plan, other, steps)
    if are_same_runs(both):
        return Difference(1.0, np.ones(2), np.ones(2), np.ones(2), (), (), is_shared=True)
    first, second = paired_sums(both, quantity, LIKE_OWN, opening=opening)
    sizes: tuple[float, ...] = (1.0, 1.0)
    if quantity == POTENCY:
        numbers = (one.sum() for one in paired_sums(both, NUMBER, LIKE_OWN, opening=opening))
        sizes = tuple(sums.sum() / max(number, 1.0) for sums, number in zip((first, second), numbers, strict=True))
    cells, rock = _half_width_by_cells(both, quantity), _log_ratios(both, quantity, DRAW)
    return judged_difference(first, second, sizes, comparisons, cells, rock if len(rock) >= MIN_DRAWS else None)


def paired_sums(
    both: Sequence[xr.Dataset], name: str, kinds: Sequence[str], **selected: object
) -> tuple[NDArray, NDArray]:
    """Sums of a variable over steps by run, of runs of the same kind and number in two plans, (pair,) each.

    Runs that do not stand in one of them are left out in both. selected: coordinates along its other dimensions.
    """
    sums = []
    for outcome in both:
        values = outcome[name].sel(selected).transpose("run", "step").values.sum(axis=1)
        sums.append(values[np.isin(outcome["run_kind"].values, kinds)])
    count = min(len(one) for one in sums)
    first, second = (one[:count] for one in sums)
    known = np.isfinite(first) & np.isfinite(second)
    return first[known], second[known]


def steps_of_both(
    plan: xr.Dataset, other: xr.Dataset, steps: tuple[Sequence[str], Sequence[str]]
) -> tuple[xr.Dataset, xr.Dataset]:
    """Outcomes of two plans in steps of each. Raises InputError if their events are counted from different floors."""
    for floor in ("floor", "shared_floor"):
        ends = [float(one.attrs[floor]) for one in (plan, other)]
        if np.isfinite(ends).all() and not np.isclose(ends[0], ends[1]):
            raise InputError(
                f"plans: events of {plan.attrs['plan']} are counted from log P {ends[0]:.3g} on, those of "
                f"{other.attrs['plan']} from {ends[1]:.3g} on; make both outcomes again"
            )
    return plan.sel(step=list(steps[0])), other.sel(step=list(steps[1]))


def are_same_runs(both: Sequence[xr.Dataset]) -> bool:
    """True if the runs of two outcomes are the same in all of their steps."""
    digests = [tuple(one["made_by"].values) for one in both]
    return digests[0] == digests[1] and all(digests[0])


def judged_difference(
    first: NDArray,
    second: NDArray,
    sizes: Sequence[float],
    comparisons: int,
    cells: float | None = None,
    rock: NDArray | None = None,
) -> Difference:
    """The difference of two plans by sums of their runs (run,) each, runs of one index being a pair.

    sizes: mean of an event's share in a sum of the first and the second plan; cells: half the width of the 95 %
    interval of ln ratio by cells; rock: ln ratio in drawn rock (draw,).
    """
    contains, lacks = [CHANCE], []
    if min(len(first), len(second)) < MIN_RUNS:
        contains, lacks = [], [RUNS]
    for name, uncertainty in ((CELLS, cells), (ROCK, rock)):
        (lacks if uncertainty is None else contains).append(name)
    value = float(first.mean() / second.mean()) if second.any() else np.nan
    intervals = []
    for level in (SIGNIFICANCE, SIGNIFICANCE / comparisons):
        by_chance = paired_interval(first, second, sizes, level)
        widths = (cells or 0.0) * norm.isf(level / 2) / norm.isf(SIGNIFICANCE / 2), _interval_by_rock(rock, level)
        intervals.append((by_chance, _widened_interval(value, by_chance, *widths)))
    (_, interval), (judged_by_chance, judged) = intervals
    is_empty = not (first.any() or second.any())
    return Difference(
        value, interval, judged, judged_by_chance, tuple(contains), tuple(lacks), is_empty=is_empty
    )  # fmt: skip


def paired_interval(first: NDArray, second: NDArray, sizes: Sequence[float], level: float = SIGNIFICANCE) -> NDArray:
    """Interval (2,) of the ratio of the means of two sets of sums (run,), of which those of one index are a pair.

    sizes: mean of an event's share in a sum of the first and the second set, 1 for numbers: sums vary at least as those
    of a Poisson number of equal events. level: chance that it excludes the true ratio. Its upper end is inf where the
    second mean may be 0. NaN of fewer than MIN_RUNS pairs, or if all sums are 0.
    """
    pairs = min(len(first), len(second))
    first, second = np.asarray(first[:pairs], float), np.asarray(second[:pairs], float)
    if pairs < MIN_RUNS or not (first.any() or second.any()):
        return np.full(2, np.nan)
    if not first.any():
        return np.array([0.0, 1.0 / _lower_end_over_nothing(second, sizes[1], level)])
    if not second.any():
        return np.array([_lower_end_over_nothing(first, sizes[0], level), np.inf])
    # (mean(a) - r mean(b))^2 <= t^2 var(a - r b) / n: a quadratic inequality of r
    scale = first.mean(), second.mean()
    covariance = np.cov(first / scale[0], second / scale[1])
    least = np.divide(sizes, scale)  # of the variance: of a Poisson number it is its mean
    np.fill_diagonal(covariance, np.maximum(covariance.diagonal(), least))
    covariance *= t.isf(level / 2, pairs - 1) ** 2 / pairs
    constant, linear, square = 1.0 - covariance[0, 0], 1.0 - covariance[0, 1], 1.0 - covariance[1, 1]
    root = np.sqrt(max(linear**2 - square * constant, 0.0))
    lower = max(constant / (linear + root), 0.0) if linear + root > 0.0 else 0.0
    upper = (linear + root) / square if square > 0.0 else np.inf
    if square <= 0.0 and constant <= 0.0:
        lower = 0.0
    return scale[0] / scale[1] * np.array([lower, upper])


def _lower_end_over_nothing(sums: NDArray, size: float, level: float) -> float:
    """Lower end of the ratio of the mean of sums (run,) to that of as many runs without an event.

    Both totals count as Poisson numbers of equal events, whose size follows from the variance between the runs; so few
    runs know it to a chi-square. It is no smaller than `size`, the mean of an event's share in a sum.
    """
    pairs = len(sums)
    stretch = t.isf(level / 2, pairs - 1) / norm.isf(level / 2)
    worth = (
        sums.sum() / max(stretch**2 * sums.var(ddof=1) / sums.mean(), size) + 0.5
    )  # half an event more on either side, Jeffreys' prior
    return float(2.0 * worth * f.ppf(level / 2, 2.0 * worth, 1.0))


def _log_ratios(both: Sequence[xr.Dataset], quantity: str, kind: str) -> NDArray:
    """ln of the ratio over the runs of a kind (run,), in their order, as far as both plans have one and something."""
    first, second = paired_sums(both, OF_ALL_RUNS[quantity], [kind])
    some = (first > 0.0) & (second > 0.0)
    return np.log(first[some] / second[some])


def _half_width_by_cells(both: Sequence[xr.Dataset], quantity: str) -> float | None:
    """Half the width of the interval of ln ratio that is due to the cells; None without a run on doubled cells."""
    own, coarse = (_log_ratios(both, quantity, kind) for kind in (OWN, COARSE))
    return float(CELL_CHANGE_FACTOR * abs(own[0] - coarse[0])) if len(own) and len(coarse) else None


def _interval_by_rock(values: NDArray | None, level: float) -> NDArray | None:
    """Lower and upper end (2,) of the interval of ln ratio over rock of the posterior, from its values (draw,).

    It is that of one more draw, whose rock is that of the mine. Each draw is one run, so its chance is in it, too.
    """
    if values is None:
        return None
    half = t.isf(level / 2, len(values) - 1) * values.std(ddof=1) * np.sqrt(1.0 + 1.0 / len(values))
    return values.mean() + np.array([-half, half])


def _widened_interval(value: float, by_chance: NDArray, cells: float, rock: NDArray | None) -> NDArray:
    """Ends (2,) of the interval of chance, moved outward by the cells and the rock."""
    middle = np.log(value) if value > 0.0 else None
    ends = []
    for side, end in zip((-1.0, 1.0), by_chance, strict=True):
        if not 0.0 < end < np.inf:
            ends.append(end)
            continue
        centre = np.log(end) if middle is None else middle
        by_rock = 0.0 if rock is None else max(0.0, side * (float(rock[int(side > 0)]) - centre))
        ends.append(float(np.exp(centre + side * np.sqrt((np.log(end) - centre) ** 2 + cells**2 + by_rock**2))))
    return np.array(ends)
