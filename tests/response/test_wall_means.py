"""The interval of a mean over a wall: coverage with roughness whose points are alike over a known length."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.distance import cdist

from mpm_core.geometry.solids import Solid
from response.scan_rays import reach_of_void
from response.wall_means import HALVINGS, divide, mean_and_interval

SIZE = np.array([20.0, 15.0])  # m, along and up a wall
MEAN, ROUGHNESS = 2.0, 0.4  # m
RUNS = 100


def wall_points(spacing: float) -> np.ndarray:
    """Points (n, xyz) of an upright wall in the plane x = 0."""
    axes = [np.arange(0.5 * spacing, size, spacing) for size in SIZE]
    y, z = np.meshgrid(*axes, indexing="ij")
    return np.column_stack([np.zeros(y.size), y.ravel(), z.ravel()])


def scanned_wall(field: np.ndarray, spacing: float) -> Solid:
    """A void between x = -10 m and a rough wall at x = field (k,), whose vertices lie on a lattice beyond SIZE."""
    count = np.ceil(SIZE / spacing).astype(int) + 1
    y, z = (value.ravel() for value in np.meshgrid(*(spacing * np.arange(n) for n in count), indexing="ij"))
    front = np.column_stack([field, y, z])
    back = np.column_stack([np.full(len(field), -10.0), y, z])
    number = np.arange(len(field)).reshape(count)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    sheet = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    rim = np.concatenate([number[:-1, 0], number[-1, :-1], number[:0:-1, -1], number[0, :0:-1]])
    following, behind = np.roll(rim, -1), len(field)
    sides = np.concatenate(
        [
            np.column_stack([rim, rim + behind, following]),
            np.column_stack([following, rim + behind, following + behind]),
        ]
    )
    mesh = trimesh.Trimesh(np.concatenate([front, back]), np.concatenate([sheet, sheet[:, ::-1] + behind, sides]))
    assert mesh.is_watertight
    assert mesh.volume > 0.0
    return Solid("wall", mesh.vertices, mesh.faces)


@pytest.mark.slow
@pytest.mark.parametrize("length", [0.3, 1.0, 3.0])
def test_intervals_cover_the_mean_of_rough_walls(length):
    """Scans of walls with exponential covariance: 95 % intervals by rays hold the mean that the walls were made with.
    Intervals of independent rays do not, as soon as neighbours are alike."""
    rng, place, spacing = np.random.default_rng(8), wall_points(0.8), 0.5
    normal, weight = np.tile([1.0, 0.0, 0.0], (len(place), 1)), np.full(len(place), 0.64)
    count = np.ceil(SIZE / spacing).astype(int) + 1
    vertices = np.stack(np.meshgrid(*(spacing * np.arange(n) for n in count), indexing="ij"), axis=-1).reshape(-1, 2)
    factor = np.linalg.cholesky(np.exp(-cdist(vertices, vertices) / length) + 1e-9 * np.eye(len(vertices)))
    held = naive = 0
    for _ in range(RUNS):
        field = MEAN + ROUGHNESS * factor @ rng.normal(size=len(vertices))
        reach = reach_of_void(scanned_wall(field, spacing), place, normal)
        mean, low, high = mean_and_interval(reach, place, weight)
        assert mean == pytest.approx(reach.mean())
        held += low <= MEAN <= high
        naive += abs(mean - MEAN) <= 1.96 * reach.std() / np.sqrt(len(reach))
    assert 0.91 <= held / RUNS <= 0.99
    assert naive / RUNS < held / RUNS
    if length >= 1.0:
        assert naive / RUNS < 0.7


def test_a_mean_of_nothing_and_of_one_and_of_a_flat_wall():
    place = wall_points(1.0)
    assert np.isnan(mean_and_interval(np.empty(0), np.empty((0, 3)), np.empty(0))).all()
    mean, low, high = mean_and_interval(np.array([0.7]), place[:1], np.ones(1))
    assert mean == 0.7
    assert np.isnan([low, high]).all()
    flat = mean_and_interval(np.full(len(place), 0.7), place, np.ones(len(place)))
    assert flat == pytest.approx((0.7, 0.7, 0.7))


@pytest.mark.parametrize("spacing", [4.0, 1.0, 0.3])
def test_blocks_have_as_many_points(spacing):
    place = wall_points(spacing)
    size = np.bincount(divide(place))
    assert len(size) == min(len(place), 2**HALVINGS)
    assert size.max() - size.min() <= max(1, 0.05 * size.max())


def test_an_interval_does_not_depend_on_place_scale_or_order():
    """In another order it stays; turned, shifted or mirrored, too, but for the blocks, which are not quite the same; k
    times the values in k times the size give k times the interval."""
    rng, place = np.random.default_rng(2), wall_points(1.0)
    values = np.cumsum(rng.normal(size=len(place))) * 0.05
    weight = rng.uniform(0.5, 1.5, len(place))
    expected = np.array(mean_and_interval(values, place, weight))
    moved = place[:, [1, 0, 2]] * [1.0, 1.0, -1.0] + [4e5, 7e6, -300.0]
    np.testing.assert_allclose(mean_and_interval(values, moved, weight), expected, rtol=0.05)
    np.testing.assert_allclose(mean_and_interval(10.0 * values, 10.0 * place, 7.0 * weight), 10.0 * expected, rtol=1e-6)
    order = rng.permutation(len(place))
    np.testing.assert_allclose(mean_and_interval(values[order], place[order], weight[order]), expected, rtol=1e-9)
