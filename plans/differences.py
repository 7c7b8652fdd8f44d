"""Difference between two plans: a ratio of totals, its interval, and whether chance explains it.

The ratio of the mean totals of two plans is uncertain for three reasons, and each has an interval of ln ratio: chance
(catalogs.compare.exposure.total_ratio), the cells (the change of the ratio on cells of twice the size) and the rock
(its scatter over draws of a posterior). On each side of the ratio the distances to their ends are added in quadrature
(Zou and Donner 2008).

Rows that compare plans at once for many steps or openings differ by chance in one of twenty cases.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import t

from catalogs.compare.exposure import Ratio, Total, total_ratio
from catalogs.compare.grid_convergence import SAFETY_FACTOR
from catalogs.compare.sum_measures import MIN_RUNS_FOR_VARIANCE, MIN_SCALE_SHARE, mean_total
from catalogs.sources.jackknife import INTERVAL_95
from common.errors import InputError
from plans.layout import ANY, COARSE, DRAW, LIKE_OWN, OWN
from plans.record import CELLS, CHANCE, MIN_DRAWS, ROCK, RUNS

NUMBER, POTENCY = "number", "potency"
# A variance between runs needs as many events of all runs together: of fewer, most of it is in events that are rare.
MIN_EVENTS_FOR_VARIANCE = 50
OTHER_CAUSES = {CELLS: "cell size", ROCK: "rock"}  # of a difference, in words
OF_ALL_RUNS = {NUMBER: "shared_number", POTENCY: "whole_potency"}  # what runs on other cells can be compared by


@dataclass(frozen=True)
class Difference:
    """Ratio of a plan to another: value, 95 % interval (2,), and that of chance alone, by_chance (2,).

    value: NaN where the other has nothing. is_shared: both plans are the same runs here. contains, lacks: those of
    CHANCE, CELLS and ROCK that the interval does, and RUNS where there is one run only.
    """

    value: float
    interval: NDArray
    by_chance: NDArray
    contains: tuple[str, ...]
    lacks: tuple[str, ...]
    is_shared: bool = False

    @property
    def is_significant(self) -> bool:
        """True if the interval excludes 1."""
        return bool(self.interval[0] > 1.0 or self.interval[1] < 1.0)

    @property
    def verdict(self) -> str:
        """The difference in words."""
        if self.is_shared:
            return "the same runs in both plans"
        if not np.isfinite(self.interval).any():
            return "neither plan makes anything"
        if self.is_significant:
            return "larger than chance explains"
        if self.by_chance[0] > 1.0 or self.by_chance[1] < 1.0:
            others = " and ".join(OTHER_CAUSES[one] for one in self.contains if one != CHANCE)
            return f"larger than chance explains, but {others} may explain it"
        return "difference within chance"


def steps_with_other_runs(plan: xr.Dataset, other: xr.Dataset) -> list[str]:
    """Names of the steps of a plan whose runs are not those of the other plan, in order."""
    digests = dict(zip(other["step"].values, other["made_by"].values, strict=True))
    return [
        str(step)
        for step, digest in zip(plan["step"].values, plan["made_by"].values, strict=True)
        if not digest or digests.get(step) != digest
    ]


def compare_plans(
    plan: xr.Dataset, other: xr.Dataset, quantity: str, steps: tuple[Sequence[str], Sequence[str]], opening: str = ANY
) -> Difference:
    """The ratio of number or potency of a plan to another's, over steps of each (by name), near one opening or all.

    plan, other: outcomes (plans.layout). Without steps, or in steps that are the same runs in both, there is nothing to
    compare. Raises InputError for plans whose events are counted from different floors.
    """
    for floor in ("floor", "shared_floor"):
        ends = [float(one.attrs[floor]) for one in (plan, other)]
        if np.isfinite(ends).all() and not np.isclose(ends[0], ends[1]):
            raise InputError(
                f"plans: events of {plan.attrs['plan']} are counted from log P {ends[0]:.3g} on, those of "
                f"{other.attrs['plan']} from {ends[1]:.3g} on; make both outcomes again"
            )
    both = [one.sel(step=list(names)) for one, names in zip((plan, other), steps, strict=True)]
    digests = [tuple(one["made_by"].values) for one in both]
    if digests[0] == digests[1] and all(digests[0]):
        return Difference(1.0, np.ones(2), np.ones(2), (), (), is_shared=True)
    runs = [one.isel(run=np.flatnonzero(np.isin(one["run_kind"].values, LIKE_OWN))) for one in both]
    ratio = _ratio_by_chance([one.sel(opening=opening) for one in runs], quantity)
    contains, lacks = [CHANCE], []
    if min(one.sizes["run"] for one in runs) < 2:
        lacks.append(RUNS)
    cells, rock = _half_width_by_cells(both, quantity), _interval_by_rock(both, quantity)
    for name, uncertainty in ((CELLS, cells), (ROCK, rock)):
        (lacks if uncertainty is None else contains).append(name)
    lower, upper = _widened_interval(ratio, cells or 0.0, rock)
    return Difference(ratio.value, np.array([lower, upper]), ratio.interval, tuple(contains), tuple(lacks))


def _ratio_by_chance(runs: Sequence[xr.Dataset], quantity: str) -> Ratio:
    """The ratio and its interval by chance, of the plans' own runs and members."""
    numbers, sums = ([one[name].sum("step").values for one in runs] for name in (NUMBER, quantity))
    squares = [one["squares" if quantity == POTENCY else NUMBER].sum("step").values for one in runs]
    return ratio_of_runs(numbers, sums, squares)


