"""Panels of views on one figure: one scale for all, placed so that little paper stays empty."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.figures import style
from catalogs.figures.views import AXIS_LABELS, COORDINATE_NAMES, MIN_COORDINATE_IN_WHOLE_METRES, View

LEFT, RIGHT, TOP, BOTTOM, KEY, BAR = 0.85, 0.15, 0.5, 0.55, 0.35, 0.95  # inches: labels of a panel, key, colour bar
DIGIT_WIDTH = 0.075  # inches
KEY_ENTRY_WIDTH = 1.2  # inches
MIN_TITLED_WIDTH = 1.65  # inches, into which a column's title fits
MAX_SHORT_HEIGHT = 1.2  # inches; a lower panel has no room for a long axis label
# Arrangements of panels are considered whose scale is at least this share of the largest.
MIN_COMMON_SCALE_SHARE = 0.75


def panels(
    views: list[View],
    lower: np.ndarray,
    upper: np.ndarray,
    columns: int | None = None,
    bar: bool = False,
    tallest: float = 9.5,
) -> tuple[Figure, list[Axes], Axes | None]:
    """A figure with one scale for all its panels, in reading order, room for a key below and, if asked, a colour bar.

    columns: if None, the arrangement that leaves least paper empty of those that show the scene nearly as large as any
    does; tallest: inches. Placed by hand: matplotlib's layouts give panels of equal aspect different scales, or paper
    between them.
    """
    places = _places(views, lower, upper, columns, bar, tallest)
    scale = _scale(views, lower, upper, places, bar, tallest)
    widths, heights = _extents(views, lower, upper, places)
    widths, heights = [max(scale * width, MIN_TITLED_WIDTH) for width in widths], [scale * height for height in heights]
    columns = len(widths)
    width = sum(widths) + (LEFT + RIGHT) * columns + BAR * bar
    height = sum(heights) + (TOP + BOTTOM) * len(heights) + KEY
    figure = style.new_figure(width, height, layout=None)
    array = []
    for number, view in enumerate(views):
        row, column = places[number]
        left = sum(widths[:column]) + LEFT * (column + 1) + RIGHT * column
        bottom = KEY + sum(heights[row + 1 :]) + TOP * (len(heights) - row - 1) + BOTTOM * (len(heights) - row)
        size = scale * (upper - lower)[view.axes]
        axes = figure.add_axes([left / width, bottom / height, size[0] / width, size[1] / height])
        dress(axes, view, lower, upper)
        if size[1] < MAX_SHORT_HEIGHT:
            axes.set_ylabel(f"{COORDINATE_NAMES[view.vertical]} (m)")
        wide = max(0.65, DIGIT_WIDTH * (1 + max(len(f"{edge[view.horizontal]:.0f}") for edge in (lower, upper))))
        prune = (
            "both" if np.abs([lower, upper]).max() >= MIN_COORDINATE_IN_WHOLE_METRES else None
        )  # long numbers reach beyond the panel
        axes.locator_params(axis="x", nbins=int(np.clip(size[0] / wide, 1, 7)), prune=prune)
        axes.locator_params(axis="y", nbins=int(np.clip(size[1] / 0.4, 1, 7)))
        array.append(axes)
    if not bar:
        return figure, array, None
    tall = min(height - KEY - TOP - BOTTOM, 3.6)
    place = [(width - BAR + 0.1) / width, 1 - (TOP + tall) / height, 0.17 / width, tall / height]
    return figure, array, figure.add_axes(place)


def _places(views: list[View], lower, upper, columns: int | None, bar: bool, tallest: float) -> list[tuple[int, int]]:
    """Row and column of each panel."""
    counts = range(1, len(views) + 1) if columns is None else [columns]
    found = [[divmod(number, count) for number in range(len(views))] for count in counts]
    scales = [_scale(views, lower, upper, places, bar, tallest) for places in found]
    large = [
        places for places, scale in zip(found, scales, strict=True) if scale >= MIN_COMMON_SCALE_SHARE * max(scales)
    ]
    extent = np.maximum(upper - lower, 1e-3)
    filled = sum(float(np.prod(extent[view.axes])) for view in views)

    def covered(places) -> float:
        """Share of the paper's width and of the panels' heights that is filled."""
        widths, heights = _extents(views, lower, upper, places)
        across = _scale(views, lower, upper, places, bar, tallest) * sum(widths) / style.PAGE_WIDTH
        return filled / (sum(widths) * sum(heights)) * min(across, 1.0)

    return max(large, key=covered)


def _extents(views: list[View], lower, upper, places: list[tuple[int, int]]) -> tuple[list[float], list[float]]:
    """Widths of the columns and heights of the rows, m."""
    extent = np.maximum(upper - lower, 1e-3)
    sizes = [
        (row, column, extent[view.horizontal], extent[view.vertical])
        for view, (row, column) in zip(views, places, strict=True)
    ]
    return (
        [max(w for _, at, w, _ in sizes if at == column) for column in range(max(c for _, c in places) + 1)],
        [max(h for at, _, _, h in sizes if at == row) for row in range(max(r for r, _ in places) + 1)],
    )


def _scale(views: list[View], lower, upper, places: list[tuple[int, int]], bar: bool, tallest: float) -> float:
    """Inches per metre at which panels so placed fit the paper."""
    widths, heights = _extents(views, lower, upper, places)
    columns = len(widths)
    across = style.PAGE_WIDTH - (LEFT + RIGHT) * columns - BAR * bar
    down = tallest - (TOP + BOTTOM) * len(heights) - KEY
    return min(across / sum(widths), down / sum(heights))


def key(figure: Figure, handles: list, columns: int = 8) -> None:
    """A key in the paper left for it below the panels."""
    fit = max(int(figure.get_figwidth() // KEY_ENTRY_WIDTH), 1)
    figure.legend(handles=handles, loc="lower center", ncols=min(len(handles), columns, fit), borderaxespad=0.3)


def dress(axes: Axes, view: View, lower: np.ndarray, upper: np.ndarray) -> None:
    """Title, axis names with units, equal scales and limits."""
    axes.set_title(view.title, y=style.TITLE_PLACE)
    axes.set_xlabel(AXIS_LABELS[view.horizontal])
    axes.set_ylabel(AXIS_LABELS[view.vertical])
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlim(lower[view.horizontal], upper[view.horizontal])
    axes.set_ylim(lower[view.vertical], upper[view.vertical])
    axes.ticklabel_format(style="plain", useOffset=False)
