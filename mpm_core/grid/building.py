"""Build the grid of a scene, after saying how much memory it needs."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from common.errors import InputError
from common.free_memory import free_memory
from mpm_core.grid.domain import marks_memory
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.grid.nodes import number_nodes
from mpm_core.grid.octree import Classify, SplitMarks, leaves, mark_splits

WORK_BYTES_PER_CELL = 16
"""Bytes per cell while nodes are numbered: levels and widths as int32, first cells of blocks."""
WORK_BYTES_PER_NODE = 8
"""Bytes per node while nodes are numbered: the hash table of the nodes on block surfaces."""
GRID_REMEDY = "use larger cells (grid.finest_cell, or grid.coarse_cell), fewer grid.buffer_cells or a smaller domain"


class GridCount(NamedTuple):
    """Size of a grid, known from its split marks alone."""

    cells: int
    nodes: int
    """hanging ones included"""
    cells_per_level: np.ndarray
    """(levels,) int64"""


class GridMemory(NamedTuple):
    """Bytes."""

    arrays: int
    """what the finished grid holds"""
    building: int
    """most that is held at once while it is built, the finished arrays included"""


def count_cells(base_shape, levels: int, classify: Classify, buffer_cells: int) -> GridCount:
    """Exact numbers of cells and nodes that :func:`build_grid` would make from these arguments, without making them.

    Raises InputError if the machine has too little memory to count them."""
    _require_memory(marks_memory(np.asarray(base_shape, np.int64), levels), f"the split marks of {levels} levels")
    return _count(mark_splits(base_shape, levels, classify, buffer_cells))


def _count(marks: SplitMarks) -> GridCount:
    cells_per_level = marks.cells_per_level()
    return GridCount(int(cells_per_level.sum()), marks.number_of_nodes(), cells_per_level)


def estimate_memory(cells: int, nodes: int, dimension: int = 3) -> GridMemory:
    """Bytes that a grid of so many cells and nodes takes, and the most that numbering its nodes takes in addition.

    Split marks come on top (see mpm_core.grid.domain.marks_memory), but are gone when nodes are numbered.
    """
    int32 = np.dtype(np.int32).itemsize
    per_cell = int32 * (dimension + (1 << dimension)) + 1
    per_node = int32 * (dimension + (1 << (dimension - 1)))
    arrays = cells * per_cell + nodes * per_node
    return GridMemory(arrays, arrays + cells * WORK_BYTES_PER_CELL + nodes * WORK_BYTES_PER_NODE)


def build_grid(
    origin,
    coarse_cell: float,
    base_shape,
    levels: int,
    classify: Classify,
    buffer_cells: int,
    before_allocation: Callable[[GridCount], None] | None = None,
) -> MultiLevelGrid:
    """The multi-level grid of a scene.

    origin (d,) m, lower corner of the domain; coarse_cell m, edge of a base cell; the rest as in
    :func:`~mpm_core.grid.octree.mark_splits`. ``before_allocation`` receives the exact numbers of cells and nodes
    before they are made: it may announce them, or raise. Raises InputError if the machine has too little memory for
    the grid, ValueError for arguments out of range.
    """
    origin = np.asarray(origin, dtype=np.float64)
    base_shape = np.asarray(base_shape, dtype=np.int64)
    if origin.shape != base_shape.shape or not coarse_cell > 0:
        raise ValueError(f"origin {origin}, coarse_cell {coarse_cell}: d coordinates and a positive size are expected")
    _require_memory(marks_memory(base_shape, levels), f"the split marks of {levels} levels")
    marks = mark_splits(base_shape, levels, classify, buffer_cells)
    count = _count(marks)
    if before_allocation is not None:
        before_allocation(count)
    if max(count.cells, count.nodes) > np.iinfo(np.int32).max:
        raise InputError(f"grid: {count.cells:,} cells are more than 32-bit numbers can name: {GRID_REMEDY}")
    _require_memory(
        estimate_memory(count.cells, count.nodes, len(base_shape)).building,
        f"{count.cells:,} cells and {count.nodes:,} nodes",
    )
    cell_index, cell_level = leaves(marks)
    del marks
    halvings = levels - 1
    cell_width = np.int32(1) << (halvings - cell_level).astype(np.int32)
    shape = base_shape << halvings
    vtk_nodes, node_index, node_parents = number_nodes(cell_index, cell_width, shape)
    return MultiLevelGrid(
        origin=origin,
        fine_cell=coarse_cell / (1 << halvings),
        levels=levels,
        shape=shape,
        cell_index=cell_index,
        cell_level=cell_level,
        vtk_nodes=vtk_nodes,
        node_index=node_index,
        node_parents=node_parents,
    )


def _require_memory(needed: int, what: str) -> None:
    available = free_memory()
    if needed > available:
        raise InputError(
            f"grid: {what} take {needed / 1e9:.1f} GB of memory, {available / 1e9:.1f} GB are free: {GRID_REMEDY}"
        )
