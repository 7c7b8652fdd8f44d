"""Figure of the spread: a panel for each quantity, a dot for each run of a source, and their standard deviation."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.spread.runs import MEMBERS, QUANTITIES, SOURCES, Catalogue
from verification.spread.variances import Variance

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # Okabe and Ito (2008)
CHARACTER_WIDTH = 0.015  # Width of a character of a label, as a share of a panel's width.
DEVIATION_OFFSET = 0.28  # Distance of a standard deviation from its dots, in rows.


def draw(base: Catalogue, found: list[Variance]) -> Figure:
    """All panels. base: the mine's own run, drawn as a vertical line."""
    figure = style.new_figure(height=6.8)
    panels = figure.subplots(3, 2).flat
    panels[-1].set_axis_off()
    for panel, quantity in zip(panels, QUANTITIES, strict=False):
        rows = [variance for variance in found if variance.quantity is quantity]
        for place, (variance, colour) in enumerate(zip(rows, COLOURS, strict=True)):
            _draw_row(panel, place, variance, colour)
        if np.isfinite(quantity.of(base)):
            panel.axvline(quantity.of(base), color="#888888", linewidth=0.8, zorder=0)
        panel.set_yticks(range(len(rows)), [_title(variance) for variance in rows])
        panel.set_ylim(len(rows) - 0.4, -0.6)
        panel.margins(x=0.08)
        panel.set_title(quantity.title)
        panel.grid(axis="x", color="#e8e8e8", linewidth=0.6)
        if not any(len(variance.defined) for variance in rows):
            panel.set_xticks([])
        for place, variance in enumerate(rows):
            _label_row(panel, place, variance)
    return figure


def _draw_row(panel: Axes, place: int, variance: Variance, colour: str) -> None:
    panel.plot(variance.values, np.full(len(variance.values), place), "o", color=colour, markersize=5, alpha=0.8)
    if np.isfinite(variance.deviation):
        panel.errorbar(
            variance.defined.mean(),
            place + DEVIATION_OFFSET,
            xerr=variance.deviation,
            color=colour,
            capsize=3,
            linewidth=1.2,
        )


def _title(variance: Variance) -> str:
    """Source of a row, and the number of runs that define the quantity where not all do."""
    runs = f"\nin {len(variance.defined)} of {len(variance.values)} runs" if variance.why else ""
    return SOURCES[variance.source] + runs


def _label_row(panel: Axes, place: int, variance: Variance) -> None:
    """Write the names of runs above their dots. Members have numbers only and are left out."""
    if variance.source != MEMBERS:
        for text, value in _labels(variance, CHARACTER_WIDTH * np.ptp(panel.get_xlim())):
            panel.annotate(text, (value, place), xytext=(0, 5), textcoords="offset points", fontsize=7)


def _labels(variance: Variance, character: float) -> list[tuple[str, float]]:
    """Labels of runs and the place of each. A label that would reach the next one takes it in."""
    found: list[tuple[str, float]] = []
    for index in np.argsort(variance.values, kind="stable"):
        label, value = variance.labels[index], variance.values[index]
        if not np.isfinite(value):
            continue
        if found and value - found[-1][1] <= character * (len(found[-1][0]) + 1):
            found[-1] = (f"{found[-1][0]}, {label}", found[-1][1])
        else:
            found.append((label, float(value)))
    return found
