"""The months of the record on the page of the baselines: sentences, rows of tables, and files of numbers."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from baselines.map_scores import CEILING, MIN_CLUSTERS, SIGNIFICANCE, Estimate, MapScores, adjusted, verdict_of
from baselines.month_maps import FIRST_PRIOR_EVENTS, PRIOR_LINE, PRIOR_MODEL, PRIOR_NAMES
from baselines.months import MEASURES, Months, Rate
from catalogs.report.text import NEAREST, between, fixed, hundredths, number, percent, plural, whole
from common.datasets import atomic_path

OF_RECORD = ("all_earlier", "last")  # Maps that need a record; the others of the table need none.


def times(gain, rounding: str = NEAREST) -> str:
    """How many times as probable a recorded place is with this mean gain, nats: the geometric mean over events.

    >>> times(1.0), times(-0.1)
    ('2.7 times', '0.90 times')
    """
    return f"{factor(gain, rounding)} times"


def factor(gain, rounding: str = NEAREST) -> str:
    """The number of `times`, as a form of `between`."""
    return number(np.exp(float(gain)), 2, rounding)


def sentences(months: Months) -> list[str]:
    """Compare the pipeline's map with maps of the record and maps that need no record; then test the numbers.

    With too few independent clusters there is no verdict on the maps.
    """
    scores, labels = months.scores, list(months.maps.labels)
    mean, names = dict(zip(labels, scores.mean(), strict=True)), months.maps.labels
    pipeline = next(iter(months.maps.models))
    if not scores.common.any() or not any(np.isfinite(mean[one]) for one in OF_RECORD):
        return [
            "No month has an earlier one in the record, so there is no map of earlier months. Give baselines.since, if "
            "the record begins before the dated steps.",
        ]
    steps = len(np.unique(scores.step[scores.common]))
    best = max((one for one in OF_RECORD if np.isfinite(mean[one])), key=lambda one: mean[one])
    others = [one for one in labels if one not in (*OF_RECORD, pipeline, "mixed", *PRIOR_NAMES, CEILING)]
    tests = {
        (pipeline, best): ("the pipeline's map", "that map of the record"),
        **{(pipeline, one): ("the pipeline's map", f"the map “{names[one]}”") for one in others},
        ("mixed", "all_earlier"): ("the map of all earlier months, half mixed with the pipeline's", "it without that"),
    }
    joined = "the map of all earlier months with the pipeline's as a prior"
    if PRIOR_MODEL in labels and np.isfinite(mean[PRIOR_MODEL]):
        tests[PRIOR_MODEL, "all_earlier"] = joined, "the map of all earlier months"
        if PRIOR_LINE in labels and np.isfinite(mean[PRIOR_LINE]):
            tests[PRIOR_MODEL, PRIOR_LINE] = joined, "that with the line of the face as a prior"
    leads = [scores.lead(*pair) for pair in tests]
    raised = adjusted([lead.p_value for lead in leads]) if scores.has_intervals else [np.nan] * len(leads)
    first, *rest = (_lead(lead, p, *words) for lead, p, words in zip(leads, raised, tests.values(), strict=True))
    lines = [
        f"In {plural(steps, 'step')} with earlier months, the place of a recorded event is on average "
        f"{times(mean[pipeline])} as probable under the pipeline's map as under a uniform rate, and "
        f"{times(mean[best])} under the best map of the record ({names[best]}). {first}".strip()
    ]
    lines += rest if scores.has_intervals else [too_few_clusters(scores)]
    return [*lines, *_prior_sentences(months), *_rate_sentences(months)]


def _prior_sentences(months: Months) -> list[str]:
    """State how many recorded events a prior map is worth in the last step."""
    return [
        f"In the last step the map “{PRIOR_NAMES[label]}” takes its prior for "
        f"{plural(int(worth[-1]), 'recorded event')}: so many made the events of the steps before it most probable "
        f"({FIRST_PRIOR_EVENTS:g} if none was scored)."
        for label, worth in months.maps.prior_events.items()
        if len(worth)
    ]


def _rate_sentences(months: Months) -> list[str]:
    """Say, by metres and by days, for how many steps the rate of all earlier months fits the number (N test)."""
    lines = []
    for measure in MEASURES:
        rates = [row.all_earlier[measure] for row in months.rates]
        p_values = np.array([rate.p_value for rate in rates])
        tested = p_values[np.isfinite(p_values)]
        if len(tested):
            fits = int((adjusted(tested) >= SIGNIFICANCE).sum())
            lines.append(
                f"By {measure}, the rate of all earlier months fits the number of {fits} of "
                f"{plural(len(tested), 'step')} (N test; chance makes a right rate misfit any of them in "
                f"{percent(SIGNIFICANCE)} of records)."
            )
        elif any(np.isfinite(rate.expected) for rate in rates):
            lines.append(f"There are too few independent clusters to test the rate by {measure} (N test).")
    return lines


def too_few_clusters(scores: MapScores) -> str:
    """Say that a record has too few independent clusters for a verdict."""
    return (
        f"The recorded events form {plural(scores.clusters, 'cluster')}, which are worth "
        f"{fixed(scores.effective_clusters, 1)} of one size; {MIN_CLUSTERS:g} are needed. These are too few "
        "independent clusters to say which places events better."
    )


def _lead(lead: Estimate, p_value: float, name: str, than: str) -> str:
    """Say how many times as probable one map makes recorded places as another, and whether that may be chance.

    Empty if it is not known.
    """
    if not np.isfinite(p_value):
        return ""
    return (
        f"Under {name} it is {times(lead.value)} as probable as under {than} (95 % interval "
        f"{between(lead.interval, factor)}), which is {verdict_of(p_value)} (T test, {p_text(p_value)})."
    )


def p_text(p_value: float) -> str:
    """A p-value in words of a table."""
    return "p < 0.001" if p_value < 0.001 else f"p = {number(p_value, 2)}"


def map_rows(months: Months) -> list[dict]:
    """A row for each map: its gain in each step and in all that every map forecasts, with interval."""
    counted = range(len(months.steps))
    by_step = np.array([months.scores.mean(step) for step in counted]).reshape(len(months.steps), -1)
    mean, interval = months.scores.mean(), months.scores.interval()
    rows = []
    for row, name in enumerate(months.maps.labels.values()):
        ends = between(interval[row], hundredths)
        value = hundredths(mean[row])
        rows.append(
            {
                "name": name,
                "steps": [hundredths(by_step[step, row]) for step in counted],
                "all": value if not np.isfinite(interval[row]).all() else f"{value} ({ends})",
            }
        )
    return rows


def nuisance_rows(months: Months) -> list[dict]:
    """A row for each map: its gain in all common steps for each choice."""
    return [
        {"name": name, "cells": [hundredths(gain[row]) for _, gain in months.nuisances]}
        for row, name in enumerate(months.maps.labels.values())
    ]


def rate_rows(months: Months) -> list[dict]:
    """A row for each step: metres, days, numbers and potency by these, and the number that earlier months predict."""

    def predicted(rate: Rate) -> str:
        expected = number(rate.expected)
        return expected if not np.isfinite(rate.p_value) else f"{expected} ({p_text(rate.p_value)})"

    return [
        {
            "step": step,
            "amounts": [number(row.amount[measure]) for measure in MEASURES],
            "number": whole(row.number),
            "per": [number(_per(row.number, row.amount[measure])) for measure in MEASURES],
            "potency": [number(_per(row.potency, row.amount[measure])) for measure in MEASURES],
            "expected": [predicted(of[measure]) for of in (row.all_earlier, row.last) for measure in MEASURES],
        }
        for step, row in zip(months.steps, months.rates, strict=True)
    ]


def _per(value: float, amount: float) -> float:
    return value / amount if amount > 0.0 else np.nan


def write_months(path: Path, months: Months) -> None:
    """Gain of each map in each step and in all that every map forecasts, as CSV, atomically."""
    rows = []
    for index, step in [*enumerate(months.steps), (None, "all")]:
        mean, interval = months.scores.mean(index), months.scores.interval(index)
        own = months.scores.common if index is None else months.scores.step == index
        for row, (label, name) in enumerate(months.maps.labels.items()):
            rows.append(
                {
                    "map": label,
                    "name": name,
                    "step": step,
                    "recorded events": int(own.sum()),
                    "gain, nats per event": mean[row],
                    "gain, lower": interval[row, 0],
                    "gain, upper": interval[row, 1],
                }
            )
    _write(path, rows)


def write_rates(path: Path, months: Months, more: Sequence[Mapping[str, float]] = ()) -> None:
    """Numbers of each step by metres and by days, as CSV, atomically; more: further columns of each step."""
    _write(
        path,
        [
            {
                "step": step,
                **{f"{measure}": row.amount[measure] for measure in MEASURES},
                "recorded events": row.number,
                "recorded potency, m3": row.potency,
                **{
                    f"{what}, {since} by {measure}": getattr(of[measure], key)
                    for since, of in (("all earlier", row.all_earlier), ("last", row.last))
                    for measure in MEASURES
                    for what, key in (("expected events", "expected"), ("p-value", "p_value"))
                },
                **others,
            }
            for step, row, others in zip(months.steps, months.rates, more or [{}] * len(months.steps), strict=True)
        ],
    )


def _write(path: Path, rows: list[dict]) -> None:
    with atomic_path(path) as temporary:
        pd.DataFrame(rows).to_csv(temporary, index=False, float_format="%.6g")
