"""The comparisons of a page of plans, with verdicts that hold together.

Of many ratios of equal plans some differ by chance. So verdicts are those of intervals whose level is divided by the
number of comparisons of their kind (Bonferroni): of whole plans, of chances, and of depths at openings
(plans.opening_depths). Single steps and openings are judged only where the whole plans differ. Of twenty pages whose
plans are equal, one at most states a difference of each kind. The intervals that a page shows are those of each ratio
by itself.

Classes of likelihood are compared, too: plans whose chances are not told apart from those of the first plan share its
class, that of their mean chance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from plans.differences import NUMBER, POTENCY, Difference, compare_plans, judged_difference, paired_sums
from plans.differences import steps_with_other_runs as other_steps
from plans.layout import ANY, LIKE_OWN, PlanSummary
from plans.record import RUNS

Steps = tuple[list[str], list[str]]
NOT_JUDGED = "not judged by itself"


def differing_steps(plan: PlanSummary, first: PlanSummary) -> Steps:
    """Steps of a plan, and steps of the first one, whose runs differ between the two plans."""
    return other_steps(plan.outcome, first.outcome), other_steps(first.outcome, plan.outcome)


@dataclass(frozen=True)
class PartDifference:
    """Ratio of a step or near an opening, and the verdict that it gets on a page with others."""

    difference: Difference
    verdict: str
    differs: bool


class Comparisons:
    """Comparisons of each plan with the first one; plans: that which others are compared with first."""

    def __init__(self, plans: Sequence[PlanSummary]):
        self.plans = list(plans)
        self.first = self.plans[0]
        self._steps = {plan.name: differing_steps(plan, self.first) for plan in self.plans[1:]}
        self._whole: dict[tuple[str, str], Difference] = {}
        self._chances: dict[tuple[str, float, str], Difference] = {}

    def pairs(self, plan: PlanSummary) -> int:
        """Number of runs of a plan, and of the first one, that stand in both."""
        both = [plan.outcome, self.first.outcome]
        return len(paired_sums(both, "whole_potency", LIKE_OWN)[0])

    def steps(self, plan: PlanSummary) -> Steps:
        """Steps of a plan and of the first one whose runs differ."""
        return self._steps[plan.name]

    def whole(self, plan: PlanSummary, quantity: str) -> Difference:
        """The ratio of a quantity in all steps that differ, judged with those of both quantities and all plans."""
        key = plan.name, quantity
        if key not in self._whole:
            count = 2 * (len(self.plans) - 1)
            self._whole[key] = compare_plans(
                plan.outcome, self.first.outcome, quantity, self.steps(plan), comparisons=count
            )
        return self._whole[key]

    def every(self) -> list[Difference]:
        """The differences of whole plans, as far as there are steps to compare."""
        plans = [plan for plan in self.plans[1:] if all(self.steps(plan))]
        return [self.whole(plan, quantity) for plan in plans for quantity in (NUMBER, POTENCY)]

    @cached_property
    def _parts(self) -> dict[str, int]:
        """Number of single steps and openings that each plan is compared in."""
        names = {
            plan.name: [step for step in self.steps(plan)[0] if step in self.first.steps] for plan in self.plans[1:]
        }
        return {
            plan.name: len(names[plan.name]) + sum(opening in self.first.openings for opening in plan.openings)
            for plan in self.plans[1:]
        }

    def part(self, plan: PlanSummary, steps: tuple[Sequence[str], Sequence[str]], opening: str = ANY) -> PartDifference:
        """The ratio of potency in a step or near an opening."""
        count = max(1, self._parts[plan.name] * (len(self.plans) - 1))
        found = compare_plans(plan.outcome, self.first.outcome, POTENCY, steps, opening, count)
        is_open = any(self.whole(plan, quantity).is_significant for quantity in (NUMBER, POTENCY))
        if found.is_shared or found.is_empty or RUNS in found.lacks or is_open:
            return PartDifference(found, found.verdict, found.is_significant)
        return PartDifference(found, NOT_JUDGED, False)

    def chance(self, plan: PlanSummary, distance: float, size: str) -> Difference:
        """Ratio of the yearly chances of a class of size within a distance of any opening.

        The chances have one law of sizes, and their numbers a factor in common, so that their ratio follows from that
        of the numbers of events, each a year. A ratio rho of numbers makes the ratio R of chances,

          R = (1 - exp(-g sqrt(rho))) / (1 - exp(-g / sqrt(rho))),

        where g is the geometric mean of the numbers of such events a year. R lies between 1 and rho. Its interval takes
        the g within the intervals of both chances that moves each end outward.
        """
        key = plan.name, distance, size
        if key not in self._chances:
            self._chances[key] = self._ratio_of_chances(plan, distance, size)
        return self._chances[key]

    def _ratio_of_chances(self, plan: PlanSummary, distance: float, size: str) -> Difference:
        """The ratio that `chance` describes."""
        pair = plan, self.first
        count = max(1, (len(self.plans) - 1) * plan.outcome.sizes["size"] * plan.outcome.sizes["distance"])
        if plan.counted == self.first.counted and not any(self.steps(plan)):
            return Difference(1.0, np.ones(2), np.ones(2), np.ones(2), (), (), is_shared=True)
        counted = [one.outcome.sel(step=one.counted) for one in pair]
        a_year = [1.0 / one.days(one.counted) for one in pair]
        sums = paired_sums(counted, "number_within", LIKE_OWN, opening=ANY, distance=distance)
        first, second = (one * rate for one, rate in zip(sums, a_year, strict=True))
        numbers = judged_difference(first, second, a_year, count)
        found = [one.chance(ANY, distance, size) for one in pair]
        ends = np.sqrt(np.prod([-np.log1p(-np.clip(one[1], 0.0, 1.0 - 1e-12)) for one in found], axis=0))
        value = found[0][0] / found[1][0] if found[1][0] > 0.0 else np.nan
        interval, judged, by_chance = (
            _chance_interval(one, ends) for one in (numbers.interval, numbers.judged, numbers.judged_by_chance)
        )
        return replace(numbers, value=float(value), interval=interval, judged=judged, judged_by_chance=by_chance)

    def class_chance(self, plan: PlanSummary, distance: float, size: str) -> float:
        """The yearly chance that sets a plan's class of likelihood: the mean of those that are not told apart."""
        others = [one for one in self.plans[1:] if not self.chance(one, distance, size).is_significant]
        alike = [self.first, *others]
        is_alike = any(one is plan for one in alike)
        found = [one.chance(ANY, distance, size)[0] for one in (alike if is_alike else [plan])]
        known = [one for one in found if np.isfinite(one)]  # a plan with too few runs that stand has none
        return float(np.mean(known)) if known else np.nan


def _chance_interval(ratio: NDArray, number: NDArray) -> NDArray:
    """Interval (2,) of a ratio of chances, from that of numbers and the ends (2,) of their geometric mean."""

    def of(value: float, mean: float) -> float:
        root = np.sqrt(value)
        return float(np.expm1(-mean * root) / np.expm1(-mean / root)) if mean > 0.0 else value

    if not np.isfinite(number).all():
        return np.full(2, np.nan)  # there is no chance of the class
    low, high = (float(end) for end in ratio)
    if low > 0.0:
        low = of(low, number[0] if low < 1.0 else number[1])
    if np.isfinite(high):
        high = of(high, number[0] if high > 1.0 else number[1])
    return np.array([low, high])
