"""Figure of the clustering study: clusters of each set by each method, families, time."""

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from catalogs.figures import style
from verification.answers.clustering.family_recovery import Recovery
from verification.answers.clustering.known_truth import NOISE, PointSet, index_of_clusters
from verification.plots import plot_convergence

UNCLUSTERED_COLOUR = "#b3b3b3"
SLICE_HALF_THICKNESS = 2.0  # Cells that a slice shows on either side of the middle height.


def draw(separations: dict, families: Recovery, times: dict, mechanisms: int) -> Figure:
    """All panels. separations: lists of answer.Separation by set. times: by method (see answer.time_methods)."""
    telling = {name: max(draws, key=_spread) for name, draws in separations.items()}
    heights = [_panel_height(separation.points) for separation in telling.values()]
    figure = style.new_figure(height=sum(heights) + 5.2)
    top, bottom = figure.subfigures(2, 1, height_ratios=[sum(heights) + 0.7, 4.5])
    _draw_sets(top, telling, heights)
    left, middle, right = bottom.subplots(1, 3)
    _draw_table(left, families, families.index.mean(axis=2), "{:.2f}", "Families: adjusted Rand index", (0.0, 1.0))
    numbers = families.families.mean(axis=2)
    title = f"Families found (true: {mechanisms})"
    _draw_table(middle, families, np.log10(numbers), "{:.3g}", title, (np.log10(mechanisms), None), numbers)
    _draw_times(right, times)
    return figure


def _spread(separation) -> float:
    """Range of the methods' indices on one draw."""
    return float(np.ptp([index_of_clusters(separation.points, label) for label in separation.label.values()]))


def _panel_height(points: PointSet) -> float:
    """Height of a panel two inches wide, its title included, inches."""
    along, across, _ = np.ptp(points.position, axis=0)
    return 0.35 + 2.0 * (across + 3.0 * points.spacing.max()) / along


def _draw_sets(figure: SubFigure, separations: dict, heights: list[float]) -> None:
    """One row for each set, as a slice across z: the truth, then each method with its index."""
    methods = next(iter(separations.values())).label
    array = figure.subplots(len(separations), 1 + len(methods), squeeze=False, height_ratios=heights)
    for number, (name, separation) in enumerate(separations.items()):
        points = separation.points
        for axes, (method, label) in zip(
            array[number], {"truth": points.truth, **separation.label}.items(), strict=True
        ):
            _draw_clusters(axes, points, label)
            index = name if method == "truth" else f"{index_of_clusters(points, label):.3f}"
            axes.set_title(index, fontsize=9.5, loc="left" if method == "truth" else "center")
            if number == 0:
                axes.annotate(method, (0.5, 1.0), (0, 22), "axes fraction", "offset points", ha="center", fontsize=11)
    figure.supxlabel(
        f"Failed particles within {SLICE_HALF_THICKNESS:g} cells of the middle height of each set; a colour is one "
        "cluster, grey a particle alone.\nNumbers: adjusted Rand index, scattered particles left out; 1 is the truth. "
        "Of several draws the one where the methods differ most.",
        fontsize=9,
    )


def _draw_clusters(axes: Axes, points: PointSet, label: NDArray) -> None:
    """Particles coloured by cluster, the largest clusters first. A particle alone is grey."""
    count = np.bincount(label[label != NOISE], minlength=1)
    alone = (label == NOISE) | (count[label] < 2)
    rank = np.empty(len(count), int)
    rank[np.argsort(-count, kind="stable")] = np.arange(len(count))
    palette = mpl.colormaps["tab10"](np.arange(10))[[0, 1, 2, 3, 4, 5, 6, 8, 9], :3]
    colour = np.where(alone[:, None], mpl.colors.to_rgb(UNCLUSTERED_COLOUR), palette[rank[label] % len(palette)])
    height = points.position[:, 2]
    order = np.argsort(height, kind="stable")
    order = order[np.abs(height[order] - np.median(height)) <= SLICE_HALF_THICKNESS * points.spacing.min()]
    across = np.ptp(points.position[:, 0]) / points.spacing.min()
    size = np.square(100.0 / across * points.spacing[order] / points.spacing.min())
    x, y = points.position[order, :2].T
    axes.scatter(x, y, s=size, c=colour[order], marker="s", linewidths=0, rasterized=True)
    axes.set(aspect="equal", xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def _draw_table(
    axes: Axes, found: Recovery, values: NDArray, form: str, title: str, limits: tuple, shown: NDArray | None = None
) -> None:
    """Heat map of scatter by threshold, with its numbers. Cells are outlined where recovery is certain."""
    shown = values if shown is None else shown
    image = axes.imshow(values, cmap="viridis", vmin=limits[0], vmax=limits[1], aspect="auto")
    for row, column in np.ndindex(values.shape):
        dark = np.less(image.norm(values[row, column]), 0.6)
        text = form.format(shown[row, column])
        axes.text(column, row, text, ha="center", va="center", color="white" if dark else "black", fontsize=8)
        if found.certain[row, column]:
            edge = mpl.patches.Rectangle(
                (column - 0.45, row - 0.45), 0.9, 0.9, fill=False, edgecolor="#d55e00", linewidth=1.8
            )
            axes.add_patch(edge)
    axes.set_xticks(range(len(found.threshold)), [f"{value:g}" for value in found.threshold])
    axes.set_yticks(range(len(found.scatter)), [f"{value:g}" for value in found.scatter])
    what = "closeness threshold (outlined: recovery certain)"
    axes.set(title=title, xlabel=what, ylabel="largest turn (degrees)")


def _draw_times(axes: Axes, times: dict) -> None:
    """Seconds against particles, logarithmic, with a line of slope 1."""
    lines = {
        method: ([count for count, _, _ in line], [seconds for _, seconds, _ in line]) for method, line in times.items()
    }
    labels = {"title": "Time to separate", "xlabel": "particles", "ylabel": "time (s)"}
    plot_convergence(axes, lines, 1.0, "in proportion", ticks=False, **labels)
