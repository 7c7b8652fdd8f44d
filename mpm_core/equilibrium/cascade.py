"""The brittle cascade: rock above its strength fails, equilibrium is reached again, and so on until no rock fails.

Between two generations of failure a loose tolerance is enough. When no particle fails at the loose tolerance, the
tolerance is divided by TOLERANCE_DIVISOR and failure is checked again, down to the final one. After a late failure, as
in cells that have just been split, the whole mine is first checked once a part of what the failure has unbalanced is
balanced: most of the rock that fails next is above its strength then. A stage ends with a check at the final tolerance.

A failure changes stress a few cells around it. So the cascade goes on in a subdomain around newly failed rock, whose
border is held (subdomain.py). When no more rock fails there, the whole mine reaches equilibrium and is checked. Intact
rock is elastic, so the rock that fails does not depend on the path by which the scheme reaches equilibrium. In
equilibrium, before rock fails, cells that are too coarse for it are split (refinement.py).

All rock above its strength fails at once, or (solver.weakest_first) the weakest first, since its failure may relieve
the rest. A crack needs the latter: its tip brings all rock around it above its strength, which, failing at once, is a
crushed zone instead of a crack (study brazilian_disc).
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mpm_core.equilibrium.brittle import Brittle, fail, new_failures, weakest
from mpm_core.equilibrium.convergence import MIN_UNBALANCED_SHARE, History, NoEquilibrium, norm
from mpm_core.equilibrium.increments import Increments
from mpm_core.equilibrium.scheme import Scheme, SchemeWithSubdomains
from mpm_core.equilibrium.subdomain import Subdomain
from mpm_core.model.model import Model
from mpm_core.model.state import MOTION, REFINED, UNBALANCED, State, snapshot
from mpm_core.settings import SolverSettings

TOLERANCE_DIVISOR = 4.0  # In the last increment each tolerance is the one before, divided by this.
EARLY_SHARE = 0.3  # Failure is first checked where this share of the unbalanced force is left.
# Where no rock loses strength, the loose tolerance is the given one times the factor, up to the largest one.
PLASTIC_TOLERANCE_FACTOR, MAX_PLASTIC_TOLERANCE = 50.0, 0.05


@dataclass(frozen=True)
class Ramp:
    """The load that a stage applies, increment by increment.

    start, target (node, d) N: the external force; strain (d, d): of the boundary, from 0 to this; reference N: what
    unbalanced forces are measured by, what this stage adds (see external_forces.reference_force).
    """

    start: np.ndarray
    target: np.ndarray
    strain: np.ndarray
    reference: float

    def at(self, load: float) -> np.ndarray:
        """External force (node, d) N under a share of the load."""
        return self.start + (self.target - self.start) * load

    @property
    def is_constant(self) -> bool:
        """True if no increment changes the load: that of the first step, whose elastic history bears it already, and of
        a step that mines, fills and loads nothing."""
        change = norm(self.target - self.start)
        return not self.strain.any() and change <= MIN_UNBALANCED_SHARE * self.reference


class AdaptiveCells(Protocol):
    """Cells that follow the rock, and what a stage has on those of now."""

    scheme: Scheme
    brittle: Brittle
    ramp: Ramp

    def flagged(
        self, model: Model, state: State, brittle: Brittle, fresh: np.ndarray, provisional: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Flagged places (k, d), which need finer cells, of a subdomain of the mine or the whole; and which of fresh
        particles (k,) may fail before. provisional: equilibrium is not reached to the final tolerance, so failure is
        checked again."""

    def split(self, places: np.ndarray, forget: Callable[[], None]) -> bool:
        """Split cells at places, in equilibrium; False where no more cells are allowed. forget: called before the cells
        are split, to free what belongs to those of now."""

    def take_out(self, loose: np.ndarray) -> str:
        """Take out particles (k,) that have come loose; the reason where so much falls that the mine caves, else
        empty."""


