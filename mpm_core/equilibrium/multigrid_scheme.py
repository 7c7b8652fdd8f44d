"""Scheme `multigrid`: equilibrium solved for directly, in the discretisation of scheme `explicit`.

Without failed rock: conjugate gradients with a V-cycle over the grid's levels (mpm_core/multigrid), then one stress
update by the kernel of `explicit`, so that stress and hourglass forces are exactly what that scheme would hold.

With failed rock the unbalanced force depends on the displacement through the return to the strength surface, from the
state from which flow is counted (Body.commit), whatever the way. Its zero is sought by Anderson
acceleration with the same V-cycle, whose stiffness is elastic at first.

The elastic V-cycle is far too stiff where much rock flows. After FIRST_TANGENT_CYCLE cycles, in perfectly plastic rock
earlier, the V-cycle has the consistent tangent (multigrid/flow_forces.py) at the displacement found so far, computed
again every CYCLES_PER_TANGENT. Anderson acceleration then starts again, and a step after which the residual has grown
is halved. Newton's method with GMRES and a line search would need more cycles, since a linear residual is not the true
one. In rock without dilation and with hardly any cohesion neither reaches equilibrium, and explicit steps take over.
"""

import logging

import numpy as np

from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.brittle import Brittle
from mpm_core.equilibrium.convergence import History
from mpm_core.equilibrium.explicit_scheme import step_to_equilibrium
from mpm_core.equilibrium.scheme import Excerpt
from mpm_core.equilibrium.subdomain import Cubes, Subdomain, cut_out
from mpm_core.kernels.nodal_operations import sizes
from mpm_core.kernels.operator_rows import balance, take_step
from mpm_core.model.model import Model
from mpm_core.model.state import State
from mpm_core.multigrid.anderson import Anderson
from mpm_core.multigrid.flow_forces import FlowForces
from mpm_core.multigrid.solver import ElasticSolver
from mpm_core.multigrid.stiffness import elastic_cells
from mpm_core.simd.threads import threads_for

MAX_ELASTIC_CYCLES = 100  # V-cycles that one elastic solution may take.
MAX_SOLUTIONS = 5  # Solutions that a relaxation may take, each for the round-off that the one before has left.
# A solution has this share of the tolerance, since stress adds round-off to its residual.
SOLUTION_TOLERANCE_SHARE = 0.5
ANDERSON_DEPTH = 8  # Differences that Anderson acceleration keeps.
# Anderson acceleration keeps fewer differences where they take more memory, but at least four.
MAX_ANDERSON_BYTES = 4e8
MAX_CELLS_WITH_KEPT_WORK_ARRAYS = 500_000  # Work arrays of more cells are freed while a subdomain is at work.
MAX_FLOW_CYCLES = 400  # After this many V-cycles of one relaxation with flow, explicit steps take over.
# Flow ends at this share of the tolerance, since the forces of the stress differ by round-off.
FLOW_TOLERANCE_SHARE = 1.0 - 1e-6
# Anderson acceleration restarts where the residual exceeds the smallest one so far by this factor.
MAX_RESIDUAL_GROWTH = 10.0
STALL_CYCLES = 16  # Anderson acceleration restarts after this many cycles without progress.
STALL_RATIO = 0.97  # There is no progress where the residual is above this share of the one STALL_CYCLES before.
# The V-cycle has the tangent from this cycle on. Where rock fails brittly most relaxations end before.
FIRST_TANGENT_CYCLE = 40
FIRST_PLASTIC_TANGENT_CYCLE = 6  # As FIRST_TANGENT_CYCLE, where no rock loses strength.
CYCLES_PER_TANGENT = 8  # The tangent is computed again after this many cycles.
MAX_TANGENT_STEP_GROWTH = 2.0  # A step with the tangent is halved if the residual grows by a larger factor.
MAX_STEP_HALVINGS = 6  # A step is halved at most this many times.
MAX_DIVERGENCE = 1e6  # The search ends where the residual exceeds its first value by this factor.


