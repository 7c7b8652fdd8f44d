"""Cells that share a face, against all pairs of cells."""

import numpy as np
from hypothesis import given, settings
from slow_grid import build, overlap, scenes

from mpm_core.grid import face_neighbors


@settings(max_examples=40, deadline=None)
@given(scenes(most_fine_cells=3000))
def test_neighbours_are_the_pairs_that_touch_along_one_axis_and_overlap_along_the_others(scene):
    grid = build(scene)
    indptr, indices = face_neighbors(grid)
    shared = overlap(grid)
    expected = ((shared == 0).sum(axis=2) == 1) & (shared >= 0).all(axis=2)
    assert indptr[-1] == len(indices) == expected.sum()
    for cell in range(len(grid.cell_level)):
        assert indices[indptr[cell] : indptr[cell + 1]].tolist() == np.flatnonzero(expected[cell]).tolist()
    few = np.arange(0, len(grid.cell_level), 3)
    some, of_some = face_neighbors(grid, few)
    np.testing.assert_array_equal(np.diff(some), np.where(np.arange(len(expected)) % 3 == 0, np.diff(indptr), 0))
    np.testing.assert_array_equal(of_some, np.concatenate([indices[indptr[cell] : indptr[cell + 1]] for cell in few]))
