"""Leaves of the tree: they tile, balance, follow the excavations, and lie in Morton order."""

import numpy as np
import pytest
from hypothesis import given, settings
from slow_grid import Boxes, build, cells_as_set, overlap, scenes, slow_leaves

from mpm_core.grid import count_cells, refine


@settings(max_examples=40, deadline=None)
@given(scenes())
def test_leaves_tile_the_domain_exactly_once(scene):
    grid = build(scene)
    covered = np.zeros(grid.shape, dtype=int)
    for lower, width in zip(grid.cell_index, grid.cell_width, strict=True):
        covered[tuple(slice(start, start + width) for start in lower)] += 1
    assert (covered == 1).all()
    assert (grid.cell_index % grid.cell_width[:, None] == 0).all()


@settings(max_examples=40, deadline=None)
@given(scenes(most_fine_cells=4000))
def test_cells_that_touch_differ_by_one_level_at_most(scene):
    """Faces, edges and corners: every pair of cells whose closed boxes meet."""
    grid = build(scene)
    touch = (overlap(grid) >= 0).all(axis=2)
    level = grid.cell_level.astype(int)
    assert np.abs(level[:, None] - level)[touch].max() <= 1


@settings(max_examples=25, deadline=None)
@given(scenes(most_fine_cells=1500))
def test_leaves_are_those_of_the_plain_definition_and_no_more(scene):
    """Rings and balance by sets of cells: nothing else splits."""
    assert cells_as_set(build(scene)) == slow_leaves(scene)


@settings(max_examples=30, deadline=None)
@given(scenes())
def test_excavations_are_finest_and_the_rings_around_them_wide_enough(scene):
    """Within buffer_cells cells of a level from a marked cell of that level, every leaf is of a finer level."""
    _, levels, boxes, rings = scene
    grid = build(scene)
    lower, upper = grid.cell_index, grid.cell_index + grid.cell_width[:, None]
    for box_lower, box_upper in boxes:
        for level in range(levels - 1):
            width = 2 ** (levels - 1 - level)
            ring_lower = (np.array(box_lower) // width - rings) * width
            ring_upper = (-(-np.minimum(box_upper, grid.shape) // width) + rings) * width
            in_ring = ((lower < ring_upper) & (upper > ring_lower)).all(axis=1)
            assert grid.cell_level[in_ring].min() > level


@settings(max_examples=30, deadline=None)
@given(scenes())
def test_cells_lie_in_morton_order_and_siblings_in_a_row(scene):
    """Codes by text: the bits of z, y, x in turn. All 2^d siblings that are leaves follow one another, x fastest."""
    grid = build(scene)
    bits = int(grid.shape.max()).bit_length()
    codes = [
        int("".join("".join(digits) for digits in zip(*(f"{c:0{bits}b}" for c in cell[::-1]), strict=True)), 2)
        for cell in grid.cell_index.tolist()
    ]
    assert codes == sorted(codes)
    children = 1 << grid.dimension
    parent = np.column_stack([grid.cell_level, grid.cell_index // (2 * grid.cell_width[:, None])])
    _, inverse, count = np.unique(parent, axis=0, return_inverse=True, return_counts=True)
    inverse = inverse.ravel()
    for family in np.flatnonzero(count == children):
        cells = np.flatnonzero(inverse == family)
        if grid.cell_level[cells[0]] > 0:
            assert (np.diff(cells) == 1).all()
            step = (grid.cell_index[cells] - grid.cell_index[cells[0]]) // grid.cell_width[cells[0]]
            assert (step @ (1 << np.arange(grid.dimension)) == np.arange(children)).all()


def test_classify_is_asked_once_per_level_and_only_about_children_of_marked_cells():
    classify = Boxes([((3, 5, 9), (6, 6, 12))], levels=4)
    refine((3, 2, 4), 4, classify, 2)
    assert [level for level, _ in classify.calls] == [0, 1, 2]
    asked = [index for _, index in classify.calls]
    assert len(asked[0]) == 3 * 2 * 4
    for level in (1, 2):
        marked = asked[level - 1][classify(level - 1, asked[level - 1])]
        assert len(np.unique(asked[level], axis=0)) == len(asked[level]) == 8 * len(marked)
        assert {tuple(cell) for cell in asked[level] // 2} == {tuple(cell) for cell in marked}
        assert asked[level].dtype == np.int32


@pytest.mark.parametrize("shape", [(7,), (1, 1), (5, 3), (1, 1, 1), (11, 1, 2), (1, 13, 1)])
def test_one_level_is_the_regular_grid(shape):
    if len(shape) == 1:
        with pytest.raises(ValueError, match="two or three"):
            refine(shape, 1, None, 3)
        return
    index, level = refine(shape, 1, None, 3)
    assert len(index) == np.prod(shape)
    assert len(np.unique(index, axis=0)) == len(index)
    assert (level == 0).all()


def test_nothing_excavated_leaves_the_base_grid():
    _, level = refine((3, 5, 7), 4, lambda level, index: np.zeros(len(index), dtype=bool), 3)
    assert len(level) == 105
    assert (level == 0).all()


@settings(max_examples=40, deadline=None)
@given(scenes())
def test_the_count_before_building_is_exact(scene):
    shape, levels, boxes, buffer_cells = scene
    grid = build(scene)
    count = count_cells(shape, levels, Boxes(boxes, levels), buffer_cells)
    assert count.cells == len(grid.cell_level)
    assert count.nodes == len(grid.node_index)
    assert count.cells_per_level.tolist() == grid.cells_per_level.tolist()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0, 3), 2, None, 1), "base_shape"),
        (((2, 3, 4, 5), 2, None, 1), "base_shape"),
        (((2, 3), 0, None, 1), "levels"),
        (((2, 3), 2, None, -1), "buffer_cells"),
        (((2, 3), 2, lambda level, index: np.ones(5, dtype=bool), 1), "classify"),
        (((2, 3), 2, lambda level, index: np.ones(6), 1), "classify"),
    ],
)
def test_arguments_out_of_range_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        refine(*arguments)
