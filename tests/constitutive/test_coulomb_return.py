"""Return mapping in principal space against the enumeration of every active set."""

import numpy as np
import pytest

from mpm_core.constitutive.coulomb_return import APEX_REGION, EDGE, ELASTIC, FACE, TENSION, return_principal
from mpm_core.constitutive.coulomb_strength import strength_row
from mpm_core.settings import lame_parameters

from .law_twins import koiter_returns, planes, stiffness, trials

MEGA = 1e6
ROWS = {
    "no cut-off": strength_row(30, 10, 2 * MEGA),
    "cut-off": strength_row(30, 10, 2 * MEGA, 1 * MEGA),
    "cut-off zero": strength_row(20, 10, 1 * MEGA, 0.0),
    "associated": strength_row(35, 35, 2 * MEGA, 1 * MEGA),
    "dilation above friction": strength_row(25, 30, 1 * MEGA, 0.5 * MEGA),
    "no dilation": strength_row(30, 0, 2 * MEGA, 2 * MEGA),
    "no friction": strength_row(0, 0, 2 * MEGA, 1 * MEGA),
    "no friction, dilation, no cut-off": strength_row(0, 10, 2 * MEGA),
    "no cohesion": strength_row(30, 10, 0.0),
    "high friction": strength_row(55, 10, 2 * MEGA, 0.2 * MEGA),
}


@pytest.mark.parametrize("name", ROWS)
@pytest.mark.parametrize("poisson_ratio", [0.0, 0.25, 0.45])
def test_return_is_the_one_that_koiters_rule_allows(name, poisson_ratio):
    """All active sets are tried; those that pass agree on one stress, and ours is that; where none passes, the apex."""
    row = ROWS[name]
    constants = lame_parameters(57e9, poisson_ratio)
    for trial in trials(25, seed=len(name)):
        t1, t2, t3, region = return_principal(*trial, *constants, row)
        allowed = koiter_returns(trial, *constants, row)
        size = np.abs(trial).max()
        for other in allowed:
            np.testing.assert_allclose([t1, t2, t3], -np.sort(-other), rtol=0, atol=1e-9 * size)
        if not allowed:
            assert region == APEX_REGION
            assert t1 == t2 == t3 == row[4]


def test_every_region_is_reached():
    """Guards the test above: its draws end in every region."""
    constants = lame_parameters(57e9, 0.25)
    regions = {return_principal(*trial, *constants, row)[3] for row in ROWS.values() for trial in trials(60, 3)}
    assert regions == {ELASTIC, FACE, EDGE, APEX_REGION, TENSION}


def test_associated_return_is_the_closest_admissible_stress_in_energy():
    """(trial - t) : compliance : (r - t) <= 0 for every admissible r: t is the projection in the energy norm."""
    row = ROWS["associated"]
    lame_lambda, shear_modulus = lame_parameters(57e9, 0.3)
    compliance = np.linalg.inv(stiffness(lame_lambda, shear_modulus))
    normals, limits, _ = planes(row)
    random = np.random.default_rng(5)
    others = random.normal(size=(4000, 3)) * 10.0 ** random.uniform(4, 8, size=(4000, 1)) - 5 * MEGA
    others = others[np.all(others @ normals.T <= limits, axis=1)]
    assert len(others) > 100
    for trial in trials(60, 6):
        t1, t2, t3, _ = return_principal(*trial, lame_lambda, shear_modulus, row)
        returned = np.array([t1, t2, t3])
        work = (others - returned) @ compliance @ (trial - returned)
        assert work.max() <= 1e-9 * np.abs(trial).max() ** 2 / shear_modulus


def test_zero_dilation_in_hydrostatic_tension_goes_to_the_apex_by_convention():
    """No flow direction leads there (Koiter finds nothing): the return is the tip all the same."""
    row = strength_row(30, 0, 2 * MEGA)
    constants = lame_parameters(57e9, 0.25)
    trial = np.full(3, 10 * MEGA)
    assert not koiter_returns(trial, *constants, row)
    assert return_principal(*trial, *constants, row) == (row[4], row[4], row[4], APEX_REGION)


def test_frictionless_rock_without_cohesion_keeps_its_pressure_only():
    """c = phi = psi = 0: a fluid. The deviator goes, the mean stays (no dilation)."""
    t1, t2, t3, _ = return_principal(5.0, 2.0, -1.0, *lame_parameters(57e9, 0.25), strength_row(0, 0, 0))
    np.testing.assert_allclose([t1, t2, t3], 2.0, rtol=1e-14)


def test_a_large_overshoot_leaves_no_overstress():
    """1 TPa beyond rock of 1 kPa cohesion: the surface equation holds for the result to round-off of the result."""
    row = strength_row(30, 10, 1e3, 500.0)
    for trial in [(1e12, 0.0, -1e12), (1e12, 1e12, -1e12), (1e12, -1e12, -1e12), (0.0, -1e11, -1e12)]:
        t1, t2, t3, _ = return_principal(*trial, *lame_parameters(57e9, 0.25), row)
        assert t1 >= t2 >= t3
        assert t1 <= 500.0
        assert 3.0 * t1 - t3 - row[2] <= 1e-14 * max(abs(t3), row[2])
