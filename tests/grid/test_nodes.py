"""Node numbering and hanging nodes, against geometry."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from slow_grid import build, constrain, interpolate, overlap, scenes, slow_parents, small_blocks

from mpm_core.grid import CORNER_OFFSETS, number_nodes

BLOCKS = st.sampled_from([1, 2, 8])
"""width of the blocks that share a table, fine units: several blocks even in a small scene"""


@settings(max_examples=40, deadline=None)
@given(scenes(), BLOCKS)
def test_every_corner_has_one_node_numbered_by_first_touch(scene, block):
    with small_blocks(block):
        grid = build(scene)
    corners = grid.cell_index[:, None] + CORNER_OFFSETS[grid.dimension] * grid.cell_width[:, None, None]
    assert (grid.node_index[grid.vtk_nodes] == corners).all()
    assert len(grid.node_index) == len(np.unique(corners.reshape(-1, grid.dimension), axis=0))
    _, first = np.unique(grid.vtk_nodes, return_index=True)
    assert (np.diff(first) > 0).all()


@settings(max_examples=30, deadline=None)
@given(scenes(most_fine_cells=3000), BLOCKS)
def test_hanging_nodes_and_parents_are_those_of_the_definition(scene, block):
    with small_blocks(block):
        grid = build(scene)
    expected = slow_parents(grid)
    assert np.flatnonzero(grid.is_hanging).tolist() == sorted(expected)
    for node, parents in expected.items():
        listed = grid.node_parents[node]
        assert set(listed[listed >= 0].tolist()) == parents
        assert (listed[: len(parents)] >= 0).all()
        assert (listed[len(parents) :] == -1).all()


@settings(max_examples=30, deadline=None)
@given(scenes())
def test_no_parent_hangs(scene):
    grid = build(scene)
    parents = grid.node_parents[grid.node_parents >= 0]
    assert not grid.is_hanging[parents].any()


@settings(max_examples=30, deadline=None)
@given(scenes(), st.integers(0, 1000))
def test_a_linear_field_is_exact_at_hanging_nodes(scene, seed):
    """Whole coefficients and halves only: equality, not closeness."""
    grid = build(scene)
    slope = np.random.default_rng(seed).integers(-9, 9, grid.dimension)
    linear = 3.0 + grid.node_index @ slope
    assert (constrain(grid, linear) == linear).all()


@settings(max_examples=15, deadline=None)
@given(scenes(most_fine_cells=1500), st.integers(0, 1000))
def test_an_interpolated_field_is_continuous_where_cells_meet(scene, seed):
    """Any nodal values, hanging nodes constrained: both cells see one value at a point of their common face."""
    grid = build(scene)
    random = np.random.default_rng(seed)
    value = constrain(grid, random.normal(size=len(grid.node_index)))
    meet = np.argwhere(np.triu((overlap(grid) >= 0).all(axis=2), 1))
    different = grid.cell_level[meet[:, 0]] != grid.cell_level[meet[:, 1]]
    for cell, other in meet[different][:400]:
        lower = np.maximum(grid.cell_index[cell], grid.cell_index[other])
        upper = np.minimum(*(grid.cell_index[c] + grid.cell_width[c] for c in (cell, other)))
        place = lower + random.random(grid.dimension) * (upper - lower)
        assert interpolate(grid, cell, place, value) == pytest.approx(interpolate(grid, other, place, value), abs=1e-12)


@pytest.mark.parametrize("threads", [1, 2])
def test_numbers_do_not_depend_on_the_thread_count(threads):
    scene = (np.array([5, 4, 3]), 4, [((9, 7, 5), (14, 9, 6)), ((30, 20, 3), (31, 21, 20))], 1)
    with small_blocks(8):
        reference = build(scene)
        numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))
        again = build(scene)
    for name in ("cell_index", "vtk_nodes", "node_index", "node_parents"):
        assert (getattr(again, name) == getattr(reference, name)).all()


def test_cells_out_of_morton_order_are_refused():
    index = np.array([[0, 0], [8, 0], [0, 1]], dtype=np.int32)
    with small_blocks(4), pytest.raises(ValueError, match="Morton"):
        number_nodes(index, np.ones(3, dtype=np.int32), (9, 9))


def test_a_domain_beyond_64_bit_keys_is_refused():
    with pytest.raises(ValueError, match="too many"):
        number_nodes(np.zeros((1, 3), dtype=np.int32), np.ones(1, dtype=np.int32), (2**22, 2**22, 2**22))