class InStepSubdomain(Protocol):
    """The subdomain that a step begins in (stages/step_subdomain.py).

    share: of the whole mine's cells; waits: whether it is left, as too much rock near its border stands above strength.
    """

    share: float
    waits: bool

    def far_from_border(self, fresh: np.ndarray) -> np.ndarray:
        """Fresh particles (k,) that may fail in the subdomain."""


def needs_whole_mine(solver: SolverSettings) -> bool:
    """True if each generation needs the whole mine: its last state in equilibrium, or its weakest rock."""
    return solver.collapse == "keep" or solver.weakest_first > 0.0


def snapshot_equilibrium(scheme: Scheme, history: History) -> None:
    """Save the state as the last one in equilibrium.

    The body's `rest`, its `start` and where its path begins may be one array with it: they are replaced, never written
    into, and the path ends before the saved state is written over.
    """
    scheme.body.commit()
    body = scheme.body
    history.last_equilibrium = snapshot(body.state, body.model.scene.solver.move, history.last_equilibrium)
    body.rest = history.last_equilibrium["displacement"]
    history.equilibrium_increment, history.equilibrium_load = history.increment, history.load


def next_failures(scheme: Scheme, brittle: Brittle, subdomain: Subdomain | InStepSubdomain | None = None) -> np.ndarray:
    """Rock above its strength in equilibrium, particles (k,), ascending; none if the cascade is at its end.

    In a subdomain of the mine rock near its border waits for the whole.
    """
    model, state, solver = scheme.body.model, scheme.body.state, scheme.body.model.scene.solver
    fresh = new_failures(model, state, brittle)
    if subdomain is not None:
        fresh = subdomain.far_from_border(fresh)
    return weakest(model, state, brittle, fresh, solver.weakest_first)


def let_fail(
    scheme: Scheme, brittle: Brittle, fresh: np.ndarray, step: int, history: History, is_whole: bool = True
) -> None:
    """Let particles (k,) fail, in equilibrium. is_whole: of the mine, to whose last equilibrium a step may go back."""
    history.failures(len(fresh))
    if not len(fresh):
        return
    solver = scheme.body.model.scene.solver
    if solver.collapse == "keep" or (is_whole and solver.collapse == "fall"):
        snapshot_equilibrium(scheme, history)
    if history.generation >= solver.max_generations:
        raise NoEquilibrium(
            f"the cascade of failure has not ended after {solver.max_generations} generations; raise "
            "solver.max_generations, or mine in smaller steps"
        )
    fail(scheme.body, brittle, fresh, step, history.increment, history.generation)
    history.generation += 1
    scheme.set_failed()


def approach(
    scheme: Scheme, external: np.ndarray, tolerance: float, loose: float, reference: float, history: History
) -> float:
    """Go as near to equilibrium as is enough for a first check of failure; the tolerance that is reached, between the
    loose one and the one asked for."""
    scheme.reach_equilibrium(external, loose, reference, history)
    reached = max(tolerance, EARLY_SHARE * history.unbalanced_ratio)
    scheme.reach_equilibrium(external, reached, reference, history)
    return reached


