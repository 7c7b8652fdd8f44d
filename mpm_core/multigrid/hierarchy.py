"""All levels under a multi-level grid, and the stiffness that each gets from the finer one.

A coarse cell's l and m are those of its parts together (their lambda V and mu V, summed): with trilinear interpolation
that is the Galerkin product exactly where rock is uniform, if the coarse cell counts as having the particles of its
parts. Hence s of a merged cell is (1 + s) / 4, and of its parts' hourglass stiffness a sixteenth each remains.

A void one cell thick leaves half of a coarse cell, a quarter of the next: rock on both sides of it would be tied
together, the more the coarser the grid, and its closure left to the fine grids. So a coarse cell there loses more
stiffness than its void part, and nodes next to voids move with their rock (coarsening.py). Both are needed for a number
of iterations that does not grow with the length of a slot.

The base grid halved may reach past the domain. A free face is then a void in the coarse cell. A held face lies within
the cell, but the coarse grid holds it only at the cell's far side: the stiffness there is that of the part inside over
its share squared, which is the Galerkin product for a motion towards the face.
"""

import numpy as np
from numba import njit

from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.grid.splitting import code_of
from mpm_core.multigrid.coarsening import MAX_VOID_STIFFNESS, LevelGrid, build_transfer, coarsen, finest_grid
from mpm_core.multigrid.cycle import MAX_DIRECT_UNKNOWNS, Cycle
from mpm_core.multigrid.level import Level, Operator
from mpm_core.multigrid.stiff_bodies import StiffBodies, host_shear
from mpm_core.multigrid.stiffness import ElasticCells

MIN_STIFFNESS_SHARE = 1e-9  # Parts with less than this share of the stiffest part's stiffness count as empty.
BRIDGE_POWER = {2: 6, 3: 3}
"""Power of the share of a coarse cell's parts that are not void, by dimension."""


def held_faces(grid: MultiLevelGrid, held: np.ndarray) -> np.ndarray:
    """(axis, side, component) bool: faces of the domain whose nodes are all held (node, d)."""
    return np.array(
        [[held[grid.boundary_nodes(axis, side)].all(axis=0) for side in range(2)] for axis in range(grid.dimension)]
    )


def held_nodes(grid: LevelGrid, faces: np.ndarray, complete: np.ndarray | None) -> np.ndarray:
    """(node, d) bool: nodes on held faces or past them, and those next to cells that are not complete (cell,).

    Only a part of a mine has such cells, at its border: with the node held, no motion of the coarse grid reaches it.
    None: all are complete.
    """
    held = np.zeros((len(grid.node_index), grid.dimension), bool)
    for axis in range(grid.dimension):
        place = grid.node_index[:, axis]
        held[place <= 0] |= faces[axis, 0]
        held[place >= grid.extent[axis]] |= faces[axis, 1]
    if complete is None:
        return held
    code = code_of(grid.node_index, grid.node_index.max(axis=0) + 1)
    place = np.unique(code, return_inverse=True)[1]  # phantom nodes share theirs
    corners = np.bincount(place[grid.cell_nodes[complete].ravel()], minlength=len(held))[place]
    outside = (grid.node_index <= 0) | (grid.node_index >= grid.extent)
    held[corners < 2.0 ** (grid.dimension - outside.sum(axis=1))] = True
    return held


def fills_box(grid: LevelGrid) -> bool:
    """True if there is a cell everywhere in the domain; not in a subdomain."""
    widths = (1 << power for power in range(int(grid.cell_width.max()).bit_length()))
    volume = sum(np.count_nonzero(grid.cell_width == width) * width**grid.dimension for width in widths)
    return volume == int(np.prod(grid.extent))


def complete_cells(fine: LevelGrid, complete: np.ndarray, coarse: LevelGrid, coarse_of_cell: np.ndarray) -> np.ndarray:
    """(coarse cell,) bool: whether its parts fill it, as far as the domain goes; complete (cell,) bool: the parts."""
    filled = np.bincount(coarse_of_cell, fine.inside_volume * complete, minlength=len(coarse.cell_width))
    return filled == coarse.inside_volume * 2.0**fine.dimension


@njit(cache=True)
def unbridged(shear: np.ndarray, power: int, most: float) -> float:
    """The rest of the stiffness of a coarse cell's parts, of m `shear` (part,), where some of them are void.

    That of layers in series, the harmonic over the arithmetic mean, but not less than a floor: the share of parts that
    are not void to a power. The floor is taken off the other: the next coarser grid would count it as stiffness again.
    most: m of the rock at large; next to a body that is stiffer it is no void.
    """
    largest = shear[0]
    for part in shear:
        largest = max(largest, part)
    stiffest = min(largest, most)
    solid = 0.0
    for part in shear:
        solid += part >= MAX_VOID_STIFFNESS * stiffest
    if solid == len(shear):
        return 1.0
    softness, stiffness = 0.0, 0.0
    for part in shear:
        relative = min(part / stiffest, 1.0)
        softness += 1.0 / max(relative, MIN_STIFFNESS_SHARE)
        stiffness += relative
    in_series = 1.0 / (softness / len(shear)) / (stiffness / len(shear))
    floor = (solid / len(shear)) ** power
    return max(floor, in_series - floor)