def ratio_of_runs(numbers: Sequence[NDArray], sums: Sequence[NDArray], squares: Sequence[NDArray]) -> Ratio:
    """The ratio of the mean sum of two sets of runs, and its interval by chance.

    numbers, sums, squares: for both sets, (run,) each: number of events, sum of their sizes, sum of squared sizes. Runs
    of the same index share their perturbation: what they have in common does not change the ratio.
    """
    total = float(sum(one.sum() for one in sums))
    scale = float(sum(one.sum() for one in squares)) / total if total else 1.0
    unlike, both = unlike_share(*sums), []
    for number, added, squared in zip(numbers, sums, squares, strict=True):
        mean = mean_total(added, squared, scale)
        least = scale / len(number) if number.sum() < MIN_EVENTS_FOR_VARIANCE else MIN_SCALE_SHARE * mean.value
        both.append(Total(mean.value, max(mean.scale * unlike, least)))
    return total_ratio(*both)


def unlike_share(first: NDArray, second: NDArray) -> float:
    """Variance of the difference of two sets of sums (run,), each over its mean, over that of independent runs.

    1 where runs do not come in pairs, are too few for a variance, or do not vary.
    """
    if len(first) != len(second) or len(first) < MIN_RUNS_FOR_VARIANCE or not (first.any() and second.any()):
        return 1.0
    relative = [one / one.mean() for one in (first, second)]
    apart = float(sum(one.var(ddof=1) for one in relative))
    return float((relative[0] - relative[1]).var(ddof=1)) / apart if apart else 1.0


def _log_ratios(both: Sequence[xr.Dataset], quantity: str, kind: str) -> NDArray:
    """ln of the ratio over the runs of a kind (run,), in their order, as far as both plans have one and something."""
    sums = [one[OF_ALL_RUNS[quantity]].sum("step").values[one["run_kind"].values == kind] for one in both]
    count = min(len(one) for one in sums)
    first, second = (one[:count] for one in sums)
    some = (first > 0.0) & (second > 0.0)
    return np.log(first[some] / second[some])


def _half_width_by_cells(both: Sequence[xr.Dataset], quantity: str) -> float | None:
    """Half the width of the interval of ln ratio that is due to the cells; None without a run on doubled cells."""
    own, coarse = (_log_ratios(both, quantity, kind) for kind in (OWN, COARSE))
    return float(SAFETY_FACTOR * abs(own[0] - coarse[0])) if len(own) and len(coarse) else None


def _interval_by_rock(both: Sequence[xr.Dataset], quantity: str) -> NDArray | None:
    """Lower and upper end (2,) of the interval of ln ratio over rock of the posterior; None of too few draws.

    It is that of one more draw, whose rock is that of the mine. Each draw is one run, so its chance is in it, too.
    """
    values = _log_ratios(both, quantity, DRAW)
    if len(values) < MIN_DRAWS:
        return None
    half = t.ppf(INTERVAL_95[1], len(values) - 1) * values.std(ddof=1) * np.sqrt(1.0 + 1.0 / len(values))
    return values.mean() + np.array([-half, half])


def _widened_interval(ratio: Ratio, cells: float, rock: NDArray | None) -> tuple[float, float]:
    """Ends of the interval of chance, moved outward by the cells and the rock."""
    lower, upper = float(ratio.interval[0]), float(ratio.interval[1])
    middle = np.log(ratio.value) if ratio.value > 0.0 else None
    ends = []
    for side, end in ((-1.0, lower), (1.0, upper)):
        if not 0.0 < end < np.inf:
            ends.append(end)
            continue
        centre = np.log(end) if middle is None else middle
        by_rock = 0.0 if rock is None else max(0.0, side * (float(rock[int(side > 0)]) - centre))
        ends.append(float(np.exp(centre + side * np.sqrt((np.log(end) - centre) ** 2 + cells**2 + by_rock**2))))
    return ends[0], ends[1]
