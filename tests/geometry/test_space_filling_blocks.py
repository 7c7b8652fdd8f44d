"""Blocks side by side: which one holds a point, against a comparison with each, and what is wrong with them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpm_core.geometry.blocks import NO_BLOCK, Blocks

IDENTITY = np.zeros(3), np.eye(3)


def lattice(count, side=(1.0, 1.0, 1.0), corner=(0.0, 0.0, 0.0)) -> Blocks:
    """Equal blocks side by side."""
    index = np.stack(np.meshgrid(*map(np.arange, count), indexing="ij"), axis=-1).reshape(-1, 3)
    lower = np.array(corner) + index * np.array(side)
    return Blocks(lower, lower + side, *IDENTITY)


def divided(random: np.random.Generator, halvings: int) -> Blocks:
    """One box, of which a random block is cut in two along a random axis at a random place, again and again."""
    lower, upper = [np.zeros(3)], [np.array([64.0, 48.0, 32.0])]
    for _ in range(halvings):
        number, axis = random.integers(len(lower)), random.integers(3)
        place = lower[number][axis] + random.uniform(0.2, 0.8) * (upper[number] - lower[number])[axis]
        lower.append(lower[number].copy())
        upper.append(upper[number].copy())
        upper[number][axis] = lower[-1][axis] = place
    return Blocks(np.array(lower), np.array(upper), *IDENTITY)


def of_each(blocks: Blocks, points: np.ndarray) -> np.ndarray:
    """The last block that holds each point, by comparison with all."""
    inside = ((points[:, None] >= blocks.lower) & (points[:, None] <= blocks.upper)).all(axis=2)
    last = inside.shape[1] - 1 - inside[:, ::-1].argmax(axis=1)
    return np.where(inside.any(axis=1), last, NO_BLOCK)


@given(seed=st.integers(0, 2**32 - 1), halvings=st.integers(0, 60))
@settings(max_examples=40, deadline=None)
def test_a_point_lies_in_the_block_that_a_comparison_with_all_finds(seed, halvings):
    random = np.random.default_rng(seed)
    blocks = divided(random, halvings)
    points = random.uniform(-4.0, 68.0, (300, 3))
    assert np.array_equal(blocks.at(points), of_each(blocks, points))
    corners = np.concatenate([blocks.lower, blocks.upper])  # on faces, edges and corners: of one of those that meet
    assert (blocks.at(corners) != NO_BLOCK).all()


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_blocks_that_fill_a_box_have_no_gap_and_no_overlap(seed):
    random = np.random.default_rng(seed)
    blocks = divided(random, 30)
    assert blocks.overlaps().share == 0.0
    assert blocks.gaps().share == 0.0
    assert blocks.apart() == 0.0
    missing = np.delete(np.arange(31), random.integers(31))
    assert np.isclose(blocks.volume.sum(), 64.0 * 48.0 * 32.0)
    assert (Blocks(blocks.lower[missing], blocks.upper[missing], *IDENTITY).at(blocks.lower) != NO_BLOCK).sum() >= 29


def test_order_and_place_change_nothing():
    random = np.random.default_rng(7)
    blocks, points = divided(random, 50), random.uniform(0.0, 32.0, (500, 3))
    order = random.permutation(51)
    other = Blocks(blocks.lower[order], blocks.upper[order], *IDENTITY)
    assert np.array_equal(order[other.at(points)], blocks.at(points))
    far = np.array([700_000.0, 7_000_000.0, -900.0])
    moved = Blocks(blocks.lower + far, blocks.upper + far, *IDENTITY)
    assert np.array_equal(moved.at(points + far), blocks.at(points))


def test_turned_and_tilted_blocks_hold_turned_and_tilted_points():
    random = np.random.default_rng(8)
    blocks, points = divided(random, 40), random.uniform(-2.0, 40.0, (500, 3))
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    origin = np.array([500.0, -30.0, 8.0])
    turned = Blocks(blocks.lower, blocks.upper, origin, axes)
    assert np.array_equal(turned.at(points @ axes + origin), blocks.at(points))


def test_one_large_block_among_many_small_ones():
    """Bins follow the mean side. A block that reaches into thousands of them must not be lost, nor fill the memory."""
    small = lattice((40, 40, 10))
    blocks = Blocks(
        np.append(small.lower, [[0.0, 0.0, 10.0]], axis=0), np.append(small.upper, [[400.0, 400.0, 410.0]], axis=0),
        *IDENTITY,
    )  # fmt: skip
    random = np.random.default_rng(9)
    points = random.uniform(0.0, [60.0, 60.0, 60.0], (2000, 3))
    assert np.array_equal(blocks.at(points), of_each(blocks, points))
    assert blocks.overlaps().share == 0.0


def test_a_block_that_is_missing_inside_is_a_gap_and_one_at_the_surface_is_none():
    blocks = lattice((10, 10, 10), side=(5.0, 5.0, 5.0))
    inside, outside = np.ones(1000, bool), np.ones(1000, bool)
    inside[555] = outside[5] = False
    gap = Blocks(blocks.lower[inside], blocks.upper[inside], *IDENTITY).gaps()
    assert gap.share == pytest.approx(1e-3, rel=0.1)
    assert (gap.point >= blocks.lower[555]).all()
    assert (gap.point <= blocks.upper[555]).all()
    assert Blocks(blocks.lower[outside], blocks.upper[outside], *IDENTITY).gaps().share == 0.0


def test_a_block_said_twice_and_one_that_is_too_wide_overlap():
    blocks = lattice((4, 4, 4), side=(5.0, 5.0, 5.0))
    row = np.append(np.arange(64), 9)
    twice = Blocks(blocks.lower[row], blocks.upper[row], *IDENTITY)
    assert twice.overlaps().share == pytest.approx(1 / 65)
    assert np.allclose(twice.overlaps().point, 0.5 * (blocks.lower[9] + blocks.upper[9]))
    wide = Blocks(blocks.lower, blocks.upper + 2.0, *IDENTITY)
    assert wide.overlaps().share > 0.9


def test_rounded_coordinates_are_no_gap_and_no_overlap():
    """A third of a metre, written with two decimals."""
    blocks = lattice((12, 12, 12), side=(10 / 3, 10 / 3, 10 / 3))
    middle, side = np.round(0.5 * (blocks.lower + blocks.upper), 2), np.round(blocks.upper - blocks.lower, 2)
    rounded = Blocks(middle - 0.5 * side, middle + 0.5 * side, *IDENTITY)
    assert rounded.overlaps().share == 0.0
    assert rounded.gaps().share == 0.0


def test_blocks_that_touch_no_other_lie_apart():
    blocks = lattice((6, 6, 6), side=(5.0, 5.0, 5.0))
    assert Blocks(blocks.lower, blocks.lower + 2.5, *IDENTITY).apart() == 1.0
    assert blocks.apart() == 0.0
    assert Blocks(blocks.lower[:1], blocks.upper[:1], *IDENTITY).apart() == 0.0
