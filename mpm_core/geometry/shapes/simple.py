"""The simple shapes: box, circle, cylinder, sphere and polygon.

In plane strain a box is a rectangle; `sphere` and `cylinder` stand for a circle, a long round hole across the plane.
"""

from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field

from common.mine_grid import GridMap
from common.setting_types import AsTuple, Point, Size, is_list, refusal
from mpm_core.geometry.outlines import box_around
from mpm_core.geometry.shapes.shape import Shape, ShapeError, around, check_above, check_outline, closed_line

CIRCLE_SEGMENTS = 96  # inscribed, the polygon lacks 0.07 % of the circle
SPHERE_SUBDIVISIONS = 5  # 20480 triangles; inscribed, they lack 0.054 % of the ball


def _listed(value: Any) -> Any:
    if not is_list(value):
        raise refusal("expected the coordinates of a point")
    return value


Corner = Annotated[Point, BeforeValidator(_listed)]


class Box(Shape):
    """A box by two corners."""

    POINT_KEYS = ("lower", "upper")

    lower: Corner
    """its lower corner"""
    upper: Corner
    """its upper corner"""

    def check(self, dimension: int) -> None:
        """Raise ShapeError for a box upside down."""
        super().check(dimension)
        check_above("upper", *self.extent(dimension))

    def placed(self, grid: GridMap) -> dict[str, Any]:
        """Its corners; the keys of a prism in a grid that is turned by no multiple of 90 degrees."""
        (x, y, lower), (x_far, y_far, upper) = self.extent(3)
        if grid.keeps_boxes:
            corners = grid.box(*self.extent(3))
            return dict(zip(self.POINT_KEYS, (corner.tolist() for corner in corners), strict=True))
        outline = [[x, y], [x_far, y], [x_far, y_far], [x, y_far]]
        heights = dict(zip(("lower", "upper"), sorted(map(grid.elevation, (float(lower), float(upper)))), strict=True))
        return {"shape": "prism", "polygon": grid.to_map(outline).tolist()} | heights

    def extent(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """Its corners."""
        return np.array(self.lower, float), np.array(self.upper, float)

    def surface(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """Its faces."""
        lower, upper = self.extent(dimension)
        if dimension == 2:
            return closed_line(np.array([lower, [upper[0], lower[1]], upper, [lower[0], upper[1]]]))
        import trimesh

        box = trimesh.creation.box(bounds=[[0, 0, 0], [1, 1, 1]])
        return np.where(box.vertices == 0, lower, upper), box.faces  # the corners' own numbers: no round-off


class Circle(Shape):
    """A circle."""

    POINT_KEYS = ("center",)
    PLAN_SIZES = ("radius",)

    center: Point
    """the centre"""
    radius: Size
    """the radius"""

    def extent(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """The square around it."""
        return around(np.array([self.center], float), self.radius)

    def sides_and_volume(self, dimension: int) -> tuple[np.ndarray, float]:
        """Sides of the square around it, and its exact area: pi / 4 of the square's."""
        sides, area = super().sides_and_volume(dimension)
        return sides, area * (np.pi / 4)

    def surface(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """A polygon of CIRCLE_SEGMENTS corners, moved outward until the area is exact."""
        angle = 2 * np.pi / CIRCLE_SEGMENTS * np.arange(CIRCLE_SEGMENTS)
        around_it = np.column_stack([np.cos(angle), np.sin(angle)])
        return closed_line(np.array(self.center, float) + self.radius * circle_growth() * around_it)


def circle_growth() -> float:
    """Radius of the polygon of CIRCLE_SEGMENTS corners that has the unit circle's area."""
    step = 2 * np.pi / CIRCLE_SEGMENTS
    return np.sqrt(step / np.sin(step))


class Cylinder(Shape):
    """A cylinder by the centres of its ends."""

    POINT_KEYS = ("start", "end")
    PLAN_SIZES = ("radius",)

    start: Point
    """the centre of one end"""
    end: Point
    """the centre of the other end"""
    radius: Size
    """the radius"""

    def check(self, dimension: int) -> None:
        """Raise ShapeError for a cylinder without length."""
        super().check(dimension)
        if self.start == self.end:
            raise ShapeError("the same point as where it starts", "end")

    def extent(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """A box around it with room to spare."""
        return around(np.array([self.start, self.end], float), self.radius)

    def sides_and_volume(self, dimension: int) -> tuple[np.ndarray, float]:
        """Along its own axis, and exact."""
        length = float(np.linalg.norm(np.subtract(self.end, self.start)))
        sides = np.array([2 * self.radius, 2 * self.radius, length])
        return sides, np.pi * self.radius**2 * length

    def surface(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """CIRCLE_SEGMENTS flat faces around it, moved outward until the volume is exact, and its ends."""
        import trimesh

        start, end = np.array(self.start, float), np.array(self.end, float)
        radius = self.radius * circle_growth()
        cylinder = trimesh.creation.cylinder(radius, segment=[[0, 0, 0], end - start], sections=CIRCLE_SEGMENTS)
        return cylinder.vertices + start, cylinder.faces


class Sphere(Shape):
    """A ball."""

    POINT_KEYS = ("center",)
    PLAN_SIZES = ("radius",)

    center: Point
    """the centre"""
    radius: Size
    """the radius"""

    def extent(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """The cube around it."""
        return around(np.array([self.center], float), self.radius)

    def sides_and_volume(self, dimension: int) -> tuple[np.ndarray, float]:
        """Sides of the cube around it, and its exact volume: pi / 6 of the cube's."""
        sides, volume = super().sides_and_volume(dimension)
        return sides, volume * (np.pi / 6)

    def surface(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """Triangles of a divided icosahedron, moved outward until the volume is exact."""
        import trimesh

        ball = trimesh.creation.icosphere(subdivisions=SPHERE_SUBDIVISIONS)
        radius = self.radius * (4 / 3 * np.pi / ball.volume) ** (1 / 3)
        return ball.vertices * radius + np.array(self.center, float), ball.faces


class Polygon(Shape):
    """A polygon by its corners, of which the last may repeat the first."""

    POINT_KEYS = ("points",)

    points: Annotated[tuple[Point, ...], Field(min_length=3), AsTuple]
    """its corners"""

    def check(self, dimension: int) -> None:
        """Raise ShapeError for a polygon without area, or one that crosses itself."""
        super().check(dimension)
        check_outline("points", self._corners())

    def _corners(self) -> np.ndarray:
        return np.array(self.points, float)

    def extent(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """The rectangle around it."""
        return around(self._corners(), 0.0)

    def sides_and_volume(self, dimension: int) -> tuple[np.ndarray, float]:
        """Along one of its edges, and exact."""
        return box_around(self._corners())

    def surface(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """Its edges; neighbours that are the same point are one."""
        corners = self._corners()
        corners = corners[np.append(True, (np.diff(corners, axis=0) != 0).any(axis=1))]
        if len(corners) < 3:
            raise ShapeError(f"needs at least 3 different points, has {len(corners)}", "points")
        return closed_line(corners[:-1] if (corners[0] == corners[-1]).all() else corners)
