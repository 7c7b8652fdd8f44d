"""Forecast numbers on the page of the baselines: sentences, rows of tables, a figure, and columns of rates.csv."""

from functools import partial

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from baselines.map_scores import adjusted, verdict_of
from baselines.measures import MEASURES
from baselines.month_report import factor, p_text
from baselines.months import Months
from baselines.number_forecasts import (
    ALL_BY_DAYS,
    ALL_BY_METRES,
    ALL_LAWS,
    CONTROLS,
    LAST,
    LAST_BY_DAYS,
    LAST_BY_METRES,
    NumberScores,
)
from catalogs.figures import style
from catalogs.report.text import DASH, NEAREST, between, fixed, hundredths, number, percent, plural, whole

RULE_NAMES = {
    LAST: "last step",
    LAST_BY_METRES: "last step, by metres",
    ALL_BY_METRES: "all earlier steps, by metres",
    LAST_BY_DAYS: "last step, by days with a moving face",
    ALL_BY_DAYS: "all earlier steps, by days",
}
NAMES = {ALL_LAWS: "laws of all measures together", **RULE_NAMES}
NAMES |= {measure.label: f"law of {measure.name}" for measure in MEASURES}
two_digits = partial(number, digits=2)


def _with(value: str, ends: str) -> str:
    """A value with its interval, if it has one."""
    return value if DASH in (value, ends) else f"{value} ({ends})"


def _controls(scores: NumberScores) -> list[str]:
    """Labels of the simpler rules that have a forecast of the steps that are scored."""
    return [label for label in CONTROLS if label in scores.forecasts and len(scores.scores(label, scores.common))]


def is_scored(months: Months) -> bool:
    """True if there is a step whose number a law and a simpler rule forecast."""
    scores = months.numbers
    return bool(scores.weights) and bool(scores.common.any()) and bool(len(scores.scores(ALL_LAWS, scores.common)))


def number_sentences(months: Months) -> list[str]:
    """Compare the number by laws of modelled measures with the best of the simpler rules, and state the law."""
    if not is_scored(months):
        return ["There are too few steps with a modelled measure to forecast the number of another one."]
    scores = months.numbers
    steps, controls = scores.common, _controls(scores)
    missed, ends = scores.misses(ALL_LAWS, steps)
    interval = f"; 95 % interval {between(ends, hundredths)}" if np.isfinite(ends).all() else ""
    lines = [
        f"In {plural(int(steps.sum()), 'step')} the number of events is forecast from earlier steps by modelled "
        f"measures. It is off by a factor of {factor(missed)} (r.m.s. of ln {hundredths(missed)}{interval})."
    ]
    if controls:
        leads = [scores.lead(ALL_LAWS, label, steps) for label in controls]
        p_values = [lead.p_value for lead in leads]
        raised = adjusted(p_values) if np.isfinite(p_values).all() else np.full(len(leads), np.nan)
        best = min(range(len(controls)), key=lambda place: leads[place].value)
        said = (
            f"The best simpler rule by its probabilities ({RULE_NAMES[controls[best]]}) is off by a factor of "
            f"{factor(scores.misses(controls[best], steps)[0])}."
        )
        if np.isfinite(raised[best]):
            said += (
                f" The laws make the recorded number of a step {factor(leads[best].value)} times as probable (95 % "
                f"interval {between(leads[best].interval, factor)}), which is {verdict_of(raised[best])} "
                f"({p_text(raised[best])})."
            )
        lines.append(said)
    return [*lines, *_law_sentence(months)]


def _law_sentence(months: Months) -> list[str]:
    """State the law of the measure with the largest weight."""
    scores = months.numbers
    last = np.flatnonzero(np.isfinite(list(scores.weights.values())).any(axis=0))
    if not len(last):
        return []
    weights = {label: weight[last[-1]] for label, weight in scores.weights.items() if np.isfinite(weight[last[-1]])}
    best = max(weights, key=lambda label: weights[label])
    measure = next(one for one in MEASURES if one.label == best)
    going_on, _ = months.laws[best].coefficients()
    return [
        f"Of the measures, {measure.name} has forecast earlier steps best (weight {percent(weights[best])}). By its "
        f"law {two_digits(going_on[1])} events a day ({between(going_on[[0, 2]], two_digits)}) come without mining."
    ]


def score_rows(months: Months) -> list[dict]:
    """A row for each forecast: by how much it misses number and potency, and how it compares with all laws together."""
    scores, potencies = months.numbers, months.potencies
    steps, mined = scores.common, scores.common & scores.mined
    labels = [label for label in scores.forecasts if len(scores.scores(label, steps))]
    rows = []
    for label in labels:
        lead = scores.lead(ALL_LAWS, label, steps)
        gain, ends = hundredths(lead.value), between(lead.interval, hundredths)
        rows.append(
            {
                "name": NAMES[label],
                "misses": [
                    _missed(*one)
                    for one in (
                        scores.misses(label, steps),
                        scores.misses(label, mined),
                        potencies.misses(label, potencies.common),
                    )
                ],
                "inside": f"{scores.inside(label, steps)} of {int(steps.sum())}",
                "score": hundredths(scores.scores(label, steps).mean()),
                "lead": DASH if label == ALL_LAWS else _with(gain, ends),
            }
        )
    return rows