def run_generations(
    scheme: Scheme,
    brittle: Brittle,
    external: np.ndarray,
    tolerance: float,
    reference: float,
    step: int,
    history: History,
    subdomain: Subdomain | InStepSubdomain | None = None,
    save: Callable[[State, History], None] = lambda state, history: None,
    cells: AdaptiveCells | None = None,
    loose: float = 0.0,
) -> np.ndarray:
    """Reach equilibrium, let fail what is then above its strength, and so on until nothing is.

    loose: the tolerance that is enough for a first check, if it is larger than the tolerance.

    Failure spreads from fresh failures in a subdomain of the mine around them, if that is small, and there in a
    subdomain of that. It does not where the last state in equilibrium or the weakest rock of the whole is needed.
    subdomain: the one that the scheme is for. Returns the flagged places (k, d), which need finer cells before
    any more fails; none at its end.
    """
    solver = scheme.body.model.scene.solver
    divisible = scheme if isinstance(scheme, SchemeWithSubdomains) and not needs_whole_mine(solver) else None
    reached = loose
    while True:
        if reached > tolerance:
            reached = approach(scheme, external, tolerance, loose, reference, history)
        else:
            scheme.reach_equilibrium(external, tolerance, reference, history)
        fresh, places = next_failures(scheme, brittle, subdomain), np.empty((0, scheme.body.model.dimension), int)
        if cells is not None:
            provisional = max(reached, tolerance) > solver.tolerance
            places, fresh = cells.flagged(scheme.body.model, scheme.body.state, brittle, fresh, provisional)
        if not len(fresh) and reached > tolerance:
            reached = tolerance
            continue
        if len(places) and not len(fresh):
            return places
        let_fail(scheme, brittle, fresh, step, history, not isinstance(subdomain, Subdomain))
        if not len(fresh):
            return places
        reached = loose
        inner = None if divisible is None else divisible.subdomain_around(brittle, fresh)
        if divisible is not None and inner is not None:
            own = divisible.scheme_of(inner)
            share = len(inner.cells) / len(scheme.body.model.cell_nodes)  # of what may be unbalanced
            try:
                run_generations(
                    own, inner.brittle, external[inner.nodes], tolerance * np.sqrt(share), reference, step, history,
                    inner, cells=cells,
                )  # fmt: skip
            except NoEquilibrium as error:
                error.loose = inner.particles[error.loose]
                raise
            own.body.commit()
            divisible.take_over(inner)
            del inner, own  # before the whole needs its memory again
        save(scheme.body.state, history)


def balance_split_cells(scheme: Scheme, external: np.ndarray, tolerance, reference: float, history: History) -> None:
    """Reach equilibrium on cells that have just been split. The energy of that motion counts as that of the split."""
    energy = scheme.body.state.energy
    own = [MOTION, UNBALANCED]
    before = energy[own]
    scheme.reach_equilibrium(external, tolerance, reference, history)
    scheme.body.commit()
    energy[REFINED] -= float(np.sum(energy[own] - before))
    energy[own] = before


def loose_tolerance(model: Model) -> float:
    """Unbalanced force over the reference at which the next generation of failure is checked for.

    Where no rock loses strength, stress does not drop when rock yields: it flows on from there. In equilibrium before
    it does, an increment has first to be solved as if its rock were elastic, far above strength.
    """
    solver = model.scene.solver
    given = max(solver.cascade_tolerance, solver.tolerance)
    plastic = model.can_fail().any() and not model.is_brittle() and solver.collapse != "keep"
    return max(given, min(PLASTIC_TOLERANCE_FACTOR * given, MAX_PLASTIC_TOLERANCE)) if plastic else given


def begin_increment(
    scheme: Scheme, brittle: Brittle, ramp: Ramp, increments: Increments, tolerance: float, history: History
) -> None:
    """Begin the next increment: apply its load and its strain of the boundary. Where increments are chosen, it reaches
    equilibrium before anything fails, and smaller ones are tried until one is accepted."""
    before = snapshot(scheme.body.state) if increments.chosen else {}
    start, rest = scheme.body.start, scheme.body.rest  # which a strain of the boundary moves
    while True:
        increments.begin(history)
        if ramp.strain.any():
            scheme.body.deform(ramp.strain * (history.load - history.load_before))
        if not increments.chosen:
            return
        try:
            scheme.reach_equilibrium(ramp.at(history.load), tolerance, ramp.reference, history)
            if increments.accept(scheme.body, brittle, history):
                return
        except NoEquilibrium as error:
            if len(error.loose) or increments.shrink(history):
                scheme.body.start, scheme.body.rest = start, rest  # whoever catches it goes back, too
                raise
        scheme.go_back(before)
        scheme.body.start, scheme.body.rest = start, rest


