"""The cells that split, and the leaves that remain (paper, section 2.1), in 2-D and 3-D.

Cells of level 0 are the base grid, each level halves them, the finest level is ``levels - 1``. Every level but the
finest has one dense array of flags, "this cell splits"; rings and balance are dilations of such arrays. Balance is 2:1
over faces, edges and corners (the paper's face balance makes chains of hanging nodes): a cell may split only if all
its neighbours exist at its own level or finer, hence their parents split too.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit, prange

Classify = Callable[[int, np.ndarray], np.ndarray]
"""``classify(level, index (n, d) int32) -> (n,) bool``: is the cell crossed by or inside an excavation; index in units
of that level's own cells."""


@dataclass(frozen=True)
class SplitMarks:
    """The splits of a balanced tree: enough to count its cells and nodes before they are allocated."""

    base_shape: np.ndarray
    """(d,) int64, base cells per axis"""
    levels: int
    """number of levels, 1 for a regular grid"""
    flags: np.ndarray
    """(sum of the cells of all levels but the finest,) bool: the cell splits; level after level, C order"""

    @classmethod
    def none(cls, base_shape, levels: int) -> "SplitMarks":
        """The unsplit base grid. Raises ValueError if a side has no cell or there is no level."""
        base_shape = np.asarray(base_shape, dtype=np.int64)
        if base_shape.shape not in ((2,), (3,)) or (base_shape < 1).any():
            raise ValueError(f"base_shape: {base_shape.tolist()}: two or three positive numbers of cells are expected")
        if levels < 1:
            raise ValueError(f"levels: {levels}: at least 1 is expected")
        return cls(base_shape, levels, np.zeros(_level_starts(base_shape, levels)[-1], dtype=np.bool_))

    def of_level(self, level: int) -> np.ndarray:
        """The flags of one level in the shape of its cells (a view)."""
        starts = _level_starts(self.base_shape, self.levels)
        return self.flags[starts[level] : starts[level + 1]].reshape(self.base_shape << level)

    def cells_per_level(self) -> np.ndarray:
        """(levels,) int64: number of leaves of each level."""
        splits = np.array([np.count_nonzero(self.of_level(level)) for level in range(self.levels - 1)] + [0])
        born = np.append(np.prod(self.base_shape), splits[:-1] << len(self.base_shape))
        return born - splits

    def number_of_nodes(self) -> int:
        """Number of distinct corners of the leaves, hanging ones included.

        A split adds a node at the cell's centre and at the middle of each face and edge that no neighbour split
        before. The middles of a set of axes are the cells dilated by half a cell along the other axes.
        """
        dimension = len(self.base_shape)
        count = int(np.prod(self.base_shape + 1))
        for level in range(self.levels - 1):
            splits = self.of_level(level)
            for axes in range(1 << dimension):
                if axes == (1 << dimension) - 1:
                    continue  # across every axis: a corner of the cell, not new
                middles = splits
                for axis in range(dimension):
                    if axes >> axis & 1:
                        middles = _either_side(middles, axis)
                count += int(np.count_nonzero(middles))
        return count


