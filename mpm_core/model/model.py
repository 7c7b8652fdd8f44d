"""A scene on its grid: everything that stays the same while equilibrium is sought; state.py has what does not."""

from dataclasses import dataclass, replace
from functools import cached_property
from types import ModuleType

import numpy as np

from common.errors import InputError
from mpm_core.constitutive.laws import can_fail, law_of_all, rows_of_all
from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.distorted_cells import DistortedCells, corner_offsets
from mpm_core.grid.mesh import BIT_ORDER, MultiLevelGrid
from mpm_core.grid.splitting import with_leaves
from mpm_core.kernels.block_scatter import Scatter, build_scatter
from mpm_core.kernels.nodal_operations import mark_cells, mark_corners
from mpm_core.model.edge_cells import EdgeKinds, kinds_at_cells
from mpm_core.model.occupancy import ALL_SAMPLES, NO_SAMPLES, Changes, Pieces, Unsupported, changes_of
from mpm_core.model.openings import Openings
from mpm_core.model.particles import (
    MASSIVE_BENDING_SHARE,
    Particles,
    at_step,
    part_means,
    seed,
    shares_of_volume,
    step_stiffness,
    volumes,
)
from mpm_core.model.phantom_nodes import NO_CELL, with_phantom_nodes, without_phantom_nodes
from mpm_core.model.rigid_motions import RigidMotions, free_motions
from mpm_core.model.state import State
from mpm_core.model.unsupported import find_unsupported
from mpm_core.model.variability import strength_scale
from mpm_core.scene.scene import FACES, Scene, virgin_stress


