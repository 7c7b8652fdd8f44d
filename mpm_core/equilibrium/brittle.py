"""Rock that may fail, the part of it that is above its strength, and its brittle drop."""

from dataclasses import dataclass

import numpy as np

from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.energy_balance import dissipate, hourglass_energies
from mpm_core.equilibrium.front import Front, front_of
from mpm_core.equilibrium.perturbation import strength_perturbation
from mpm_core.kernels.failure import NO_ROCK, any_neighbor, make_drop, make_is_above_strength, make_overstress_of
from mpm_core.model.model import Model
from mpm_core.model.state import HOURGLASS, OVERSHOOT, SEISMIC, State


@dataclass(frozen=True)
class Brittle:
    """The particles that may fail: on their own stress (`sound`), or once a neighbouring cell has failed (`sliver`).

    present (particle,) bool: not mined; sound, sliver: particle indices; coarse: indices of rock in larger cells, which
    may fail once its cells have been split to the finest size; neighbor_start (cell + 1,), neighbors (pair,): cells
    that share a face with each cell (grid.adjacency.face_neighbors); tolerated_overstress (particle,) Pa: overstress
    without failure, in a member of an ensemble (perturbation.strength_perturbation); front: see front.py.

    A cut cell that is less than half
    rock fails only next to failed rock: the smaller its share, the more wrong is its stress (next to Kirsch's hole from
    a quarter down). If it stayed elastic, it would support the wall for ever.
    """

    present: np.ndarray
    sound: np.ndarray
    sliver: np.ndarray
    coarse: np.ndarray
    neighbor_start: np.ndarray
    neighbors: np.ndarray
    tolerated_overstress: np.ndarray | None
    front: Front


def find_brittle(model: Model, volume: np.ndarray, step: int, neighbor_start, neighbors) -> Brittle:
    """Rock that can fail, of the finest level, still there at `step`; neighbours: grid.adjacency."""
    particles = model.particles
    small = model.grid.cell_level[particles.cell] == model.grid.levels - 1
    rock = model.can_fail() & (volume > 0.0)
    may_fail = rock & small
    half = (model.rock_share(step)[particles.cell] >= 0.5) | (particles.sample >= 0)
    sound, sliver = np.flatnonzero(may_fail & half), np.flatnonzero(may_fail & ~half)
    tolerated_overstress = strength_perturbation(model) if model.scene.perturbation else None
    return Brittle(
        volume > 0.0, sound, sliver, np.flatnonzero(rock & ~small), neighbor_start, neighbors, tolerated_overstress,
        front_of(model, step),
    )  # fmt: skip


def new_failures(model: Model, state: State, brittle: Brittle) -> np.ndarray:
    """Intact particles that fail now, ascending."""
    sound = above_strength(model, state, brittle.sound, brittle.tolerated_overstress)
    sound = np.union1d(sound, _above_strength_at_front(model, state, brittle))
    broken = np.zeros(len(model.cell_nodes), bool)
    broken[model.particles.cell[(state.failed >= 0) & brittle.present]] = True
    broken[model.particles.cell[sound]] = True
    by_failed = np.empty(len(brittle.sliver), bool)
    any_neighbor(model.particles.cell[brittle.sliver], brittle.neighbor_start, brittle.neighbors, broken, by_failed)
    sliver = above_strength(model, state, brittle.sliver[by_failed], brittle.tolerated_overstress)
    return np.sort(np.concatenate([sound, sliver]))


