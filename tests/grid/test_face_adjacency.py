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
