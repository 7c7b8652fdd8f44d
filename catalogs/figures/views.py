"""Plans and vertical sections of a scene in mine coordinates: which plane, which cells it cuts, what is mined."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from catalogs.figures import style
from common.part_centers import part_centers

EAST, NORTH, UP = 0, 1, 2
AXIS_LABELS = ("east x (m)", "north y (m)", "elevation z (m)")
COORDINATE_NAMES = ("x", "y", "z")
MIN_CELL_WITH_EDGES = 5.0  # points; the edges of smaller cells would hide their colour
MIN_COORDINATE_IN_WHOLE_METRES = 1e4  # Larger coordinates, m, are written in whole metres.
MIN_EXCAVATED_SHARE_DRAWN = 0.5  # Cells with a larger excavated share are drawn as excavated.


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
        at = f"{self.at:.6g}" if abs(self.at) < MIN_COORDINATE_IN_WHOLE_METRES else f"{self.at:.0f}"
        return f"{self.name}\n{COORDINATE_NAMES[self.normal]} = {at} m"


PLAN = View("Plan", EAST, NORTH, UP)
LOOKING_NORTH = View("Section looking north", EAST, UP, NORTH)
LOOKING_WEST = View("Section looking west", NORTH, UP, EAST)


def projections(grid: xr.Dataset) -> list[View]:
    """Two sections and the plan, north up; in 2-D the one plane."""
    if int(grid.attrs["dimension"]) == 3:
        return [LOOKING_NORTH, LOOKING_WEST, PLAN]
    return [PLAN if grid.attrs.get("plane") == "xy" else LOOKING_NORTH]


def cuts(grid: xr.Dataset, positions: np.ndarray, weights: np.ndarray) -> list[View]:
    """The views of `projections`, cut through the fine layer that holds most of `weights` (positions (point, xyz) m).

    Of layers nearly as full as the fullest, the one nearest the centre of weight is used.
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
    found = np.concatenate([array.reshape(-1, 3) for array in (piece_corners(grid), *points)])
    found = found[np.isfinite(found).all(axis=1)]
    if not len(found):
        return lower, upper
    low, high = found.min(axis=0), found.max(axis=0)
    least = 6 * float(grid.attrs["fine_cell"]) if least is None else least
    pad = np.maximum(margin * (high - low).max(), least)
    return np.maximum(low - pad, lower), np.minimum(high + pad, upper)


def piece_centres(grid: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Middle (piece, xyz) of every finest cell that an excavation takes a part of, and the part as a weight (piece,):
    its share of the undistorted cell, m3 (m2)."""
    corners = piece_corners(grid)
    pieces = len(corners) // 2
    volume = grid["piece_fraction"].values * float(grid.attrs["fine_cell"]) ** int(grid.attrs["dimension"])
    return (corners[:pieces] + corners[pieces:]) / 2, volume


def piece_corners(grid: xr.Dataset) -> np.ndarray:
    """Lower and upper corners of the box of every excavated cell, (2 * piece, xyz) m."""
    origin = grid["piece_origin"].values
    extent = np.zeros_like(origin)
    extent[:, axes_of(grid)] = float(grid.attrs["fine_cell"])
    return np.concatenate([origin, origin + extent])


def axes_of(grid: xr.Dataset) -> list[int]:
    """Axes of the computation: two in plane strain."""
    if int(grid.attrs["dimension"]) == 3:
        return [EAST, NORTH, UP]
    return PLAN.axes if grid.attrs.get("plane") == "xy" else LOOKING_NORTH.axes


def cut_cells(grid: xr.Dataset, view: View) -> np.ndarray:
    """Indices of the cells that a view's plane cuts (all of them in 2-D)."""
    if view.at is None:
        return np.arange(grid.sizes["cell"])
    start = grid["cell_origin"].values[:, view.normal]
    return np.flatnonzero((start <= view.at) & (view.at < start + grid["cell_size"].values))


def cut_particles(state: xr.Dataset, view: View) -> np.ndarray:
    """Indices of the particles whose own cube a view's plane cuts: fill first, then rock that is most of its cube."""
    volume, rock = state["volume"].values, state["excavation"].values < 0
    cube = state["spacing"].values ** (3 if state.attrs["plane"] == "none" else 2) * state.attrs["thickness"]
    # Rock and outlines meet, neither overlaps.
    cut = np.where(rock, volume > (1.0 - MIN_EXCAVATED_SHARE_DRAWN) * cube, volume > 0)
    if view.at is not None:
        start = part_centers(state)[:, view.normal] - state["spacing"].values / 2
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
    place, fraction = grid["piece_origin"].values, grid["piece_fraction"].values.astype(float)
    edge = float(grid.attrs["fine_cell"])
    keep = np.ones(len(place), bool) if excavations is None else np.isin(grid["piece_excavation"].values, excavations)
    if view.at is not None:
        keep &= (place[:, view.normal] <= view.at) & (view.at < place[:, view.normal] + edge)
    place, fraction = place[keep], fraction[keep]
    corner, size = place[:, view.axes], np.full(len(place), edge)
    if not len(place):
        return corner, size, fraction
    _, cell = np.unique(np.rint((place - domain(grid)[0]) / edge).astype(np.int64), axis=0, return_inverse=True)
    total = np.bincount(cell.ravel(), fraction)[cell.ravel()]  # a cell may be shared by excavations
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
    axes: Axes,
    grid: xr.Dataset,
    view: View,
    planned: Sequence[int] = (),
    fill: bool = True,
    colour: str = style.OUTLINE,
) -> None:
    """Grey bodies with an outline for what is mined; a dashed outline for the excavations `planned` (indices)."""
    count = int(grid["piece_excavation"].values.max(initial=-1)) + 1
    mined = [index for index in range(count) if index not in planned]
    for group, dashed in ((mined, False), (list(planned), True)):
        lower, size, share = silhouette(grid, view, group)
        lower, size = lower[share >= MIN_EXCAVATED_SHARE_DRAWN], size[share >= MIN_EXCAVATED_SHARE_DRAWN]
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


def mark_cuts(axes: Axes, view: View, cut_views: list[View]) -> None:
    """Thin dashed lines where the other views cut this one."""
    for other in cut_views:
        if other.at is not None and other.normal == view.horizontal:
            axes.axvline(other.at, color="k", linewidth=0.6, linestyle=":", zorder=3)
        if other.at is not None and other.normal == view.vertical:
            axes.axhline(other.at, color="k", linewidth=0.6, linestyle=":", zorder=3)


def edges_help(axes: Axes, cell: float) -> bool:
    """True if cells of edge `cell` (m) are drawn wide enough for their edges to be seen within their colour."""
    left, right = axes.get_xlim()
    inches = axes.get_position().width * axes.figure.get_figwidth()
    return 72 * inches * cell / (right - left) > MIN_CELL_WITH_EDGES
