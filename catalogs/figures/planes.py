"""What each point of a plane through a scene lies in: rock, fill or void."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.figures.views import domain

NOWHERE, VOID, FILLED, ROCK = range(4)  # What a point lies in.


def look_up(grid: xr.Dataset, state: xr.Dataset, planned: list[int], places: NDArray) -> tuple[NDArray, NDArray]:
    """What each place (n, 3) m lies in, (n,) of NOWHERE to ROCK, and the particle (n,) of its rock, else -1.

    A cell that is mined in part is void where its samples are; planned excavations (indices) are rock. Shifts of nodes
    at edges are left out: they are smaller than a finest cell.
    """
    lower, upper = domain(grid)
    inside = ((places >= lower) & (places < upper)).all(axis=1)
    kind, particle = np.full(len(places), NOWHERE), np.full(len(places), -1)
    cell = _cells(grid, places, inside)
    kind[cell >= 0] = ROCK
    present = np.flatnonzero(state["volume"].values > 0)
    rock = state["excavation"].values[present] < 0
    own = present[rock]
    particle = _nearest(state, own, cell, places)
    kind[(cell >= 0) & (particle < 0)] = VOID
    void = _is_mined(grid, planned, places, inside)
    filled = np.isin(cell, state["cell"].values[present[~rock]])
    kind[void] = np.where(filled[void], FILLED, VOID)
    kind[(kind == VOID) & filled] = FILLED
    return kind, np.where(kind == ROCK, particle, -1)


def _cells(grid: xr.Dataset, places: NDArray, inside: NDArray) -> NDArray:
    """Cell (n,) that holds each place, -1 outside."""
    lower, upper = domain(grid)
    origin, size = grid["cell_origin"].values, grid["cell_size"].values
    found = np.full(len(places), -1)
    for edge in np.unique(size):
        own = np.flatnonzero(np.isclose(size, edge))
        shape = tuple(np.ceil((upper - lower) / edge).astype(np.int64) + 1)
        code = np.ravel_multi_index(tuple(np.rint((origin[own] - lower) / edge).astype(np.int64).T), shape)
        order = np.argsort(code)
        wanted = np.floor((places[inside] - lower) / edge).astype(np.int64)
        target = np.ravel_multi_index(tuple(wanted.T), shape)
        at = np.minimum(np.searchsorted(code[order], target), len(own) - 1)
        hit = code[order][at] == target
        found[np.flatnonzero(inside)[hit]] = own[order[at[hit]]]
    return found


def _nearest(state: xr.Dataset, own: NDArray, cell: NDArray, places: NDArray) -> NDArray:
    """The particle among `own` (k,) of each place's cell (n,) that is nearest to it, (n,); -1 where there is none."""
    of_cell = state["cell"].values[own]
    order = np.argsort(of_cell, kind="stable")
    first = np.searchsorted(of_cell[order], cell)
    count = np.where(cell >= 0, np.searchsorted(of_cell[order], cell, side="right") - first, 0)
    found, least = np.full(len(cell), -1), np.full(len(cell), np.inf)
    position = state["position"].values
    for number in range(count.max(initial=0)):
        here = np.flatnonzero(count > number)
        candidate = own[order[first[here] + number]]
        distance = np.linalg.norm(position[candidate] - places[here], axis=1)
        closer = distance < least[here]
        found[here[closer]], least[here[closer]] = candidate[closer], distance[closer]
    return found


def _is_mined(grid: xr.Dataset, planned: list[int], places: NDArray, inside: NDArray) -> NDArray:
    """Places (n,) bool in the part of a finest cell that an excavation has."""
    lower, upper = domain(grid)
    edge = float(grid.attrs["fine_cell"])
    mined = np.zeros(len(places), bool)
    kept = ~np.isin(grid["piece_excavation"].values, planned)
    samples = grid["piece_samples"].values[kept].astype(np.uint64)
    if not len(samples):
        return mined
    shape = tuple(np.ceil((upper - lower) / edge).astype(np.int64) + 1)
    piece = np.rint((grid["piece_origin"].values[kept] - lower) / edge).astype(np.int64)
    code, row = np.unique(np.ravel_multi_index(tuple(piece.T), shape), return_inverse=True)
    joined = np.zeros(len(code), np.uint64)
    np.bitwise_or.at(joined, row.reshape(-1), samples)
    offset = (places[inside] - lower) / edge
    whole = np.floor(offset).astype(np.int64)
    target = np.ravel_multi_index(tuple(whole.T), shape)
    at = np.minimum(np.searchsorted(code, target), len(code) - 1)
    sub = np.minimum(((offset - whole) * 4).astype(np.int64), 3) @ np.array([1, 4, 16])
    bit = (joined[at] >> sub.astype(np.uint64)) & np.uint64(1)
    mined[inside] = (code[at] == target) & (bit == 1)
    return mined
