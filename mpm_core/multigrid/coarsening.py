"""The coarser grids under a multi-level grid: its finest leaves merged, level by level, then the base grid halved.

Every grid counts in its own finest cells. An odd number of base cells is rounded up: the last cells reach past the
domain.

Between a grid and the next coarser one displacements are interpolated multilinearly, and forces go by the transpose.
A node half-way between coarse ones moves as the mean of both, but not where one side of it is void: there it moves as
the coarse node on the side of its rock. Otherwise rock next to a void one cell thick, which the coarse grid cannot
show, would be torn by every motion that opens or closes the void (hierarchy.py says what that costs).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from mpm_core.grid.mesh import BIT_ORDER, MultiLevelGrid
from mpm_core.grid.nodes import number_nodes
from mpm_core.multigrid.siblings import Siblings

MAX_VOID_STIFFNESS = 0.1  # A cell with less than this share of the stiffness of the stiffest cell nearby is void.
PARENT_WEIGHTS = (0.5 ** np.bitwise_count(np.arange(8))).astype(np.float32)
"""Weight of a node in each of its parents, by bits of the axes along which it is half-way."""


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


@njit(cache=True)
def _find_homes(cell_index, cell_width, cell_nodes, node_parents, home, upper, between):
    """Find free nodes in the coarser grid: in the first of their cells that comes; all arrays (node,) written.

    home: that cell (finer grid), -1 for hanging nodes; upper: bits of the coarse corner; between: axes along which the
    node is half-way to the next corner.
    """
    cells, corners = cell_nodes.shape
    dimension = cell_index.shape[1]
    home[:] = -1
    for cell in range(cells):
        for corner in range(corners):
            node = cell_nodes[cell, corner]
            if home[node] >= 0 or node_parents[node, 0] >= 0:
                continue
            home[node] = cell
            half = 0
            high = corner
            if cell_width[cell] == 1:
                high = 0
                for axis in range(dimension):
                    steps = (cell_index[cell, axis] & 1) + ((corner >> axis) & 1)
                    half |= (steps & 1) << axis
                    high |= (steps >> 1) << axis
            upper[node], between[node] = high, half


@njit(cache=True)
def _lean_on_rock(cell_nodes, shear, upper, between):
    """Let nodes half-way between corners lie at the one on their rock's side where the other side is void, in place.

    shear (cell,): m of the cells. What lies past the domain is void.
    """
    corners = cell_nodes.shape[1]
    dimension = 2 if corners == 4 else 3
    stiffest = np.zeros(len(between), np.float32)
    for cell in range(len(cell_nodes)):
        for corner in range(corners):
            node = cell_nodes[cell, corner]
            stiffest[node] = max(stiffest[node], np.float32(shear[cell]))
    solid = np.zeros(len(between), np.uint8)  # bits: axis, low side; axis + 4, high side
    for cell in range(len(cell_nodes)):
        for corner in range(corners):
            node = cell_nodes[cell, corner]
            if between[node] and shear[cell] >= MAX_VOID_STIFFNESS * stiffest[node]:
                solid[node] |= (~corner & 7) << 4 | corner  # a cell is on the low side of its high corners
    for node in range(len(between)):
        for axis in range(dimension):
            low, high = 1 << axis, 16 << axis
            if between[node] & low:
                if not solid[node] & low:
                    between[node] &= ~low
                    upper[node] |= low
                elif not solid[node] & high:
                    between[node] &= ~low


@njit(cache=True)
def _count_parents(home, between, parent_start):
    """parent_start (node + 1,), written: sums of the 1, 2, 4 or 8 corners that each free node lies between."""
    for node in range(len(home)):
        count = 1 if home[node] >= 0 else 0
        for axis in range(3):
            count <<= (between[node] >> axis) & 1
        parent_start[node + 1] = parent_start[node] + count


@njit(parallel=True, cache=True)
def _link_parents(home, upper, between, parent_start, coarse_of_cell, coarse_nodes, parents):
    """Coarse nodes that each node lies between: parents (link,), written."""
    corners = coarse_nodes.shape[1]
    for node in prange(len(home)):
        if home[node] >= 0:
            link = parent_start[node]
            for corner in range(corners):
                if corner & ~between[node] == upper[node]:
                    parents[link] = coarse_nodes[coarse_of_cell[home[node]], corner]
                    link += 1


@njit(cache=True)
def _transpose(parent_start, parents, fine_row, coarse_row, link_start, links):
    """Rows of the free nodes that use each coarse node, ascending by node: link_start, zeros, and links, written.

    parents (link,), in place: coarse nodes before, their rows afterwards.
    """
    for link in range(len(parents)):
        link_start[parents[link] + 1] += 1
    for node in range(len(link_start) - 1):
        link_start[node + 1] += link_start[node]
    room = link_start[:-1].copy()
    for node in range(len(parent_start) - 1):
        for link in range(parent_start[node], parent_start[node + 1]):
            parent = parents[link]
            links[room[parent]] = fine_row[node]
            room[parent] += 1
            parents[link] = coarse_row[parent]


@dataclass(frozen=True)
class Transfer:
    """Links between the rows of a level and of the next coarser one, for restrict and prolong of kernels.operator_rows.

    parent_start (fine node + 1,), parents: coarse rows between which each free node lies; link_start (coarse node +
    1,), links: rows of the free nodes that lie next to each coarse node; fine_weights (fine row,): 1 / parents. All
    int32 but the last, float32.
    """

    parent_start: np.ndarray
    parents: np.ndarray
    link_start: np.ndarray
    links: np.ndarray
    fine_weights: np.ndarray


def build_transfer(
    fine: LevelGrid,
    fine_siblings: Siblings,
    coarse: LevelGrid,
    coarse_siblings: Siblings,
    coarse_of_cell: np.ndarray,
    shear: np.ndarray,
) -> Transfer:
    """Transfer between two grids of the hierarchy, `coarse` being that of `coarsening.coarsen(fine)`.

    shear (cell,): m of the finer grid's cells.
    """
    nodes = len(fine.node_parents)
    parent_start = np.zeros(nodes + 1, np.int32)
    home, upper, between = np.empty(nodes, np.int32), np.zeros(nodes, np.int8), np.zeros(nodes, np.int8)
    _find_homes(fine.cell_index, fine.cell_width, fine.cell_nodes, fine.node_parents, home, upper, between)
    if shear.min() < MAX_VOID_STIFFNESS * shear.max() or (fine.extent % 2.0).any():
        _lean_on_rock(fine.cell_nodes, shear, upper, between)
    _count_parents(home, between, parent_start)
    parents = np.empty(parent_start[-1], np.int32)
    _link_parents(home, upper, between, parent_start, coarse_of_cell, coarse.cell_nodes, parents)
    link_start, links = np.zeros(len(coarse.node_parents) + 1, np.int32), np.empty(len(parents), np.int32)
    _transpose(parent_start, parents, fine_siblings.node_row, coarse_siblings.node_row, link_start, links)
    weights = np.zeros(fine_siblings.rows, np.float32)
    weights[fine_siblings.node_row] = PARENT_WEIGHTS[between]
    return Transfer(parent_start, parents, link_start, links, weights)
