"""Cells split at places: what is asked is finest, the rest is balanced and no finer than it must be, in any order."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from slow_grid import build, cells_as_set, overlap, scenes

from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.splitting import around, code_of, family_codes, split, with_leaves


@st.composite
def split_scenes(draw):
    """A small random grid of two levels or more, places in it, rings and grading."""
    scene = draw(scenes(most_fine_cells=1500).filter(lambda scene: scene[1] > 1))
    shape = np.asarray(scene[0]) << scene[1] - 2
    place = st.tuples(*[st.integers(0, int(side) - 1) for side in shape])
    places = np.array(draw(st.lists(place, min_size=1, max_size=4)), np.int32)
    return build(scene), places, draw(st.integers(0, 2)), draw(st.integers(1, 2))


def same(first, second) -> bool:
    """Whether all arrays of two grids are the same."""
    return all(
        np.array_equal(getattr(first, name), getattr(second, name))
        for name in ("cell_index", "cell_level", "vtk_nodes", "node_index", "node_parents")
    )


@settings(max_examples=60, deadline=None)
@given(split_scenes())
def test_places_and_rings_are_finest_and_all_stays_balanced(scene):
    grid, places, rings, grading = scene
    finer = split(grid, places, rings, grading)
    asked = around(places, rings, grid.shape >> 1)
    finest = finer.cell_level == grid.levels - 1
    parents = {tuple(cell >> 1) for cell in finer.cell_index[finest]}
    assert {tuple(place) for place in asked} <= parents
    level = finer.cell_level.astype(int)
    touch = (overlap(finer) >= 0).all(axis=2)
    assert np.abs(level[:, None] - level)[touch].max() <= 1
    volume = (finer.cell_width.astype(np.int64) ** grid.dimension).sum()
    assert volume == np.prod(grid.shape)
    # No old cell is merged; siblings stand in Morton order, which numbering the nodes has checked.
    assert (finer.cell_level >= grid.cell_level[holding_cells(grid, finer.cell_index)]).all()


@settings(max_examples=60, deadline=None)
@given(split_scenes(), st.randoms())
def test_any_order_of_splits_makes_the_same_grid(scene, random):
    """At once, one by one, in another order, twice."""
    grid, places, rings, grading = scene
    at_once = split(grid, places, rings, grading)
    order = list(range(len(places)))
    random.shuffle(order)
    one_by_one = grid
    for place in order:
        one_by_one = split(one_by_one, places[place : place + 1], rings, grading)
    assert same(at_once, one_by_one)
    assert split(at_once, places, rings, grading) is at_once


@settings(max_examples=40, deadline=None)
@given(split_scenes())
def test_no_cell_is_split_that_nothing_asks_for(scene):
    """Slow twin by sets: what is asked for, level by level with its rings, and the children of all that."""
    grid, places, rings, grading = scene
    finest = grid.levels - 1
    wanted, index = set(), [tuple(place) for place in places]
    for level in range(finest - 1, -1, -1):
        reach = rings if level == finest - 1 else grading
        shape = grid.shape >> finest - level
        grown = {
            tuple(np.array(cell) + shift)
            for cell in index
            for shift in np.ndindex(*(2 * reach + 1,) * grid.dimension)
            for shift in [np.array(shift) - reach]
        }
        grown = {cell for cell in grown if (np.array(cell) >= 0).all() and (np.array(cell) < shape).all()}
        wanted |= {(level, cell) for cell in grown}
        index = {tuple(np.array(cell) >> 1) for cell in grown}
    leaves = cells_as_set(grid)
    while splits := [leaf for leaf in leaves if (leaf[0], leaf[1:]) in wanted]:
        for level, *cell in splits:
            leaves.remove((level, *cell))
            for corner in np.ndindex(*(2,) * grid.dimension):
                leaves.add((level + 1, *(2 * one + other for one, other in zip(cell, corner, strict=True))))
    assert cells_as_set(split(grid, places, rings, grading)) == leaves


@settings(max_examples=30, deadline=None)
@given(split_scenes())
def test_families_are_the_cells_whose_children_are_finest(scene):
    grid, places, rings, grading = scene
    finer = split(grid, places, rings, grading)
    finest = finer.cell_index[finer.cell_level == grid.levels - 1]
    assert np.array_equal(family_codes(finer), np.unique(code_of(finest >> 1, grid.shape >> 1)))


@settings(max_examples=20, deadline=None)
@given(split_scenes())
def test_leaves_alone_make_the_whole_grid_again(scene):
    """As a checkpoint keeps them; in any order."""
    grid, places, rings, grading = scene
    finer = split(grid, places, rings, grading)
    backwards = slice(None, None, -1)
    assert same(with_leaves(grid, finer.cell_index[backwards], finer.cell_level[backwards]), finer)
