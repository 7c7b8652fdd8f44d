"""Forces of mining by hand: weight removed, tractions taken off, configured loads; and a virgin model stays virgin."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import InputError
from mechanics.scenes import (
    COULOMB,
    FILL,
    HOST,
    TABLE_2,
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
from mpm_core.equilibrium.explicit_scheme import ExplicitScheme
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.external_forces import external_force, load_force

DIMENSIONS = [("xz", 2), (None, 3)]
WEIGHT = {"constant": [0.0] * 6, "gradient": [-0.0249e6, -0.0363e6, -0.0278e6, 0.0, 0.0, 0.0]}


@pytest.mark.parametrize(("plane", "dimension"), DIMENSIONS)
@pytest.mark.parametrize("per_edge", [1, 2])
def test_a_virgin_model_rests(plane, dimension, per_edge, tmp_path):
    """Table 2 is not in equilibrium with gravity (departures.md); as the reference state it must all the same
    move nothing and fail nothing: displacements are exactly zero, no iteration is made."""
    scene = make_scene(plane, host=COULOMB, stress=TABLE_2, particles_per_cell=per_edge)
    grid = make_dataset(scene, grid_around([ball([20.0] * dimension, 3.0)], [5] * dimension, 2, 8.0))
    elastic, _ = elastic_stage(scene, grid, tmp_path / "elastic.npz")
    state, facts = mining_step(scene, grid, elastic, tmp_path / "step.npz")
    assert (state.node_displacement == 0.0).all()
    assert (state.failed == -1).all()
    assert facts["iterations"] == 0
    assert facts["energy_released"] == 0.0
    assert (state.convergence_unbalanced_ratio == 0.0).all()
    virgin = scene.insitu.at(state.position.values[:, 2])
    np.testing.assert_array_equal(state.stress, virgin)


def test_weight_needs_a_face_that_holds_it():
    """Traction or free faces all round, or rollers on the sides alone, leave a heavy model to fall."""
    for boundary in ("traction", "free", {face: "traction" for face in ("z_lower", "z_upper")}):
        sides = (
            {} if isinstance(boundary, str) else dict.fromkeys(("x_lower", "x_upper", "y_lower", "y_upper"), "roller")
        )
        with pytest.raises(InputError, match="holds"):
            make_scene(stress=WEIGHT, boundary=boundary if isinstance(boundary, str) else boundary | sides)
    make_scene(stress=WEIGHT, boundary={"z_upper": "free"})


@pytest.mark.parametrize(("plane", "dimension"), DIMENSIONS)
def test_mined_weight_lifts_and_filled_weight_presses(plane, dimension):
    """Sum of all forces of an inner void: its volume times rho g upwards, and -b sideways if the field asks for a side
    force (Table 2: b_x = d sxz/dD); with fill of 1750 instead of 2850 kg/m3 the difference of both remains."""
    stress = {"constant": TABLE_2["constant"], "gradient": TABLE_2["gradient"]}
    shape = ball([20.3] * dimension, 5.1)
    grid = grid_around([shape], [5] * dimension, 2, 8.0)
    for fill, density in ((None, 0.0), ("fill", FILL["density"])):
        model = make_model(make_scene(plane, stress=stress, excavations=[excavation(fill=fill)]), grid, [shape])
        rock = model.particles.is_rock
        mined = (model.particles.full_volume - model.volumes(0))[rock].sum()
        body = np.array([0.0027e6, -0.0027e6, -0.0278e6])[[0, 2] if plane else [0, 1, 2]]
        expected = -mined * body
        expected[-1] += mined * density * body[-1] / HOST["density"]
        total = external_force(model, 0).sum(axis=0)
        size = np.abs(external_force(model, 0)).sum()
        np.testing.assert_allclose(total, expected, rtol=0, atol=1e-12 * size)
        assert total[-1] > 0.0


def test_a_plan_section_weighs_nothing():
    """Plane xy lies at one depth: a gradient with depth is no force in it."""
    shape = ball([20.0, 20.0], 5.0)
    model = make_model(
        make_scene("xy", stress=TABLE_2, excavations=[excavation()]), grid_around([shape], [5, 5], 2, 8.0), [shape]
    )
    force = external_force(model, 0)
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * np.abs(force).sum())


def test_a_free_face_loses_its_virgin_traction():
    """sigma_zz = -5 MPa and sigma_xz = 1 MPa on the top of a 24 m wide section: +5 MPa and -1 MPa times 24 m, and
    nothing below the uppermost row of nodes."""
    scene = make_scene("xz", stress=uniform(-3e6, -4e6, -5e6, 0, 1e6), boundary={
        "x_lower": "traction", "x_upper": "traction", "z_lower": "fixed", "z_upper": "free"
    })  # fmt: skip
    model = make_model(scene, grid_around([ball([12, 21], 2.0)], [3, 3], 2, 8.0))
    force = external_force(model, 0)
    np.testing.assert_allclose(force.sum(axis=0), [-1e6 * 24, 5e6 * 24], rtol=1e-12)
    assert (force[model.grid.node_position[:, 1] < 24.0] == 0.0).all()


@pytest.mark.parametrize("treatment", ["mean", "subdivide"])
@pytest.mark.parametrize("per_edge", [1, 2])
@pytest.mark.parametrize("condition", ["fixed", "roller", "traction"])
@pytest.mark.parametrize(("plane", "dimension"), DIMENSIONS)
def test_an_opening_at_a_face_loses_the_traction_of_its_own_part_of_it(
    plane, dimension, condition, per_edge, treatment
):  # fmt: skip
    """A box of 12 m by 8 m by 8 m at the upper face of x, in uniform stress with shear. Its wall loses -s n, whose sum
    is -s e_x times the area that it opens in the face; of that the face takes what it holds: all (fixed) or x alone
    (roller). Virgin shear along a roller stayed where its rock was mined."""
    stress = np.array([-20e6, -10e6, -15e6, 1e6, 2e6, 4e6])
    shape = box([28.0, *[16.0] * (dimension - 1)], [41.0, *[24.0] * (dimension - 1)])
    grid = grid_around([shape], [5] * dimension, 2, 8.0)
    scene = make_scene(
        plane, stress=uniform(*stress), boundary={"x_upper": condition}, excavations=[excavation()],
        particles_per_cell=per_edge, cut_cells=treatment,
    )  # fmt: skip
    model = make_model(scene, grid, [shape])
    force = external_force(model, 0)
    expected = -stress[[0, 4] if plane else [0, 5, 4]] * 8.0 ** (dimension - 1)
    first = {"traction": 0, "roller": 1, "fixed": dimension}[condition]
    np.testing.assert_allclose(force.sum(axis=0)[first:], expected[first:], rtol=1e-9)
    assert not force[model.held].any()
    wall = force[np.abs(grid.node_position[:, 0] - 28.0) < 1e-9].sum(axis=0)  # its end, and halves of the cells beside
    np.testing.assert_allclose(wall, expected, rtol=1e-9)


@settings(max_examples=30, deadline=None)
@given(
    constant=st.lists(st.floats(-20e6, 20e6), min_size=6, max_size=6),
    gradient=st.lists(st.floats(-3e4, 3e4), min_size=6, max_size=6),
    conditions=st.lists(st.sampled_from(["fixed", "roller", "traction", "free"]), min_size=5, max_size=5),
    treatment=st.sampled_from(["mean", "subdivide", "whole"]),
    per_edge=st.sampled_from([1, 2]),
    fill=st.sampled_from([None, "fill"]),
    pressure=st.sampled_from([0.0, 5e6]),
    plane=st.sampled_from(["xz", None]),
    center=st.lists(st.floats(0.0, 40.0), min_size=3, max_size=3),
)
def test_nodes_without_rock_or_fill_carry_no_force(
    constant, gradient, conditions, treatment, per_edge, fill, pressure, plane, center
):
    """Whatever the stress, the faces that an opening cuts, its pressure and its fill."""
    dimension = 2 if plane else 3
    shape = ball(np.array(center[:dimension]), 9.0)
    faces = ("x_lower", "x_upper", "y_lower", "y_upper", "z_upper")
    scene = make_scene(
        plane, stress={"constant": constant, "gradient": gradient}, particles_per_cell=per_edge, cut_cells=treatment,
        boundary=dict(zip(faces, conditions, strict=True)),
        excavations=[excavation(fill=fill) | {"pressure": [[0, pressure]] if pressure else []}],
    )  # fmt: skip
    grid = grid_around([shape], [5] * dimension, 2, 8.0)
    model = make_model(scene, grid, [shape])
    grid = model.grid
    there = np.zeros(len(grid.node_index), bool)
    there[model.cell_nodes[model.particles.cell[model.volumes(0) > 0.0]]] = True
    for node in np.flatnonzero(there & grid.is_hanging):
        parents = grid.node_parents[node]
        there[parents[parents >= 0]] = True
    assert not external_force(model, 0)[~there].any()


def test_rollers_hold_the_normal_component_only():
    scene = make_scene(boundary={"x_lower": "roller", "y_upper": "fixed", "z_lower": "traction"} | dict.fromkeys(
        ("x_upper", "y_lower", "z_upper"), "traction"))  # fmt: skip
    model = make_model(scene, grid_around([], [2, 2, 2], 1, 8.0))
    position = model.grid.node_position
    expected = np.zeros_like(model.held)
    expected[position[:, 0] == 0.0, 0] = True
    expected[position[:, 1] == 16.0] = True
    assert np.array_equal(model.held, expected)


@pytest.mark.parametrize(("plane", "dimension"), [("xy", 2), (None, 3)])
@pytest.mark.parametrize("at_the_faces", [False, True])
def test_traction_all_round_balances_and_the_body_stays_where_it_is(plane, dimension, at_the_faces):
    """Void in a weightless block with tractions on all faces, also notches that open into two faces: forces on
    nodes with rock add up to nothing, it converges, and no rigid motion is left (mass-weighted means)."""
    center = np.full(dimension, 20.0)

    def shape(x):
        along = np.abs(x - center)
        inside = (along[..., 1:] <= 4.0).all(axis=-1)
        return inside & ((along[..., 0] >= 14.0) if at_the_faces else (along[..., 0] <= 5.0))

    stress = uniform(-20e6, -10e6, -15e6, 0, 0, 0 if at_the_faces else 4e6)  # shear on notches would be a couple
    scene = make_scene(plane, stress=stress, boundary="traction", excavations=[excavation()])
    model = make_model(scene, grid_around([shape], [5] * dimension, 2, 8.0), [shape])
    scheme, history = solve(model, 1e-6)
    acting = scheme.body.mass > 0.0
    force = external_force(model, 0)
    assert not acting.all()
    np.testing.assert_allclose(force[acting].sum(axis=0), 0.0, atol=1e-12 * np.abs(force).sum())
    assert history.rows[-1][3] <= 1e-6
    mass, u = scheme.body.mass[:, None], scheme.body.state.displacement
    x = model.grid.node_position
    x = x - (mass * x).sum(axis=0) / mass.sum()
    size = np.sum(mass * np.abs(u))
    assert size > 0.0
    np.testing.assert_allclose((mass * u).sum(axis=0), 0.0, atol=1e-10 * size)
    spin = (mass[:, 0] * (x[:, 0] * u[:, 1] - x[:, 1] * u[:, 0])).sum()
    assert abs(spin) < 1e-10 * size * x.max()


def test_a_void_that_opens_into_one_traction_face_is_refused():
    """Its traction is gone, the one on the face across is not: nothing holds the block."""
    shape = box([0.0, 12.0], [6.0, 28.0])
    scene = make_scene("xy", stress=uniform(-20e6, -10e6), boundary="traction", excavations=[excavation()])
    model = make_model(scene, grid_around([shape], [5, 5], 2, 8.0), [shape])
    with pytest.raises(InputError, match="balance"):
        external_force(model, 0)


def load(center, force, name="press", since=0):
    shape = {"shape": "sphere", "center": center, "radius": 4.0}
    return {"name": name, "since": since, "force": force, "shape": shape}


def test_a_configured_load_adds_up_to_its_force():
    """Total equals the force, in 2-D per metre of thickness; not before its step; refused once its rock is gone."""
    shape = ball([20.0, 20.0], 8.0)
    grid = grid_around([shape], [5, 5], 2, 8.0)
    press = load([20.0, 20.0], [3e6, 7e6, -5e6], since=1)
    scene = make_scene("xz", loads=[press], thickness=2.0, steps=2)
    model = make_model(scene, grid)
    assert (external_force(model, 0) == 0.0).all()
    np.testing.assert_allclose(external_force(model, 1).sum(axis=0), [1.5e6, -2.5e6], rtol=1e-12)
    mined = make_scene("xz", loads=[press], steps=2, excavations=[excavation(mined=1)])
    with pytest.raises(InputError, match="mined"):
        external_force(make_model(mined, grid, [shape]), 1)


def test_loads_on_a_body_that_nothing_holds_must_balance():
    """Two opposite forces on one line are a test of strength; one alone, or a couple, is a launch."""
    grid = grid_around([], [6, 6], 1, 8.0)

    def force(*loads):
        return external_force(make_model(make_scene("xy", boundary="free", loads=loads), grid), 0)

    left, right = [12.0, 24.0], [36.0, 24.0]
    balanced = force(load(left, [1e6, 0, 0]), load(right, [-1e6, 0, 0], "hold"))
    assert np.abs(balanced).max() > 0.0
    for push, pull in (([1e6, 0, 0], [0.0, 0, 0]), ([0, 1e6, 0], [0, -1e6, 0])):
        with pytest.raises(InputError, match="balance"):
            force(load(left, push), load(right, pull, "hold"))


def directed(center, force, toward, name="press"):
    return load(center, force, name) | {"toward": toward}


@pytest.mark.parametrize(("plane", "dimension"), DIMENSIONS)
def test_a_directed_load_points_to_its_point_and_its_sizes_add_up(plane, dimension):
    """3 MN on two metres of thickness (2-D), particle by particle against the definition, and at the nodes in sum."""
    center, toward = [12.0] * dimension, [24.0] * dimension
    grid = grid_around([ball(center, 1.0)], [5] * dimension, 2, 8.0)
    scene = make_scene(plane, loads=[directed(center, 3e6, toward)], thickness=2.0)
    model = make_model(scene, grid)
    force = load_force(model, scene.loads[0], model.volumes(0))
    size = np.linalg.norm(force, axis=1)
    loaded = size > 0.0
    total = 1.5e6 if plane else 3e6
    assert 1 < loaded.sum() < model.particles.count
    assert size.sum() == pytest.approx(total, rel=1e-12)
    np.testing.assert_allclose(size[loaded], total * (model.volumes(0) / model.volumes(0)[loaded].sum())[loaded])
    way = np.array(toward) - model.particles.position[loaded]
    way /= np.linalg.norm(way, axis=1)[:, None]
    np.testing.assert_allclose(force[loaded], size[loaded, None] * way, rtol=1e-12, atol=1e-6)
    np.testing.assert_allclose(external_force(model, 0).sum(axis=0), force.sum(axis=0), rtol=0, atol=1e-12 * size.sum())


def test_a_load_directed_to_a_line_has_nothing_along_it():
    """A skew line in 3-D: forces are at right angles to it and no couple about it, and their sizes add up."""
    center, line = [12.0, 12.0, 12.0], np.array([[24.0, 20.0, 4.0], [26.0, 23.0, 10.0]])
    grid = grid_around([ball(center, 1.0)], [5, 5, 5], 2, 8.0)
    scene = make_scene(None, loads=[directed(center, 3e6, line.tolist())])
    model = make_model(scene, grid)
    force = load_force(model, scene.loads[0], model.volumes(0))
    axis = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    assert np.linalg.norm(force, axis=1).sum() == pytest.approx(3e6, rel=1e-12)
    np.testing.assert_allclose(force @ axis, 0.0, atol=1e-6)
    np.testing.assert_allclose(np.cross(model.particles.position - line[0], force) @ axis, 0.0, atol=1e-3)
    loaded = np.linalg.norm(force, axis=1) > 0.0
    assert (np.sum(force * (line[0] - model.particles.position), axis=1)[loaded] > 0.0).all()


def test_a_directed_load_on_its_own_point_is_refused():
    """The particle there has no direction."""
    scene = make_scene("xz", loads=[directed([12.0, 12.0], 1e6, [12.0, 12.0])])
    with pytest.raises(InputError, match=r"loads\.press\.toward"):
        external_force(make_model(scene, grid_around([], [3, 3], 1, 8.0)), 0)


def test_unit_stress_of_virgin_rock_needs_no_iteration():
    """A state whose forces balance within tolerance is left as it is."""
    model = make_model(make_scene("xz", stress=uniform(-1e6, -1e6, -1e6)), grid_around([], [3, 3], 1, 8.0))
    scheme = ExplicitScheme(model, model.virgin_state(), model.volumes(0))
    assert (scheme.body.internal_force() == 0.0).all()
