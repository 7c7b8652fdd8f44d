"""Stress of a smeared source: against Kelvin's solution, equilibrium, decay, symmetries, and an energy above zero."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial.hermite_e import hermegauss
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from baselines.point_source import (
    MIN_STRESS_SHARE,
    boys,
    crack_factor,
    reach,
    slip_tensor,
    smearing,
    source_stress,
    traction,
)
from common.source_tensors import scalar_potency
from common.voigt import tensor_from_voigt

SHEAR = 2.0
seeds, ratios = st.integers(0, 10_000), st.floats(0.0, 0.45)


def slip_at_random(generator) -> np.ndarray:
    """Potency tensor of slip along a random plane, with potency 1."""
    normal, direction = np.linalg.qr(generator.normal(size=(3, 2)))[0].T
    return slip_tensor(normal, direction)


def stress_at(places, potency, ratio, width=1e-3):
    """Stress tensors (place, 3, 3) of a source that is nearly a point."""
    places = np.atleast_2d(places)
    return tensor_from_voigt(source_stress(places, potency, SHEAR, ratio, np.full(len(places), width)))


def kelvin(place, ratio):
    """Displacement (3, 3) by unit forces along each axis in an infinite body (Kelvin's solution), force second."""
    distance = np.linalg.norm(place)
    both = (3.0 - 4.0 * ratio) * np.eye(3) + np.outer(place, place) / distance**2
    return both / (16.0 * np.pi * SHEAR * (1.0 - ratio) * distance)


def stress_by_differences(place, potency, ratio, step=1e-3):
    """The slow twin: displacement is minus the moment tensor times the gradient of Kelvin's, stress by Hooke's law."""
    shifts = step * np.eye(3)

    def displacement(at):
        gradient = np.stack([kelvin(at + shift, ratio) - kelvin(at - shift, ratio) for shift in shifts], axis=-1)
        return -np.einsum("ijk,jk->i", gradient / (2.0 * step), 2.0 * SHEAR * potency)

    gradient = np.stack([displacement(place + shift) - displacement(place - shift) for shift in shifts], axis=-1)
    strain = (gradient + gradient.T) / (4.0 * step)
    return 2.0 * SHEAR * (strain + ratio / (1.0 - 2.0 * ratio) * np.trace(strain) * np.eye(3))


def point_stress(places, potency, ratio):
    """Closed form of a point: G / (4 pi (1 - nu) r^3) times four tensors of the direction."""
    distance = np.linalg.norm(places, axis=1)
    unit = places / distance[:, None]
    along = unit @ potency
    across = np.sum(unit * along, axis=1)[:, None, None]
    pair = unit[:, :, None] * along[:, None, :]
    tensor = 2.0 * (1.0 - 2.0 * ratio) * potency + 6.0 * ratio * (pair + np.swapaxes(pair, 1, 2))
    tensor = tensor + across * (3.0 * (1.0 - 2.0 * ratio) * np.eye(3) - 15.0 * unit[:, :, None] * unit[:, None, :])
    return SHEAR / (4.0 * np.pi * (1.0 - ratio)) * tensor / distance[:, None, None] ** 3


@given(seed=seeds, ratio=ratios)
def test_a_narrow_source_has_the_stress_of_kelvins_solution(seed, ratio):
    """By differences, and in the closed form of a point."""
    generator = np.random.default_rng(seed)
    potency, place = slip_at_random(generator), generator.normal(size=3)
    place /= np.linalg.norm(place)
    expected = stress_by_differences(place, potency, ratio)
    found = stress_at(place, potency, ratio)[0]
    np.testing.assert_allclose(found, expected, atol=2e-4 * np.abs(expected).max())
    np.testing.assert_allclose(found, point_stress(place[None], potency, ratio)[0], atol=1e-4 * np.abs(expected).max())


@given(seed=seeds, ratio=ratios)
@settings(max_examples=20)
def test_a_wide_source_has_the_mean_stress_of_points(seed, ratio):
    """Gauss-Hermite quadrature over points of the normal distribution, eight widths away."""
    generator = np.random.default_rng(seed)
    potency, place, width = slip_at_random(generator), generator.normal(size=3), 0.1
    place *= 8.0 * width / np.linalg.norm(place)
    nodes, weights = hermegauss(12)
    shifts = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    weight = np.prod(np.stack(np.meshgrid(weights, weights, weights, indexing="ij"), axis=-1), axis=-1).reshape(-1)
    expected = np.tensordot(weight / weight.sum(), point_stress(place - width * shifts, potency, ratio), axes=1)
    np.testing.assert_allclose(stress_at(place, potency, ratio, width)[0], expected, atol=1e-4 * np.abs(expected).max())


@given(seed=seeds, ratio=ratios, distance=st.floats(0.01, 5.0))
def test_stress_is_in_equilibrium(seed, ratio, distance):
    """The divergence is 0, within the source, too."""
    generator = np.random.default_rng(seed)
    potency, place, step = slip_at_random(generator), generator.normal(size=3), 1e-4
    place *= distance / np.linalg.norm(place)
    parts = [
        (stress_at(place + shift, potency, ratio, 1.0) - stress_at(place - shift, potency, ratio, 1.0))[0, axis]
        for axis, shift in enumerate(step * np.eye(3))
    ]
    largest = np.abs(parts).max()
    np.testing.assert_allclose(np.sum(parts, axis=0), 0.0, atol=1e-5 * largest + 1e-14)


@given(seed=seeds, ratio=ratios, factor=st.floats(0.1, 50.0))
def test_stress_falls_with_the_cube_of_distance_and_is_that_of_the_opposite_place(seed, ratio, factor):
    """With the width in proportion. Plane and direction of slip may change places. It turns with the source."""
    generator = np.random.default_rng(seed)
    normal, direction = np.linalg.qr(generator.normal(size=(3, 2)))[0].T
    potency, place = slip_tensor(normal, direction), generator.normal(size=3)
    here = stress_at(place, potency, ratio, 0.7)[0]
    scale = np.abs(here).max()
    np.testing.assert_allclose(
        stress_at(factor * place, potency, ratio, 0.7 * factor)[0] * factor**3, here, atol=1e-9 * scale
    )
    np.testing.assert_allclose(stress_at(-place, potency, ratio, 0.7)[0], here, atol=1e-12 * scale)
    np.testing.assert_array_equal(slip_tensor(direction, normal), potency)
    turn = Rotation.random(rng=generator).as_matrix()
    np.testing.assert_allclose(
        stress_at(turn @ place, turn @ potency @ turn.T, ratio, 0.7)[0], turn @ here @ turn.T, atol=1e-9 * scale
    )


def test_far_away_width_does_not_matter():
    """Stress of a source of any width tends to r^-3: ten times as far, a thousandth, to the square of width over
    distance."""
    potency, place = slip_at_random(np.random.default_rng(1)), np.array([60.0, 30.0, -70.0])
    near, far = (stress_at(factor * place, potency, 0.25, 1.0)[0] for factor in (1.0, 10.0))
    np.testing.assert_allclose(1000.0 * far, near, atol=2e-3 * np.abs(near).max())


def test_slip_loads_rock_beside_the_source_along_plane_and_normal():
    """Shear along the plane of slip grows by (1 + nu) G P / (4 pi (1 - nu) r^3) on both axes; it falls between."""
    potency, ratio = slip_tensor(np.array([0.0, 0, 1]), np.array([1.0, 0, 0])), 0.25
    places = 2.0 * np.array([[1.0, 0, 0], [0, 0, 1], [np.sqrt(0.5), 0, np.sqrt(0.5)]])
    shear = stress_at(places, potency, ratio)[:, 0, 2]
    expected = (1.0 + ratio) * SHEAR / (4.0 * np.pi * (1.0 - ratio) * 8.0)
    np.testing.assert_allclose(shear[:2], expected, rtol=1e-4)
    assert shear[2] < 0.0


@given(ratio=ratios)
def test_a_crack_takes_its_stress_drop_off_its_own_plane(ratio):
    """Source and plane are smeared alike, so the width is that of both together; nothing else acts on the plane."""
    radius, drop = 3.0, 5e6
    normal, direction = np.array([0.0, 0, 1]), np.array([1.0, 0, 0])
    potency = crack_factor(ratio) * drop / SHEAR * radius**3 * slip_tensor(normal, direction)
    width = np.sqrt(2.0) * smearing(ratio) * radius
    own = source_stress(np.zeros((1, 3)), potency, SHEAR, ratio, np.array([width]))
    np.testing.assert_allclose(traction(own, normal[None])[0], -drop * direction, rtol=1e-9, atol=1e-3)


@given(seed=seeds, ratio=ratios, count=st.integers(2, 12))
@settings(max_examples=30)
def test_no_slips_have_an_energy_below_zero(seed, ratio, count):
    """Of flaws of any size that lie in each other: the matrix of stress taken off each by slip on each other."""
    generator = np.random.default_rng(seed)
    place, radius = generator.uniform(0, 4, (count, 3)), generator.uniform(0.5, 4.0, count)
    tensor = np.array([slip_at_random(generator) for _ in range(count)])
    width = smearing(ratio) * radius
    work = np.array(
        [
            -np.sum(
                tensor
                * tensor_from_voigt(
                    source_stress(place - place[source], tensor[source], SHEAR, ratio, np.hypot(width, width[source]))
                ),
                axis=(1, 2),
            )
            for source in range(count)
        ]
    )
    np.testing.assert_allclose(work, work.T, atol=1e-9 * np.abs(work).max())
    values = np.linalg.eigvalsh(work)
    assert values[0] >= -1e-9 * values[-1]


@given(seed=seeds, ratio=ratios)
def test_reach_is_where_the_largest_stress_is_the_least_that_counts(seed, ratio):
    """Of a crack with a stress drop of 1 Pa: on the axes of compression and tension, and nowhere more."""
    generator = np.random.default_rng(seed)
    radius, normal, direction = 3.0, np.array([0.0, 0, 1]), np.array([1.0, 0, 0])
    potency = crack_factor(ratio) / SHEAR * radius**3 * slip_tensor(normal, direction)
    distance = reach(radius, ratio)
    tension = distance * (normal + direction) / np.sqrt(2.0)
    found = np.linalg.eigvalsh(stress_at(tension, potency, ratio, 0.01)[0])[0]
    assert found == pytest.approx(-MIN_STRESS_SHARE, rel=1e-3)
    places = generator.normal(size=(200, 3))
    places *= distance / np.linalg.norm(places, axis=1)[:, None]
    assert np.abs(stress_at(places, potency, ratio, 0.01)).max() <= 1.001 * MIN_STRESS_SHARE


@pytest.mark.parametrize("argument", [0.0, 1e-14, 1e-6, 0.3, 5.0, 80.0])
def test_boys_functions_are_their_integrals(argument):
    """By quadrature."""
    for order, found in enumerate(boys(np.array([argument]))):
        assert found[0] == pytest.approx(quad(lambda t, k=order: t ** (2 * k) * np.exp(-argument * t * t), 0, 1)[0])


def test_crack_and_slip_have_the_potency_of_the_textbook():
    """16 (1 - nu) / (3 (2 - nu)) is 16 / 7 for Poisson's ratio 0.25; the scalar potency of slip is slip times area."""
    assert crack_factor(0.25) == pytest.approx(16.0 / 7.0)
    assert crack_factor(0.0) == pytest.approx(8.0 / 3.0)
    assert scalar_potency(slip_at_random(np.random.default_rng(0))) == pytest.approx(1.0)
