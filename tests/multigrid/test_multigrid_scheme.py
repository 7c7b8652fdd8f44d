"""Scheme `multigrid` against scheme `explicit`: the same equilibrium."""

import logging

import numba
import numpy as np
import pytest

from mpm_core.equilibrium import multigrid_scheme
from mpm_core.equilibrium.convergence import History, norm
from mpm_core.equilibrium.explicit_scheme import ExplicitScheme
from mpm_core.equilibrium.multigrid_scheme import MultigridScheme
from mpm_core.multigrid.solver import Solution
from mpm_core.stages.external_forces import external_force
from tests.mechanics.scenes import COULOMB, ball, excavation, grid_around, make_model, make_scene, uniform
from tests.multigrid.test_operator import scene_with_everything

STRESS = 30e6  # Pa, largest in-situ stress of the scenes


def at_rest(kind, model, volume, state, tolerance=1e-9, parts=1):
    """The scheme after relaxation under all forces, put on in parts."""
    scheme, history = kind(model, state, volume), History(tolerance)
    force = external_force(model, 0)
    for part in range(1, parts + 1):
        scheme.reach_equilibrium(force * part / parts, tolerance, norm(force), history)
    return scheme, history


def difference(one, other, volume) -> float:
    """Root mean square of the difference in stress over all rock and fill, share of the in-situ stress."""
    square = (one.body.state.stress - other.body.state.stress) ** 2
    return float(np.sqrt(np.sum(square * volume[:, None]) / volume.sum()) / STRESS)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("boundary", ["fixed", "roller", "traction"])
@pytest.mark.parametrize(("points", "cut_cells"), [(1, "mean"), (2, "mean"), (2, "whole"), (1, "subdivide")])
def test_elastic_equilibrium_is_that_of_the_explicit_scheme(dimension, boundary, points, cut_cells):
    """Filled and empty excavation, also where nothing holds the body; both to 1e-9 of the excavation forces."""
    model, volume = scene_with_everything(dimension, points, cut_cells, boundary)
    (one, _), (other, history) = (
        at_rest(kind, model, volume, model.virgin_state()) for kind in (ExplicitScheme, MultigridScheme)
    )
    assert history.iteration <= 20
    assert difference(one, other, volume) < 1e-8
    moved = (one.body.mass > 0.0) | model.grid.is_hanging
    gap = np.abs(one.body.state.displacement - other.body.state.displacement)[moved].max()
    assert gap < 1e-7 * np.abs(one.body.state.displacement[moved]).max()


def plastic_model(dimension: int):
    """A tunnel or a spherical void in perfectly plastic rock; (model, volume, state with all fine rock failed)."""
    strength = {key: {"intact": value["residual"], "residual": value["residual"]} for key, value in COULOMB.items()
                if isinstance(value, dict)}  # fmt: skip
    strength["cohesion"] = {"intact": 5e6, "residual": 5e6}
    scene = make_scene(
        "xy" if dimension == 2 else None,
        host=COULOMB | strength,
        stress=uniform(-STRESS, -0.7 * STRESS, -0.8 * STRESS),
        excavations=[excavation()],
    )
    shapes = [ball([16.0] * dimension, 3.0)]
    grid = grid_around(shapes, (8,) * dimension, levels=3, coarse=4.0, rings=2)
    model = make_model(scene, grid, shapes)
    volume, state = model.volumes(0), model.virgin_state()
    finest = grid.cell_level[model.particles.cell] == 2
    state.failed[finest & (volume > 0.0)] = 0
    return model, volume, state


@pytest.mark.parametrize("dimension", [2, 3])
def test_plastic_equilibrium_is_that_of_the_explicit_scheme(dimension):
    """Rock at residual strength flows around a void: same stress and flow, in far fewer steps, no explicit ones."""
    results = []
    for kind in (ExplicitScheme, MultigridScheme):
        model, volume, state = plastic_model(dimension)
        results.append(at_rest(kind, model, volume, state, tolerance=1e-6))
    (one, steps), (other, cycles) = results
    flowed = (one.body.state.later_strain != 0.0).any(axis=1)
    assert flowed.sum() > 20
    assert difference(one, other, volume) < 1e-4
    flow = np.sum(np.abs(one.body.state.later_strain), axis=1), np.sum(np.abs(other.body.state.later_strain), axis=1)
    assert np.sum(np.abs(flow[0] - flow[1]) * volume) < 0.02 * np.sum(flow[0] * volume)
    assert cycles.iteration < 0.4 * steps.iteration


@pytest.mark.parametrize("dimension", [2, 3])
def test_threads_change_no_bit(dimension, monkeypatch):
    """Elastic solution and flow, with the tangent from the fourth cycle on, on one thread and on two."""
    for name in ("FIRST_TANGENT_CYCLE", "FIRST_PLASTIC_TANGENT_CYCLE"):
        monkeypatch.setattr(multigrid_scheme, name, 3)
    states = []
    for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
        numba.set_num_threads(threads)
        model, volume, state = plastic_model(dimension)
        states.append(at_rest(MultigridScheme, model, volume, state, tolerance=1e-4)[0].state)
    one, other = states
    assert one.later_strain.any()
    for name in ("stress", "later_strain", "displacement", "hourglass_force"):
        assert np.array_equal(getattr(one, name), getattr(other, name))