def _missed(value: float, ends: NDArray) -> str:
    return _with(hundredths(value), between(ends, hundredths))


def law_rows(months: Months) -> list[dict]:
    """A row for each measure: its weight before the last step, and its law by all steps."""
    rows = []
    for measure in MEASURES:
        if measure.label not in months.laws:
            continue
        weight = months.numbers.weights.get(measure.label, np.full(1, np.nan))
        known = weight[np.isfinite(weight)]
        ends = [_with(number(one[1]), between(one[[0, 2]])) for one in months.laws[measure.label].coefficients()]
        rows.append(
            {
                "name": measure.name,
                "unit": measure.unit,
                "weight": _weight(known),
                "cells": ends,
            }
        )
    return rows


def _weight(known: NDArray) -> str:
    """Last weight of those that are known, in per cent."""
    if not len(known):
        return DASH
    return percent(known[-1]) if known[-1] >= 0.001 else "less than 0.1 %"


def step_rows(months: Months) -> list[dict]:
    """A row for each step: what was recorded, and what laws and simpler rules forecast."""
    scores, potencies = months.numbers, months.potencies
    labels = [label for label in CONTROLS if label in scores.forecasts]
    medians = {label: scores.values(label) for label in (ALL_LAWS, *labels)}
    ends, potency = scores.intervals(ALL_LAWS), potencies.values(ALL_LAWS)
    potency_ends, rows = potencies.intervals(ALL_LAWS), []
    for place, step in enumerate(months.steps):
        rows.append(
            {
                "step": step,
                "number": whole(scores.number[place]),
                "law": _with(_events(medians[ALL_LAWS][place]), between(ends[place], _events)),
                "rules": [_events(medians[label][place]) for label in labels],
                "potency": number(months.recorded_potency[place]),
                "potency_law": _with(two_digits(potency[place]), between(potency_ends[place], two_digits)),
            }
        )
    return rows


def _events(value: float, rounding: str = NEAREST) -> str:
    """A number of events, whole from ten on."""
    return fixed(value, 0 if value >= 10.0 else 1, rounding)


def rule_names(months: Months) -> list[str]:
    """Names of the simpler rules of `step_rows`."""
    return [RULE_NAMES[label] for label in CONTROLS if label in months.numbers.forecasts]


def draw_numbers(months: Months) -> Figure:
    """Draw recorded numbers, those by laws with their 95 % range, and those of the last step, by step."""
    scores = months.numbers
    figure = style.new_figure(height=3.6)
    axes = figure.subplots()
    place, ends = np.arange(len(months.steps)), scores.intervals(ALL_LAWS)
    median = scores.values(ALL_LAWS)
    axes.errorbar(
        place, median, np.abs(np.nan_to_num(ends.T - median, nan=0.0)), fmt="s", color=style.MODELLED, markersize=4,
        elinewidth=1.0, capsize=2.0, label="forecast by laws of measures (95 %)",
    )  # fmt: skip
    axes.plot(place, scores.number, "o", color=style.RECORDED, markersize=5, label="recorded")
    axes.plot(place, scores.values(LAST), "_", color=style.OUTLINE, markersize=12, label="last step's number")
    axes.set(xlabel="step", ylabel="events in the step", ylim=(0, None))
    shown = max(len(place) // 24, 1)
    axes.set_xticks(place[::shown], [months.steps[one] for one in place[::shown]], rotation=45, ha="right")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right upper")
    return figure


def number_columns(months: Months) -> list[dict[str, float]]:
    """Columns of rates.csv, for each step: amounts of measures, forecasts with intervals, and weights of measures."""
    rows: list[dict[str, float]] = [{} for _ in months.steps]

    def add(name: str, values: NDArray) -> None:
        for row, value in zip(rows, values, strict=True):
            row[name] = float(value)

    for measure in MEASURES:
        if measure.label in months.amounts and measure.label != "metres":
            add(f"{measure.name}, {measure.unit.replace('m³', 'm3')}", months.amounts[measure.label])
    for what, unit, scores in (("events", "", months.numbers), ("potency", ", m3", months.potencies)):
        for label in scores.forecasts:
            name = f"forecast {what}, {NAMES[label]}{unit}"
            ends = scores.intervals(label)
            add(name, scores.values(label))
            add(f"{name}, lower", ends[:, 0])
            add(f"{name}, upper", ends[:, 1])
    for label, weight in months.numbers.weights.items():
        add(f"weight, {NAMES[label]}", weight)
    return rows
