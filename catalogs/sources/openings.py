"""Openings on the grid: which is nearest to an event, of those that are mined when it happens, and what each mines.

Where solids overlap, the first step that mines the rock mines it; of one step, the excavation that comes first in
grid.nc. Fill is mined again by a later excavation. What stands open already is not mined. The mechanics follow the same
order (mpm_core/model/occupancy.py).
"""

import json
from collections import defaultdict
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from common.errors import InputError

NEIGHBOURS = 16  # Cells, nearest by their centres, among which the nearest by its sides is looked for.
SPANS = 8  # Parts of a span of steps in which its openings are looked for.
NEVER = 1 << 30  # Place in the order of steps of what no step does.
MIN_OVERLAP = 0.05  # Excavations overlap that have more than this share of the smaller one in common.
NOTHING, ROCK, FILL = range(3)  # What an excavation mines of one of its pieces.


@dataclass(frozen=True)
class Mining:
    """Which excavation mines which part of which cell, by the pieces of grid.nc.

    origin (piece, xyz): lower corner of the cell, m; excavation (piece,); step (piece,): place in the order of steps;
    takes (piece,): NOTHING, ROCK or FILL; until (piece,): step in which another excavation mines fill there, or NEVER;
    volume (piece,) m3; count: number of excavations.
    """

    origin: NDArray
    excavation: NDArray
    step: NDArray
    takes: NDArray
    until: NDArray
    volume: NDArray
    count: int

    @classmethod
    def of(cls, grid: xr.Dataset, mined: NDArray, filled: NDArray) -> "Mining":
        """What is mined where each excavation is mined and filled in these steps, (excavation,), NEVER for none.

        Raises InputError for a grid of an earlier version.
        """
        if "piece_volume" not in grid:
            raise InputError("grid.nc was made by an earlier version; delete it and run again")
        part, excavation = _parts_of(grid), grid["piece_excavation"].values.astype(np.int64)
        state, last = np.full(part.max(initial=-1) + 1, ROCK), np.full(part.max(initial=-1) + 1, -1)
        takes, until = np.full(len(part), NOTHING), np.full(len(part), NEVER)
        mined, filled = np.asarray(mined, np.int64), np.asarray(filled, np.int64)
        order, place = np.lexsort((excavation, mined[excavation])), np.argsort(filled[excavation], kind="stable")
        mined_in, filled_in = mined[excavation[order]], filled[excavation[place]]
        for step in np.unique(np.concatenate([mined, filled])):
            if step == NEVER:
                continue
            own = order[slice(*np.searchsorted(mined_in, [step, step + 1]))]
            own = own[np.unique(part[own], return_index=True)[1]]  # of each part the first excavation
            own = own[state[part[own]] != NOTHING]
            takes[own] = state[part[own]]
            again = last[part[own]]
            until[again[again >= 0]] = step
            state[part[own]], last[part[own]] = NOTHING, own
            placed = part[place[slice(*np.searchsorted(filled_in, [step, step + 1]))]]
            state[placed[state[placed] == NOTHING]] = FILL
        volume = grid["piece_volume"].values
        return cls(grid["piece_origin"].values, excavation, mined[excavation], takes, until, volume, len(mined))

    def volumes(self, kind: int) -> NDArray:
        """Volume that each excavation mines of a kind, ROCK or FILL, (excavation,) m3."""
        return np.bincount(self.excavation, np.where(self.takes == kind, self.volume, 0.0), minlength=self.count)

    def cells_open(self, step: int) -> tuple[NDArray, NDArray]:
        """Cells that excavations have mined a part of up to a step: lower corners (cell, xyz) m, and of each the
        excavation (cell,) that mined there last; a cell may have several."""
        return self._cells(np.flatnonzero((self.takes != NOTHING) & (self.step <= step) & (self.until > step)))

    def _cells(self, own: NDArray) -> tuple[NDArray, NDArray]:
        """Lower corners (cell, xyz) m and excavations (cell,) of pieces (k,), of which those of one cell are one."""
        origin, excavation = self.origin[own], self.excavation[own]
        same = (origin[1:] == origin[:-1]).all(axis=1) & (excavation[1:] == excavation[:-1])
        first = np.append(True, ~same)[: len(own)]
        return origin[first], excavation[first]

    def nearest_open(self, points: NDArray, step: NDArray, edge: float, axes: list[int]) -> tuple[NDArray, NDArray]:
        """Index of the nearest excavation of each point that is open in the point's step, and the distance, m.

        Of several as near, it is the one mined last.

        points (point, d) m, along these axes; step (point,); edge: of the cells, m. -1 and NaN where nothing is open.
        Pieces are searched together that are open in a span of steps, the spans SPANS times shorter at each level, so
        that no piece is searched anew for each step.
        """
        found, distance = np.full(len(points), -1), np.full(len(points), np.inf)
        mined = np.full(self.count + 1, -1)  # one more, of no excavation
        mined[self.excavation] = self.step
        rank = latest_first(mined)
        steps, place = np.unique(step, return_inverse=True)
        first, end = np.searchsorted(steps, self.step), np.searchsorted(steps, self.until)
        spans = [(0, len(steps), np.arange(len(points)), np.flatnonzero((self.takes != NOTHING) & (first < end)))]
        while spans:
            start, stop, own, pieces = spans.pop()
            whole = (first[pieces] <= start) & (end[pieces] >= stop)
            origin, excavation = self._cells(pieces[whole])
            of_all = np.ones(self.count, bool)
            nearest, apart = nearest_opening(points[own], origin[:, axes], edge, excavation, of_all, rank)
            closer = (apart < distance[own]) | ((apart == distance[own]) & (rank[nearest] < rank[found[own]]))
            found[own[closer]], distance[own[closer]] = nearest[closer], apart[closer]
            rest = pieces[~whole]
            bounds = np.unique(np.linspace(start, stop, SPANS + 1).astype(int))
            for low, high in pairwise(bounds.tolist()) if len(rest) else ():
                inside = own[(place[own] >= low) & (place[own] < high)]
                spans.append((low, high, inside, rest[(first[rest] < high) & (end[rest] > low)]))
        return found, np.where(found >= 0, distance, np.nan)

    def first_mined(self, grid: xr.Dataset) -> xr.Dataset:
        """The grid with the pieces that their excavations mine as rock only, so that each part of a cell is in one.

        Its attribute `excavation_overlaps` tells which excavations overlap, as JSON.
        """
        drawn = grid.isel(piece=np.flatnonzero(self.takes == ROCK))
        return drawn.assign_attrs(excavation_overlaps=json.dumps(overlaps(grid)))