@dataclass(frozen=True)
class Model:
    """Grid, particles and material tables of a stage."""

    scene: Scene
    grid: MultiLevelGrid
    body: np.ndarray
    """(cell,) int16, index of the rock body, -1 host"""
    pieces: Pieces
    """of cells inside excavations, of all that the grid knows"""
    changes: Changes
    particles: Particles
    scatter: Scatter
    cell_nodes: np.ndarray
    """(cell, 2^d) int32, corners in bit order"""
    insitu: np.ndarray
    """(particle, 6) Pa, virgin stress; zero for fill, which starts without stress"""
    elastic_constants: np.ndarray
    """(row, 2) lambda, mu, Pa; rows are those of materials, and once more for each of edge_kinds"""
    law: ModuleType
    """of failure, of all rock (constitutive.laws); kernels are made for it"""
    intact_rows: np.ndarray
    residual_rows: np.ndarray
    """(row, column) strength rows of the law"""
    openings: Openings
    edge_kinds: EdgeKinds
    """of the sharp edges of openings"""
    held: np.ndarray
    """(node, d) bool: fixed or on a roller"""
    unsupported: Unsupported
    """what has fallen so far"""
    step: int
    """once it is mined the particles are where they are; -1 virgin rock"""
    plain: MultiLevelGrid
    """the grid with one node at each place; the same one if there are no phantom nodes"""
    severed: np.ndarray
    unheld: np.ndarray
    """see phantom_nodes.PhantomNodes"""

    @property
    def slopes(self) -> np.ndarray:
        """(point row, 2^d, d) slopes of the modes at each point of the particles' tables, or means over samples."""
        return self.particles.slopes

    @cached_property
    def hourglass_patterns(self) -> np.ndarray:
        """Modal sums of each hourglass pattern of the distorted cells: (k, 2^d - 1 - d, 2^d).

        In a cube they are the higher modes. In a distorted cell a uniform strain has a part in those, which is removed
        by the mean gradient of the whole cell (Flanagan and Belytschko 1981): whatever of it is mined, the patterns
        stay, and so do the forces that they have built up.
        """
        corners, distorted = 1 << self.dimension, self.particles.distorted
        bits = np.arange(corners)
        higher = np.flatnonzero(np.bitwise_count(bits) > 1)
        sign = (-1.0) ** np.bitwise_count(bits & ~bits[:, None])  # (corner, mode)
        position = np.einsum("cm,kcj->kmj", sign[:, higher], distorted.corners)
        whole = np.full(len(distorted.cell), ALL_SAMPLES)
        slopes = part_means(whole, distorted.cell, distorted, self.dimension)[1]
        linear = np.einsum("kmj,knj->kmn", position, slopes) * 2.0 / corners
        return np.ascontiguousarray((bits == higher[:, None]) - linear)  # else kernels are compiled for each layout

    @property
    def material(self) -> np.ndarray:
        """(particle,) index into the scene's materials; particles.material is one into the model's tables."""
        return self.particles.material % len(self.scene.materials)

    @cached_property
    def step_stiffness(self) -> np.ndarray:
        """(particle,) Pa: what bounds the time step of the explicit scheme, see particles.step_stiffness."""
        return step_stiffness(self.particles, self.elastic_constants, self.bending_share)

    @cached_property
    def strength_scale(self) -> np.ndarray:
        """(particle,) strength of intact rock over that of its material, or (0,) where none varies."""
        return strength_scale(self.scene, self.grid, self.particles, self.insitu, self.law, self.intact_rows)

    @cached_property
    def bending_share(self) -> np.ndarray:
        """(particle,) share of the stiffness at which a cell bends as a plate does: in skins of rock all of it, or its
        spread where the cell is cut."""
        faces = [(axis, side) for axis in range(self.dimension) for side in range(2)]
        free = [face for face in faces if face not in held_faces(self.scene)]
        cells = holding_cells(self.grid, self.openings.skins(self.step, self.grid.shape, free))
        skin = np.zeros(len(self.cell_nodes), bool)
        skin[cells[(cells >= 0) & (self.grid.cell_level[cells] == self.grid.levels - 1)]] = True
        return np.where(skin[self.particles.cell], self.particles.spread, MASSIVE_BENDING_SHARE)

    @cached_property
    def node_position(self) -> np.ndarray:
        """(node, d) m: where nodes are, those that lie on edges of openings, too."""
        return self.positions_of(slice(None))

    def positions_of(self, nodes: np.ndarray | slice) -> np.ndarray:
        """(k, d) m: where some nodes (k,) are, see node_position."""
        grid = self.grid
        return grid.origin + grid.node_index[nodes] * grid.fine_cell + self.node_shift[nodes] * grid.fine_cell

    @cached_property
    def node_shift(self) -> np.ndarray:
        """(node, d) in finest cells: from each node's place in the lattice to where it is."""
        distorted, shift = self.particles.distorted, np.zeros((len(self.grid.node_index), self.dimension))
        shift[self.cell_nodes[distorted.cell]] = distorted.corners - corner_offsets(self.dimension)
        return shift

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.grid.dimension

    @property
    def hanging(self) -> np.ndarray:
        """Nodes with parents."""
        return np.flatnonzero(self.grid.is_hanging).astype(np.int32)

    def at(self, step: int) -> "Model":
        """The model with particles where their material is once `step` is mined, and nodes of their own for walls that
        it has parted; itself unless `cut_cells` is mean."""
        if self.scene.cut_cells != "mean" or step == self.step:
            return self
        particles = at_step(self.particles, self.changes, step, self.grid)
        particles = with_edges(particles, self.openings, self.edge_kinds, self.grid, step, len(self.scene.materials))
        moved = np.flatnonzero((particles.position != self.particles.position).any(axis=1) & particles.is_rock)
        insitu = self.insitu.copy()
        insitu[moved] = virgin_stress(self.scene, particles.position[moved])
        changed = replace(self, particles=particles, insitu=insitu, step=step)
        phantom_nodes = with_phantom_nodes(self.plain, self.changes, step)
        if not (phantom_nodes.grid.phantoms or self.grid.phantoms):
            return changed
        return replace(changed, **phantom_nodes._asdict(), **_on_nodes(phantom_nodes.grid, self.scene))

    def stripped(self) -> "Model":
        """The model without virgin stress and sums over cells, which take much memory: what its cells and particles are
        is all that a model on other cells is made from."""
        return replace(
            self, insitu=self.insitu[:0].copy(), scatter=build_scatter(self.cell_nodes[:0], self.grid.node_parents[:0])
        )

    def material_volumes(self, step: int) -> np.ndarray:
        """Volume of each particle's own material once `step` is mined and filled, (particle,)."""
        return volumes(self.particles, self.changes, step)

    def volumes(self, step: int) -> np.ndarray:
        """Volume in which each particle bears stress once `step` is mined and filled, (particle,).

        It is that of its material, but for `cut_cells: mean`: fill that shares a cell with stiffer rock would share its
        strain, and hold failed rock, which dilates, like a jacket. It weighs, but bears nothing where a cell next to
        it is filled wholly. In an opening so narrow that none is, it bears its share.
        """
        volume = self.material_volumes(step)
        if self.scene.cut_cells == "mean" and not self.particles.is_rock.all():
            volume[self._is_jacket(step)] = 0.0
        return volume

    def _is_jacket(self, step: int) -> np.ndarray:
        """Fill (particle,) bool that shares its cell with stiffer rock, where a cell filled wholly was next to it
        when it was placed: fill that is placed or mined later does not unload it."""
        particles, cells = self.particles, len(self.cell_nodes)
        rock = self.changes.rock_samples(cells, step)
        shear = self.elastic_constants[particles.material, 1]
        of_rock = shear[particles.group_start[:cells]]  # the first groups are those of rock, one for each cell
        found = ~particles.is_rock & (rock != NO_SAMPLES)[particles.cell] & (shear < of_rock[particles.cell])
        placed = np.array([excavation.filled for excavation in self.scene.excavations])[particles.excavation]
        for first in np.unique(placed[found]):
            chosen = np.flatnonzero(found & (placed == first))
            found[chosen] = self._touching_filled(first)[particles.cell[chosen]]
        return found

    def _touching_filled(self, step: int) -> np.ndarray:
        """Cells (cell,) bool that share a node with one that is filled wholly once `step` is mined and filled."""
        cells = len(self.cell_nodes)
        rock, solid = self.changes.rock_samples(cells, step), self.changes.solid_samples(cells, step)
        filled = np.zeros(len(self.plain.node_index), bool)
        filled[self.plain.vtk_nodes[(rock == NO_SAMPLES) & (solid == ALL_SAMPLES)]] = True
        touching = np.empty(cells, bool)
        mark_cells(self.plain.vtk_nodes, filled, touching)
        return touching

    def unheld_fill(self, step: int) -> dict[str, int]:
        """Fill that does not hold the walls between which it lies once `step` is mined and filled: number of nodes at
        which it does not, by name of the excavation."""
        cells, place = np.unique(self.unheld, return_inverse=True)
        now, found = self.changes.until(step, owned_by_rock=False), {}
        now = now[np.isin(self.changes.cell[now], cells)]
        owner, changed = self.changes.owner[now], np.searchsorted(cells, self.changes.cell[now])
        for number in np.unique(owner):
            own = owner == number
            samples = np.zeros(len(cells), np.uint64)
            np.bitwise_xor.at(samples, changed[own], self.changes.samples[now[own]])
            at_node = (samples != NO_SAMPLES)[place.reshape(self.unheld.shape)] & (self.unheld != NO_CELL)
            if places := int(np.count_nonzero(at_node.any(axis=1))):
                found[self.scene.excavations[number].name] = places
        return found

    def rock_share(self, step: int) -> np.ndarray:
        """Share of each cell's volume that is rock once `step` is mined, (cell,)."""
        rock, distorted = self.changes.rock_samples(len(self.cell_nodes), step), self.particles.distorted
        share = np.bitwise_count(rock) / SAMPLES_PER_CELL
        share[distorted.cell] = shares_of_volume(distorted, np.arange(len(distorted.cell)), rock[distorted.cell])
        return share

    def can_fail(self) -> np.ndarray:
        """(particle,) bool: rock whose material can fail."""
        by_material = np.array([can_fail(material) for material in self.scene.materials.values()])
        return self.particles.is_rock & by_material[self.material]

    def is_brittle(self) -> bool:
        """True if some rock loses strength when it fails; if not, it is perfectly plastic."""
        return not np.array_equal(self.intact_rows, self.residual_rows, equal_nan=True)

    def virgin_state(self) -> State:
        """Nothing mined: all changes are zero. Position, cell: the model's own; a scheme that moves them copies."""
        return State.virgin(self.particles, len(self.grid.node_index), len(self.cell_nodes), self.dimension)

    def attached_nodes(self, volume: np.ndarray) -> np.ndarray:
        """Nodes (node,) bool that rock and fill of these volumes (particle,) move with: corners of their cells, and
        parents of those that hang."""
        attached = np.zeros(len(self.held), bool)
        mark_corners(self.cell_nodes, self.particles.cell, volume, attached)
        parents = self.grid.node_parents[self.hanging[attached[self.hanging]]]
        attached[parents[parents >= 0]] = True
        return attached

    def free_motions(self, attached: np.ndarray) -> RigidMotions:
        """Rigid motions that fixed and roller faces leave to what is attached to nodes (node,) bool."""
        nodes = np.flatnonzero(np.logical_or.reduce(self.held.T) & attached)  # rows are short: by column
        if not len(nodes):
            nodes = np.flatnonzero(attached)
        return free_motions(self.positions_of(nodes), self.held[nodes])


