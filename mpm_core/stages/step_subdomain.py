"""The subdomain of a mine that a step changes: blocks of space around what it mines, held still at their border.

The effect of a month's mining reaches some widths. There its load is applied, increment by increment, and there rock
fails and cells are split, at the cost of that rock; what is beyond stays as it is. Then the whole mine reaches
equilibrium, with the border free again, and what it lets fail then fails as ever: so the whole has the last word on
equilibrium and on failure, and the subdomain, like one around failed rock (equilibrium/subdomain.py), only determines
the path on which they are reached. The whole is set up at a step's start, and once more where cells were split.

What a patch of half-width a changes decays as (a / distance)^d. Rock near the border waits for
the whole. Where much of it waits the subdomain is too small, and the step goes on in the whole after that increment.
"""

import logging
from dataclasses import dataclass, replace

import numpy as np

from mpm_core.equilibrium.cascade import needs_whole_mine
from mpm_core.equilibrium.refinement import RINGS_SPLIT_AT_ONCE, RefinedCells
from mpm_core.equilibrium.scheme import SchemeWithSubdomains
from mpm_core.equilibrium.subdomain import Cubes, Surroundings
from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.distorted_cells import corner_offsets
from mpm_core.grid.edge_nodes import EdgeNodes
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.grid.octree import parents
from mpm_core.grid.splitting import split, with_leaves
from mpm_core.model.model import Model
from mpm_core.model.occupancy import FinestPieces, Unsupported
from mpm_core.model.state import State, copy_from_subdomain, copy_to_subdomain
from mpm_core.stages.step_cells import StepCells, brittle_of, make_scheme

BORDER_DISTANCE_FACTOR = {2: 8, 3: 2}
"""By dimension, the distance of the border from what is mined, over the distance that a failed patch of that size
needs. Rock that fails makes the patch wider."""
# The step goes on in the whole mine if more than this share of the failing rock is near the border.
MAX_NEAR_BORDER_SHARE = 0.05
MAX_SUBDOMAIN_SHARE = 0.5  # Above this share of the mine's cells a subdomain saves nothing.
MIN_MINE_CELLS = 50_000  # A mine of fewer cells has no subdomains.
MIN_FORCE_CHANGE_SHARE = 1e-9  # A node's force is unchanged if its change is below this share of the largest change.
MIN_BLOCK_HALVINGS = 3  # A block's edge is at least a finest cell's, doubled this many times.


@dataclass(frozen=True)
class Blocks:
    """The blocks of space of a subdomain: chosen (blocks along each axis) bool, of 2^halvings finest cells; within
    so many cubes (Cubes), margin, of their border rock does not fail."""

    chosen: np.ndarray
    halvings: int
    margin: int = 0

    def hold(self, places: np.ndarray) -> np.ndarray:
        """(k,) bool: True where they hold a place (k, d), fine units."""
        return self.chosen[tuple((places >> self.halvings).T)]

    def of(self, grid: MultiLevelGrid) -> MultiLevelGrid:
        """A grid's cells in them, as a grid of their own, in the same units and of fewer levels."""
        inside = self.hold(grid.cell_index)
        fewer = grid.levels - 1 - self.halvings
        return with_leaves(
            replace(grid, levels=self.halvings + 1), grid.cell_index[inside], grid.cell_level[inside] - np.int8(fewer)
        )


