"""One level of the hierarchy: its elastic operator, its diagonal, its work arrays."""

import numpy as np
from numba import njit, prange

from mpm_core.kernels.operator_cells import add_row_sums, apply_cells
from mpm_core.kernels.operator_rows import COLLECT, SPREAD
from mpm_core.kernels.sibling_operators import apply_siblings_2, apply_siblings_3
from mpm_core.multigrid.cell_entries import Patterns, Tangents, pack
from mpm_core.multigrid.coarsening import LevelGrid, Transfer
from mpm_core.multigrid.siblings import Siblings, build_siblings
from mpm_core.multigrid.stiffness import ElasticCells
from mpm_core.simd.lanes import LANES, POINT_WIDTH

APPLY = {2: apply_siblings_2, 3: apply_siblings_3}


@njit(parallel=True, cache=True)
def _place_constants(cell_place, constants, placed):
    """Constants (cell, 4) to their places (batch * 2^d, 4, LANES), in place."""
    for cell in prange(len(cell_place)):
        slot, lane = cell_place[cell] // placed.shape[2], cell_place[cell] % placed.shape[2]
        for k in range(4):
            placed[slot, k, lane] = constants[cell, k]


@njit(parallel=True, cache=True)
def _sum_at_corners(batch_start, row_start, places, placed, sums):
    """Sums over the cells at each row: sums (row * 4,), written; copies hold their own part.

    Of 2^d (l + 2 m), of 2^d (d l + 2 m), and of the square of the first; see `_invert`.
    """
    nodes, lanes = places.shape[1], places.shape[2]
    dimension = 2 if nodes == 9 else 3
    corners = 1 << dimension
    position = np.zeros((corners, corners), np.int64)
    for child in range(corners):
        for corner in range(corners):
            for axis in range(dimension - 1, -1, -1):
                position[child, corner] = 3 * position[child, corner] + ((child >> axis) & 1) + ((corner >> axis) & 1)
    for block in prange(len(batch_start) - 1):
        sums[row_start[block] * 4 : row_start[block + 1] * 4] = 0.0
        for batch in range(batch_start[block], batch_start[block + 1]):
            for child in range(corners):
                for lane in range(lanes):
                    slot = batch * corners + child
                    lame, shear = placed[slot, 0, lane], placed[slot, 1, lane]
                    wave = corners * (lame + 2.0 * shear)
                    for corner in range(corners):
                        element = 4 * places[batch, position[child, corner], lane]
                        sums[element] += wave
                        sums[element + 1] += corners * (dimension * lame + 2.0 * shear)
                        sums[element + 2] += wave * wave


@njit(parallel=True, error_model="numpy", cache=True)
def _invert(node_row, node_parents, held, sums, inverse_diagonal):
    """Inverse of the smoother's D at free nodes: inverse_diagonal (row * width,), written there.

    D is such that no eigenvalue of D^-1 A is above about 1. In a uniform grid the stiffest motion is a plane
    compression wave of two cells' length: 2^d (l + 2 m) from each cell at a node is then exact, for any hourglass
    stiffness and number of particles. A cell on its own would need 2^d (d l + 2 m), the stiffness of its dilation:
    D tends to that where one cell outweighs all others. Hanging nodes hand their sums to their parents: no eigenvalue
    of the whole is above the largest of its parts (Irons and Treharne 1971).
    """
    dimension = held.shape[1]
    width = len(inverse_diagonal) // (len(sums) // 4)
    even = 0.5**dimension
    for node in prange(len(node_row)):
        row = node_row[node]
        wave, dilation, squares = sums[4 * row], sums[4 * row + 1], sums[4 * row + 2]
        if node_parents[node, 0] >= 0 or wave == 0.0:
            for k in range(dimension):
                inverse_diagonal[row * width + k] = 0.0
            continue
        alone = (0.5 - wave * wave / squares * even) / (0.5 - even)  # 0 if half of the cells are alike, 1 for one
        diagonal = wave + min(max(alone, 0.0), 1.0) * (dilation - wave)
        for k in range(dimension):
            inverse_diagonal[row * width + k] = 0.0 if held[node, k] else 1.0 / diagonal


