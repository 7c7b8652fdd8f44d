"""Number the corners of the leaves and find the hanging ones with their parents (paper, section 2.2.1).

Cells come in Morton order, so an aligned block of space is one run of cells. Within a block a small dense table knows
every node; a hash table is searched only for nodes on a block's surface, which neighbouring blocks share. That keeps
nearly all look-ups in the processor's cache.
"""

import math

import numpy as np
from numba import get_num_threads, njit, prange

from mpm_core.grid.mesh import CORNER_OFFSETS, EDGE_CORNERS, FACE_CORNERS
from mpm_core.grid.octree import morton_code

BLOCK_WIDTH = {2: 512, 3: 64}
"""Width of a block in fine units by dimension, unless a cell is wider. The block's table fits into the cache."""
INITIAL_SLOTS = 1 << 16
"""Initial slots of the hash table, a power of two. Their number doubles when half are full."""
NO_ENTRY = -1
"""Value of an empty slot of the hash table, and of a missing parent."""
GOLDEN_MULTIPLIER = np.int64(-7046029254386353131)
"""2^64 / golden ratio, as a signed number: multiplying by it spreads neighbouring keys (Knuth 6.4)"""


def number_nodes(cell_index, cell_size, shape):
    """Nodes of a balanced grid, by first touch in cell order.

    cell_index (cell, d) int32 lower corners and cell_size (cell,) edges, fine units, powers of two, in Morton order;
    shape (d,) of the domain, fine units. Returns cell_nodes (cell, 2^d) int32 in VTK order, node_index (node, d) int32
    in fine units, and node_parents (node, 2^(d-1)) int32 padded with -1: two parents of weight 1/2 where the node lies
    in the middle of an edge of a coarser cell, four of weight 1/4 in the middle of a face. Raises ValueError if cells
    are not in Morton order or the domain has more than 2^63 places for nodes.
    """
    dimension = cell_index.shape[1]
    places = np.asarray(shape, dtype=np.int64) + 1
    if math.prod(places.tolist()) >= 2**63:
        raise ValueError(f"shape: {np.asarray(shape).tolist()}: too many fine cells to number their corners")
    cell_size = np.ascontiguousarray(cell_size, dtype=np.int32)
    block = max(BLOCK_WIDTH[dimension], int(cell_size.max()))
    cell_nodes = np.empty((len(cell_index), 1 << dimension), dtype=np.int32)
    stride = (block + 1) ** np.arange(dimension)
    corners = CORNER_OFFSETS[dimension]
    nodes, block_start, keys, ids = _number(
        cell_index, cell_size, places, block, stride, corners, corners @ stride, INITIAL_SLOTS, cell_nodes
    )
    if nodes < 0:
        raise ValueError("cell_index: the cells are not in Morton order")
    node_index = np.empty((nodes, dimension), dtype=np.int32)
    _place(cell_index, cell_size, corners, cell_nodes, node_index)
    node_parents = np.full((nodes, 1 << (dimension - 1)), NO_ENTRY, dtype=np.int32)
    sides = _edges_and_faces(dimension)
    middle = _middles(sides, corners)
    _find_parents(
        cell_index, cell_size, places, block, block_start, stride, corners @ stride, sides, middle, middle @ stride,
        cell_nodes, keys, ids, node_parents, get_num_threads(),
    )  # fmt: skip
    return cell_nodes, node_index, node_parents


def _edges_and_faces(dimension: int) -> np.ndarray:
    """(edge or face, 2^(d-1)): the corners of all edges, then of all faces, padded with -1."""
    edges, faces = EDGE_CORNERS[dimension], FACE_CORNERS[dimension]
    corners = np.full((len(edges) + len(faces), 1 << (dimension - 1)), NO_ENTRY)
    corners[: len(edges), :2] = edges
    corners[len(edges) :] = faces
    return corners


@njit(cache=True)
def _slot(keys, key):
    """Place of a key in the hash table, or the empty slot where it belongs (open addressing, linear probing)."""
    mask = len(keys) - 1
    slot = ((key * GOLDEN_MULTIPLIER) >> 24) & mask
    while keys[slot] != NO_ENTRY and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@njit(cache=True)
def _doubled(keys, ids):
    """The hash table with twice the room."""
    new_keys = np.full(2 * len(keys), NO_ENTRY, np.int64)
    new_ids = np.empty(2 * len(keys), np.int32)
    for old in range(len(keys)):
        if keys[old] != NO_ENTRY:
            slot = _slot(new_keys, keys[old])
            new_keys[slot] = keys[old]
            new_ids[slot] = ids[old]
    return new_keys, new_ids


