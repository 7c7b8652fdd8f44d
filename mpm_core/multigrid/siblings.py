"""The memory layout of the cells of one grid level for the elastic operator: groups, batches, blocks and rows.

A *group* is the 2^d sibling cells of one parent, which share 3^d nodes; siblings that are split are missing from it.
LANES groups side by side are a *batch*, a run of batches is a *block*. A nodal array has *rows* of its own for every
block, so blocks never write to the same place and the result does not depend on the number of threads::

    block 0:  none | nodes in order of first touch ...     block 1:  none | nodes ...

The first row of a block stands for nodes that a group lacks; it holds nothing. A node in several blocks has a row in
each: the first is its own, the others are *copies*. A hanging node is a copy in every block. Copies take their value
from the rows of their parents (its own row, or those of the 2 or 4 parents of a hanging node) before the operator is
applied, and give them their part of the force afterwards: C and C^T in one, in a fixed order.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from mpm_core.simd.lanes import LANES

# Fewest and most groups of a block: large blocks have few copies, many blocks keep all threads busy.
GROUPS_PER_BLOCK = (64, 4096)
BLOCKS_WANTED = 32  # Number of blocks if the groups per block allow it.


@dataclass(frozen=True)
class Siblings:
    """Layout of one level. Rows are numbered through all blocks.

    batch_start, row_start (block + 1,) int64; places (batch, 3^d, LANES) int32 row of each node; cell_place (cell,)
    int32 where a cell stands among (batch, 2^d, LANES); node_row (node,) int32 own row, the first one for a hanging
    node; row_node (row,) int32 the node whose own row this is, -1 for others; copies (copy,) rows, copy_start
    (copy + 1,), parents: rows they take the mean of; targets (target,) rows with copies, target_start (target + 1,),
    sources: their copies, source_weights.
    """

    batch_start: np.ndarray
    row_start: np.ndarray
    places: np.ndarray
    cell_place: np.ndarray
    row_node: np.ndarray
    node_row: np.ndarray
    copies: np.ndarray
    copy_start: np.ndarray
    parents: np.ndarray
    targets: np.ndarray
    target_start: np.ndarray
    sources: np.ndarray
    source_weights: np.ndarray

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(self.row_start[-1])

    def corner_rows(self, cells: np.ndarray) -> np.ndarray:
        """Rows of the corners of some cells, in the blocks of these cells: (k, 2^d) int32, bit order."""
        nodes = self.places.shape[1]
        rows = np.empty((len(cells), 4 if nodes == 9 else 8), np.int32)
        _corner_rows(self.places, self.cell_place, cells, rows)
        return rows


@njit(cache=True)
def _corner_rows(places, cell_place, cells, rows):
    """Rows of the corners of cells (k,): rows (k, 2^d), written."""
    corners, lanes = rows.shape[1], places.shape[2]
    dimension = 2 if corners == 4 else 3
    for i in range(len(cells)):
        slot, lane = cell_place[cells[i]] // lanes, cell_place[cells[i]] % lanes
        child = slot % corners
        for corner in range(corners):
            position = 0
            for axis in range(dimension - 1, -1, -1):
                position = 3 * position + ((child >> axis) & 1) + ((corner >> axis) & 1)
            rows[i, corner] = places[slot // corners, position, lane]


@njit(cache=True)
def _fits(nodes, cell_nodes, place):
    """True if a group has no other node at the corners of a cell at a place in it; then it has these: nodes (3^d,),
    -1 where none is known, written."""
    dimension = 2 if len(cell_nodes) == 4 else 3
    for writes in range(2):
        for corner in range(len(cell_nodes)):
            position, step = 0, 1
            for axis in range(dimension):
                position += step * ((place >> axis & 1) + (corner >> axis & 1))
                step *= 3
            if writes:
                nodes[position] = cell_nodes[corner]
            elif nodes[position] >= 0 and nodes[position] != cell_nodes[corner]:
                return False
    return True


@njit(cache=True)
def _gather_groups(cell_index, cell_width, cell_nodes):
    """(groups, group of each cell, place of each cell in it). Cells in Morton order; siblings meet in one group, but
    those that have other nodes at the same place (phantom nodes)."""
    cells, dimension = cell_index.shape
    nodes = np.empty((32, 3**dimension), np.int32)  # of the latest group by level
    group = np.empty(cells, np.int32)
    place = np.empty(cells, np.int8)
    parent = np.full((32, dimension), -1, np.int64)  # the latest by level: Morton order visits a parent's cells at once
    latest = np.empty(32, np.int32)
    count = 0
    for cell in range(cells):
        level = 0
        while (cell_width[cell] >> level) > 1:
            level += 1
        same = True
        child = 0
        for axis in range(dimension):
            home = cell_index[cell, axis] >> (level + 1)
            same &= parent[level, axis] == home
            parent[level, axis] = home
            child |= ((cell_index[cell, axis] >> level) & 1) << axis
        if not same:
            nodes[level] = -1
        if not _fits(nodes[level], cell_nodes[cell], child):
            nodes[level] = -1
            _fits(nodes[level], cell_nodes[cell], child)
            same = False
        if not same:
            latest[level] = count
            count += 1
        group[cell] = latest[level]
        place[cell] = child
    return count, group, place


@njit(cache=True)
def _group_nodes(groups, group, place, cell_nodes):
    """(group, 3^d) int32: nodes at place x + 3 y + 9 z, -1 where no cell of the group has a corner."""
    cells, corners = cell_nodes.shape
    dimension = 2 if corners == 4 else 3
    nodes = np.full((groups, 3**dimension), -1, np.int32)
    for cell in range(cells):
        for corner in range(corners):
            position = 0
            step = 1
            for axis in range(dimension):
                position += step * (((place[cell] >> axis) & 1) + ((corner >> axis) & 1))
                step *= 3
            nodes[group[cell], position] = cell_nodes[cell, corner]
    return nodes


@njit(cache=True)
def _number_rows(block_start, group_nodes, nodes, lanes):
    """Rows by first touch, block by block: (row_start, places, row_node, node_row)."""
    blocks = len(block_start) - 1
    width = group_nodes.shape[1]
    batches = 0
    for block in range(blocks):
        batches += (block_start[block + 1] - block_start[block] + lanes - 1) // lanes
    row_start = np.zeros(blocks + 1, np.int64)
    places = np.empty((batches, width, lanes), np.int32)
    row_node = np.empty(blocks + group_nodes.size, np.int32)
    node_row = np.full(nodes, -1, np.int32)
    seen_in = np.full(nodes, -1, np.int32)
    row_of = np.empty(nodes, np.int32)
    rows = 0
    batch = 0
    for block in range(blocks):
        nothing = rows
        row_node[rows] = -1
        rows += 1
        first, last = block_start[block], block_start[block + 1]
        for begin in range(first, last, lanes):
            for lane in range(lanes):
                for position in range(width):
                    node = group_nodes[begin + lane, position] if begin + lane < last else -1
                    if node < 0:
                        places[batch, position, lane] = nothing
                        continue
                    if seen_in[node] != block:
                        seen_in[node] = block
                        row_of[node] = rows
                        row_node[rows] = node
                        if node_row[node] < 0:
                            node_row[node] = rows
                        rows += 1
                    places[batch, position, lane] = row_of[node]
            batch += 1
        row_start[block + 1] = rows
    return row_start, places, row_node[:rows], node_row


@njit(parallel=True, cache=True)
def _place_cells(group, place, groups_per_block, batch_start, corners, lanes, cell_place):
    """Places of cells among (batch, 2^d, LANES): cell_place (cell,), written."""
    for cell in prange(len(group)):
        block, rank = divmod(group[cell], groups_per_block)
        batch = batch_start[block] + rank // lanes
        cell_place[cell] = (batch * corners + place[cell]) * lanes + rank % lanes


@njit(cache=True)
def _list_copies(row_node, node_row, node_parents):
    """(copies, copy_start, parents) and (targets, target_start, sources, source_weights), both in ascending order.

    row_node (row,), in place: of all rows before, of nodes' own rows afterwards.
    """
    copies, links = 0, 0
    uses = np.zeros(len(row_node) + 1, np.int32)
    for row in range(len(row_node)):
        node = row_node[row]
        if node < 0:
            continue
        if node_parents[node, 0] >= 0:
            copies += 1
            for parent in node_parents[node]:
                if parent >= 0:
                    links += 1
                    uses[node_row[parent]] += 1
        elif row != node_row[node]:
            copies += 1
            links += 1
            uses[node_row[node]] += 1
    copy = np.empty(copies, np.int32)
    copy_start = np.zeros(copies + 1, np.int32)
    parents = np.empty(links, np.int32)
    targets = np.flatnonzero(uses).astype(np.int32)
    target_start = np.zeros(len(targets) + 1, np.int32)
    next_source = uses  # in the same memory
    for target in range(len(targets)):
        target_start[target + 1] = target_start[target] + uses[targets[target]]
        next_source[targets[target]] = target_start[target]
    sources = np.empty(links, np.int32)
    weights = np.empty(links, np.float32)
    copies, links = 0, 0
    for row in range(len(row_node)):
        node = row_node[row]
        if node < 0 or (node_parents[node, 0] < 0 and row == node_row[node]):
            continue
        first = links
        if node_parents[node, 0] >= 0:
            for parent in node_parents[node]:
                if parent >= 0:
                    parents[links] = node_row[parent]
                    links += 1
        else:
            parents[links] = node_row[node]
            links += 1
        for link in range(first, links):
            target = parents[link]
            sources[next_source[target]] = row
            weights[next_source[target]] = 1.0 / (links - first)
            next_source[target] += 1
        copy[copies] = row
        copies += 1
        copy_start[copies] = links
        if row != node_row[node]:
            row_node[row] = -1
    return copy, copy_start, parents, targets, target_start, sources, weights


def build_siblings(cell_index, cell_width, cell_nodes, node_parents) -> Siblings:
    """Layout of a level whose cells are in Morton order.

    cell_index (cell, d) lower corners and cell_width (cell,) powers of two, in any common unit that divides both;
    cell_nodes (cell, 2^d) in bit order; node_parents (node, 2^(d-1)) with -1 padding.
    """
    groups, group, place = _gather_groups(cell_index, cell_width, cell_nodes)
    fewest, most = GROUPS_PER_BLOCK
    per_block = min(max(-(-groups // BLOCKS_WANTED), fewest), most)
    per_block = -(-per_block // LANES) * LANES
    block_start = np.append(np.arange(0, groups, per_block), groups)
    group_nodes = _group_nodes(groups, group, place, cell_nodes)
    row_start, places, row_node, node_row = _number_rows(block_start, group_nodes, len(node_parents), LANES)
    batches = -(-np.diff(block_start) // LANES)
    batch_start = np.append(0, np.cumsum(batches)).astype(np.int64)
    cell_place = np.empty(len(group), np.int32)
    _place_cells(group, place, per_block, batch_start, cell_nodes.shape[1], LANES, cell_place)
    return Siblings(
        batch_start,
        row_start,
        places,
        cell_place,
        row_node,
        node_row,
        *_list_copies(row_node, node_row, node_parents),
    )
