"""Coulomb on whole tensors: invariants for all stresses, and the strengths that a laboratory would measure."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpm_core.constitutive.coulomb_return import APEX_REGION, EDGE, ELASTIC, FACE, TENSION
from mpm_core.constitutive.coulomb_strength import strength_row
from mpm_core.constitutive.elastic import strain_from_stress
from mpm_core.constitutive.laws.coulomb import (
    STRENGTH_FACTOR_CAP,
    excess_shear_stress,
    overstress,
    return_to_surface,
    strength_factor,
    surely_admissible,
)
from mpm_core.settings import lame_parameters

from . import law_twins
from .law_twins import matrix, rotated, rotation_from, strength_rows, stresses

ROCK = lame_parameters(57e9, 0.25)
TABLE_2 = strength_row(30, 10, 2e6)  # N = 3, unconfined strength 6.928 MPa
WITH_CUTOFF = strength_row(30, 10, 2e6, 1e6)


def size_of(stress, row):
    """What round-off of the strength condition scales with."""
    return (row[0] + 1.0) * max(np.abs(stress).max(), 1e-300)


@given(stress=stresses(), row=strength_rows(), ratio=st.floats(0.0, 0.49))
@settings(max_examples=600, deadline=None)
def test_returned_stress_is_finite_admissible_and_returned_no_further(stress, row, ratio):
    constants = lame_parameters(57e9, ratio)
    *returned, region = return_to_surface(*stress, *constants, row)
    assert np.all(np.isfinite(returned))
    assert law_twins.overstress(returned, row) <= 1e-12 * size_of(returned, row)
    assert return_to_surface(*returned, *constants, row) == (*returned, ELASTIC)
    if region == ELASTIC:
        assert np.array_equal(returned, stress)
        assert law_twins.overstress(stress, row) <= 1e-12 * size_of(stress, row)
    else:
        assert law_twins.overstress(stress, row) > 0.0


@given(stress=stresses(), row=strength_rows(), seed=st.integers(0, 10**6))
@settings(max_examples=400, deadline=None)
def test_return_does_not_depend_on_the_axes(stress, row, seed):
    rotation = rotation_from(seed)
    *returned, _ = return_to_surface(*stress, *ROCK, row)
    *turned, _ = return_to_surface(*rotated(stress, rotation), *ROCK, row)
    np.testing.assert_allclose(turned, rotated(returned, rotation), rtol=0, atol=1e-11 * np.abs(stress).max())


@given(stress=stresses(), row=strength_rows())
@settings(max_examples=300, deadline=None)
def test_return_keeps_the_principal_directions(stress, row):
    """Trial and returned stress commute."""
    *returned, _ = return_to_surface(*stress, *ROCK, row)
    a, b = matrix(stress), matrix(returned)
    np.testing.assert_allclose(a @ b, b @ a, rtol=0, atol=1e-13 * np.abs(stress).max() ** 2)


@given(stress=stresses(), row=strength_rows())
@settings(max_examples=400, deadline=None)
def test_plastic_flow_dissipates_where_dilation_is_at_most_friction(stress, row):
    row = row.copy()
    row[1] = min(row[1], row[0])
    *returned, _ = return_to_surface(*stress, *ROCK, row)
    plastic_strain = strain_from_stress(*ROCK, *(stress - returned))
    dissipated = np.sum(matrix(returned) * matrix(plastic_strain))
    assert dissipated >= -1e-12 * np.abs(stress).max() * np.abs(returned).max() / ROCK[1]


@given(stress=stresses(), row=strength_rows())
@settings(max_examples=400, deadline=None)
def test_early_exit_never_clears_a_stress_above_strength(stress, row):
    if surely_admissible(*stress, row):
        assert law_twins.overstress(stress, row) <= 1e-12 * size_of(stress, row)


def test_early_exit_clears_all_lode_angles_just_inside_its_bound():
    """The bound is the maximum over Lode angles, no cruder: 0.1 % inside, the worst angle is cleared, outside not."""
    n = TABLE_2[0]
    mean = -10e6
    size = (TABLE_2[2] - (n - 1.0) * mean) / (2.0 * math.sqrt(n * n + n + 1.0))
    lode = math.atan2(math.sqrt(3.0) / 2.0, n + 0.5)
    worst = np.array([math.cos(lode + turn) for turn in (0.0, -2.0 * math.pi / 3.0, 2.0 * math.pi / 3.0)])
    inside, outside = mean + 2.0 * size * 0.999 * worst, mean + 2.0 * size * 1.001 * worst
    assert surely_admissible(*inside, 0.0, 0.0, 0.0, TABLE_2)
    assert overstress(*inside, 0.0, 0.0, 0.0, TABLE_2) < 0.0 < overstress(*outside, 0.0, 0.0, 0.0, TABLE_2)


@given(stress=stresses(), row=strength_rows())
@settings(max_examples=300, deadline=None)
def test_overstress_and_strength_measures_agree_with_their_definitions(stress, row):
    """ESS and strength factor by search over planes and by shrinking the Mohr circle, with numpy's principal values."""
    above = law_twins.overstress(stress, row)
    assert overstress(*stress, row) == pytest.approx(above, rel=1e-9, abs=1e-13 * size_of(stress, row))

    s1, _, s3 = law_twins.principal(stress)
    phi = math.asin((row[0] - 1.0) / (row[0] + 1.0))
    cohesion = row[2] / (2.0 * math.sqrt(row[0]))
    twice_angle = np.linspace(0.0, math.pi, 20001)
    normal = 0.5 * (s1 + s3) + 0.5 * (s1 - s3) * np.cos(twice_angle)
    shear = 0.5 * (s1 - s3) * np.sin(twice_angle)
    search = np.max(shear - (cohesion - normal * math.tan(phi)))
    excess = excess_shear_stress(*stress, row)
    assert excess == pytest.approx(search, rel=1e-7, abs=1e-7 * (size_of(stress, row) + cohesion))

    factor = strength_factor(*stress, row)
    assert 0.0 <= factor <= STRENGTH_FACTOR_CAP
    if abs(above) > 1e-9 * size_of(stress, row):
        assert (factor >= 1.0) == (above <= 0.0)
    if 0.0 < factor < STRENGTH_FACTOR_CAP and factor != 1.0:
        centre, radius = 0.5 * (s1 + s3), 0.5 * (s1 - s3)
        at_failure = (centre + factor * radius, centre, centre - factor * radius, 0.0, 0.0, 0.0)
        scale = max(size_of(stress, row), size_of(at_failure, row))
        assert overstress(*at_failure, row) == pytest.approx(0.0, abs=1e-12 * scale)


