"""Plans and vertical sections of a scene in mine coordinates: which plane, which cells it cuts, what is mined."""

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from catalogs.figures import style

EAST, NORTH, UP = 0, 1, 2
AXIS_LABELS = ("east x (m)", "north y (m)", "elevation z (m)")
AXIS_NAMES = ("x", "y", "z")
EDGES_ABOVE = 5.0  # points: smaller cells are drawn without edges, which would hide their colour
LEFT, RIGHT, TOP, BOTTOM, KEY, BAR = 0.85, 0.15, 0.5, 0.55, 0.35, 0.95  # inches: labels of a panel, key, colour bar
DIGIT = 0.075  # inches
NARROWEST = 1.65  # inches: a column's title fits
SHORT = 1.2  # inches: no room for a long axis label
WHOLE_FROM = 1e4  # m: grid coordinates; half a cell more or less does not help to find a place
NEARLY = 0.75  # of the largest scale
INSIDE = 0.5  # a cell belongs to an excavation's outline from this share


@dataclass(frozen=True)
class View:
    """A plane of projection: its two axes, the axis it looks along and, for a cut, the coordinate (m) on that axis."""

    name: str
    horizontal: int
    vertical: int
    normal: int
    at: float | None = None

    @property
    def axes(self) -> list[int]:
        return [self.horizontal, self.vertical]

    @property
    def title(self) -> str:
        if self.at is None:
            return self.name
        at = f"{self.at:.6g}" if abs(self.at) < WHOLE_FROM else f"{self.at:.0f}"
        return f"{self.name}\n{AXIS_NAMES[self.normal]} = {at} m"


PLAN = View("Plan", EAST, NORTH, UP)
LOOKING_NORTH = View("Section looking north", EAST, UP, NORTH)
LOOKING_WEST = View("Section looking west", NORTH, UP, EAST)


def projections(grid: xr.Dataset) -> list[View]:
    """Two sections and the plan, which in two columns lies below the section along x; in 2-D the one plane."""
    if int(grid.attrs["dimension"]) == 3:
        return [LOOKING_NORTH, LOOKING_WEST, PLAN]
    return [PLAN if grid.attrs.get("plane") == "xy" else LOOKING_NORTH]


def cuts(grid: xr.Dataset, positions: np.ndarray, weights: np.ndarray) -> list[View]:
    """The same views as cuts, each through the fine layer that holds most of `weights` (positions (point, xyz) m).

    Of layers nearly as full as the fullest, the one nearest the centre of weight is taken.
    """
    views = projections(grid)
    if int(grid.attrs["dimension"]) == 2:
        return views
    lower, upper = domain(grid)
    fine = float(grid.attrs["fine_cell"])
    if not len(positions) or weights.sum() <= 0:
        positions, weights = np.atleast_2d((lower + upper) / 2), np.ones(1)
    chosen = []
    for view in views:
        layers = max(round((upper - lower)[view.normal] / fine), 1)
        layer = np.clip(((positions[:, view.normal] - lower[view.normal]) / fine).astype(int), 0, layers - 1)
        content = np.bincount(layer, weights, minlength=layers)
        full = np.flatnonzero(content >= 0.95 * content.max())
        best = full[np.argmin(np.abs(full - np.average(layer, weights=weights)))]
        chosen.append(replace(view, at=float(lower[view.normal] + (best + 0.5) * fine)))
    return chosen


