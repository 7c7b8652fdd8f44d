"""Cells with moved corners, beside what holds for any of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid.distorted_cells import (
    DistortedCells,
    corner_offsets,
    fullest_samples,
    part_integrals,
    points_of_samples,
    points_with_volume,
    sample_volumes,
    smallest_element,
    sub_cell_middles,
)
from mpm_core.model.particles import centroids, mean_modes, shapes_of, shares_of_volume, slopes_of

FULL = np.uint64(2**64 - 1)
BITS = st.integers(1, 2**64 - 1).map(np.uint64)


def bent(dimension, seed, most=0.25):
    """Corners (2^d, d) of a cell, each moved by up to `most` of its edge."""
    random = np.random.default_rng(seed)
    return corner_offsets(dimension) + random.uniform(-most, most, (1 << dimension, dimension))


@given(st.sampled_from([2, 3]), BITS)
@settings(deadline=None)
def test_a_cube_has_the_means_of_its_samples(dimension, samples):
    found = part_integrals(corner_offsets(dimension)[None].astype(float), np.array([samples]))
    modes = mean_modes(np.array([samples]), dimension)
    assert found.volume[0] == pytest.approx(np.bitwise_count(samples) / SAMPLES_PER_CELL)
    np.testing.assert_allclose(found.modes, modes, atol=1e-14)
    np.testing.assert_allclose(found.place, centroids(modes), atol=1e-13)
    np.testing.assert_allclose(found.gradients, shapes_of(modes, slopes_of(modes))[1], atol=1e-14)


@given(st.sampled_from([2, 3]), st.integers(0, 999), BITS)
@settings(max_examples=30, deadline=None)
def test_a_linear_field_has_its_gradient_in_any_part(dimension, seed, samples):
    """The patch test of one cell: to round-off, whatever its shape and the part of it."""
    corners, gradient = bent(dimension, seed)[None], np.random.default_rng(seed).normal(size=(dimension, dimension))
    found = part_integrals(corners, np.array([samples]))
    np.testing.assert_allclose(found.gradients.sum(axis=1), 0.0, atol=1e-13)
    values = corners[0] @ gradient.T  # in cells; gradients are in units of 2 over the edge
    np.testing.assert_allclose(2.0 * np.einsum("cj,ci->ij", found.gradients[0], values), gradient, atol=1e-12)


@given(st.sampled_from([2, 3]), st.integers(0, 999), BITS)
@settings(max_examples=30, deadline=None)
def test_a_part_and_the_rest_are_the_whole(dimension, seed, samples):
    corners = np.repeat(bent(dimension, seed)[None], 3, axis=0)
    rest = ~samples if samples != FULL else np.uint64(1)
    held = samples if samples != FULL else FULL ^ np.uint64(1)
    part = part_integrals(corners, np.array([held, rest, FULL]))
    assert part.volume[0] + part.volume[1] == pytest.approx(part.volume[2])
    assert sample_volumes(corners[:1]).sum() == pytest.approx(part.volume[2])
    for name in ("place", "modes", "gradients"):
        values = getattr(part, name)
        mean = (part.volume[0] * values[0] + part.volume[1] * values[1]) / part.volume[2]
        np.testing.assert_allclose(mean, values[2], atol=1e-12, err_msg=name)


@pytest.mark.parametrize("dimension", [2, 3])
def test_cells_around_a_moved_node_balance_there(dimension):
    """The gradients of its shape function, integrated over all cells around a node, add up to nothing."""
    shift, total = np.random.default_rng(1).uniform(-0.3, 0.3, dimension), np.zeros(dimension)
    for corner in range(1 << dimension):
        corners = corner_offsets(dimension).astype(float)
        corners[corner] += shift
        found = part_integrals(corners[None], np.array([FULL]))
        total += found.gradients[0, corner] * found.volume[0]
    np.testing.assert_allclose(total, 0.0, atol=1e-14)


@pytest.mark.parametrize("dimension", [2, 3])
def test_points_lie_in_their_sub_cells_and_are_their_own_mirror_image(dimension):
    points, per_edge = points_of_samples(dimension), round(SAMPLES_PER_CELL ** (1 / dimension))
    middles = sub_cell_middles(dimension)[:, None, :]
    assert (np.abs(points - middles) <= 0.5 / per_edge).all()
    known = {tuple(p) for p in np.round(points.reshape(-1, dimension), 9).tolist()}
    assert len(known) == SAMPLES_PER_CELL << dimension
    for axis in range(dimension):
        mirrored = points.reshape(-1, dimension).copy()
        mirrored[:, axis] = 1.0 - mirrored[:, axis]
        assert {tuple(p) for p in np.round(mirrored, 9).tolist()} == known


@pytest.mark.parametrize("dimension", [2, 3])
def test_points_are_where_the_corners_take_them_and_stand_for_what_is_around_them(dimension):
    """Places: the trilinear image, a product along each axis; volumes: differences of places, summed to the cell's."""
    corners, step = np.stack([bent(dimension, seed) for seed in range(5)]), 1e-6
    points = points_of_samples(dimension).reshape(-1, dimension)

    def image(at):
        bits = corner_offsets(dimension)
        shape = np.prod(np.where(bits == 1, at[:, None, :], 1.0 - at[:, None, :]), axis=2)
        return np.einsum("pc,kcj->kpj", shape, corners)

    places, volume = points_with_volume(corners)
    np.testing.assert_allclose(places.reshape(5, -1, dimension), image(points), atol=1e-15)
    jacobian = np.stack(
        [(image(points + way) - image(points - way)) / (2 * step) for way in step * np.eye(dimension)], axis=3
    )
    np.testing.assert_allclose(volume.reshape(5, -1), np.linalg.det(jacobian) / len(points), rtol=1e-8)


