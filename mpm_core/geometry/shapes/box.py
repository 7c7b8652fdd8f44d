"""A box along the axes, in 2-D a rectangle."""

from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator

from common.setting_types import Point, is_list, refusal
from mpm_core.geometry.shapes.shape import Shape, check_above, closed_line


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
