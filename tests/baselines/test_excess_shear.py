"""Excess shear stress against a search over planes, what states raise it by, and events drawn from that."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rock_fixtures import QUIET, SLIPPING, STRENGTH, block

from baselines.catalogues import draw_places, excess_shear_stress, raised_excess
from baselines.point_source import traction
from common.voigt import voigt_from_tensor

NORMALS = np.stack(np.meshgrid(np.linspace(0, np.pi, 181), np.linspace(0, np.pi, 181)), axis=-1).reshape(-1, 2)
NORMALS = np.stack(
    [
        np.sin(NORMALS[:, 0]) * np.cos(NORMALS[:, 1]),
        np.sin(NORMALS[:, 0]) * np.sin(NORMALS[:, 1]),
        np.cos(NORMALS[:, 0]),
    ],
    axis=-1,
)


@given(seed=st.integers(0, 10_000), angle=st.floats(0.0, 60.0))
def test_largest_excess_is_that_of_a_search_over_planes(seed, angle):
    """Planes a degree apart come within the square of half a degree; none exceeds the closed form."""
    generator = np.random.default_rng(seed)
    tensor = generator.normal(size=(3, 3))
    tensor = tensor + tensor.T - 2.0 * np.eye(3)
    stress = voigt_from_tensor(tensor)
    on_plane = traction(np.broadcast_to(stress, (len(NORMALS), 6)), NORMALS)
    across = np.sum(on_plane * NORMALS, axis=1)
    shear = np.linalg.norm(on_plane - across[:, None] * NORMALS, axis=1)
    searched = np.max(shear + across * np.tan(np.radians(angle)))
    found = excess_shear_stress(stress[None], angle)[0]
    size = np.ptp(np.linalg.eigvalsh(tensor)) / np.cos(np.radians(angle))
    assert searched <= found + 1e-12 * size
    assert found - searched < 5e-4 * size


def test_uniaxial_compression_without_friction_has_half_of_it_as_shear():
    """The limit of Tresca; hydrostatic pressure has no excess with friction."""
    assert excess_shear_stress(np.array([[-10.0, 0, 0, 0, 0, 0]]), 0.0)[0] == pytest.approx(5.0)
    assert excess_shear_stress(QUIET[None], 20.0)[0] < 0.0


def test_only_what_mining_raises_above_zero_counts():
    """Less excess, or none after none, counts as none; what is mined counts no more, half-mined rock by half."""
    states = [QUIET, QUIET, SLIPPING, 0.5 * SLIPPING, 2.0 * SLIPPING]
    rock = block(states, cells=1, edge=2.0, share=[1, 1, 1, 1, 0.5])
    excess = excess_shear_stress(SLIPPING[None], 20.0)[0]
    expected = [0.0, 0.0, 8.0 * excess, 0.0, 4.0 * (2.0 - 0.5) * excess]
    np.testing.assert_allclose(raised_excess(rock, STRENGTH)[:, 0], expected)
    assert excess > 0.0


def test_events_follow_the_numbers_expected():
    """Of each state and part: chi-square of the counts; places lie in their part, in no order of parts."""
    rock = block([QUIET, SLIPPING], cells=2)
    numbers = np.arange(1, 17).reshape(2, 8) * 20.0
    state, place = draw_places(rock, numbers, np.random.default_rng(4))
    part = (place // 10.0).astype(int) @ np.array([4, 2, 1])
    counts = np.zeros((2, 8))
    np.add.at(counts, (state, part), 1)
    assert np.sum((counts - numbers) ** 2 / numbers) < 40.0  # 16 degrees of freedom: p = 0.001
    assert np.any(np.diff(part[state == 0]) < 0)
