"""Pressure on walls from inside: by hand, what leaves rock as it was, superposition, steps, fill, energy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mechanics.scenes import (
    COULOMB,
    HOST,
    ball,
    box,
    excavation,
    grid_around,
    make_dataset,
    make_model,
    make_scene,
    solve,
    uniform,
)
from mpm_core.scene.scene import Excavation
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.external_forces import external_force
from verification.answers.kirsch.closed_form import InfinitePlate

DIMENSIONS = [("xy", 2), (None, 3)]
P = 5e6


def pressed(pressure, mined=0, **options):
    """An excavation with a pressure Pa from the step that mines it, or pairs of step and Pa."""
    pairs = pressure if isinstance(pressure, list) else [[mined, pressure]]
    return excavation(mined, **options) | {"pressure": pairs}


def test_one_cell_presses_its_neighbours_apart():
    """The middle of three cells of 2 m is open: each node of its walls bears half of p h, outwards; others nothing."""
    grid = grid_around([], [3, 1], 1, 2.0)
    faces = {"y_lower": "free", "y_upper": "free"}
    scene = make_scene("xy", boundary=faces, excavations=[pressed(P)])
    force = external_force(make_model(scene, grid, [box([2.0, -1.0], [4.0, 3.0])]), 0)
    x = grid.node_position[:, 0]
    np.testing.assert_allclose(force[:, 0], np.select([x == 2.0, x == 4.0], [-P, P], 0.0), rtol=0, atol=1e-9 * P)
    np.testing.assert_allclose(force[:, 1], 0.0, atol=1e-9 * P)  # through the free faces it presses on nothing


@pytest.mark.parametrize(("plane", "dimension"), DIMENSIONS)
@pytest.mark.parametrize("treatment", ["mean", "whole", "subdivide"])
def test_rock_mined_against_its_own_stress_does_not_notice(plane, dimension, treatment, tmp_path):
    """All-round virgin stress -p, no weight: forces are zero to the last bit, and no iteration is made, whatever the
    share of the cells at the walls, where excavations overlap, and in every step."""
    shapes = [ball([19.3] * dimension, 5.7), ball([23.0] * dimension, 4.1)]
    p = 31.7e6 / 3.0
    scene = make_scene(
        plane, stress=uniform(-p, -p, -p), host=COULOMB | {"cohesion": {"intact": 9e6, "residual": 1e6}},
        cut_cells=treatment, particles_per_cell=2, steps=2, excavations=[pressed(p), pressed(p, 1, name="next")],
        solver={"scheme": "multigrid"},
    )  # fmt: skip
    grid = grid_around(shapes, [5] * dimension, 2, 8.0)
    model = make_model(scene, grid, shapes)
    assert (model.volumes(1) < model.particles.full_volume).any()
    for step in (0, 1):
        assert (external_force(model, step) == 0.0).all()
    dataset = make_dataset(scene, grid, shapes)
    elastic, facts = elastic_stage(scene, dataset, tmp_path / "f.npz")
    assert facts["iterations"] == 0
    state, facts = mining_step(scene, dataset, elastic, tmp_path / "f.npz")
    assert facts["iterations"] == 0
    assert (state.node_displacement == 0.0).all()
    assert facts["failed_particles"] == 0


@settings(max_examples=20, deadline=None)
@given(
    stress=st.lists(st.floats(-40e6, 0.0), min_size=3, max_size=3),
    pressure=st.floats(0.0, 50e6),
    treatment=st.sampled_from(["mean", "subdivide"]),
    plane=st.sampled_from(["xy", None]),
    center=st.floats(0.0, 20.0),
)
def test_pressure_adds_up_with_virgin_stress(stress, pressure, treatment, plane, center):
    """The forces of a hole under stress s and pressure p are those under s + p I alone, at every node, also where the
    hole reaches faces that keep their traction. 1e-9 of both."""
    dimension = 2 if plane else 3
    shape = ball([center] * dimension, 6.0)
    grid = grid_around([shape], [5] * dimension, 2, 8.0)

    def force(virgin, entry):
        scene = make_scene(
            plane, stress=uniform(*virgin), boundary={"x_lower": "traction", "y_lower": "traction"},
            cut_cells=treatment, excavations=[entry],
        )  # fmt: skip
        model = make_model(scene, grid, [shape])
        solid = np.zeros(len(model.grid.node_index), bool)  # what lies in the void alone is no matter
        solid[model.cell_nodes[model.particles.cell[model.volumes(0) > 0.0]]] = True
        return external_force(model, 0)[solid]

    both = force(stress, pressed(pressure))
    alone = force(np.array(stress) + pressure, excavation())
    np.testing.assert_allclose(both, alone, rtol=0, atol=1e-9 * 64.0 * (pressure - min(stress) + 1.0))


def test_kirsch_with_internal_pressure():
    """Quarter of a hole of a = 6 m in 30 and 15 MPa with 5 MPa inside, plane strain, h = 1 m, tractions at 13 a:
    Kirsch (1898) under both and Lame's p (a / r)^2. 3 % of 30 MPa rms from a + 2h to 4 a, 5 % of the closure."""
    a, stress = 6.0, np.array([-30e6, -15e6, 0.0])
    shape = ball([0.0, 0.0], a)
    grid = grid_around([shape], [20, 20], 3, 4.0, rings=2)
    boundary = dict.fromkeys(("x_lower", "y_lower"), "roller") | dict.fromkeys(("x_upper", "y_upper"), "traction")
    scene = make_scene("xy", stress=uniform(-30e6, -15e6, -20e6), boundary=boundary, excavations=[pressed(P)])
    model = make_model(scene, grid, [shape])
    scheme, _ = solve(model, 1e-5)
    nu = HOST["poisson_ratio"]
    plate = InfinitePlate(a, tuple(stress), HOST["youngs_modulus"] / (2 * (1 + nu)), nu)
    x = model.particles.position
    r, angle = np.linalg.norm(x, axis=1), np.arctan2(x[:, 1], x[:, 0])
    ring = (r > a + 2.0) & (r < 4 * a)
    r, angle = r[ring], angle[ring]
    lame = P * (a / r) ** 2
    rr, tt, rt, _, _ = plate.polar(r, angle)
    rr, tt = rr - lame, tt + lame
    c, s = np.cos(angle), np.sin(angle)
    found = (scheme.body.state.stress + model.insitu)[ring]
    exact = np.stack(
        [rr * c**2 + tt * s**2 - 2 * rt * s * c, rr * s**2 + tt * c**2 + 2 * rt * s * c,
         (rr - tt) * s * c + rt * (c**2 - s**2)], axis=1,
    )  # fmt: skip
    rms = np.sqrt(np.mean((found[:, [0, 1, 5]] - exact) ** 2))
    without = np.sqrt(np.mean(lame**2))
    assert rms < 0.03 * 30e6
    assert rms < 0.5 * without  # it would be seen to be missing