@njit(cache=True)
def _number(cell_index, cell_size, places, block, stride, corners, corner_slot, slots, cell_nodes):
    """Number the corners of all cells by first touch; cell_nodes (cell, 2^d) int32 is written.

    stride (d,): of a block's table; corner_slot (2^d,): where the corners (2^d, d) of a cell of width 1 are in it.

    Returns the number of nodes (-1: not in Morton order), the first cell of each block and the hash table of the nodes
    on block surfaces: keys (slot,) int64, ids (slot,) int32.
    """
    cells, dimension = cell_index.shape
    table = np.empty((block + 1) ** dimension, np.int32)
    written = np.full((block + 1) ** dimension, -1, np.int32)  # the block that wrote this entry of the table
    block_start = np.empty(cells + 1, np.int32)
    blocks = 0
    keys = np.full(slots, NO_ENTRY, np.int64)
    ids = np.empty(slots, np.int32)
    shared = 0
    here = np.full(dimension, -1, np.int64)
    last_code = -1
    local = np.empty(dimension, np.int64)
    nodes = 0
    for cell in range(cells):
        moved = False
        for axis in range(dimension):
            home = cell_index[cell, axis] // block
            moved |= home != here[axis]
            here[axis] = home
        if moved:
            code = morton_code(here)
            if code <= last_code:
                return -1, block_start[:0], keys, ids
            last_code = code
            block_start[blocks] = cell
            blocks += 1
        width = cell_size[cell]
        lower_slot = 0
        for axis in range(dimension):
            local[axis] = cell_index[cell, axis] - here[axis] * block
            lower_slot += local[axis] * stride[axis]
        for corner in range(len(corners)):
            entry = lower_slot + width * corner_slot[corner]
            if written[entry] != blocks:
                written[entry] = blocks
                on_surface = False
                key = np.int64(0)
                for axis in range(dimension):
                    inner = local[axis] + width * corners[corner, axis]
                    on_surface |= inner == 0 or inner == block
                    key = key * places[axis] + here[axis] * block + inner
                node = nodes
                if on_surface:
                    if 2 * shared >= len(keys):
                        keys, ids = _doubled(keys, ids)
                    slot = _slot(keys, key)
                    if keys[slot] == NO_ENTRY:
                        keys[slot] = key
                        ids[slot] = nodes
                        shared += 1
                    node = np.int64(ids[slot])
                table[entry] = node
                if node == nodes:
                    nodes += 1
            cell_nodes[cell, corner] = table[entry]
    block_start[blocks] = cells
    return nodes, block_start[: blocks + 1].copy(), keys, ids


@njit(cache=True)
def _place(cell_index, cell_size, corners, cell_nodes, node_index):
    """Note the places of nodes: node_index (node, d) int32 is written when a node is first met."""
    met = 0
    for cell in range(len(cell_index)):
        for corner in range(len(corners)):
            if cell_nodes[cell, corner] == met:
                for axis in range(cell_index.shape[1]):
                    node_index[met, axis] = cell_index[cell, axis] + cell_size[cell] * corners[corner, axis]
                met += 1


@njit(parallel=True, cache=True)
def _find_parents(
    cell_index, cell_size, places, block, block_start, stride, corner_slot, sides, middle, middle_slot, cell_nodes,
    keys, ids, node_parents, threads,
):  # fmt: skip
    """Parents of the nodes in the middle of an edge or a face of a cell; node_parents (node, 2^(d-1)) is written.

    sides (edge or face, 2^(d-1)): their corners, -1 padded; middle: see _middles; stride, corner_slot: see _number;
    middle_slot (edge or face,): of middle, like corner_slot. Each thread has runs of whole blocks. An edge on the
    surface of a block may be seen from several threads; they write the same numbers, because edges that coincide have
    the same ends.
    """
    dimension = cell_index.shape[1]
    blocks = len(block_start) - 1
    runs = min(8 * threads, blocks)
    for run in prange(runs):
        table = np.empty((block + 1) ** dimension, np.int32)
        written = np.full((block + 1) ** dimension, -1, np.int32)  # the block that wrote this entry of the table
        lower = np.empty(dimension, np.int64)
        for this in range(run * blocks // runs, (run + 1) * blocks // runs):
            first = block_start[this]
            for axis in range(dimension):
                lower[axis] = cell_index[first, axis] // block * block
            for cell in range(first, block_start[this + 1]):
                entry = _entry(cell_index, cell, lower, stride)
                for corner in range(len(corner_slot)):
                    written[entry + cell_size[cell] * corner_slot[corner]] = this
                    table[entry + cell_size[cell] * corner_slot[corner]] = cell_nodes[cell, corner]
            for cell in range(first, block_start[this + 1]):
                half = cell_size[cell] // 2
                if half == 0:
                    continue
                lower_entry = _entry(cell_index, cell, lower, stride)
                for side in range(len(sides)):
                    entry = lower_entry + half * middle_slot[side]
                    if written[entry] == this:
                        node = np.int64(table[entry])
                    else:
                        node = _node_on_surface(cell_index, cell, half, middle, side, lower, block, places, keys, ids)
                    if node != NO_ENTRY:
                        for end in range(sides.shape[1]):
                            if sides[side, end] >= 0:
                                node_parents[node, end] = cell_nodes[cell, sides[side, end]]


def _middles(sides, corners):
    """(side, d): middle of each edge or face, in halves of the cell from its lower corner."""
    middle = np.zeros((len(sides), corners.shape[1]), np.int64)
    for side in range(len(sides)):
        ends = 0
        for end in range(sides.shape[1]):
            if sides[side, end] >= 0:
                middle[side] += 2 * corners[sides[side, end]]
                ends += 1
        middle[side] //= ends
    return middle


@njit(cache=True)
def _entry(cell_index, cell, lower, stride):
    """Place of a cell's lower corner in its block's table."""
    entry = 0
    for axis in range(len(lower)):
        entry += (cell_index[cell, axis] - lower[axis]) * stride[axis]
    return entry


@njit(cache=True)
def _node_on_surface(cell_index, cell, half, middle, side, lower, block, places, keys, ids):
    """The node in the middle of a cell's edge or face if that lies on the block's surface and a cell outside has it."""
    key = np.int64(0)
    on_surface = False
    for axis in range(len(lower)):
        place = cell_index[cell, axis] + half * middle[side, axis]
        on_surface |= place == lower[axis] or place == lower[axis] + block
        key = key * places[axis] + place
    if on_surface:
        slot = _slot(keys, key)
        if keys[slot] == key:
            return np.int64(ids[slot])
    return np.int64(NO_ENTRY)
