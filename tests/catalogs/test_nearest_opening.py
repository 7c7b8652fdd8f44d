"""The nearest opening against a search over all cells; order, time and places that are inside."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from catalogs.sources.openings import NEVER, ROCK, Mining, latest_first, nearest_opening


def block(lower, upper, edge):
    """Lower corners of the cells of a block."""
    axes = [np.arange(a, b, edge) for a, b in zip(lower, upper, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


STOPE, DRIVE = block([0, 0, 0], [10, 20, 30], 2.0), block([30, -40, 10], [34, 60, 14], 2.0)
CELLS, OPENING = np.concatenate([STOPE, DRIVE]), np.repeat([0, 1], [len(STOPE), len(DRIVE)])
RANK = np.array([0, 1])


@given(seed=st.integers(0, 1000))
def test_it_is_that_of_a_search_over_all_cells(seed):
    """By the distance to their sides."""
    points = np.random.default_rng(seed).uniform([-50, -60, -30], [80, 90, 60], (20, 3))
    found, distance = nearest_opening(points, CELLS, 2.0, OPENING, np.array([True, True]), RANK)
    outside = np.maximum(np.maximum(CELLS - points[:, None], points[:, None] - CELLS - 2.0), 0.0)
    exact = np.linalg.norm(outside, axis=2)
    np.testing.assert_allclose(distance, exact.min(axis=1), atol=1e-9)
    of_found = np.where(OPENING == found[:, None], exact, np.inf).min(axis=1)
    np.testing.assert_allclose(of_found, distance, atol=1e-9)


def test_openings_that_are_not_mined_yet_are_not_there():
    """Inside the stope before it is mined, the drive is nearest; afterwards the distance is 0."""
    inside = np.array([[5.0, 10.0, 12.0]])
    before, after = (
        nearest_opening(inside, CELLS, 2.0, OPENING, np.array([mined, True]), RANK) for mined in (False, True)
    )
    assert (before[0][0], before[1][0]) == (1, 25.0)
    assert (after[0][0], after[1][0]) == (0, 0.0)
    none = nearest_opening(inside, CELLS, 2.0, OPENING, np.array([False, False]), RANK)
    assert none[0][0] == -1
    assert np.isnan(none[1][0])


def test_the_order_of_cells_and_a_shift_of_all_change_nothing():
    """Shuffled, and moved together."""
    generator = np.random.default_rng(1)
    points, order = generator.uniform(-20, 40, (30, 3)), generator.permutation(len(CELLS))
    mined = np.array([True, True])
    first = nearest_opening(points, CELLS, 2.0, OPENING, mined, RANK)
    for other in (
        nearest_opening(points, CELLS[order], 2.0, OPENING[order], mined, RANK),
        nearest_opening(points + 512.0, CELLS + 512.0, 2.0, OPENING, mined, RANK),
    ):
        np.testing.assert_array_equal(first[0], other[0])
        np.testing.assert_allclose(first[1], other[1], atol=1e-9)


def test_of_openings_as_near_the_one_mined_last_has_the_point():
    """Two stopes share a cell; the drive is far. Whatever the order of cells; of two mined together the first."""
    shared, random = np.array([[5.0, 10.0, 12.0]]), np.random.default_rng(0)
    cells, opening = np.concatenate([STOPE, STOPE, DRIVE]), np.repeat([0, 1, 2], [len(STOPE)] * 2 + [len(DRIVE)])
    order = random.permutation(len(cells))
    for mined, expected in (([3, 5, 1], 1), ([5, 3, 7], 0), ([4, 4, 4], 0)):
        rank = latest_first(np.array(mined))
        found, distance = nearest_opening(shared, cells[order], 2.0, opening[order], np.ones(3, bool), rank)
        assert (found[0], distance[0]) == (expected, 0.0)


@given(seed=st.integers(0, 1000))
def test_the_opening_of_an_event_does_not_depend_on_other_events(seed):
    """Openings that overlap, mined in any steps; each point alone and beside points of other steps."""
    random = np.random.default_rng(seed)
    count, steps = 30, 12
    origin, mined = 2.0 * random.integers(0, 4, (count, 3)), random.integers(0, steps, 6)
    excavation = np.sort(random.integers(0, 6, count))
    until = np.where(random.random(count) < 0.3, mined[excavation] + random.integers(1, steps, count), NEVER)
    mining = Mining(origin, excavation, mined[excavation], np.full(count, ROCK), until, np.ones(count), 6)
    points, when = random.uniform(-2, 10, (20, 3)), random.integers(0, steps, 20)
    together = mining.nearest_open(points, when, 2.0, [0, 1, 2])[0]
    alone = [mining.nearest_open(points[[n]], when[[n]], 2.0, [0, 1, 2])[0][0] for n in range(20)]
    assert together.tolist() == alone


def test_without_any_excavation_nothing_is_nearest():
    none = Mining(np.empty((0, 3)), *np.empty((4, 0), np.int64), np.empty(0), 0)
    found, distance = none.nearest_open(np.zeros((2, 3)), np.array([0, 1]), 2.0, [0, 1, 2])
    assert found.tolist() == [-1, -1]
    assert np.isnan(distance).all()
