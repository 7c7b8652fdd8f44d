"""MovingScheme as a scheme: beside the resting one, and through the stages' datasets."""

import numpy as np
import pytest

from mpm_core.equilibrium import explicit_scheme
from mpm_core.equilibrium.convergence import History, norm
from mpm_core.equilibrium.explicit_scheme import ExplicitScheme
from mpm_core.equilibrium.moving_scheme import MovingScheme
from mpm_core.files.state_datasets import read_state
from mpm_core.model.model import build_model
from mpm_core.model.state import snapshot
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.external_forces import external_force
from tests.mechanics.scenes import (
    COULOMB,
    ball,
    excavation,
    grid_around,
    host_everywhere,
    make_dataset,
    make_model,
    make_scene,
    pieces_of,
    uniform,
)

CENTER = {2: (20.0, 20.0), 3: (20.0, 20.0, 20.0)}
PLANES = {2: "xz", 3: None}


def cavity(dimension: int):
    """A cavity of 5 m radius in a small grid of two levels: its shape and the grid."""
    shape = ball(CENTER[dimension], 5.0)
    return shape, grid_around([shape], (5,) * dimension, 2, 8.0)


def test_a_long_relaxation_is_settled_on_its_way(monkeypatch):
    """Elastic rock rests the same, whether or not flow is counted anew on the way."""
    shape, grid = cavity(2)
    scene = make_scene("xz", stress=uniform(-1e3, -2e3, -1.5e3, 0.0, 3e2), excavations=[excavation()])
    model = make_model(scene, grid, [shape])
    force, stresses = external_force(model, 0), []
    for often in (explicit_scheme.ITERATIONS_PER_FLOW_COUNT, explicit_scheme.ITERATIONS_PER_CHECK):
        monkeypatch.setattr(explicit_scheme, "ITERATIONS_PER_FLOW_COUNT", often)
        scheme, history = MovingScheme(model, model.virgin_state(), model.volumes(0)), History(1e-6)
        scheme.reach_equilibrium(force, 1e-6, norm(force), history)
        assert history.iteration > explicit_scheme.ITERATIONS_PER_CHECK
        stresses.append(scheme.body.state.stress)
    np.testing.assert_array_equal(*stresses)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("cut_cells", ["whole", "subdivide"])
def test_tiny_displacement_rests_where_the_resting_scheme_does(dimension, cut_cells):
    """A cavity under 1 kPa: particles move 1e-8 of a cell, so both schemes have one equilibrium.

    Bound: tolerance 1e-9 of both, times the number that leads from residual force to stress (some tens here).
    """
    shape, grid = cavity(dimension)
    scene = make_scene(
        PLANES[dimension],
        stress=uniform(-1e3, -2e3, -1.5e3, 0.0, 3e2),
        excavations=[excavation()],
        particles_per_cell=2,
        cut_cells=cut_cells,
    )
    model = make_model(scene, grid, [shape])
    volume, force = model.volumes(0), external_force(model, 0)
    states = []
    for scheme_class in (ExplicitScheme, MovingScheme):
        scheme = scheme_class(model, model.virgin_state(), volume)
        scheme.reach_equilibrium(force, 1e-9, norm(force), History(1e-9))
        states.append(scheme.body.state)
    resting, moving = states
    there = volume > 0.0
    np.testing.assert_allclose(
        moving.stress[there], resting.stress[there], rtol=0.0, atol=1e-6 * np.abs(resting.stress).max()
    )
    np.testing.assert_allclose(
        moving.displacement, resting.displacement, rtol=0.0, atol=1e-6 * np.abs(resting.displacement).max()
    )
    assert moving.cell_changes == 0
    assert np.abs(moving.position - model.particles.position).max() > 0.1 * np.abs(resting.displacement).max()


@pytest.mark.parametrize("scaling", [True, False])
def test_comes_to_rest_with_scaled_and_with_true_density(scaling):
    """A cavity in 30 MPa: rest is reached, and the wall closes alike (1 %: particles leave their quadrature points)."""
    shape, grid = cavity(2)
    scene = make_scene(
        "xz",
        stress=uniform(-30e6, -30e6, -30e6),
        excavations=[excavation()],
        particles_per_cell=2,
        cut_cells="whole",
        solver={"density_scaling": scaling},
    )
    model = make_model(scene, grid, [shape])
    scheme = MovingScheme(model, model.virgin_state(), model.volumes(0))
    force, history = external_force(model, 0), History(1e-5)
    scheme.reach_equilibrium(force, 1e-5, norm(force), history)
    reference = ExplicitScheme(model, model.virgin_state(), model.volumes(0))
    reference.reach_equilibrium(force, 1e-5, norm(force), History(1e-5))
    assert np.abs(scheme.body.state.displacement).max() == pytest.approx(
        np.abs(reference.body.state.displacement).max(), rel=0.01
    )


