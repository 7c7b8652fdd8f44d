"""Events as regions: rock that failed in one part of a step, hangs together, and has like mechanisms.

The mechanism around a failed particle is the sum of the potency tensors of all particles that failed in the same part
of the step, within the link length of it. So it hardly depends on the size of the particles. Regions follow one after
the other: the particle with the largest such sum that is in no event yet leads the next one, and its region is what can
be reached from it over particles

- that are in no event yet and failed in the same part of the step,
- each within the link length of the one before,
- and around which the cosine of the mechanism with that around the leader is above the threshold.

So rock whose mechanism turns gradually, as around an opening, is divided between the places where most potency is.
These places follow from their surroundings. Rock far away counts only through events that reach that far: where one of
them has another leader, its neighbours may be divided elsewhere, too. The result depends neither on the order of the
particles nor on the threads: sums are added in the order of places, and ties are broken by a number derived from these.
Studies clustering and events measure what this rule finds.
"""

import itertools

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from seismic.clusters import number_by_first
from seismic.families import NINE_COMPONENT_WEIGHTS

ROUND_OFF = 1e-9  # relative; places of a lattice that are just the link length apart are linked


def find_regions(position: NDArray, potency: NDArray, part: NDArray, link_length: float, threshold: float) -> NDArray:
    """Event of every particle, (particle,) int64 from 0, numbered by each one's first particle.

    position (particle, 3) m; potency (particle, 6) m3, tensor shear, none of them zero; part (particle,) int: part of
    the step in which it failed; link_length m; threshold: cosine above 0 and below 1.
    """
    position = np.asarray(position, np.float64)
    if len(position) == 0:
        return np.empty(0, np.int64)
    potency, part = np.asarray(potency, np.float64), np.asarray(part, np.int64)
    length = link_length * (1.0 + ROUND_OFF)
    cube = np.floor(position / length).astype(np.int64)
    cell = np.column_stack([part, cube])
    cell -= cell.min(axis=0)
    place = (*position.T, np.ravel_multi_index(tuple(cell.T), cell.max(axis=0) + 1))
    order = np.lexsort(place)
    if np.all([np.diff(column[order]) == 0 for column in place], axis=0).any():  # particles lie at one place
        order = np.lexsort((*potency.T, *place))
    position, tensor, part = position[order], potency[order] * NINE_COMPONENT_WEIGHTS, part[order]
    tensor /= np.abs(tensor).max()  # no underflow when squared
    start, own, near = neighbouring_cubes(np.column_stack([part, cube[order]]))
    around = local_tensors(position, tensor, start, own, near, length)
    size = np.linalg.norm(around, axis=1)
    around /= np.where(size > 0.0, size, 1.0)[:, None]
    leaders = np.lexsort((lots(position), -size))
    region = np.empty(len(order), np.int64)
    region[order] = grow(position, around, leaders, start, own, near, length, threshold)
    return number_by_first(region)


def neighbouring_cubes(cube: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Cubes that hold particles: the first particle of each and, at the end, their number (cube + 1,); cube of each
    particle (particle,); the 27 cubes of the same part that touch each one, itself included, (cube, 27), -1 for none.

    cube (particle, 4): part of the step, place along each axis; sorted by its columns.
    """
    first = np.flatnonzero(np.append(True, (np.diff(cube, axis=0) != 0).any(axis=1)))
    own = np.zeros(len(cube), np.int64)
    own[first[1:]] = 1
    known = cube[first] - cube.min(axis=0)
    shape = known.max(axis=0) + 3
    strides = np.append(np.cumprod(shape[:0:-1])[::-1], 1)
    number = known @ strides
    around = np.array([(0, *offset) for offset in itertools.product((-1, 0, 1), repeat=3)]) @ strides
    wanted = number + around[:, None]  # each row ascends: its search stays in the processor's cache
    found = np.minimum(np.searchsorted(number, wanted), len(number) - 1)
    near = np.ascontiguousarray(np.where(number[found] == wanted, found, -1).T)
    return np.append(first, len(cube)), np.cumsum(own), near


@njit(cache=True)
def _square_distance(position, a, b):
    total = 0.0
    for axis in range(3):
        total += (position[a, axis] - position[b, axis]) ** 2
    return total


@njit(cache=True, parallel=True)
def local_tensors(position, tensor, start, own, near, length):
    """Sum (particle, 6) of the tensors of all particles of the same part within a length of each one.

    tensor (particle, 6); start, own, near: as neighbouring_cubes gives them.
    """
    around = np.zeros(tensor.shape)
    for particle in prange(len(position)):
        for column in range(near.shape[1]):
            cube = near[own[particle], column]
            if cube < 0:
                continue
            for other in range(start[cube], start[cube + 1]):
                if _square_distance(position, particle, other) <= length * length:
                    for k in range(6):
                        around[particle, k] += tensor[other, k]
    return around


@njit(cache=True)
def grow(position, around, leaders, start, own, near, length, threshold):
    """Region (particle,) int64 of every particle: number of the particle that leads it.

    around (particle, 6): unit tensor around each particle; leaders (particle,): in the order in which they may lead.
    Of each cube, the particles without a region are the first ones of its list.
    """
    count = len(position)
    region = np.full(count, -1)
    listed, place, end = np.arange(count), np.arange(count), start[1:].copy()
    found = np.empty(count, np.int64)
    for leader in leaders:
        if region[leader] >= 0:
            continue
        found[0], left = leader, 1
        region[leader] = leader
        _take(leader, own, listed, place, end)
        while left > 0:
            left -= 1
            particle = found[left]
            for column in range(near.shape[1]):
                cube = near[own[particle], column]
                if cube < 0:
                    continue
                for at in range(end[cube] - 1, start[cube] - 1, -1):
                    other = listed[at]
                    if _square_distance(position, particle, other) > length * length:
                        continue
                    cosine = 0.0
                    for k in range(6):
                        cosine += around[leader, k] * around[other, k]
                    if cosine > threshold:
                        region[other] = leader
                        _take(other, own, listed, place, end)
                        found[left] = other
                        left += 1
    return region


@njit(cache=True)
def _take(particle, own, listed, place, end):
    """Take a particle off the list of its cube: the last one of the list takes its place."""
    cube = own[particle]
    end[cube] -= 1
    last = listed[end[cube]]
    at = place[particle]
    listed[at], listed[end[cube]] = last, particle
    place[last], place[particle] = at, end[cube]


def lots(position: NDArray) -> NDArray:
    """A random-looking number of each place, (particle,) uint64: splitmix64 of the bits of its coordinates."""
    bits = np.ascontiguousarray(position + 0.0).view(np.uint64)  # + 0.0: no negative zero
    lot = np.zeros(len(position), np.uint64)
    for column in bits.T:
        lot = _mix(lot + column)
    return lot


def _mix(value: NDArray) -> NDArray:
    value = value + np.uint64(0x9E3779B97F4A7C15)
    value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))
