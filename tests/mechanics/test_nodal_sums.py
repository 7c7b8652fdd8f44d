"""Sums over particles at nodes, and over nodes, beside the plain way."""

import numba
import numpy as np
import pytest

from mpm_core.equilibrium.body import Body, nodal_mass
from mpm_core.kernels.nodal_operations import mark_cells, sizes
from tests.mechanics.scenes import ball, excavation, grid_around, make_model, make_scene


@pytest.mark.parametrize("dimension", [2, 3])
def test_nodes_have_the_mass_of_the_particles_and_its_centre(dimension):
    """On hanging nodes and several particles to a cell; hanging nodes keep none."""
    shapes = [ball([9.0] * dimension, 3.0)]
    grid = grid_around(shapes, (5,) * dimension, levels=3, coarse=4.0)
    scene = make_scene("xy" if dimension == 2 else None, particles_per_cell=2, excavations=[excavation()])
    model = make_model(scene, grid, shapes)
    mass = np.random.default_rng(1).random(model.particles.count)
    mass[::3] = 0.0
    nodal = nodal_mass(model, mass)
    assert nodal.sum() == pytest.approx(mass.sum())
    np.testing.assert_allclose(nodal @ model.grid.node_position, mass @ model.particles.position)
    assert grid.is_hanging.any()
    assert (nodal[model.grid.is_hanging] == 0.0).all()


@pytest.mark.parametrize("dimension", [2, 3])
def test_nodes_are_attached_where_they_have_mass(dimension):
    """Whatever is mined: free nodes as their mass says, hanging ones as the cells that they are corners of. What moves,
    mass and time step follow the volume."""
    shapes = [ball([9.0] * dimension, 3.0)]
    grid = grid_around(shapes, (5,) * dimension, levels=3, coarse=4.0)
    model = make_model(make_scene("xy" if dimension == 2 else None, excavations=[excavation()]), grid, shapes)
    whole = model.particles.full_volume
    kept = np.random.default_rng(2).random(model.particles.count) < 0.2
    body = Body(model, model.virgin_state(), whole)
    assert body.attached.all()
    before = body.mass, body.time_step
    body.set_volume(np.where(kept, whole, 0.0))
    hanging, corners = model.grid.is_hanging, np.unique(model.cell_nodes[model.particles.cell[kept]])
    np.testing.assert_array_equal(body.attached[~hanging], body.mass[~hanging] > 0.0)
    np.testing.assert_array_equal(np.flatnonzero(body.attached & hanging), corners[hanging[corners]])
    assert 0 < np.count_nonzero(hanging & ~body.attached) < np.count_nonzero(hanging)
    np.testing.assert_array_equal(body.moves, body.attached[:, None] & ~model.held)
    assert body.mass.sum() < before[0].sum()
    body.set_volume(whole)
    np.testing.assert_array_equal(body.mass, before[0])
    assert body.time_step == before[1]


@pytest.mark.parametrize("count", [1, 63, 1000])
def test_sizes_are_the_norm_and_the_largest_component(count):
    """The same bits with two threads; not a number stays that."""
    values = np.random.default_rng(count).standard_normal((count, 3))
    norm, largest = sizes(values)
    assert norm == pytest.approx(np.linalg.norm(values), rel=1e-14)
    assert largest == np.abs(values).max()
    numba.set_num_threads(min(2, numba.config.NUMBA_NUM_THREADS))
    assert sizes(values) == (norm, largest)
    values[count // 2, 1] = np.nan
    assert np.isnan(sizes(values)).all()


@pytest.mark.parametrize("corners", [4, 8])
def test_cells_with_a_marked_corner_are_marked(corners):
    """Whatever stood there before, with one thread and with two."""
    random = np.random.default_rng(corners)
    cell_nodes = random.integers(0, 900, (500, corners)).astype(np.int32)
    marked = random.random(900) < 0.1
    for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
        numba.set_num_threads(threads)
        cells = random.random(500) < 0.5
        mark_cells(cell_nodes, marked, cells)
        np.testing.assert_array_equal(cells, [marked[nodes].any() for nodes in cell_nodes])
