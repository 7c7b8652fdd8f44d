"""Tangents of rock that flows, on the levels of the V-cycle."""

import numpy as np
import pytest

from mpm_core.equilibrium.multigrid_scheme import MultigridScheme
from mpm_core.model.particles import slopes_of
from mpm_core.multigrid.cell_entries import pack
from mpm_core.multigrid.coarsening import coarsen, finest_grid
from tests.mechanics.scenes import COULOMB, grid_around, make_model, make_scene, uniform
from tests.multigrid.test_operator import scene_with_everything


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("points", "cut_cells"), [(1, "mean"), (2, "mean"), (2, "whole"), (1, "subdivide")])
def test_finest_level_is_the_derivative_of_the_forces(dimension, points, cut_cells, monkeypatch):
    """Half of the rock has failed; forces of two motions 2e-6 apart. 1e-4: single precision."""
    monkeypatch.setattr("mpm_core.multigrid.flow_forces.STIFFNESS_SHARE_KEPT", 0.0)
    model, volume = scene_with_everything(dimension, points, cut_cells, host=COULOMB)
    state, random = model.virgin_state(), np.random.default_rng(4)
    state.failed[(volume > 0.0) & (random.random(len(volume)) < 0.5)] = 0
    scheme = MultigridScheme(model, state, volume)
    scheme._set_stiffness()
    solver, flow = scheme.solver, scheme._flow_forces()
    flow.begin(state, scheme.body.undo_flow)
    motion, change = (solver.to_rows(3e-3 * random.standard_normal(model.held.shape)) for _ in range(2))
    for values in (motion, change):
        solver.operator.spread(values)
    solver.set_tangents(model, flow, motion)

    fallen = []
    for sign in (1.0, -1.0):
        fallen.append(solver.operator.zeros())
        flow.add(motion + sign * 1e-6 * change, fallen[-1])
        solver.operator.collect(fallen[-1])
    expected = (fallen[0] - fallen[1]) / 2e-6
    with_flow, elastic = solver.operator.zeros(), solver.operator.zeros()
    double = solver.finest.operator.in_precision(np.float64)
    double.apply(change, with_flow)
    solver.drop_tangents()
    solver.finest.operator.in_precision(np.float64).apply(change, elastic)
    free = solver.finest.inverse_diagonal != 0.0
    error = np.abs(elastic - with_flow - expected)[free]
    assert np.abs(expected[free]).max() > 0.01 * np.abs(elastic[free]).max()
    assert np.sum(error > 1e-4 * np.abs(expected[free]).max()) <= 0.01 * free.sum()  # a few at a kink of the surface
    assert solver.cycle is solver.elastic_cycle


@pytest.mark.parametrize("dimension", [2, 3])
def test_all_levels_store_the_energy_of_a_linear_motion(dimension):
    """Random tangents: half of the work of a linear motion against them is the same on every level."""
    scene = make_scene("xy" if dimension == 2 else None, host=COULOMB, stress=uniform(-1e6))
    model = make_model(scene, grid_around([], (16,) * dimension, 1, 1.0))
    scheme = MultigridScheme(model, model.virgin_state(), model.volumes(0))
    scheme._set_stiffness()
    random, levels = np.random.default_rng(0), scheme.solver.hierarchy.levels
    assert len(levels) > 1
    cells = np.sort(random.choice(len(model.cell_nodes), len(model.cell_nodes) // 3, replace=False))
    matrices = random.random((len(cells), 36))
    centre = slopes_of(np.eye(1, 1 << dimension)).repeat(len(cells), axis=0)
    strain, energies = random.normal(size=(dimension, dimension)), []
    grid = finest_grid(model.grid, model.cell_nodes)
    for level in levels:
        operator = level.operator
        tangents = pack(level.siblings, cells, centre[: len(cells)], matrices)
        values, forces = operator.zeros(), operator.zeros()
        rows = values.reshape(-1, operator.width)
        rows[level.siblings.node_row, :dimension] = grid.node_index @ strain * (16.0 / grid.extent[0])
        operator.spread(values)
        tangents.take_off(values, forces)
        energies.append(np.sum(values.astype(float) * forces))
        if level.coarse_of_cell is not None:
            grid, _ = coarsen(grid)
            summed = np.zeros((level.coarse_of_cell.max() + 1, 36))
            np.add.at(summed, level.coarse_of_cell[cells], matrices)
            cells, used = np.unique(level.coarse_of_cell[cells]), np.unique(level.coarse_of_cell[cells])
            matrices = summed[used] * level.kept[used, None]
    np.testing.assert_allclose(energies, energies[0], rtol=1e-4)
