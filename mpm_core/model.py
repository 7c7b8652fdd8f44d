"""A scene on its grid: everything that stays the same while equilibrium is sought; state.py has what does not."""

from dataclasses import dataclass

import numpy as np

from mpm_core.constitutive.strength import elastic_row, strength_row
from mpm_core.grid.mesh import BIT_ORDER, MultiLevelGrid
from mpm_core.kernels.blocks import Scatter, build_scatter
from mpm_core.loose import find_loose
from mpm_core.occupancy import SAMPLES, Changes, Loose, Pieces, changes_of
from mpm_core.particles import Particles, seed, volumes
from mpm_core.rigid import RigidMotions, free_motions
from mpm_core.scene import FACES, Material, Scene
from mpm_core.state import State
from mpm_core.virgin import virgin_stress


def _strength_rows(material: Material) -> tuple[np.ndarray, np.ndarray]:
    if material.intact is None:
        return elastic_row(), elastic_row()
    rows = [
        strength_row(s.friction_angle, s.dilation_angle, s.cohesion, s.tension_cutoff)
        for s in (material.intact, material.residual)
    ]
    return rows[0], rows[1]


@dataclass(frozen=True)
class Model:
    """Grid, particles and material tables of a stage."""

    scene: Scene
    grid: MultiLevelGrid
    changes: Changes
    particles: Particles
    scatter: Scatter
    cell_nodes: np.ndarray
    """(cell, 2^d) int32, corners in bit order"""
    mode_values: np.ndarray
    """(point row, 2^d) value of each mode at each point of the particles' tables"""
    insitu: np.ndarray
    """(particle, 6) Pa, virgin stress; zero for fill, which starts without stress"""
    elastic_constants: np.ndarray
    """(material, 2) lambda, mu, Pa"""
    intact_rows: np.ndarray
    residual_rows: np.ndarray
    """(material, column) strength rows of constitutive.strength"""
    held: np.ndarray
    """(node, d) bool: fixed or on a roller"""
    loose: Loose
    """what has fallen so far"""

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.grid.dimension

    @property
    def hanging(self) -> np.ndarray:
        """Nodes with parents."""
        return np.flatnonzero(self.grid.is_hanging).astype(np.int32)

    def volumes(self, step: int) -> np.ndarray:
        """Volume of each particle once `step` is mined and filled, (particle,)."""
        return volumes(self.particles, self.changes, step)

    def rock_share(self, step: int) -> np.ndarray:
        """Share of each cell that is rock once `step` is mined, (cell,)."""
        return np.bitwise_count(self.changes.rock_samples(len(self.cell_nodes), step)) / SAMPLES

    def is_coulomb(self) -> np.ndarray:
        """(particle,) bool: rock whose material can fail."""
        can_fail = np.array([material.intact is not None for material in self.scene.materials.values()])
        return self.particles.is_rock & can_fail[self.particles.material]

    def virgin_state(self) -> State:
        """Nothing mined: all changes are zero. Position, cell: the model's own; a scheme that moves them copies."""
        return State.virgin(self.particles, len(self.grid.node_index), len(self.cell_nodes), self.dimension)

    def free_motions(self, volume: np.ndarray) -> RigidMotions:
        """Rigid motions that fixed and roller faces leave to rock and fill of these volumes (particle,)."""
        present = np.zeros(len(self.cell_nodes), bool)
        present[self.particles.cell[volume > 0.0]] = True
        touched = present[:, None] & self.held.any(axis=1)[self.cell_nodes]
        nodes = np.unique(self.cell_nodes[touched])
        if not len(nodes):
            nodes = np.unique(self.cell_nodes[present])
        return free_motions(self.grid.node_position[nodes], self.held[nodes])


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
        held[np.ix_(grid.boundary_nodes(axis, side), components)] = True
    return held


def build_model(
    scene: Scene, grid: MultiLevelGrid, body: np.ndarray, pieces: Pieces, loose: Loose | None = None
) -> Model:
    """Seed the particles of a stage and tabulate what the kernels need. `pieces` as stored with the grid.

    loose: what has fallen in the steps before. What comes loose in the last step of the scene falls here.
    """
    step = len(scene.steps) - 1
    changes = changes_of(pieces, scene.excavations, loose or Loose.none())
    fallen = find_loose(grid, changes.solid_samples(len(grid.cell_level), step), held_faces(scene), step)
    loose = (loose or Loose.none()).and_then(fallen)
    if len(fallen.cell):
        changes = changes_of(pieces, scene.excavations, loose)
    particles = seed(grid, body, changes, scene, pieces)
    cell_nodes = np.ascontiguousarray(grid.vtk_nodes[:, BIT_ORDER[grid.dimension]])
    modes = range(1 << grid.dimension)
    mode_values = np.stack(
        [np.prod([particles.points[:, k] ** ((m >> k) & 1) for k in range(grid.dimension)], axis=0) for m in modes],
        axis=1,
    )
    insitu = virgin_stress(scene, particles.position)
    insitu[~particles.is_rock] = 0.0
    materials = scene.materials.values()
    rows = [_strength_rows(material) for material in materials]
    return Model(
        scene=scene,
        grid=grid,
        changes=changes,
        particles=particles,
        scatter=build_scatter(cell_nodes, grid.node_parents),
        cell_nodes=cell_nodes,
        mode_values=np.ascontiguousarray(mode_values),
        insitu=insitu,
        elastic_constants=np.array([(material.lame_lambda, material.shear_modulus) for material in materials]),
        intact_rows=np.array([intact for intact, _ in rows]),
        residual_rows=np.array([residual for _, residual in rows]),
        held=_held(grid, scene),
        loose=loose,
    )
