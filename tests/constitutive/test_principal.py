"""The closed-form eigen-solve against numpy's iterative one."""

import numpy as np
import pytest
from hypothesis import given, settings

from mpm_core.constitutive.principal import (
    MAX_FAST_ERROR,
    extreme_stresses,
    principal_directions,
    principal_stresses,
    scaled_deviator,
    split_deviator,
    tensor_from_principal,
)

from .law_twins import components, principal, rotated, rotation_from, stresses

ROUND_OFF = np.finfo(float).eps


@given(stress=stresses())
@settings(max_examples=400, deadline=None)
def test_values_and_directions_rebuild_the_tensor(stress):
    """Values agree with eigvalsh and sum s n n^T gives the tensor back, to 30 round-offs of its largest entry.

    30: the largest seen in 3 million tensors was 12 (values, of which part is eigvalsh's own) and 8 (rebuilt).
    """
    s1, s2, s3, n1, n3 = principal_directions(*stress)
    allowed = 30.0 * ROUND_OFF * np.abs(stress).max()
    assert s1 >= s2 >= s3
    np.testing.assert_allclose([s1, s2, s3], principal(stress), rtol=0, atol=allowed)
    np.testing.assert_allclose(tensor_from_principal(s1, s2, s3, n1, n3), stress, rtol=0, atol=allowed)
    frame = np.array([n1, n3])
    np.testing.assert_allclose(frame @ frame.T, np.eye(2), rtol=0, atol=10.0 * ROUND_OFF)


@pytest.mark.parametrize("gap", [0.0, 1e-16, 1e-15, 1e-12, 1e-9, 1e-8, 1e-6, 1e-3])
@pytest.mark.parametrize("repeated_at", ["tensile end", "compressive end"])
def test_nearly_repeated_values_lose_no_digits(gap, repeated_at):
    """Two values a relative gap apart, in 50 turned frames: arccos alone would err by 1e-8, we by round-off."""
    values = [1.0, 1.0 - gap, -3.0] if repeated_at == "tensile end" else [3.0, -1.0, -1.0 - gap]
    for seed in range(50):
        tensor = rotated(components(np.diag(values)), rotation_from(seed))
        s1, s2, s3, n1, n3 = principal_directions(*tensor)
        np.testing.assert_allclose([s1, s2, s3], principal(tensor), rtol=0, atol=60.0 * ROUND_OFF)
        np.testing.assert_allclose(tensor_from_principal(s1, s2, s3, n1, n3), tensor, rtol=0, atol=60.0 * ROUND_OFF)


@given(stress=stresses())
@settings(max_examples=300, deadline=None)
def test_fast_values_stay_within_their_error_bound(stress):
    mean, dx, dy, dz, j2 = split_deviator(*stress)
    if j2 == 0.0:
        return
    *_, size, root = scaled_deviator(dx, dy, dz, *stress[3:], j2)
    s1, s3, error = extreme_stresses(mean, size, root)
    exact = principal(stress)
    assert error == MAX_FAST_ERROR * size
    round_off = 30.0 * ROUND_OFF * np.abs(stress).max()
    assert abs(s1 - exact[0]) <= error + round_off
    assert abs(s3 - exact[2]) <= error + round_off


@pytest.mark.parametrize("exponent", [-300, -30, 30, 300])
def test_powers_of_two_change_nothing_but_the_scale(exponent):
    """Scaling by a power of two is exact, so every digit of the values must follow."""
    tensor = np.array([-3.0, 1.7, 0.2, 0.6, -1.1, 2.3])
    scale = 2.0**exponent
    assert np.array_equal(
        np.array(principal_stresses(*(tensor * scale))), np.array(principal_stresses(*tensor)) * scale
    )


def test_an_isotropic_tensor_has_three_equal_values_and_a_frame():
    for pressure in (0.0, -1.0, 1e12):
        s1, s2, s3, n1, n3 = principal_directions(pressure, pressure, pressure, 0.0, 0.0, 0.0)
        assert (s1, s2, s3) == (pressure, pressure, pressure)
        assert np.dot(n1, n3) == 0.0


def test_a_small_deviator_on_a_large_mean_is_seen():
    """1 Pa of shear on 1 GPa of pressure: the pressure has 1e-7 Pa of round-off, no more may be lost."""
    s1, s2, s3 = principal_stresses(-1e9, -1e9, -1e9, 0.0, 0.0, 1.0)
    np.testing.assert_allclose([s1 + 1e9, s2 + 1e9, s3 + 1e9], [1.0, 0.0, -1.0], rtol=0, atol=5e-7)
