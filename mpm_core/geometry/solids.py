"""A volume of rock bounded by facets, or the rest of a box without it. Every shape and file becomes one of the two.

The volume of a solid is that of what lies inside its surface, where the winding number W exceeds 1/2 in size. A closed
surface has it by Gauss's theorem, if no part overlaps another: W is whole everywhere, and its integral is a sum over
the facets. Where W is neither 0 nor 1 (overlaps, bodies that look different ways) what that sum has wrong is added up
over cells; elsewhere this is exactly zero. An open surface has no such sum, and all is added up over cells. Cells are
halved where the surface passes, or where it is open and W is near 1/2, until there are some thousand of them; of those
the last, 64 points are tested. What all lies on the surface of its convex hull, as boxes and most prisms do, has one W
within it, and nothing to be added up. Lengths are in m from a local origin.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from common.errors import InputError
from mpm_core.geometry.crossing import cross_cells
from mpm_core.geometry.winding import winding_number_of

ROOT_CELLS = 4  # Cells along the longest side of a solid's box before any is halved.
MAX_CELLS_HALVED = 1000  # More cells on the surface of an open body are not halved further.
MAX_CLOSED_CELLS_HALVED = 300  # As MAX_CELLS_HALVED for a closed body, of which only overlaps are added up.
MAX_HALVINGS = 20
# A corner may be beyond the plane of a facet of its hull by this share of the solid's size.
HULL_ROUND_OFF = 1e-12
# Solids with more corners are not compared with their hull, since each is tested with each facet.
MAX_HULL_CORNERS = 512
# A sub-cell's point along one axis, in 8ths (16ths) of the sub-cell, by the sub-cell's place along the other axes. The
# best of the point-symmetric patterns of this form by the error of a half-space's share; in 2-D, bit reversal.
SUBCELL_POINTS_2D = np.array([0, 4, 2, 6, 1, 5, 3, 7])
SUBCELL_POINTS_3D = 4 * np.array([2, 0, 3, 1])[:, None] + np.array([0, 2, 1, 3])
# A cell without any surface is undecided if its W is within this of 1/2. W changes slowly there.
MAX_UNDECIDED_WINDING = 0.3
OPEN_SIZES = np.array([0.6, 0.5, 0.4])


class Edges(NamedTuple):
    """The edges of some triangles, each counted once."""

    of_facet: np.ndarray
    """(facet, 3) int64: number of the edge from each corner to the next"""
    count: np.ndarray  # type: ignore[assignment]  # hides the method of tuples, which nothing calls
    """(edge,) int64: how often it is passed"""
    balance: np.ndarray
    """(edge,) int64: passages one way less those the other; 0 everywhere in a closed surface"""


def edges_of(facets: np.ndarray) -> Edges:
    """Edges of triangles (facet, 3), vertices at the same place being one; an edge from a vertex to itself is none."""
    start, end = facets.astype(np.int64).ravel(), np.roll(facets, -1, axis=1).astype(np.int64).ravel()
    key = np.minimum(start, end) * (facets.max(initial=0) + 1) + np.maximum(start, end)
    _, number = np.unique(key, return_inverse=True)
    number = number.reshape(-1)
    real = (start != end).astype(float)
    balance = np.bincount(number, weights=np.sign(end - start))
    count = np.bincount(number, weights=real)
    return Edges(number.reshape(-1, 3), count.astype(np.int64), balance.astype(np.int64))


def unique_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Different rows (n, d) of an array in order of their columns, and of each row its place in them (row,) int64."""
    order = np.lexsort(rows.T[::-1])
    sorted_rows = rows[order]
    first = np.append(True, (sorted_rows[1:] != sorted_rows[:-1]).any(axis=1))[: len(rows)]
    place = np.empty(len(rows), dtype=np.int64)
    place[order] = np.cumsum(first) - 1
    return sorted_rows[first], place


