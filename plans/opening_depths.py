"""Openings after the last step, plan beside plan: where rock fails deeper or less deep, and what that depends on.

The depth of failure d of an opening is that of its side with the deepest failure, which nine tenths of the side do not
exceed. Runs of one number have the same random strength, so they come in pairs. The difference of two plans is the mean
of d_i - e_i over their pairs, and its interval that of Student's t. Depths of few pairs may agree by chance. A depth is
known to half a cell, so the variance of a pair's difference is at least that of two such errors, each uniform within
half a cell: cell^2 / 6.

A difference is none if its mean is smaller than half a cell. Otherwise it is one if its interval, at a level divided by
the number of comparisons of the page (Bonferroni), excludes 0, and else within chance. Of twenty pages of equal plans,
one at most names an opening. What cells change in a depth is not in the interval.

Closures are compared in the same way, with a tenth of the larger one in place of half a cell.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import t

from catalogs.report.text import DASH, number, plural
from plans.differences import MIN_RUNS, SIGNIFICANCE
from plans.layout import LIKE_OWN, PlanSummary
from plans.sentences import listed_names

SHARE_OF_CLOSURE = 0.1  # Smaller differences of closure are none: cells change a closure by so much.
MAX_ROWS = 15  # Openings of the table, those with the deepest failure in any plan.
SHARE_OF_CELL = 0.5  # Smaller differences of depth are none.
Kind = Literal["none", "chance", "few", "more", "less"]
VERDICTS: dict[Kind, str] = {
    "none": "none",
    "chance": "difference within chance",
    "few": "too few runs to say",
    "more": "deeper",
    "less": "less deep",
}


@dataclass(frozen=True)
class OpeningDifference:
    """Difference of a depth or a closure of an opening between two plans, m: mean, its 95 % interval (2,), NaN of fewer
    than MIN_RUNS pairs, and what it is."""

    mean: float
    interval: NDArray
    kind: Kind


def paired_difference(first: NDArray, second: NDArray, resolution: float, comparisons: int) -> OpeningDifference:
    """Difference of values (pair,) m of an opening, second minus first; each value is known to within the resolution,
    m; comparisons: how many are judged at once. Pairs of which one is NaN do not count."""
    apart = second - first
    apart = apart[np.isfinite(apart)]
    if not len(apart):
        return OpeningDifference(np.nan, np.full(2, np.nan), "few")
    mean, interval, judged = float(apart.mean()), np.full(2, np.nan), np.full(2, np.nan)
    if len(apart) >= MIN_RUNS:
        deviation = np.sqrt(max(float(apart.var(ddof=1)), 2.0 * resolution**2 / 3.0) / len(apart))
        interval, judged = (
            mean + deviation * t.isf(level / 2.0, len(apart) - 1) * np.array([-1.0, 1.0])
            for level in (SIGNIFICANCE, SIGNIFICANCE / comparisons)
        )
    if abs(mean) < resolution or mean == 0.0:
        return OpeningDifference(mean, interval, "none")
    if len(apart) < MIN_RUNS:
        return OpeningDifference(mean, interval, "few")
    is_other = judged[0] > 0.0 or judged[1] < 0.0
    return OpeningDifference(mean, interval, ("more" if mean > 0.0 else "less") if is_other else "chance")


@dataclass(frozen=True)
class PlanDepths:
    """Openings of a plan after its last step: by name, values (run,) of its own run and the members that stand."""

    name: str
    step: str
    cell: float
    filled: dict[str, bool]
    values: dict[str, dict[str, NDArray]]

    @classmethod
    def of(cls, plan: PlanSummary, openings: xr.Dataset) -> "PlanDepths":
        """Of a plan and its opening_runs.nc, whose runs stand in the order of the outcome's."""
        stands = plan.stands[np.isin(plan.outcome["run_kind"].values, LIKE_OWN)]
        names = [str(name) for name in openings["opening"].values]
        columns = {
            name: np.where(stands[:, None], openings[name].values, np.nan)
            for name in ("depth_p90", "depth_largest", "closure", "failed_volume")
        }
        columns["side"] = np.where(stands[:, None], openings["side"].values, "")
        return cls(
            plan.name,
            str(openings.attrs["step"]),
            float(openings.attrs["fine_cell"]),
            {name: bool(filled) for name, filled in zip(names, openings["filled"].values, strict=True)},
            {name: {key: one[:, place] for key, one in columns.items()} for place, name in enumerate(names)},
        )

    def mean(self, opening: str, column: str) -> float:
        """Mean of the runs; NaN where none has a value."""
        values = self.values[opening][column]
        known = values[np.isfinite(values)]
        return float(known.mean()) if len(known) else np.nan

    def side(self, opening: str) -> str:
        """The side that fails deepest in most runs; empty where rock fails at none."""
        sides, count = np.unique([one for one in self.values[opening]["side"] if one], return_counts=True)
        return str(sides[count.argmax()]) if len(sides) else ""


