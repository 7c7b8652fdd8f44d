"""The rows of the page's tables, as text, and the table of numbers in the same folder."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from baselines.measures import MEASURES
from catalogs.report.text import DASH, between, fixed, number, percent, typeset
from catalogs.settings import ALL_STEPS
from catalogs.sources.jackknife import INTERVAL_95
from common.datasets import atomic_path
from plans.comparisons import Comparisons, PartDifference
from plans.differences import MIN_RUNS, NUMBER, POTENCY
from plans.layout import ANY, PlanSummary, RunMeans
from plans.sentences import (
    chance_with_interval,
    count,
    frequency_text,
    listed_names,
    ratio_text,
    step_range,
)
from plans.settings import HazardSettings

ENERGY_UNIT = 1e6  # J; the page gives MJ
NOT_COMPARED = {"potency_ratio": DASH, "verdict": "", "differs": False}
MAX_OPENINGS = 15  # Rows of openings, those with most potency in any plan.


def magnitude_of(plan: PlanSummary, potency: float) -> str:
    """A potency (m3) as moment magnitude; a dash for none."""
    return fixed(plan.magnitude(np.log10(potency)), 1) if potency > 0.0 else DASH


def mean_cells(plan: PlanSummary, means: RunMeans) -> dict[str, str]:
    """Number, potency and largest event, as text."""
    largest = means.largest
    return {
        "number": count(means.number),
        "potency": number(means.potency),
        "magnitude": magnitude_of(plan, means.potency),
        "largest": fixed(plan.magnitude(largest), 1) if np.isfinite(largest) else DASH,
    }


def plan_rows(comparisons: Comparisons) -> list[dict]:
    """One row for each plan: all of its steps, and its ratios to the first plan in the steps that differ."""
    rows = []
    for plan in comparisons.plans:
        means, mined = plan.means(plan.steps), plan.mined(plan.steps)
        row: dict[str, object] = {
            "plan": plan.name,
            "steps": step_range(plan.steps),
            "mined": number(mined),
            "energy": number(means.energy / ENERGY_UNIT),
            "failed": number(means.failed),
            "fallen": number(plan.fallen),
            "per_volume": number(1000.0 * means.potency / mined) if mined > 0.0 else DASH,
            **mean_cells(plan, means),
        }
        row |= {"number_ratio": DASH, **NOT_COMPARED}
        if plan is comparisons.first:
            rows.append(row)
            continue
        steps = comparisons.steps(plan)
        more, fewer = step_range(steps[0]), step_range(steps[1])
        row["verdict"] = f"goes on with {more}" if more else f"lacks {fewer}" if fewer else "the same runs"
        if all(steps):
            events, potency = (comparisons.whole(plan, one) for one in (NUMBER, POTENCY))
            row |= {"number_ratio": ratio_text(events), "potency_ratio": ratio_text(potency)}
            row |= {"verdict": potency.verdict, "differs": potency.is_significant}
        rows.append(row)
    return rows


def _comparison_cells(
    plan: PlanSummary, comparisons: Comparisons, steps: tuple[Sequence[str], Sequence[str]], opening: str
) -> dict[str, object]:
    """Cells that compare the potency of a plan with that of the first one, in steps of each near an opening."""
    first = comparisons.first
    if plan is first or not all(steps) or opening not in [*first.openings, ANY]:
        return dict(NOT_COMPARED)
    part: PartDifference = comparisons.part(plan, steps, opening)
    return {"potency_ratio": ratio_text(part.difference), "verdict": part.verdict, "differs": part.differs}


def step_rows(comparisons: Comparisons, settings: HazardSettings) -> list[dict]:
    """One row for each step of each plan; steps of one name follow each other, in order of time.

    The chance is that of the largest class within the smallest distance of any opening, while the step lasts.
    """
    plans = comparisons.plans
    start = {step: plan.dates(step)[0] for plan in plans for step in plan.steps}
    rows = []
    sizes = list(settings.sizes)
    for step in sorted(start, key=lambda one: start[one]):
        mining = [plan for plan in plans if step in plan.steps]
        for place, plan in enumerate(mining):
            rows.append(
                {
                    "step": step if not place else "",
                    "mines": listed_names(plan.mines(step)) or DASH,
                    "mined": number(plan.mined([step])),
                    "energy": number(plan.means([step]).energy / ENERGY_UNIT),
                    "chance": chance_with_interval(
                        *plan.chance(ANY, settings.distances[0], sizes[-1], step, yearly=False)
                    )
                    if sizes
                    else "",
                    "plan": plan.name,
                    **mean_cells(plan, plan.means([step])),
                    **_comparison_cells(
                        plan, comparisons, ([step], [one for one in plans[0].steps if one == step]), ANY
                    ),
                }
            )
    return rows


def opening_rows(comparisons: Comparisons) -> list[dict]:
    """One row for each opening and plan, over all steps; of many openings those with most potency."""
    plans = comparisons.plans
    potency: dict[str, float] = {}
    for plan in plans:
        for opening in plan.openings:
            potency[opening] = max(potency.get(opening, 0.0), plan.means(plan.steps, opening).potency)
    shown = sorted((one for one in potency if potency[one] > 0.0), key=lambda one: -potency[one])[:MAX_OPENINGS]
    rows = []
    for opening in (one for one in potency if one in shown):
        mining = [plan for plan in plans if opening in plan.openings]
        for place, plan in enumerate(mining):
            rows.append(
                {
                    "opening": opening if not place else "",
                    "plan": plan.name,
                    "step": plan.mined_in(opening) or "before",
                    **mean_cells(plan, plan.means(plan.steps, opening)),
                    **_comparison_cells(
                        plan, comparisons, comparisons.steps(plan) if plan is not plans[0] else ([], []), opening
                    ),
                }
            )
    return rows


def matrix(plan: PlanSummary, settings: HazardSettings, comparisons: Comparisons) -> list[dict]:
    """Rows of a plan's risk matrix: classes of size, the largest first; each has a cell for every distance.

    `ratio` of a cell: the chance per year over that of the first plan. Plans that are not told apart share a class.
    """
    rows = []
    for size, magnitude in reversed(settings.sizes.items()):
        cells = []
        for distance in settings.distances:
            chance, interval = plan.chance(ANY, distance, size)
            whole_plan = plan.chance(ANY, distance, size, yearly=False)
            cells.append(
                {
                    "yearly": chance_with_interval(chance, interval),
                    "often": frequency_text(chance, plan.yearly_number(ANY, distance, size)),
                    "likelihood": settings.likelihood(comparisons.class_chance(plan, distance, size))
                    if np.isfinite(chance)
                    else "",
                    "ratio": ratio_text(comparisons.chance(plan, distance, size))
                    if plan is not comparisons.first and np.isfinite(chance)
                    else "",
                    "whole": chance_with_interval(*whole_plan),
                    "shade": round(float(np.clip(chance, 0.0, 1.0)) ** 0.5, 2) if np.isfinite(chance) else 0.0,
                }
            )
        rows.append({"size": size, "magnitude": typeset(f"{magnitude:g}"), "cells": cells})
    return rows


def exposed_rows(plans: Sequence[PlanSummary], settings: HazardSettings) -> list[dict]:
    """Openings by the yearly chance of the largest class within the smallest distance, plan by plan."""
    if not settings.sizes:
        return []
    size, distance = list(settings.sizes)[-1], settings.distances[0]
    chances = {
        (plan.name, opening): plan.chance(opening, distance, size) for plan in plans for opening in plan.openings
    }
    names = list(dict.fromkeys(opening for plan in plans for opening in plan.openings))
    most = {name: np.nanmax([0.0, *(chances[one][0] for one in chances if one[1] == name)]) for name in names}
    shown = sorted((name for name in names if most[name] > 0.0), key=lambda name: -most[name])[:MAX_OPENINGS]
    return [
        {
            "opening": name,
            "cells": [
                chance_with_interval(*chances[(plan.name, name)]) if (plan.name, name) in chances else DASH
                for plan in plans
            ],
        }
        for name in shown
    ]


def quantiles(draws: NDArray) -> tuple[float, NDArray]:
    """Median and 95 % interval (2,) of draws."""
    return float(np.median(draws)), np.quantile(draws, INTERVAL_95, method="nearest")


def forecast_rows(plans: Sequence[PlanSummary]) -> list[dict]:
    """One row for each step that is ahead: number, potency and largest event, median and interval; of a plan with fewer
    than MIN_RUNS runs the median of the number alone."""
    rows = []
    for plan in plans:
        for step in plan.ahead:
            part = plan.outcome.sel(step=step)
            counted, potency, largest = (part[f"forecast_{name}"].values for name in ("number", "potency", "largest"))
            row = {"plan": plan.name, "step": step, "mines": listed_names(plan.mines(step)) or DASH}
            middle, ends = quantiles(counted)
            few = int(plan.outcome.attrs["runs"]) < MIN_RUNS  # to say how another run would differ
            row["number"] = f"{middle:.0f}" if few else f"{middle:.0f} ({ends[0]:.0f} to {ends[1]:.0f})"
            row |= {"potency": DASH, "largest": DASH, "measured": DASH}
            if rate := plan.measured_rates[0].get(step):
                row["measured"] = f"{rate.value:.0f} ({rate.lower:.0f} to {rate.upper:.0f})"
            if np.isfinite(potency).all() and not few:
                middle, ends = quantiles(potency)
                row["potency"] = f"{number(middle)} ({between(ends)})"
                middle, ends = quantiles(largest)
                row["largest"] = f"{_largest(plan, middle)} ({' to '.join(_largest(plan, end) for end in ends)})"
            rows.append(row)
    return rows


def measured_text(plans: Sequence[PlanSummary]) -> str:
    """State what numbers by measures are, and which measure weighs most; empty where no plan has any."""
    weights: dict[str, float] = next((plan.measured_rates[1] for plan in plans if plan.measured_rates[0]), {})
    if not weights:
        return ""
    best = max(weights, key=lambda label: weights[label])
    name = next(measure.name for measure in MEASURES if measure.label == best)
    return (
        "Numbers by measures do not go by the events of the runs. They follow from failed volume, plastic work and "
        "released energy of the plan's own run, and from a part that goes on without mining, by laws of the recorded "
        f"steps. Of the measures, {name} has forecast the recorded steps best (weight {percent(weights[best])}). "
        "Chances do not contain these numbers."
    )


def _largest(plan: PlanSummary, size: float) -> str:
    """The largest event (log10 m3) as magnitude; none where there is no event."""
    return fixed(plan.magnitude(size), 1) if np.isfinite(size) else "none"


def write_table(path: Path, plans: Sequence[PlanSummary], settings: HazardSettings) -> None:
    """Numbers by plan, step and opening as CSV, atomically."""
    rows = []
    for plan in plans:
        for step in [*plan.steps, ALL_STEPS]:
            steps = plan.steps if step == ALL_STEPS else [step]
            for opening in [*plan.openings, ANY]:
                means = plan.means(steps, opening)
                row: dict[str, object] = {
                    "plan": plan.name,
                    "step": step,
                    "opening": opening,
                    "days": plan.days(steps),
                    "events": means.number,
                    "potency, m3": means.potency,
                    "largest, log10 m3": means.largest,
                    "energy released, J": means.energy if opening == ANY else np.nan,
                    "failed volume, m3": means.failed if opening == ANY else np.nan,
                }
                for size in settings.sizes:
                    for distance in settings.distances:
                        chance, ends = plan.chance(opening, distance, size, step)
                        name = f"chance per year, {size} within {distance:g} m"
                        row |= {name: chance, f"{name}, lower": ends[0], f"{name}, upper": ends[1]}
                rows.append(row)
    with atomic_path(path) as temporary:
        pd.DataFrame(rows).to_csv(temporary, index=False, float_format="%.6g")
