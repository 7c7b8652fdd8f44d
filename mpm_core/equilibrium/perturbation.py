"""Random perturbations that make a member of an ensemble: a run as defensible as the mine's own.

Brittle failure localises: the rock that fails first decides what fails next. A member has a strength that is slightly
larger, by a random amount at each place, and increments that end at other loads. Both are smaller than what is known of
any rock. The perturbed increments cause most of the spread. The number of increments (solver.increments) changes all
members alike and is not in their spread (study catalog_spread).
"""

import numpy as np

from mpm_core.constitutive.laws import can_fail, law_of
from mpm_core.model.model import Model
from mpm_core.scene.scene import Scene

# Largest strength perturbation as a share of the law's cohesion. No rock's strength is known as well.
MAX_STRENGTH_PERTURBATION = 0.01
MAX_INCREMENT_DELAY = 0.5  # Largest delay of an increment's end as a share of the increment; their order stays.


def strength_perturbation(model: Model) -> np.ndarray:
    """Overstress that each particle tolerates in this member before it fails, besides the margin: (particle,) Pa; else
    0.

    Uniform between 0 and MAX_STRENGTH_PERTURBATION of intact cohesion: never less than in the mine's own run, so virgin
    rock stands. The number is a hash of member and place: the same on whatever grid the particle is found. The place of
    rock that is alone in its cell is the cell's centre, which no later wall moves.
    """
    scene, particles = model.scene, model.particles
    result = np.zeros(particles.count)
    if scene.perturbation:
        cohesion = np.array(
            [law_of(rock).cohesion(rock) if can_fail(rock) else 0.0 for rock in scene.materials.values()]
        )
        rock = np.flatnonzero(particles.is_rock)
        size = np.diff(particles.group_start)
        alone = np.repeat(size == 1, size)[rock, None]
        places = np.where(alone, model.grid.cell_center[particles.cell[rock]], particles.position[rock])
        share = MAX_STRENGTH_PERTURBATION * uniform_at(places, scene.perturbation)
        result[rock] = share * cohesion[model.material[rock]]
    return result


def uniform_at(places: np.ndarray, seed: int) -> np.ndarray:
    """Numbers (k,) in 0 to 1 that look random, each from the bits of a place (k, d) and the seed alone (the finalizer
    of SplitMix64; Steele, Lea and Flood 2014)."""
    mixed = np.full(len(places), np.uint64(seed))
    for along in places.T:
        mixed = (mixed + np.uint64(0x9E3779B97F4A7C15)) ^ np.ascontiguousarray(along + 0.0).view(np.uint64)
        for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
            mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
        mixed ^= mixed >> np.uint64(31)
    return (mixed >> np.uint64(11)) * 2.0**-53


def delays(scene: Scene, step: int, increments: int) -> np.ndarray:
    """Delay of each increment's end in this member, as a share of the increment, (increments + 1,); else 0.

    Uniform between -1/2 and 1/2, but 0 where the step starts and ends: all that it changes is changed in the end.
    """
    result = np.zeros(increments + 1)
    if scene.perturbation:
        random = np.random.default_rng([scene.perturbation, 1 + step])
        result[1:-1] = MAX_INCREMENT_DELAY * random.uniform(-1.0, 1.0, increments - 1)
    return result


def pace(scene: Scene, step: int, increment: int) -> float:
    """Factor on an increment that follows its error in this member, 3/4 to 5/4; else 1."""
    if not scene.perturbation:
        return 1.0
    random = np.random.default_rng([scene.perturbation, 1 + step, increment])
    return 1.0 + 0.5 * MAX_INCREMENT_DELAY * random.uniform(-1.0, 1.0)
