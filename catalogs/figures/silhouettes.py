"""Excavations as they are seen along a direction: outlines of their solids, and which of them hides which.

The outline of a solid follows from its triangles. Seen along a direction, all are given the same sense. Edges that are
then passed as often one way as the other lie within the silhouette; the others are closed curves, and what they wind
round is the silhouette. In a plane the segments of a solid are such curves themselves. An excavation without a surface
(that which lies outside a solid, or on a grid without surfaces) is drawn as its cells.
"""

import heapq
import json
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.collections import PathCollection
from matplotlib.path import Path
from matplotlib.transforms import IdentityTransform
from numpy.typing import NDArray

from catalogs.figures import style, views
from catalogs.sources.openings import overlaps

EAST, NORTH, UP = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
HALF = float(np.sqrt(0.5))
X, Y, Z = views.AXIS_LABELS
OUTLINE_WIDTH = 0.7  # Points, outside of the silhouette.
# The silhouette of a solid of more facets, many of which are folds, is known to its longest side divided by PIXELS.
MAX_FACETS, PIXELS = 5000, 500
FACETS_AT_ONCE = 20_000  # Facets of one path: matplotlib's renderer takes no path of any length.
MAX_VECTOR_POINTS = 20_000  # More points of curves than these are drawn as pixels.


@dataclass(frozen=True)
class Plane:
    """A plane to project onto: unit vectors to the right and up, the names of both axes, and whether the first is a
    coordinate. Where it is none, distances are counted from the left side of the picture."""

    name: str
    right: tuple[float, float, float]
    up: tuple[float, float, float]
    labels: tuple[str, str]
    along_axis: bool = True

    def project(self, points: NDArray) -> NDArray:
        """Places (point, 2), m, of points (point, 3)."""
        return points @ np.array([self.right, self.up]).T

    @property
    def normal(self) -> NDArray:
        """Unit vector (3,) towards the viewer."""
        return np.cross(self.right, self.up)


PLAN = Plane("Plan", EAST, NORTH, (X, Y))
SECTIONS = (
    Plane("Section looking north", EAST, UP, (X, Z)),
    Plane("Section looking west", NORTH, UP, (Y, Z)),
    Plane("Section looking north-east", (HALF, -HALF, 0.0), UP, ("to the south-east (m)", Z), along_axis=False),
    Plane("Section looking north-west", (HALF, HALF, 0.0), UP, ("to the north-east (m)", Z), along_axis=False),
)


class Silhouettes:
    """Outlines of a grid's excavations, as they are seen on planes."""

    def __init__(self, grid: xr.Dataset):
        self.grid = grid
        self.vertices, self.facets = np.zeros((0, 3)), np.zeros((0, 3), np.int64)
        owner = np.zeros(0, int)
        if "solid_facets" in grid:
            self.vertices, self.facets = grid["solid_position"].values, grid["solid_facets"].values.astype(np.int64)
            owner = grid["solid_excavation"].values
        order = np.argsort(owner, kind="stable")
        self.facets, self._owner = self.facets[order], owner[order]

    def curves(self, plane: Plane, excavation: int) -> list[NDArray]:
        """Closed curves (point, 2), m, around an excavation; empty where it has neither surface nor cells."""
        start, end = np.searchsorted(self._owner, [excavation, excavation + 1])
        if start == end:
            lower, size = cells_covered(plane, self.grid, [excavation])
            return list(lower[:, None, :] + size * np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float))
        used, facets = np.unique(self.facets[start:end], return_inverse=True)
        place, facets = plane.project(self.vertices[used]), facets.reshape(end - start, -1)
        if len(facets) > MAX_FACETS and facets.shape[1] == 3:
            return _curves_of_many(place, facets)
        _, same = np.unique(self.vertices[used], axis=0, return_inverse=True)  # STL files repeat vertices
        same = same.ravel()
        merged = np.empty((same.max() + 1, 2))
        merged[same] = place
        facets = same[facets]
        return closed_curves(merged, facets if facets.shape[1] == 2 else _boundary(merged, facets))


