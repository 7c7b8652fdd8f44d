"""Between a grid and the next coarser one: multilinear interpolation, and its transpose for forces."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mpm_core.multigrid.coarsening import LevelGrid
from mpm_core.multigrid.families import Families


@njit(cache=True)
def _interpolate(cell_index, cell_width, cell_nodes, node_parents, coarse_nodes, coarse_of_cell, parent_start, parents):
    """Coarse parents of every free node: `parents` (link,) nodes, written; with no room in it, they are only counted.

    parent_start (node + 1,): written while counting, read while writing. A merged cell's node lies between 1, 2, 4 or
    8 corners of the coarse cell; other cells keep their corners.
    """
    cells, corners = cell_nodes.shape
    dimension = cell_index.shape[1]
    counting = len(parents) == 0
    done = np.zeros(len(node_parents), np.bool_)
    for cell in range(cells):
        for corner in range(corners):
            node = cell_nodes[cell, corner]
            if done[node] or node_parents[node, 0] >= 0:
                continue
            done[node] = True
            between = 0  # axes along which the node is half-way
            upper = corner
            if cell_width[cell] == 1:
                upper = 0
                for axis in range(dimension):
                    steps = (cell_index[cell, axis] & 1) + ((corner >> axis) & 1)
                    between |= (steps & 1) << axis
                    upper |= (steps >> 1) << axis
            if counting:
                count = 1
                for axis in range(dimension):
                    count <<= (between >> axis) & 1
                parent_start[node + 1] = count
                continue
            link = parent_start[node]
            for other in range(corners):
                if other & ~between == upper:
                    parents[link] = coarse_nodes[coarse_of_cell[cell], other]
                    link += 1
    if counting:
        for node in range(len(node_parents)):
            parent_start[node + 1] += parent_start[node]


@njit(cache=True)
def _transpose(parent_start, parents, coarse_nodes, fine_row):
    """(link_start, links): rows of the free nodes that use each coarse node, ascending by node."""
    link_start = np.zeros(coarse_nodes + 1, np.int64)
    for link in range(len(parents)):
        link_start[parents[link] + 1] += 1
    for node in range(coarse_nodes):
        link_start[node + 1] += link_start[node]
    room = link_start[:-1].copy()
    links = np.empty(len(parents), np.int32)
    for node in range(len(parent_start) - 1):
        for link in range(parent_start[node], parent_start[node + 1]):
            parent = parents[link]
            links[room[parent]] = fine_row[node]
            room[parent] += 1
    return link_start, links


@dataclass(frozen=True)
class Transfer:
    """Links between the rows of a level and of the next coarser one, for kernels.operator_rows.restrict and prolong.

    fine_ranks (fine row,), coarse_ranks (coarse row,) int32: the node whose own row this is, -1 for copies;
    parent_start (fine node + 1,), parents: coarse rows between which each free node lies; link_start (coarse node +
    1,), links: rows of the free nodes that lie beside each coarse node; fine_weights (fine row,): 1 / parents.
    """

    fine_ranks: np.ndarray
    coarse_ranks: np.ndarray
    parent_start: np.ndarray
    parents: np.ndarray
    link_start: np.ndarray
    links: np.ndarray
    fine_weights: np.ndarray


def build_transfer(
    fine: LevelGrid, fine_families: Families, coarse: LevelGrid, coarse_families: Families, coarse_of_cell: np.ndarray
) -> Transfer:
    """Transfer between two grids of the hierarchy, `coarse` being that of `coarsening.coarsen(fine)`."""
    parent_start = np.zeros(len(fine.node_parents) + 1, np.int64)
    arguments = (
        fine.cell_index,
        fine.cell_width,
        fine.cell_nodes,
        fine.node_parents,
        coarse.cell_nodes,
        coarse_of_cell,
        parent_start,
    )
    _interpolate(*arguments, np.empty(0, np.int32))
    parents = np.empty(parent_start[-1], np.int32)
    _interpolate(*arguments, parents)
    link_start, links = _transpose(parent_start, parents, len(coarse.node_parents), fine_families.node_row)
    count = np.diff(parent_start)
    fine_ranks = own_nodes(fine_families, count > 0)
    weights = np.zeros(fine_families.rows, np.float32)
    own = fine_ranks >= 0
    weights[own] = 1.0 / count[fine_ranks[own]]
    return Transfer(
        fine_ranks=fine_ranks,
        coarse_ranks=own_nodes(coarse_families, np.ones(len(coarse.node_parents), bool)),
        parent_start=parent_start,
        parents=coarse_families.node_row[parents],
        link_start=link_start,
        links=links,
        fine_weights=weights,
    )


def own_nodes(families: Families, wanted: np.ndarray) -> np.ndarray:
    """(row,) int32: the node whose own row this is, -1 for others and for nodes that are not wanted."""
    nodes = np.full(families.rows, -1, np.int32)
    chosen = np.flatnonzero(wanted)
    nodes[families.node_row[chosen]] = chosen
    return nodes
