"""Scheme `explicit`: damped symplectic time stepping to rest (paper section 2.2, Eqs 1 to 6 with the errata).

Particles rest in their cells, so nodes keep their velocity from step to step: the grid is never reset, and the particle
velocities of Eqs (1) and (5), which would only filter it, are not needed. moving.py is the full cycle.

The time step. For a cell of edge h the largest frequency is that of its dilation: K_e's largest eigenvalue over the
mass at a corner is 4 (d lambda + 2 mu) / (rho h^2), in d dimensions. No frequency of the assembly exceeds the largest
of its parts (Irons and Treharne 1971), and lumping the mass of hanging nodes onto their parents only lowers it, so
dt = 2 / omega = h sqrt(rho / (d lambda + 2 mu)) is stable without damping. A lone sample of a cut cell ("subdivide") is
off its centre, where a corner takes little of its mass: there 1 - xi^2 of the squared limit is left. Local damping c
adds up to c |f| to a restoring force: a mode at the limit then grows unless dt <= 2 / (omega sqrt(1 + c)). With density
scaling rho is chosen so that the limit is the same everywhere: all cells then reach rest in about the same number of
steps. Weights are not touched by it.

Flow. On its way to rest the model swings past it, a cell that has just failed most of all. Were failed rock to flow
with every step, the strain of each swing would stay: a single cell under 10 MPa came to rest 13 to 36 % below its
residual strength, however short the time step. So what has flowed since a state near rest is taken back before each
step, and all strain since then gets one return to the surface (backward Euler): only what lies between states near rest
counts. Those are the ends of increments and generations and, where a relaxation does not end, every FLOW_FROM
iterations: it lets non-associated flow settle that would else circle (a tunnel did, at an unbalanced force of 3e-4).
No sooner: what flows by parts, on a way that is none of the rock's, is another flow. With every 200 iterations the
demo's history dissipated 1.5 % less than with one return (and than scheme `multigrid`), and 0.5 % more rock failed.
"""

import numpy as np

from mpm_core.equilibrium.brittle import Brittle
from mpm_core.equilibrium.convergence import History, NoRest
from mpm_core.equilibrium.energy import Way, count_flow
from mpm_core.kernels.flow import note_flow_start, take_back_flow
from mpm_core.kernels.nodes import (
    advance_nodes,
    collect_to_parents,
    largest_difference,
    particle_masses,
    sizes,
    spread_to_hanging,
)
from mpm_core.kernels.resting import make_update
from mpm_core.model import Model, State

CHECK_EVERY = 20  # iterations between two looks at the unbalanced force
TIME_STEP_SHARE = 0.98  # of the damped limit, 1 / sqrt(1 + c) of the undamped one
FLOW_FROM = 2000  # iterations; a relaxation that ends takes up to 1,200 (the demo, to 3e-5)
FAILED_HOURGLASS = 0.01  # of the intact hourglass stiffness: a stiff one props failed rock up, as eight particles do.
# Closure of a stope in cells of 4, 2, 1 m: 11.3, 13.7, 13.5 mm; at 0.1 8.4, 11.6, 12.3; eight particles 6.5, 9.9, 12.0