def test_explicit_steps_take_over_where_cycles_are_not_enough(monkeypatch, caplog):
    """The state returned is at rest all the same, and the log says how."""
    monkeypatch.setattr(multigrid_scheme, "MAX_FLOW_CYCLES", 3)
    model, volume, state = plastic_model(2)
    with caplog.at_level(logging.WARNING):
        _, history = at_rest(MultigridScheme, model, volume, state, tolerance=1e-5)
    assert "going on with explicit steps" in caplog.text
    assert history.rows[-1][3] <= 1e-5


@pytest.mark.parametrize("ratio", [2.0, np.inf, np.nan])
def test_a_diverged_solution_is_never_applied(ratio, monkeypatch, caplog):
    """The state is as before, and explicit steps bring it to rest."""
    model, volume, state = plastic_model(2)
    state.failed[:] = -1

    def diverging(self, *_):
        return Solution(np.full(len(self.finest.inverse_diagonal), 1e140), ratio, 100)

    monkeypatch.setattr(multigrid_scheme.ElasticSolver, "solve", diverging)
    with caplog.at_level(logging.WARNING):
        scheme, history = at_rest(MultigridScheme, model, volume, state, tolerance=1e-4)
    assert "going on with explicit steps" in caplog.text
    assert history.rows[-1][3] <= 1e-4
    assert 0.0 < np.abs(scheme.body.state.displacement).max() < 0.1


def test_a_residual_that_runs_away_is_left_to_explicit_steps(monkeypatch, caplog):
    """Still a number, of 1e38 N: its square is none, and the next combination of steps had no solution."""
    make_step, made = MultigridScheme._make_step, []

    def make_worse(self):
        size, largest = make_step(self)
        made.append(size)
        factor = 1e30 if len(made) == 4 else 1.0
        self.rows[3] *= factor
        return factor * size, factor * largest

    monkeypatch.setattr(MultigridScheme, "_make_step", make_worse)
    model, volume, state = plastic_model(2)
    with caplog.at_level(logging.WARNING):
        scheme, history = at_rest(MultigridScheme, model, volume, state, tolerance=1e-4)
    assert "going on with explicit steps" in caplog.text
    assert len(made) == 4
    assert history.rows[-1][3] <= 1e-4
    assert 0.0 < np.abs(scheme.body.state.displacement).max() < 0.1


def test_a_relaxation_that_stands_still_begins_anew(monkeypatch, caplog):
    """Anderson's steps can die out short of rest, here after 8 of them each time that it begins."""
    next_step = multigrid_scheme.Anderson.next_step

    def dying(self, residual, correction, size, step, symmetric=True):
        next_step(self, residual, correction, size, step, symmetric)
        if self.count > 8:
            step[:] = 0.0

    monkeypatch.setattr(multigrid_scheme.Anderson, "next_step", dying)
    model, volume, state = plastic_model(2)
    with caplog.at_level(logging.WARNING):
        _, history = at_rest(MultigridScheme, model, volume, state, tolerance=1e-5)
    assert "explicit" not in caplog.text
    assert history.rows[-1][3] <= 1e-5


def hard_tunnel(cells: int, **strength):
    """A tunnel in rock that has all failed, on equal cells; (model, volume, state)."""
    host = COULOMB | {key: {"intact": value, "residual": value} for key, value in strength.items()}
    stress = uniform(-STRESS, -0.7 * STRESS, -0.8 * STRESS)
    scene = make_scene("xy", host=host, stress=stress, excavations=[excavation()])
    shapes = [ball([16.0, 16.0], 6.0)]
    model = make_model(scene, grid_around([], (cells, cells), 1, 32.0 / cells), shapes)
    volume, state = model.volumes(0), model.virgin_state()
    state.failed[volume > 0.0] = 0
    return model, volume, state


@pytest.mark.parametrize("dilation", [10.0, 30.0])
def test_rock_without_tensile_strength_flows_to_rest_in_cycles(dilation, caplog):
    """Friction 30 degrees, cohesion 5 MPa, no tension. 353 and 299 with elastic cycles alone."""
    model, volume, state = hard_tunnel(
        40, friction_angle=30.0, dilation_angle=dilation, cohesion=5e6, tension_cutoff=0.0
    )
    with caplog.at_level(logging.WARNING):
        scheme, history = at_rest(MultigridScheme, model, volume, state, tolerance=1e-5)
    assert "explicit" not in caplog.text
    assert history.iteration <= 200
    assert history.rows[-1][3] <= 1e-5
    # Nothing of the tangent is left for the next relaxation: a killed stage goes on without it.
    assert scheme.solver.cycle is scheme.solver.elastic_cycle
    assert all(level.operator.tangents is None for level in scheme.solver.hierarchy.levels)


def test_nothing_mined_is_at_rest():
    """No force: no cycle, no motion."""
    scene = make_scene(stress=uniform(-STRESS))
    model = make_model(scene, grid_around([], (3, 3, 3), 1, 4.0))
    scheme, history = at_rest(MultigridScheme, model, model.volumes(0), model.virgin_state())
    assert history.iteration == 0
    assert not scheme.body.state.displacement.any()