def _parts_of(grid: xr.Dataset) -> NDArray:
    """Number of the part of a cell that each piece is, (piece,): one for pieces of several excavations that overlap."""
    corner, edge = np.asarray(grid.attrs["domain_lower"]), float(grid.attrs["fine_cell"])
    cell = np.rint((grid["piece_origin"].values - corner) / edge).astype(np.int64)
    if not len(cell):
        return np.empty(0, np.int64)
    code = np.ravel_multi_index(cell.T, cell.max(axis=0) + 1)
    samples = grid["piece_samples"].values
    order = np.lexsort((samples, code))
    other = (np.diff(code[order]) != 0) | (samples[order][1:] != samples[order][:-1])
    part = np.empty(len(order), np.int64)
    part[order] = np.append(0, np.cumsum(other))
    return part


def overlaps(grid: xr.Dataset) -> list[tuple[int, int]]:
    """Pairs of excavations that hold the same points of cells, more than MIN_OVERLAP of the smaller one."""
    if "piece_samples" not in grid or not grid.sizes["piece"]:
        return []
    samples, owner = grid["piece_samples"].values, grid["piece_excavation"].values.astype(np.int64)
    _, cell = np.unique(grid["piece_origin"].values, axis=0, return_inverse=True)
    order = np.argsort(cell.ravel(), kind="stable")
    cell, samples, owner = cell.ravel()[order], samples[order], owner[order]
    total = np.bincount(owner, np.bitwise_count(samples))
    both: dict[tuple[int, int], float] = defaultdict(float)
    for apart in range(1, int(np.bincount(cell).max())):  # places between two pieces of one cell in the list
        first = np.flatnonzero(cell[apart:] == cell[:-apart])
        shared = np.bitwise_count(samples[first] & samples[first + apart])
        first, shared = first[shared > 0], shared[shared > 0]
        for one, other, count in zip(owner[first], owner[first + apart], shared, strict=True):
            both[min(one, other), max(one, other)] += count
    return [(int(a), int(b)) for (a, b), count in both.items() if count > MIN_OVERLAP * min(total[a], total[b])]


def nearest_opening(
    points: NDArray, origin: NDArray, edge: float, opening: NDArray, is_open: NDArray, rank: NDArray
) -> tuple[NDArray, NDArray]:
    """Index of the nearest opening of each point, of several as near that of the lowest rank (opening,), and the
    distance to its cells, m; 0 inside.

    points (point, xyz), m; origin (piece, xyz): lower corner of a cell that belongs to an opening, wholly or in part;
    edge: of these cells, m; opening (piece,): its index; is_open (opening,): those that are mined. -1 and NaN where
    nothing is mined.

    >>> cells, numbers, rank = np.array([[0.0, 0, 0], [10, 0, 0]]), np.array([0, 1]), np.array([0, 1])
    >>> nearest_opening(np.array([[4.0, 0.5, 0.5]]), cells, 1.0, numbers, np.array([True, True]), rank)
    (array([0]), array([3.]))
    >>> nearest_opening(np.array([[4.0, 0.5, 0.5]]), cells, 1.0, numbers, np.array([False, True]), rank)
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
    least, found = distance.min(axis=1), opening[mined[near]]
    ranked = np.where(distance == least[:, None], rank[found], len(rank))
    return found[np.arange(len(points)), ranked.argmin(axis=1)], least


def latest_first(mined: NDArray) -> NDArray:
    """Rank (opening,) of openings that are mined in these steps (opening,): the one mined last first, else by index."""
    rank = np.empty(len(mined), np.int64)
    rank[np.lexsort((np.arange(len(mined)), -mined))] = np.arange(len(mined))
    return rank
