"""Rock and fill as every scheme finds them: stress from motion, forces from stress, and plastic flow so far.

A scheme moves the nodes of a body until its forces balance (explicit_scheme.py, multigrid_scheme.py). The body computes
what follows: stress by the law of its rock, the unbalanced force, the energy along the path.

The time step. For a cell of edge h the largest frequency is that of its dilation: K_e's largest eigenvalue over the
mass at a corner is 4 (d lambda + 2 mu) / (rho h^2), in d dimensions. No frequency of the assembly exceeds the largest
of its parts (Irons and Treharne 1971), and lumping the mass of hanging nodes onto their parents only lowers it, so
dt = 2 / omega = h sqrt(rho / (d lambda + 2 mu)) is stable without damping. A lone sample of a cut cell ("subdivide") is
off its centre, where a corner takes little of its mass: there 1 - xi^2 of the squared limit is left; a particle that
stands for some of a cell's samples ("mean") has a limit of its own (particles.step_stiffness). Local damping c
adds up to c |f| to a restoring force: a mode at the limit then grows unless dt <= 2 / (omega sqrt(1 + c)). With density
scaling rho is chosen so that the limit is the same everywhere: all cells then reach equilibrium in about the same
number of steps. Weights are not touched by it.

Flow. On its way to equilibrium the model swings past it, a cell that has just failed most of all. Were failed rock to
flow with every step, the strain of each swing would stay, and rock would reach equilibrium well below its residual
strength, however short the time step. So what has flowed since a state near equilibrium is undone before each step, and
all strain since then gets one return to the surface (backward Euler): only what lies between states near equilibrium
counts. Those are the ends of increments and generations (`commit`).
"""

from functools import cached_property

import numpy as np

from mpm_core.equilibrium.convergence import NoEquilibrium
from mpm_core.equilibrium.energy_balance import EnergyPath, count_flow
from mpm_core.equilibrium.falls import loose_rock
from mpm_core.kernels.nodal_operations import (
    advance_nodes,
    collect_to_parents,
    largest_difference,
    particle_masses,
    spread_to_hanging,
)
from mpm_core.kernels.stress_update import make_update, record_flow_start, undo_flow
from mpm_core.model.model import Model
from mpm_core.model.particles import bending_stiffness
from mpm_core.model.state import State, restore

TIME_STEP_SHARE = 0.98  # The time step is this share of the damped limit, which is 1 / sqrt(1 + c) of the undamped one.
# Failed rock keeps this share of the intact hourglass stiffness. More of it would hold failed rock up.
FAILED_HOURGLASS_SHARE = 0.01


