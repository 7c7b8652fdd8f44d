"""A volume of rock bounded by facets: what every shape and file becomes."""

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
