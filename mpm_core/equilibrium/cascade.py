"""The brittle cascade: rock fails where it stands above strength at rest, comes to rest again, and so on.

Between two generations of failure a loose tolerance is enough. Once nothing fails at it any more, it is tightened by
steps, with a look after each: what then still fails is little, and is at rest again soon. (Back to the loose tolerance
after each late failure, and to the full one for another look: twice the iterations in the demo mine.) A stage ends
with a look at full tolerance.
Intact rock is elastic in between, so what fails does not depend on the scheme's way to rest.

All rock above strength fails at once, or (solver.weakest_first) the weakest first: its failure may relieve the rest. A
crack needs that. Its tip lifts all that surrounds it above strength; failing at once that is a crushed zone, no crack
(Brazilian disc, 1 mm cells: 660 cells fail over a third of the diameter where 144, two cells wide, split it).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mpm_core.equilibrium.convergence import History, NoRest
from mpm_core.equilibrium.perturbation import borne_overstress, lateness
from mpm_core.kernels.failure import any_neighbor, drop, overstress_of, stands_above
from mpm_core.model import Model, State
from pipeline.errors import InputError

TIGHTER = 4.0  # between two tolerances of the last increment


@dataclass(frozen=True)
class Brittle:
    """Which particles may fail: on their own stress (`sound`), or once a neighbouring cell has failed (`sliver`).

    present (particle,) bool: not mined; sound, sliver: particle indices; borne (particle,) Pa: overstress without
    failure, in a member of an ensemble (perturbation.borne_overstress). A cut cell that is less than half rock reads a
    stress that is 30 to 50 % wrong (measured on Kirsch's hole), so it fails only beside failed rock; kept elastic it
    would line the wall with steel for ever.
    """

    present: np.ndarray
    sound: np.ndarray
    sliver: np.ndarray
    neighbor_start: np.ndarray
    neighbors: np.ndarray
    borne: np.ndarray | None


@dataclass(frozen=True)
class Ramp:
    """What a stage changes in solver.increments.

    start, target (node, d) N: the external force; strain (d, d): of the boundary, from 0 to this; reference, change N:
    what unbalanced forces are measured by, all that has acted since virgin rock and what this stage adds (see
    stages.load_size).
    """

    start: np.ndarray
    target: np.ndarray
    strain: np.ndarray
    reference: float
    change: float


def find_brittle(model: Model, volume: np.ndarray, step: int, neighbor_start, neighbors) -> Brittle:
    """Coulomb rock of the finest level (of any, in a draft) still there at `step`; neighbours: grid.adjacency."""
    particles = model.particles
    small = model.scene.draft | (model.grid.cell_level[particles.cell] == model.grid.levels - 1)
    may_fail = model.is_coulomb() & small & (volume > 0.0)
    half = (model.rock_share(step)[particles.cell] >= 0.5) | (particles.sample >= 0)
    sound, sliver = np.flatnonzero(may_fail & half), np.flatnonzero(may_fail & ~half)
    borne = borne_overstress(particles, model.scene) if model.scene.perturbation else None
    return Brittle(volume > 0.0, sound, sliver, neighbor_start, neighbors, borne)


def new_failures(model: Model, state: State, brittle: Brittle) -> np.ndarray:
    """Intact particles that fail now, ascending."""
    sound = above_strength(model, state, brittle.sound[state.failed[brittle.sound] < 0], brittle.borne)
    broken = np.zeros(len(model.cell_nodes), bool)
    broken[model.particles.cell[(state.failed >= 0) & brittle.present]] = True
    broken[model.particles.cell[sound]] = True
    intact = brittle.sliver[state.failed[brittle.sliver] < 0]
    beside = np.empty(len(intact), bool)
    any_neighbor(model.particles.cell[intact], brittle.neighbor_start, brittle.neighbors, broken, beside)
    sliver = above_strength(model, state, intact[beside], brittle.borne)
    return np.sort(np.concatenate([sound, sliver]))


def above_strength(model: Model, state: State, candidates: np.ndarray, borne: np.ndarray | None = None) -> np.ndarray:
    """Those of the candidates (particle indices) that stand above intact strength by more than the margin.

    borne: see Brittle.borne; without it strength is the rock's own, as in all that rates a state.
    """
    above = np.empty(len(candidates), bool)
    borne = np.empty(0) if borne is None else borne
    stands_above(
        candidates, state.stress, model.insitu, model.particles.material, model.intact_rows, model.strength_margin,
        borne, above,
    )  # fmt: skip
    return candidates[above]


def weakest(
    model: Model, state: State, candidates: np.ndarray, share: float, borne: np.ndarray | None = None
) -> np.ndarray:
    """Those of the candidates (particle indices, above strength) with at least `share` of the largest overstress."""
    if share == 0.0 or len(candidates) < 2:
        return candidates
    excess = _overstress(model, state, candidates, borne)
    return candidates[excess >= share * excess.max()]


def _overstress(model: Model, state: State, candidates: np.ndarray, borne: np.ndarray | None) -> np.ndarray:
    """How far candidates (particle indices) stand above intact strength, Pa; at most 0 where they do not."""
    excess = np.zeros(len(candidates))
    overstress_of(candidates, state.stress, model.insitu, model.particles.material, model.intact_rows, excess)
    return excess if borne is None else excess - borne[candidates]


def fail(model: Model, state: State, particles: np.ndarray, step: int, increment: int, generation: int) -> None:
    """Drop these particles to residual strength and release the hourglass force of their cells."""
    drop(
        particles,
        state.stress,
        model.insitu,
        model.particles.material,
        model.elastic_constants,
        model.intact_rows,
        model.residual_rows,
        state.overshoot_strain,
        state.seismic_strain,
        state.dissipated,
    )
    state.failed[particles] = step
    state.failure_order[particles] = increment, generation
    state.hourglass_force[model.particles.cell[particles]] = 0.0


def run_cascade(
    scheme,
    brittle: Brittle,
    ramp: Ramp,
    step: int,
    history: History,
    save: Callable[[State, History], None] = lambda state, history: None,
) -> bool:
    """Ramp external force and boundary strain, with a cascade at each increment. Whether it ended in collapse.

    `scheme` offers deform(strain), relax(external, tolerance, reference, history), set_failed(), settle() and
    go_back(rest). `save` is called between generations; a history that stands within an increment (a saved one) goes on
    from there.
    Collapse: after rock has failed it finds no rest. That is an error, or (solver.collapse "keep") the last state of
    rest is the result, at cascade_tolerance, with rock above strength that would fail next.
    Raises InputError when the cascade has not ended after solver.max_generations.
    """
    model, state, solver = scheme.model, scheme.state, scheme.model.scene.solver
    reference = ramp.reference
    # What one stope changes may be small beside all that was ever mined: between generations the step itself counts.
    mines = ramp.change > solver.tolerance * reference  # less is round-off: nothing new is mined
    loose = solver.cascade_tolerance * (min(1.0, ramp.change / reference) if mines and reference > 0.0 else 1.0)
    loose = max(loose, solver.tolerance)
    late = lateness(model.scene, step)

    def load_at(increment: int) -> np.ndarray:
        return ramp.start + (ramp.target - ramp.start) * ((increment + late[increment]) / solver.increments)

    def keep_rest() -> None:
        if solver.collapse == "keep":
            scheme.settle()
            history.rest = {name: np.copy(value) for name, value in vars(state).items()}

    def look(increment: int) -> bool:
        fresh = new_failures(model, state, brittle)
        fresh = weakest(model, state, fresh, solver.weakest_first, brittle.borne)
        history.failures(len(fresh))
        if not len(fresh):
            return False
        if history.generation >= solver.max_generations:
            raise InputError(
                f"the cascade of failure has not ended after {solver.max_generations} generations; raise "
                "solver.max_generations, or mine in smaller steps"
            )
        keep_rest()
        fail(model, state, fresh, step, increment, history.generation)
        history.generation += 1
        scheme.set_failed()
        save(state, history)
        return True

    resumed = history.increment
    before = load_at(max(resumed - 1, 0))
    for increment in range(max(resumed, 1), solver.increments + 1):
        external = load_at(increment)
        if increment != resumed:
            if ramp.strain.any():
                scheme.deform(ramp.strain * (1.0 + late[increment] - late[increment - 1]) / solver.increments)
            history.increment, history.generation, history.tightened = increment, 0, 0
        last = increment == solver.increments
        try:
            while True:
                tolerance = max(loose / TIGHTER**history.tightened, solver.tolerance)
                scheme.relax(external, tolerance, reference, history)
                if look(increment):
                    continue
                if not last or tolerance == solver.tolerance:
                    break
                history.tightened += 1
        except NoRest:
            if not history.rest:
                raise
            scheme.go_back(history.rest)
            if history.generation == 0:  # nothing failed since the increment before
                history.increment, external = increment - 1, before
            scheme.relax(external, loose, reference, history)  # is at rest: this notes it
            return True
        scheme.settle()
        if history.rest:
            keep_rest()
        before = external
    return False
