"""The plans in sentences: how they differ, where their events are, how likely large ones are, and what is missing."""

import json
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from catalogs.report.text import DASH, between, fixed, number, plural, typeset, whole
from plans.comparisons import Comparisons
from plans.differences import MIN_RUNS, NUMBER, POTENCY, Difference
from plans.layout import COARSE, DRAW, PlanSummary
from plans.record import CELLS, CHANCE, LAW, RECORD, ROCK, RUNS
from plans.settings import HazardSettings

# Uncertainties that an interval contains (plans.record), in words.
IN_WORDS = {
    CHANCE: "chance",
    CELLS: "what the cells change",
    RECORD: "by how much the record differs from the model",
    ROCK: "what the calibration leaves open",
    LAW: "what is not known of the law of sizes",
}
SMALLEST_CHANCE, LARGEST_CHANCE = 1e-4, 0.999  # Chances beyond are written as less or more than these.
MAX_NAMED = 4


def ratio_text(difference: Difference) -> str:
    """A ratio with its interval, as a table shows it."""
    if difference.is_shared:
        return "the same runs"
    if difference.is_empty:
        return DASH
    if not np.isfinite(difference.interval).any():
        return number(difference.value, 2)
    interval = between(difference.interval, partial(number, digits=2))
    return f"{number(difference.value, 2)} ({interval})"


def chance_text(chance: float) -> str:
    """A chance as per cent, from less than SMALLEST_CHANCE to more than LARGEST_CHANCE.

    >>> chance_text(0.034), chance_text(0.87654), chance_text(0.9999), chance_text(1e-6)
    ('3.4 %', '88 %', 'more than 99.9 %', 'less than 0.01 %')
    """
    if not np.isfinite(chance):
        return DASH
    if chance < SMALLEST_CHANCE:
        return f"less than {100 * SMALLEST_CHANCE:g} %"
    return f"more than {100 * LARGEST_CHANCE:g} %" if chance > LARGEST_CHANCE else f"{_percents(chance)} %"


def _percents(chance: float) -> str:
    """A chance in per cent, two digits; the ends of all chances as 0 and 100."""
    if chance < SMALLEST_CHANCE or chance > LARGEST_CHANCE:
        return "0" if chance < SMALLEST_CHANCE else "100"
    return f"{100 * chance:.{1 if chance > 0.995 else 0}f}" if chance >= 0.1 else f"{100 * chance:.2g}"


def chance_with_interval(chance: float, interval: Sequence[float] | NDArray) -> str:
    """A chance and its interval as per cent. Where the runs make no event, the upper end only.

    >>> chance_with_interval(0.2, (0.05, 0.5)), chance_with_interval(0.0, (0.0, 0.3))
    ('20 % (5 to 50 %)', 'up to 30 %')
    """
    if not np.isfinite(chance):
        return DASH
    low, high = (float(end) for end in interval)
    if chance == 0.0:
        return f"up to {_percents(high)} %"
    if low > LARGEST_CHANCE:
        return chance_text(chance)
    return f"{chance_text(chance)} ({_percents(low)} to {_percents(high)} %)"


def count(value: float) -> str:
    """A number of events; a mean of runs with one decimal.

    >>> count(21.0), count(21.25), count(1234.5)
    ('21', '21.2', '1\u202f234')
    """
    if value.is_integer() or value >= 1000.0:
        return whole(value)
    return fixed(value, 1)


def listed_names(names: Sequence[str]) -> str:
    """Names in a sentence; of many the first ones."""
    more = f" and {len(names) - MAX_NAMED} more" if len(names) > MAX_NAMED else ""
    return ", ".join(names[:MAX_NAMED]) + more


def step_range(steps: Sequence[str]) -> str:
    """Steps in order, in a sentence: the first and the last of three or more."""
    return " and ".join(steps) if len(steps) < 3 else f"{steps[0]} to {steps[-1]}"


def frequency_text(chance: float, number_a_year: float) -> str:
    """Number of events a year, where one at least is nearly sure; else empty."""
    return f"about {number(number_a_year, 2)} a year" if chance > LARGEST_CHANCE else ""


def collapsed(plans: Sequence[PlanSummary]) -> list[str]:
    """State the plans, and the runs of other plans, that are left out, since rock found no equilibrium in them."""
    lines = [
        f"{plan.name} is left out: in its own run rock finds no equilibrium in step {plan.collapsed}, so the plan "
        "cannot be mined as it is."
        for plan in plans
        if plan.collapsed
    ]
    for plan in plans:
        count = 0 if plan.collapsed else int((~plan.stands).sum())
        if count:
            lines.append(
                f"In {count} of {plural(len(plan.stands), 'run')} of {plan.name} rock finds no equilibrium. "
                f"{'It is' if count == 1 else 'They are'} left out, and so are the runs of other plans that would be "
                "compared with them. What is left shows this plan better than it is."
            )
    return [*lines, "docs/how-to/loose-rock.md says what to do."] if lines else []


