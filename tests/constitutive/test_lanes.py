"""Eight returns side by side are those of single stresses; choices among lanes are those among numbers."""

import math

import numpy as np
import pytest
from numba import njit

from mpm_core.constitutive.coulomb_return import APEX_REGION, EDGE, ELASTIC, FACE, TENSION
from mpm_core.constitutive.coulomb_strength import strength_row
from mpm_core.constitutive.laws.coulomb import return_lanes, return_to_surface
from mpm_core.settings import lame_parameters
from mpm_core.simd.lanes import LANES, choose, load, store

ROWS = [
    strength_row(30, 10, 2e6),
    strength_row(30, 10, 2e6, 1e6),
    strength_row(20, 10, 1e6, 0.0),
    strength_row(35, 35, 2e6, 1e6),
    strength_row(0, 0, 2e6, 1e6),
    strength_row(30, 10, 0.0),
    np.array([1.0, 1.0, math.inf, math.inf, math.inf]),
]


@njit
def return_eight(numbers, returned):
    """numbers (6 stress, 2 moduli, 5 strength; lane) and returned (6, lane), flat."""
    row = load(numbers, 64), load(numbers, 72), load(numbers, 80), load(numbers, 88), load(numbers, 96)
    xx, yy, zz = load(numbers, 0), load(numbers, 8), load(numbers, 16)
    yz, xz, xy = load(numbers, 24), load(numbers, 32), load(numbers, 40)
    xx, yy, zz, yz, xz, xy = return_lanes(xx, yy, zz, yz, xz, xy, load(numbers, 48), load(numbers, 56), row)
    store(returned, 0, xx)
    store(returned, 8, yy)
    store(returned, 16, zz)
    store(returned, 24, yz)
    store(returned, 32, xz)
    store(returned, 40, xy)


def stresses(count):
    """Tensors of 0.1 to 100 MPa, some isotropic, some with two equal principal values, some zero."""
    random = np.random.default_rng(5)
    stress = random.normal(size=(count, 6)) * 10.0 ** random.uniform(5, 8, size=(count, 1))
    stress[:, :3] += random.normal(size=(count, 1)) * 10.0 ** random.uniform(5, 8, size=(count, 1))
    stress[::9, 3:] = 0.0
    stress[::18, :3] = stress[::18, :1]
    stress[1::9, 3:] = 0.0
    stress[1::9, 1] = stress[1::9, 0]
    stress[2] = 0.0
    return stress


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.25, 0.45])
def test_eight_returns_are_those_of_single_stresses(poisson_ratio):
    """To round-off of the stress, in every region, with another strength in each lane."""
    constants = lame_parameters(57e9, poisson_ratio)
    regions = set()
    for start, batch in enumerate(stresses(160 * LANES).reshape(-1, LANES, 6)):
        rows = np.array([ROWS[(start + lane) % len(ROWS)] for lane in range(LANES)])
        numbers = np.concatenate([batch, np.tile(constants, (LANES, 1)), rows], axis=1)
        returned = np.empty((6, LANES))
        return_eight(numbers.T.ravel(), returned.ravel())
        for lane in range(LANES):
            *expected, region = return_to_surface(*batch[lane], *constants, rows[lane])
            regions.add(region)
            size = np.abs(batch[lane]).max()
            np.testing.assert_allclose(returned[:, lane], expected, rtol=0, atol=1e-13 * size)
            if region == ELASTIC:
                np.testing.assert_array_equal(returned[:, lane], batch[lane])
    assert regions == {ELASTIC, FACE, EDGE, APEX_REGION, TENSION}


@njit
def decide(a, b):
    """Every operation of lanes at least once."""
    bigger = (a > b) & (a >= 0.0) | (b < -1.0)
    quotient = choose(bigger, a / b, math.sqrt(abs(b)))
    quotient -= 1
    quotient = quotient + 0.25 * a
    return choose(b <= 0.0, -min(quotient, 1.0), max(math.copysign(quotient, a), 0.5) * 2.0)


@njit
def decide_eight(a, b, decided):
    store(decided, 0, decide(load(a, 0), load(b, 0)))


def test_choices_among_lanes_are_those_among_numbers():
    random = np.random.default_rng(2)
    seen = set()
    for _ in range(40):
        a, b = random.normal(size=(2, LANES))
        decided = np.empty(LANES)
        decide_eight(a, b, decided)
        # products may be rounded together with sums
        np.testing.assert_allclose(decided, [decide(*pair) for pair in zip(a, b, strict=True)], rtol=1e-14, atol=1e-15)
        seen |= {(x > y, y <= 0.0) for x, y in zip(a, b, strict=True)}
    assert len(seen) == 4
