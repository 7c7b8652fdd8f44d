"""A round bar between two points. In 2-D the name stands for a circle."""

import numpy as np

from common.setting_types import Point, Size
from mpm_core.geometry.shapes.circle import CIRCLE_SEGMENTS, circle_growth
from mpm_core.geometry.shapes.shape import Shape, ShapeError, around


class Cylinder(Shape):
    """A cylinder by the centres of its ends."""

    POINT_KEYS = ("start", "end")

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
