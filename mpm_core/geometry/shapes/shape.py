"""The base of all shapes: keys as settings, their checks, the extent, and the surface.

All lengths are in m, on the map; `dimension` is 3, or 2 in plane strain.
"""

from collections.abc import Iterator
from typing import Any, ClassVar, NamedTuple

import numpy as np

from common.errors import InputError
from common.mine_grid import GridMap
from common.setting_types import Settings, is_list
from mpm_core.geometry.outlines import check_simple

MIN_WIDTH_SHARE = 1e-9  # An outline narrower than this share of its length has no area.


class ShapeError(Exception):
    """A mistake in a shape, and the key that is wrong; empty where it is no single one."""

    def __init__(self, problem: str, key: str = ""):
        super().__init__(problem)
        self.problem, self.key = problem, key


class Opening(NamedTuple):
    """One solid that is mined or loaded: corners (d,) m of its box, its own sides (d,) m and volume m^d.

    sides: of a box around it in any orientation; parts (part, 2, d) m: boxes that cover it, a tunnel's along its path.
    """

    lower: np.ndarray
    upper: np.ndarray
    sides: np.ndarray
    volume: float
    parts: np.ndarray


class Shape(Settings):
    """Base of the shapes. Each has its keys as fields."""

    POINT_KEYS: ClassVar[tuple[str, ...]] = ()
    """Keys that hold a point, or several, with as many coordinates as the scene has."""
    PLAN_SIZES: ClassVar[tuple[str, ...]] = ()
    """Keys that hold a size in plan, which the scale of a mine's grid changes."""

    def check(self, dimension: int) -> None:
        """Raise ShapeError for what the types of the keys cannot refuse."""
        for key in self.POINT_KEYS:
            value = getattr(self, key)
            for point in value if is_list(value[0]) else (value,):
                if len(point) != dimension:
                    raise ShapeError(f"{len(point)} coordinates; this scene has {dimension}", key)

    def placed(self, grid: GridMap) -> dict[str, Any]:
        """Keys of this shape, with `shape` where it becomes another one, on the map: its own are in a mine's grid."""
        points = {key: grid.to_map(getattr(self, key)).tolist() for key in self.POINT_KEYS}
        return self.given() | points | {key: grid.scale * getattr(self, key) for key in self.PLAN_SIZES}

    def extent(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner (dimension,) m of a box around the shape, which may be larger than it."""
        raise NotImplementedError

    def sides_and_volume(self, dimension: int) -> tuple[np.ndarray, float]:
        """Sides (dimension,) m of a box around the shape in any orientation, and its volume m3 (area m2 in 2-D)."""
        lower, upper = self.extent(dimension)
        return upper - lower, float(np.prod(upper - lower))

    def openings(self, dimension: int) -> Iterator[Opening]:
        """The shape as what is mined; a tunnel stretch by stretch."""
        lower, upper = self.extent(dimension)
        yield Opening(lower, upper, *self.sides_and_volume(dimension), np.stack([lower, upper])[None])

    def surface(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (vertex, dimension) m and facets (facet, dimension), rows of them; they may all look inward."""
        raise NotImplementedError


def around(points: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (d,) m of a box that leaves `reach` m around points (point, d) m."""
    return points.min(axis=0) - reach, points.max(axis=0) + reach


def check_above(key: str, lower: np.ndarray, upper: np.ndarray) -> None:
    """Raise ShapeError naming `key` unless upper is above lower throughout, m."""
    if (upper <= lower).any():
        raise ShapeError(f"upside down: {upper.tolist()} m is not above lower {lower.tolist()} m throughout", key)


def check_outline(key: str, outline: np.ndarray) -> None:
    """Raise ShapeError naming `key` for an outline (point, 2) m whose points all lie on one line, or that crosses
    itself."""
    edges = outline[1:] - outline[0]
    if len(edges) < 2 or np.linalg.matrix_rank(edges, tol=MIN_WIDTH_SHARE * np.abs(edges).max()) < 2:
        raise ShapeError("needs three points or more that are not on one line", key)
    try:
        check_simple(outline)
    except InputError as error:
        raise ShapeError(str(error), key) from error


def closed_line(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and segments of the closed line through points (point, 2)."""
    number = np.arange(len(points))
    return points, np.column_stack([number, np.roll(number, -1)])