@njit(cache=True)
def _merge_constants(coarse_of_cell, cell_width, constants, power, most, result):
    """Constants of each coarse cell: result (coarse cell, 4), written. Parts of a coarse cell follow each other."""
    last = 0
    for coarse in range(len(result)):
        first = last
        while last < len(coarse_of_cell) and coarse_of_cell[last] == coarse:
            last += 1
        if cell_width[first] > 1:
            for k in range(4):
                result[coarse, k] = constants[first, k]
            continue
        for k in range(3):
            result[coarse, k] = 0.0
        for cell in range(first, last):
            result[coarse, 0] += 0.25 * constants[cell, 0]
            result[coarse, 1] += 0.25 * constants[cell, 1]
            result[coarse, 2] += 0.0625 * constants[cell, 2]
            result[coarse, 3] = 0.25 * (1.0 + constants[cell, 3])
        share = unbridged(constants[first:last, 1], power, most)
        for k in range(3):
            result[coarse, k] *= share


def merged_constants(fine: Level, coarse: LevelGrid, constants: np.ndarray, most: float) -> np.ndarray:
    """Constants (coarse cell, 4) of the parts of each coarse cell together.

    constants (cell, 4) of the finer level; most: m of the rock at large in its cells of width 1, see `unbridged`.
    """
    result = np.empty((len(coarse.cell_index), 4))
    _merge_constants(fine.coarse_of_cell, fine.grid.cell_width, constants, BRIDGE_POWER[coarse.dimension], most, result)
    return result


class Hierarchy:
    """Levels, finest first: their grids, then their stiffness and the motions of nodes next to voids."""

    def __init__(self, grid: MultiLevelGrid, cell_nodes: np.ndarray, held: np.ndarray):
        """cell_nodes (cell, 2^d) in bit order; held (node, d) bool."""
        self.faces = held_faces(grid, held)
        self.levels = [Level(finest_grid(grid, cell_nodes), held)]
        complete = None if fills_box(self.levels[0].grid) else np.ones(len(cell_nodes), bool)
        while self.levels[-1].unknowns > MAX_DIRECT_UNKNOWNS:
            fine = self.levels[-1]
            coarse_grid, coarse_of_cell = coarsen(fine.grid)
            if complete is not None:
                complete = complete_cells(fine.grid, complete, coarse_grid, coarse_of_cell)
            coarse_held = held_nodes(coarse_grid, self.faces, complete)
            if coarse_held.all() or len(coarse_of_cell) == len(coarse_grid.cell_index):
                break
            coarse = Level(coarse_grid, coarse_held, fine)
            fine.coarse_of_cell = coarse_of_cell
            self.levels.append(coarse)

    def set_stiffness(self, cells: ElasticCells, operator: Operator, body_is_held: bool) -> Cycle:
        """The V-cycle for this stiffness, which the operator of the finest level has. The levels then need no grid any
        more, and have none: another stiffness needs another hierarchy."""
        constants = filled = cells.constants
        host = most = host_shear(self.levels[0].grid, constants[:, 1])
        for level in self.levels:
            level.set_precision(np.float32 if host == np.inf else np.float64)
        self.levels[0].operator = operator.in_precision(self.levels[0].operator.precision)
        self.levels[0].set_diagonal()
        for fine, coarse in zip(self.levels, self.levels[1:], strict=False):
            assert fine.coarse_of_cell is not None  # only the coarsest level has none
            width = fine.grid.cell_width.astype(float) ** (coarse.grid.dimension - 2)
            fine.transfer = build_transfer(
                fine.grid, fine.siblings, coarse.grid, coarse.siblings, fine.coarse_of_cell,
                constants[:, 1] if most == np.inf else np.minimum(constants[:, 1], most * width),
            )  # fmt: skip
            parts = np.bincount(fine.coarse_of_cell, filled[:, 1])
            constants = merged_constants(fine, coarse.grid, constants, most)
            filled = self._filled(coarse.grid, constants)
            fine.kept = np.divide(filled[:, 1], parts, out=np.zeros(len(parts)), where=parts > 0.0).astype(np.float32)
            coarse.operator.set_constants(filled)
            coarse.set_diagonal()
            most *= 2.0 ** (coarse.grid.dimension - 2)
        bodies = None if host == np.inf else StiffBodies(self.levels[0], cells, host)
        for level in self.levels:
            del level.grid
        return Cycle(self.levels, cells.wave_over_shear, body_is_held, bodies)

    def _filled(self, grid: LevelGrid, constants: np.ndarray) -> np.ndarray:
        """Constants (cell, 4) with the stiffness of cells that reach past a held face."""
        if not (grid.extent % 1.0).any():
            return constants
        filled = constants.copy()
        filled[:, :3] /= grid.inside_share(np.asarray(self.faces[:, 1].any(axis=1)))[:, None] ** 2
        return filled
