"""Rock bodies far stiffer than the rock around them: their motions solved for exactly, in addition to the V-cycle.

A stiff body in soft rock moves rigidly, a plate bends besides: next to no force for its own stiffness, by which the
smoother measures everything. The coarser grids join it with its neighbours and the boundary, and thicken plates. So the
nodes of stiff bodies are gathered in blocks, as small as a direct solution can afford by the entries of its factor (a
dyke can afford more than a ball), single nodes if possible, and a solution in which every block moves rigidly is used
out before and after the V-cycle (deflation, Frank and Vuik 2001; balancing, Mandel 1993). Blocks belong to one body
each; bodies that meet at an edge or a corner share its nodes by halves: a hinge.

Unknowns are eliminated in the order of nested dissection, which also counts the entries of the factor.
"""

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from threadpoolctl import ThreadpoolController

from mpm_core.kernels.modes import hourglass_shares
from mpm_core.kernels.operator_cells import sum_cell_stiffness
from mpm_core.model.particles import mode_table, slopes_of
from mpm_core.multigrid.coarsening import LevelGrid
from mpm_core.multigrid.level import Level
from mpm_core.multigrid.stiffness import ElasticCells

MAX_LEAF_NODES = 32  # So few nodes are not divided further.
MIN_STIFFNESS_RATIO = 8.0  # Rock is a stiff body if it is stiffer than its host by a larger factor.
MAX_FACTOR_ENTRIES = 4_000_000  # Entries of the factor of a stiff body's matrix.
MAX_CELLS_AT_ONCE = 20_000  # Cells whose stiffness matrices are held in memory.
# Share by which the diagonal of a block is enlarged. Some of its motions, two nodes turned about each other, are none.
BLOCK_SHIFT = 1e-12
STIFFNESS_CLASS_RATIO = 2.0  # Stiffnesses that differ by less than this factor count as one kind of rock.