def _above_strength_at_front(model: Model, state: State, brittle: Brittle) -> np.ndarray:
    """Sound particles that are above strength by the stress at the front beside them, ascending."""
    rock, across = brittle.front.rock, brittle.front.across
    broken = rock == NO_ROCK
    judged = rock >= 0
    broken[judged] = state.failed[rock[judged]] >= 0
    cell = model.particles.cell[brittle.sound]
    beside = np.zeros(len(cell), bool)
    for side in across.T:
        beside |= broken[side[cell]] & (side[cell] >= 0)
    candidates = brittle.sound[beside & (state.failed[brittle.sound] < 0)]
    stress = state.stress[candidates] + brittle.front.stress_change(model, state, candidates)
    above = np.empty(len(candidates), bool)
    tolerated = brittle.tolerated_overstress
    make_is_above_strength(model.law)(
        np.arange(len(candidates)),
        state.failed[candidates],
        stress,
        model.insitu[candidates],
        model.particles.material[candidates],
        model.intact_rows,
        np.empty(0) if tolerated is None else tolerated[candidates],
        above,
    )
    return candidates[above]


def judged_at(model: Model, state: State, brittle: Brittle, particles: np.ndarray) -> np.ndarray:
    """Change of stress (k, 6) Pa from particles (k,) to where they are judged: to the front if the overstress is larger
    there, else none."""
    change = brittle.front.stress_change(model, state, particles)
    at_front, at_centre = np.zeros((2, len(particles)))
    rows = np.arange(len(particles)), model.insitu[particles], model.particles.material[particles]
    for stress, excess in ((state.stress[particles] + change, at_front), (state.stress[particles], at_centre)):
        make_overstress_of(model.law)(rows[0], stress, rows[1], rows[2], model.intact_rows, excess)
    change[at_front <= at_centre] = 0.0
    return change


def above_strength(
    model: Model, state: State, candidates: np.ndarray, tolerated_overstress: np.ndarray | None = None
) -> np.ndarray:
    """Candidates (particle indices) that are intact and above strength by more than the margin.

    tolerated_overstress: see Brittle.tolerated_overstress; without it strength is the rock's own, as in all that rates
    a state.
    """
    above = np.empty(len(candidates), bool)
    tolerated_overstress = np.empty(0) if tolerated_overstress is None else tolerated_overstress
    make_is_above_strength(model.law)(
        candidates,
        state.failed,
        state.stress,
        model.insitu,
        model.particles.material,
        model.intact_rows,
        tolerated_overstress,
        above,
    )
    return candidates[above]


def weakest(model: Model, state: State, brittle: Brittle, candidates: np.ndarray, share: float) -> np.ndarray:
    """Candidates (particle indices, above strength) with at least `share` of the largest overstress."""
    if share == 0.0 or len(candidates) < 2:
        return candidates
    excess = np.zeros(len(candidates))
    make_overstress_of(model.law)(
        np.arange(len(candidates)),
        state.stress[candidates] + judged_at(model, state, brittle, candidates),
        model.insitu[candidates],
        model.particles.material[candidates],
        model.intact_rows,
        excess,
    )
    if brittle.tolerated_overstress is not None:
        excess -= brittle.tolerated_overstress[candidates]
    return candidates[excess >= share * excess.max()]


def fail(body: Body, brittle: Brittle, particles: np.ndarray, step: int, increment: int, generation: int) -> None:
    """Drop these particles of a body to residual strength and release the hourglass force of their cells."""
    model, state = body.model, body.state
    energy = np.empty((len(particles), 2))
    make_drop(model.law)(
        particles,
        state.stress,
        model.insitu,
        model.particles.material,
        model.elastic_constants,
        model.intact_rows,
        model.residual_rows,
        state.overshoot_strain,
        state.seismic_strain,
        judged_at(model, state, brittle, particles),
        energy,
    )
    state.failed[particles] = step
    state.failure_order[particles] = increment, generation
    for entry, part in zip((OVERSHOOT, SEISMIC), energy.T, strict=True):
        dissipate(state, entry, part * body.volume[particles])
    cells = np.unique(model.particles.cell[particles])
    state.energy[HOURGLASS] += float(hourglass_energies(state.hourglass_force[cells], body.hourglass[cells]).sum())
    state.hourglass_force[cells] = 0.0