class OpeningDepths:
    """Openings of all plans; each plan is compared with the first."""

    def __init__(self, plans: Sequence[PlanSummary], openings: Sequence[xr.Dataset]):
        self.plans = [PlanDepths.of(plan, one) for plan, one in zip(plans, openings, strict=True)]
        self.first = self.plans[0]
        shared = [sum(name in self.first.values for name in plan.values) for plan in self.plans[1:]]
        self.comparisons = max(1, 2 * sum(shared))

    @property
    def names(self) -> list[str]:
        """Openings of any plan, the one with the deepest failure first."""
        deepest: dict[str, float] = {}
        for plan in self.plans:
            for name in plan.values:
                deepest[name] = max(deepest.get(name, 0.0), float(np.nan_to_num(plan.mean(name, "depth_p90"))))
        return sorted(deepest, key=lambda name: -deepest[name])

    def cell(self, plan: PlanDepths) -> float:
        """The larger of the cells of a plan and of the first one, m."""
        return max(plan.cell, self.first.cell)

    def difference(self, plan: PlanDepths, opening: str) -> OpeningDifference | None:
        """Difference of depth to the first plan at an opening; None where one of them does not mine it."""
        return self._difference(plan, opening, "depth_p90", SHARE_OF_CELL * self.cell(plan))

    def closure(self, plan: PlanDepths, opening: str) -> OpeningDifference | None:
        """Difference of closure, likewise."""
        if opening not in plan.values or opening not in self.first.values:
            return None
        largest = max(abs(one.mean(opening, "closure")) for one in (plan, self.first))
        return self._difference(plan, opening, "closure", SHARE_OF_CLOSURE * largest)

    def _difference(self, plan: PlanDepths, opening: str, column: str, resolution: float) -> OpeningDifference | None:
        if opening not in plan.values or opening not in self.first.values:
            return None
        both = [one.values[opening][column] for one in (self.first, plan)]
        count = min(map(len, both))
        return paired_difference(both[0][:count], both[1][:count], resolution, self.comparisons)


def depth_rows(depths: OpeningDepths) -> list[dict]:
    """Rows of the page's table: each opening, plan below plan, with the difference to the first plan."""
    rows = []
    for opening in depths.names[:MAX_ROWS]:
        for place, plan in enumerate(one for one in depths.plans if opening in one.values):
            difference = depths.difference(plan, opening) if plan is not depths.first else None
            row: dict[str, Any] = {
                "opening": "" if place else opening,
                "plan": f"{plan.name} (filled)" if plan.filled[opening] else plan.name,
                "side": plan.side(opening),
                "p90": number(plan.mean(opening, "depth_p90"), 2),
                "largest": _beside(depths, plan, opening, "depth_largest", 1.0, depths.cell(plan) * SHARE_OF_CELL),
                "closure": _closure(depths, plan, opening),
                "volume": _beside(depths, plan, opening, "failed_volume", 1.0),
                "difference": DASH,
                "verdict": "",
                "differs": False,
            }
            if difference is not None and np.isfinite(difference.mean):
                row["difference"] = DASH if difference.kind == "none" else _signed(difference.mean)
                if difference.kind != "none" and np.isfinite(difference.interval).all():
                    ends = " to ".join(_signed(end) for end in difference.interval)
                    row["difference"] += f" ({ends})"
                row["verdict"] = VERDICTS[difference.kind]
                row["differs"] = difference.kind in ("more", "less")
            elif plan is not depths.first and opening not in depths.first.values:
                row["verdict"] = f"not in {depths.first.name}"
            rows.append(row)
    return rows


def _closure(depths: OpeningDepths, plan: PlanDepths, opening: str) -> str:
    """Closure in mm, with its difference to the first plan unless there is none; a star where chance does not explain
    it."""
    text = number(1e3 * plan.mean(opening, "closure"), 2)
    found = depths.closure(plan, opening) if plan is not depths.first else None
    if found is None or found.kind == "none" or not np.isfinite(found.mean):
        return text
    return f"{text} ({_signed(1e3 * found.mean)}){' *' if found.kind in ('more', 'less') else ''}"


