"""Hooke's law, its inverse and stored energy against plain numpy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpm_core.constitutive.elastic import energy_density, strain_from_stress, stress_increment
from mpm_core.settings import lame_parameters

from .law_twins import components, matrix, stresses


def test_lame_parameters_of_table_2_rock():
    """E 57 GPa and nu 0.25: lambda = G = E / 2.5 = 22.8 GPa."""
    np.testing.assert_allclose(lame_parameters(57e9, 0.25), (22.8e9, 22.8e9), rtol=1e-15)


@given(strain=stresses(), ratio=st.floats(0.0, 0.49))
@settings(max_examples=200, deadline=None)
def test_stress_is_lambda_trace_plus_two_g_strain_and_back(strain, ratio):
    lame_lambda, shear_modulus = lame_parameters(57e9, ratio)
    stress = stress_increment(lame_lambda, shear_modulus, *strain)
    e = matrix(strain)
    twin = components(lame_lambda * np.trace(e) * np.eye(3) + 2.0 * shear_modulus * e)
    np.testing.assert_allclose(stress, twin, rtol=0, atol=1e-14 * (lame_lambda + shear_modulus) * np.abs(strain).max())
    back = strain_from_stress(lame_lambda, shear_modulus, *stress)
    np.testing.assert_allclose(back, strain, rtol=0, atol=1e-12 * np.abs(strain).max())


def test_uniaxial_stress_strains_by_young_and_poisson():
    strain = strain_from_stress(*lame_parameters(57e9, 0.25), 57e6, 0.0, 0.0, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(strain, [1e-3, -0.25e-3, -0.25e-3, 0.0, 0.0, 0.0], rtol=1e-14, atol=1e-18)


@given(stress=stresses())
@settings(max_examples=200, deadline=None)
def test_energy_is_half_of_stress_times_strain(stress):
    constants = lame_parameters(57e9, 0.25)
    twin = 0.5 * np.sum(matrix(stress) * matrix(strain_from_stress(*constants, *stress)))
    assert energy_density(*constants, *stress) == pytest.approx(twin, rel=1e-12, abs=1e-300)
    assert energy_density(*constants, *stress) >= 0.0


def test_energy_of_uniaxial_and_shear_stress():
    """s^2 / 2E and t^2 / 2G."""
    constants = lame_parameters(57e9, 0.25)
    assert energy_density(*constants, 30e6, 0, 0, 0, 0, 0) == pytest.approx(30e6**2 / (2 * 57e9), rel=1e-13)
    assert energy_density(*constants, 0, 0, 0, 0, 10e6, 0) == pytest.approx(10e6**2 / (2 * 22.8e9), rel=1e-13)
