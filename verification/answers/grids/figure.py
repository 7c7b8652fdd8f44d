"""Figure of the grids: error against the number of cells and against processor time, a row of panels for each scene."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from catalogs.figures import style
from verification.answers.grids.runs import SPHERE, STOPE, Run, starts, work

# Title, colour (Okabe and Ito 2008), mark, and offset of the labels in points: those of two grids often lie together.
LOOKS = {
    "regular": ("regular grid", "#555555", "s", (6, 3)),
    "boxes": ("nested boxes", "#e69f00", "D", (6, 3)),
    "adaptive": ("cells that follow walls and failed rock", "#0072b2", "o", (-6, -9)),
    "walls": ("cells that follow walls only", "#cc79a7", "^", (6, 3)),
}
ERRORS = {
    SPHERE: "error of the hoop stress at the wall (%)",
    STOPE: "difference of potency by blocks (%)",
}
TITLES = {SPHERE: "Sphere in elastic rock", STOPE: "Stope in brittle rock"}


def draw(runs: list[Run]) -> Figure:
    """Both scenes; each point is labelled with its finest cell."""
    figure = style.new_figure(height=7.4)
    panels = figure.subplots(2, 2)
    for (cells, time), scene in zip(panels, ERRORS, strict=True):
        for grid in LOOKS:
            members = [run for run in runs if (run.scene, run.grid) == (scene, grid)]
            plot(cells, members, [run.cells for run in members])
            plot(time, members, [work(run, runs) for run in members])
        cells.set(title=f"{TITLES[scene]}: cells", ylabel=ERRORS[scene], xlabel="cells at the end")
        time.set(title=f"{TITLES[scene]}: time", ylabel=ERRORS[scene])
        told = max((starts(run, runs) for run in runs if run.scene == scene), default=np.nan)
        if np.isfinite(told):
            time.axvspan(time.get_xlim()[0], told, color="#eeeeee", zorder=0, label="less time than the starts take")
        time.set_xlabel("processor time of all stages, less the start of their processes (s)")
    figure.legend(*panels[1, 1].get_legend_handles_labels(), loc="outside lower center", ncols=len(LOOKS) + 1)
    return figure


def plot(panel: Axes, members: list[Run], costs: list[float]) -> None:
    """One grid's error against its cost, log-log."""
    if not members:
        return
    title, colour, mark, offset = LOOKS[members[0].grid]
    panel.plot(
        costs, [100 * run.error for run in members], mark, linestyle="-", color=colour, label=title, markersize=5
    )
    for run, cost in zip(members, costs, strict=True):
        if np.isfinite(cost):
            place = (cost, 100 * run.error)
            look = {"fontsize": 7, "color": colour, "ha": "right" if offset[0] < 0 else "left"}
            panel.annotate(f"{run.cell:g} m", place, xytext=offset, textcoords="offset points", **look)
    panel.set(xscale="log", yscale="log")
    panel.margins(0.09)
    panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
        axis.set_minor_formatter(NullFormatter())
    panel.grid(which="major", color="#e2e2e2", linewidth=0.6)
