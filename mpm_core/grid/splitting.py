"""Cells of a grid split to the finest size at given places, with the rings and the 2:1 balance that they need.

What a place needs depends on the place alone, and the grid that follows is the union of what all places need and
of what was split before: splits in any order, at once or one by one, make the same grid.
"""

import numpy as np

from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.grid.nodes import number_nodes
from mpm_core.grid.octree import all_cells, children, morton_codes


def families(grid: MultiLevelGrid, cells: np.ndarray) -> np.ndarray:
    """Places of these cells, (k, d) cells of the last level but one, in units of their own: finest cells' parents."""
    return grid.cell_index[cells] >> 1


def middles(grid: MultiLevelGrid, cells: np.ndarray) -> np.ndarray:
    """Places in the middle of these coarse cells, each once: those that meet in the centre, so that no side is ahead;
    a cell of the last level but one is its own."""
    width = grid.cell_width[cells]
    large = cells[width > 2]
    centre = (grid.cell_index[large] + (width[width > 2] >> 1)[:, None]) >> 1
    around_centre = (centre[:, None, :] + all_cells((2,) * grid.dimension) - 1).reshape(-1, grid.dimension)
    return np.unique(np.concatenate([families(grid, cells[width == 2]), around_centre]), axis=0)


def family_codes(grid: MultiLevelGrid) -> np.ndarray:
    """Codes (k,) int64, ascending, of all cells of the last level but one that are split: see `code_of`."""
    finest = np.flatnonzero(grid.cell_level == grid.levels - 1)
    first = finest[:: 1 << grid.dimension]  # of each family of siblings, which stand together
    return np.sort(code_of(grid.cell_index[first] >> 1, grid.shape >> 1)) if grid.levels > 1 else np.empty(0, np.int64)


def code_of(index: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """One number (k,) int64 for each cell (k, d) of a regular grid with so many cells along each axis."""
    return np.ravel_multi_index(tuple(index.T), tuple(shape)).astype(np.int64)


def around(index: np.ndarray, rings: int, shape: np.ndarray) -> np.ndarray:
    """Cells (n, d) within so many rings, corners too, around cells (k, d) of a regular grid; each once, by code."""
    for axis in range(len(shape)):
        shifts = np.zeros((2 * rings + 1, len(shape)), index.dtype)
        shifts[:, axis] = np.arange(-rings, rings + 1)
        index = (index[:, None, :] + shifts).reshape(-1, len(shape))
        index = index[(index[:, axis] >= 0) & (index[:, axis] < shape[axis])]
        index = _once(index, shape)
    return index


def _once(index: np.ndarray, shape: np.ndarray) -> np.ndarray:
    code = np.unique(code_of(index, shape))
    return np.stack(np.unravel_index(code, tuple(shape)), axis=1)


def split(grid: MultiLevelGrid, places: np.ndarray, rings: int, grading: int) -> MultiLevelGrid:
    """The grid with finest cells at places (k, d), cells of the last level but one, and in rings of these around them.

    grading: rings of each coarser level that split around what is split on it; one is the least that is balanced.
    Returns the grid itself where nothing is to be split.
    """
    finest = grid.levels - 1
    requested = {}
    index = places
    for level in range(finest - 1, -1, -1):
        shape = grid.shape >> finest - level
        index = around(index, rings if level == finest - 1 else max(grading, 1), shape)
        requested[level] = code_of(index, shape)
        index = _once(index >> 1, shape >> 1) if level else index
    fresh = {level: _not_split(grid, level, codes) for level, codes in requested.items()}
    if not any(len(codes) for codes in fresh.values()):
        return grid
    keep = np.ones(len(grid.cell_level), bool)
    added, of_level = [], []
    for level, codes in fresh.items():
        own = np.flatnonzero(grid.cell_level == level)
        shape = grid.shape >> finest - level
        keep[own[np.isin(code_of(grid.cell_index[own] >> finest - level, shape), codes, kind="sort")]] = False
        born = children(np.stack(np.unravel_index(codes, tuple(shape)), axis=1))
        if level + 1 < finest:
            born = born[~np.isin(code_of(born, 2 * shape), fresh[level + 1], kind="sort")]
        added.append(born << finest - level - 1)
        of_level.append(np.full(len(born), level + 1, np.int8))
    cell_index = np.concatenate([grid.cell_index[keep], *added]).astype(np.int32)
    cell_level = np.concatenate([grid.cell_level[keep], *of_level])
    return with_leaves(grid, cell_index, cell_level)


def with_leaves(grid: MultiLevelGrid, cell_index: np.ndarray, cell_level: np.ndarray) -> MultiLevelGrid:
    """The grid of the same domain with these leaves in any order: lower corners (cell, d), fine units, and levels."""
    code = np.empty(len(cell_index), np.int64)
    morton_codes(cell_index, code)
    order = np.argsort(code, kind="stable")
    cell_index, cell_level = cell_index[order], cell_level[order]
    width = np.int32(1) << (grid.levels - 1 - cell_level).astype(np.int32)
    vtk_nodes, node_index, node_parents = number_nodes(cell_index, width, grid.shape)
    return MultiLevelGrid(
        origin=grid.origin, fine_cell=grid.fine_cell, levels=grid.levels, shape=grid.shape, cell_index=cell_index,
        cell_level=cell_level, vtk_nodes=vtk_nodes, node_index=node_index, node_parents=node_parents,
    )  # fmt: skip


def _not_split(grid: MultiLevelGrid, level: int, codes: np.ndarray) -> np.ndarray:
    """Codes, among these of cells of a level, that are not split in the grid, all of them in no finer cell."""
    halvings = grid.levels - 1 - level
    if not grid.present.all():  # cells of a subdomain's surroundings are not its own
        place = np.stack(np.unravel_index(codes, tuple(grid.shape >> halvings)))
        codes = codes[grid.present[tuple(place >> level)]]
    deeper = np.flatnonzero(grid.cell_level > level)
    first = deeper[(grid.cell_index[deeper] & ((1 << halvings) - 1) == 0).all(axis=1)]  # at the cell's lower corner
    split_codes = code_of(grid.cell_index[first] >> halvings, grid.shape >> halvings)
    return codes[~np.isin(codes, split_codes, kind="sort")]
