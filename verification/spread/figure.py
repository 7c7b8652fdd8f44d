"""Every run of every source as a dot, one panel for each quantity, with the standard deviation between them."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.spread.runs import MEMBERS, QUANTITIES, SOURCES, Catalogue
from verification.spread.variances import Variance

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # Okabe and Ito (2008)
NEAR = 0.12  # of a panel's values: labels closer than that are one
APART = 0.28  # of a row: between the line of dots and that of their standard deviation


def draw(base: Catalogue, found: list[Variance]) -> Figure:
    """base: the mine's own run, a vertical line."""
    figure = style.new_figure(height=6.2)
    panels = figure.subplots(3, 2).flat
    panels[-1].set_axis_off()
    for panel, quantity in zip(panels, QUANTITIES, strict=False):
        rows = [variance for variance in found if variance.quantity is quantity]
        every = np.concatenate([variance.defined for variance in rows])
        near = NEAR * np.ptp(every) if len(every) else 0.0
        for place, (variance, colour) in enumerate(zip(rows, COLOURS, strict=True)):
            _draw_row(panel, place, variance, colour, near)
        if np.isfinite(quantity.of(base)):
            panel.axvline(quantity.of(base), color="#888888", linewidth=0.8, zorder=0)
        panel.set_yticks(range(len(rows)), [SOURCES[variance.source] for variance in rows])
        panel.set_ylim(len(rows) - 0.4, -0.6)
        panel.margins(x=0.08)
        panel.set_title(quantity.title)
        panel.grid(axis="x", color="#e8e8e8", linewidth=0.6)
    return figure


def _draw_row(panel: Axes, place: int, variance: Variance, colour: str, near: float) -> None:
    panel.plot(variance.values, np.full(len(variance.values), place), "o", color=colour, markersize=5, alpha=0.8)
    if variance.source != MEMBERS:
        for text, value in _labels(variance, near):
            panel.annotate(text, (value, place), xytext=(0, 5), textcoords="offset points", fontsize=7)
    if np.isfinite(variance.deviation):
        panel.errorbar(
            variance.defined.mean(), place + APART, xerr=variance.deviation, color=colour, capsize=3, linewidth=1.2
        )
    if variance.why:
        panel.annotate(
            f"none: {variance.why}",
            (0.01, place - 0.3),
            xycoords=("axes fraction", "data"),
            fontsize=7,
            color="#666666",
        )


def _labels(variance: Variance, near: float) -> list[tuple[str, float]]:
    """What runs are called, and where: one text for those whose values are near each other."""
    found: list[tuple[str, float]] = []
    for index in np.argsort(variance.values, kind="stable"):
        label, value = variance.labels[index], variance.values[index]
        if not np.isfinite(value):
            continue
        if found and value - found[-1][1] <= near:
            found[-1] = (f"{found[-1][0]}, {label}", found[-1][1])
        else:
            found.append((label, float(value)))
    return found