@given(stress=stresses(), row=strength_rows())
@settings(max_examples=200, deadline=None)
def test_a_returned_stress_has_a_strength_factor_of_at_least_one(stress, row):
    *returned, _ = return_to_surface(*stress, *ROCK, row)
    assert strength_factor(*returned, row) >= 1.0


@pytest.mark.parametrize("confinement", [0.0, 1e6, 10e6, 100e6])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_triaxial_strength_is_n_times_confinement_plus_unconfined_strength(confinement, axis):
    """Table 2 rock: 6.928 MPa unconfined, three times the confinement more when confined."""
    strength = 3.0 * confinement + 4e6 * math.sqrt(3.0)
    stress = np.array([-confinement] * 3 + [0.0] * 3)
    stress[axis] = -strength * (1.0 - 1e-9)
    assert return_to_surface(*stress, *ROCK, TABLE_2)[6] == ELASTIC
    stress[axis] = -strength * (1.0 + 1e-9)
    assert return_to_surface(*stress, *ROCK, TABLE_2)[6] == EDGE
    stress[axis] = -strength - 1e6
    assert overstress(*stress, TABLE_2) == pytest.approx(1e6, rel=1e-7)
    assert strength_factor(0.0, 0.0, -2.0 * TABLE_2[2], 0.0, 0.0, 0.0, TABLE_2) < 1.0


def test_uniaxial_tension_fails_at_the_cutoff_or_on_the_cone():
    """Cut-off 1 MPa; without one at sigma_c / N = 2.309 MPa, two thirds of the apex."""
    for row, strength, region in ((WITH_CUTOFF, 1e6, TENSION), (TABLE_2, 4e6 * math.sqrt(3.0) / 3.0, EDGE)):
        assert return_to_surface(strength * (1 - 1e-9), 0, 0, 0, 0, 0, *ROCK, row)[6] == ELASTIC
        assert return_to_surface(strength * (1 + 1e-9), 0, 0, 0, 0, 0, *ROCK, row)[6] == region


def test_uniaxial_tension_beyond_the_cutoff_by_hand():
    """s = T + x, 0, 0: it opens by x / (lambda + 2G), lateral stress drops by lambda x / (lambda + 2G) = x / 3."""
    returned = return_to_surface(1.3e6, 0.0, 0.0, 0.0, 0.0, 0.0, *ROCK, WITH_CUTOFF)
    np.testing.assert_allclose(returned[:6], [1e6, -0.1e6, -0.1e6, 0.0, 0.0, 0.0], rtol=1e-12, atol=1e-3)


def test_hydrostatic_tension_ends_at_the_cutoff_or_the_apex():
    pulled = (5e6, 5e6, 5e6, 0.0, 0.0, 0.0)
    assert return_to_surface(*pulled, *ROCK, WITH_CUTOFF) == (1e6, 1e6, 1e6, 0.0, 0.0, 0.0, TENSION)
    *returned, region = return_to_surface(*pulled, *ROCK, TABLE_2)
    np.testing.assert_allclose(returned, [2e6 * math.sqrt(3.0)] * 3 + [0.0] * 3, rtol=1e-14)
    assert region == APEX_REGION


def test_pure_shear_on_the_face_by_hand():
    """Tresca, no dilation: shear of c + x on a plane returns to c, wherever the mean stress is."""
    row = strength_row(0, 0, 2e6)
    *returned, region = return_to_surface(-7e6, -7e6, -7e6, 0.0, 0.0, 3e6, *ROCK, row)
    np.testing.assert_allclose(returned, [-7e6, -7e6, -7e6, 0.0, 0.0, 2e6], rtol=1e-13, atol=1e-6)
    assert region == FACE


def test_void_without_stress_is_admissible_whatever_the_strength():
    for row in (WITH_CUTOFF, strength_row(30, 10, 0.0, 0.0), strength_row(0, 0, 0.0)):
        assert return_to_surface(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, row) == (0.0,) * 6 + (ELASTIC,)
        assert strength_factor(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, row) == STRENGTH_FACTOR_CAP
