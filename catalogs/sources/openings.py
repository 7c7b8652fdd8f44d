"""Openings on the grid: which is nearest to an event, of those that are mined when it happens, and the rock mined."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import cKDTree

NEIGHBOURS = 16  # Cells, nearest by their centres, among which the nearest by its sides is looked for.


def nearest_opening(
    points: NDArray, origin: NDArray, edge: float, opening: NDArray, is_open: NDArray
) -> tuple[NDArray, NDArray]:
    """Index of the nearest opening of each point, and the distance to its cells, m; 0 inside.

    points (point, xyz), m; origin (piece, xyz): lower corner of a cell that belongs to an opening, wholly or in part;
    edge: of these cells, m; opening (piece,): its index; is_open (opening,): those that are mined. -1 and NaN where
    nothing is mined.

    >>> cells, numbers = np.array([[0.0, 0, 0], [10, 0, 0]]), np.array([0, 1])
    >>> nearest_opening(np.array([[4.0, 0.5, 0.5]]), cells, 1.0, numbers, np.array([True, True]))
    (array([0]), array([3.]))
    >>> nearest_opening(np.array([[4.0, 0.5, 0.5]]), cells, 1.0, numbers, np.array([False, True]))
    (array([1]), array([6.]))
    """
    mined = np.flatnonzero(is_open[opening])
    if not len(mined) or not len(points):
        return np.full(len(points), -1), np.full(len(points), np.nan)
    lower = origin[mined]
    count = min(NEIGHBOURS, len(mined))
    near = cKDTree(lower + 0.5 * edge).query(points, count)[1].reshape(len(points), count)
    outside = np.maximum(np.maximum(lower[near] - points[:, None], points[:, None] - lower[near] - edge), 0.0)
    distance = np.linalg.norm(outside, axis=2)
    best = distance.argmin(axis=1)
    row = np.arange(len(points))
    return opening[mined[near[row, best]]], distance[row, best]


def volumes_mined(grid: xr.Dataset, steps: Sequence[Sequence[int]]) -> list[float]:
    """Volume that each step mines, m3; steps: indices of the excavations that each mines, in order.

    Where solids overlap it counts once, in the step that comes first; fill that is mined again is no rock.
    """
    lower, upper, edge = (np.asarray(grid.attrs[name]) for name in ("domain_lower", "domain_upper", "fine_cell"))
    cell, end = (np.rint((corner - lower) / edge).astype(np.int64) for corner in (grid["piece_origin"].values, upper))
    _, place = np.unique(np.ravel_multi_index(cell.T, end + 1), return_inverse=True)
    # Each bit is a point of the cell, inside the excavation or not.
    samples, excavation = grid["piece_samples"].values, grid["piece_excavation"].values
    points = 8 * samples.dtype.itemsize
    gone, found = np.zeros(len(place), samples.dtype), []
    volume = float(edge) ** int(grid.attrs["dimension"]) * float(grid.attrs["thickness"])
    for wanted in steps:
        own = np.flatnonzero(np.isin(excavation, wanted))
        here = np.unique(place[own])
        before = gone[here]
        np.bitwise_or.at(gone, place[own], samples[own])
        found.append(float(np.bitwise_count(gone[here] & ~before).sum()) / points * volume)
    return found