def held_faces(scene: Scene) -> dict[tuple[int, int], list[int]]:
    """Components that fixed and roller faces of the domain hold, by axis and side, in the computation's axes."""
    held = {}
    for axis in range(len(scene.axes)):
        for side, name in enumerate(FACES[2 * scene.axes[axis] :][:2]):
            condition = scene.boundary.get(name)
            if condition in ("fixed", "roller"):
                held[axis, side] = [axis] if condition == "roller" else list(range(len(scene.axes)))
    return held


def _held(grid: MultiLevelGrid, scene: Scene) -> np.ndarray:
    held = np.zeros((len(grid.node_index), grid.dimension), bool)
    for (axis, side), components in held_faces(scene).items():
        held[np.ix_(grid.boundary_nodes(axis, side), np.array(components))] = True
    held[grid.border_nodes()] = True
    return held


def _on_nodes(grid: MultiLevelGrid, scene: Scene) -> dict:
    """The attributes of a model that depend on the nodes of a grid, by name."""
    cell_nodes = grid.vtk_nodes.take(BIT_ORDER[grid.dimension], axis=1)
    return {
        "cell_nodes": cell_nodes,
        "scatter": build_scatter(cell_nodes, grid.node_parents),
        "held": _held(grid, scene),
    }


def with_edges(
    particles: Particles, openings: Openings, kinds: EdgeKinds, grid: MultiLevelGrid, step: int, materials: int
) -> Particles:
    """These particles with rock next to the edges of a step in the rows of their kind (edge_factor.py)."""
    row = particles.material % materials
    if materials * (1 + len(kinds.code)) > (most := np.iinfo(row.dtype).max):
        raise InputError(
            f"materials: {materials} of them, at {len(kinds.code)} kinds of edges of excavations, are more than {most} "
            "kinds of rock: give fewer values of block_model.properties, or grid.cut_cells: whole"
        )
    number = kinds_at_cells(openings.edge_points(step), grid, particles.distorted, kinds)[particles.cell]
    row[particles.is_rock] += ((1 + number) * materials).astype(row.dtype)[particles.is_rock]
    return replace(particles, material=row)


