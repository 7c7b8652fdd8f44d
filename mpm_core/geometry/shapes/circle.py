"""A circle in plane strain: a long round hole across the plane."""

import numpy as np

from common.setting_types import Point, Size
from mpm_core.geometry.shapes.shape import Shape, around, closed_line

CIRCLE_SEGMENTS = 96  # inscribed, the polygon lacks 0.07 % of the circle


class Circle(Shape):
    """A circle."""

    POINT_KEYS = ("center",)

    center: Point
    """the centre"""
    radius: Size
    """the radius"""

    def extent(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """The square around it."""
        return around(np.array([self.center], float), self.radius)

    def sides_and_volume(self, dimension: int) -> tuple[np.ndarray, float]:
        """Those of the square, and pi / 4 of its area."""
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
