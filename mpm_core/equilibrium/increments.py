"""Increments of a stage's load: a given number of them, or as many as keep the overshoot within its limit.

Rock that reaches its strength within an increment fails at its end, above its strength, together with all other rock
that did so. In smaller increments the failure of some would have relieved others in time. So too much rock fails, in
proportion to the size of the increments. The measure of this error is the overshoot of the rock that fails first in
each increment: the potency of the strain that brings its stress back to its strength, over its seismic potency. Study
refinement compares it with the error of the step's potency. The overshoot of a particle counts with at most its seismic
potency, since a particle that should not have failed adds no more.

An increment is tried first: equilibrium under its load, with no rock failing. If the overshoot exceeds
solver.max_overshoot, or if rock would fail in an increment that reaches into another of the step's parts
(solver.parts), the state is restored and a smaller increment is tried. The next increment follows in proportion, as the
steps of an adaptive integrator do. Sizes are halvings and doublings of a part that begin at their own multiples (block
time steps, McMillan 1986). So runs that differ a little, for example by their cells, have increments that end at the
same loads, and differ less.

Rock that fails in different parts of a step makes different events (seismic.regions).
"""

import numpy as np

from common.source_tensors import scalar_potency
from common.voigt import tensor_from_voigt
from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.brittle import Brittle, above_strength, new_failures, stress_to_front
from mpm_core.equilibrium.convergence import History
from mpm_core.kernels.failure import make_drop
from mpm_core.model.model import Model
from mpm_core.model.state import State

# Number of increments where no rock loses strength, or where particles move and cannot go back.
INCREMENTS_WITHOUT_DROP = 4
MIN_INCREMENT = 1.0 / 64.0  # No increment is smaller than this share of a part.
ROUND_OFF = 1e-9  # parts
MIN_SIZE_FACTOR, MAX_SIZE_FACTOR = 0.1, 2.0  # Bounds of the ratio of an increment's size to that of the one before.
SIZE_SAFETY = 0.8  # An increment gets this share of the size that would just meet its error.


class Increments:
    """The increments of one stage. history.load is the share of the load at the end of the present one.

    chosen: whether they follow their error. A constant load is one increment: smaller ones would all be that load.
    """

    def __init__(self, model: Model, is_constant: bool):
        solver = model.scene.solver
        self.max_overshoot = solver.max_overshoot
        self.chosen = solver.increments == 0 and model.is_brittle() and not solver.move and not is_constant
        self.count = 1 if is_constant else solver.increments or INCREMENTS_WITHOUT_DROP
        self.parts = solver.parts

    def begin(self, history: History) -> None:
        """Go over to the next increment."""
        history.load_before = history.load
        history.increment, history.generation, history.tightened = history.increment + 1, 0, 0
        if self.chosen:
            done, size = history.load * self.parts, min(history.size, _block(history.load * self.parts))
            done += size
            history.load = 1.0 if done > self.parts - ROUND_OFF else done / self.parts
        else:
            history.load = history.increment / self.count

    def accept(self, body: Body, brittle: Brittle, history: History) -> bool:
        """True if a chosen increment is accepted, in equilibrium under its load and before anything fails. Otherwise it
        is undone in the history, and the next one is smaller."""
        return self.follow(overshoot_of_next(body, brittle) / self.max_overshoot, history)

    def follow(self, ratio: float, history: History) -> bool:
        """Do as `accept` for an increment whose error is `ratio` times the largest accepted one; 0 if nothing fails."""
        if ratio == 0.0:
            return self._resize(MAX_SIZE_FACTOR, True, history)
        factor = np.clip(SIZE_SAFETY / ratio, MIN_SIZE_FACTOR, MAX_SIZE_FACTOR)
        part_end = np.floor(history.load_before * self.parts + ROUND_OFF) + 1.0
        accepted = self._resize(factor, ratio <= 1.0 and history.load * self.parts < part_end + ROUND_OFF, history)
        history.size = min(history.size, 1.0)
        return accepted

    def shrink(self, history: History) -> bool:
        """Do as `accept` for an increment that has not reached equilibrium."""
        return self._resize(MIN_SIZE_FACTOR, False, history)

    def _resize(self, factor: float, accepted: bool, history: History) -> bool:
        size, requested = (history.load - history.load_before) * self.parts, history.size
        history.size = max(2.0 ** np.floor(np.log2(size * factor)), MIN_INCREMENT)
        if accepted or min(size - ROUND_OFF, requested) <= MIN_INCREMENT:
            return True
        history.size = min(history.size, 0.5 * requested)  # whatever round-off makes of it: the next try is another
        history.load, history.increment = history.load_before, history.increment - 1
        return False


def _block(done: float) -> float:
    """The largest halving or doubling of a part that these parts, a multiple of MIN_INCREMENT, are a multiple of."""
    count = round(done / MIN_INCREMENT)
    return (count & -count) * MIN_INCREMENT if count else np.inf


def overshoot_of_next(body: Body, brittle: Brittle) -> float:
    """Overshoot over seismic potency of the rock that would fail now, and of what would in finer cells; 0 for none.
    Nothing is changed."""
    model, state = body.model, body.state
    coarse = above_strength(model, state, brittle.coarse)
    fresh = np.concatenate([new_failures(model, state, brittle), coarse])
    overshoot, seismic = np.zeros((2, len(fresh), 6))
    scale = model.strength_scale[fresh] if len(model.strength_scale) else model.strength_scale
    make_drop(model.law)(
        np.arange(len(fresh)), state.stress[fresh], model.insitu[fresh], model.particles.material[fresh],
        model.elastic_constants, model.intact_rows, model.residual_rows, scale, overshoot, seismic,
        stress_to_front(model, state, brittle, fresh), np.empty((len(fresh), 2)),
    )  # fmt: skip
    return _share_of_drop(overshoot, seismic, body.volume[fresh])


def overshoot_share(state: State, volume: np.ndarray, step: int) -> float:
    """Overshoot over seismic potency of the rock that failed first in each increment of a step and is there (volume
    (particle,) > 0): about the share by which the step's potency is at most too large; 0 where none failed."""
    first = np.flatnonzero((state.failed == step) & (state.failure_order[:, 1] == 0) & (volume > 0.0))
    return _share_of_drop(state.overshoot_strain[first], state.seismic_strain[first], volume[first])


def _share_of_drop(overshoot: np.ndarray, seismic: np.ndarray, volume: np.ndarray) -> float:
    """Overshoot over seismic potency, of strains (k, 6) in volumes (k,) m3."""
    seismic_potency = potency(seismic, volume)
    total = seismic_potency.sum()
    return float(np.minimum(potency(overshoot, volume), seismic_potency).sum() / total) if total > 0.0 else 0.0


def potency(strain: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """Scalar potency (k,) m3, sqrt(2 P : P) as in a catalogue, of strains (k, 6), tensor shear, of volumes (k,) m3."""
    return volume * scalar_potency(tensor_from_voigt(strain))