def domain(grid: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner of the domain, three coordinates each (m); the axis out of a 2-D plane spans zero."""
    corners = [np.atleast_1d(grid.attrs[name]).astype(float) for name in ("domain_lower", "domain_upper")]
    if len(corners[0]) == 2:
        axes = projections(grid)[0].axes
        flat, corners = corners, [np.zeros(3), np.zeros(3)]
        for full, corner in zip(corners, flat, strict=True):
            full[axes] = corner
    return corners[0], corners[1]


def frame_limits(
    grid: xr.Dataset, points: list[np.ndarray], margin: float = 0.08, least: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Box around the excavations and `points` ((n, xyz) arrays, m), with a margin, inside the domain."""
    lower, upper = domain(grid)
    found = [piece_corners(grid), *points]
    found = np.concatenate([array.reshape(-1, 3) for array in found])
    found = found[np.isfinite(found).all(axis=1)]
    if not len(found):
        return lower, upper
    low, high = found.min(axis=0), found.max(axis=0)
    least = 6 * float(grid.attrs["fine_cell"]) if least is None else least
    pad = np.maximum(margin * (high - low).max(), least)
    return np.maximum(low - pad, lower), np.minimum(high + pad, upper)


def piece_corners(grid: xr.Dataset) -> np.ndarray:
    """Lower and upper corners of the box of every excavated cell, (2 * piece, xyz) m."""
    cell = grid["piece_cell"].values
    origin, size = grid["cell_origin"].values[cell], grid["cell_size"].values[cell]
    extent = np.zeros_like(origin)
    extent[:, projections(grid)[0].axes if int(grid.attrs["dimension"]) == 2 else [0, 1, 2]] = size[:, None]
    return np.concatenate([origin, origin + extent])


def cut_cells(grid: xr.Dataset, view: View) -> np.ndarray:
    """Indices of the cells that a view's plane cuts (all of them in 2-D)."""
    if view.at is None:
        return np.arange(grid.sizes["cell"])
    start = grid["cell_origin"].values[:, view.normal]
    return np.flatnonzero((start <= view.at) & (view.at < start + grid["cell_size"].values))


def cut_particles(state: xr.Dataset, view: View) -> np.ndarray:
    """Indices of the particles whose own cube a view's plane cuts: fill first, then rock that is most of its cube."""
    volume, rock = state["volume"].values, state["excavation"].values < 0
    _, group = np.unique(state["spacing"].values, return_inverse=True)
    full = np.zeros(int(group.max(initial=-1)) + 1)
    np.maximum.at(full, group, volume)
    cut = np.where(rock, volume > (1.0 - INSIDE) * full[group], volume > 0)  # rock and outlines meet, neither overlaps
    if view.at is not None:
        start = state["position"].values[:, view.normal] - state["spacing"].values / 2
        cut &= (start <= view.at) & (view.at < start + state["spacing"].values)
    chosen = np.flatnonzero(cut)
    return chosen[np.argsort(rock[chosen], kind="stable")]


def squares(lower: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Corner lists (n, 4, 2) of squares with lower-left corners (n, 2) and edges (n,), m."""
    unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    return lower[:, None, :] + size[:, None, None] * unit


def draw_squares(axes: Axes, lower: np.ndarray, size: np.ndarray, **colours) -> PolyCollection:
    """Draw squares as one rasterised layer; colours as for PolyCollection (array, cmap, norm or facecolors)."""
    collection = PolyCollection(
        squares(lower, size),
        rasterized=True,
        **{"edgecolors": "none", "linewidths": 0, "antialiaseds": False} | colours,
    )
    axes.add_collection(collection, autolim=False)
    return collection


def silhouette(
    grid: xr.Dataset, view: View, excavations: list[int] | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Excavated squares of a view: lower corners (n, 2), edges (n,) m, share (n,), the largest along a projection.

    excavations: indices to include, all if None. A cut takes the cells that its plane cuts, a projection all.
    """
    cell, fraction = grid["piece_cell"].values, grid["piece_fraction"].values.astype(float)
    keep = np.ones(len(cell), bool) if excavations is None else np.isin(grid["piece_excavation"].values, excavations)
    if view.at is not None:
        keep &= np.isin(cell, cut_cells(grid, view))
    cell, fraction = cell[keep], fraction[keep]
    corner, size = grid["cell_origin"].values[cell][:, view.axes], grid["cell_size"].values[cell]
    if not len(cell):
        return corner, size, fraction
    total = np.bincount(cell, fraction)[cell]  # a cell may be shared by excavations
    step, origin = float(grid.attrs["fine_cell"]) / 2, domain(grid)[0][view.axes]
    key = np.column_stack([np.rint((corner - origin) / step), np.rint(size / step)])
    key, inverse = np.unique(key, axis=0, return_inverse=True)
    share = np.zeros(len(key))
    np.maximum.at(share, inverse.ravel(), np.minimum(total, 1.0))
    return origin + key[:, :2] * step, key[:, 2] * step, share


def outline_segments(lower: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Edges (n, 2, 2) that occur once among squares of one size: the outline of their union."""
    corners = squares(lower, size)
    edges = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    quarters = np.rint((edges - lower.min(axis=0)) / (size.min() / 4)).astype(np.int64)
    key = np.sort(quarters @ np.array([1, 1 << 31]), axis=1)
    _, first, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    return edges[first[count == 1]]


def draw_excavations(
    axes: Axes, grid: xr.Dataset, view: View, planned: list[int] = (), fill: bool = True, colour: str = style.OUTLINE
) -> None:
    """Grey bodies with an outline for what is mined; a dashed outline for the excavations `planned` (indices)."""
    count = int(grid["piece_excavation"].values.max(initial=-1)) + 1
    mined = [index for index in range(count) if index not in planned]
    for group, dashed in ((mined, False), (list(planned), True)):
        lower, size, share = silhouette(grid, view, group)
        lower, size = lower[share >= INSIDE], size[share >= INSIDE]
        if not len(size):
            continue
        if fill and not dashed:
            draw_squares(axes, lower, size, facecolors=style.EXCAVATION, zorder=0.5)
        axes.add_collection(
            LineCollection(
                outline_segments(lower, size),
                colors=colour,
                linewidths=0.8,
                rasterized=True,
                linestyles=(0, (3, 2)) if dashed else "solid",
                zorder=4,
            ),
            autolim=False,
        )


def panels(
    views: list[View],
    lower: np.ndarray,
    upper: np.ndarray,
    columns: int | None = None,
    bar: bool = False,
    tallest: float = 9.5,
) -> tuple[Figure, list[Axes], Axes | None]:
    """A figure with one scale for all its panels, in reading order, room for a key below and, if asked, a colour bar.

    columns: if None, the most (least paper) that show the scene nearly as large as any does; tallest: inches.
    Placed by hand: matplotlib's layouts give panels of equal aspect different scales, or paper between them.
    """
    if columns is None:
        scales = {count: _scale(views, lower, upper, count, bar, tallest) for count in range(1, len(views) + 1)}
        columns = max(count for count, scale in scales.items() if scale >= NEARLY * max(scales.values()))
    scale = _scale(views, lower, upper, columns, bar, tallest)
    widths, heights = _extents(views, lower, upper, columns)
    widths, heights = [max(scale * width, NARROWEST) for width in widths], [scale * height for height in heights]
    width = sum(widths) + (LEFT + RIGHT) * columns + BAR * bar
    height = sum(heights) + (TOP + BOTTOM) * len(heights) + KEY
    figure = style.new_figure(width, height, layout=None)
    array = []
    for number, view in enumerate(views):
        row, column = divmod(number, columns)
        left = sum(widths[:column]) + LEFT * (column + 1) + RIGHT * column
        bottom = KEY + sum(heights[row + 1 :]) + TOP * (len(heights) - row - 1) + BOTTOM * (len(heights) - row)
        size = scale * (upper - lower)[view.axes]
        axes = figure.add_axes([left / width, bottom / height, size[0] / width, size[1] / height])
        dress(axes, view, lower, upper)
        if size[1] < SHORT:
            axes.set_ylabel(f"{AXIS_NAMES[view.vertical]} (m)")
        wide = max(0.65, DIGIT * (1 + max(len(f"{edge[view.horizontal]:.0f}") for edge in (lower, upper))))
        prune = "both" if np.abs([lower, upper]).max() >= WHOLE_FROM else None  # long numbers reach beyond the panel
        axes.locator_params(axis="x", nbins=int(np.clip(size[0] / wide, 1, 7)), prune=prune)
        axes.locator_params(axis="y", nbins=int(np.clip(size[1] / 0.4, 1, 7)))
        array.append(axes)
    if not bar:
        return figure, array, None
    tall = min(height - KEY - TOP - BOTTOM, 3.6)
    place = [(width - BAR + 0.1) / width, 1 - (TOP + tall) / height, 0.17 / width, tall / height]
    return figure, array, figure.add_axes(place)


def _extents(views: list[View], lower, upper, columns: int) -> tuple[list[float], list[float]]:
    """Widths of the columns and heights of the rows, m."""
    extent = np.maximum(upper - lower, 1e-3)
    rows = -(-len(views) // columns)
    return (
        [max(extent[view.horizontal] for view in views[column::columns]) for column in range(columns)],
        [max(extent[view.vertical] for view in views[row * columns : (row + 1) * columns]) for row in range(rows)],
    )


def _scale(views: list[View], lower, upper, columns: int, bar: bool, tallest: float) -> float:
    """Inches per metre at which so many columns fit the paper."""
    widths, heights = _extents(views, lower, upper, columns)
    across = style.WIDTH - (LEFT + RIGHT) * columns - BAR * bar
    down = tallest - (TOP + BOTTOM) * len(heights) - KEY
    return min(across / sum(widths), down / sum(heights))


def key(figure: Figure, handles: list, columns: int = 8) -> None:
    """A key in the paper left for it below the panels."""
    figure.legend(handles=handles, loc="lower center", ncols=min(len(handles), columns), borderaxespad=0.3)


def dress(axes: Axes, view: View, lower: np.ndarray, upper: np.ndarray) -> None:
    """Title, axis names with units, equal scales and limits."""
    axes.set_title(view.title)
    axes.set_xlabel(AXIS_LABELS[view.horizontal])
    axes.set_ylabel(AXIS_LABELS[view.vertical])
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlim(lower[view.horizontal], upper[view.horizontal])
    axes.set_ylim(lower[view.vertical], upper[view.vertical])
    axes.ticklabel_format(style="plain", useOffset=False)


def mark_cuts(axes: Axes, view: View, cut_views: list[View]) -> None:
    """Thin dashed lines where the other views cut this one."""
    for other in cut_views:
        if other.at is not None and other.normal == view.horizontal:
            axes.axvline(other.at, color="k", linewidth=0.6, linestyle=":", zorder=3)
        if other.at is not None and other.normal == view.vertical:
            axes.axhline(other.at, color="k", linewidth=0.6, linestyle=":", zorder=3)


def edges_help(axes: Axes, cell: float) -> bool:
    """Whether cells of edge `cell` (m) are drawn wide enough for their edges to be told from their colour."""
    left, right = axes.get_xlim()
    inches = axes.get_position().width * axes.figure.get_figwidth()
    return 72 * inches * cell / (right - left) > EDGES_ABOVE
