"""Families of failed particles with like mechanisms (paper, section 3.1; docs/explanation/method.md).

Leaders are found greedily: particles are visited from the largest potency down, and a particle that is close to no
leader becomes one. Then each particle joins the leader it is closest to. So every particle is in exactly one family,
and the largest source around a mechanism leads the family.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from common.errors import InputError

# The nine-component norm of a symmetric tensor is the ordinary norm of six components with shear times sqrt(2).
NINE_COMPONENT_WEIGHTS = np.array([1.0, 1.0, 1.0, np.sqrt(2.0), np.sqrt(2.0), np.sqrt(2.0)])
# Particles that a thread compares at a time: their eight arrays fit in the first-level cache.
PARTICLES_PER_CHUNK = 512
PARTICLES_PER_BLOCK = 8192  # Particles between two rounds of comparison with all leaders known so far.


def closeness(first: NDArray, second: NDArray) -> NDArray:
    """Cosine between tensors (..., 3, 3): 1 parallel, -1 opposite (paper, Eq. 13; departures.md, correction 3).

    A double couple compared with a larger one, with one of opposite sense, and with an explosion:

    >>> shear = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    >>> closeness(np.stack([2 * shear, -shear, np.eye(3)]), shear).round(3).tolist()
    [1.0, -1.0, 0.0]
    """
    product = np.sum(first * second, axis=(-2, -1))
    squares = np.sum(np.square(first), axis=(-2, -1)), np.sum(np.square(second), axis=(-2, -1))
    return product / (np.sqrt(squares[0]) * np.sqrt(squares[1]))


def find_families(potency: NDArray, threshold: float) -> tuple[NDArray, NDArray]:
    """Family of every particle, and the particle that leads each family.

    potency (particle, 6) m3, tensor shear, none of them zero; threshold: least closeness of a member to its leader,
    above 0 (members must not cancel) and below 1. Gives family (particle,) int64 and leader (family,) int64, families
    in the order their leaders were found: by descending potency, ties by index. A particle as close to two leaders
    joins the larger one. The result does not depend on the number of threads. Raises InputError.
    """
    if not 0.0 < threshold < 1.0:
        raise InputError(f"seismic.closeness: {threshold} is not between 0 and 1: give a tensor cosine such as 0.8")
    potency = np.asarray(potency, dtype=np.float64)
    if len(potency) == 0:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    size = np.max(np.abs(potency), axis=1)
    if not np.all((size > 0.0) & np.isfinite(size)):
        raise InputError("seismic_strain: a failed particle's potency is zero or not finite: leave such particles out")
    direction = (
        potency / size[:, None] * NINE_COMPONENT_WEIGHTS
    )  # scaled by the largest component: no underflow when squared
    norm = np.sqrt(np.sum(np.square(direction), axis=1))
    order = np.argsort(-(size * norm), kind="stable")
    unit = np.ascontiguousarray((direction / norm[:, None])[order].T)

    family_in_order, leader_in_order = _greedy_leaders(unit, threshold)
    family = np.empty(len(potency), np.int64)
    family[order] = family_in_order
    return family, order[leader_in_order]


def _greedy_leaders(unit: NDArray, threshold: float) -> tuple[NDArray, NDArray]:
    """Family (particle,) and leader (family,) of unit vectors (6, particle) in their order of visit.

    Block by block: all leaders known so far are compared with the block in parallel, then the few that none of them
    covers are visited one by one. At the end the leaders found since are compared with each block.
    """
    particles = unit.shape[1]
    best = np.full(particles, -2.0)
    family = np.full(particles, -1, np.int64)
    leader = np.empty(particles, np.int64)
    leader_unit = np.empty((1024, 6))
    blocks = []
    found, start, length = 0, 0, PARTICLES_PER_CHUNK
    while start < particles:
        stop = min(start + length, particles)
        _compare_with_leaders(unit, start, stop, leader_unit[:found], 0, best, family)
        blocks.append((start, stop, found))
        if found + stop - start > len(leader_unit):
            leader_unit = np.concatenate([leader_unit, np.empty((len(leader_unit) + stop - start, 6))])
        found = _visit(unit, start, stop, threshold, best, leader_unit, leader, found)
        start, length = stop, min(2 * length, PARTICLES_PER_BLOCK)
    for start, stop, known in blocks:
        _compare_with_leaders(unit, start, stop, leader_unit[known:found], known, best, family)
    family[leader[:found]] = np.arange(found)  # a leader is its own, even if round-off brings another as close
    return family, leader[:found].copy()


@njit(parallel=True, cache=True)
def _compare_with_leaders(unit, start, stop, leader_unit, first, best, family):
    """Update the closest leader of particles start to stop, in place.

    unit (6, particle) float64; leader_unit (leader, 6) float64; first: family of the first of these leaders; best
    (particle,) closeness so far; family (particle,) int64. A later leader must be strictly closer. Each particle is
    written by one thread only: the result does not depend on the thread count.
    """
    for chunk in prange((stop - start + PARTICLES_PER_CHUNK - 1) // PARTICLES_PER_CHUNK):
        low = start + chunk * PARTICLES_PER_CHUNK
        high = min(low + PARTICLES_PER_CHUNK, stop)
        xx, yy, zz = unit[0, low:high], unit[1, low:high], unit[2, low:high]
        yz, xz, xy = unit[3, low:high], unit[4, low:high], unit[5, low:high]
        chunk_best, chunk_family = best[low:high], family[low:high]
        for row in range(leader_unit.shape[0]):
            a, b, c = leader_unit[row, 0], leader_unit[row, 1], leader_unit[row, 2]
            d, e, f = leader_unit[row, 3], leader_unit[row, 4], leader_unit[row, 5]
            label = first + row
            for i in range(high - low):
                cosine = a * xx[i] + b * yy[i] + c * zz[i] + d * yz[i] + e * xz[i] + f * xy[i]
                closer = cosine > chunk_best[i]  # written without a branch, so that it runs as vector instructions
                chunk_family[i] = label if closer else chunk_family[i]
                chunk_best[i] = cosine if closer else chunk_best[i]


@njit(cache=True)
def _visit(unit, start, stop, threshold, best, leader_unit, leader, found):
    """Visit particles start to stop in order; those that no leader covers become leaders. Gives the new leader count.

    best (particle,) closeness to the leaders known before start; leader_unit (room, 6) and leader (particle,) are
    filled from `found` on.
    """
    known = found
    for particle in range(start, stop):
        if best[particle] >= threshold:
            continue
        covered = False
        for row in range(known, found):
            cosine = 0.0
            for component in range(6):
                cosine += leader_unit[row, component] * unit[component, particle]
            if cosine >= threshold:
                covered = True
                break
        if not covered:
            for component in range(6):
                leader_unit[found, component] = unit[component, particle]
            leader[found] = particle
            found += 1
    return found
