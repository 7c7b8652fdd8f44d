"""Planes of any strike and dip through a scene: by point, strike and dip, or along an excavation."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Plane:
    """A plane: point (3,) m; strike, clockwise from north, and dip, to its right, degrees.

    along (3,): unit vector of the strike; up (3,): up the dip; toward (3,): normal, to the side that the plane dips
    to, which it is looked at from. A horizontal plane is looked at from above.
    """

    point: NDArray
    strike: float
    dip: float
    along: NDArray
    up: NDArray
    toward: NDArray

    @classmethod
    def of(cls, point: ArrayLike, strike: float, dip: float) -> Self:
        """The plane of a point (3,) m, strike and dip, degrees.

        >>> upright = Plane.of([0, 0, 0], 90.0, 90.0)
        >>> np.round(np.stack([upright.along, upright.up, upright.toward]), 12) + 0.0
        array([[ 1.,  0.,  0.],
               [ 0.,  0.,  1.],
               [ 0., -1.,  0.]])
        """
        azimuth, angle = np.radians(strike), np.radians(dip)
        along = np.array([np.sin(azimuth), np.cos(azimuth), 0.0])
        right = np.array([np.cos(azimuth), -np.sin(azimuth), 0.0])
        vertical = np.array([0.0, 0.0, 1.0])
        up = vertical * np.sin(angle) - right * np.cos(angle)
        toward = vertical * np.cos(angle) + right * np.sin(angle)
        return cls(np.asarray(point, float), float(strike), float(dip), along, up, toward)

    def coordinates(self, places: NDArray) -> tuple[NDArray, NDArray]:
        """Coordinates (n, 2) along strike and up the dip of places (n, 3), and distances (n,) from the plane, m;
        positive to the side that it dips to."""
        offset = places - self.point
        return np.stack([offset @ self.along, offset @ self.up], axis=1), offset @ self.toward

    def places(self, coordinates: NDArray) -> NDArray:
        """Places (n, 3) m of coordinates (n, 2) in the plane."""
        return self.point + coordinates @ np.stack([self.along, self.up])

    def misses(self, lower: NDArray, upper: NDArray) -> float:
        """Distance of the plane from a box with corners (3,) m; 0 if it cuts the box."""
        middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        distance = abs(float((middle - self.point) @ self.toward))
        return max(distance - float(np.abs(self.toward) @ half), 0.0)

    def outline(self, lower: NDArray, upper: NDArray) -> NDArray:
        """Corners (k, 2), in the plane, of its part within a box; none where it misses the box."""
        corner = np.array(np.meshgrid(*np.stack([lower, upper], axis=1), indexing="ij")).reshape(3, -1).T
        places, distance = self.coordinates(corner)
        first, second = np.triu_indices(8, 1)
        is_edge = (corner[first] != corner[second]).sum(axis=1) == 1
        first, second = first[is_edge], second[is_edge]
        crossed = (distance[first] < 0) != (distance[second] < 0)
        first, second = first[crossed], second[crossed]
        share = (distance[first] / (distance[first] - distance[second]))[:, None]
        return places[first] + share * (places[second] - places[first])


def along_excavation(grid: xr.Dataset, excavation: int) -> Plane | None:
    """The upright plane through the middle of an excavation, along the direction in plan in which it is longest.

    None where it has no cells. grid: with the pieces of excavations. The strike is from 0 to below 180 degrees.
    """
    own = grid["piece_excavation"].values == excavation
    if not own.any():
        return None
    places = grid["piece_origin"].values[own] + 0.5 * float(grid.attrs["fine_cell"])
    weight = grid["piece_fraction"].values[own]
    middle = np.average(places, axis=0, weights=weight)
    spread = np.cov(places[:, :2].T, aweights=weight, ddof=0)
    east, north = np.linalg.eigh(spread)[1][:, 1]
    strike = float(np.degrees(np.arctan2(east, north))) % 180.0
    return Plane.of(middle, 0.0 if np.isclose(strike, 180.0) else strike, 90.0)
