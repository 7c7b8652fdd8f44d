"""Rock that may fail, the part of it that is above its strength, and its brittle drop."""

from dataclasses import dataclass

import numpy as np

from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.energy_balance import dissipate, hourglass_energies
from mpm_core.equilibrium.front import REACH, Front, front_of
from mpm_core.kernels.failure import (
    any_neighbor,
    make_drop,
    make_drop_share,
    make_is_above_strength,
    make_overstress_of,
)
from mpm_core.model.model import Model
from mpm_core.model.state import HOURGLASS, OVERSHOOT, SEISMIC, State

CENTER = np.empty((0, 6))  # In place of changes of stress: rock is judged at the centre of its cell.
MIN_GAIN_SHARE = 1e-9  # Energy that a drop gains, as a share of squared stress over shear modulus; less is round-off.
CANDIDATES_AT_ONCE = 1 << 18  # Changes of stress of so many particles are held at once.


@dataclass(frozen=True)
class Brittle:
    """The particles that may fail: on their own stress (`sound`), or once a neighbouring cell has failed (`sliver`).

    present (particle,) bool: not mined; sound, sliver: particle indices; coarse: indices of rock in larger cells, which
    may fail once its cells have been split to the finest size; neighbor_start (cell + 1,), neighbors (pair,): cells
    that share a face with each cell (grid.adjacency.face_neighbors); front: cells that are judged by the stress
    towards the front.

    A cut cell that is less than half rock fails only next to failed rock: the smaller its share, the more wrong is its
    stress (next to Kirsch's hole from a quarter down). If it stayed elastic, it would support the wall for ever.
    """

    present: np.ndarray
    sound: np.ndarray
    sliver: np.ndarray
    coarse: np.ndarray
    neighbor_start: np.ndarray
    neighbors: np.ndarray
    front: Front


def find_brittle(model: Model, volume: np.ndarray, step: int, neighbor_start, neighbors) -> Brittle:
    """Rock that can fail, of the finest level, still there at `step`; neighbours: grid.adjacency."""
    particles = model.particles
    small = model.grid.cell_level[particles.cell] == model.grid.levels - 1
    rock = model.can_fail() & (volume > 0.0)
    may_fail = rock & small
    half = (model.rock_share(step)[particles.cell] >= 0.5) | (particles.sample >= 0)
    sound, sliver = np.flatnonzero(may_fail & half), np.flatnonzero(may_fail & ~half)
    coarse = np.flatnonzero(rock & ~small)
    return Brittle(volume > 0.0, sound, sliver, coarse, neighbor_start, neighbors, front_of(model, step))


def new_failures(model: Model, state: State, brittle: Brittle) -> np.ndarray:
    """Intact particles that fail now, ascending."""
    intact = brittle.sound[state.failed[brittle.sound] < 0]
    found = [intact[:0]]
    for first in range(0, len(intact), CANDIDATES_AT_ONCE):
        some = intact[first : first + CANDIDATES_AT_ONCE]
        found.append(above_strength(model, state, some, stress_to_front(model, state, brittle, some)))
    sound = np.concatenate(found)
    broken = np.zeros(len(model.cell_nodes), bool)
    broken[model.particles.cell[(state.failed >= 0) & brittle.present]] = True
    broken[model.particles.cell[sound]] = True
    by_failed = np.empty(len(brittle.sliver), bool)
    any_neighbor(model.particles.cell[brittle.sliver], brittle.neighbor_start, brittle.neighbors, broken, by_failed)
    sliver = above_strength(model, state, brittle.sliver[by_failed])
    return np.sort(np.concatenate([sound, sliver]))


def stress_to_front(model: Model, state: State, brittle: Brittle, particles: np.ndarray) -> np.ndarray:
    """Change of stress (k, 6) Pa from particles (k,) to where they are judged (front.py): towards the face at the front
    where the overstress is larger there, else 0."""
    change = brittle.front.stress_to_face(model, state, particles)
    near = np.flatnonzero(change.any(axis=1))
    near = near[overstress(model, state, particles[near], change[near]) > 0.0]  # no other rock is above strength nearer
    some, part = particles[near], np.empty(len(near))
    make_drop_share(model.law)(
        some, state.stress, model.insitu, change[near], model.particles.material, model.intact_rows,
        model.residual_rows, model.strength_scale, part,
    )  # fmt: skip
    to_front = REACH * part[:, None] * change[near]
    to_front[overstress(model, state, some, to_front) <= overstress(model, state, some)] = 0.0
    change[:] = 0.0
    change[near] = to_front
    return change