def verdict(comparisons: Comparisons, settings: HazardSettings) -> list[str]:
    """The first sentences of the page: how the plans differ, and whether chances of large events are known."""
    first = comparisons.first
    means = first.means(first.steps)
    lines = [_comparison(plan, comparisons) for plan in comparisons.plans[1:]] or [
        f"{first.name} makes {count(means.number)} events in {step_range(first.steps)}: {number(means.potency)} m³ of "
        "potency."
    ]
    return [*lines, *_without_chances(comparisons, settings)]


def _comparison(plan: PlanSummary, comparisons: Comparisons) -> str:
    """Compare a plan with the first one."""
    first, steps = comparisons.first, comparisons.steps(plan)
    if not steps[0] and not steps[1]:
        return f"{plan.name} and {first.name} are the same runs."
    if not steps[0] or not steps[1]:
        longer, shorter, more = (plan, first, steps[0]) if steps[0] else (first, plan, steps[1])
        means, rest = longer.means(more), longer.means([step for step in longer.steps if step not in more])
        return (
            f"{longer.name} mines as {shorter.name} does, and goes on with {step_range(more)}, which adds "
            f"{count(means.number)} events and {number(means.potency)} m³ of potency to {count(rest.number)} events "
            f"and {number(rest.potency)} m³ of the steps before."
        )
    potency, events = (comparisons.whole(plan, quantity) for quantity in (POTENCY, NUMBER))
    means = plan.means(steps[0])
    if means.number and not first.means(steps[1]).number:
        return (
            f"{first.name} makes nothing in {step_range(steps[1])}; {plan.name} makes {count(means.number)} events, "
            f"{number(means.potency)} m³ of potency, in {step_range(steps[0])}: {_verdict(events)}."
        )
    if potency.is_empty:
        return f"Neither {plan.name} nor {first.name} makes anything in the steps that differ."
    text = (
        f"{plan.name} releases {_ratio(potency)} the potency of {first.name}{_interval(potency)}: {_verdict(potency)}. "
    )
    text += f"It makes {_ratio(events)} the events{_interval(events)}: {_verdict(events)}."
    volumes = plan.mined(steps[0]), first.mined(steps[1])
    if volumes[1] > 0 and abs(volumes[0] / volumes[1] - 1.0) > 0.01:
        text += f" It mines {number(volumes[0] / volumes[1], 2)} times the volume."
    return text


def _verdict(difference: Difference) -> str:
    """The verdict of a difference within a sentence."""
    text = difference.verdict
    if RUNS in difference.lacks:
        return f"{text}, since a difference needs {MIN_RUNS} runs of each plan"
    if text.startswith("larger"):
        return f"a difference {text}"
    return f"a {text}" if text.startswith("difference") else text


def _ratio(difference: Difference) -> str:
    return f"{number(difference.value, 2)} times"


def _interval(difference: Difference) -> str:
    ends = between(difference.interval, partial(number, digits=2))
    return f" (95 % interval {ends})" if np.isfinite(difference.interval).any() else ""


def _without_chances(comparisons: Comparisons, settings: HazardSettings) -> list[str]:
    """State that there are too few events for a chance. Of too few runs, and of classes that are too small, `missing`
    says so."""
    plans = comparisons.plans
    if not settings.sizes or any(plan.runs < MIN_RUNS or plan.outcome.attrs["law_source"] != "none" for plan in plans):
        return []
    return ["There are too few events to say how likely large ones are."]