class MultigridScheme:
    """Relaxes a state to equilibrium under given external forces; see scheme.Scheme."""

    solver: ElasticSolver  # from the first relaxation on

    def __init__(self, model: Model, state: State, volume: np.ndarray):
        self.body = Body(model, state, volume)
        self.model, self.state = model, state
        self.anderson: Anderson | None = None
        self.flow: FlowForces | None = None
        self.stale = np.ones(len(model.scatter.blocks), bool)  # blocks whose forces are not those of their stress
        self.rows: list[np.ndarray] = []
        self.cubes: Cubes | None = None
        self.softened: np.ndarray | None = None  # (cell,) bool: hourglass stiffness is that of failed rock
        self._stop()

    def set_volume(self, volume: np.ndarray) -> None:
        """Take over changed particle volumes."""
        self.body.set_volume(volume)
        self.stale[:] = True
        self.release()

    def set_failed(self) -> None:
        """Take over which particles have failed."""
        before, body = self.body.failed, self.body
        body.set_failed()
        fresh = body.flowing[~before[body.flowing]]
        self.stale[self.model.scatter.blocks_of(self.model.particles.cell[fresh])] = True
        if self.flow is not None:
            self.flow.add_particles(fresh)

    def _set_stiffness(self) -> None:
        """Give the solver the stiffness of all cells, its operator the hourglass stiffness of failed rock."""
        if self.softened is None:  # new volumes
            # The V-cycle has the hourglass stiffness of intact rock: a killed stage that goes on finds the same one.
            cells = elastic_cells(self.model, self.body.volume, self.body.intact_hourglass)
            free = list(self.body.free.at(self.model.node_position)) if self.body.free.count else []
            self.solver = ElasticSolver(self.model.grid, self.model.cell_nodes, self.model.held, cells, free)
            self.softened = np.zeros(len(self.body.hourglass), bool)
        failed = np.zeros(len(self.softened), bool)
        failed[self.model.particles.cell[self.body.flowing]] = True
        # Those that a return to an earlier state makes whole, too; others hold no lone particle.
        changed = np.flatnonzero((failed != self.softened) & (self.body.hourglass > 0.0))
        constants = self.body.hourglass / (1 << self.model.dimension) ** 2
        bent = self.body.pattern_row[changed] >= 0
        self.solver.operator.set_hourglass(changed[~bent], constants[changed[~bent]])
        if bent.any():
            self.solver.operator.set_patterns(constants[self.model.particles.distorted.cell])
        self.softened = failed

    def go_back(self, snapshot: dict[str, np.ndarray]) -> None:
        """Return to a committed state kept earlier (state.snapshot)."""
        self.body.go_back(snapshot)
        self.stale[:], self.flow = True, None

    def subdomain_around(self, brittle: Brittle, fresh: np.ndarray) -> Subdomain | None:
        """The subdomain around rock that has just failed; None where that is too much of the mine."""
        grid = self.model.grid
        if self.cubes is None:
            self.cubes = Cubes(grid)
        around = self.cubes.around(grid.cell_index[self.model.particles.cell[fresh]])
        return None if around is None else cut_out(self.model, self.state, self.body.volume, brittle, around, fresh)

    def scheme_of(self, subdomain: Subdomain) -> "MultigridScheme":
        """The scheme that brings a subdomain to equilibrium."""
        if len(self.model.cell_nodes) > MAX_CELLS_WITH_KEPT_WORK_ARRAYS:
            self.anderson, self.rows = None, []
        scheme = MultigridScheme(subdomain.model, subdomain.state, subdomain.volume)
        scheme.body.start, scheme.body.rest = (nodal[subdomain.nodes] for nodal in (self.body.start, self.body.rest))
        return scheme

    def take_over(self, excerpt: Excerpt) -> None:
        """Take over the result of a subdomain, which is in equilibrium and committed."""
        excerpt.write_back(self.state)
        self.stale[self.model.scatter.blocks_of(excerpt.cells)] = True
        self.body.restart_flow_count()
        self.set_failed()

    def drop_work_arrays(self) -> None:
        """Free the work arrays; no relaxation follows."""
        self.body.drop_work_arrays()
        self.cubes = None
        self.release()

    def release(self) -> None:
        """Free the solver and all arrays on its rows, which the next relaxation makes again."""
        self.anderson = self.softened = self.flow = None
        vars(self).pop("solver", None)
        self.rows = []

    def reach_equilibrium(self, external: np.ndarray, tolerance: float, reference: float, history: History) -> None:
        """Bring the 2-norm of the unbalanced force at free nodes to at most tolerance * reference (N).

        Where that does not converge, the steps of scheme `explicit` go on from there, and the log says so. Raises
        InputError as that scheme does.
        """
        reference = reference or 1.0  # nothing was mined: any force at all counts
        history.cells = len(self.model.cell_nodes)
        with threads_for(history.cells):
            self._reach_equilibrium(external, tolerance, reference, history)

    def _reach_equilibrium(self, external: np.ndarray, tolerance: float, reference: float, history: History) -> None:
        self._set_stiffness()
        if self.stale.any():
            self.body.update(0.0, np.flatnonzero(self.stale))
        self.stale[:] = False
        ratio = self._look(external, reference, history)
        self.body.energy_path.begin(self.body, external)
        if ratio > tolerance:
            before = history.iteration
            approach = self._flow if len(self.body.flowing) else self._solve
            if not approach(external, ratio, tolerance, reference, history):
                logging.warning(
                    "multigrid: unbalanced %.2e after %d cycles, tolerance %.2e; going on with explicit steps",
                    history.rows[-1][3], history.iteration - before, tolerance,
                )  # fmt: skip
                step_to_equilibrium(self.body, external, tolerance, reference, history)
                self._stop()
                return
        self.body.check_reach(ratio)
        self.body.remove_rigid_motions()

    def _solve(self, external, ratio: float, tolerance: float, reference: float, history: History) -> bool:
        """Elastic rock: solve for the displacement. Whether the tolerance (ratio) is reached."""
        for _ in range(MAX_SOLUTIONS):
            share = SOLUTION_TOLERANCE_SHARE * tolerance / ratio
            solution = self.solver.solve(
                self.body.unbalanced, share, MAX_ELASTIC_CYCLES, lambda _: self._count(history)
            )
            if not solution.ratio < 1.0:  # diverged: a step away from equilibrium, or no number
                return False
            self._move(solution.displacement)
            ratio = self._look(external, reference, history)
            if ratio <= tolerance:
                return True
        return False

    def _flow(self, external, ratio: float, tolerance: float, reference: float, history: History) -> bool:
        """Rock that flows: Anderson acceleration. Whether the tolerance (ratio) is reached.

        On the way only displacement and forces are kept, on the operator's rows: elastic ones, and what failed rock
        does not carry of them. Stress is updated at the end.
        """
        for _ in range(MAX_SOLUTIONS):
            displacement = self._flow_to_equilibrium(ratio, tolerance, reference, history)
            if displacement is None:
                self.body.update(0.0)
                return False
            self._move(displacement)
            ratio = self._look(external, reference, history)
            if ratio <= tolerance:
                return True
        return False

    def _flow_to_equilibrium(
        self, ratio: float, tolerance: float, reference: float, history: History
    ) -> np.ndarray | None:
        """Displacement (element,) to where residuals are at most tolerance * reference; None where it is not found."""
        solver, free = self.solver, self.solver.finest.inverse_diagonal
        flow = self._flow_forces()
        flow.begin(self.state, self.body.undo_flow)
        displacement, step, force, residual, elastic = self._row_arrays()
        displacement[:], force[:], step[:] = 0.0, 0.0, 0.0
        solver.to_rows(self.body.unbalanced, elastic)
        size, _ = balance(free, elastic, force, residual)
        anderson = self._anderson(free)
        first = FIRST_TANGENT_CYCLE if self.model.is_brittle() else FIRST_PLASTIC_TANGENT_CYCLE
        smallest, since, follows, taken_over, most = ratio, [ratio], first, False, MAX_DIVERGENCE * ratio
        try:
            for cycle in range(MAX_FLOW_CYCLES):
                stands = len(since) > STALL_CYCLES and ratio > STALL_RATIO * since[-1 - STALL_CYCLES]
                if cycle == follows or ratio > MAX_RESIDUAL_GROWTH * smallest or stands:
                    anderson.reset()
                    smallest, since = ratio, [ratio]
                    if cycle >= first:
                        solver.set_tangents(self.model, flow, displacement)
                        follows, taken_over = cycle + CYCLES_PER_TANGENT, True
                anderson.next_step(residual, solver.precondition(residual, size), size, step, not taken_over)
                before = size
                size, largest = self._make_step()
                if taken_over:
                    size, largest = self._shorten_step(before, size, largest)
                ratio = size / reference
                if not ratio <= most:
                    return None
                self._count(history)
                history.check(ratio, largest / reference)
                smallest = min(smallest, ratio)
                since.append(ratio)
                if ratio <= FLOW_TOLERANCE_SHARE * tolerance:
                    return displacement
            return None
        finally:
            solver.drop_tangents()

    def _make_step(self) -> tuple[float, float]:
        """Make the step in the work arrays: residual and what it is made of follow; its 2-norm and largest size, N."""
        solver, free = self.solver, self.solver.finest.inverse_diagonal
        displacement, step, force, residual, elastic = self.rows
        solver.operator.apply(step, force)
        take_step(free, step, displacement, force, elastic)
        self._flow_forces().add(displacement, force)
        solver.operator.collect(force)
        return balance(free, elastic, force, residual)

    def _shorten_step(self, before: float, size: float, largest: float) -> tuple[float, float]:
        """Halve the step just made while its residual is well above that before, N; what `_make_step` then gives."""
        step = self.rows[1]
        halved = 0
        while not size <= MAX_TANGENT_STEP_GROWTH * before and halved < MAX_STEP_HALVINGS:
            step *= 0.5 if halved else -0.5
            size, largest = self._make_step()
            halved += 1
        if halved:
            step *= -1.0  # as much of it as is left
        return size, largest

    def _flow_forces(self) -> FlowForces:
        """Flow forces of the rock that has failed by now."""
        if self.flow is None:
            self.flow = FlowForces(self.model, self.solver.finest.siblings, self.body.volume)
            self.flow.add_particles(self.body.flowing)
        return self.flow

    def _row_arrays(self) -> list[np.ndarray]:
        """Five work arrays (element,): to make them again each time would cost as much as half a cycle."""
        if not self.rows:
            self.rows = [self.solver.operator.zeros() for _ in range(5)]
        return self.rows

    def _anderson(self, inverse_diagonal: np.ndarray) -> Anderson:
        if self.anderson is None:
            free = np.flatnonzero(inverse_diagonal).astype(np.int32)
            depth = np.clip(MAX_ANDERSON_BYTES / (8 * max(1, len(free))), ANDERSON_DEPTH // 2, ANDERSON_DEPTH)
            self.anderson = Anderson(free, int(depth))
        self.anderson.reset()
        return self.anderson

    def _count(self, history: History) -> None:
        history.iteration += 1
        if history.bar is not None:
            history.bar.update()

    def _look(self, external: np.ndarray, reference: float, history: History) -> float:
        """Unbalanced force at free nodes over the reference; it is noted in the history."""
        self.body.advance(external, 0.0)
        ratio, largest = (size / reference for size in sizes(self.body.unbalanced))
        history.check(ratio, largest)
        return ratio

    def _move(self, motion: np.ndarray) -> None:
        """Move nodes by motion (element,) m, an array of the solver; stress follows."""
        state = self.state
        self.solver.to_nodes(motion, state.velocity)  # times 1 s it is the motion: the kernel takes a velocity
        state.displacement += state.velocity
        self.body.update(1.0)
        self._stop()

    def _stop(self) -> None:
        """Nodes rest: no memory is needed until they are moved again."""
        velocity = self.state.velocity
        self.state.velocity = np.zeros(velocity.shape, velocity.dtype)  # zeros_like would write them