class Body:
    """A model's particles and nodes on their way to equilibrium.

    `model` and the arrays of `state` are the caller's, the latter changed in place; work arrays are the body's own. A
    velocity of zeros may be another array than before.
    volume (particle,) m3; failed (particle,) bool; flowing (k,): failed particles that are there; attached (node,)
    bool, see Model.attached_nodes; moves (node, d) bool: of these what is not held;
    hourglass (cell,) N/m: stiffness of each cell now, intact_hourglass: of intact rock; free: rigid motions that
    nothing holds; unbalanced (node, d) N: forces at free nodes when last computed; start (node, d) m: where
    displacement is counted from in the check for a run away; rest (node, d) m: displacement in the last equilibrium of
    the whole mine.
    """

    energy_path: EnergyPath
    flowing: np.ndarray

    def __init__(self, model: Model, state: State, volume: np.ndarray):
        self.model = model
        self.state = state
        self.hanging = model.hanging
        self.start = self.rest = state.displacement.copy()
        self.unbalanced = np.zeros_like(state.displacement)
        self.restart_flow_count()
        self.slot_force = np.zeros((model.scatter.slots, model.dimension))
        self.set_volume(volume)

    @property
    def time_step_share(self) -> float:
        """Time step over the limit without damping."""
        return TIME_STEP_SHARE / np.sqrt(1.0 + self.model.scene.solver.damping)

    @cached_property
    def time_step(self) -> float:
        """Stable time step with damping, s."""
        return self.time_step_share * density_and_limit(self.model, self.volume)[1]

    @cached_property
    def mass(self) -> np.ndarray:
        """Mass at each node, (node,) kg."""
        return nodal_mass(self.model, density_and_limit(self.model, self.volume)[0] * self.volume)

    def set_volume(self, volume: np.ndarray) -> None:
        """Take over changed particle volumes: the nodes that move, mass, time step and hourglass stiffness follow."""
        for known in ("mass", "time_step"):
            vars(self).pop(known, None)
        model, particles = self.model, self.model.particles
        self.volume = volume
        self.pattern_row = particles.distorted.rows(np.arange(len(model.cell_nodes)))
        lame, shear = model.elastic_constants[particles.material].T
        size = model.grid.cell_size[particles.cell]
        self.attached = model.attached_nodes(volume)
        self.moves = self.attached[:, None] & ~model.held
        self.free = model.free_motions(self.attached)
        # stiffness that an intact particle gives its cell, N/m; 0 where it has company
        alone = np.repeat(np.diff(particles.group_start) == 1, np.diff(particles.group_start))
        hourglass = model.bending_share * bending_stiffness(lame, shear) * volume / size**2
        self.particle_hourglass = np.where(alone, hourglass, 0.0)
        self.intact_hourglass = np.bincount(particles.cell, self.particle_hourglass, minlength=len(model.cell_nodes))
        self.set_failed()

    def set_failed(self) -> None:
        """Take over which particles have failed."""
        self.failed = self.state.failed >= 0
        self.commit()
        cell = self.model.particles.cell[self.flowing]
        self.hourglass = self.intact_hourglass.copy()
        np.subtract.at(self.hourglass, cell, (1.0 - FAILED_HOURGLASS_SHARE) * self.particle_hourglass[self.flowing])

    def commit(self, in_equilibrium: bool = True) -> None:
        """Make the flow so far permanent; from here on flow is counted from zero."""
        state = self.state
        self.energy_path.end(self, count_flow(self), in_equilibrium)
        self.flowing = np.flatnonzero(self.failed & (self.volume > 0.0))
        count = len(self.flowing)
        self.flow_start = np.empty((count, 6)), np.empty((count, 6))
        record_flow_start(self.flowing, state.stress, state.later_strain, *self.flow_start)

    def go_back(self, snapshot: dict[str, np.ndarray]) -> None:
        """Return to a committed state kept earlier (state.snapshot); what has flowed since then is forgotten."""
        restore(snapshot, self.state)
        self.restart_flow_count()
        self.set_failed()

    def restart_flow_count(self) -> None:
        """Count flow from the present state on: nothing has flowed on the path to it."""
        self.flowing = np.empty(0, np.int64)
        self.flow_start = (np.empty((0, 6)), np.empty((0, 6)))
        self.energy_path = EnergyPath()

    def undo_flow(self) -> None:
        """Stress of failed rock as if it had not flowed since `commit`."""
        model, state = self.model, self.state
        undo_flow(
            self.flowing,
            self.flow_start[1],
            model.particles.material,
            model.elastic_constants,
            state.stress,
            state.later_strain,
        )

    def update(self, time_step: float, blocks: np.ndarray | None = None) -> None:
        """Advance stress by time_step of nodal velocity, and its forces; in chosen blocks of cells, or in all."""
        model, particles, state, scatter = self.model, self.model.particles, self.state, self.model.scatter
        self.undo_flow()
        make_update(model.law, model.dimension)(
            scatter.blocks if blocks is None else blocks,
            scatter.block_start,
            scatter.slot_start,
            model.cell_nodes,
            scatter.cell_slots,
            model.grid.cell_size,
            particles.cell_groups_start,
            particles.cell_groups,
            particles.group_start,
            particles.group_table,
            model.slopes,
            time_step,
            state.velocity,
            self.volume,
            particles.material,
            model.elastic_constants,
            model.residual_rows,
            self.failed,
            model.insitu,
            self.hourglass,
            self.pattern_row,
            model.hourglass_patterns,
            state.stress,
            state.later_strain,
            state.hourglass_force,
            self.slot_force,
        )

    def advance(self, external: np.ndarray, time_step: float) -> None:
        """Unbalanced force under external forces (node, d) N; velocity and displacement advance by time_step of it."""
        model, state, scatter = self.model, self.state, self.model.scatter
        advance_nodes(
            scatter.free_nodes,
            scatter.sum_start,
            scatter.sum_slots,
            scatter.sum_weights,
            self.slot_force,
            external,
            self.mass if time_step else np.empty(0),
            self.moves,
            model.scene.solver.damping,
            time_step,
            state.velocity,
            state.displacement,
            self.unbalanced,
        )
        spread_to_hanging(self.hanging, model.grid.node_parents, state.velocity)

    def internal_force(self) -> np.ndarray:
        """Forces -B^T sigma V of the present stress at free nodes, (node, d) N; nothing moves."""
        self.update(0.0)
        self.advance(np.zeros_like(self.unbalanced), 0.0)
        return self.unbalanced.copy()

    def displace(self, motion: np.ndarray) -> None:
        """Move the nodes by motion (node, d) m, held ones too, in one stress update; hanging nodes follow parents.

        Motions of nodes so given are no run away: `check_reach` counts from here.
        """
        model, state = self.model, self.state
        kept = state.velocity.copy()
        state.velocity[:] = motion  # times 1 s it is the motion: the kernel takes a velocity
        spread_to_hanging(self.hanging, model.grid.node_parents, state.velocity)
        state.displacement += state.velocity
        self.start, self.rest = self.start + state.velocity, self.rest + state.velocity
        self.update(1.0)
        state.velocity[:] = kept

    def deform(self, strain: np.ndarray) -> None:
        """Strain the whole mesh homogeneously by strain (d, d), from the lower corner of the domain.

        Where the boundary is held this is its motion; elsewhere a first guess, exact for a homogeneous specimen.
        """
        self.update(0.0)
        self.energy_path.strain(self)
        position = self.model.node_position - self.model.grid.origin
        self.displace(np.sum(position[:, None, :] * strain, axis=2))

    def remove_rigid_motions(self) -> None:
        """Remove the rigid motions that nothing holds from the displacement: the body is in equilibrium."""
        if self.free.count:
            self.free.remove_from(self.state.displacement, self.model.node_position, self.mass)
        spread_to_hanging(self.hanging, self.model.grid.node_parents, self.state.displacement)

    def stop_drift(self) -> None:
        """Remove free rigid motions from the velocity: damping by component pushes a body along what nothing holds."""
        if self.free.count:
            self.free.remove_from(self.state.velocity, self.model.node_position, self.mass)

    def check_reach(self, ratio: float) -> None:
        """Raise NoEquilibrium if a node has moved farther than a finest cell; ratio: the unbalanced force left."""
        reach = largest_difference(self.state.displacement, self.start)
        if reach > self.model.grid.fine_cell:
            raise NoEquilibrium(
                f"rock moved {reach:.3g} m in this stage, more than a finest cell: it runs away (unbalanced ratio "
                f"{ratio:.2g}); fill the excavation, raise residual strength, or mine it in more steps",
                loose_rock(self),
            )

    def drop_work_arrays(self) -> None:
        """Free the work arrays; no relaxation follows."""
        self.slot_force = np.empty((0, self.model.dimension))


def density_and_limit(model: Model, volume: np.ndarray) -> tuple[np.ndarray, float]:
    """Density (particle,) kg/m3 that time stepping works with, and the longest time step without damping, s."""
    particles, stiffness = model.particles, model.step_stiffness
    size = model.grid.cell_size[particles.cell]
    if model.scene.solver.density_scaling:
        return stiffness / size**2, 1.0  # the limit is 1 s everywhere
    present = volume > 0.0
    density = np.array([m.density for m in model.scene.materials.values()])[model.material]
    return density, float((size * np.sqrt(density / stiffness))[present].min()) if present.any() else 1.0


def nodal_mass(model: Model, mass: np.ndarray) -> np.ndarray:
    """Masses of particles (particle,) kg at nodes by shape functions; hanging nodes hand theirs on (paper, Eq. 1)."""
    nodal = np.zeros((len(model.grid.node_index), 1))
    particles = model.particles
    particle_masses(
        model.cell_nodes, particles.cell, particles.row, particles.modes, model.dimension, mass, nodal[:, 0]
    )
    collect_to_parents(model.grid.node_parents, nodal)
    return nodal[:, 0]
