"""What a split carries over: stress, displacement, forces, hourglass forces and unsupported rock on finer cells."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mechanics.scenes import HOST, constrain, host_everywhere, make_model, make_scene, random_grid
from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.energy_balance import elastic_energy
from mpm_core.grid import build_grid
from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.splitting import split
from mpm_core.model.model import build_model
from mpm_core.model.occupancy import ALL_SAMPLES, Unsupported
from mpm_core.stages.state_transfer import transfer, transfer_forces, transfer_nodes, transfer_unsupported
from mpm_core.stages.step_cells import stored

SEEDS = st.integers(0, 2**32 - 1)
DIMENSIONS = st.sampled_from([2, 3])


def models(seed, dimension, per_edge):
    """An elastic model on a random grid with hanging nodes, and the same with random cells split."""
    random = np.random.default_rng(seed)
    grid = random_grid(random, dimension)
    scene = make_scene("xz" if dimension == 2 else None, particles_per_cell=per_edge)
    shape = grid.shape >> 1
    places = random.integers(0, shape, (3, dimension))
    finer = split(grid, places, int(random.integers(0, 2)), 1)
    return make_model(scene, grid), make_model(scene, finer), random


def strained(model, gradient):
    """The model's body under a homogeneous displacement gradient (d, d), from virgin."""
    body = Body(model, model.virgin_state(), model.volumes(0))
    body.displace((model.grid.node_position - model.grid.origin) @ gradient.T)
    return body


@settings(max_examples=25, deadline=None)
@given(SEEDS, DIMENSIONS, st.sampled_from([1, 2]))
def test_a_linear_field_goes_over_with_stress_and_forces(seed, dimension, per_edge):
    """Stress, energy and total force to round-off, on cells of all sizes with hanging nodes; hourglass forces none."""
    old, new, random = models(seed, dimension, per_edge)
    gradient = 1e-3 * random.standard_normal((old.dimension, old.dimension))
    body = strained(old, gradient)
    state = transfer(old, body.state, new)
    exact = strained(new, gradient)
    size = np.abs(exact.state.stress).max()
    np.testing.assert_allclose(state.stress, exact.state.stress, rtol=0, atol=1e-11 * size)
    np.testing.assert_allclose(
        state.displacement, exact.state.displacement, rtol=0, atol=1e-12 * np.abs(exact.state.displacement).max()
    )
    assert np.abs(state.hourglass_force).max() <= 1e-9 * size
    carried = Body(new, state, new.volumes(0))
    force, expected = carried.internal_force(), exact.internal_force()
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-10 * size * new.grid.fine_cell ** (new.dimension - 1))
    assert stored(carried) == pytest.approx(stored(body), rel=1e-9)


@settings(max_examples=25, deadline=None)
@given(SEEDS, DIMENSIONS, st.just(1))
def test_of_any_field_the_parts_have_the_mean_of_their_cell(seed, dimension, per_edge):
    """Random displacement: parts' stress has the cell's as its mean, unsplit cells keep every bit, and the energy of
    stress can only grow: the parts feel what the one point of their cell did not."""
    old, new, random = models(seed, dimension, per_edge)
    body = Body(old, old.virgin_state(), old.volumes(0))
    body.displace(1e-3 * random.standard_normal(body.state.displacement.shape))
    state = transfer(old, body.state, new)
    origin = holding_cells(old.grid, new.grid.cell_index)
    whole = new.grid.cell_level == old.grid.cell_level[origin]
    assert np.array_equal(state.stress[whole], body.state.stress[origin[whole]])
    assert np.array_equal(state.hourglass_force[whole], body.state.hourglass_force[origin[whole]])
    volume = new.volumes(0)
    for component in range(6):
        mean = np.bincount(origin, volume * state.stress[:, component]) / np.bincount(origin, volume)
        size = np.abs(body.state.stress).max()
        np.testing.assert_allclose(mean, body.state.stress[:, component], rtol=0, atol=1e-10 * size)
    before, after = (
        elastic_energy(replace(model, insitu=np.zeros_like(model.insitu)), own, model.volumes(0))
        for model, own in ((old, body.state), (new, state))
    )
    assert after >= before * (1.0 - 1e-12)


@pytest.mark.parametrize("poisson", [0.25, 0.4999])
@pytest.mark.parametrize("dimension", [2, 3])
def test_split_cells_have_the_hourglass_forces_of_rock_that_moved_so(dimension, poisson):
    """Also of rock near Poisson's ratio 0.5, whose hourglass stiffness is not in proportion to lambda + 2 mu."""
    random = np.random.default_rng(3)
    grid = random_grid(random, dimension)
    scene = make_scene("xz" if dimension == 2 else None, host=HOST | {"poisson_ratio": poisson})
    finer = split(grid, random.integers(0, grid.shape >> 1, (3, dimension)), 1, 1)
    old, new = make_model(scene, grid), make_model(scene, finer)
    body = Body(old, old.virgin_state(), old.volumes(0))
    body.displace(1e-3 * random.standard_normal(body.state.displacement.shape))
    state = transfer(old, body.state, new)
    exact = Body(new, new.virgin_state(), new.volumes(0))
    exact.displace(state.displacement)
    anew = new.grid.cell_level != old.grid.cell_level[holding_cells(old.grid, new.grid.cell_index)]
    assert anew.any()
    size = np.abs(exact.state.hourglass_force).max()
    np.testing.assert_allclose(state.hourglass_force[anew], exact.state.hourglass_force[anew], rtol=0, atol=1e-9 * size)


@settings(max_examples=25, deadline=None)
@given(SEEDS, DIMENSIONS, st.sampled_from([1, 2]))
def test_nodes_that_stay_keep_value_and_force(seed, dimension, per_edge):
    old, new, random = models(seed, dimension, per_edge)
    values = random.standard_normal((len(old.grid.node_index), 3))
    values = constrain(old.grid, values)
    result = transfer_nodes(old, values, new)
    place = {tuple(index): number for number, index in enumerate(new.grid.node_index.tolist())}
    stay = np.array([place[tuple(index)] for index in old.grid.node_index.tolist()])
    np.testing.assert_allclose(result[stay], values, rtol=0, atol=1e-14)
    np.testing.assert_allclose(constrain(new.grid, result), result, rtol=0, atol=1e-14)
    forces = transfer_forces(old, values, new)
    assert np.array_equal(forces[stay], values)
    assert np.array_equal(np.sort(np.flatnonzero(forces.any(axis=1))), np.sort(stay[values.any(axis=1)]))


def test_fallen_cells_stay_fallen_with_all_their_parts():
    grid = build_grid(np.zeros(2), 4.0, np.array([2, 2]), 3, lambda level, index: np.zeros(len(index), bool), 0)
    scene = make_scene("xz")
    zero = np.zeros(1, np.int32)
    unsupported = Unsupported(np.array([1], np.int32), np.array([ALL_SAMPLES]), zero, zero, zero)
    model = build_model(
        scene, grid, host_everywhere(grid), make_model(scene, grid).pieces, unsupported, all_fallen=True
    )
    finer = split(grid, np.array([[2, 0]]), 0, 1)
    carried = transfer_unsupported(model, finer.cell_index)
    origin = holding_cells(grid, finer.cell_index)
    assert np.array_equal(carried.cell, np.flatnonzero(origin == 1))
    assert len(carried.cell) > 1
    assert (carried.samples == ALL_SAMPLES).all()
