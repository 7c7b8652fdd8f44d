"""A volume of rock bounded by facets, or what such a volume leaves of a box: what every shape and file becomes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.errors import InputError


@dataclass(frozen=True, eq=False)
class Solid:
    """A volume bounded by triangles (3-D) or line segments (2-D, plane strain: coordinates in the plane).

    The facets need not be watertight, nor all of them distinct: inside is where the generalised winding number
    exceeds 1/2 in size (inside.py). Facets of one solid must agree in orientation, outward or inward, all of them.

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

    @property
    def volume(self) -> float:
        """Size of `signed_volume`. The union's volume where no part of the solid overlaps another, else more."""
        return abs(self.signed_volume)

    def volume_within(self, lower: np.ndarray, upper: np.ndarray) -> float:
        """Volume m3 (area m2 in 2-D) of the part inside the box from lower to upper (dimension,) m.

        Gauss: the flux through the facets of the field (x clamped to the box, 0, 0) where y and z lie in the box.
        """
        center = self.bounds.mean(axis=0)
        corners, lower, upper = self.corners(center), lower - center, upper - center
        if self.dimension == 2:  # walls one metre high over the segments
            a, b = (np.insert(corners[:, end], 2, 0.0, axis=1) for end in (0, 1))
            top = np.array([0.0, 0.0, 1.0])
            corners = np.concatenate([np.stack([a, b, b + top], axis=1), np.stack([a, b + top, a + top], axis=1)])
        for axis in range(1, self.dimension):
            corners = _clip(_clip(corners, axis, lower[axis], 1), axis, upper[axis], -1)
        beyond, corners = _clip(corners, 0, upper[0], 1), _clip(corners, 0, upper[0], -1)
        between = _clip(corners, 0, lower[0], 1)
        flux = (_area_x(between) * (between[:, :, 0].mean(axis=1) - lower[0])).sum()
        return abs(float(flux + _area_x(beyond).sum() * (upper[0] - lower[0])))

    @cached_property
    def is_closed(self) -> bool:
        """Whether the facets leave no edge open: each is passed as often one way as the other.

        Vertices at the same place are one (STL repeats them). Then the winding number is a whole number everywhere.
        """
        _, place = np.unique(self.vertices, axis=0, return_inverse=True)
        facets = place.reshape(-1)[self.facets]
        if self.dimension == 2:
            balance = np.zeros(facets.max() + 1, dtype=np.int64)
            np.add.at(balance, facets[:, 0], -1)
            np.add.at(balance, facets[:, 1], 1)
            return not balance.any()
        edges = np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]])
        edges = edges[edges[:, 0] != edges[:, 1]]
        forward = edges[:, 0] < edges[:, 1]
        _, which = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
        return not np.bincount(which.reshape(-1), weights=np.where(forward, 1.0, -1.0)).any()


@dataclass(frozen=True, eq=False)
class Outside:
    """What a solid leaves of the box from lower to upper (dimension,) m: a body under load is a box less its outside.

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
    def volume(self) -> float:
        """Volume m3 (area m2 in 2-D) of the box less the solid's part in it."""
        return float(np.prod(self.upper - self.lower)) - self.solid.volume_within(self.lower, self.upper)


def _clip(corners: np.ndarray, axis: int, bound: float, side: int) -> np.ndarray:
    """Triangles (n, 3, 3) cut at the plane x[axis] = bound: what lies above (side 1) or below it (-1), as triangles.

    What lies in the plane counts as above.
    """
    height = side * (corners[:, :, axis] - bound)
    above = ((height >= 0.0) if side > 0 else (height > 0.0)).sum(axis=1)

    def turned(chosen: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The chosen triangles, starting at their corner `first`, and where their edges from there meet the plane."""
        order = (first[:, None] + np.arange(3)) % 3
        place = np.take_along_axis(corners[chosen], order[:, :, None], axis=1)
        level = np.take_along_axis(height[chosen], order, axis=1)
        share = level[:, :1] / (level[:, :1] - level[:, 1:])
        cut = place[:, :1] + share[:, :, None] * (place[:, 1:] - place[:, :1])
        return place, cut[:, 0], cut[:, 1]

    one, two = np.flatnonzero(above == 1), np.flatnonzero(above == 2)
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
