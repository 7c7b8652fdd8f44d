"""Figure of the spread: a panel for each quantity, a dot for each run of a source, and their standard deviation."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.catalog_spread.runs import MEMBERS, QUANTITIES, SOURCES, Catalogue
from verification.catalog_spread.variances import values_of, variances

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # Okabe and Ito (2008)
CHARACTER_WIDTH = 0.015  # Width of a character of a label, as a share of a panel's width.
DEVIATION_OFFSET = 0.28  # Distance of a standard deviation from its dots, in rows.


def draw(base: Catalogue, sources: dict[str, list[Catalogue]]) -> Figure:
    """All panels. base: the mine's own run, drawn as a vertical line."""
    values = values_of(sources)
    table, by_row = variances(values), dict(list(values.groupby(["quantity", "source"])))
    figure = style.new_figure(height=6.8)
    panels = figure.subplots(3, 2).flat
    panels[-1].set_axis_off()
    for panel, quantity in zip(panels, QUANTITIES, strict=False):
        rows = list(table[table["quantity"] == quantity.title].itertuples())
        runs = [by_row[row.quantity, row.source] for row in rows]
        for place, (row, shown, colour) in enumerate(zip(rows, runs, COLOURS, strict=True)):
            panel.plot(shown["value"], np.full(len(shown), place), "o", color=colour, markersize=5, alpha=0.8)
            if np.isfinite(row.standard_deviation):
                look = {"color": colour, "capsize": 3, "linewidth": 1.2}
                panel.errorbar(row.mean, place + DEVIATION_OFFSET, xerr=row.standard_deviation, **look)
        if np.isfinite(quantity.of(base)):
            panel.axvline(quantity.of(base), color="#888888", linewidth=0.8, zorder=0)
        panel.set_yticks(range(len(rows)), list(map(_title, rows, runs)))
        panel.set_ylim(len(rows) - 0.4, -0.6)
        panel.margins(x=0.08)
        panel.set_title(quantity.title)
        panel.grid(axis="x", color="#e8e8e8", linewidth=0.6)
        if not any(row.defined_in for row in rows):
            panel.set_xticks([])
        for place, (row, shown) in enumerate(zip(rows, runs, strict=True)):
            if row.source != MEMBERS:  # These have numbers only, which say nothing.
                for text, value in _labels(shown, CHARACTER_WIDTH * np.ptp(panel.get_xlim())):
                    panel.annotate(text, (value, place), xytext=(0, 5), textcoords="offset points", fontsize=7)
    return figure


def _title(row, runs: pd.DataFrame) -> str:
    """Source of a row of the table, and the number of runs that define the quantity where not all do."""
    return SOURCES[row.source] + (f"\nin {row.defined_in} of {len(runs)} runs" if row.not_defined else "")


def _labels(runs: pd.DataFrame, character: float) -> list[tuple[str, float]]:
    """Labels of runs and the place of each. A label that would reach the next one takes it in."""
    found: list[tuple[str, float]] = []
    known = runs.dropna(subset="value").sort_values("value", kind="stable")
    for label, value in zip(known["run"], known["value"], strict=True):
        if found and value - found[-1][1] <= character * (len(found[-1][0]) + 1):
            found[-1] = (f"{found[-1][0]}, {label}", found[-1][1])
        else:
            found.append((label, value))
    return found
