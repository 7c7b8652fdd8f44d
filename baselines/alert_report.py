"""Alarms on the page of the baselines: sentences, rows of the table, Molchan's diagram, and a file of numbers."""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from baselines.alerts import ALERT_SHARES, AlertScores
from baselines.months import Months
from catalogs.figures import style
from catalogs.report.text import DASH, between, hundredths, number
from common.datasets import atomic_path

CURVE_SHARES = np.concatenate([np.linspace(0.0, 0.1, 51)[:-1], np.linspace(0.1, 1.0, 91)])
# Okabe and Ito's colours and further ones: as many as there are maps
COLOURS = (
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#cc79a7",
    "#e69f00",
    "#56b4e9",
    "#000000",
    "#999999",
    "#7f3c8d",
    "#a5aa99",
    "#882255",
    "#44aa99",
)
LINES = ("-", "--", "-.", ":")


ROCK, DRIVES = "rock", "metres of drives"  # What is on alert.


def _labels(alerts: AlertScores) -> list[str]:
    """Labels of the maps that have a forecast of the events that all maps forecast."""
    return [label for label, value in zip(alerts.labels, alerts.skill.mean(), strict=True) if np.isfinite(value)]


def _rate(alerts: AlertScores, label: str, share: float) -> str:
    """A hit rate with its interval, in per cent."""
    rate, interval = alerts.hit_rate(label, share)
    form = partial(number, digits=2)
    ends = between(100.0 * interval, form)
    return f"{form(100.0 * rate)} %" if ends == DASH else f"{form(100.0 * rate)} % ({ends} %)"


def alert_sentences(months: Months) -> list[str]:
    """State which share of the next step's events lies in the rock on alert, for the best map and the pipeline's own,
    and with the metres of drives on alert, if there are drives.

    Empty without an event that a map of earlier months forecasts.
    """
    lines = _sentences(months, months.alerts, f"the {ROCK}")
    if lines and months.drive_alerts is not None:
        lines += _sentences(months, months.drive_alerts, f"the {DRIVES}")
    return lines


def _sentences(months: Months, alerts: AlertScores, what: str) -> list[str]:
    """Sentences on one kind of what is on alert."""
    labels = _labels(alerts)
    if not any(label in labels for label in ("all_earlier", "last")):
        return []
    names, skill = months.maps.labels, alerts.skill
    mean = dict(zip(skill.labels, skill.mean(), strict=True))
    best, pipeline = max(labels, key=lambda label: mean[label]), next(iter(months.maps.models), "")
    shares = [f"{100 * share:g}" for share in ALERT_SHARES]
    ahead = f"With {', '.join(shares[:-1])} and {shares[-1]} % of {what} on alert"

    def held(label: str) -> str:
        rates = [_rate(alerts, label, share) for share in ALERT_SHARES]
        return f"{', '.join(rates[:-1])} and {rates[-1]} of the events of the next step"

    lines = [f"{ahead}, the map with the largest area skill ({names[best]}) holds {held(best)}."]
    if pipeline in labels and pipeline != best:
        lines.append(f"The pipeline's map holds {held(pipeline)}.")
    return lines


def alert_rows(months: Months) -> list[dict]:
    """A row for each map: its area skill score and its hit rates of rock on alert, with intervals."""
    return _rows(months, months.alerts)


def drive_rows(months: Months) -> list[dict]:
    """The same of metres of drives on alert; empty without drives."""
    return [] if months.drive_alerts is None else _rows(months, months.drive_alerts)


def _rows(months: Months, alerts: AlertScores) -> list[dict]:
    skill, names = alerts.skill, months.maps.labels
    mean, interval = skill.mean(), np.clip(skill.interval(), 0.0, 1.0)
    rows = []
    for label in _labels(alerts):
        row = skill.labels.index(label)
        value, ends = hundredths(mean[row]), between(interval[row], hundredths)
        rows.append(
            {
                "name": names[label],
                "skill": value if ends == DASH else f"{value} ({ends})",
                "rates": [_rate(alerts, label, share) for share in ALERT_SHARES],
            }
        )
    return rows


def no_skill_text(alerts: AlertScores) -> str:
    """Area skill scores of maps that know nothing: 95 % of them."""
    return between(alerts.no_skill(CURVE_SHARES)[1], hundredths)


def draw_molchan(months: Months) -> Figure:
    """Draw the hit rate of each map against the share of the rock on alert, and of the metres of drives if there are
    any, with the band of maps that know nothing."""
    kinds = {ROCK: months.alerts} | ({DRIVES: months.drive_alerts} if months.drive_alerts is not None else {})
    figure = style.new_figure(height=4.6 if len(kinds) == 1 else 6.0)
    labels = _labels(months.alerts)
    row = {label: place for place, label in enumerate(labels)}
    panels = figure.subplots(1, len(kinds), sharey=True, squeeze=False)[0]
    for axes, (what, alerts) in zip(panels, kinds.items(), strict=True):
        band, _ = alerts.no_skill(CURVE_SHARES)
        axes.fill_between(
            100 * CURVE_SHARES, *(100 * band.T), color="#d9d9d9", linewidth=0, label="knows nothing (95 %)", zorder=1
        )
        for label in _labels(alerts):
            axes.plot(
                100 * CURVE_SHARES, 100 * alerts.curve(label, CURVE_SHARES), label=months.maps.labels[label],
                color=COLOURS[row[label] % len(COLOURS)], linestyle=LINES[row[label] % len(LINES)], linewidth=1.4,
                zorder=2,
            )  # fmt: skip
        for share in ALERT_SHARES:
            axes.axvline(100 * share, color=style.OUTLINE, linewidth=0.5, zorder=0)
        axes.set(xlim=(0, 100), ylim=(0, 100), xlabel=f"share of the {what} on alert (%)")
        axes.set_title("Events in rock on alert" if len(kinds) == 1 else f"By {what}")
    panels[0].set_ylabel("share of events hit (%)")
    if len(kinds) == 1:
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper")
    else:
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def write_alerts(path: Path, months: Months) -> None:
    """Area skill score and hit rates of each map, of each step and of all that every map forecasts, as CSV, atomically;
    of rock, then of metres of drives if there are any."""
    rows = _numbers(months, months.alerts, ROCK)
    if months.drive_alerts is not None:
        rows += _numbers(months, months.drive_alerts, DRIVES)
    with atomic_path(path) as temporary:
        pd.DataFrame(rows).to_csv(temporary, index=False, float_format="%.6g")


def _numbers(months: Months, alerts: AlertScores, what: str) -> list[dict]:
    """Rows of the file; what: is on alert."""
    skill, rows = alerts.skill, []
    for index, step in [*enumerate(months.steps), (None, "all")]:
        mean, interval = skill.mean(index), np.clip(skill.interval(index), 0.0, 1.0)
        own = skill.common if index is None else skill.step == index
        for row, label in enumerate(alerts.labels):
            values = {
                "map": label,
                "name": months.maps.labels[label],
                "step": step,
                "recorded events": int(own.sum()),
                "area skill score": mean[row],
                "area skill score, lower": interval[row, 0],
                "area skill score, upper": interval[row, 1],
            }
            for share in ALERT_SHARES:
                rate, ends = alerts.hit_rate(label, share, index)
                name = f"hit rate at {100 * share:g} % on alert"
                values |= {name: rate, f"{name}, lower": ends[0], f"{name}, upper": ends[1]}
            rows.append(values | {"on alert": what})
    return rows
