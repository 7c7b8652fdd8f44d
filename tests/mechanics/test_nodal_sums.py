"""Sums over particles at nodes, and over nodes, beside the plain way."""

import numba
import numpy as np
import pytest

from mpm_core.equilibrium.body import nodal_mass
from mpm_core.kernels.nodal_operations import sizes
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
