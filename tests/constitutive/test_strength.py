"""Strength rows: what they hold, what is refused, and whether residual strength lies inside intact strength."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from numba import njit

from common.errors import InputError
from mpm_core.constitutive.coulomb_strength import residual_outside_intact, strength_row
from mpm_core.constitutive.general import strength_of
from mpm_core.constitutive.laws.coulomb import overstress, return_to_surface

from .law_twins import strength_rows


@njit
def second_row(rows):
    return strength_of(rows, 1, 5)


def test_row_of_table_2_rock():
    """phi 30: N = 3, sigma_c = 2 c sqrt 3; psi 10; apex 2 MPa / tan 30 = 3.464 MPa, above the cut-off of 1 MPa."""
    row = strength_row(30.0, 10.0, 2e6, 1e6)
    np.testing.assert_allclose(row, [3.0, 1.420276625, 6.92820323e6, 1e6, 3.464101615e6], rtol=1e-9)
    assert second_row(np.array([0.0 * row, row])) == tuple(row)


def test_cutoff_is_lowered_to_the_apex_and_missing_where_there_is_no_friction():
    assert strength_row(30.0, 0.0, 2e6, 50e6)[3] == strength_row(30.0, 0.0, 2e6)[4]
    assert strength_row(0.0, 0.0, 2e6)[3] == math.inf
    assert strength_row(0.0, 0.0, 2e6, 1e6)[3] == 1e6
    assert strength_row(30.0, 0.0, 0.0, 1e6)[3] == 0.0


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ((90.0, 0.0, 1e6), "friction_angle"),
        ((-1.0, 0.0, 1e6), "friction_angle"),
        ((30.0, float("nan"), 1e6), "dilation_angle"),
        ((30.0, 0.0, -1.0), "cohesion"),
        ((30.0, 0.0, math.inf), "cohesion"),
        ((30.0, 0.0, 1e6, -1.0), "tension_cutoff"),
    ],
)
def test_impossible_strengths_are_refused(arguments, key):
    with pytest.raises(InputError, match=key):
        strength_row(*arguments)


def test_a_row_of_infinite_strength_never_fails():
    stress, row = (1e12, -1e12, 0.0, 3e11, 0.0, 1e11), np.array([1.0, 1.0, math.inf, math.inf, math.inf])
    assert return_to_surface(*stress, 1e10, 1e10, row) == (*stress, 0)
    assert overstress(*stress, row) == -math.inf


@pytest.mark.parametrize(
    ("intact", "residual", "expected"),
    [
        ((30, 10, 2e6), (20, 10, 1e6), ""),
        ((30, 10, 2e6, 1e6), (20, 10, 1e6, 0.0), ""),
        ((30, 10, 2e6), (30, 10, 2e6), ""),
        ((30, 10, 2e6), (35, 10, 1e6), "friction_angle"),
        ((30, 10, 2e6, 1e6), (20, 10, 1e6, 1.1e6), "tensile strength"),
        ((30, 10, 2e6), (10, 10, 1e6), "tensile strength"),  # apex 5.67 MPa above 3.46 MPa, though all three are lower
        ((30, 10, 1e6), (20, 10, 1.2e6, 1e6), "cohesion"),
        ((30, 10, 2e6, 1e6), (0, 0, 1e6), "tensile strength"),
        ((0, 0, 2e6), (0, 0, 1e6), ""),
        ((30, 10, 2e6, 1e6), (0, 0, 1e6, 0.0), ""),
    ],
)
def test_residual_strength_must_lie_inside_intact_strength(intact, residual, expected):
    reason = residual_outside_intact(strength_row(*intact), strength_row(*residual))
    assert (expected in reason) if expected else reason == ""
    assert "\n" not in reason


@given(intact=strength_rows(), residual=strength_rows())
@settings(max_examples=300, deadline=None)
def test_inside_means_that_every_residual_stress_is_admissible_to_intact_rock(intact, residual):
    """Twin: the corner s1 = T and points along the residual surface into compression, checked one by one."""
    top = residual[3] if math.isfinite(residual[3]) else 1e15
    s1 = np.concatenate([[top], top - np.logspace(-3, 18, 43)])
    s3 = np.minimum(residual[0] * s1 - residual[2], s1)
    size = np.maximum(intact[0] * np.abs(s1) + np.abs(s3) + intact[2], 1.0)
    excess = np.maximum((intact[0] * s1 - s3 - intact[2]) / size, (s1 - intact[3]) / size)
    if not residual_outside_intact(intact, residual):
        assert excess.max() <= 1e-9
