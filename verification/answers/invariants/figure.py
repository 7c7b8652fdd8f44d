"""Figure of the invariants: errors against round-off, the column, and errors against cell size."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.figures.style import MODELLED, OUTLINE, RECORDED, applied, new_figure
from verification.answers.invariants.closed_form import Column
from verification.answers.invariants.operator import Solved
from verification.rows import Row

MIN_DRAWN_ERROR = 1e-18  # Errors of exactly zero are drawn here.
MARKERS = {"section": "o", "block": "s"}


def draw(
    rows: list[Row], columns: Mapping[str, tuple[Column, *tuple[np.ndarray, ...]]], series: dict[str, list[Solved]]
) -> Figure:
    """Three panels. rows: those with an allowed error. columns: closed form and profile by variant. series: by kind."""
    with applied():
        figure = new_figure(height=4.8)
        left, middle, right = figure.subplots(1, 3, width_ratios=[1, 1, 1])
        _errors(left, rows)
        _columns(middle, columns)
        _orders(right, series)
    return figure


def _errors(axes: Axes, rows: list[Row]) -> None:
    kinds = list(dict.fromkeys(row.quantity.split("_")[0] for row in rows))
    for place, kind in enumerate(kinds):
        for variant, marker, shift in (("section", "o", 0.12), ("block", "s", -0.12)):
            chosen = [row for row in rows if row.quantity.startswith(f"{kind}_{variant}")]
            error = [max(row.error, MIN_DRAWN_ERROR) for row in chosen]
            axes.plot(error, [place + shift] * len(error), marker, color=MODELLED, markersize=5, alpha=0.6)
        bound = next(row.allowed for row in rows if row.quantity.startswith(kind))
        axes.plot([bound, bound], [place - 0.35, place + 0.35], color=RECORDED, linewidth=2)
    axes.set_xscale("log")
    axes.set_xlim(0.3 * MIN_DRAWN_ERROR, 1e-9)
    axes.set_yticks(range(len(kinds)), kinds)
    axes.invert_yaxis()
    axes.set_xlabel("error, share of the largest term (0: 1e-18)")
    axes.set_title("Round-off: found, allowed")


def _columns(axes: Axes, columns: Mapping[str, tuple]) -> None:
    for name, (_, nodes, moved, _, _) in columns.items():
        kind = name.split("_")[1]
        axes.plot(1e3 * moved, nodes, MARKERS[kind], color=MODELLED, markersize=5, alpha=0.5, label=f"nodes, {kind}")
    if columns:
        column = next(iter(columns.values()))[0]
        z = np.linspace(0.0, column.top, 200)
        axes.plot(1e3 * column.displacement(z), z, color=OUTLINE, linewidth=1, label="closed form")
        axes.axhline(column.joint, color=OUTLINE, linewidth=0.6, linestyle=":")
        axes.annotate("fill", (0.03, column.joint), xycoords=("axes fraction", "data"), va="bottom")
        axes.annotate("rock", (0.03, column.joint), xycoords=("axes fraction", "data"), va="top")
        axes.legend(loc="lower left")
    axes.set_xlabel("vertical displacement (mm)")
    axes.set_ylabel("height (m)")
    axes.set_title("Column under its weight")


def _orders(axes: Axes, series: dict[str, list[Solved]]) -> None:
    for kind, solved in series.items():
        marker = MARKERS[kind.split(",")[0]]
        style = {"marker": marker, "fillstyle": "full" if " 1 " in kind else "none"}
        cell = np.array([one.cell for one in solved])
        error = np.array([one.displacement for one in solved])
        axes.loglog(cell, error, "-", color=MODELLED, label=f"displacement, {kind}", **style)
        axes.loglog(cell, [one.stress for one in solved], ":", color=RECORDED, label=f"stress, {kind}", **style)
    cells = sorted({one.cell for solved in series.values() for one in solved})
    if cells:
        finest = min((solved[-1] for solved in series.values()), key=lambda one: one.displacement)
        below = 0.5 * finest.displacement / finest.cell**2 * np.array(cells) ** 2
        axes.loglog(cells, below, color=OUTLINE, linewidth=1, linestyle="--", label="h²")
        axes.set_xticks(cells, [f"{cell:g}" for cell in cells])
        axes.minorticks_off()
    axes.set_xlabel("finest cell (m)")
    axes.set_ylabel("L2 error, share of the field")
    axes.set_title("Smooth field")
    if series:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7.5)