class ExplicitScheme:
    """Relaxes a state towards equilibrium under given external forces.

    The scheme owns work arrays; `model` and the arrays of `state` are the caller's, the latter changed in place.
    """

    def __init__(self, model: Model, state: State, volume: np.ndarray):
        self.model = model
        self.state = state
        self.hanging = model.hanging
        self.start = state.displacement.copy()
        self.unbalanced = np.zeros_like(state.displacement)
        self._count_flow_anew()
        self.slot_force = np.zeros((model.scatter.slots, model.dimension))
        self.set_volume(volume)

    @property
    def time_step_share(self) -> float:
        """Time step over the limit without damping."""
        return TIME_STEP_SHARE / np.sqrt(1.0 + self.model.scene.solver.damping)

    def set_volume(self, volume: np.ndarray) -> None:
        """Take over changed particle volumes: mass, time step and hourglass stiffness follow."""
        model, particles = self.model, self.model.particles
        self.volume = volume
        lame, shear = model.elastic_constants[particles.material].T
        stiffness = model.dimension * lame + 2.0 * shear
        lone = particles.sample >= 0
        stiffness[lone] /= 1.0 - np.abs(particles.xi[lone]).max(axis=1, initial=0.0) ** 2
        size = model.grid.cell_size[particles.cell]
        present = volume > 0.0
        if model.scene.solver.density_scaling:
            density = stiffness / size**2  # the limit is 1 s everywhere
            limit = 1.0
        else:
            density = np.array([m.density for m in model.scene.materials.values()])[particles.material]
            limit = float((size * np.sqrt(density / stiffness))[present].min()) if present.any() else 1.0
        self.time_step = self.time_step_share * limit
        self.density = density
        self.particle_mass = density * volume
        self.mass = nodal_mass(model, self.particle_mass)
        self.free = model.free_motions(volume)
        # stiffness that an intact particle gives its cell, N/m; 0 where it has company
        alone = np.repeat(np.diff(particles.group_start) == 1, np.diff(particles.group_start))
        hourglass = 4.0 * model.scene.solver.hourglass * (lame + 2.0 * shear) * volume / size**2
        self.particle_hourglass = np.where(alone, hourglass, 0.0)
        self.intact_hourglass = np.bincount(particles.cell, self.particle_hourglass, minlength=len(model.cell_nodes))
        self.set_failed()

    def set_failed(self) -> None:
        """Take over which particles have failed."""
        self.failed = self.state.failed >= 0
        self.settle()
        cell = self.model.particles.cell[self.flowing]
        self.hourglass = self.intact_hourglass.copy()
        np.subtract.at(self.hourglass, cell, (1.0 - FAILED_HOURGLASS) * self.particle_hourglass[self.flowing])

    def settle(self) -> None:
        """What has flowed so far stays; from here on flow is counted anew."""
        state = self.state
        self.way.end(self, count_flow(self))
        self.flowing = np.flatnonzero(self.failed & (self.volume > 0.0))
        count = len(self.flowing)
        self.flow_start = np.empty((count, 6)), np.empty((count, 6))
        note_flow_start(self.flowing, state.stress, state.later_strain, *self.flow_start)

    def part_around(self, brittle: Brittle, fresh: np.ndarray) -> None:
        """No part of the mine: by explicit steps the whole comes to rest at once."""

    def drop_work_arrays(self) -> None:
        """Nothing more is to be relaxed."""
        self.slot_force = np.empty((0, self.model.dimension))

    def go_back(self, rest: dict[str, np.ndarray]) -> None:
        """Return to a settled state kept earlier, its arrays by name; what has flowed since then is forgotten."""
        for name, value in rest.items():
            if isinstance(getattr(self.state, name), np.ndarray):
                getattr(self.state, name)[...] = value
        self._count_flow_anew()
        self.set_failed()

    def _count_flow_anew(self) -> None:
        """Nothing has flowed on the way to the present state."""
        self.flowing = np.empty(0, np.int64)
        self.flow_start = (np.empty((0, 6)), np.empty((0, 6)))
        self.way = Way()

    def _take_back_flow(self) -> None:
        """Stress of failed rock as if it had not flowed since flow was last counted anew."""
        model, state = self.model, self.state
        take_back_flow(
            self.flowing,
            self.flow_start[1],
            model.particles.material,
            model.elastic_constants,
            state.stress,
            state.later_strain,
        )

    def _update(self, time_step: float, blocks: np.ndarray | None = None) -> None:
        """Advance stress by time_step of nodal velocity, and its forces; in chosen blocks of cells, or in all."""
        model, particles, state, scatter = self.model, self.model.particles, self.state, self.model.scatter
        self._take_back_flow()
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
            model.mode_values,
            time_step,
            state.velocity,
            self.volume,
            particles.material,
            model.elastic_constants,
            model.residual_rows,
            self.failed,
            model.insitu,
            self.hourglass,
            state.stress,
            state.later_strain,
            state.hourglass_force,
            self.slot_force,
        )

    def _advance(self, external: np.ndarray, time_step: float) -> None:
        model, state, scatter = self.model, self.state, self.model.scatter
        advance_nodes(
            scatter.free_nodes,
            scatter.sum_start,
            scatter.sum_slots,
            scatter.sum_weights,
            self.slot_force,
            external,
            self.mass,
            model.held,
            model.scene.solver.damping,
            time_step,
            state.velocity,
            state.displacement,
            self.unbalanced,
        )
        spread_to_hanging(self.hanging, model.grid.node_parents, state.velocity)

    def internal_force(self) -> np.ndarray:
        """Forces -B^T sigma V of the present stress at free nodes, (node, d) N; nothing moves."""
        self._update(0.0)
        self._advance(np.zeros_like(self.unbalanced), 0.0)
        return self.unbalanced.copy()

    def displace(self, motion: np.ndarray) -> None:
        """Move the nodes by motion (node, d) m, held ones too, in one stress update; hanging nodes follow parents.

        Motions of nodes so given are no run away: `relax` counts from here.
        """
        model, state = self.model, self.state
        kept = state.velocity.copy()
        state.velocity[:] = motion
        spread_to_hanging(self.hanging, model.grid.node_parents, state.velocity)
        state.displacement += state.velocity
        self.start += state.velocity
        self._update(1.0)
        state.velocity[:] = kept

    def deform(self, strain: np.ndarray) -> None:
        """Strain the whole mesh homogeneously by strain (d, d), from the lower corner of the domain.

        Where the boundary is held this is its motion; elsewhere a first guess, exact for a homogeneous specimen.
        """
        self._update(0.0)
        self.way.strain(self)
        place = self.model.grid.node_index * self.model.grid.fine_cell
        self.displace(np.sum(place[:, None, :] * strain, axis=2))

    def step(self, external: np.ndarray) -> None:
        """One time step under external forces (node, d) N."""
        self._advance(external, self.time_step)
        self._update(self.time_step)

    def relax(self, external: np.ndarray, tolerance: float, reference: float, history: History) -> None:
        """Step until the 2-norm of the unbalanced force at free nodes is at most tolerance * reference (N).

        Raises NoRest after solver.max_iterations and when a node moves farther than a finest cell
        from where `displace` has taken it, InputError for NaN.
        """
        solver = self.model.scene.solver
        reference = reference or 1.0  # nothing was mined: any force at all counts
        history.cells = len(self.model.cell_nodes)
        self._update(0.0)
        for iteration in range(solver.max_iterations + 1):
            if iteration % CHECK_EVERY == 0:
                self._advance(external, 0.0)
                self.way.begin(self, external)
                ratio, largest = (size / reference for size in sizes(self.unbalanced))
                history.check(ratio, largest)
                if ratio <= tolerance:
                    break
                self._stop_drift()
                self._check_reach(ratio)
                if iteration > 0 and iteration % FLOW_FROM == 0:
                    self.settle()
                    self.way.begin(self, external)
            self.step(external)
            history.iteration += 1
            if history.bar is not None:
                history.bar.update()
        else:
            raise NoRest(
                f"no convergence: unbalanced ratio {ratio:.3g} after {solver.max_iterations} iterations, tolerance "
                f"{tolerance:g}; raise solver.max_iterations or solver.tolerance, or mine in smaller steps"
            )
        self._come_to_rest()

    def _come_to_rest(self) -> None:
        self.free.remove_from(self.state.displacement, self.model.grid.node_position, self.mass)
        spread_to_hanging(self.hanging, self.model.grid.node_parents, self.state.displacement)

    def _stop_drift(self) -> None:
        """Damping by component pushes a body along what nothing holds."""
        self.free.remove_from(self.state.velocity, self.model.grid.node_position, self.mass)

    def _check_reach(self, ratio: float) -> None:
        reach = largest_difference(self.state.displacement, self.start)
        if reach > self.model.grid.fine_cell:
            raise NoRest(
                f"rock moved {reach:.3g} m in this stage, more than a finest cell: it runs away (unbalanced ratio "
                f"{ratio:.2g}); fill the excavation, raise residual strength, or mine it in more steps"
            )


def nodal_mass(model: Model, mass: np.ndarray) -> np.ndarray:
    """Masses of particles (particle,) kg at the nodes by the shape functions; hanging nodes hand theirs on (Eq. 1)."""
    nodal = np.zeros((len(model.grid.node_index), 1))
    particle_masses(model.cell_nodes, model.particles.cell, model.particles.xi, mass, nodal[:, 0])
    collect_to_parents(model.grid.node_parents, nodal)
    return nodal[:, 0]
