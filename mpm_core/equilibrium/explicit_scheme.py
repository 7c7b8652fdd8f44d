"""Scheme `explicit`: damped symplectic time stepping to equilibrium (paper, section 2.2, Eqs 1 to 6; equilibrium.md).

Particles rest in their cells, so nodes keep their velocity from step to step: the grid is never reset, and the particle
velocities of Eqs (1) and (5), which would only filter it, are not needed. moving_scheme.py is the full cycle.

In a relaxation that does not end, plastic flow is counted again from the present state every
ITERATIONS_PER_FLOW_COUNT iterations (body.py), and rock that falls is looked for (falls.py). Without the former,
non-associated flow may circle around equilibrium. A smaller number would change the answer: flow that is returned in
parts, along the path of the iterations, is not the flow of one return, and dissipates another energy.
"""

import numpy as np

from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.convergence import History, NoEquilibrium
from mpm_core.equilibrium.falls import FallWatch, loose_rock
from mpm_core.kernels.nodal_operations import sizes
from mpm_core.model.model import Model
from mpm_core.model.state import State

ITERATIONS_PER_CHECK = 20  # Iterations between two checks of the unbalanced force.
ITERATIONS_PER_FLOW_COUNT = 2000  # Iterations after which a relaxation counts flow again from its present state.


class ExplicitScheme:
    """Relaxes a state towards equilibrium under given external forces by time steps of its body; see scheme.Scheme."""

    kind_of_body = Body

    def __init__(self, model: Model, state: State, volume: np.ndarray):
        self.body = self.kind_of_body(model, state, volume)

    def set_volume(self, volume: np.ndarray) -> None:
        """Take over changed particle volumes."""
        self.body.set_volume(volume)

    def set_failed(self) -> None:
        """Take over which particles have failed."""
        self.body.set_failed()

    def go_back(self, snapshot: dict[str, np.ndarray]) -> None:
        """Return to a committed state kept earlier (state.snapshot)."""
        self.body.go_back(snapshot)

    def reach_equilibrium(self, external: np.ndarray, tolerance: float, reference: float, history: History) -> None:
        """Step until the 2-norm of the unbalanced force at free nodes is at most tolerance * reference (N).

        Raises as step_to_equilibrium.
        """
        step_to_equilibrium(self.body, external, tolerance, reference, history)

    def release(self) -> None:
        """Nothing to free: a relaxation makes nothing of its own."""

    def drop_work_arrays(self) -> None:
        """Free the work arrays; no relaxation follows."""
        self.body.drop_work_arrays()


def take_time_step(body: Body, external: np.ndarray) -> None:
    """One time step under external forces (node, d) N."""
    body.advance(external, body.time_step)
    body.update(body.time_step)


def step_to_equilibrium(body: Body, external: np.ndarray, tolerance: float, reference: float, history: History) -> None:
    """Step until the 2-norm of the unbalanced force at free nodes is at most tolerance * reference (N).

    Raises NoEquilibrium after solver.max_iterations and when a node moves farther than a finest cell
    from where `displace` has moved it, InputError for NaN.
    """
    solver = body.model.scene.solver
    watch = FallWatch(body) if solver.collapse == "fall" else None
    reference = reference or 1.0  # nothing was mined: any force at all counts
    history.cells = len(body.model.cell_nodes)
    body.update(0.0)
    for iteration in range(solver.max_iterations + 1):
        if iteration % ITERATIONS_PER_CHECK == 0:
            body.advance(external, 0.0)
            body.energy_path.begin(body, external)
            ratio, largest = (size / reference for size in sizes(body.unbalanced))
            history.check(ratio, largest)
            if ratio <= tolerance:
                break
            body.stop_drift()
            body.check_reach(ratio)
            if iteration > 0 and iteration % ITERATIONS_PER_FLOW_COUNT == 0:
                if watch is not None:
                    watch.look(ratio)
                body.commit(in_equilibrium=False)
                body.energy_path.begin(body, external)
        take_time_step(body, external)
        history.iteration += 1
        if history.bar is not None:
            history.bar.update()
    else:
        raise NoEquilibrium(
            f"no convergence: unbalanced ratio {ratio:.3g} after {solver.max_iterations} iterations, tolerance "
            f"{tolerance:g}; raise solver.max_iterations or solver.tolerance, or mine in smaller steps",
            loose_rock(body),
        )
    body.remove_rigid_motions()