def test_virgin_rock_with_particles_that_may_move_stays():
    """Nothing mined, Coulomb on, stress with depth: exactly zero."""
    _, grid = cavity(2)
    scene = make_scene("xz", host=COULOMB, stress=uniform(-10e6, -20e6, -15e6), particles_per_cell=2)
    model = make_model(scene, grid)
    scheme = MovingScheme(model, model.virgin_state(), model.volumes(0))
    scheme.reach_equilibrium(external_force(model, 0), 1e-6, 0.0, History(1e-6))
    assert not scheme.body.state.displacement.any()
    assert not scheme.body.state.stress.any()


def test_steps_start_where_particles_came_to_rest(tmp_path):
    """Elastic history, then Coulomb steps by file: places and cells are those of the step before, and failures happen.

    The second step mines nothing more: nothing moves but by what the tolerance leaves.
    """
    shape, grid = cavity(2)
    stage = {
        "host": COULOMB,
        "stress": uniform(-10e6, -20e6, -12e6),
        "excavations": [excavation()],
        "particles_per_cell": 2,
        "cut_cells": "whole",
        "solver": {"move": True, "tolerance": 1e-5},
    }
    grid_file = make_dataset(make_scene("xz", **stage), grid, [shape])
    elastic, _ = elastic_stage(make_scene("xz", **stage), grid_file, tmp_path / "failed.npz")
    first, facts = mining_step(make_scene("xz", **stage), grid_file, elastic, tmp_path / "failed.npz")
    assert facts["failed_particles"] > 0
    assert facts["cell_changes"] == (first.cell != elastic.cell).sum()
    two = make_scene("xz", steps=2, **stage)
    model = build_model(two, grid, host_everywhere(grid), pieces_of(grid, [shape]))
    state = read_state(first, model)
    np.testing.assert_array_equal(state.position, first.position.values[:, [0, 2]])
    np.testing.assert_array_equal(state.cell, first.cell.values)
    assert np.abs(state.position - model.particles.position).max() > 1e-4
    second, facts = mining_step(two, grid_file, first, tmp_path / "failed.npz")
    moved = np.abs(second.position - first.position).max()
    assert facts["failed_particles"] == 0
    assert float(moved) < 1e-2 * float(np.abs(first.displacement).max())
    np.testing.assert_allclose(
        first.displacement.values[:, [0, 2]], first.position.values[:, [0, 2]] - model.particles.position
    )


def test_going_back_puts_particles_and_energy_where_they_were():
    """Strain that runs away across cells is undone: places in cells, velocity, and what flow has dissipated."""
    shape, grid = cavity(2)
    scene = make_scene(
        "xz", host=COULOMB, stress=uniform(-30e6, -20e6, -18e6, 0.0, 3e6), excavations=[excavation()],
        particles_per_cell=2, cut_cells="whole",
    )  # fmt: skip
    model = make_model(scene, grid, [shape])
    scheme = MovingScheme(model, model.virgin_state(), model.volumes(0))
    body, state, force = scheme.body, scheme.body.state, external_force(model, 0)
    kept = snapshot(state, True)
    before = {name: np.copy(value) for name, value in vars(state).items()}
    state.failed[:] = 0
    scheme.set_failed()
    for _ in range(300):
        body.update(body.time_step)
        body.advance(10.0 * force, body.time_step)
    assert body.dissipated.any()
    assert (state.cell != before["cell"]).any()
    scheme.go_back(kept)
    for name in ("cell", "position", "stress", "displacement", "energy"):
        np.testing.assert_array_equal(getattr(state, name), before[name], err_msg=name)
    np.testing.assert_allclose(body._position(), before["position"], rtol=0, atol=1e-9)
    assert not body.velocity.any()
    np.testing.assert_array_equal(np.sort(body.cell_particles), np.arange(model.particles.count))
    for cell in np.unique(state.cell):
        own = body.cell_particles[body.cell_start[cell] : body.cell_start[cell + 1]]
        assert (state.cell[own] == cell).all()
