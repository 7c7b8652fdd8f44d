"""Convergence of each stage to equilibrium.

The template is "convergence.html.j2".
"""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

from catalogs.figures import style
from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery

PANELS_PER_ROW = 3
MAX_PANELS = 18  # The figure shows the stages with the most iterations; the table has all.
MAX_POINTS_PER_CURVE = 4000  # More points of one curve cannot be distinguished in a panel.


def section(evidence: Evidence, gallery: Gallery) -> dict:
    """Content of the section on convergence: figure (None before any stage), number of stages that it shows, and table
    (attributes and number of new failures of each stage)."""
    drawn = with_most_iterations(evidence.stages)
    figure = gallery.add("convergence", convergence(drawn)) if drawn else None
    failures = [int(stage["convergence_new_failures"].values.sum()) for stage in evidence.stages]
    return {
        "figure": figure,
        "panels": len(drawn),
        "table": list(zip([stage.attrs for stage in evidence.stages], failures, strict=True)),
    }


def with_most_iterations(stages: list[xr.Dataset]) -> list[xr.Dataset]:
    """The MAX_PANELS stages with the most iterations, in their order; of equal ones the earlier."""
    count = np.array([int(stage.attrs["iterations"]) for stage in stages])
    return [stages[index] for index in np.sort(np.argsort(-count, kind="stable")[:MAX_PANELS])]


def running_iteration(iteration: np.ndarray) -> np.ndarray:
    """Iteration counted through the whole stage, where the recorded one starts from zero in each relaxation."""
    iteration = np.asarray(iteration, dtype=np.int64)
    restart = np.flatnonzero(np.diff(iteration) < 0) + 1
    offset = np.zeros(len(iteration), dtype=np.int64)
    offset[restart] = iteration[restart - 1] + (iteration[restart] <= 0)
    return iteration + np.cumsum(offset)


def convergence(stages: list[xr.Dataset]) -> Figure:
    """One panel per stage: unbalanced ratio of the whole mine (line), tolerance (dashed), new failures (bars)."""
    columns = min(PANELS_PER_ROW, len(stages))
    rows = -(-len(stages) // columns)
    figure = style.new_figure(height=2.6 * rows + 0.4)
    array = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
    for axes, stage in zip(array, stages, strict=False):
        _panel(axes, stage, first=axes.get_subplotspec().is_first_col())
    for axes in array[len(stages) :]:
        axes.set_axis_off()
    return figure


def _panel(axes: Axes, stage: xr.Dataset, first: bool) -> None:
    name = stage.attrs.get("step") if stage.attrs.get("stage") == "step" else "elastic"
    axes.set_title(str(name))
    axes.set_xlabel("iteration")
    axes.set_yscale("log")
    axes.yaxis.set_minor_locator(NullLocator())
    if first:
        axes.set_ylabel("unbalanced force ratio (1)")
    ratio = stage["convergence_unbalanced_ratio"].values
    if not (ratio > 0).any():  # an axis of logarithms has no place for zero
        axes.text(0.5, 0.5, "nothing to solve", transform=axes.transAxes, ha="center", color=style.OUTLINE)
        return
    iteration = running_iteration(stage["convergence_iteration"].values)
    cells = stage["convergence_cells"].values
    # A part of the mine in equilibrium says nothing of the mine, which has the more cells the more are split.
    whole = np.flatnonzero(cells == np.maximum.accumulate(cells))
    whole = whole[:: -(-len(whole) // MAX_POINTS_PER_CURVE)]
    shown = np.where(ratio > 0, ratio, np.nan)[whole]
    increment = stage["convergence_increment"].values
    starts = np.flatnonzero(np.diff(increment)) + 1
    _mark(axes, iteration[starts], 1.0, color="#cccccc", linewidth=0.7)
    generation = stage["convergence_generation"].values
    generations = np.flatnonzero((np.diff(generation) != 0) & (np.diff(increment) == 0)) + 1
    _mark(axes, iteration[generations], 0.03, color=style.OUTLINE, linewidth=0.5)
    axes.plot(iteration[whole], shown, color=style.MODELLED, linewidth=1.0, marker="." if len(whole) < 60 else None)
    axes.axhline(float(stage.attrs["tolerance"]), color="k", linestyle="--", linewidth=0.8)
    axes.set_xlim(-0.03 * max(iteration[-1], 1), 1.03 * max(iteration[-1], 1))
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    failures = stage["convergence_new_failures"].values
    if failures.any():
        twin = axes.twinx()
        twin.spines["right"].set_visible(True)
        twin.vlines(iteration[failures > 0], 0, failures[failures > 0], color=style.RECORDED, linewidth=1.6, alpha=0.75)
        twin.set_ylim(0, failures.max() * 2.2)
        twin.yaxis.set_major_locator(MaxNLocator(4, integer=True))
        twin.tick_params(axis="y", colors=style.RECORDED)
        twin.set_ylabel("new failures", color=style.RECORDED)
        axes.set_zorder(twin.get_zorder() + 1)
        axes.patch.set_visible(False)


def _mark(axes: Axes, iteration: np.ndarray, share: float, **look) -> None:
    """Lines from the bottom of a panel up to a share of its height; as one artist, since there may be hundreds."""
    axes.vlines(iteration, 0.0, share, transform=axes.get_xaxis_transform(), zorder=0, **look)