def volume_within(corners: np.ndarray, is_closed: bool, lower: np.ndarray, upper: np.ndarray) -> float:
    """Volume m3 (area m2 in 2-D) inside the surface and the box. corners (facet, corner, dimension) m, lower, upper m.

    Exact to round-off for a closed surface without overlaps; else good to some 1e-3 of the volume.
    """
    places = corners.reshape(-1, corners.shape[2])
    lower, upper = np.maximum(lower, places.min(axis=0)), np.minimum(upper, places.max(axis=0))
    if not (upper > lower).all():
        return 0.0
    whole = flux_within(corners, lower, upper) if is_closed else 0.0
    winding_number = winding_number_of(corners)
    if is_closed and is_on_its_hull(corners) and np.rint(abs(winding_number(places.mean(axis=0)[None])[0])) == 1:
        return abs(whole)

    def missing(points: np.ndarray) -> np.ndarray:
        """Error of the sum over the facets at points, which is to be added up; 0 where it is right."""
        w = winding_number(points)
        if not is_closed:
            return (np.abs(w) > 0.5).astype(float)
        w = np.rint(w)
        return (w != 0) - np.copysign(1.0, whole) * w

    return float(abs(whole) + _sum_over_cells(corners, is_closed, lower, upper, winding_number, missing))


