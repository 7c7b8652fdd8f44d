"""Hanging nodes as constraints: patch test, conservation, rigid motion, adjointness; and the scatter in blocks."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mechanics.scenes import constrain, make_model, make_scene, random_grid
from mpm_core.equilibrium.explicit_scheme import ExplicitScheme
from mpm_core.kernels import block_scatter
from mpm_core.kernels.nodal_operations import collect_to_parents, spread_to_hanging

PLANES = {2: "xz", 3: None}
GRIDS = st.tuples(st.sampled_from([2, 3]), st.integers(0, 10_000))


def patch(dimension, seed, per_edge, slope):
    """Stress and internal forces after the linear displacement x -> slope x is imposed on a random grid."""
    grid = random_grid(np.random.default_rng(seed), dimension)
    model = make_model(make_scene(PLANES[dimension], particles_per_cell=per_edge), grid)
    state = model.virgin_state()
    scheme = ExplicitScheme(model, state, model.volumes(0))
    state.velocity[:] = grid.node_position @ slope.T
    scheme.body.update(1.0)
    return model, state, scheme.body.internal_force()


@settings(max_examples=15, deadline=None)
@given(GRIDS, st.sampled_from([1, 2]))
def test_a_linear_displacement_strains_all_cells_alike_and_leaves_no_force(grid, per_edge):
    """Patch test: uniform stress, and internal forces of neighbouring cells cancel at interior free nodes. 1e-12:
    sums of some twenty terms that cancel."""
    dimension, seed = grid
    slope = np.random.default_rng(seed).normal(size=(dimension, dimension))
    model, state, force = patch(dimension, seed, per_edge, slope)
    assert model.grid.is_hanging.any()
    strain = np.zeros((3, 3))
    strain[:dimension, :dimension] = 0.5 * (slope + slope.T)
    lame, shear = model.elastic_constants[0]
    tensor = lame * np.trace(strain) * np.eye(3) + 2 * shear * strain
    expected = tensor[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    size = np.abs(tensor).max()
    np.testing.assert_allclose(state.stress, np.tile(expected, (len(state.stress), 1)), rtol=0, atol=1e-12 * size)
    assert np.abs(force).max() < 1e-12 * size * model.grid.cell_size.max() ** (dimension - 1)


@settings(max_examples=10, deadline=None)
@given(GRIDS)
def test_rigid_motion_strains_nothing(grid):
    """Translation and infinitesimal rotation: all stress at round-off of velocity gradients times moduli."""
    dimension, seed = grid
    spin = np.random.default_rng(seed).normal(size=(dimension, dimension))
    _, state, force = patch(dimension, seed, 1, spin - spin.T)
    assert np.abs(state.stress).max() < 1e-12 * 57e9 * np.abs(spin).max() * 8
    assert np.abs(force).max() < 1e-11 * 57e9 * np.abs(spin).max() * 64


@settings(max_examples=15, deadline=None)
@given(GRIDS)
def test_collecting_is_the_adjoint_of_spreading_and_conserves_totals(grid):
    """<C u, f> = <u, C^T f> for all u and f; and since C 1 = 1, the total of f is kept."""
    dimension, seed = grid
    random = np.random.default_rng(seed)
    grid = random_grid(random, dimension)
    hanging = np.flatnonzero(grid.is_hanging).astype(np.int32)
    free_motion = random.normal(size=(len(grid.node_index), dimension))
    free_motion[hanging] = 0.0
    force = random.normal(size=free_motion.shape)
    motion, collected = free_motion.copy(), force.copy()
    spread_to_hanging(hanging, grid.node_parents, motion)
    np.testing.assert_allclose(motion, constrain(grid, free_motion), atol=1e-15)
    collect_to_parents(grid.node_parents, collected)
    assert (collected[hanging] == 0.0).all()
    size = np.abs(force).sum()
    assert np.sum(motion * force) == pytest.approx(np.sum(free_motion * collected), abs=1e-14 * size)
    np.testing.assert_allclose(collected.sum(axis=0), force.sum(axis=0), rtol=0, atol=1e-14 * size)


@pytest.mark.parametrize(("dimension", "per_edge"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_mass_and_momentum_of_particles_arrive_at_free_nodes(dimension, per_edge):
    """Total nodal mass is the particles'; momentum of a rigid motion is mass times velocity."""
    grid = random_grid(np.random.default_rng(1), dimension)
    model = make_model(
        make_scene(PLANES[dimension], particles_per_cell=per_edge, solver={"density_scaling": False}), grid
    )
    scheme = ExplicitScheme(model, model.virgin_state(), model.volumes(0))
    assert (scheme.body.mass[grid.is_hanging] == 0.0).all()
    domain = np.prod(grid.shape * grid.fine_cell)
    assert scheme.body.mass.sum() == pytest.approx(2850.0 * domain, rel=1e-13)
    center = (scheme.body.mass[:, None] * grid.node_position).sum(axis=0) / scheme.body.mass.sum()
    np.testing.assert_allclose(center, 0.5 * grid.shape * grid.fine_cell, rtol=1e-12)


@pytest.mark.parametrize("block", [1, 7, 2048])
def test_block_scatter_is_plain_assembly(block, monkeypatch):
    """Random corner forces, summed into slots of blocks of any size, equal np.add.at and C^T."""
    monkeypatch.setattr(block_scatter, "CELLS_PER_BLOCK", block)
    grid = random_grid(np.random.default_rng(8), 3)
    scatter = block_scatter.build_scatter(grid.vtk_nodes, grid.node_parents)
    assert len(scatter.block_start) == 1 + -(-len(grid.vtk_nodes) // block)
    corner_force = np.random.default_rng(9).normal(size=grid.vtk_nodes.shape)
    slots = np.zeros(scatter.slots)
    np.add.at(slots, scatter.cell_slots, corner_force)
    for first, last, low, high in zip(
        scatter.block_start[:-1], scatter.block_start[1:], scatter.slot_start[:-1], scatter.slot_start[1:], strict=True
    ):
        assert scatter.cell_slots[first:last].min() >= low
        assert scatter.cell_slots[first:last].max() < high
    plain = np.zeros((len(grid.node_index), 1))
    np.add.at(plain[:, 0], grid.vtk_nodes, corner_force)
    collect_to_parents(grid.node_parents, plain)
    for i, node in enumerate(scatter.free_nodes):
        own = slice(scatter.sum_start[i], scatter.sum_start[i + 1])
        total = np.sum(scatter.sum_weights[own] * slots[scatter.sum_slots[own]])
        assert total == pytest.approx(plain[node, 0], abs=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_relaxation_has_the_same_bits_on_one_thread_and_two(dimension, monkeypatch):
    """Blocks of 16 cells, so that two threads have work: stress, displacement and forces agree bit for bit."""
    monkeypatch.setattr(block_scatter, "CELLS_PER_BLOCK", 16)
    from mechanics.scenes import ball, excavation, grid_around, solve, uniform

    shape = ball([16.0] * dimension, 5.0)
    scene = make_scene(
        PLANES[dimension], stress=uniform(-30e6, -20e6, -10e6, 1e6, 2e6, 3e6), excavations=[excavation()]
    )
    grid = grid_around([shape], [4] * dimension, 2, 8.0)
    results = []
    for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS), 1):
        numba.set_num_threads(threads)
        scheme, history = solve(make_model(scene, grid, [shape]), 1e-4)
        results.append((scheme.body.state.stress, scheme.body.state.displacement, np.array(history.rows)))
    for other in results[1:]:
        for one, two in zip(results[0], other, strict=True):
            assert np.array_equal(one, two)