def _beside(
    depths: OpeningDepths, plan: PlanDepths, opening: str, column: str, unit: float, resolution: float = 0.0
) -> str:
    """Mean of a column, and in brackets what it is more than in the first plan; differences below `resolution` are
    left out."""
    mean = plan.mean(opening, column)
    text = number(unit * mean, 2)
    if plan is depths.first or opening not in depths.first.values:
        return text
    apart = mean - depths.first.mean(opening, column)
    return f"{text} ({_signed(unit * apart)})" if abs(apart) > resolution else text


def _signed(value: float) -> str:
    return f"+{number(value, 2)}" if value > 0.0 else number(value, 2)


def depth_section(plans: Sequence[PlanSummary], openings: Sequence[xr.Dataset]) -> dict:
    """Content of the page's section; empty without openings."""
    if not openings:
        return {}
    depths = OpeningDepths(plans, openings)
    rows, count = depth_rows(depths), len(depths.names)
    return {
        "rows": rows,
        "sentences": depth_sentences(depths),
        "half_cell": number(SHARE_OF_CELL * max(plan.cell for plan in depths.plans), 2),
        "left_out": f"{MAX_ROWS} of {count} openings are shown. " if count > MAX_ROWS else "",
    }


def depth_sentences(depths: OpeningDepths) -> list[str]:
    """For each other plan what gets better and what worse than in the first, and what this depends on."""
    return [_sentence(depths, plan) for plan in depths.plans[1:]]


def _sentence(depths: OpeningDepths, plan: PlanDepths) -> str:
    """Sentences on one plan beside the first."""
    first, names = depths.first, depths.names
    found = {name: one for name in names if (one := depths.difference(plan, name)) is not None}
    kinds: tuple[Kind, ...] = ("less", "more")
    clauses = [
        f"{VERDICTS[kind]} at {_named(found, kind)}"
        for kind in kinds
        if any(one.kind == kind for one in found.values())
    ]
    half = number(SHARE_OF_CELL * depths.cell(plan), 2)
    if clauses:
        parts = [f"With {plan.name} rock fails {' and '.join(clauses)} than with {first.name}"]
    elif any(one.kind == "few" for one in found.values()):
        parts = [
            f"{plan.name} and {first.name} differ by more than half a cell ({half} m) at {_named(found, 'few')}: too "
            f"few runs to say whether chance explains it, since that needs {MIN_RUNS}"
        ]
    elif found:
        parts = [f"No opening that both {plan.name} and {first.name} mine shows a difference in depth of failure"]
    else:
        parts = [f"{plan.name} and {first.name} have no opening in common"]
    count = {kind: sum(one.kind == kind for one in found.values()) for kind in ("none", "chance")}
    rest = [f"{plural(count['none'], 'opening')} by less than half a cell ({half} m)"] if count["none"] else []
    rest += [f"{plural(count['chance'], 'opening')} by no more than chance explains"] if count["chance"] else []
    if rest:
        parts.append(f"The depth differs at {' and at '.join(rest)}")
    closures = {name: one for name in names if (one := depths.closure(plan, name)) is not None}
    closing = [
        f"{kind} at {_named(closures, kind, 1e3, 'mm')}"
        for kind in kinds
        if any(one.kind == kind for one in closures.values())
    ]
    if closing:
        parts.append(f"With {plan.name} walls close {' and '.join(closing)} than with {first.name}")
    for mining, other in ((plan, first), (first, plan)):
        if alone := [name for name in names if name in mining.values and name not in other.values]:
            parts.append(f"Only {mining.name} mines {listed_names(alone)}")
    if plan.step != first.step:
        parts.append(f"The depths of {plan.name} are those after {plan.step}, of {first.name} after {first.step}")
    return f"{'. '.join(parts)}."


def _named(found: dict[str, OpeningDifference], kind: Kind, unit: float = 1.0, name_of_unit: str = "m") -> str:
    """Openings of a kind with their differences, the largest first."""
    own = sorted((name for name in found if found[name].kind == kind), key=lambda name: -abs(found[name].mean))
    return listed_names([f"{name} ({_signed(unit * found[name].mean)} {name_of_unit})" for name in own])
