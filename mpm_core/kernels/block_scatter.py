"""The threads that write forces: cells in blocks of fixed size, each with force slots of its own.

A cell adds to the nodes of its corners, so two threads may meet at a node. Here every block of cells writes into slots
that no other block touches, and each free node then adds up its slots in one fixed order. The blocks depend on the grid
alone, so the result does not depend on the number of threads, to the last bit. The constraint of hanging nodes,
F = C^T f, is part of that sum: a free node's list holds the slots of its hanging children too, with their weights.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

CELLS_PER_BLOCK = 2048  # The forces of one block fit into a core's second-level cache.


@dataclass(frozen=True)
class Scatter:
    """The sums that turn forces at cell corners into forces at free nodes.

    block_start (block + 1,) first cell of each block; slot_start (block + 1,) first slot of each block;
    cell_slots (cell, corner) slot of each corner; free_nodes (free,) nodes without parents;
    sum_start (free + 1,), sum_slots, sum_weights: the weighted slots that a free node adds up, in fixed order.
    """

    block_start: np.ndarray
    slot_start: np.ndarray
    cell_slots: np.ndarray
    free_nodes: np.ndarray
    sum_start: np.ndarray
    sum_slots: np.ndarray
    sum_weights: np.ndarray

    @property
    def slots(self) -> int:
        """Number of force slots."""
        return int(self.slot_start[-1])

    @property
    def blocks(self) -> np.ndarray:
        """All blocks."""
        return np.arange(len(self.block_start) - 1)

    def blocks_of(self, cells: np.ndarray) -> np.ndarray:
        """The block that holds each of these cells."""
        return cells // CELLS_PER_BLOCK


@njit(cache=True)
def _assign_slots(block_start, cell_nodes, nodes):
    """Slots numbered block by block in order of first touch: (cell_slots, slot_start, node of each slot)."""
    cells, corners = cell_nodes.shape
    cell_slots = np.empty((cells, corners), np.int32)
    slot_start = np.zeros(len(block_start), np.int64)
    slot_node = np.empty(cells * corners, np.int32)
    seen_in = np.full(nodes, -1, np.int32)
    slot_of = np.empty(nodes, np.int32)
    count = 0
    for block in range(len(block_start) - 1):
        for cell in range(block_start[block], block_start[block + 1]):
            for corner in range(corners):
                node = cell_nodes[cell, corner]
                if seen_in[node] != block:
                    seen_in[node] = block
                    slot_of[node] = count
                    slot_node[count] = node
                    count += 1
                cell_slots[cell, corner] = slot_of[node]
        slot_start[block + 1] = count
    return cell_slots, slot_start, slot_node[:count].copy()


@njit(cache=True)
def _list_sums(slot_node, node_parents, free_nodes):
    """(sum_start, sum_slots, sum_weights) of the free nodes, each one's slots ascending."""
    rank = np.full(len(node_parents), -1, np.int64)
    for i in range(len(free_nodes)):
        rank[free_nodes[i]] = i
    start = np.zeros(len(free_nodes) + 1, np.int64)
    for node in slot_node:
        if rank[node] >= 0:
            start[rank[node] + 1] += 1
        else:
            for parent in node_parents[node]:
                if parent >= 0:
                    start[rank[parent] + 1] += 1
    start = np.cumsum(start)
    room = start[:-1].copy()
    slots, weights = np.empty(start[-1], np.int32), np.empty(start[-1])
    for slot in range(len(slot_node)):
        node = slot_node[slot]
        if rank[node] >= 0:
            slots[room[rank[node]]], weights[room[rank[node]]] = slot, 1.0
            room[rank[node]] += 1
            continue
        count = 0
        for parent in node_parents[node]:
            count += parent >= 0
        for parent in node_parents[node]:
            if parent >= 0:
                slots[room[rank[parent]]], weights[room[rank[parent]]] = slot, 1.0 / count
                room[rank[parent]] += 1
    return start, slots, weights


def build_scatter(cell_nodes: np.ndarray, node_parents: np.ndarray) -> Scatter:
    """Blocks and sums for a grid: cell_nodes (cell, corner), node_parents (node, parent) with -1 padding."""
    cells, nodes = len(cell_nodes), len(node_parents)
    block_start = np.append(np.arange(0, cells, CELLS_PER_BLOCK), cells).astype(np.int64)
    cell_slots, slot_start, slot_node = _assign_slots(block_start, cell_nodes, nodes)

    free_nodes = np.flatnonzero(node_parents[:, 0] < 0).astype(np.int32)
    return Scatter(
        block_start, slot_start, cell_slots, free_nodes, *_list_sums(slot_node, node_parents, free_nodes)
    )  # fmt: skip
