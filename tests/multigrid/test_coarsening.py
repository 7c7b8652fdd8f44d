"""Coarser grids take their nodes from the finer ones; numbered anew they are the same."""

import numpy as np
import pytest

from mpm_core.grid import number_nodes
from mpm_core.grid.mesh import BIT_ORDER
from mpm_core.multigrid.coarsening import coarsen, finest_grid
from tests.mechanics.scenes import ball, box, grid_around


@pytest.mark.parametrize("shape", [(8, 4, 6), (7, 6, 5), (8, 6), (5, 3)])
def test_nodes_of_a_coarser_grid_are_those_numbered_anew(shape):
    """Places of all corners, and of the parents of hanging ones, down to a few cells; odd sides too."""
    dimension = len(shape)
    shapes = [ball([21.3] * dimension, 6.2), box([30.0] * dimension, [38.7] * dimension)]
    grid = grid_around(shapes, shape, levels=4, coarse=10.0)
    fine = finest_grid(grid, np.ascontiguousarray(grid.vtk_nodes[:, BIT_ORDER[dimension]]))
    hanging = []
    for _ in range(5):
        coarse, _ = coarsen(fine)
        upper = (coarse.cell_index + coarse.cell_width[:, None]).max(axis=0)
        vtk_nodes, node_index, node_parents = number_nodes(coarse.cell_index, coarse.cell_width, upper)
        own = vtk_nodes[:, BIT_ORDER[dimension]]
        assert len(coarse.node_index) == len(node_index)
        np.testing.assert_array_equal(coarse.node_index[coarse.cell_nodes], node_index[own])
        number = np.empty(len(node_index), np.int32)
        number[coarse.cell_nodes] = own
        np.testing.assert_array_equal(coarse.node_parents >= 0, node_parents[number] >= 0)
        parents = np.where(coarse.node_parents >= 0, number[coarse.node_parents], -1)
        np.testing.assert_array_equal(np.sort(parents), np.sort(node_parents[number]))
        hanging.append(np.count_nonzero(node_parents[:, 0] >= 0))
        fine = coarse
    assert hanging[0] > hanging[1] > 0
    assert hanging[-1] == 0
