"""Potency, moment, magnitude, axes and source types against values worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from seismic.potency import (
    moment_magnitude,
    moment_tensor,
    particle_potency,
    principal_axes,
    scalar_moment,
    scalar_potency,
    source_type,
    tensor_from_voigt,
    voigt_from_tensor,
)

LAMBDA, MU = 20e9, 30e9
SIX = arrays(np.float64, 6, elements=st.floats(-1.0, 1.0).filter(lambda x: x == 0.0 or abs(x) > 1e-6))


def double_couple(slip_times_area):
    """Potency of slip along x on a plane with normal y: P_xy = P_yx = half of slip times area."""
    return tensor_from_voigt([0, 0, 0, 0, 0, slip_times_area / 2])


def test_voigt_order_is_xx_yy_zz_yz_xz_xy():
    assert_allclose(tensor_from_voigt([1, 2, 3, 4, 5, 6]), [[1, 6, 5], [6, 2, 4], [5, 4, 3]])
    assert_allclose(voigt_from_tensor(tensor_from_voigt([1, 2, 3, 4, 5, 6])), [1, 2, 3, 4, 5, 6])


def test_particle_potency_is_fraction_times_strain_times_volume():
    strain = np.array([[1e-3, 0, 0, 0, 0, -2e-3]])
    assert_allclose(particle_potency(strain, np.array([2.0]), 0.25), [[5e-4, 0, 0, 0, 0, -1e-3]], rtol=1e-15)


def test_double_couple_has_slip_times_area_and_mu_times_it():
    """0.01 m of slip over 100 m2: P = 1 m3, M0 = mu P; Mw of 3e10 N m is 2/3 (10.4771 - 9.1) = 0.9181."""
    tensor = double_couple(1.0)
    moment = scalar_moment(moment_tensor(tensor, LAMBDA, MU))
    assert_allclose(scalar_potency(tensor), 1.0, rtol=1e-15)
    assert_allclose(moment, 3e10, rtol=1e-15)
    assert_allclose(moment_magnitude(moment), 0.9180808, atol=1e-6)
    assert_allclose(source_type(tensor), [0, 0, 1], atol=1e-15)


def test_opening_crack():
    """Opening 1 m3 along z: M = diag(lambda, lambda, lambda + 2 mu); ISO 1/3, CLVD 2/3, DC 1/2 (1 - 1) = 0."""
    tensor = tensor_from_voigt([0, 0, 1.0, 0, 0, 0])
    assert_allclose(moment_tensor(tensor, LAMBDA, MU), np.diag([20e9, 20e9, 80e9]), rtol=1e-15)
    assert_allclose(scalar_moment(moment_tensor(tensor, LAMBDA, MU)), math.sqrt((4e20 + 4e20 + 64e20) / 2), rtol=1e-14)
    assert_allclose(scalar_potency(tensor), math.sqrt(2), rtol=1e-15)
    assert_allclose(source_type(tensor), [1 / 3, 2 / 3, 0], atol=1e-15)
    assert_allclose(source_type(-tensor), [-1 / 3, -2 / 3, 0], atol=1e-15)


def test_explosion_is_larger_by_its_bulk_modulus():
    """Expansion of 1 m3 in all: M = (3 lambda + 2 mu) / 3 on the diagonal = 40 GPa m3, M0 = sqrt(3/2) of that."""
    tensor = np.eye(3) / 3
    assert_allclose(scalar_moment(moment_tensor(tensor, LAMBDA, MU)), math.sqrt(1.5) * 40e9, rtol=1e-15)
    assert_allclose(source_type(tensor), [1, 0, 0], atol=1e-15)
    assert_allclose(source_type(-tensor), [-1, 0, 0], atol=1e-15)


def test_compensated_linear_vector_dipole():
    """(2, -1, -1): m1 + m3 - 2 m2 = 3, so CLVD 2 and DC 1/2 (3 - 3) = 0. (1, 1, -2) is its negative."""
    assert_allclose(source_type(np.diag([2.0, -1, -1])), [0, 1, 0], atol=1e-15)
    assert_allclose(source_type(np.diag([1.0, 1, -2])), [0, -1, 0], atol=1e-15)


def test_dilatant_shear():
    """Eigenvalues 3, 0, -2: ISO 1/3, CLVD 2/3, DC 1/2 (5 - 1) = 2, over their sum 3."""
    assert_allclose(source_type(np.diag([0.0, 3, -2])), np.array([1 / 3, 2 / 3, 2]) / 3, atol=1e-15)


def test_no_potency_has_no_magnitude_and_no_type():
    zero = np.zeros((1, 3, 3))
    assert moment_magnitude(scalar_moment(moment_tensor(zero, LAMBDA, MU)))[0] == -np.inf
    assert np.all(np.isnan(source_type(zero)))


def test_axes_of_reverse_slip():
    """East-west shortening, vertical opening: P east-west, T vertical, B north-south."""
    p_axis, b_axis, t_axis = principal_axes(np.diag([-1.0, 0.1, 0.9]))
    assert_allclose(np.abs(p_axis), [1, 0, 0])
    assert_allclose(np.abs(b_axis), [0, 1, 0])
    assert_allclose(t_axis, [0, 0, -1])


@given(SIX, st.integers(0, 10**6))
@settings(max_examples=60, deadline=None)
def test_axes_are_orthonormal_eigenvectors_pointing_down(six, seed):
    rotation = Rotation.random(rng=seed).as_matrix()
    tensor = rotation @ tensor_from_voigt(six) @ rotation.T
    axes = np.stack(principal_axes(tensor))
    assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    stretch = np.einsum("ai,ij,aj->a", axes, tensor, axes)
    assert np.all(np.diff(stretch) >= -1e-12)
    assert_allclose(np.einsum("a,ai,aj->ij", stretch, axes, axes), tensor, atol=1e-12)
    assert np.all(axes[:, 2] <= 0)


@given(SIX, st.integers(0, 10**6), st.floats(1e-12, 1e6))
@settings(max_examples=60, deadline=None)
def test_scalars_and_types_do_not_depend_on_the_frame(six, seed, scale):
    rotation = Rotation.random(rng=seed).as_matrix()
    tensor = tensor_from_voigt(six)
    turned = scale * (rotation @ tensor @ rotation.T)
    assert_allclose(scalar_potency(turned), scale * scalar_potency(tensor), rtol=1e-12)
    if np.any(six):
        assert_allclose(source_type(turned), source_type(tensor), atol=1e-9)
        assert_allclose(np.sum(np.abs(source_type(turned))), 1.0, rtol=1e-12)


def test_many_tensors_as_one_by_one():
    """Slow twin: nine components summed in plain loops."""
    tensors = tensor_from_voigt(np.random.default_rng(1).normal(size=(20, 6)))
    for tensor, potency, moment in zip(
        tensors, scalar_potency(tensors), scalar_moment(moment_tensor(tensors, LAMBDA, MU)), strict=True
    ):
        squares = trace = 0.0
        for i in range(3):
            trace += tensor[i, i]
            for j in range(3):
                squares += tensor[i, j] ** 2
        assert potency == pytest.approx(math.sqrt(2 * squares), rel=1e-14)
        moments = 0.0
        for i in range(3):
            for j in range(3):
                moments += (LAMBDA * trace * (i == j) + 2 * MU * tensor[i, j]) ** 2
        assert moment == pytest.approx(math.sqrt(moments / 2), rel=1e-14)
