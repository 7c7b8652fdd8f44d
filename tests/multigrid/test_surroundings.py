"""Cells around rock that has just failed: every patch has a border far enough for it."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpm_core.equilibrium import subdomain
from mpm_core.equilibrium.subdomain import MAX_BORDER_SHARE, Cubes
from tests.mechanics.scenes import ball, grid_around

WIDEST = {2: 3, 3: 7}  # cells, where a cube is one cell: 10 cubes beyond them R / a is 7.1 and 3.7


@pytest.fixture(autouse=True)
def cells_as_cubes(monkeypatch):
    """A part may be all of a scene but for a cell, and cubes are finest cells: scenes so small show the rule."""
    monkeypatch.setattr(subdomain, "MAX_SURROUNDINGS_SHARE", 0.99)
    monkeypatch.setattr(subdomain, "CUBE_HALVINGS", {2: 0, 3: 0})
    monkeypatch.setattr(subdomain, "REACH_CELLS", (10, 6, 4, 2))


def layer(dimension: int, length: int, width: int = 24, first: int = 0):
    """A grid of finest cells alone, `length` by `width` (by 1): of x from `first` on, in a domain that begins at 0."""
    shape = np.array([length, width, 1][:dimension])
    index = (
        np.stack(np.unravel_index(np.arange(np.prod(shape)), shape), axis=1) + np.eye(1, dimension, dtype=int) * first
    )
    domain = shape + np.eye(1, dimension, dtype=int)[0] * 2 * first
    return SimpleNamespace(
        levels=1, dimension=dimension, shape=domain, cell_index=index, cell_level=np.zeros(len(index), int)
    )


def row(dimension: int, cells: int, first: int) -> np.ndarray:
    """cell_index of so many cells beside each other, in the middle of a layer."""
    place = np.zeros((cells, dimension), int)
    place[:, 0], place[:, 1] = np.arange(first, first + cells), 12
    return place


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 89), st.integers(0, 23)), min_size=1, max_size=12, unique=True))
def test_a_border_held_still_carries_at_most_its_share(failed):
    """2-D, against distances from each failed cell to all others: half-width of its patch over them, squared."""
    grid, failed = layer(2, 90), np.array(failed)
    around = Cubes(grid).around(failed)
    if around is None:
        return
    outside = np.delete(grid.cell_index, around.cells, axis=0)
    patches = [{tuple(cell)} for cell in failed]
    while True:
        pairs = [
            (i, j)
            for i in range(len(patches))
            for j in range(i)
            if any(max(abs(a[0] - b[0]), abs(a[1] - b[1])) <= 1 for a in patches[i] for b in patches[j])
        ]
        if not pairs:
            break
        i, j = pairs[0]
        patches[j] |= patches.pop(i)
    for patch in patches:
        cells = np.array(list(patch))
        half = 0.5 * (np.ptp(cells, axis=0).max() + 1)
        nearest = min(np.abs(outside - cell).max(axis=1).min() for cell in cells) - 1  # whole cells in between
        assert (half / (half + nearest)) ** 2 <= MAX_BORDER_SHARE
    assert around.are_wide(failed).all()


@pytest.mark.parametrize("dimension", [2, 3])
def test_no_part_around_a_patch_that_is_too_wide(dimension):
    """The widest reach leaves the border of a row of 3 (2-D) or 7 cells far enough; a cell more, or beside it, not."""
    cubes, widest = Cubes(layer(dimension, 200)), WIDEST[dimension]
    assert cubes.around(row(dimension, widest, 100)) is not None
    assert cubes.around(row(dimension, widest + 1, 100)) is None
    two = np.concatenate([row(dimension, widest, 60), row(dimension, widest, 140)])
    assert cubes.around(two) is not None
    touching = np.concatenate([row(dimension, widest, 100), row(dimension, 1, 100 + widest)])
    assert cubes.around(touching) is None


def test_each_patch_has_a_reach_of_its_own(monkeypatch):
    """2-D: a lone cell needs 4 cells on all sides, a row of two 7; wider (REACHES) only while that is not too much."""
    monkeypatch.setattr(subdomain, "REACH_CELLS", (10, 6, 2))
    failed = np.concatenate([row(2, 1, 30), row(2, 2, 70)])
    cubes = Cubes(layer(2, 100))
    for largest, reaches in ((0.9, (10, 10)), (0.175, (6, 7)), (0.14, (4, 7))):
        monkeypatch.setattr(subdomain, "MAX_SURROUNDINGS_SHARE", largest)
        lone, two = reaches
        assert len(cubes.around(failed).cells) == (1 + 2 * lone) ** 2 + (1 + 2 * two) * (2 + 2 * two)
    monkeypatch.setattr(subdomain, "MAX_SURROUNDINGS_SHARE", 0.13)
    assert cubes.around(failed) is None


def test_a_patch_that_grows_comes_near_the_border():
    """2-D: a border 10 cells away from a lone cell lets it grow by one cell, not by two, nor far from it."""
    around = Cubes(layer(2, 200)).around(row(2, 1, 100))
    assert around.are_wide(row(2, 2, 100)).all()
    for first in (100, 98):  # towards either side
        assert not around.are_wide(row(2, 3, first)).any()
    both = np.concatenate([row(2, 1, 100), row(2, 1, 108)])
    assert around.are_wide(both).tolist() == [True, False]


def test_the_edge_of_the_domain_is_no_border_but_that_of_a_part_is():
    """A cell at the edge of the whole, and one as near to the edge of a grid that is part of a domain."""
    near_edge = row(2, 1, 1)
    assert Cubes(layer(2, 60)).around(near_edge).are_wide(near_edge).all()
    part = Cubes(layer(2, 60, first=50))
    near_edge = row(2, 1, 51)
    assert not part.around(near_edge).are_wide(near_edge).any()
    assert part.around(row(2, 1, 80)).are_wide(row(2, 1, 80)).all()


@pytest.mark.parametrize("dimension", [2, 3])
def test_cells_of_all_levels(dimension, monkeypatch):
    """Chosen are the cells, of any size, that reach into the cubes around the failed cell, and no others."""
    monkeypatch.setattr(subdomain, "CUBE_HALVINGS", {2: 1, 3: 1})
    grid = grid_around([ball([9.0] * dimension, 3.0)], (8,) * dimension, levels=4, coarse=4.0)
    finest = np.flatnonzero(grid.cell_level == 3)
    failed = grid.cell_index[finest[len(finest) // 2]][None]
    around = Cubes(grid).around(failed)
    size = 1 << (3 - grid.cell_level)[:, None]
    cube = failed[0] >> 1 << 1
    for reach in subdomain.REACH_CELLS:
        whole = reach >> 1 << 1  # cubes
        lower, upper = cube - whole, cube + whole + 2
        meets = ((grid.cell_index < upper) & (grid.cell_index + size > lower)).all(axis=1)
        if meets.sum() <= 0.99 * len(meets):
            break
    np.testing.assert_array_equal(around.cells, np.flatnonzero(meets))
    assert len(np.unique(grid.cell_level[around.cells])) > 1


@pytest.mark.parametrize("beyond", [0, 1, 4, 30])
def test_places_whose_surroundings_end_near_them_are_found(beyond):
    """2-D, against all cubes near each place one by one; beyond the domain there is no end."""
    cubes = Cubes(layer(2, 60))
    around = cubes.around(np.concatenate([row(2, 1, 3), row(2, 2, 9), row(2, 1, 40)]))
    inside = np.argwhere(around.near)
    places = (inside + cubes.lower) << cubes.halvings
    expected = [
        not around.near[tuple(slice(max(at - beyond, 0), at + beyond + 1) for at in cube)].all() for cube in inside
    ]
    assert any(expected) == (beyond > 0)
    np.testing.assert_array_equal(around.reach_beyond(places, beyond), expected)