def run_cascade(
    scheme: Scheme,
    brittle: Brittle,
    ramp: Ramp,
    step: int,
    history: History,
    save: Callable[[State, History], None] = lambda state, history: None,
    cells: AdaptiveCells | None = None,
    step_subdomain: InStepSubdomain | None = None,
) -> tuple[Scheme, bool]:
    """Ramp external force and boundary strain, with a cascade at each increment.

    Returns the scheme, another one where cells have been split, and whether it ended in collapse. `save` is called
    where the whole mine is between two generations; a history that stands within an increment (a saved one) goes on
    from there. In a subdomain of the mine it ends at the loose tolerance, or with the increment in which much rock near
    the border waits; the whole goes on from there.

    Where no equilibrium is found (NoEquilibrium), or rock fails on after solver.max_generations, solver.collapse says
    what follows. Loose rock falls (falls.py), and the step goes on from the last equilibrium. Collapse: this last
    equilibrium is the result, at cascade_tolerance, with rock above its strength that would fail next.
    """
    solver, loose = scheme.body.model.scene.solver, loose_tolerance(scheme.body.model)
    share = np.sqrt(step_subdomain.share) if step_subdomain else 1.0  # of what may be unbalanced
    increments = Increments(scheme.body.model, ramp.is_constant)
    checks_early = scheme.body.model.is_brittle() and not needs_whole_mine(solver)
    if solver.collapse == "fall" and not history.last_equilibrium:
        snapshot_equilibrium(scheme, history)
    under_way = history.increment > 0  # a saved history
    while under_way or history.load < 1.0:
        try:
            if not under_way:
                begin_increment(scheme, brittle, ramp, increments, share * loose, history)
            under_way = False
            external, last = ramp.at(history.load), history.load == 1.0
            while True:
                tolerance = share * max(loose / TOLERANCE_DIVISOR**history.tightened, solver.tolerance)
                places = run_generations(
                    scheme, brittle, external, tolerance, ramp.reference, step, history, step_subdomain, save, cells,
                    share * loose if checks_early else 0.0,
                )  # fmt: skip
                if cells is not None and len(places):
                    goes_back = bool(history.last_equilibrium)
                    del scheme, brittle  # the memory is needed: no one but `cells` has them now
                    are_split = cells.split(places, history.last_equilibrium.clear)
                    scheme, brittle, ramp = cells.scheme, cells.brittle, cells.ramp
                    if are_split:
                        history.splits += 1
                        external = ramp.at(history.load)
                        if goes_back:  # to a state that has these cells, too
                            snapshot_equilibrium(scheme, history)
                        balance_split_cells(scheme, external, tolerance, ramp.reference, history)
                    continue
                if not last or step_subdomain or tolerance == solver.tolerance:
                    break
                history.tightened += 1
        except NoEquilibrium as error:
            if not history.last_equilibrium or not (len(scheme.body.flowing) or len(error.loose)):
                raise  # no rock has failed: it is not rock that has no equilibrium
            logging.info("no equilibrium: %s", error)
            scheme.go_back(history.last_equilibrium)
            scheme.body.rest = history.last_equilibrium["displacement"]
            history.increment, history.load = history.equilibrium_increment, history.equilibrium_load
            if cells is not None and len(error.loose):
                history.collapse = cells.take_out(error.loose)
                scheme, brittle, ramp = cells.scheme, cells.brittle, cells.ramp
                if not history.collapse:
                    snapshot_equilibrium(scheme, history)
                    under_way = True
                    continue
            history.collapse = history.collapse or str(error)
            try:
                scheme.reach_equilibrium(ramp.at(history.load), loose, ramp.reference, history)  # this notes it
            except NoEquilibrium:  # not of what is left of the mine, either
                scheme.go_back(history.last_equilibrium)
            return scheme, True
        scheme.body.commit()
        if step_subdomain and step_subdomain.waits:
            break
        if history.last_equilibrium:
            snapshot_equilibrium(scheme, history)
    return scheme, False
