"""Cells that share a face, also across levels."""

import numpy as np
from numba import njit, prange

from mpm_core.grid.mesh import MultiLevelGrid

NO_CELL = -1


def face_neighbors(grid: MultiLevelGrid, of: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Cells that share a face (2-D: an edge) with each cell, or with those `of` (k,), indices; as compressed rows.

    Returns indptr (cell + 1,) int64 and indices (pair,) int32: the neighbours of cell i are
    ``indices[indptr[i]:indptr[i + 1]]``, ascending; a pair is in both rows, but those of cells not in `of` are empty.
    Needs the 2:1 balance and the Morton order of the grid.
    """
    width = grid.cell_width
    across, tree = cells_across(grid, of), leaf_lookup(grid)
    indptr = np.zeros(len(width) + 1, dtype=np.int64)
    _count_neighbors(width, across, indptr[1:])
    np.cumsum(indptr, out=indptr)
    indices = np.empty(indptr[-1], dtype=np.int32)
    _write_neighbors(grid.cell_index, width, across, *tree, indptr, indices)
    return indptr, indices


def cells_across(grid: MultiLevelGrid, of: np.ndarray | None = None) -> np.ndarray:
    """The cell across each face (2-D: edge) of each cell, or of those `of` (k,), indices: (cell, 2 d) int32.

    Faces come axis by axis, the lower one first. Across a face with finer cells it is that at the face's lowest corner;
    NO_CELL outside of the grid, and for other cells.
    """
    chosen = np.full(len(grid.cell_width), of is None)
    chosen[[] if of is None else of] = True
    across = np.empty((len(chosen), 2 * grid.dimension), dtype=np.int32)
    _cells_across(chosen, grid.cell_index, grid.cell_width, *leaf_lookup(grid), across)
    return across


def holding_cells(grid: MultiLevelGrid, places: np.ndarray) -> np.ndarray:
    """The cell (k,) int32 that holds each place (k, d) int32, fine units; NO_CELL where the grid has none."""
    found = np.empty(len(places), dtype=np.int32)
    _find_cells(places, *leaf_lookup(grid), found)
    return found


def leaf_lookup(grid: MultiLevelGrid) -> tuple[np.ndarray, int, np.ndarray, np.ndarray, np.ndarray]:
    """The arguments by which `cell_at` finds the leaf at a place: (code, halvings, base_shape, first, count).

    code (cell,) int64 Morton code within the base cell; base_shape (d,) base cells; first, count (base,) int32 the run
    of leaves in each base cell, C order.
    """
    halvings = grid.levels - 1
    code = np.empty(len(grid.cell_level), dtype=np.int64)
    _codes_in_base_cell(grid.cell_index, halvings, code)
    base_shape = np.asarray(grid.shape, dtype=np.int64) >> halvings
    first = np.zeros(int(np.prod(base_shape)), dtype=np.int32)
    count = np.zeros(len(first), dtype=np.int32)
    _cells_of_base_cells(grid.cell_index, halvings, base_shape, first, count)
    return code, halvings, base_shape, first, count


@njit(cache=True)
def _code_in_base_cell(place, halvings):
    """Morton code of a place (d,), fine units, counted from its base cell's lower corner."""
    dimension = len(place)
    code = np.int64(0)
    for bit in range(halvings):
        for axis in range(dimension):
            code |= (np.int64(place[axis]) >> bit & 1) << (bit * dimension + axis)
    return code


@njit(parallel=True, cache=True)
def _codes_in_base_cell(cell_index, halvings, code):
    """Morton codes of the cells' lower corners within their base cells: code (cell,) int64, written."""
    for cell in prange(len(cell_index)):
        code[cell] = _code_in_base_cell(cell_index[cell], halvings)


@njit(cache=True)
def _cells_of_base_cells(cell_index, halvings, base_shape, first, count):
    """The run of leaves in each base cell (C order): first (base,) and count (base,) int32, written."""
    for cell in range(len(cell_index)):
        base = np.int64(0)
        for axis in range(len(base_shape)):
            base = base * base_shape[axis] + (cell_index[cell, axis] >> halvings)
        if count[base] == 0:
            first[base] = cell
        count[base] += 1


@njit(cache=True)
def cell_at(place, code, halvings, base_shape, first, count):
    """The leaf that holds a place (d,), fine units; NO_CELL where the grid has none. By bisection in its base cell."""
    base = np.int64(0)
    for axis in range(len(base_shape)):
        coarse = place[axis] >> halvings
        if coarse < 0 or coarse >= base_shape[axis]:
            return NO_CELL
        base = base * base_shape[axis] + coarse
    if count[base] == 0:
        return NO_CELL
    wanted = _code_in_base_cell(place, halvings)
    lower = np.int64(first[base])
    upper = lower + count[base]
    while upper - lower > 1:
        middle = (lower + upper) // 2
        if code[middle] <= wanted:
            lower = middle
        else:
            upper = middle
    return lower


@njit(parallel=True, cache=True)
def _find_cells(places, code, halvings, base_shape, first, count, found):
    """The leaf that holds each place: found (k,) int32, written."""
    for i in prange(len(places)):
        found[i] = cell_at(places[i], code, halvings, base_shape, first, count)


@njit(parallel=True, cache=True)
def _cells_across(chosen, cell_index, width, code, halvings, base_shape, first, count, across):
    """The leaf across each face of the chosen cells, next to the face's lowest corner: across (cell, 2 d) int32,
    written; NO_CELL outside, and for other cells."""
    for cell in prange(len(cell_index)):
        if not chosen[cell]:
            across[cell] = NO_CELL
            continue
        place = cell_index[cell].copy()
        for axis in range(len(base_shape)):
            place[axis] = cell_index[cell, axis] - 1
            across[cell, 2 * axis] = cell_at(place, code, halvings, base_shape, first, count)
            place[axis] = cell_index[cell, axis] + width[cell]
            across[cell, 2 * axis + 1] = cell_at(place, code, halvings, base_shape, first, count)
            place[axis] = cell_index[cell, axis]


@njit(parallel=True, cache=True)
def _count_neighbors(width, across, count):
    """Neighbours of each cell, 2^(d-1) across a face with finer cells: count (cell,) int64, written."""
    sides = across.shape[1]
    for cell in prange(len(width)):
        neighbors = 0
        for side in range(sides):
            other = across[cell, side]
            if other != NO_CELL:
                neighbors += 1 if width[other] >= width[cell] else 1 << (sides // 2 - 1)
        count[cell] = neighbors


@njit(parallel=True, cache=True)
def _write_neighbors(cell_index, width, across, code, halvings, base_shape, first, count, indptr, indices):
    """Neighbours of each cell in ascending order: indices (pair,) int32, written.

    Finer cells across a face are looked up from the first of them, at the face's lowest corner, by steps of their own
    width along the face. Those further from the face may be finer still, so siblings are no help here.
    """
    dimension = cell_index.shape[1]
    for cell in prange(len(cell_index)):
        end = indptr[cell]
        for side in range(2 * dimension):
            other = across[cell, side]
            if other == NO_CELL:
                continue
            indices[end] = other
            end += 1
            if width[other] >= width[cell]:
                continue
            for step in range(1, 1 << dimension):
                if step >> (side // 2) & 1 == 0:
                    place = cell_index[other].copy()
                    for axis in range(dimension):
                        place[axis] += width[other] * (step >> axis & 1)
                    indices[end] = cell_at(place, code, halvings, base_shape, first, count)
                    end += 1
        for last in range(indptr[cell] + 1, end):  # a few: sorted by insertion
            moving, place_of = indices[last], last
            while place_of > indptr[cell] and indices[place_of - 1] > moving:
                indices[place_of] = indices[place_of - 1]
                place_of -= 1
            indices[place_of] = moving