def overstress(model: Model, state: State, particles: np.ndarray, to_front: np.ndarray = CENTER) -> np.ndarray:
    """Overstress (k,) Pa over intact strength of particles (k,), judged where their stress is larger by to_front (k, 6)
    Pa; 0 where bounds prove them below strength."""
    excess = np.empty(len(particles))
    make_overstress_of(model.law)(
        particles, state.stress, model.insitu, to_front, model.particles.material, model.intact_rows,
        model.strength_scale, excess,
    )  # fmt: skip
    return excess


def above_strength(model: Model, state: State, candidates: np.ndarray, to_front: np.ndarray = CENTER) -> np.ndarray:
    """Candidates (particle indices) that are intact and above strength by more than the margin.

    to_front (candidate, 6) Pa: see stress_to_front; without it rock is judged at the centre of its cell.
    """
    above = np.empty(len(candidates), bool)
    make_is_above_strength(model.law)(
        candidates,
        state.failed,
        state.stress,
        model.insitu,
        to_front,
        model.particles.material,
        model.intact_rows,
        model.strength_scale,
        above,
    )
    return candidates[above]


def weakest(model: Model, state: State, brittle: Brittle, candidates: np.ndarray, share: float) -> np.ndarray:
    """Candidates (particle indices, above strength) with at least `share` of the largest overstress."""
    if share == 0.0 or len(candidates) < 2:
        return candidates
    excess = overstress(model, state, candidates, stress_to_front(model, state, brittle, candidates))
    return candidates[excess >= share * excess.max()]


def fail(body: Body, brittle: Brittle, particles: np.ndarray, step: int, increment: int, generation: int) -> None:
    """Drop these particles of a body to residual strength and release the hourglass force of their cells.

    Rock that would gain energy by the strains of a drop at the front has those of a drop at its centre instead.
    """
    model, state = body.model, body.state
    to_front = stress_to_front(model, state, brittle, particles)
    near = np.flatnonzero(to_front.any(axis=1))
    before = state.stress[particles[near]]
    energy = _drop(model, state, particles, to_front)
    shear = model.elastic_constants[model.particles.material[particles[near]], 1]
    size = np.sum((before + model.insitu[particles[near]]) ** 2, axis=1) / shear
    gains = np.flatnonzero(energy[near].sum(axis=1) < -MIN_GAIN_SHARE * size)
    if len(gains):
        again = near[gains]
        state.stress[particles[again]], to_front[again] = before[gains], 0.0
        energy[again] = _drop(model, state, particles[again], to_front[again])
    # Strains of a drop at the front may do work against the stress of the centre: one part makes up for the other.
    total, front = energy.sum(axis=1), to_front.any(axis=1)
    energy[front, 0] = np.clip(energy[front, 0], np.minimum(total[front], 0.0), np.maximum(total[front], 0.0))
    energy[front, 1] = total[front] - energy[front, 0]
    state.failed[particles] = step
    state.failure_order[particles] = increment, generation
    for entry, part in zip((OVERSHOOT, SEISMIC), energy.T, strict=True):
        dissipate(state, entry, part * body.volume[particles])
    cells = np.unique(model.particles.cell[particles])
    state.energy[HOURGLASS] += float(hourglass_energies(state.hourglass_force[cells], body.hourglass[cells]).sum())
    state.hourglass_force[cells] = 0.0


def _drop(model: Model, state: State, particles: np.ndarray, to_front: np.ndarray) -> np.ndarray:
    """Drop particles (k,) to residual strength, with the strains of a drop where stress is larger by to_front (k, 6)
    Pa. Returns what overshoot and seismic strain dissipate, (k, 2) J/m3."""
    energy = np.empty((len(particles), 2))
    make_drop(model.law)(
        particles,
        state.stress,
        model.insitu,
        model.particles.material,
        model.elastic_constants,
        model.intact_rows,
        model.residual_rows,
        model.strength_scale,
        state.overshoot_strain,
        state.seismic_strain,
        to_front,
        energy,
    )
    return energy
