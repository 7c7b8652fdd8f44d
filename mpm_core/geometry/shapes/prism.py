"""A vertical prism: an outline in plan between a floor and a roof, also of the outlines of a drawing."""

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field

from common.mine_grid import GridMap
from common.setting_types import AsTuple, Length, Size, is_list, refusal
from mpm_core.geometry.outlines import Outline, box_around
from mpm_core.geometry.shapes.shape import Shape, ShapeError, check_above, check_outline, closed_line
from mpm_core.geometry.solids import Solid

# A corner whose doubled area over its squared size is smaller is none.
MIN_CORNER_SHAPE = 1e-9


def _single(value: Any) -> Any:
    if is_list(value):
        raise refusal("expected one elevation")
    return value


Elevation = Annotated[Length, BeforeValidator(_single)]
Elevations = Annotated[tuple[Length, ...], AsTuple]
Corner = Annotated[tuple[Length, ...], Field(min_length=2, max_length=2), AsTuple]


class Prism(Shape):
    """A prism by its outline, and one lower and upper elevation, or as many of both as the outline has points."""

    polygon: Annotated[tuple[Corner, ...], Field(min_length=3), AsTuple]
    """its outline in plan"""
    lower: Elevation = None
    """its lower elevation"""
    upper: Elevation = None
    """its upper elevation"""
    base: Elevations = None
    """a lower elevation for each point of its polygon"""
    top: Elevations = None
    """an upper elevation for each point of its polygon"""

    @property
    def by_point(self) -> bool:
        """True if each point has elevations of its own."""
        return bool(self.model_fields_set & {"base", "top"})

    def check(self, dimension: int) -> None:
        """Raise ShapeError for an outline without area, one that crosses itself, and elevations that do not fit it."""
        keys = ("base", "top") if self.by_point else ("lower", "upper")
        if self.model_fields_set & {"lower", "upper", "base", "top"} != set(keys):
            raise ShapeError("a prism needs lower and upper, or base and top with an elevation per polygon point")
        check_outline("polygon", np.array(self.polygon))
        for key in keys if self.by_point else ():
            if len(getattr(self, key)) != len(self.polygon):
                raise ShapeError(f"expected {len(self.polygon)} elevations, one per polygon point", key)
        check_above(keys[1], *(np.array(getattr(self, key)) for key in keys))

    def placed(self, grid: GridMap) -> dict[str, Any]:
        """Its outline and elevations."""
        return {"polygon": grid.to_map(self.polygon).tolist()} | _elevations(self, grid)

    def _levels(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper elevation (point,) m."""
        if self.by_point:
            return np.array(self.base), np.array(self.top)
        return np.full(len(self.polygon), self.lower), np.full(len(self.polygon), self.upper)

    def extent(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """The box around it."""
        polygon, (lower, upper) = np.array(self.polygon), self._levels()
        return np.append(polygon.min(axis=0), lower.min()), np.append(polygon.max(axis=0), upper.max())

    def sides_and_volume(self, dimension: int) -> tuple[np.ndarray, float]:
        """Along an edge of its outline, by its mean height. Holes count as mined."""
        plan, area = box_around(np.array(self.polygon))
        if self.by_point:
            height = float(np.mean(np.subtract(self.top, self.base)))
        else:
            height = float(np.mean(np.subtract(self.upper, self.lower)))
        return np.append(plan, height), area * height

    def corners(self) -> np.ndarray:
        """Corners (point, 4) m: x, y, lower and upper elevation; points on a straight line left out.

        Raises ShapeError if fewer than three are left.
        """
        polygon = np.array(self.polygon)
        keep = (polygon != np.roll(polygon, 1, axis=0)).any(axis=1)
        if not self.by_point:
            while (straight := keep.copy()).any():
                straight[keep] = _straight(polygon[keep])
                if not straight.any():
                    break
                keep[np.flatnonzero(straight)[0]] = False  # one at a time: its neighbours' angles change
        if keep.sum() < 3:
            raise ShapeError("needs at least 3 points that are not on one line", "polygon")
        return np.column_stack([polygon, *self._levels()])[keep]

    def rings(self) -> Iterator[np.ndarray]:
        """Corners of its outline and of its holes."""
        yield self.corners()

    def surface(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """Walls, floor and roof, in triangles."""
        rings = list(self.rings())
        # holes the other way round
        rings = [rings[0][:: _turn(rings[0])], *(ring[:: -_turn(ring)] for ring in rings[1:])]
        vertices = np.concatenate(rings)
        count = len(vertices)
        bottom = np.arange(count)
        ahead = np.concatenate(
            [np.roll(own, -1) for own in np.split(bottom, np.cumsum([len(ring) for ring in rings])[:-1])]
        )
        walls = [
            np.column_stack([bottom, ahead, ahead + count]),
            np.column_stack([bottom, ahead + count, bottom + count]),
        ]
        places = np.concatenate([vertices[:, [0, 1, 2]], vertices[:, [0, 1, 3]]])
        plan = [ring[:, :2] for ring in rings]
        for cap in (triangulate(plan), _fans(plan)):  # fans serve any polygon, even a self-crossing one
            facets = np.concatenate([*walls, cap[:, ::-1], cap + count])
            if Solid("prism", places, facets).is_closed:
                break
        return places, facets


class PrismWithHoles(Prism):
    """A prism of a drawing: lines within its outline are holes, with elevations of their own."""

    holes: tuple[Prism, ...] = ()

    def rings(self) -> Iterator[np.ndarray]:
        """Corners of its outline and of its holes."""
        yield self.corners()
        yield from (hole.corners() for hole in self.holes)


class DrawnPrism(Shape):
    """Prisms of the closed polylines of a drawing: between two elevations, or standing on the polylines' own."""

    lower: Elevation = None
    """its lower elevation"""
    upper: Elevation = None
    """its upper elevation"""
    height: Size = None
    """its height above each of its polylines"""

    def check(self, dimension: int) -> None:
        """Raise ShapeError for what is neither two elevations, in order, nor a height."""
        if self.model_fields_set not in ({"lower", "upper"}, {"height"}):
            raise ShapeError("a prism from a file needs lower and upper, or height above its polyline")
        if self.height is None:
            check_above("upper", np.array(self.lower), np.array(self.upper))

    def placed(self, grid: GridMap) -> dict[str, Any]:
        """Its elevations and its height."""
        return self.given() | _elevations(self, grid)

    def prism(self, outline: Outline) -> PrismWithHoles:
        """The prism of an outline and its holes."""
        holes = tuple(Prism.of(self._ring(hole)) for hole in outline.holes)
        return PrismWithHoles.of(self._ring(outline.line) | {"holes": holes})

    def _ring(self, line: np.ndarray) -> dict[str, Any]:
        if self.height is None:
            return {"polygon": line[:, :2].tolist(), "lower": self.lower, "upper": self.upper}
        level = line[:, 2]
        return {"polygon": line[:, :2].tolist(), "base": level.tolist(), "top": (level + self.height).tolist()}


def _elevations(shape: Shape, grid: GridMap) -> dict[str, Any]:
    """Elevations on the map, m, of a prism in a mine's grid, by their keys."""
    given = {key: value for key, value in shape.given().items() if key in ("lower", "upper", "base", "top")}
    exchanged = {"lower": "upper", "upper": "lower", "base": "top", "top": "base"} if grid.is_downward else {}
    return {
        exchanged.get(key, key): [grid.elevation(one) for one in value] if is_list(value) else grid.elevation(value)
        for key, value in given.items()
    }


def _turn(ring: np.ndarray) -> int:
    """1 if a ring (point, 2 or more) runs counterclockwise in plan, else -1."""
    local = ring[:, :2] - ring[:, :2].mean(axis=0)
    return 1 if np.linalg.det(local[closed_line(local)[1]]).sum() >= 0 else -1


def _straight(polygon: np.ndarray) -> np.ndarray:
    """(point,) bool: True where a corner lies on the line through its neighbours."""
    before, after = polygon - np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0) - polygon
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.abs(turn) <= MIN_CORNER_SHAPE * ((before**2).sum(axis=1) + (after**2).sum(axis=1))