def _turned(place: NDArray, facets: NDArray) -> NDArray:
    """Triangles (facet, 3) with corners at `place` (vertex, 2), all counter-clockwise."""
    first, second, third = (place[facets[:, corner]] for corner in range(3))
    one, other = second - first, third - first
    is_clockwise = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0] < 0
    return np.where(is_clockwise[:, None], facets[:, ::-1], facets)


def _curves_of_many(place: NDArray, facets: NDArray) -> list[NDArray]:
    """Closed curves (point, 2) around the pixels that triangles (facet, 3) with corners at `place` (vertex, 2) cover.

    place: m, as are the curves.
    """
    low, side = place.min(axis=0), max(float(np.ptp(place, axis=0).max()), 1e-9) / PIXELS
    width, height = np.ceil(np.ptp(place, axis=0) / side).astype(int) + 2
    renderer = RendererAgg(width, height, 72)
    context = renderer.new_gc()
    context.set_antialiased(False)
    context.set_linewidth(0.0)
    corners = ((place - low) / side + 1)[_turned(place, facets)[:, [0, 1, 2, 0]]]
    for first in range(0, len(corners), FACETS_AT_ONCE):
        chunk = corners[first : first + FACETS_AT_ONCE]
        codes = np.tile([Path.MOVETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY], len(chunk))
        renderer.draw_path(context, Path(chunk.reshape(-1, 2), codes), IdentityTransform(), (0.0, 0.0, 0.0))
    covered = np.zeros((width + 2, height + 2), bool)
    covered[1:-1, 1:-1] = (np.asarray(renderer.buffer_rgba())[::-1, :, 3] > 0).T
    # A covered pixel has a side where its neighbour is not covered: corners of the pixel from which it goes and to.
    edges = []
    for axis, step, start, end in ((1, 1, (0, 0), (1, 0)), (0, -1, (1, 0), (1, 1)), (1, -1, (1, 1), (0, 1)),
                                   (0, 1, (0, 1), (0, 0))):  # fmt: skip
        pixel = np.argwhere(covered & ~np.roll(covered, step, axis=axis))
        edges.append(np.stack([pixel + start, pixel + end], axis=1))
    corner, ends = np.unique(np.concatenate(edges).reshape(-1, 2), axis=0, return_inverse=True)
    return closed_curves(low + side * (corner - 2.0), ends.reshape(-1, 2))


def _boundary(place: NDArray, facets: NDArray) -> NDArray:
    """Directed edges (edge, 2) around triangles (facet, 3) with corners at `place` (vertex, 2), all turned
    counter-clockwise; one that bounds several layers occurs several times."""
    facets = _turned(place, facets)
    start, end = facets.ravel(), np.roll(facets, -1, axis=1).ravel()
    key = np.minimum(start, end) * len(place) + np.maximum(start, end)
    edge, number = np.unique(key, return_inverse=True)
    balance = np.bincount(number.ravel(), np.sign(end - start), len(edge)).astype(int)
    low, high = np.divmod(edge, len(place))
    ends = np.where((balance > 0)[:, None], np.stack([low, high], axis=1), np.stack([high, low], axis=1))
    return np.repeat(ends, np.abs(balance), axis=0)


def closed_curves(place: NDArray, edges: NDArray) -> list[NDArray]:
    """Closed curves (point, 2) that directed edges (edge, 2) between `place` (vertex, 2) make, each edge once.

    >>> closed_curves(np.array([[0, 0], [1, 0], [0, 1]]), np.array([[0, 1], [2, 0], [1, 2]]))[0].tolist()
    [[0, 0], [1, 0], [0, 1]]
    """
    following: dict[int, list[int]] = defaultdict(list)
    for start, end in edges.tolist():
        following[start].append(end)
    curves = []
    for start in list(following):
        while following[start]:
            walk, here = [start], following[start].pop()
            while here != start and following[here]:
                walk.append(here)
                here = following[here].pop()
            curves.append(place[walk])
    return curves