def refine(base_shape, levels: int, classify: Classify, buffer_cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Leaves of the balanced tree, in Morton order of their lower corner (x fastest): sibling leaves are contiguous.

    Arguments as in :func:`mark_splits`. Returns cell_index (cell, d) int32, the lower corner in units of the finest
    cell (a base cell is 2^(levels - 1) units wide), and cell_level (cell,) int8, 0 for base cells.
    """
    return leaves(mark_splits(base_shape, levels, classify, buffer_cells))


def mark_splits(base_shape, levels: int, classify: Classify, buffer_cells: int) -> SplitMarks:
    """The cells that split, so that excavations lie in finest cells and neighbours differ by one level at most.

    base_shape (d,) base cells per axis; levels >= 1; classify is called once per level, for all base cells and then
    for the children of cells it marked; buffer_cells rings of a level's cells split around those marked on it. Raises
    ValueError for arguments out of range.
    """
    if buffer_cells < 0:
        raise ValueError(f"buffer_cells: {buffer_cells}: zero or more rings are expected")
    marks = SplitMarks.none(base_shape, levels)
    index = all_cells(marks.base_shape)
    for level in range(levels - 1):
        if len(index) == 0:
            break
        inside = np.asarray(classify(level, index))
        if inside.shape != (len(index),) or inside.dtype != np.bool_:
            raise ValueError(f"classify: level {level}: {len(index)} booleans are expected")
        index = index[inside]
        splits = marks.of_level(level)
        splits[tuple(index.T)] = True
        _dilate(splits, buffer_cells)
        index = children(index)
    for level in range(levels - 2, 0, -1):
        around = marks.of_level(level).copy()
        _dilate(around, 1)
        np.logical_or(marks.of_level(level - 1), parents(around), out=marks.of_level(level - 1))
    return marks


def leaves(marks: SplitMarks) -> tuple[np.ndarray, np.ndarray]:
    """The leaves that the splits make, in Morton order: cell_index (cell, d) int32, cell_level (cell,) int8."""
    base_cells = _morton_ordered(marks.base_shape)
    starts = _level_starts(marks.base_shape, marks.levels)
    first_cell = np.zeros(len(base_cells) + 1, dtype=np.int64)
    tree = (base_cells, marks.flags, starts, marks.base_shape, marks.levels)
    _count_leaves(*tree, first_cell[1:])
    np.cumsum(first_cell, out=first_cell)
    cell_index = np.empty((first_cell[-1], len(marks.base_shape)), dtype=np.int32)
    cell_level = np.empty(first_cell[-1], dtype=np.int8)
    _write_leaves(*tree, first_cell, cell_index, cell_level)
    return cell_index, cell_level


def _level_starts(base_shape: np.ndarray, levels: int) -> np.ndarray:
    """(levels,) int64: where each level's flags begin in the flat array; the last entry is its length."""
    cells = [int(np.prod(base_shape << level)) for level in range(levels - 1)]
    return np.cumsum([0, *cells], dtype=np.int64)


def all_cells(shape) -> np.ndarray:
    """Every cell of a regular grid, (n, d) int32, C order and C contiguous."""
    index = np.moveaxis(np.indices(shape, dtype=np.int32), 0, -1).reshape(-1, len(shape))
    return np.ascontiguousarray(index)


def children(index: np.ndarray) -> np.ndarray:
    """Children (n 2^d, d) of cells (n, d), each in units of its own level, siblings in a row."""
    dimension = index.shape[1]
    return (2 * index[:, None, :] + all_cells((2,) * dimension)).reshape(-1, dimension)


def _along(axis: int, part: slice) -> tuple[slice, ...]:
    return (slice(None),) * axis + (part,)


def _dilate(flags: np.ndarray, rings: int) -> None:
    """Mark, in place, the cells within so many rings over faces, edges and corners: one axis after the other."""
    for axis in range(flags.ndim if rings else 0):
        before = flags.copy()
        for shift in range(1, min(rings, flags.shape[axis] - 1) + 1):
            lower, upper = _along(axis, slice(None, -shift)), _along(axis, slice(shift, None))
            np.logical_or(flags[upper], before[lower], out=flags[upper])
            np.logical_or(flags[lower], before[upper], out=flags[lower])


def parents(flags: np.ndarray) -> np.ndarray:
    """Flags one level coarser: any child is marked."""
    for axis in range(flags.ndim):
        flags = flags[_along(axis, slice(0, None, 2))] | flags[_along(axis, slice(1, None, 2))]
    return flags


def _either_side(flags: np.ndarray, axis: int) -> np.ndarray:
    """Flags of the planes between cells along one axis, outer ones included: a cell on either side is marked."""
    shape = list(flags.shape)
    shape[axis] += 1
    planes = np.zeros(shape, dtype=np.bool_)
    planes[_along(axis, slice(None, -1))] = flags
    upper = planes[_along(axis, slice(1, None))]
    np.logical_or(upper, flags, out=upper)
    return planes


def _morton_ordered(base_shape: np.ndarray) -> np.ndarray:
    """Base cells (n, d) int32 in Morton order, x the fastest axis."""
    index = all_cells(base_shape)
    code = np.empty(len(index), dtype=np.int64)
    morton_codes(index, code)
    return index[np.argsort(code, kind="stable")]


@njit(cache=True)
def morton_code(index):
    """Interleaved bits of one cell's index (d,) >= 0: bit k of axis a is bit k d + a."""
    dimension = len(index)
    code = np.int64(0)
    for axis in range(dimension):
        rest = np.int64(index[axis])
        place = axis
        while rest:
            code |= (rest & 1) << place
            rest >>= 1
            place += dimension
    return code


@njit(parallel=True, cache=True)
def morton_codes(index, code):
    """Morton codes of cells: index (n, d) int32; code (n,) int64, written."""
    for cell in prange(len(index)):
        code[cell] = morton_code(index[cell])


@njit(cache=True)
def _visit_leaves(base_cell, flags, starts, base_shape, levels, first, cell_index, cell_level):
    """Number of leaves in one base cell; they are written from ``first`` on unless the arrays are empty.

    The Morton code of finest cells runs through the base cell; from the code the tree is descended to the leaf that
    begins there, and the leaf's volume is the step to the next code.
    """
    dimension = len(base_cell)
    finest = levels - 1
    corner = np.empty(dimension, np.int64)
    found = 0
    code = 0
    while code < 1 << (dimension * finest):
        for axis in range(dimension):
            offset = 0
            for bit in range(finest):
                offset |= (code >> (bit * dimension + axis) & 1) << bit
            corner[axis] = (np.int64(base_cell[axis]) << finest) + offset
        level = 0
        while level < finest:
            position = 0
            for axis in range(dimension):
                position = position * (base_shape[axis] << level) + (corner[axis] >> (finest - level))
            if not flags[starts[level] + position]:
                break
            level += 1
        if len(cell_level):
            for axis in range(dimension):
                cell_index[first + found, axis] = corner[axis]
            cell_level[first + found] = level
        found += 1
        code += 1 << (dimension * (finest - level))
    return found


@njit(parallel=True, cache=True)
def _count_leaves(base_cells, flags, starts, base_shape, levels, count):
    """Leaves in each base cell: base_cells (n, d) int32; flags, starts as in SplitMarks; count (n,) int64, written."""
    for base in prange(len(base_cells)):
        nowhere = np.empty((0, base_cells.shape[1]), np.int32), np.empty(0, np.int8)  # size, not 0: that compiles anew
        count[base] = _visit_leaves(base_cells[base], flags, starts, base_shape, levels, nowhere[1].size, *nowhere)


@njit(parallel=True, cache=True)
def _write_leaves(base_cells, flags, starts, base_shape, levels, first_cell, cell_index, cell_level):
    """Leaves of all base cells, written to cell_index (cell, d) and cell_level (cell,); first_cell (base,) of each."""
    for base in prange(len(base_cells)):
        _visit_leaves(base_cells[base], flags, starts, base_shape, levels, first_cell[base], cell_index, cell_level)
