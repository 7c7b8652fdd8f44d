"""Fields at points: uniform and linear stress are read as they are, at walls too, and not across openings."""

import numpy as np
import pytest
from small_mines import load, moved_by, rock_of, states_of

from response.field import values_at
from response.rock import MINED

PAIR = [  # Two openings with a pillar of 2 m between them, turned against nothing: walls lie within cells.
    {"name": "west", "shape": "box", "lower": ["-7.3 m", "-4.2 m", "-3 m"], "upper": ["-1.3 m", "4.2 m", "3 m"]},
    {"name": "east", "shape": "box", "lower": ["0.7 m", "-4.2 m", "-3 m"], "upper": ["6.7 m", "4.2 m", "3 m"]},
]


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pair")
    return states_of(load(folder, PAIR), folder)


def with_stress(state, stress):
    return state.assign(stress=(("particle", "voigt"), stress))


def rock_points(rock, count=400):
    """Points of rock around the openings."""
    place = np.random.default_rng(1).uniform(-10.0, 10.0, (4 * count, 3))
    return place[rock.what(place)[0] != MINED][:count]


def test_a_linear_stress_is_read_as_it_is(pair):
    grid, state = pair
    slope, shift = np.random.default_rng(2).normal(size=(3, 6)) * 1e5, np.arange(6.0) * 1e6
    rock = rock_of(grid, with_stress(state, state["position"].values @ slope + shift))
    place = rock_points(rock)
    found = values_at(rock, place)
    np.testing.assert_allclose(found.stress, place @ slope + shift, atol=1.0)
    assert np.nanmax(found.stress_error) < 1e6  # of a gradient of 1e5 Pa/m and cells of 1 m


def test_a_uniform_stress_has_no_error(pair):
    grid, state = pair
    rock = rock_of(grid, with_stress(state, np.full((state.sizes["particle"], 6), -3e6)))
    found = values_at(rock, rock_points(rock))
    np.testing.assert_allclose(found.stress, -3e6)
    np.testing.assert_allclose(found.stress_error, 0.0, atol=1e-3)


def test_displacement_is_that_of_the_nodes(pair):
    grid, state = pair
    gradient, shift = np.random.default_rng(3).normal(size=(3, 3)) * 1e-4, np.array([0.1, -0.2, 0.3])
    rock = rock_of(grid, moved_by(state, gradient, shift))
    place = rock_points(rock)
    np.testing.assert_allclose(values_at(rock, place).displacement, place @ gradient.T + shift, atol=1e-7)


def test_rock_beyond_an_opening_does_not_count(pair):
    """Stress that differs on both sides of the west opening: at its west wall only the near side is read."""
    grid, state = pair
    side = np.where(state["position"].values[:, :1] < -4.3, -1e6, -9e6) * np.ones(6)
    rock = rock_of(grid, with_stress(state, side))
    found = values_at(rock, np.array([[-7.5, 0.0, 0.0], [-0.3, 0.0, 0.0]]))
    np.testing.assert_allclose(found.stress[0], -1e6)
    np.testing.assert_allclose(found.stress[1], -9e6)


SEAM = {
    "name": "seam",
    "material": "seam",
    "shape": "box",
    "lower": ["-16 m", "-16 m", "4 m"],
    "upper": ["16 m", "16 m", "5 m"],
}
BODY = {
    "name": "ore",
    "material": "ore",
    "shape": "box",
    "lower": ["-16 m", "-16 m", "-16 m"],
    "upper": ["9 m", "16 m", "4 m"],
}


@pytest.fixture(scope="module")
def bodies(tmp_path_factory):
    """The openings in an ore body, below a seam of one cell, in host rock."""
    folder = tmp_path_factory.mktemp("bodies")
    rock = {"model": "elastic", "youngs_modulus": "50 GPa", "poisson_ratio": 0.25, "density": "2700 kg/m^3"}
    materials = dict.fromkeys(("host", "ore", "seam"), rock)
    mine = load(folder, PAIR, materials=materials, rock_bodies=[BODY, SEAM])
    return states_of(mine, folder)


def test_stress_of_another_rock_body_does_not_count(bodies):
    """Stress that is linear in each body, and jumps between them, is read as it is on both sides of a contact."""
    grid, state = bodies
    slope, shift = np.random.default_rng(4).normal(size=(3, 3, 6)) * 1e5, np.array([[1e6], [-4e6], [9e6]])
    slope[2, 2] = 0.0  # of the seam: cells that lie in one plane show no slope across it
    body = state["cell_body"].values[state["cell"].values] + 1
    assert set(body) == {0, 1, 2}
    place = state["position"].values
    rounded = place + 1e-9 * np.random.default_rng(5).normal(size=place.shape)
    state = state.assign(position=(("particle", "xyz"), rounded))
    rock = rock_of(grid, with_stress(state, np.einsum("pi,pic->pc", place, slope[body]) + shift[body]))
    points = np.concatenate(
        [
            [[x, y, z] for x in (-8.0, 0.0, 8.7) for y in (-5.0, 0.3) for z in (3.3, 3.9, 4.1, 4.5, 4.9, 5.1, 5.6)],
            [[8.9, 0.2, 0.0], [9.1, 0.2, 0.0]],
        ]
    )
    own = np.where(points[:, 2] > 4.0, np.where(points[:, 2] < 5.0, 2, 0), np.where(points[:, 0] < 9.0, 1, 0))
    found = values_at(rock, points)
    np.testing.assert_allclose(found.stress, np.einsum("pi,pic->pc", points, slope[own]) + shift[own], atol=1.0)


def test_a_point_on_a_wall_has_values_and_one_within_an_opening_has_none(pair):
    grid, state = pair
    found = values_at(rock_of(grid, state), np.array([[-7.3, 0.0, 0.0], [-4.0, 0.0, 0.0], [0.0, 0.0, 99.0]]))
    assert np.isfinite(found.stress[0]).all()
    assert np.isfinite(found.displacement[0]).all()
    assert np.isnan(found.stress[1:]).all()
    assert np.isnan(found.displacement[1:]).all()