def test_pressure_changes_in_later_steps_and_ends_with_fill(tmp_path):
    """5 MPa when mined, 2 MPa a step later, then filled: forces are those of each, and elastic walls go where they
    would have gone at once. With fill placed into the closed opening nothing presses any more."""
    shape = ball([0.0, 0.0], 6.0)
    grid = grid_around([shape], [6, 6], 3, 4.0)
    faces = {"x_lower": "roller", "y_lower": "roller"}
    options = {"boundary": faces, "stress": uniform(-20e6, -20e6, -20e6), "solver": {"scheme": "multigrid"}}

    def run(*excavations):
        state = None
        for last in range(3):
            now = make_scene(
                "xy", excavations=[entry | shown(entry, last) for entry in excavations], steps=last + 1, **options
            )
            dataset = make_dataset(now, grid, [shape])
            if state is None:
                state, _ = elastic_stage(now, dataset, tmp_path / "f.npz")
            state, facts = mining_step(now, dataset, state, tmp_path / "f.npz")
            yield state, facts

    def shown(entry, last):
        return {"fill": entry["fill"] if entry["filled"] <= last else None}

    def force(entry, step):
        return external_force(
            make_model(make_scene("xy", excavations=[entry], steps=3, **options), grid, [shape]), step
        )

    by_step = pressed([[0, P], [1, 2e6]], fill="fill", filled=2)
    np.testing.assert_array_equal(force(by_step, 0), force(pressed(P), 0))
    np.testing.assert_array_equal(force(by_step, 1), force(pressed(2e6), 1))
    np.testing.assert_array_equal(force(by_step, 2), force(excavation(fill="fill", filled=2), 2))
    states = list(run(by_step))
    once = list(run(pressed(2e6)))
    moved, exact = (run_[1][0].node_displacement.values for run_ in (states, once))
    np.testing.assert_allclose(moved, exact, rtol=0, atol=1e-4 * np.abs(exact).max())
    closed = [np.abs(state.node_displacement.values).max() for state, _ in states]
    assert closed[1] > 1.1 * closed[0]  # less pressure, more closure
    assert closed[2] > closed[1]  # and none at all: walls lean on the fill
    for _, facts in states[1:]:
        assert facts["energy_left_share"] < 1e-9


