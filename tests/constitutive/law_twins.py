"""Slow, obvious numpy twins of the constitutive kernels, and the draws that the property tests share."""

from itertools import combinations, permutations

import numpy as np
from hypothesis import strategies

from mpm_core.constitutive.coulomb_strength import (
    APEX,
    DILATION_FACTOR,
    FRICTION_FACTOR,
    TENSILE_STRENGTH,
    UNCONFINED_STRENGTH,
    strength_row,
)

VOIGT = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def matrix(tensor):
    """Symmetric 3 x 3 matrix of xx, yy, zz, yz, xz, xy."""
    xx, yy, zz, yz, xz, xy = tensor
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def components(symmetric):
    """xx, yy, zz, yz, xz, xy of a symmetric 3 x 3 matrix."""
    return np.array([symmetric[i, j] for i, j in VOIGT])


def rotated(tensor, rotation):
    """The tensor in turned axes: R s R^T."""
    return components(rotation @ matrix(tensor) @ rotation.T)


def rotation_from(seed):
    """A random rotation matrix."""
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]


def principal(tensor):
    """s1 >= s2 >= s3 by numpy's general symmetric eigen-solver."""
    return np.linalg.eigvalsh(matrix(tensor))[::-1]


def overstress(tensor, row):
    """max(N s1 - s3 - sigma_c, s1 - T)."""
    s1, _, s3 = principal(tensor)
    return max(row[FRICTION_FACTOR] * s1 - s3 - row[UNCONFINED_STRENGTH], s1 - row[TENSILE_STRENGTH])


def stiffness(lame_lambda, shear_modulus):
    """Hooke's law between principal strains and stresses, 3 x 3."""
    return lame_lambda * np.ones((3, 3)) + 2.0 * shear_modulus * np.eye(3)


def planes(row):
    """All strength planes in unordered principal space: normals (plane, 3), limits (plane,), flows (plane, 3)."""
    normals, limits, flows = [], [], []
    for i, j in permutations(range(3), 2):
        normal, flow = np.zeros(3), np.zeros(3)
        normal[i], normal[j] = row[FRICTION_FACTOR], -1.0
        flow[i], flow[j] = row[DILATION_FACTOR], -1.0
        normals.append(normal)
        flows.append(flow)
        limits.append(row[UNCONFINED_STRENGTH])
    if row[TENSILE_STRENGTH] < row[APEX]:
        for axis in np.eye(3):
            normals.append(axis)
            flows.append(axis)
            limits.append(row[TENSILE_STRENGTH])
    return np.array(normals), np.array(limits), np.array(flows)


def koiter_returns(trial, lame_lambda, shear_modulus, row, tolerance=1e-11):
    """Every stress that Koiter's rule allows as the return of a principal trial stress, by trying all active sets.

    A set of up to three planes is active if stress ends on all of them, their plastic multipliers are not negative
    and no other plane is exceeded. Tolerances are relative to the trial stress.
    """
    hooke = stiffness(lame_lambda, shear_modulus)
    normals, limits, flows = planes(row)
    size = np.abs(trial).max() + 1e-300
    found = []
    for count in range(4):
        for active in combinations(range(len(limits)), count):
            chosen = list(active)
            returned, multipliers = np.array(trial, float), np.zeros(count)
            if count:
                system = normals[chosen] @ hooke @ flows[chosen].T
                if np.linalg.cond(system) > 1e12:
                    continue
                multipliers = np.linalg.solve(system, normals[chosen] @ trial - limits[chosen])
                returned = trial - hooke @ flows[chosen].T @ multipliers
            admissible = np.all(normals @ returned - limits <= tolerance * size * np.abs(normals).sum(axis=1))
            if admissible and np.all(multipliers * shear_modulus >= -tolerance * size):
                found.append(returned)
    return found


def magnitudes():
    """Stress magnitudes from 1 Pa to 1 TPa, evenly in the logarithm."""
    return strategies.floats(0.0, 12.0).map(lambda exponent: 10.0**exponent)


@strategies.composite
def stresses(draw):
    """Stress tensors of 1 Pa to 1 TPa: general, with repeated or nearly repeated principal values, and turned axes."""
    values = np.array(draw(strategies.tuples(*[strategies.floats(-1.0, 1.0)] * 3)))
    values[np.abs(values) < 1e-20] = 0.0
    values /= np.abs(values).max() if values.any() else 1.0
    gap = draw(strategies.sampled_from([None, 0.0, 1e-15, 1e-12, 1e-8, 1e-4]))
    if gap is not None:
        values[1] = values[0] * (1.0 + gap)
    if draw(strategies.booleans()) and draw(strategies.booleans()):
        values[2] = values[1]
    rotation = np.eye(3) if draw(strategies.booleans()) else rotation_from(draw(strategies.integers(0, 10**6)))
    return rotated(components(np.diag(values)), rotation) * draw(magnitudes())


@strategies.composite
def strength_rows(draw):
    """Strengths from nothing to 1 TPa, friction and dilation 0 to 60 degrees, with and without a tension cut-off."""
    angles = strategies.one_of(strategies.just(0.0), strategies.floats(0.0, 60.0), strategies.just(30.0))
    pressures = strategies.one_of(strategies.just(0.0), magnitudes())
    cutoffs = strategies.one_of(strategies.none(), strategies.just(0.0), magnitudes())
    return strength_row(draw(angles), draw(angles), draw(pressures), draw(cutoffs))


def trials(count, seed):
    """Principal trial stresses (trial, 3) Pa, of 0.1 to some 100 MPa, of both signs; a third have two equal values."""
    random = np.random.default_rng(seed)
    values = random.normal(size=(count, 3)) * 10.0 ** random.uniform(5, 8, size=(count, 1))
    values += random.normal(size=(count, 1)) * 10.0 ** random.uniform(5, 8, size=(count, 1))
    values[::3, 1] = values[::3, random.integers(0, 2) * 2]
    return -np.sort(-values, axis=1)
