"""Scheme `multigrid`: equilibrium solved for directly, in the discretisation of scheme `explicit`.

Without failed rock: conjugate gradients with a V-cycle over the grid's levels (mpm_core/multigrid), then one stress
update by the kernel of `explicit`, so that stress and hourglass forces are exactly what that scheme would hold.
"""

import logging

import numpy as np

from mpm_core.equilibrium.convergence import History, norm
from mpm_core.equilibrium.explicit import ExplicitScheme
from mpm_core.kernels.nodes import spread_to_hanging
from mpm_core.model import Model, State
from mpm_core.multigrid.solver import ElasticSolver
from mpm_core.multigrid.stiffness import elastic_cells

CYCLES = 100  # V-cycles of one elastic solution; 20 are usual at most
SOLUTIONS = 5  # elastic solutions, each for what round-off of the one before has left
SHARE = 0.5  # of the tolerance that a solution is asked for: its residual is not the last word


class MultigridScheme(ExplicitScheme):
    """Relaxes a state to equilibrium under given external forces; the same interface as ExplicitScheme."""

    def __init__(self, model: Model, state: State, volume: np.ndarray):
        self.solver = ElasticSolver(model.grid, model.cell_nodes, model.held)
        super().__init__(model, state, volume)

    def set_volume(self, volume: np.ndarray) -> None:
        """Take over changed particle volumes."""
        super().set_volume(volume)
        model = self.model
        cells = elastic_cells(model, volume, self.hourglass)
        single = model.scene.particles_per_cell == 1
        kappa = model.scene.solver.hourglass if single else np.inf
        self.solver.set_stiffness(cells, kappa, model.is_held(volume))

    def relax(self, external: np.ndarray, tolerance: float, reference: float, history: History) -> None:
        """Bring the 2-norm of the unbalanced force at free nodes to at most tolerance * reference (N).

        Falls back to the steps of scheme `explicit` where the solution does not converge, and logs it.
        """
        reference = reference or 1.0
        self._update(0.0)
        for _ in range(SOLUTIONS):
            ratio = self._look(external, reference, history)
            if ratio <= tolerance:
                self._come_to_rest(not self.model.is_held(self.volume))
                return
            self._check_reach(ratio)
            solution = self.solver.solve(
                self.unbalanced, SHARE * tolerance / ratio, CYCLES, lambda _: self._count(history)
            )
            if not np.isfinite(solution.ratio):
                break
            self._move(solution.displacement)
        logging.warning("multigrid: not at rest after %d solutions; going on with explicit steps", SOLUTIONS)
        super().relax(external, tolerance, reference, history)

    def _count(self, history: History) -> None:
        history.iteration += 1
        if history.bar is not None:
            history.bar.update()

    def _look(self, external: np.ndarray, reference: float, history: History) -> float:
        """Unbalanced force at free nodes, noted in the history."""
        self._advance(external, 0.0)
        ratio = norm(self.unbalanced) / reference
        history.check(ratio, float(np.abs(self.unbalanced).max()) / reference)
        return ratio

    def _move(self, motion: np.ndarray) -> None:
        """Move free nodes by motion (node, d) m; stress follows."""
        state = self.state
        state.velocity[:] = motion
        spread_to_hanging(self.hanging, self.model.grid.node_parents, state.velocity)
        state.displacement += state.velocity
        self._update(1.0)
        state.velocity[:] = 0.0
