"""Nodes of a narrow opening that each of its walls has for itself (phantom nodes).

Shape functions of a cut cell reach into the opening. Where two walls are so near that their cells share nodes there,
the rock of one is tied to that of the other, and supports it. So where the solid parts of the cells around a node do
not hang together among themselves, every group of them gets a node of its own at that place: the displacement of one
wall is independent of the other's (Hansbo and Hansbo 2004, Comput. Methods Appl. Mech. Eng. 193, 3523; Song, Areias and
Belytschko 2006, Int. J. Numer. Methods Eng. 67, 868). Kernels see a cell with other nodes, and no more.

Parts hang together if solid samples face each other across a face that their cells share. Slivers of one curved wall
need not: more nodes than necessary do no harm. Since the rule depends on the cells around the node alone, a part of
the mine has the nodes that the mine has. What was apart once stays apart, since its nodes may have moved apart: fill
that is placed between such walls later moves with either of them, and does not hold them. A cell has one set of nodes,
so rock on both sides of an opening within one cell stays tied.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numba import njit

from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid.mesh import BIT_ORDER, MultiLevelGrid
from mpm_core.kernels.nodal_operations import mark_cells
from mpm_core.model.occupancy import Changes

NO_CELL = -1


class PhantomNodes(NamedTuple):
    """A grid with phantom nodes, and the walls that they belong to."""

    grid: MultiLevelGrid
    severed: np.ndarray
    """(pair, 3) int64: a node, a cell that stands at its place and has another node there, that corner of the cell (bit
    order)"""
    unheld: np.ndarray
    """(place, 2^d) int64: cells, else NO_CELL, whose fill lies between walls that were apart before it was placed: it
    does not hold them there"""


def with_phantom_nodes(grid: MultiLevelGrid, changes: Changes, step: int) -> PhantomNodes:
    """A grid without phantom nodes as it is once `step` is mined and filled.

    Nodes stay one at the border, where cells are not of the finest size and where a node hangs.
    """
    whole = without_phantom_nodes(grid)
    done = changes.step <= step
    octants = _octants(grid, changes.cell[done])
    if not len(octants):
        return whole
    cells, dimension, last = len(grid.cell_level), grid.dimension, octants.shape[1] - 1
    apart, now = np.zeros((2, *octants.shape), np.int8)
    for when in np.unique(changes.step[done]):
        changed = np.zeros(cells, bool)
        changed[changes.cell[changes.step == when]] = True
        rows = np.flatnonzero(changed[octants].any(axis=1))
        now[rows] = _groups(changes.solid_samples(cells, when)[octants[rows]])
        apart[rows] = _both(apart[rows], now[rows])
    rock = changes.rock_samples(cells, step)[octants] != 0
    number = _numbers(apart, now, rock)
    split = np.flatnonzero(number.max(axis=1) > 0)
    if not len(split):
        return whole
    octants, number, now = octants[split], number[split], now[split]
    corner = last - np.arange(last + 1)  # of each octant's cell, at the node
    cell_nodes = grid.vtk_nodes[:, BIT_ORDER[dimension]]
    own = cell_nodes[octants[:, 0], corner[0]]
    more = number.max(axis=1).astype(np.int64)
    first = len(grid.node_index) + np.cumsum(more) - more
    cell_nodes[octants, corner] = np.where(number > 0, first[:, None] + number - 1, own[:, None])
    at = np.repeat(own, more)
    parted = replace(
        grid,
        vtk_nodes=np.ascontiguousarray(cell_nodes[:, BIT_ORDER[dimension]]),
        node_index=np.concatenate([grid.node_index, grid.node_index[at]]),
        node_parents=np.concatenate([grid.node_parents, np.full((len(at), grid.node_parents.shape[1]), -1, np.int32)]),
        phantoms=len(at),
    )
    pairs = []
    for group in range(int(more.max()) + 1):
        row, octant = np.nonzero((number != group) & (more >= group)[:, None])
        node = own[row] if group == 0 else first[row] + group - 1
        pairs.append(np.stack([node, octants[row, octant], corner[octant]], axis=1))
    return PhantomNodes(parted, np.concatenate(pairs), _unheld(octants, number, now))


def without_phantom_nodes(grid: MultiLevelGrid) -> PhantomNodes:
    """A grid of which no node is divided."""
    return PhantomNodes(grid, np.empty((0, 3), np.int64), np.empty((0, 1 << grid.dimension), np.int64))


def _octants(grid: MultiLevelGrid, mined: np.ndarray) -> np.ndarray:
    """The cells (node, 2^d) around each node of mined cells that may be split: bit k of a place says on which side of
    axis k; mined (k,) indices."""
    corners, order = 1 << grid.dimension, BIT_ORDER[grid.dimension]
    chosen = np.zeros(len(grid.node_index), bool)
    chosen[grid.vtk_nodes[np.unique(mined)]] = True
    chosen[grid.is_hanging] = False
    chosen[grid.node_parents[grid.node_parents >= 0]] = False
    finest = np.flatnonzero(grid.cell_level == grid.levels - 1)
    touched = np.empty(len(grid.cell_level), bool)
    mark_cells(grid.vtk_nodes, chosen, touched)
    around = finest[touched[finest]]
    nodes = np.flatnonzero(chosen)
    row = np.full(len(chosen), -1, np.int64)
    row[nodes] = np.arange(len(nodes))
    octants = np.full((len(nodes), corners), NO_CELL, np.int64)
    for corner in range(corners):
        at = row[grid.vtk_nodes[around, order[corner]]]
        octants[at[at >= 0], corners - 1 - corner] = around[at >= 0]
    return octants[(octants != NO_CELL).all(axis=1)]


def _unheld(octants: np.ndarray, number: np.ndarray, now: np.ndarray) -> np.ndarray:
    """Cells (place, 2^d), else NO_CELL, of what hangs together now and has several nodes; octants, number, now (node,
    2^d)."""
    several = np.zeros(number.shape, bool)
    for group in range(number.shape[1]):
        among = now == group
        least = np.where(among, number, number.shape[1]).min(axis=1)
        apart = np.where(among, number, -1).max(axis=1) > least
        several |= among & apart[:, None]
    places = several.any(axis=1)
    return np.where(several[places], octants[places], NO_CELL)


@njit(cache=True)
def _hang_together(low, high, axis, per_edge):
    """True if samples of a cell face some of the next cell's along an axis."""
    stride = per_edge**axis
    across = low >> np.uint64((per_edge - 1) * stride)  # those at the high face, at the place of those at the low face
    for sample in range(64):
        if (sample // stride) % per_edge == 0 and (across & high) >> np.uint64(sample) & np.uint64(1):
            return True
    return False


@njit(cache=True)
def _groups_of(solid, per_edge, group):
    """Groups of octants whose samples hang together: solid (node, 2^d) uint64; group (node, 2^d) int8, written, -1
    where nothing is solid."""
    octants = solid.shape[1]
    for node in range(len(solid)):
        for octant in range(octants):
            group[node, octant] = octant if solid[node, octant] else -1
        changed = True
        while changed:
            changed = False
            for octant in range(octants):
                axis = 0
                while 1 << axis < octants:
                    one, other = group[node, octant], group[node, octant | 1 << axis]
                    if one >= 0 and other >= 0 and one != other:
                        if _hang_together(solid[node, octant], solid[node, octant | 1 << axis], axis, per_edge):
                            group[node, octant] = group[node, octant | 1 << axis] = min(one, other)
                            changed = True
                    axis += 1


def _groups(solid: np.ndarray) -> np.ndarray:
    """Groups of octants as `_groups_of` writes them, (node, 2^d) int8."""
    group = np.empty(solid.shape, np.int8)
    _groups_of(solid, round(SAMPLES_PER_CELL ** (1 / np.log2(solid.shape[1]))), group)
    return group


@njit(cache=True)
def _both(apart, now):
    """Groups (node, 2^d) of what is in one group of both: the first octant of each is its number."""
    result = np.empty_like(apart)
    for node in range(len(apart)):
        for octant in range(apart.shape[1]):
            result[node, octant] = octant
            for before in range(octant):
                if apart[node, before] == apart[node, octant] and now[node, before] == now[node, octant]:
                    result[node, octant] = result[node, before]
                    break
    return result


@njit(cache=True)
def _numbers(apart, now, rock):
    """Number (node, 2^d) int8 of the node that each octant has, 0 the one that was there.

    Octants with rock have those of their groups `apart`; fill that of the first rock which it hangs together with now.
    """
    number = np.zeros_like(apart)
    for node in range(len(apart)):
        count = 0
        for octant in range(apart.shape[1]):
            if not rock[node, octant]:
                continue
            found = False
            for before in range(octant):
                if rock[node, before] and apart[node, before] == apart[node, octant]:
                    number[node, octant] = number[node, before]
                    found = True
                    break
            if not found:
                number[node, octant] = count
                count += 1
        for octant in range(apart.shape[1]):
            if rock[node, octant] or now[node, octant] < 0:
                continue
            for other in range(apart.shape[1]):
                if rock[node, other] and now[node, other] == now[node, octant]:
                    number[node, octant] = number[node, other]
                    break
    return number
