"""Scheme `explicit` with `solver.move`: particles carry the motion and travel through the grid (paper, section 2.2).

Every step is the full cycle of Eqs (1) to (6), corrected (departures.md): nothing is kept at the nodes. That is
pure FLIP (paper, Eq. 5): particle velocities that the nodes do not see are neither damped nor do they move or strain
anything. They are no part of the datasets: every stage starts in equilibrium, without velocity.

What stays small-strain: the loads of excavations are nodal forces fixed in space, volumes and virgin stresses are those
of each particle's first place. So particles may travel, but a wall that moves by a good part of a cell takes its load
with it only in part.

The time step. Between two steps the transfer to particles and back filters the nodal velocity. A motion of frequency
omega of which it keeps the share p obeys u' = u + dt v', v' = v + dt a, v <- v + p dt a: stable while
omega dt <= 2 / sqrt(2 - p). As p may be anything from 0 to 1, the time step is 1 / sqrt(2) of that of body.py.

Light nodes. A particle that enters an empty cell gives its far nodes hardly any mass but its full stress gradient: the
acceleration has no bound there (paper, Eq. 3). Particles get of it in proportion to that mass, but it would strain
them in full. In the velocity of Eq. 4 that strains, the mass under the force is therefore at least that of the heaviest
particle nearby, which a node at the corner of one full cell has anyway. Momentum and equilibrium are not touched. With
density scaling a particle that changes level takes the density of its new cell, for the same reason.
"""

import numpy as np

from common.errors import InputError
from mpm_core.equilibrium.body import Body, density_and_limit
from mpm_core.equilibrium.energy_balance import dissipate
from mpm_core.equilibrium.explicit_scheme import ExplicitScheme
from mpm_core.grid.adjacency import leaf_lookup
from mpm_core.kernels.material_point_cycle import make_cycle, move_nodes, relocate, sort_by_cell
from mpm_core.kernels.nodal_operations import spread_to_hanging
from mpm_core.model.model import Model
from mpm_core.model.state import FLOW, State