def triangulate(rings: list[np.ndarray]) -> np.ndarray:
    """Triangles (triangle, 3) of a simple counterclockwise polygon (point, 2) less its holes: rows of all rings."""
    from ezdxf.math.triangulation import mapbox_earcut_2d

    places = np.concatenate(rings)
    local = places - places.mean(axis=0)
    outline, *holes = (part.tolist() for part in np.split(local, np.cumsum([len(ring) for ring in rings])[:-1]))
    row = {tuple(point): number for number, point in enumerate(local.tolist())}
    corners = [[row[point.x, point.y] for point in triangle] for triangle in mapbox_earcut_2d(outline, holes)]
    triangles = np.array(corners, dtype=np.int64).reshape(-1, 3)
    wrong = np.linalg.det(np.dstack([local[triangles], np.ones(triangles.shape)])) < 0
    triangles[wrong] = triangles[wrong, ::-1]
    return triangles


def _fans(rings: list[np.ndarray]) -> np.ndarray:
    """Triangles (triangle, 3) of each ring from its first corner to each edge, rows of all rings: where they overlap,
    they cancel in the winding number."""
    first = np.cumsum([0] + [len(ring) for ring in rings])[:-1]
    fans = []
    for start, ring in zip(first, rings, strict=True):
        ahead = start + np.arange(1, len(ring) - 1)
        fans.append(np.column_stack([np.full_like(ahead, start), ahead, ahead + 1]))
    return np.concatenate(fans)
