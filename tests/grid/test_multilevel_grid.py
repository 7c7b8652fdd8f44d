"""The grid's own coordinates and what is said before it is built."""

import numpy as np
import pytest
from slow_grid import Boxes

from common.errors import InputError
from mpm_core.grid import CORNER_OFFSETS, build_grid, building, count_cells, estimate_memory
from mpm_core.grid.mesh import EDGE_CORNERS, FACE_CORNERS

ORIGIN = np.array([100.0, -40.0, 12.5])


@pytest.fixture
def grid():
    """2 x 1 x 3 base cells of 10 m, three levels, a small box in one corner."""
    return build_grid(ORIGIN, 10.0, (2, 1, 3), 3, Boxes([((0, 0, 0), (1, 1, 1))], 3), 0)


def test_positions_are_in_metres_from_the_origin(grid):
    assert grid.dimension == 3
    assert grid.fine_cell == 2.5
    assert grid.shape.tolist() == [8, 4, 12]
    assert (grid.cell_size == 10.0 / 2**grid.cell_level).all()
    assert (grid.cell_origin.min(axis=0) == ORIGIN).all()
    upper = (grid.cell_origin + grid.cell_size[:, None]).max(axis=0)
    assert (upper == ORIGIN + np.array([20.0, 10.0, 30.0])).all()
    assert (grid.cell_center == grid.cell_origin + grid.cell_size[:, None] / 2).all()
    assert (grid.node_position[grid.vtk_nodes].mean(axis=1) == grid.cell_center).all()
    assert np.sum(grid.cell_size**3) == 20.0 * 10.0 * 30.0


def test_cells_per_level_count_the_levels(grid):
    assert grid.cells_per_level.tolist() == [5, 7, 8]


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_boundary_nodes_lie_on_the_face_of_the_domain(grid, axis):
    position = grid.node_position[:, axis]
    assert (position[grid.boundary_nodes(axis, 0)] == ORIGIN[axis]).all()
    assert (position[grid.boundary_nodes(axis, 1)] == ORIGIN[axis] + 2.5 * grid.shape[axis]).all()
    inside = ~grid.boundary_nodes(axis, 0) & ~grid.boundary_nodes(axis, 1)
    assert ((position[inside] > ORIGIN[axis]) & (position[inside] < ORIGIN[axis] + 2.5 * grid.shape[axis])).all()


@pytest.mark.parametrize(("axis", "side"), [(3, 0), (-1, 0), (0, 2)])
def test_a_face_that_does_not_exist_is_refused(grid, axis, side):
    with pytest.raises(ValueError, match="axis"):
        grid.boundary_nodes(axis, side)


@pytest.mark.parametrize("dimension", [2, 3])
def test_corner_edge_and_face_numbering_fit_together(dimension):
    """VTK: the bottom quadrilateral runs counter-clockwise seen from above, the top repeats it."""
    corners = CORNER_OFFSETS[dimension]
    x, y = corners[:4, 0], corners[:4, 1]
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2 == 1
    if dimension == 3:
        assert (corners[4:] == corners[:4] + np.array([0, 0, 1])).all()
    along = corners[EDGE_CORNERS[dimension][:, 1]] - corners[EDGE_CORNERS[dimension][:, 0]]
    assert (along.sum(axis=1) == 1).all()
    assert (along >= 0).all()
    assert len({tuple(edge) for edge in EDGE_CORNERS[dimension]}) == dimension * 2 ** (dimension - 1)
    across = [np.ptp(corners[face], axis=0).tolist().count(0) for face in FACE_CORNERS[dimension]]
    assert across == [1] * (6 if dimension == 3 else 0)


def test_the_counts_are_told_before_arrays_are_made_and_may_stop_the_building():
    told = []

    def refuse(count):
        told.append(count)
        raise InputError("grid: too large for the solver")

    with pytest.raises(InputError, match="solver"):
        build_grid((0, 0), 1.0, (3, 3), 2, Boxes([((2, 2), (3, 3))], 2), 0, before_allocation=refuse)
    assert told[0].cells == 12
    assert told[0].nodes == 16 + 5


@pytest.mark.parametrize(("available", "what"), [(100, "split marks"), (2500, "cells and .* nodes")])
def test_too_little_memory_is_said_with_figures_before_it_is_taken(monkeypatch, available, what):
    monkeypatch.setattr(building, "free_memory", lambda: available)
    with pytest.raises(InputError, match=f"grid: .*{what}.* take .* GB .* larger cells"):
        build_grid((0, 0, 0), 1.0, (5, 5, 5), 2, Boxes([((2, 2, 2), (3, 3, 3))], 2), 0)
    if available < 2500:
        with pytest.raises(InputError, match=r"grid: .*split marks"):
            count_cells((5, 5, 5), 2, Boxes([((2, 2, 2), (3, 3, 3))], 2), 0)


def test_the_memory_estimate_is_what_the_arrays_hold(grid):
    names = ("cell_index", "cell_level", "vtk_nodes", "node_index", "node_parents")
    held = sum(getattr(grid, name).nbytes for name in names)
    estimate = estimate_memory(len(grid.cell_level), len(grid.node_index))
    assert estimate.arrays == held
    assert estimate.building > held


@pytest.mark.parametrize(("origin", "coarse_cell"), [((0, 0), 1.0), ((0, 0, 0), 0.0), ((0, 0, 0), float("nan"))])
def test_a_frame_that_does_not_fit_is_refused(origin, coarse_cell):
    with pytest.raises(ValueError, match="origin"):
        build_grid(origin, coarse_cell, (2, 2, 2), 1, None, 0)
