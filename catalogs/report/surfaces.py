"""Closed surfaces around what cells of one size hold: openings and failed rock, for the view that can be turned."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Corners of a cube, in the order of igl.marching_cubes.
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
LEVELS = (0.01, 0.99)  # The level of a surface is searched between these shares.
LEVEL_ERROR = 0.001


@dataclass(frozen=True)
class CellSet:
    """What cells of one size hold.

    cell (cell, 3): lower corners, distinct, whole numbers of edges from `corner` (3,) m; share (cell,): which share of
    each cell is held, above 0 and at most 1; other cells hold nothing. edge: m.
    """

    cell: NDArray
    share: NDArray
    edge: float
    corner: NDArray

    @classmethod
    def of(cls, cell: NDArray, share: NDArray, edge: float, corner: NDArray) -> "CellSet":
        """Distinct cells, with the shares of those that occur more than once summed, up to 1."""
        distinct, place = np.unique(cell, axis=0, return_inverse=True)
        return cls(distinct, np.minimum(np.bincount(place.ravel(), share, len(distinct)), 1.0), edge, corner)

    def coarsened(self) -> "CellSet":
        """This volume in cells of twice the edge."""
        return CellSet.of(self.cell // 2, self.share / 8.0, 2.0 * self.edge, self.corner)

    def surface(self) -> tuple[NDArray, NDArray]:
        """Vertices (vertex, 3), edges from `corner`, and outward triangles (triangle, 3) around what is held.

        The shares are taken as values at the cells' centres, linear between them. The surface is where they equal a
        level. The level is chosen so that the surface encloses the held volume, as nearly as one level can. So an
        opening that is narrower than a cell is drawn, too.
        """
        if not len(self.cell):
            return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
        from scipy.optimize import brentq  # here, as igl below: other sections are drawn meanwhile

        at_level = self._surface_at_level()

        def excess(level: float) -> float:
            return enclosed_volume(*at_level(level)) - float(self.share.sum())

        low, high = LEVELS
        if excess(low) <= 0:
            return at_level(low)
        return at_level(high if excess(high) >= 0 else brentq(excess, low, high, xtol=LEVEL_ERROR))

    def _surface_at_level(self) -> Callable[[float], tuple[NDArray, NDArray]]:
        """The surface by its level, from marching cubes between the centres of these cells and their neighbours."""
        import igl

        lower = self.cell.min(axis=0) - 1
        shape = tuple(self.cell.max(axis=0) - lower + 2)

        def key(place: NDArray) -> NDArray:
            return np.ravel_multi_index(tuple((place - lower).T), shape)

        def place(key: NDArray) -> NDArray:
            return np.stack(np.unravel_index(key, shape), axis=1) + lower

        cubes = place(np.unique(key((self.cell[:, None, :] - CORNERS).reshape(-1, 3))))
        known, corner = np.unique(key((cubes[:, None, :] + CORNERS).reshape(-1, 3)), return_inverse=True)
        centre, corner = place(known) + 0.5, corner.reshape(-1, 8).astype(np.int64)
        value = np.zeros(len(known))
        value[np.searchsorted(known, key(self.cell))] = self.share

        def at_level(level: float) -> tuple[NDArray, NDArray]:
            vertices, triangles, _ = igl.marching_cubes(value, centre, corner, level)
            return vertices, triangles[:, ::-1]  # Those of igl look towards larger values.

        return at_level


def enclosed_volume(vertices: NDArray, triangles: NDArray) -> float:
    """Volume within closed surfaces, positive where their triangles look outward."""
    if not len(triangles):
        return 0.0
    return float(np.linalg.det((vertices - vertices.mean(axis=0))[triangles]).sum()) / 6.0