def blocks_around(grid: MultiLevelGrid, changed: np.ndarray) -> Blocks:
    """Blocks with a border far enough from changed cells (k,), indices; they cut no cell of the grid."""
    cubes = Cubes(grid)
    places, _, patch, reach = cubes.patches(grid.cell_index[changed])
    far = (BORDER_DISTANCE_FACTOR[grid.dimension] * reach)[patch]
    for halvings in range(min(max(MIN_BLOCK_HALVINGS, cubes.halvings), grid.levels - 1), grid.levels):
        chosen = np.zeros(grid.shape >> halvings, bool)
        size = halvings - cubes.halvings
        for place, most in zip(places + cubes.lower, far, strict=True):
            low, high = np.maximum(place - most, 0) >> size, (place + most >> size) + 1
            chosen[tuple(slice(first, end) for first, end in zip(low, high, strict=True))] = True
        if not _cuts_cells(grid, chosen, halvings):
            break
    return Blocks(chosen, halvings, int(far.min() // 2))


def _cuts_cells(grid: MultiLevelGrid, chosen: np.ndarray, halvings: int) -> bool:
    """True if a chosen block, of 2^halvings finest cells, is a part of a larger cell."""
    for larger in range(halvings + 1, grid.levels):
        chosen = parents(chosen)
        cells = grid.cell_index[grid.cell_level == grid.levels - 1 - larger]
        if chosen[tuple((cells >> larger).T)].any():
            return True
    return False


class StepSubdomain:
    """A step in its subdomain. cells: what it has there; waits: whether much rock near the border stands above its
    strength, or no more cells may be: then the step goes on in the whole mine."""

    def __init__(self, whole: StepCells, blocks: Blocks):
        model, state, ramp = whole.model, whole.scheme.body.state, whole.ramp
        inside = blocks.hold(model.grid.cell_index)
        ground = replace(
            whole.ground,
            pieces=_inside(whole.ground.pieces, blocks),
            edge_nodes=_moved_as_in(model.grid, whole.ground.edge_nodes, blocks),
        )
        self.whole, self.blocks, self.waits = whole, blocks, False
        own = ground.model(
            blocks.of(model.grid), model.body[inside], _unsupported_inside(model.unsupported, inside), True
        )
        places = _places(model, own, inside)
        whole.scheme.drop_work_arrays()  # the memory is needed; it is set up again in the end
        at_start = own.virgin_state()
        copy_to_subdomain(state, at_start, places)
        volume = own.volumes(whole.step)
        self.share = len(own.cell_nodes) / len(model.cell_nodes)
        self.cells = StepCells(
            ground, make_scheme(own, at_start, volume), brittle_of(own, volume, whole.step),
            replace(ramp, start=ramp.start[places["node"]], target=ramp.target[places["node"]]), whole.step,
            at_start.displacement.copy(), whole.held_up[places["node"]], RefinedCells.of(own.grid),
            elsewhere=len(model.cell_nodes) - len(own.cell_nodes),
        )  # fmt: skip
        cubes = Cubes(own.grid)
        self.surroundings = Surroundings(cubes, cubes.present, np.arange(cubes.cells))

    def far_from_border(self, fresh: np.ndarray) -> np.ndarray:
        """Particles (k,) of the subdomain that do not lie near its border."""
        model, state = self.cells.model, self.cells.scheme.body.state
        near = self.surroundings.reach_beyond(model.grid.cell_index[model.particles.cell[fresh]], self.blocks.margin)
        failed = np.count_nonzero(state.failed == self.cells.step) + len(fresh)
        self.waits = self.cells.full or bool(np.count_nonzero(near) > MAX_NEAR_BORDER_SHARE * failed)
        return fresh[~near]

    def write_back(self) -> None:
        """Take over into the whole mine what has happened in the subdomain, which is in equilibrium."""
        own, whole = self.cells, self.whole
        own.scheme.body.commit()
        own.scheme.drop_work_arrays()
        if own.places:
            grid = split(whole.model.grid, np.concatenate(own.places), RINGS_SPLIT_AT_ONCE, 1)
            whole.onto(grid, lambda model: ~self.blocks.hold(model.grid.cell_index))
        else:
            whole.renew()
        fallen = own.fallen
        if own.falls:
            inside = np.flatnonzero(self.blocks.hold(whole.model.grid.cell_index))
            fallen = replace(fallen, cell=inside[fallen.cell].astype(np.int32))
            whole.without(fallen, lambda model: ~self.blocks.hold(model.grid.cell_index))
        inside = self.blocks.hold(whole.model.grid.cell_index)
        assert isinstance(whole.scheme, SchemeWithSubdomains)  # checked by step_subdomain_of
        whole.scheme.take_over(_Excerpt(own.scheme.body.state, _places(whole.model, own.model, inside)))


@dataclass(frozen=True)
class _Excerpt:
    """The state of a subdomain as the whole mine takes it over; places: see `_places`."""

    state: State
    places: dict[str, np.ndarray]

    @property
    def cells(self) -> np.ndarray:
        """Indices (k,) of the cells in the whole mine."""
        return self.places["cell"]

    def write_back(self, state: State) -> None:
        """Write it into the state of the whole mine."""
        copy_from_subdomain(self.state, state, self.places)


def step_subdomain_of(whole: StepCells) -> StepSubdomain | None:
    """The subdomain of a step that has begun, in equilibrium; None where the whole mine is the better place for it.

    That is where it is small or the step changes much of it, for a scheme without subdomains, where all of the mine is
    needed (the last state in equilibrium, the weakest rock), and where loads or strains act on what may be beyond.
    """
    model, scene = whole.model, whole.ground.scene
    divisible = isinstance(whole.scheme, SchemeWithSubdomains) and not needs_whole_mine(scene.solver)
    if not divisible or scene.loads or scene.strains or whole.step == 0 or len(model.cell_nodes) < MIN_MINE_CELLS:
        return None
    change = np.abs(whole.ramp.target - whole.ramp.start).max(axis=1)
    nodes = change > MIN_FORCE_CHANGE_SHARE * change.max(initial=0.0)
    if not nodes.any():
        return None
    changed = np.flatnonzero(nodes[model.cell_nodes].any(axis=1))
    blocks = blocks_around(model.grid, changed)
    share = np.count_nonzero(blocks.hold(model.grid.cell_index)) / len(model.cell_nodes)
    if share > MAX_SUBDOMAIN_SHARE:
        return None
    cells = len(model.cell_nodes)
    logging.info("the step begins in the subdomain that it changes: %.0f %% of %d cells", 100 * share, cells)
    return StepSubdomain(whole, blocks)


def _inside(parts: FinestPieces, blocks: Blocks) -> FinestPieces:
    """Parts of finest cells that the blocks hold."""
    chosen = blocks.hold(parts.place)
    return FinestPieces(**{name: column[chosen] for name, column in vars(parts).items()})


def _moved_as_in(grid: MultiLevelGrid, nodes: EdgeNodes, blocks: Blocks) -> EdgeNodes:
    """Edge nodes but for those around which the grid has coarser cells outside the blocks: it does not move them."""
    if not len(nodes.place):
        return nodes
    around = (nodes.place[:, None, :] - corner_offsets(grid.dimension)).reshape(-1, grid.dimension)
    finest = grid.cell_level[holding_cells(grid, around)] == grid.levels - 1
    return nodes.of((finest | blocks.hold(around)).reshape(len(nodes.place), -1).all(axis=1))


def _unsupported_inside(unsupported: Unsupported, inside: np.ndarray) -> Unsupported:
    """Rock and fill that have lost their support in some cells (cell,) bool, numbered among them."""
    chosen = inside[unsupported.cell]
    number = np.cumsum(inside) - 1
    return replace(unsupported.of(chosen), cell=number[unsupported.cell[chosen]].astype(np.int32))


def _places(whole: Model, own: Model, inside: np.ndarray) -> dict[str, np.ndarray]:
    """The cells, nodes and particles of the whole mine that the subdomain has, by dimension; inside (cell,) bool: its
    cells.

    Both are in Morton order, and particles in that of cells and excavations.
    """
    cells, particles = np.flatnonzero(inside), np.flatnonzero(inside[whole.particles.cell])
    if len(cells) != len(own.cell_nodes) or len(particles) != own.particles.count:
        raise RuntimeError("a subdomain has other cells than the mine that it is of")
    nodes = np.empty(len(own.grid.node_index), np.int64)
    nodes[own.cell_nodes] = whole.cell_nodes[cells]
    return {"cell": cells, "node": nodes, "particle": particles}
