"""Any outline in plane strain."""

from typing import Annotated

import numpy as np
from pydantic import Field

from common.setting_types import AsTuple, Point
from mpm_core.geometry.outlines import box_around
from mpm_core.geometry.shapes.shape import Shape, ShapeError, around, check_outline, closed_line


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