def dissect(graph, place: np.ndarray) -> tuple[np.ndarray, float]:
    """(order (n,), entries): nodes in the order of elimination, and entries of the factor's lower triangle, at most.

    graph: sparse (n, n), its pattern symmetric, each node its own neighbour; place (n, d). Halves by place are divided
    by those nodes of one that have neighbours in the other; both halves come first, then what divides them (George
    1973, SIAM J. Numer. Anal. 10, 345). Every node is counted with all that remains of its half and around it.
    """
    entries = 0.0
    order: list[np.ndarray] = []
    on_the_other_side = np.zeros(len(place), bool)

    def neighbours(nodes: np.ndarray):
        count = graph.indptr[nodes + 1] - graph.indptr[nodes]
        first = np.repeat(graph.indptr[nodes] - np.cumsum(count) + count, count)
        return graph.indices[first + np.arange(count.sum())], np.repeat(np.arange(len(nodes)), count)

    def eliminate(nodes: np.ndarray) -> np.ndarray:
        """Put nodes into the order; those around them that are left."""
        nonlocal entries
        halves: list[np.ndarray] = []
        last = nodes
        if len(nodes) > MAX_LEAF_NODES:
            spread = np.ptp(place[nodes], axis=0)
            nodes = nodes[np.argsort(place[nodes, int(np.argmax(spread))], kind="stable")]
            low, high = np.split(nodes, [len(nodes) // 2])
            on_the_other_side[high] = True
            neighbour, of = neighbours(low)
            divides = np.zeros(len(low), bool)
            divides[of[on_the_other_side[neighbour]]] = True
            on_the_other_side[high] = False
            last = low[divides]
            halves = [eliminate(half) for half in (low[~divides], high) if len(half)]
        around = np.setdiff1d(np.concatenate([neighbours(last)[0], *halves]), nodes)
        entries += len(last) * (0.5 * (len(last) + 1) + len(around))
        order.append(last)
        return around

    eliminate(np.arange(len(place)))
    return np.concatenate(order), entries


def host_shear(grid: LevelGrid, shear: np.ndarray) -> float:
    """m of a cell of width 1 of the rock at large, the volume's median; inf if none is far stiffer.

    shear (cell,): m of the cells, which grows with a cell's width^(d - 2). The largest of that kind of rock.
    """
    per_width = shear / grid.cell_width.astype(float) ** (grid.dimension - 2)
    present = per_width > 0.0
    largest = per_width.max(initial=0.0)
    if not present.any() or largest <= MIN_STIFFNESS_RATIO * per_width[present].min():
        return np.inf
    kind = np.floor(np.log(largest / per_width[present]) / np.log(STIFFNESS_CLASS_RATIO)).astype(np.int64)
    volume = np.bincount(kind, grid.cell_width[present].astype(float) ** grid.dimension)
    host = largest / STIFFNESS_CLASS_RATIO ** int(np.searchsorted(np.cumsum(volume), 0.5 * volume.sum()))
    return host if largest > MIN_STIFFNESS_RATIO * host else np.inf


def cell_matrices(cells: ElasticCells, chosen: np.ndarray, dimension: int) -> np.ndarray:
    """Stiffness matrices (k, 2^d d, 2^d d) of chosen cells (k,), N/m; see kernels.sibling_operators."""
    corners = 1 << dimension
    bits = np.arange(corners)
    constants = cells.constants[chosen]
    matrices = np.empty((len(chosen), corners * dimension, corners * dimension))
    for spread in np.unique(constants[:, 3]):
        alike = np.flatnonzero(constants[:, 3] == spread)
        both, shear = _unit_matrices(spread, dimension)
        matrices[alike] = constants[alike, 0, None, None] * (both - shear) + constants[alike, 1, None, None] * shear
    sign = (-1.0) ** np.bitwise_count(bits[:, None] & ~bits)  # (mode, corner)
    higher = sign[np.bitwise_count(bits) > 1]
    place = np.searchsorted(cells.irregular, chosen)
    own = np.flatnonzero(place < len(cells.irregular))
    own = own[cells.irregular[place[own]] == chosen[own]]
    for one, irregular in zip(own, place[own], strict=True):
        assert cells.parts is not None  # there are irregular cells
        matrices[one] = cells.parts.stiffness(irregular, irregular + 1)[0]
    hourglass = np.zeros((corners, dimension, corners, dimension))
    axes = np.arange(dimension)
    hourglass[:, axes, :, axes] = np.einsum("mj,ma,mb->jab", hourglass_shares(dimension), higher, higher)
    return matrices + constants[:, 2, None, None] * hourglass.reshape(matrices.shape[1:])


def _unit_matrices(spread: float, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness (2^d d, 2^d d) of a cell whose particles have this mean square place: of l = m = 1, and of m = 1."""
    corners = 1 << dimension
    bits = np.arange(corners)
    xi = np.sqrt(spread) * (2.0 * (bits[:, None] >> np.arange(dimension) & 1) - 1.0)
    ones = np.full(corners, 1.0 / corners)
    both, shear = np.empty((2, 1, corners * dimension, corners * dimension))
    for lame, matrix in ((ones, both), (0.0 * ones, shear)):
        sum_cell_stiffness(
            np.array([0, corners]), bits, np.array([2.0 / corners]), bits, slopes_of(mode_table(xi)), lame, ones, matrix
        )
    return both[0], shear[0]


def rigid_motions(nodes: np.ndarray, block: np.ndarray, place: np.ndarray, weight: np.ndarray, count: int):
    """Translations and rotations of blocks, those of a block one after the other: (row, column, value) of entries.

    Rows are node d + component. All arrays by member of a block (k,), `place` (k, d).
    nodes: which node; block: of `count`; weight: the node's share in this block. Single nodes do not turn.
    """
    dimension = place.shape[1]
    members = np.bincount(block, minlength=count)
    centre = np.stack([np.bincount(block, axis, count) / members for axis in place.T], axis=1)
    arm = place - centre[block]
    size = np.sqrt(np.bincount(block, (arm**2).sum(axis=1), count) / members)
    arm /= np.where(size > 0.0, size, 1.0)[block, None]
    pairs = [(i, j) for i in range(dimension) for j in range(i)] if size.any() else []
    each = dimension + len(pairs)
    parts = [(nodes * dimension + i, block * each + i, weight) for i in range(dimension)]
    for number, (i, j) in enumerate(pairs, start=dimension):
        parts.append((nodes * dimension + i, block * each + number, weight * arm[:, j]))
        parts.append((nodes * dimension + j, block * each + number, -weight * arm[:, i]))
    return tuple(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


class StiffBodies:
    """The motions of a model's stiff bodies, block by block, and their stiffness, factorised."""

    def __init__(self, finest: Level, cells: ElasticCells, host: float):
        """host: see `host_shear`; some cell is stiff."""
        grid = finest.grid
        self.grid, self.dimension = grid, grid.dimension
        width = grid.cell_width.astype(float)
        self.relative = cells.constants[:, 1] / (host * width ** (self.dimension - 2))
        self.stiff = np.flatnonzero(self.relative > MIN_STIFFNESS_RATIO)
        self.hanging = grid.node_parents[:, 0] >= 0
        self.free = finest.inverse_diagonal[
            finest.siblings.node_row[:, None] * finest.operator.width + np.arange(self.dimension)
        ] != 0.0  # fmt: skip
        self.touched = self._touched(cells)
        motions = self._motions()
        moved = np.flatnonzero(np.diff(motions.indptr))
        node, component = moved // self.dimension, moved % self.dimension
        self.elements = finest.siblings.node_row[node].astype(np.int64) * finest.operator.width + component
        self.motions = motions[moved]
        self.transposed = self.motions.T.tocsr()
        self.blas = ThreadpoolController()
        matrix = self._stiffness(motions, cells)
        diagonal = matrix.diagonal()
        shift = np.where(diagonal > 0.0, BLOCK_SHIFT * diagonal, 1.0)
        with self.blas.limit(limits=1):  # threads would add up in another order
            self.factors = splu(
                (matrix + sparse.diags_array(shift)).tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )  # fmt: skip

    def solve(self, residual: np.ndarray, solution: np.ndarray) -> None:
        """The motion of the blocks that takes a residual off them: solution (element,), written, 0 elsewhere."""
        with self.blas.limit(limits=1):
            amounts = self.factors.solve(self.transposed @ residual[self.elements])
        solution[:] = 0.0
        solution[self.elements] = self.motions @ amounts

    def _corners(self, cells: np.ndarray):
        """(cell, node) pairs, sparse: free nodes at the corners of cells (k,), parents for those that hang."""
        nodes = self.grid.cell_nodes[cells]
        rows = np.repeat(np.arange(len(cells)), nodes.shape[1])
        nodes = nodes.ravel()
        hanging = self.hanging[nodes]
        parents = self.grid.node_parents[nodes[hanging]]
        present = parents >= 0
        columns = np.concatenate([nodes[~hanging], parents[present]])
        rows = np.concatenate([rows[~hanging], np.repeat(rows[hanging], present.sum(axis=1))])
        pairs = np.unique(rows.astype(np.int64) * len(self.hanging) + columns)
        rows, columns = np.divmod(pairs, len(self.hanging))
        return sparse.csr_array((np.ones(len(pairs), np.int32), (rows, columns)), shape=(len(cells), len(self.hanging)))

    def _touched(self, cells: ElasticCells) -> np.ndarray:
        """Cells (k,) with rock that a motion of the stiff ones strains or moves."""
        moves = np.zeros(len(self.hanging), bool)
        moves[self._corners(self.stiff).indices] = True
        moves[self.hanging] = (moves[self.grid.node_parents] & (self.grid.node_parents >= 0)).any(axis=1)[self.hanging]
        return np.flatnonzero(moves[self.grid.cell_nodes].any(axis=1) & (cells.constants[:, 1] > 0.0))

    def _motions(self):
        """Motions of the blocks, (node d, motion) sparse, 0 where held; the smallest blocks that can be afforded.

        Motions come in the order of their elimination, those of a block together.
        """
        corners = self._corners(self.touched)
        for blocks in self._blocks():
            node, block, place, _ = blocks
            count = int(block.max()) + 1
            members = sparse.csr_array((np.ones(len(node), np.int32), (node, block)), shape=(len(self.hanging), count))
            corners_of_blocks = corners @ members
            centre = (
                np.stack([np.bincount(block, axis, count) for axis in place.T], axis=1) / np.bincount(block)[:, None]
            )
            order, entries = dissect((corners_of_blocks.T @ corners_of_blocks).tocsr(), centre)
            each = self.dimension if len(node) == count else self.dimension * (self.dimension + 1) // 2
            if entries * each**2 <= MAX_FACTOR_ENTRIES:
                break
        else:  # more bodies than can be afforded: those of most nodes
            chosen = np.argsort(-np.bincount(block), kind="stable")
            most = int(count * MAX_FACTOR_ENTRIES / (entries * each**2))
            order = order[np.isin(order, chosen[: max(1, most)])]
        weight = blocks[-1]
        number = np.full(count, -1)
        number[order] = np.arange(len(order))
        keep = number[block] >= 0
        rows, columns, values = rigid_motions(
            node[keep], number[block[keep]], place[keep].astype(float), weight[keep], len(order)
        )
        keep = self.free.ravel()[rows] & (values != 0.0)
        shape = (len(self.hanging) * self.dimension, each * len(order))
        return sparse.csr_array((values[keep], (rows[keep], columns[keep])), shape=shape)

    def _blocks(self):
        """Ways to gather the nodes of stiff bodies, the smallest blocks first, single nodes to whole bodies.

        Each as arrays by member of a block (k,): node, block, place (k, d) on the grid, the node's share in the block.
        """
        corners = self._corners(self.stiff)
        single = np.unique(corners.indices)
        single = single[self.free[single].any(axis=1)]
        yield single, np.arange(len(single)), self.grid.node_index[single], np.ones(len(single))
        touching = (corners @ corners.T).tocsr()
        touching.data = (touching.data >= 2 ** (self.dimension - 1)).astype(np.int8)  # across a face, not an edge
        touching.eliminate_zeros()
        _, body = connected_components(touching, directed=False)
        count, bodies = np.diff(corners.indptr), int(body.max()) + 1
        pairs = np.unique(corners.indices.astype(np.int64) * bodies + np.repeat(body, count))
        node, body = np.divmod(pairs, bodies)
        weight = 1.0 / np.bincount(node)[node]
        kind = np.zeros(len(self.hanging), np.int64)
        smallest = np.zeros(len(self.hanging), np.int64)
        decade = np.log10(self.relative[self.stiff] / MIN_STIFFNESS_RATIO).astype(np.int64)
        np.maximum.at(kind, corners.indices, np.repeat(decade, count))
        np.maximum.at(smallest, corners.indices, np.repeat(self.grid.cell_width[self.stiff], count))
        place = self.grid.node_index[node]
        lowest = np.full((bodies, self.dimension), np.iinfo(place.dtype).max)
        np.minimum.at(lowest, body, place)
        from_corner = place - lowest[body]  # both sides of a plate in one block
        edge = 2
        while edge <= 2 * place.max():
            boxes = from_corner // (edge * smallest[node, None])
            keys = np.column_stack([body, kind[node], smallest[node], boxes])
            _, block = np.unique(keys, axis=0, return_inverse=True)
            yield node, block.ravel(), place, weight
            edge *= 2

    def _stiffness(self, motions, cells: ElasticCells):
        """Stiffness of the motions (motion, motion), sparse: the elastic operator's, Galerkin."""
        dimension, nodes = self.dimension, len(self.hanging)
        hanging = np.flatnonzero(self.hanging)
        parents = self.grid.node_parents[hanging]
        present = parents >= 0
        mean = sparse.csr_array(
            (
                np.repeat(1.0 / present.sum(axis=1), present.sum(axis=1)),
                (np.repeat(hanging, present.sum(axis=1)), parents[present]),
            ),
            shape=(nodes, nodes),
        )
        motions = motions + sparse.kron(mean, np.eye(dimension), format="csr") @ motions
        total = sparse.csr_array((motions.shape[1],) * 2)
        for first in range(0, len(self.touched), MAX_CELLS_AT_ONCE):
            some = self.touched[first : first + MAX_CELLS_AT_ONCE]
            elements = self.grid.cell_nodes[some].astype(np.int64)[:, :, None] * dimension + np.arange(dimension)
            elements, local = np.unique(elements, return_inverse=True)
            local = local.reshape(len(some), -1)
            edge = local.shape[1]
            matrices = cell_matrices(cells, some, dimension)
            whole = sparse.csr_array(
                (matrices.ravel(), (np.repeat(local, edge, axis=1).ravel(), np.tile(local, (1, edge)).ravel())),
                shape=(len(elements),) * 2,
            )
            part = motions[elements]
            total = total + part.T @ (whole @ part)
        return total
