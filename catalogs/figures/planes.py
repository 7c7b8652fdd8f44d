"""Planes of projection for the first page: the plan, the vertical section that shows openings best, what they show."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.figures import views

# A section to the north-east or north-west must show the openings so many times as long as one along an axis does.
MIN_DIAGONAL_GAIN = 1.1
MARGIN = 0.12  # Of the longest side of what is shown, on each side of it.
REACH = 1.0  # Events are in the picture up to this many longest sides of the openings away from them.


@dataclass(frozen=True)
class Plane:
    """A plane to project onto: unit vectors to the right and up, the names of both axes, and whether the first is a
    coordinate. Where it is none, distances are counted from the left side of the picture."""

    name: str
    right: tuple[float, float, float]
    up: tuple[float, float, float]
    labels: tuple[str, str]
    along_axis: bool = True

    def project(self, points: NDArray) -> NDArray:
        """Places (point, 2), m, of points (point, 3)."""
        return points @ np.array([self.right, self.up]).T


EAST, NORTH, UP = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
HALF = float(np.sqrt(0.5))
X, Y, Z = views.AXIS_LABELS
PLAN = Plane("Plan", EAST, NORTH, (X, Y))
SECTIONS = (
    Plane("Section looking north", EAST, UP, (X, Z)),
    Plane("Section looking west", NORTH, UP, (Y, Z)),
    Plane("Section looking north-east", (HALF, -HALF, 0.0), UP, ("to the south-east (m)", Z), along_axis=False),
    Plane("Section looking north-west", (HALF, HALF, 0.0), UP, ("to the north-east (m)", Z), along_axis=False),
)


def section_of(grid: xr.Dataset, focus: Sequence[int]) -> Plane:
    """The section that shows these excavations longest: that in whose horizontal direction they spread most.

    Spread: standard deviation of the mined volume. Of directions that show them about as long, one along an axis.
    """
    centre, volume = _pieces(grid, focus)
    if not volume.sum() > 0:
        return SECTIONS[0]
    spread = []
    for section in SECTIONS:
        along = section.project(centre)[:, 0]
        variance = np.average((along - np.average(along, weights=volume)) ** 2, weights=volume)
        spread.append(np.sqrt(variance) / (1.0 if section.along_axis else MIN_DIAGONAL_GAIN))
    return SECTIONS[int(np.argmax(np.round(spread, 6)))]  # of equal ones the first, whatever the round-off


def frame(grid: xr.Dataset, focus: Sequence[int], places: Sequence[NDArray]) -> tuple[NDArray, NDArray]:
    """Box, m, around these excavations and those of the places (place, 3) that are within REACH of them, with a margin;
    inside the domain."""
    lower, upper = views.domain(grid)
    box = box_of(grid, focus)
    if box is None:
        return lower, upper
    low, high = box
    near = [place[within_reach(place, low, high)] for place in places]
    low, high = np.concatenate([*near, [low]]).min(axis=0), np.concatenate([*near, [high]]).max(axis=0)
    around = MARGIN * float((high - low).max())
    return np.maximum(low - around, lower), np.minimum(high + around, upper)


def box_of(grid: xr.Dataset, excavations: Sequence[int]) -> tuple[NDArray, NDArray] | None:
    """Lower and upper corner, m, of the box around these excavations' cells; None where they have none."""
    corners = corners_of(grid, excavations)
    return (corners.min(axis=0), corners.max(axis=0)) if len(corners) else None


def corners_of(grid: xr.Dataset, excavations: Sequence[int]) -> NDArray:
    """Lower and upper corners (corner, 3), m, of these excavations' cells."""
    own = np.isin(grid["piece_excavation"].values, list(excavations))
    return views.piece_corners(grid)[np.tile(own, 2)]


def within_reach(place: NDArray, low: NDArray, high: NDArray) -> NDArray:
    """Which places (event, 3) are at most REACH longest sides of the box away from it (event,)."""
    reach = REACH * float((high - low).max())
    return np.all((place >= low - reach) & (place <= high + reach), axis=1)


def silhouette(plane: Plane, grid: xr.Dataset, excavations: Sequence[int]) -> tuple[NDArray, NDArray]:
    """What the excavations' cells cover as seen along the plane's normal: lower corners (n, 2) and the size (2,), m.

    A place is covered where a cell behind it is excavated for MIN_EXCAVATED_SHARE_DRAWN; of an opening so narrow that
    none is, where a cell is for half as much as its fullest.
    """
    edge = float(grid.attrs["fine_cell"])
    # Diagonally, the middles of neighbouring columns are half the width of a cell apart.
    step = np.array([edge if plane.along_axis else edge * HALF, edge])
    size = step if plane.along_axis else step * [2.0, 1.0]
    centre, volume = _pieces(grid, excavations)
    if not len(centre):
        return np.zeros((0, 2)), size
    _, cell = np.unique(np.rint((centre - views.domain(grid)[0]) / (edge / 2)), axis=0, return_inverse=True)
    share = np.bincount(cell.ravel(), volume)[cell.ravel()] / edge ** int(grid.attrs["dimension"])
    place = plane.project(centre)
    zero = place.min(axis=0)
    column, index = np.unique(np.rint((place - zero) / step), axis=0, return_inverse=True)
    fullest = np.zeros(len(column))
    np.maximum.at(fullest, index.ravel(), share)
    kept = fullest >= min(views.MIN_EXCAVATED_SHARE_DRAWN, fullest.max() / 2)
    return zero + column[kept] * step - size / 2, size


def plane_of(grid: xr.Dataset) -> Plane:
    """The plane that a mine in a plane is computed in."""
    return PLAN if grid.attrs.get("plane") == "xy" else SECTIONS[0]


def _pieces(grid: xr.Dataset, excavations: Sequence[int]) -> tuple[NDArray, NDArray]:
    """Centres (piece, 3) of the cells that these excavations take a part of, and the volumes taken (piece,)."""
    centre, volume = views.piece_centres(grid)
    own = np.isin(grid["piece_excavation"].values, list(excavations))
    return centre[own], volume[own]
