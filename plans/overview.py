"""The first screen of the page: what each plan mines, where and when the worst is, and how likely a large event is.

Number and potency are those that the runs make. Chances and forecasts are multiplied by the record's ratio to the runs
(plans.factors), so that ratio stands beside both.
"""

from collections.abc import Mapping
from functools import partial

import numpy as np

from catalogs.report.text import DASH, between, number, percent, plural, typeset
from plans.comparisons import Comparisons
from plans.differences import MIN_RUNS, POTENCY
from plans.layout import ANY, PlanSummary
from plans.sentences import chance_with_interval, count, frequency_text, listed_names, ratio_text, step_range
from plans.settings import HazardSettings


def overview(comparisons: Comparisons, settings: HazardSettings, titles: Mapping[str, str]) -> dict:
    """Rows of the plans, head of the column of chances (empty without), and the sentence on the record.

    titles: by name of a plan, for those that have one.
    """
    plans = comparisons.plans
    has_chance = bool(settings.sizes) and all(plan.runs >= MIN_RUNS for plan in plans)
    head = ""
    if has_chance:
        size, magnitude = list(settings.sizes.items())[-1]
        head = f"chance per year: {size} ({typeset(f'Mw {magnitude:g}')} or more) within {settings.distances[0]:g} m"
    rows = [_row(plan, comparisons, settings, has_chance) | {"title": titles.get(plan.name, "")} for plan in plans]
    return {"rows": rows, "chance": head, "record": record_sentence(plans[0])}


def worst(plan: PlanSummary) -> dict[str, str]:
    """Opening and step with most potency, each with its share of the plan's; dashes without potency."""
    whole = plan.means(plan.steps).potency
    if not whole > 0.0:
        return {"where": DASH, "when": DASH}
    near = {opening: plan.means(plan.steps, opening).potency for opening in plan.openings}
    by_step = {step: plan.means([step]).potency for step in plan.steps}
    found = {}
    for name, values in (("where", near), ("when", by_step)):
        place = max(values, key=lambda one: values[one])
        found[name] = f"{place} ({percent(values[place] / whole)})"
    return found


def record_sentence(plan: PlanSummary) -> str:
    """How many events are recorded for each modelled one, and which numbers contain that; empty without a record."""
    low, middle, high = np.atleast_1d(plan.outcome.attrs["record_factor"])
    if not np.isfinite(middle):
        return ""
    said = f"{number(middle, 2)} ({between((low, high), partial(number, digits=2))})"
    return (
        f"For each event that the runs make in {step_range(plan.counted)}, {said} events are expected to be recorded, "
        "as in the steps with a record. Chances and forecasts contain this factor. What the runs make does not."
    )


def _row(plan: PlanSummary, comparisons: Comparisons, settings: HazardSettings, has_chance: bool) -> dict:
    means = plan.means(plan.steps)
    openings = [opening for step in plan.steps for opening in plan.mines(step)]
    row = {
        "plan": plan.name,
        "mined": f"{number(plan.mined(plan.steps))} m³ in {plural(len(openings), 'opening')}",
        "openings": listed_names(openings),
        "number": count(means.number),
        "potency": number(means.potency),
        "compared": DASH,
        "differs": False,
        "chance": "",
        "chance_basis": "",
        **worst(plan),
    }
    if plan is not comparisons.first and all(comparisons.steps(plan)):
        potency = comparisons.whole(plan, POTENCY)
        row |= {"compared": f"{ratio_text(potency)}: {potency.verdict}", "differs": potency.is_significant}
    elif plan is not comparisons.first:
        more, fewer = (step_range(steps) for steps in comparisons.steps(plan))
        row["compared"] = f"the same, and {more}" if more else f"the same without {fewer}" if fewer else "the same runs"
    if has_chance:
        distance, size = settings.distances[0], list(settings.sizes)[-1]
        chance, interval = plan.chance(ANY, distance, size)
        parts = [chance_with_interval(chance, interval)]
        if np.isfinite(chance):
            parts += [
                frequency_text(chance, plan.yearly_number(ANY, distance, size)),
                settings.likelihood(comparisons.class_chance(plan, distance, size)),
            ]
            row["chance_basis"] = (
                f"at the rate of {step_range(plan.counted)}{_chance_ratio(plan, comparisons, distance, size)}"
            )
        row["chance"] = ", ".join(filter(None, parts))
    return row


def _chance_ratio(plan: PlanSummary, comparisons: Comparisons, distance: float, size: str) -> str:
    """The ratio of a plan's chance to that of the first plan, with its verdict, to be appended; empty for the first."""
    if plan is comparisons.first:
        return ""
    ratio = comparisons.chance(plan, distance, size)
    if ratio.is_shared or ratio.is_empty:
        return ""
    return f"; {ratio_text(ratio)} times that of {comparisons.first.name}: {ratio.verdict}"