def cells_covered(plane: Plane, grid: xr.Dataset, excavations: Sequence[int]) -> tuple[NDArray, NDArray]:
    """Rectangles that the excavations' cells cover along the plane's normal: lower corners (n, 2), size (2,), m.

    A place is covered where a cell behind it is excavated for MIN_EXCAVATED_SHARE_DRAWN; of an opening so narrow that
    none is, where a cell is for half as much as its fullest.
    """
    edge = float(grid.attrs["fine_cell"])
    # Diagonally, the middles of neighbouring columns are half the width of a cell apart.
    step = np.array([edge if plane.along_axis else edge * HALF, edge])
    size = step if plane.along_axis else step * [2.0, 1.0]
    centre, volume = pieces(grid, excavations)
    if not len(centre):
        return np.zeros((0, 2)), size
    _, cell = np.unique(np.rint((centre - views.domain(grid)[0]) / (edge / 2)), axis=0, return_inverse=True)
    share = np.bincount(cell.ravel(), volume)[cell.ravel()] / edge ** int(grid.attrs["dimension"])
    place = plane.project(centre)
    zero = place.min(axis=0)
    column, index = np.unique(np.rint((place - zero) / step), axis=0, return_inverse=True)
    fullest = np.zeros(len(column))
    np.maximum.at(fullest, index.ravel(), share)
    kept = fullest >= min(views.MIN_EXCAVATED_SHARE_DRAWN, fullest.max() / 2)
    return zero + column[kept] * step - size / 2, size


def pieces(grid: xr.Dataset, excavations: Sequence[int]) -> tuple[NDArray, NDArray]:
    """Centres (piece, 3) of the cells that these excavations take a part of, and the volumes taken (piece,)."""
    centre, volume = views.piece_centres(grid)
    own = np.isin(grid["piece_excavation"].values, list(excavations))
    return centre[own], volume[own]


def drawing_order(grid: xr.Dataset, excavations: Sequence[int]) -> list[int]:
    """Excavations in the order in which they are drawn, what is drawn later hiding what is drawn before.

    excavations: in the order of mining, in which they are drawn, but that one is drawn before the earlier ones that it
    overlaps: these mine the rock that both hold.
    """
    rank = {excavation: place for place, excavation in enumerate(excavations)}
    waits: dict[int, set[int]] = {excavation: set() for excavation in excavations}  # for those drawn before it
    frees: dict[int, list[int]] = defaultdict(list)
    pairs = json.loads(grid.attrs["excavation_overlaps"]) if "excavation_overlaps" in grid.attrs else overlaps(grid)
    for one, other in pairs:
        if one in rank and other in rank:
            early, late = sorted((one, other), key=rank.__getitem__)
            waits[early].add(late)
            frees[late].append(early)
    ready = [rank[excavation] for excavation in excavations if not waits[excavation]]
    heapq.heapify(ready)
    order = []
    while ready:
        order.append(excavations[heapq.heappop(ready)])
        for early in frees[order[-1]]:
            waits[early].discard(order[-1])
            if not waits[early]:
                heapq.heappush(ready, rank[early])
    return order


def draw(axes: Axes, bodies: Sequence[tuple[Sequence[NDArray], tuple]], **options) -> PathCollection:
    """Draw bodies, each given by closed curves (point, 2) in the units of the axes and a colour, red to blue or with
    opacity. Opaque ones have an outline around them and hide earlier ones; of others all curves are drawn.

    options: of PathCollection.
    """
    paths: list[Path] = []
    faces: list = []
    edges: list = []
    widths: list[float] = []
    for curves, colour in bodies:
        if not curves:
            continue
        path = Path.make_compound_path(*(Path(np.append(curve, curve[:1], axis=0), closed=True) for curve in curves))
        if len(colour) == 4:
            paths, faces, edges, widths = [*paths, path], [*faces, colour], [*edges, style.OUTLINE], [*widths, 0.7]
            continue
        # Its outline, and on it its face, which hides the half of the outline that is inside, and what several curves
        # have in common.
        paths += [path, path]
        faces += ["none", colour]
        edges += [style.OUTLINE, "none"]
        widths += [2 * OUTLINE_WIDTH, 0.0]
    many = sum(map(len, paths)) > MAX_VECTOR_POINTS
    look = {
        "rasterized": many,
        "facecolors": faces,
        "edgecolors": edges,
        "linewidths": widths,
        "joinstyle": "round",
        "zorder": 2,
    }
    found = PathCollection(paths, **look | options)
    axes.add_collection(found, autolim=False)
    return found
