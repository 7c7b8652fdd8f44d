"""A volume of rock bounded by facets, or the rest of a box without it. Every shape and file becomes one of the two."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from common.errors import InputError
from mpm_core.geometry.edges import edges_of, unique_rows
from mpm_core.geometry.volume import open_volumes, volume_within

OPEN_SIZES = np.array([0.6, 0.5, 0.4])


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
        """Volume m3 (area m2 in 2-D) of what lies inside: see volume.py."""
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