@given(st.lists(BITS, min_size=1, max_size=20))
@settings(deadline=None)
def test_shares_of_volume_are_sums_over_samples(samples):
    """All and none are whole numbers."""
    samples = np.array([*samples, FULL, np.uint64(0)])
    corners = np.stack([bent(3, seed) for seed in range(len(samples))])
    volume = sample_volumes(corners)
    held = samples[:, None] >> np.arange(SAMPLES_PER_CELL, dtype=np.uint64) & np.uint64(1)
    expected = np.sum(volume * held, axis=1) / volume.sum(axis=1)
    found = shares_of_volume(
        DistortedCells(np.arange(len(samples), dtype=np.int32), corners), np.arange(len(samples)), samples
    )
    np.testing.assert_allclose(found, expected, rtol=1e-14)
    assert found[-2:].tolist() == [1.0, 0.0]


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_smallest_element_of_a_cube_is_one_and_of_a_turned_cell_negative(dimension):
    cube, points = corner_offsets(dimension).astype(float), sub_cell_middles(dimension)
    assert smallest_element(cube, points) == pytest.approx(1.0)
    folded = cube.copy()
    folded[-1] = -0.6
    assert smallest_element(folded, points) < 0.0


@given(st.sampled_from([2, 3]), st.integers(0, 999))
@settings(deadline=None)
def test_fullest_samples_have_the_volume_filled_and_are_mirrored_with_it(dimension, seed):
    """Half a sample's volume, as no two are filled alike."""
    random = np.random.default_rng(seed)
    volume = random.uniform(0.5, 1.5, (1, SAMPLES_PER_CELL)) / SAMPLES_PER_CELL
    filled = volume * random.uniform(0.0, 1.0, (1, SAMPLES_PER_CELL))
    per_edge = round(SAMPLES_PER_CELL ** (1 / dimension))
    held = [fullest_samples(filled, volume, dimension)]
    for axis in range(dimension):
        shape = (per_edge,) * dimension
        one, other = (np.flip(values.reshape(shape), axis).reshape(1, -1) for values in (filled, volume))
        held.append(fullest_samples(one, other, dimension))
        bits = np.unpackbits(held[-1].view(np.uint8), bitorder="little").reshape(shape)
        own = np.unpackbits(held[0].view(np.uint8), bitorder="little").reshape(shape)
        np.testing.assert_array_equal(np.flip(bits, axis), own)
    chosen = np.unpackbits(held[0].view(np.uint8), bitorder="little").astype(bool)
    assert abs(volume[0, chosen].sum() - filled.sum()) <= 0.5 * volume.max() + 1e-9


def test_mirror_images_within_a_cell_are_taken_together():
    """A layer of 16 samples, a little fuller near the middle: its middle four come or stay away as one."""
    volume = np.full((1, SAMPLES_PER_CELL), 1.0 / SAMPLES_PER_CELL)
    layer = np.zeros((4, 4, 4))
    for taken in (0.3, 0.7):
        layer[0, 1:3, 1:3] = taken
        held = fullest_samples(layer.reshape(1, -1) / SAMPLES_PER_CELL, volume, 3)[0]
        assert np.bitwise_count(held) == (4 if taken > 0.5 else 0)
