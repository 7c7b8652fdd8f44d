"""A ball. In 2-D the name stands for a circle."""

import numpy as np

from common.setting_types import Point, Size
from mpm_core.geometry.shapes.shape import Shape, around

SPHERE_SUBDIVISIONS = 5  # 20480 triangles; inscribed, they lack 0.054 % of the ball


class Sphere(Shape):
    """A ball."""

    POINT_KEYS = ("center",)

    center: Point
    """the centre"""
    radius: Size
    """the radius"""

    def extent(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """The cube around it."""
        return around(np.array([self.center], float), self.radius)

    def sides_and_volume(self, dimension: int) -> tuple[np.ndarray, float]:
        """Those of the cube, and pi / 6 of its volume."""
        sides, volume = super().sides_and_volume(dimension)
        return sides, volume * (np.pi / 6)

    def surface(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """Triangles of a divided icosahedron, moved outward until the volume is exact."""
        import trimesh

        ball = trimesh.creation.icosphere(subdivisions=SPHERE_SUBDIVISIONS)
        radius = self.radius * (4 / 3 * np.pi / ball.volume) ** (1 / 3)
        return ball.vertices * radius + np.array(self.center, float), ball.faces
