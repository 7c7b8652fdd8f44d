"""The coarser grids under a multi-level grid: its finest leaves merged, level by level, then the base grid halved.

Every grid counts in its own finest cells. An odd number of base cells is rounded up: the last cells reach past the
domain.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mpm_core.grid.mesh import BIT_ORDER, MultiLevelGrid
from mpm_core.grid.nodes import number_nodes


@dataclass(frozen=True)
class LevelGrid:
    """One grid of the hierarchy. Cells in Morton order; units: its finest cells.

    cell_index (cell, d) int32, cell_width (cell,) int32; cell_nodes (cell, 2^d) int32 in bit order; node_index
    (node, d) int32; node_parents (node, 2^(d-1)) int32, -1 padded; extent (d,) float64: where the domain ends, a
    fraction where the last cell reaches past it.
    """

    cell_index: np.ndarray
    cell_width: np.ndarray
    cell_nodes: np.ndarray
    node_index: np.ndarray
    node_parents: np.ndarray
    extent: np.ndarray

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.cell_index.shape[1]

    @property
    def inside_volume(self) -> np.ndarray:
        """(cell,) volume of each cell that lies in the domain."""
        upper = np.minimum(self.cell_index + self.cell_width[:, None], self.extent)
        return np.prod(upper - self.cell_index, axis=1)

    def inside_share(self, axes: np.ndarray) -> np.ndarray:
        """(cell,) share of each cell that lies in the domain, as far as the chosen axes (d,) bool go."""
        share = np.ones(len(self.cell_width))
        for axis in np.flatnonzero(axes):
            if self.extent[axis] % 1.0:
                share *= np.minimum((self.extent[axis] - self.cell_index[:, axis]) / self.cell_width, 1.0)
        return share


def finest_grid(grid: MultiLevelGrid, cell_nodes: np.ndarray) -> LevelGrid:
    """The whole multi-level grid, its cells and nodes as they are; cell_nodes (cell, 2^d) in bit order."""
    width = grid.cell_width
    shift = int(np.log2(width.min()))  # not 0 where nothing is refined
    cell_index, node_index = (index >> shift if shift else index for index in (grid.cell_index, grid.node_index))
    return LevelGrid(cell_index, width >> shift, cell_nodes, node_index, grid.node_parents, grid.shape / (1 << shift))


@njit(cache=True)
def _merge(cell_index, cell_width, coarse_index, coarse_width, coarse_of_cell):
    """Merge the cells of width 1; returns the number of coarse cells. Siblings of width 1 follow each other."""
    cells, dimension = cell_index.shape
    count = 0
    home = np.full(dimension, -1, np.int32)
    for cell in range(cells):
        new = cell_width[cell] > 1
        for axis in range(dimension):
            new |= home[axis] != cell_index[cell, axis] >> 1
        if new:
            for axis in range(dimension):
                coarse_index[count, axis] = cell_index[cell, axis] >> 1
                home[axis] = cell_index[cell, axis] >> 1 if cell_width[cell] == 1 else -1
            coarse_width[count] = max(cell_width[cell] >> 1, 1)
            count += 1
        coarse_of_cell[cell] = count - 1
    return count


@njit(cache=True)
def _inherit_nodes(cell_width, cell_index, cell_nodes, node_index, node_parents, coarse_of_cell, coarse_cells):
    """Nodes of the coarser grid if every merged cell has all its parts: corners of those, hanging as they did.

    (cell_nodes, node_index, node_parents) in the coarser grid's numbers and units; nodes by first touch. A finer node
    between cells of width 1 and 2 is no corner any more; one between larger cells keeps its parents.
    """
    corners = cell_nodes.shape[1]
    dimension = cell_index.shape[1]
    coarse_nodes = np.empty((coarse_cells, corners), np.int32)
    for cell in range(len(cell_width)):
        if cell_width[cell] == 1:
            corner = 0
            for axis in range(dimension):
                corner |= (cell_index[cell, axis] & 1) << axis
            coarse_nodes[coarse_of_cell[cell], corner] = cell_nodes[cell, corner]
        else:
            for corner in range(corners):
                coarse_nodes[coarse_of_cell[cell], corner] = cell_nodes[cell, corner]
    number = np.full(len(node_index), -1, np.int32)
    met = np.empty(len(node_index), np.int32)
    count = 0
    for cell in range(coarse_cells):
        for corner in range(corners):
            node = coarse_nodes[cell, corner]
            if number[node] < 0:
                number[node] = count
                met[count] = node
                count += 1
            coarse_nodes[cell, corner] = number[node]
    coarse_index = np.empty((count, dimension), np.int32)
    coarse_parents = np.empty((count, node_parents.shape[1]), np.int32)
    for node in range(count):
        for axis in range(dimension):
            coarse_index[node, axis] = node_index[met[node], axis] >> 1
        for end in range(node_parents.shape[1]):
            parent = node_parents[met[node], end]
            coarse_parents[node, end] = number[parent] if parent >= 0 else -1
    return coarse_nodes, coarse_index, coarse_parents


def coarsen(fine: LevelGrid) -> tuple[LevelGrid, np.ndarray]:
    """The next coarser grid, and which of its cells each cell of `fine` is (part of): (cell,) int32."""
    cells, dimension = fine.cell_index.shape
    coarse_index = np.empty((cells, dimension), np.int32)
    coarse_width = np.empty(cells, np.int32)
    coarse_of_cell = np.empty(cells, np.int32)
    count = _merge(fine.cell_index, fine.cell_width, coarse_index, coarse_width, coarse_of_cell)
    coarse_index, coarse_width = coarse_index[:count], coarse_width[:count]  # what lies behind was never touched
    extent = fine.extent / 2
    merged = np.count_nonzero(fine.cell_width == 1)
    if merged == (merged - cells + count) << dimension:
        coarse_nodes, node_index, node_parents = _inherit_nodes(
            fine.cell_width, fine.cell_index, fine.cell_nodes, fine.node_index, fine.node_parents, coarse_of_cell, count
        )
    else:  # parts are missing: some corners are new
        shape = (coarse_index + coarse_width[:, None]).max(axis=0)
        vtk_nodes, node_index, node_parents = number_nodes(coarse_index, coarse_width, shape)
        coarse_nodes = np.ascontiguousarray(vtk_nodes[:, BIT_ORDER[dimension]])
    return LevelGrid(coarse_index, coarse_width, coarse_nodes, node_index, node_parents, extent), coarse_of_cell