def build_model(
    scene: Scene,
    grid: MultiLevelGrid,
    body: np.ndarray,
    pieces: Pieces,
    unsupported: Unsupported | None = None,
    all_fallen: bool = False,
    distorted: DistortedCells | None = None,
    at: int | None = None,
    openings: Openings | None = None,
) -> Model:
    """Seed the particles of a stage and tabulate what the kernels need. `pieces` as stored with the grid.

    distorted: cells that are no cubes; at: the step of which particles are where they are, the last one without it.
    openings: at whose edges and between which rock has another stiffness.
    unsupported: what has fallen in the steps before; what loses its support in the last step of the scene falls here,
    unless all_fallen says that it is among them.
    """
    step = len(scene.steps) - 1
    unsupported = unsupported or Unsupported.none()
    changes = changes_of(pieces, scene.excavations, unsupported)
    if not all_fallen:
        fallen = find_unsupported(grid, changes.solid_samples(len(grid.cell_level), step), held_faces(scene), step)
        unsupported = unsupported.and_then(fallen)
        if len(fallen.cell):
            changes = changes_of(pieces, scene.excavations, unsupported)
    particles = seed(grid, body, changes, scene, pieces, distorted or DistortedCells.none(grid.dimension))
    if grid.phantoms:  # of the step before
        grid = with_leaves(grid, grid.cell_index, grid.cell_level)
    phantom_nodes = without_phantom_nodes(grid)
    at = step if at is None else at
    openings = openings or Openings.none(grid.dimension)
    kinds = EdgeKinds.of(openings.points)
    if scene.cut_cells == "mean":
        particles = at_step(particles, changes, at, grid)
        particles = with_edges(particles, openings, kinds, grid, at, len(scene.materials))
        phantom_nodes = with_phantom_nodes(grid, changes, at)
        nodes, parted = len(grid.node_index), phantom_nodes.grid  # which begins with the nodes that it parts
        if parted is not grid:
            grid = replace(grid, node_index=parted.node_index[:nodes], node_parents=parted.node_parents[:nodes])
    insitu = virgin_stress(scene, particles.position)
    insitu[~particles.is_rock] = 0.0
    materials = list(scene.materials.values())
    law = law_of_all(materials)
    intact_rows, residual_rows = rows_of_all(law, materials * (1 + len(kinds.code)), scene.frame_axes)
    constants = np.array([(material.lame_lambda, material.shear_modulus) for material in materials])
    factors = kinds.factors([material.poisson_ratio for material in materials])
    return Model(
        scene=scene,
        body=body,
        pieces=pieces,
        changes=changes,
        particles=particles,
        insitu=insitu,
        elastic_constants=np.concatenate([constants, *(constants * row[:, None] for row in factors)]),
        openings=openings,
        edge_kinds=kinds,
        law=law,
        intact_rows=intact_rows,
        residual_rows=residual_rows,
        unsupported=unsupported,
        step=at,
        plain=grid,
        **phantom_nodes._asdict(),
        **_on_nodes(phantom_nodes.grid, scene),
    )