class Operator:
    """C^T K C of a level in one precision, on flat nodal arrays of its rows."""

    def __init__(self, siblings: Siblings, dimension: int, precision):
        self.siblings, self.dimension, self.precision = siblings, dimension, precision
        self.width = POINT_WIDTH[dimension]
        self.places = siblings.places.reshape(-1)
        self.constants = np.zeros((len(siblings.places) << dimension, 4, LANES), precision)
        self.block_cells = np.zeros(len(siblings.row_start), np.int64)
        self.cell_rows = np.empty((0, 1 << dimension), np.int32)
        self.row_sums = np.empty((0, 1 << dimension))  # of irregular cells, see add_row_sums
        self.stiffness = np.empty((0, dimension << dimension, dimension << dimension), precision)
        self.distorted = np.empty(0, np.int32)
        self.patterns: Patterns | None = None  # of distorted cells
        self.averaged: Tangents | None = None  # irregular cells in place of stiffness, with the sign of what is lacking
        self.tangents: Tangents | None = None  # of rock that flows: the operator is then that of flow

    def set_constants(self, constants: np.ndarray) -> None:
        """Take over l, m, g and s of each cell, (cell, 4)."""
        _place_constants(self.siblings.cell_place, constants, self.constants)

    def set_cells(self, cells: ElasticCells) -> None:
        """Take over constants, and the matrices of irregular cells."""
        siblings, corners = self.siblings, 1 << self.dimension
        self.set_constants(cells.constants)
        place = siblings.cell_place[cells.irregular]
        slot = place // LANES
        for entry in (0, 1, 3):  # l, m and s; what stands against hourglass patterns stays
            self.constants[slot, entry, place % LANES] = 0.0
        order = np.argsort(slot, kind="stable")
        self.cell_rows = siblings.corner_rows(cells.irregular[order])
        self.block_cells = np.searchsorted(slot[order] // corners, siblings.batch_start)
        self.row_sums = cells.row_sums()[order]
        self.distorted = cells.distorted
        self.patterns = None
        if len(cells.distorted):
            self.patterns = Patterns.of(siblings, cells.distorted, cells.patterns, self.precision)
            self.set_patterns(cells.constants[cells.distorted, 2])
        if cells.averaged is None:
            if cells.parts is not None:
                self.stiffness = cells.parts.stiffness()[order].astype(self.precision)
        else:
            cell, slopes, matrices = cells.averaged
            self.averaged = pack(siblings, cell, slopes, -matrices, self.precision)

    def set_patterns(self, constants: np.ndarray) -> None:
        """Take over g (n,) of the distorted cells, of which there are some."""
        assert self.patterns is not None
        place = self.siblings.cell_place[self.distorted]
        self.constants[place // LANES, 2, place % LANES] = 0.0
        self.patterns.set_stiffness(constants)

    def set_hourglass(self, cells: np.ndarray, constants: np.ndarray) -> None:
        """Take over g (k,) of some cells (k,), none of them distorted."""
        place = self.siblings.cell_place[cells]
        self.constants[place // LANES, 2, place % LANES] = constants

    def in_precision(self, precision) -> "Operator":
        """A copy in another precision, or the same."""
        other = Operator(self.siblings, self.dimension, precision)
        other.constants[:] = self.constants
        other.block_cells, other.cell_rows = self.block_cells, self.cell_rows
        other.row_sums, other.stiffness = self.row_sums, self.stiffness.astype(precision)
        other.averaged = self.averaged and self.averaged.in_precision(precision)
        other.patterns = self.patterns and self.patterns.in_precision(precision)
        other.distorted = self.distorted
        other.tangents = self.tangents and self.tangents.in_precision(precision)
        return other

    def zeros(self) -> np.ndarray:
        """A nodal array of zeros."""
        return np.zeros(self.siblings.rows * self.width, self.precision)

    def spread(self, values: np.ndarray) -> None:
        """Fill in the copies, hanging nodes included."""
        f = self.siblings
        SPREAD[self.dimension](f.copies, f.copy_start, f.parents, values)

    def collect(self, values: np.ndarray) -> None:
        """Add what copies hold to the nodes that they stand for; the copies' own values are then meaningless."""
        f = self.siblings
        COLLECT[self.dimension](f.targets, f.target_start, f.sources, f.source_weights, values)

    def apply(self, values: np.ndarray, forces: np.ndarray) -> None:
        """forces = C^T K C values; the copies of `values` are filled in, those of `forces` are meaningless."""
        f = self.siblings
        self.spread(values)
        APPLY[self.dimension](f.batch_start, f.row_start, self.places, self.constants.reshape(-1), values, forces)
        if len(self.stiffness):
            apply_cells(self.block_cells, self.cell_rows, self.stiffness, self.width, values, forces)
        if self.averaged is not None:
            self.averaged.take_off(values, forces)
        if self.patterns is not None:
            self.patterns.add(values, forces)
        if self.tangents is not None:
            self.tangents.take_off(values, forces)
        self.collect(forces)

    def sum_stiffness(self, sums: np.ndarray) -> None:
        """Sums over the cells at each node that `_invert` needs: sums (row * 4,) float32, written."""
        f = self.siblings
        _sum_at_corners(f.batch_start, f.row_start, f.places, self.constants, sums)
        add_row_sums(self.block_cells, self.cell_rows, self.row_sums, sums)
        COLLECT[3](f.targets, f.target_start, f.sources, f.source_weights, sums)  # rows of four, as in 3-D


class Level:
    """One level of the hierarchy: operator in single precision, inverse of the smoother's D, work arrays.

    The cycle needs a step and what it changes only while it is on a level: all levels have the finest one's memory for
    them. `held` (node, d) bool; `transfer` leads to the next coarser level, `coarse_of_cell` (cell,) to its cells;
    `kept` (coarse cell,): their m over that of their parts, summed; `grid`: until the hierarchy has its stiffness.
    """

    grid: LevelGrid
    step: np.ndarray
    change: np.ndarray

    def __init__(self, grid: LevelGrid, held: np.ndarray, finer: "Level | None" = None):
        self.grid, self.held, self.finer = grid, held, finer
        self.dimension, self.cells = grid.dimension, len(grid.cell_width)
        self.siblings = build_siblings(grid.cell_index, grid.cell_width, grid.cell_nodes, grid.node_parents)
        self._make_arrays(np.float32)
        self.transfer: Transfer | None = None
        self.coarse_of_cell: np.ndarray | None = None
        self.kept: np.ndarray | None = None

    def _make_arrays(self, precision) -> None:
        self.operator = Operator(self.siblings, self.dimension, precision)
        self.residual, self.solution, self.inverse_diagonal = (self.operator.zeros() for _ in range(3))
        size = len(self.residual)
        if self.finer is not None and size <= len(self.finer.step):
            self.step, self.change = self.finer.step[:size], self.finer.change[:size]
        else:
            self.step, self.change = self.operator.zeros(), self.operator.zeros()

    def set_precision(self, precision) -> None:
        """Single, or double with stiff bodies, whose forces' round-off must not outweigh the host's forces."""
        if precision != self.operator.precision:
            self._make_arrays(precision)

    @property
    def unknowns(self) -> int:
        """Components of free nodes that nothing holds."""
        free = self.grid.node_parents[:, 0] < 0
        return sum(int(np.count_nonzero(free & ~held)) for held in self.held.T)

    def set_diagonal(self) -> None:
        """D^-1 by element, from the operator's constants; 0 on copies, where held and where nothing is attached."""
        size = 4 * self.siblings.rows  # in 3-D that of a work array: memory that a cycle needs anyway
        sums = self.change if size == len(self.change) else np.empty(size, self.operator.precision)
        self.operator.sum_stiffness(sums)
        _invert(self.siblings.node_row, self.grid.node_parents, self.held, sums, self.inverse_diagonal)
