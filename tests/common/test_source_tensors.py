"""Potency, moment, magnitude, axes and source types against values worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from catalogs.records.build import build_record
from catalogs.records.quakeml_reader import RecordSlice
from common.source_tensors import (
    clear_axes,
    moment_from_potency,
    moment_magnitude,
    moment_of_magnitude,
    point_down,
    potency_from_moment,
    principal_axes,
    scalar_moment,
    scalar_potency,
    shear_iso_share,
    source_shares,
)
from common.voigt import tensor_from_voigt
from seismic.events import extract_events
from verification.answers.clustering.known_truth import synthetic_step

LAMBDA, MU = 20e9, 30e9
SIX = arrays(np.float64, 6, elements=st.floats(-1.0, 1.0).filter(lambda x: x == 0.0 or abs(x) > 1e-6))


def double_couple(slip_times_area):
    """Potency of slip along x on a plane with normal y: P_xy = P_yx = half of slip times area."""
    return tensor_from_voigt([0, 0, 0, 0, 0, slip_times_area / 2])


def test_double_couple_has_slip_times_area_and_mu_times_it():
    """0.01 m of slip over 100 m2: P = 1 m3, M0 = mu P; Mw of 3e10 N m is 2/3 (10.4771 - 9.1) = 0.9181."""
    tensor = double_couple(1.0)
    moment = scalar_moment(moment_from_potency(tensor, LAMBDA, MU))
    assert_allclose(scalar_potency(tensor), 1.0, rtol=1e-15)
    assert_allclose(moment, 3e10, rtol=1e-15)
    assert_allclose(moment_magnitude(moment), 0.9180808, atol=1e-6)
    assert_allclose(source_shares(tensor), [0, 0, 1], atol=1e-15)


def test_opening_crack():
    """Opening 1 m3 along z: M = diag(lambda, lambda, lambda + 2 mu); ISO 1/3, CLVD 2/3, DC 1/2 (1 - 1) = 0."""
    tensor = tensor_from_voigt([0, 0, 1.0, 0, 0, 0])
    assert_allclose(moment_from_potency(tensor, LAMBDA, MU), np.diag([20e9, 20e9, 80e9]), rtol=1e-15)
    assert_allclose(
        scalar_moment(moment_from_potency(tensor, LAMBDA, MU)), math.sqrt((4e20 + 4e20 + 64e20) / 2), rtol=1e-14
    )
    assert_allclose(scalar_potency(tensor), math.sqrt(2), rtol=1e-15)
    assert_allclose(source_shares(tensor), [1 / 3, 2 / 3, 0], atol=1e-15)
    assert_allclose(source_shares(-tensor), [-1 / 3, -2 / 3, 0], atol=1e-15)


def test_explosion_is_larger_by_its_bulk_modulus():
    """Expansion of 1 m3 in all: M = (3 lambda + 2 mu) / 3 on the diagonal = 40 GPa m3, M0 = sqrt(3/2) of that."""
    tensor = np.eye(3) / 3
    assert_allclose(scalar_moment(moment_from_potency(tensor, LAMBDA, MU)), math.sqrt(1.5) * 40e9, rtol=1e-15)
    assert_allclose(source_shares(tensor), [1, 0, 0], atol=1e-15)
    assert_allclose(source_shares(-tensor), [-1, 0, 0], atol=1e-15)


def test_compensated_linear_vector_dipole():
    """(2, -1, -1): m1 + m3 - 2 m2 = 3, so CLVD 2 and DC 1/2 (3 - 3) = 0. (1, 1, -2) is its negative."""
    assert_allclose(source_shares(np.diag([2.0, -1, -1])), [0, 1, 0], atol=1e-15)
    assert_allclose(source_shares(np.diag([1.0, 1, -2])), [0, -1, 0], atol=1e-15)


def test_dilatant_shear():
    """Eigenvalues 3, 0, -2: ISO 1/3, CLVD 2/3, DC 1/2 (5 - 1) = 2, over their sum 3."""
    assert_allclose(source_shares(np.diag([0.0, 3, -2])), np.array([1 / 3, 2 / 3, 2]) / 3, atol=1e-15)


def test_no_potency_has_no_magnitude_and_no_shares():
    zero = np.zeros((1, 3, 3))
    assert moment_magnitude(scalar_moment(moment_from_potency(zero, LAMBDA, MU)))[0] == -np.inf
    assert np.all(np.isnan(source_shares(zero)))


def test_axes_of_reverse_slip():
    """East-west shortening, vertical opening: P east-west, B north-south, T vertical; level ones north or east."""
    assert_array_equal(principal_axes(np.diag([-1.0, 0.1, 0.9])), [[1, 0, 0], [0, 1, 0], [0, 0, -1]])


@given(SIX, st.integers(0, 10**6))
@settings(max_examples=60, deadline=None)
def test_axes_are_orthonormal_eigenvectors_pointing_down(six, seed):
    """Principal values ascend from P to T and rebuild the tensor, equal ones too (TIE apart at most)."""
    rotation = Rotation.random(rng=seed).as_matrix()
    tensor = rotation @ tensor_from_voigt(six) @ rotation.T
    axes = principal_axes(tensor)
    assert_allclose(axes @ axes.T, np.eye(3), atol=1e-8)
    stretch = np.einsum("ai,ij,aj->a", axes, tensor, axes)
    assert np.all(np.diff(stretch) >= -1e-12)
    assert_allclose(np.einsum("a,ai,aj->ij", stretch, axes, axes), tensor, atol=1e-8)
    assert np.all(axes[:, 2] <= 0)


@given(st.integers(0, 10**6), st.integers(0, 10**6), st.floats(-1.0, 1.0), st.floats(1e-12, 1e6))
@settings(max_examples=100, deadline=None)
def test_axes_turn_with_the_tensor(first, second, middle, scale):
    """Of distinct principal values: turned by any rotation and of any size, each axis turns along."""
    start, turn = Rotation.random(rng=first).as_matrix(), Rotation.random(rng=second).as_matrix()
    values = np.array([-1.5, middle, 1.5])
    tensor = start.T @ np.diag(values) @ start
    assert_allclose(principal_axes(tensor), point_down(start), atol=1e-9)
    turned = principal_axes(scale * turn @ tensor @ turn.T)
    assert_allclose(turned, point_down(principal_axes(tensor) @ turn.T), atol=2e-9)


@given(
    st.integers(0, 10**6), st.floats(0.0, 360.0), st.booleans(), st.floats(-3.0, 3.0).filter(lambda x: abs(x) > 1e-3)
)
@settings(max_examples=100, deadline=None)
def test_tied_axes_do_not_hang_on_round_off(seed, azimuth, opening, isotropic):
    """Two equal principal values: the level axis is level, round-off changes nothing, they turn with the azimuth."""
    frame = Rotation.random(rng=seed).as_matrix()
    values = np.array([0.0, 0.0, 1.0] if opening else [-1.0, 0.0, 0.0]) + isotropic
    tensor = frame.T @ np.diag(values) @ frame
    axes = principal_axes(tensor)
    assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert_allclose(axes.T @ np.diag(values) @ axes, tensor, atol=1e-8)
    assert axes[1 if opening else 2, 2] == 0
    noise = 1e-14 * np.random.default_rng(seed).normal(size=(3, 3))
    assert_allclose(principal_axes(tensor + noise + noise.T), axes, atol=1e-9)
    about = Rotation.from_euler("z", azimuth, degrees=True).as_matrix()
    assert_allclose(principal_axes(about @ tensor @ about.T), point_down(axes @ about.T), atol=1e-8)


def test_tied_axes_by_hand():
    """A crack that opens east: P down, B north. One that opens upwards: P north, B east. An explosion, and nothing."""
    down, north, east = [0, 0, -1], [0, 1, 0], [1, 0, 0]
    assert_array_equal(principal_axes(np.diag([1.0, 0, 0])), [down, north, east])
    assert_array_equal(principal_axes(np.diag([0, 0, 1.0])), [north, east, down])
    assert_array_equal(principal_axes(np.diag([0, 0, -1.0])), [down, north, east])
    assert_array_equal(principal_axes(np.stack([np.eye(3), np.zeros((3, 3))])), [[down, north, east]] * 2)


@given(st.integers(0, 10**6), st.sampled_from([0.0, 1e-16, -1e-16, 3e-12, -3e-12]))
def test_an_axis_and_its_opposite_are_given_in_one_sense(seed, noise):
    """Level ones too, whatever round-off says of their height: north, and east if they run east and west."""
    axis = np.random.default_rng(seed).normal(size=3)
    level = np.array([*axis[:2] / np.hypot(*axis[:2]), noise])
    east = np.array([1.0, noise, noise])
    for vector in (axis / np.linalg.norm(axis), level, east):
        assert_array_equal(point_down(vector), point_down(-vector))
        assert_allclose(np.abs(point_down(vector)), np.abs(vector), atol=1e-9)
    assert point_down(axis)[2] < 0
    assert point_down(level)[1] > 0
    assert point_down(level)[2] == 0
    assert point_down(east)[0] == 1


@given(st.floats(0.0, 360.0))
def test_level_axes_of_a_strike_slip_event_point_north(strike):
    """On a vertical plane P and T are level, 45 degrees from its strike, B is vertical; all senses are known."""
    along, across = (np.radians(strike + angle) for angle in (0.0, 90.0))
    slip, normal = (np.array([np.sin(angle), np.cos(angle), 0.0]) for angle in (along, across))
    p_axis, b_axis, t_axis = principal_axes(0.5 * (np.outer(slip, normal) + np.outer(normal, slip)))
    assert_allclose(b_axis, [0, 0, -1], atol=1e-12)
    for axis in (p_axis, t_axis):
        assert axis[2] == 0
        assert axis[1] > -1e-9
        assert axis[1] > 1e-9 or axis[0] > 0


def test_model_and_record_give_one_tensor_the_same_axes_and_shares():
    """A level shear, through the events of a step and through a record: the same bytes."""
    strain = np.tile([0, 1e-3, -1e-3, 0, 4e-4, -2e-4], (4, 1))
    step = synthetic_step(1.25 * np.arange(4)[:, None] * [1, 0, 0], strain)
    chosen = {
        "mine": "testmine",
        "method": "simultaneous",
        "closeness": 0.8,
        "least_particles": 3,
        "seismic_fraction": 1.0,
    }
    chosen["frame"] = {"surface": 0.0}
    modelled, _ = extract_events(step, chosen)
    moduli = {name: step.attrs[name] for name in ("lame_lambda", "shear_modulus")}
    recorded = build_record(
        RecordSlice.of({"reader": "quakeml", "file": "", "location_error": 1.0} | moduli, "record"),
        modelled["time"].values,
        modelled["location"].values,
        {},
        modelled["potency_tensor"].values,
    )
    assert modelled.sizes["event"] == 1
    for name in ("p_axis", "b_axis", "t_axis", "iso", "clvd", "dc", "potency", "moment", "mw"):
        assert_array_equal(modelled[name].values, recorded[name].values, err_msg=name)


@given(SIX, st.integers(0, 10**6), st.floats(1e-12, 1e6))
@settings(max_examples=60, deadline=None)
def test_scalars_and_shares_do_not_depend_on_the_frame(six, seed, scale):
    """Nor shares on size; the isotropic one has the sign of the volume change."""
    rotation = Rotation.random(rng=seed).as_matrix()
    tensor = tensor_from_voigt(six)
    turned = scale * (rotation @ tensor @ rotation.T)
    assert_allclose(scalar_potency(turned), scale * scalar_potency(tensor), rtol=1e-12)
    if np.any(six):
        iso, clvd, double_couple = source_shares(turned)
        assert_allclose([iso, clvd, double_couple], source_shares(tensor), atol=1e-9)
        assert_allclose(abs(iso) + abs(clvd) + double_couple, 1.0, rtol=1e-12)
        assert double_couple >= 0
        trace = np.trace(tensor)
        assert abs(trace) < 1e-9 or np.sign(iso) == np.sign(trace)


@given(SIX, st.floats(1e8, 1e11), st.floats(0.0, 2.0))
def test_potency_and_moment_are_each_other_s_inverse(six, mu, ratio):
    """Both ways; the trace of the moment is (3 lambda + 2 mu) times that of the potency."""
    potency = tensor_from_voigt(six)
    moment = moment_from_potency(potency, ratio * mu, mu)
    assert_allclose(potency_from_moment(moment, ratio * mu, mu), potency, atol=1e-14)
    assert_allclose(np.trace(moment), (3 * ratio + 2) * mu * np.trace(potency), atol=1e-12 * mu)


@given(st.floats(-12.0, 10.0))
def test_moment_of_a_magnitude_gives_the_magnitude_back(magnitude):
    assert moment_magnitude(moment_of_magnitude(magnitude)) == pytest.approx(magnitude, abs=1e-12)


def test_many_tensors_as_one_by_one():
    """Slow twin: nine components summed in plain loops."""
    tensors = tensor_from_voigt(np.random.default_rng(1).normal(size=(20, 6)))
    for tensor, potency, moment in zip(
        tensors, scalar_potency(tensors), scalar_moment(moment_from_potency(tensors, LAMBDA, MU)), strict=True
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


@pytest.mark.parametrize(
    ("values", "clear"),
    [
        ([-1.0, 0.0, 1.0], [True, True, True]),  # double couple
        ([0.0, 0.0, 1.0], [False, False, True]),  # a crack opens
        ([-1.0, 0.0, 0.0], [True, False, False]),  # one closes
        ([1.0, 1.0, 1.0], [False, False, False]),  # explosion
        ([-1.0, 0.05, 0.1], [True, False, False]),  # within a tenth
        ([-1.0, -0.2, 0.1], [True, True, True]),
    ],
)
def test_axes_are_given_where_principal_values_are_apart(values, clear):
    """In a turned frame; what is given is the principal axis."""
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    tensor = turn @ np.diag(values) @ turn.T
    found = clear_axes(tensor)
    assert np.isfinite(found).all(axis=-1).tolist() == clear
    expected = point_down(turn.T)
    assert_allclose(found[clear], expected[clear], atol=1e-9)


def test_a_lot_of_tensors_have_the_axes_of_each():
    tensors = np.array([np.diag([0.0, 0.0, 1.0]), np.diag([-1.0, 0.0, 1.0])])
    together = clear_axes(tensors)
    for one, tensor in zip(together, tensors, strict=True):
        assert_allclose(one, clear_axes(tensor))


@pytest.mark.parametrize("dilation", [0.0, 5.0, 30.0])
def test_slip_along_a_plane_that_opens_by_its_dilation_angle_has_the_share_of_flow_on_a_face(dilation):
    """Slip by 1 along x, opening by tan psi along z."""
    opening = np.tan(np.radians(dilation))
    tensor = np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 0.0], [0.5, 0.0, opening]])
    assert_allclose(source_shares(tensor)[0], shear_iso_share(dilation)[0], rtol=1e-12, atol=1e-15)
