"""Strength of intact rock that varies from place to place by itself, over a length in metres.

Rock breaks where it is weakest. In uniform rock no place is, and round-off and the directions of the grid choose among
the bands in which it may break as well. Strength is a log-normal random field with the Gaussian correlation
exp(-(distance / length)^2): a sum of plane waves with random directions and phases (Shinozuka and Deodatis 1991), a
function of place and of the number of the realization alone. So it knows no cells. Each member of an ensemble is
another realization.

Rock has stood under its virgin stress. Where that needs strength, what is drawn is the field's distribution above this
strength alone (by its quantiles): rock that would have failed before is not there, and none stands exactly at its
limit.
"""

import math
from types import ModuleType

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for
from numba import njit, prange

from mpm_core.constitutive.laws import variability_of
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.kernels.failure import make_overstress_of
from mpm_core.model.particles import Particles
from mpm_core.scene.scene import Scene

WAVES = 256  # With so many waves the sum is a normal variable, and far places are independent, to a few per cent.
POINTS_AT_ONCE = 256  # Phases of so many points stay in the cache.
LOWEST = -5.0  # Standard deviations of the logarithm below its mean: no rock that stands is taken to be weaker.
# Rock in coarse cells is judged by a strength so many standard deviations below the mean: some of its finest cells are
# as weak, and are to be split off before they fail.
COARSE_CELLS = -1.0
BISECTIONS = 20  # The strength that virgin stress needs is known to 2^-20 of the range.
# Coefficients of cos(2 pi t) in powers of t^2 for |t| <= 1/2, by interpolation in Chebyshev nodes; off by 1e-11.
COSINE = tuple(
    np.polynomial.chebyshev.Chebyshev.interpolate(lambda u: np.cos(2.0 * np.pi * np.sqrt(u)), 8, domain=[0.0, 0.25])
    .convert(kind=np.polynomial.Polynomial)
    .coef
)


def field_at(places: np.ndarray, length: float, realization: int) -> np.ndarray:
    """A random field (k,) with mean 0, variance 1 and correlation exp(-(distance / length)^2) at places (k, d) m.

    In 2-D it is the section at 0 of the field in 3-D.
    """
    random = np.random.default_rng([realization])
    waves = random.normal(0.0, math.sqrt(2.0) / (2.0 * np.pi * length), (WAVES, 3))  # turns per m
    phase, result = random.uniform(0.0, 1.0, WAVES), np.empty(len(places))
    where = np.zeros((len(places), 3))
    where[:, : places.shape[1]] = places
    _sum_waves(where, waves, phase, result)
    return math.sqrt(2.0 / WAVES) * result


@njit(parallel=True, error_model="numpy", cache=True)
def _sum_waves(places, waves, phase, result):
    """Sums over waves of cos(2 pi (phase + wave . place)): result (k,), written; places (k, 3) m, waves (wave, 3) turns
    per m, phase (wave,) turns."""
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = COSINE
    for block in prange((len(places) + POINTS_AT_ONCE - 1) // POINTS_AT_ONCE):
        first, end = block * POINTS_AT_ONCE, min(len(places), (block + 1) * POINTS_AT_ONCE)
        found = np.zeros(POINTS_AT_ONCE)
        for wave in range(len(waves)):
            kx, ky, kz, start = waves[wave, 0], waves[wave, 1], waves[wave, 2], phase[wave]
            for i in range(first, end):
                turns = start + kx * places[i, 0] + ky * places[i, 1] + kz * places[i, 2]
                turns -= np.rint(turns)
                u = turns * turns
                found[i - first] += c0 + u * (
                    c1 + u * (c2 + u * (c3 + u * (c4 + u * (c5 + u * (c6 + u * (c7 + u * c8))))))
                )
        for i in range(first, end):
            result[i] = found[i - first]


def strength_scale(
    scene: Scene,
    grid: MultiLevelGrid,
    particles: Particles,
    insitu: np.ndarray,
    law: ModuleType,
    intact_rows: np.ndarray,
) -> np.ndarray:
    """Strength of intact rock at each particle over that of its material, (particle,); (0,) where no rock varies.

    insitu (particle, 6) Pa: virgin stress; intact_rows: of the law. The place of rock that is alone in its cell is the
    cell's centre, which no later wall moves.
    """
    materials = list(scene.materials.values())
    given = [variability_of(material) for material in materials]
    if not any(share for share, _ in given):
        return np.empty(0)
    result, finest = np.ones(particles.count), grid.cell_level == grid.levels - 1
    count = np.diff(particles.group_start)
    alone = np.repeat(count == 1, count)
    for share, length in dict.fromkeys(pair for pair in given if pair[0]):
        own = np.flatnonzero(np.array([pair == (share, length) for pair in given]))
        rock = np.flatnonzero(particles.is_rock & np.isin(particles.material % len(materials), own))
        deviation = math.sqrt(math.log(1.0 + share**2))  # of the logarithm
        small, value = finest[particles.cell[rock]], np.full(len(rock), COARSE_CELLS)
        places = np.where(alone[rock, None], grid.centers(particles.cell[rock]), particles.position[rock])[small]
        value[small] = field_at(places, length, scene.realization)
        needed = _needed(insitu[rock], particles.material[rock], law, intact_rows, deviation)
        bound = np.flatnonzero(needed > LOWEST)
        stands = scipy.special.ndtr(-needed[bound])  # probability
        value[bound] = -scipy.special.ndtri(stands * scipy.special.ndtr(-value[bound]))
        result[rock] = _scale_of(value, deviation)
    return result


def _scale_of(value: np.ndarray, deviation: float) -> np.ndarray:
    """The log-normal number, of mean 1, of standard normal ones (k,); deviation: of its logarithm."""
    return np.exp(deviation * value - 0.5 * deviation**2)


def _needed(insitu: np.ndarray, material: np.ndarray, law: ModuleType, rows: np.ndarray, deviation: float):
    """The smallest standard normal values (k,) with whose strength virgin rock stands: LOWEST where it needs less, and
    no more than what is the strength of the material itself. insitu (k, 6) Pa; material (k,) rows of the law."""
    result, overstress_of = np.full(len(insitu), LOWEST), make_overstress_of(law)

    def fails(some: np.ndarray, value: np.ndarray) -> np.ndarray:
        excess, count = np.empty(len(some)), len(some)
        overstress_of(
            np.arange(count), np.zeros((count, 6)), insitu[some], np.empty((0, 6)), material[some], rows,
            _scale_of(value, deviation), excess,
        )  # fmt: skip
        return excess > 0.0

    some = np.flatnonzero(fails(np.arange(len(insitu)), result))
    low, high = result[some], np.full(len(some), 0.5 * deviation)  # the latter is that of the material itself
    for _ in range(BISECTIONS if len(some) else 0):
        middle = 0.5 * (low + high)
        above = fails(some, middle)
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    result[some] = high
    return result