def interval_contents(comparisons: Comparisons) -> str:
    """State the uncertainties that intervals of ratios and of chances contain, in a sentence each."""
    ratios = [set(one.contains) for one in comparisons.every() if CHANCE in one.contains]
    chances = [set(json.loads(plan.outcome.attrs["contains"])) for plan in comparisons.plans if plan.runs >= MIN_RUNS]
    lines = []
    for what, held in (("ratios", ratios), ("chances", chances)):
        words = [word for name, word in IN_WORDS.items() if held and name in set.intersection(*held)]
        if words:
            lines.append(f"Intervals of {what} contain {_listed(words)}.")
    return " ".join(lines)


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def missing(comparisons: Comparisons, settings: HazardSettings) -> list[str]:
    """State the uncertainties that intervals lack, and the key of the mine file that adds each."""
    plans = comparisons.plans
    lines = []
    asked = min(plan.asked for plan in plans)
    if (runs := min(comparisons.pairs(plan) for plan in plans)) < MIN_RUNS:
        has, more = f"Each plan has {plural(runs, 'run')}", MIN_RUNS
        if runs < asked:
            has = f"Of {plural(asked, 'run')} of each plan, {whole(runs)} {'is' if runs == 1 else 'are'} left"
            more = max(asked, MIN_RUNS) + asked - runs
        lines.append(
            f"{has}, too few to say how another run would differ. Plans with fewer than {MIN_RUNS} runs get no "
            f"interval, no verdict and no chance. Set hazard.runs to {more} or more."
        )
    if any(plan.has_lost(COARSE) for plan in plans):
        lines.append(
            "Intervals do not contain what the cells change, since rock finds no equilibrium in a plan on cells of "
            "twice the size."
        )
    elif not all(plan.has_runs(COARSE) for plan in plans):
        lines.append(
            "Intervals do not contain what the cells change, since a plan has no run on cells of twice the size "
            "(grid_convergence)."
        )
    elif any(CELLS in one.lacks for one in comparisons.every()):
        lines.append(
            "Intervals of ratios do not contain what the cells change, since a plan makes nothing on cells of twice "
            "the size that could be compared."
        )
    if any(plan.has_lost(DRAW) and ROCK in json.loads(plan.outcome.attrs["lacks"]) for plan in plans):
        lines.append(
            "Intervals do not contain what is not known of the rock, since it finds no equilibrium in too many of its "
            "draws."
        )
    elif not all(plan.has_runs(DRAW) for plan in plans):
        lines.append(
            "Intervals do not contain what is not known of the rock. After snakemake calibrate, set hazard.rock to "
            "posterior."
        )
    for plan in plans:
        if differs := json.loads(plan.outcome.attrs["differs_in"]):
            lines.append(
                f"{plan.name} is a mine file of its own, which differs from the mine file in {_listed(differs)}, too. "
                "Its ratios say what all of that changes, not the sequence alone."
            )
    below = {
        f"{name} ({typeset(f'Mw {magnitude:g}')})": None
        for plan in plans
        for name, magnitude in settings.sizes.items()
        if np.isfinite(plan.floor) and magnitude < plan.magnitude(plan.floor)
    }
    if below:
        smallest = max(plan.magnitude(plan.floor) for plan in plans if np.isfinite(plan.floor))
        smallest_text = typeset(f"Mw {np.ceil(100.0 * smallest) / 100.0:g}")
        lines.append(
            f"There is no chance of events that are {' or '.join(below)}, since the runs do not resolve such "
            f"small ones. The smallest magnitude with a chance is {smallest_text}."
        )
    if not settings.sizes:
        lines.append(
            "There is no chance of large events, since the mine file gives no classes of size. Give hazard.magnitudes, "
            "such as {felt: 0.0, damaging: 1.0}."
        )
    elif not settings.likelihoods:
        lines.append("Chances have no class. Give hazard.likelihoods, such as {rare: 0, possible: 0.1, likely: 0.5}.")
    return lines


def law_texts(plans: Sequence[PlanSummary]) -> list[str]:
    """State the laws of sizes, in sentences; one for plans of one law."""
    named_by: dict[str, list[str]] = {}
    for plan in plans:
        named_by.setdefault(_law_text(plan), []).append(plan.name)
    if len(named_by) == 1:
        return list(named_by)
    return [f"{listed_names(names)}: {text[0].lower()}{text[1:]}" for text, names in named_by.items()]


def _law_text(plan: PlanSummary) -> str:
    attributes = plan.outcome.attrs
    if attributes["law_source"] == "none":
        events = int(attributes["law_events"])
        return f"There {'is' if events == 1 else 'are'} {plural(events, 'event')}: too few for a law of sizes."
    whose = "the record" if attributes["law_source"] == "record" else "the runs"
    bound = [plan.magnitude(float(end)) for end in np.atleast_1d(attributes["law_bound_interval"])]
    slope = between(np.atleast_1d(attributes["law_b_interval"]), partial(number, digits=2))
    return (
        f"Sizes follow {whole(attributes['law_events'])} events of {whose} from log P {number(attributes['floor'], 3)} "
        f"on: b = {number(attributes['law_b'], 2)} ({slope}), and an upper end at Mw "
        f"{between(bound, partial(number, digits=2))}."
    )