def open_volumes(corners: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Volumes m3 (area m2 in 2-D) where the winding number of an open surface exceeds `sizes` (k,), near 1/2, in size.

    corners as in volume_within.
    """
    places = corners.reshape(-1, corners.shape[2])
    winding_number = winding_number_of(corners)
    box = places.min(axis=0), places.max(axis=0)
    return _sum_over_cells(
        corners, False, *box, winding_number, lambda points: np.abs(winding_number(points))[:, None] > sizes
    )


def is_on_its_hull(corners: np.ndarray) -> bool:
    """True if every facet (facet, corner, dimension) lies on the surface of the convex hull of all corners.

    W is then the same everywhere within it, and 0 without if the surface is closed. False where corners are many.
    """
    places = corners.reshape(-1, corners.shape[2])
    if len(places) > MAX_HULL_CORNERS:
        return False
    edge = corners[:, 1] - corners[:, 0]
    normal = np.cross(edge, corners[:, 2] - corners[:, 0]) if corners.shape[2] == 3 else edge[:, ::-1] * [1, -1]
    height = normal @ places.T - (normal * corners[:, 0]).sum(axis=1)[:, None]
    slack = HULL_ROUND_OFF * np.ptp(places, axis=0).max() * np.linalg.norm(normal, axis=1)
    return bool(((height.max(axis=1) <= slack) | (height.min(axis=1) >= -slack)).all())


def _sum_over_cells(corners, is_closed, lower, upper, winding_number, value):
    """Integral over the box from lower to upper of `value` (point, ...), which changes at the surface and where W is
    near 1/2 alone."""
    dimension = len(lower)
    cell = (upper - lower).max() / ROOT_CELLS
    counts = np.ceil((upper - lower) / cell).astype(int).clip(1)
    index = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, dimension)
    children = np.stack(np.meshgrid(*[[0, 1]] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    total, enough = 0.0, MAX_CLOSED_CELLS_HALVED if is_closed else MAX_CELLS_HALVED
    for halving in range(MAX_HALVINGS):
        crossed, _ = cross_cells((corners - lower) / cell, index.astype(np.int32))
        middle = lower + (index + 0.5) * cell
        if not is_closed:
            free = np.flatnonzero(~crossed)
            crossed[free] = np.abs(np.abs(winding_number(middle[free])) - 0.5) < MAX_UNDECIDED_WINDING
        shared = np.minimum((index[~crossed] + 1) * cell, upper - lower) - index[~crossed] * cell
        total = total + np.prod(shared.clip(0.0), axis=1) @ value(middle[~crossed])
        index = index[crossed]
        if len(index) > enough or len(index) == 0 or halving == MAX_HALVINGS - 1:
            break
        index = (2 * index[:, None, :] + children).reshape(-1, dimension)
        cell /= 2
        index = index[(index * cell < upper - lower).all(axis=1)]
    points = (lower + (index[:, None, :] + _points_of_a_cell(dimension)) * cell).reshape(-1, dimension)
    points = points[(points < upper).all(axis=1)]
    return total + value(points).sum(axis=0) * cell**dimension / 64


def _points_of_a_cell(dimension: int) -> np.ndarray:
    """Offsets (64, dimension) of points from a cell's lower corner, in cells: one in each sub-cell, each axis at 64
    evenly spaced places (multi-jittered sampling, Chiu et al. 1994).

    The points of inside.sample_points are their own mirror images, for which they give up some accuracy at
    axis-parallel walls: a volume needs none.
    """
    if dimension == 2:
        i, j = np.indices((8, 8))
        places = [(i + (SUBCELL_POINTS_2D[j] + 0.5) / 8) / 8, (j + (SUBCELL_POINTS_2D[i] + 0.5) / 8) / 8]
    else:
        i, j, k = np.indices((4, 4, 4))
        places = [(a + (SUBCELL_POINTS_3D[b, c] + 0.5) / 16) / 4 for a, b, c in ((i, j, k), (j, k, i), (k, i, j))]
    return np.stack([place.ravel() for place in places], axis=1)


def flux_within(corners: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    """Integral of W over the box, m3 (m2 in 2-D), for a closed surface: negative where its facets look inward.

    Gauss: the flux through the facets of the field (x clamped to the box, 0, 0) where y and z lie in the box.
    """
    dimension = corners.shape[2]
    if dimension == 2:  # walls one metre high over the segments
        a, b = (np.insert(corners[:, end], 2, 0.0, axis=1) for end in (0, 1))
        top = np.array([0.0, 0.0, 1.0])
        corners = np.concatenate([np.stack([a, b, b + top], axis=1), np.stack([a, b + top, a + top], axis=1)])
    for axis in range(1, dimension):
        corners = _clip(_clip(corners, axis, lower[axis], 1), axis, upper[axis], -1)
    beyond, corners = _clip(corners, 0, upper[0], 1), _clip(corners, 0, upper[0], -1)
    between = _clip(corners, 0, lower[0], 1)
    flux = (_area_x(between) * (between[:, :, 0].mean(axis=1) - lower[0])).sum()
    return float(flux + _area_x(beyond).sum() * (upper[0] - lower[0]))


def _clip(corners: np.ndarray, axis: int, bound: float, side: int) -> np.ndarray:
    """Triangles (n, 3, 3) cut at the plane x[axis] = bound: what lies above (side 1) or below it (-1), as triangles.

    What lies in the plane counts as above.
    """
    height = side * (corners[:, :, axis] - bound)
    above = ((height >= 0.0) if side > 0 else (height > 0.0)).sum(axis=1)
    one, two = np.flatnonzero(above == 1), np.flatnonzero(above == 2)
    if not len(one) and not len(two):
        return corners[above == 3]

    def turned(chosen: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The chosen triangles, starting at their corner `first`, and where their edges from there meet the plane."""
        order = (first[:, None] + np.arange(3)) % 3
        place, level = corners[chosen[:, None], order], height[chosen[:, None], order]
        share = level[:, :1] / (level[:, :1] - level[:, 1:])
        cut = place[:, :1] + share[:, :, None] * (place[:, 1:] - place[:, :1])
        return place, cut[:, 0], cut[:, 1]

    tip, tip_b, tip_c = turned(one, height[one].argmax(axis=1))
    base, base_b, base_c = turned(two, height[two].argmin(axis=1))
    return np.concatenate(
        [
            corners[above == 3],
            np.stack([tip[:, 0], tip_b, tip_c], axis=1),
            np.stack([base_b, base[:, 1], base[:, 2]], axis=1),
            np.stack([base_b, base[:, 2], base_c], axis=1),
        ]
    )


def _area_x(corners: np.ndarray) -> np.ndarray:
    """Area of each triangle (n, 3, 3) seen along x, (n,) m2, positive where it looks towards +x."""
    b, c = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return 0.5 * (b[:, 1] * c[:, 2] - b[:, 2] * c[:, 1])


@dataclass(frozen=True, eq=False)
class Solid:
    """A volume bounded by triangles (3-D) or line segments (2-D, plane strain: coordinates in the plane).

    The facets need not be watertight, nor all of them distinct: inside is where the generalised winding number
    exceeds 1/2 in size (inside.py). Neighbouring facets must agree in orientation; those of files are made to
    (orientation.py).

    Raises InputError for a solid without facets, with coordinates that are not finite or indices out of range.
    """

    name: str
    vertices: np.ndarray  # (vertex, dimension) float64, m
    facets: np.ndarray  # (facet, dimension) int32, rows of `vertices`

    def __post_init__(self):
        vertices = np.array(self.vertices, dtype=np.float64, order="C", ndmin=2)
        facets = np.array(self.facets, dtype=np.int32, order="C", ndmin=2)
        dimension = vertices.shape[1]
        if dimension not in (2, 3) or facets.size == 0 or facets.shape[1] != dimension:
            raise InputError(f"{self.name}: the solid has no facets: check that its file or shape encloses a volume")
        if facets.min() < 0 or facets.max() >= len(vertices):
            raise InputError(f"{self.name}: the solid's facets refer to vertices that do not exist: export it again")
        if not np.isfinite(vertices).all():
            raise InputError(f"{self.name}: the solid has coordinates that are not finite: export it again")
        vertices.setflags(write=False)
        facets.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "facets", facets)

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.vertices.shape[1]

    @cached_property
    def bounds(self) -> np.ndarray:
        """Lower and upper corner (2, dimension) m of the vertices that facets use."""
        used = self.vertices[np.unique(self.facets)]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    def corners(self, origin: np.ndarray) -> np.ndarray:
        """Corners of all facets (facet, corner, dimension) m relative to `origin` (dimension,) m.

        Mine coordinates reach 1e7 m: products of three of them keep no digit of a stope's volume, differences do.
        """
        return (self.vertices - np.asarray(origin, dtype=np.float64))[self.facets]

    @cached_property
    def signed_volume(self) -> float:
        """Enclosed volume m3 (area m2 in 2-D), positive where the facets look outward. Repeats count repeatedly."""
        corners = self.corners(self.bounds.mean(axis=0))
        return float(np.linalg.det(corners).sum()) / (6 if self.dimension == 3 else 2)

    @cached_property
    def volume(self) -> float:
        """Volume m3 (area m2 in 2-D) of what lies inside: see `volume_within`."""
        return self.volume_within(*self.bounds) if self.is_closed else float(self.open_volumes[1])

    def volume_within(self, lower: np.ndarray, upper: np.ndarray) -> float:
        """Volume m3 (area m2 in 2-D) of what lies inside, in the box from lower to upper (dimension,) m."""
        center = self.bounds.mean(axis=0)
        return volume_within(self.corners(center), self.is_closed, lower - center, upper - center)

    @cached_property
    def open_volumes(self) -> np.ndarray:
        """Volumes m3 (areas m2 in 2-D), (3,), where the winding number exceeds 0.6, 0.5 and 0.4 in size.

        They differ by what hangs on how an open surface is closed: cracks and small holes change none of them.
        """
        return open_volumes(self.corners(self.bounds.mean(axis=0)), OPEN_SIZES)

    @property
    def open_share(self) -> float:
        """First less last of `open_volumes` over the volume, positive: 0 for a closed solid."""
        if self.is_closed:
            return 0.0
        least, volume, most = self.open_volumes
        return float((most - least) / volume) if volume > 0 else np.inf

    @cached_property
    def is_closed(self) -> bool:
        """True if the facets leave no edge open: each is passed as often one way as the other.

        Vertices at the same place are one (STL repeats them). Then the winding number is a whole number everywhere.
        """
        _, place = unique_rows(self.vertices)
        facets = place[self.facets]
        if self.dimension == 2:
            passages = np.bincount(facets[:, 1], minlength=facets.max() + 1)
            return bool((passages == np.bincount(facets[:, 0], minlength=facets.max() + 1)).all())
        return not edges_of(facets).balance.any()


@dataclass(frozen=True, eq=False)
class Outside:
    """The rest of the box from lower to upper (dimension,) m without a solid: a body under load is a box less its
    outside.

    inside.py treats it as any solid; beyond the box it may be either.
    """

    solid: Solid
    lower: np.ndarray
    upper: np.ndarray

    @property
    def name(self) -> str:
        """The solid's."""
        return self.solid.name

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.solid.dimension

    @property
    def bounds(self) -> np.ndarray:
        """Lower and upper corner of the box, (2, dimension) m."""
        return np.stack([self.lower, self.upper])

    @property
    def open_share(self) -> float:
        """The solid's."""
        return self.solid.open_share

    @property
    def volume(self) -> float:
        """Volume m3 (area m2 in 2-D) of the box less the solid's part in it."""
        return self.volume_within(self.lower, self.upper)

    def volume_within(self, lower: np.ndarray, upper: np.ndarray) -> float:
        """Volume m3 (area m2 in 2-D) of what the solid leaves of the box from lower to upper (dimension,) m."""
        return float(np.prod(upper - lower)) - self.solid.volume_within(lower, upper)