class MovingBody(Body):
    """A body whose particles move.

    xi (particle, d) and state.cell say where particles are, velocity (particle, d) m/s; state.position is brought up to
    date when a relaxation ends. Raises InputError when a particle leaves the domain.
    """

    def __init__(self, model: Model, state: State, volume: np.ndarray):
        dimension, scatter = model.dimension, model.scatter
        state.position, state.cell = state.position.copy(), state.cell.copy()  # until now they may be the model's own
        self.lookup = leaf_lookup(model.grid)
        self.cell_index, self.cell_width = model.grid.cell_index, model.grid.cell_width
        self.cell_size = model.grid.cell_size
        self.model, self.state = model, state
        self.xi = self._place_in_cells()
        self.velocity = np.zeros((model.particles.count, dimension))
        self.acceleration = np.zeros_like(state.velocity)
        self.dissipated = np.zeros(model.particles.count)  # by flow, J/m3
        self.slot_values = np.zeros((scatter.slots, 2 * dimension + 2))
        self.leavers = np.zeros(len(scatter.block_start) - 1, np.int64)
        super().__init__(model, state, volume)
        state.velocity[:] = 0.0
        self._relocate()

    @property
    def time_step_share(self) -> float:
        """Time step over the limit without damping and without the filter of the transfers."""
        return super().time_step_share / np.sqrt(2.0)

    def displace(self, motion: np.ndarray) -> None:
        """Refused: places and volumes of particles that move would have to follow (InputError)."""
        raise InputError("strains: the boundary cannot be strained while particles move; set solver.move: false")

    def set_volume(self, volume: np.ndarray) -> None:
        """Take over changed particle volumes: mass and time step follow."""
        super().set_volume(volume)
        self.density, _ = density_and_limit(self.model, volume)
        self.particle_mass = self.density * volume
        self._weigh()

    def _weigh(self) -> None:
        if self.model.scene.solver.density_scaling:
            level_change = self.cell_size[self.model.particles.cell] / self.cell_size[self.state.cell]
            self.particle_mass = self.density * self.volume * level_change**2

    def _relocate(self) -> None:
        changed, lost = relocate(self.cell_index, self.cell_width, *self.lookup, self.volume, self.state.cell, self.xi)
        if lost:
            raise InputError(
                f"{lost} particles left the domain: hold its faces (domain.boundary), enlarge it, or let "
                "particles rest (solver.move: false)"
            )
        self.state.cell_changes += changed
        self._weigh()
        self.cell_start, self.cell_particles = sort_by_cell(self.state.cell, len(self.cell_size))

    def update(self, time_step: float) -> None:  # type: ignore[override]  # of all blocks, always
        """One cycle of time_step; particles that have left their cell find the next."""
        self._cycle(time_step)
        if self.leavers.any():
            self._relocate()
            self._cycle(0.0)

    def _cycle(self, time_step: float) -> None:
        model, state, scatter = self.model, self.state, self.model.scatter
        make_cycle(model.law, model.dimension)(
            scatter.block_start,
            scatter.slot_start,
            model.cell_nodes,
            scatter.cell_slots,
            self.cell_size,
            self.cell_start,
            self.cell_particles,
            time_step,
            state.velocity,
            self.acceleration,
            self.particle_mass,
            self.volume,
            model.particles.material,
            model.elastic_constants,
            model.residual_rows,
            self.failed,
            model.insitu,
            self.xi,
            self.velocity,
            state.stress,
            state.later_strain,
            self.dissipated,
            self.slot_values,
            self.leavers,
        )

    def advance(self, external: np.ndarray, time_step: float) -> None:
        """Unbalanced force under external forces (node, d) N; nodes and particles advance by time_step of it."""
        model, state, scatter = self.model, self.state, self.model.scatter
        move_nodes(
            scatter.free_nodes,
            scatter.sum_start,
            scatter.sum_slots,
            scatter.sum_weights,
            self.slot_values,
            external,
            model.held,
            model.scene.solver.damping,
            time_step,
            self.mass,
            state.velocity,
            self.acceleration,
            state.displacement,
            self.unbalanced,
        )
        for values in (state.velocity, self.acceleration):
            spread_to_hanging(self.hanging, model.grid.node_parents, values)

    def commit(self, in_equilibrium: bool = True) -> None:
        """Count what particles that move have dissipated: they flow as they go, in every step. No work of forces is
        counted, in equilibrium or not: nodes are new in each."""
        self.energy_path.reset()
        dissipate(self.state, FLOW, self.dissipated * self.volume)
        self.dissipated[:] = 0.0

    def go_back(self, snapshot: dict[str, np.ndarray]) -> None:
        """Return to a state kept earlier, with particles where they were, at rest."""
        self.dissipated[:] = 0.0
        super().go_back(snapshot)
        self.velocity[:], self.acceleration[:] = 0.0, 0.0
        self.xi = self._place_in_cells()
        self._relocate()

    def stop_drift(self) -> None:
        """Remove rigid motions that nothing holds from the particles' velocity."""
        if self.free.count:
            self.free.remove_from(self.velocity, self._position(), self.particle_mass)
            self.update(0.0)

    def check_reach(self, ratio: float) -> None:
        """Check nothing: particles may move any distance, and _relocate raises if one leaves the domain."""

    def _place_in_cells(self) -> np.ndarray:
        """Places (particle, d) of the state in its cells, -1 to 1."""
        cell = self.state.cell
        return (self.state.position - self.model.grid.centers(cell)) / (0.5 * self.cell_size[cell])[:, None]

    def _position(self) -> np.ndarray:
        cell = self.state.cell
        return self.model.grid.centers(cell) + 0.5 * self.cell_size[cell][:, None] * self.xi

    def remove_rigid_motions(self) -> None:
        """The body is in equilibrium: particles are where they have got to."""
        super().remove_rigid_motions()
        self.state.position[:] = self._position()


class MovingScheme(ExplicitScheme):
    """Scheme `explicit` for particles that move."""

    kind_of_body = MovingBody