def test_the_highest_pressure_acts_where_openings_overlap():
    """Two overlapping squares, one listed first or last: the overlap has the higher pressure. Where pressure ends in
    the void it pushes nothing: forces act on the walls alone."""
    shapes = [box([4.0, 4.0], [12.0, 12.0]), box([8.0, 4.0], [16.0, 12.0])]
    grid = grid_around([], [10, 8], 1, 2.0)
    forces = []
    for order in ([0, 1], [1, 0]):
        entries = [pressed(P), pressed(2e6, name="low")]
        scene = make_scene("xy", excavations=[entries[i] for i in order])
        forces.append(external_force(make_model(scene, grid, [shapes[i] for i in order]), 0))
    np.testing.assert_array_equal(*forces)
    x, y = grid.node_position.T
    side = np.sum(forces[0][x == 4.0, 0]), np.sum(forces[0][x == 16.0, 0])
    np.testing.assert_allclose(side, [-8.0 * P, 8.0 * 2e6], rtol=1e-12)
    roof = forces[0][y == 12.0, 1].sum()
    np.testing.assert_allclose(roof, 8.0 * P + 4.0 * 2e6, rtol=1e-12)
    inside = (x > 4.0) & (x < 16.0) & (y > 4.0) & (y < 12.0)
    assert (forces[0][inside] == 0.0).all()


def test_pressure_begins_with_mining_and_ends_with_fill():
    """Step by step, from the schedule alone."""
    entry = Excavation("stope", 1, "fill", 4, ((1, 5.0), (3, 2.0)))
    assert [entry.pressure_at(step) for step in range(6)] == [0.0, 5.0, 5.0, 2.0, 0.0, 0.0]
    assert Excavation("planned", -1, None, -1, ((0, 5.0),)).pressure_at(3) == 0.0
    assert Excavation("late", 0, None, -1, ((2, 5.0),)).pressure_at(1) == 0.0


@pytest.mark.parametrize("scheme", ["multigrid", "explicit"])
def test_the_balance_closes_around_a_pressed_tunnel_that_fails(scheme, tmp_path):
    """Mined with 5 MPa inside, let off to 0.5 MPa in the next step, in rock that fails. With pressure less
    fails than without."""
    shape = ball([0.0, 0.0], 6.0)
    grid = grid_around([shape], [6, 6], 3, 4.0)
    failed = {}
    for name, entry in (("with", pressed([[1, P], [2, 0.5e6]], 1)), ("without", excavation(1))):
        state = None
        for steps in (1, 2, 3):
            entries = [entry if steps > 1 else excavation(-1)]
            scene = make_scene(
                "xy", host=COULOMB, stress=uniform(-15e6, -15e6, -15e6), excavations=entries, steps=steps,
                boundary={"x_lower": "roller", "y_lower": "roller"}, solver={"scheme": scheme, "increments": 2},
            )  # fmt: skip
            dataset = make_dataset(scene, grid, [shape])
            if state is None:
                state, _ = elastic_stage(scene, dataset, tmp_path / "f.npz")
            state, facts = mining_step(scene, dataset, state, tmp_path / "f.npz")
            failed[name, steps] = facts["failed_particles"]
            if facts["failed_particles"]:
                assert facts["energy_left_share"] < 1e-9
                assert facts["energy_motion"] > 0.0
    assert failed["with", 2] < failed["without", 2]
    assert failed["with", 3] > 0
