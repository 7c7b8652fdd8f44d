"""A strained boundary: exact in homogeneous rock, whatever the grid; accumulating, restarting, failing as by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.datasets import read_dataset, write_dataset
from common.errors import InputError
from mechanics.scenes import (
    COULOMB,
    HOST,
    ball,
    excavation,
    grid_around,
    host_everywhere,
    make_dataset,
    make_scene,
    random_grid,
    uniform,
)
from mpm_core.equilibrium import cascade
from mpm_core.equilibrium.increments import Increments
from mpm_core.files.state_datasets import grid_dataset
from mpm_core.grid.edge_nodes import EdgeNodes
from mpm_core.grid.edge_points import EdgePoints
from mpm_core.model.occupancy import FinestPieces
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step

IN_PLANE = {"xz": [0, 2, 4], "xy": [0, 1, 5], None: range(6)}
ROLLERS = dict.fromkeys(("x_lower", "x_upper", "y_lower", "y_upper", "z_lower", "z_upper"), "roller")


def strain_entry(components, since=0, name="press"):
    return {"name": name, "since": since, "strain": list(components)}


def tensor(voigt):
    xx, yy, zz, yz, xz, xy = voigt
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def hooke(strain, host=HOST):
    """Stress tensor (3, 3) of a strain tensor (3, 3), Pa."""
    shear = host["youngs_modulus"] / (2 * (1 + host["poisson_ratio"]))
    lame = 2 * shear * host["poisson_ratio"] / (1 - 2 * host["poisson_ratio"])
    return lame * np.trace(strain) * np.eye(3) + 2 * shear * strain


def voigt_of(tensor):
    return tensor[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]


@settings(max_examples=12, deadline=None)
@given(st.sampled_from(["xz", "xy", None]), st.integers(0, 10_000), st.sampled_from([1, 2]))
def test_fixed_faces_strain_a_grid_with_hanging_nodes_linearly(plane, seed, per_edge):
    """Patch test by the stages: elastic state and step are the linear field and its stress to 1e-12, at once."""
    random = np.random.default_rng(seed)
    grid = random_grid(random, 2 if plane else 3)
    assert grid.is_hanging.any()
    components = np.zeros(6)
    components[IN_PLANE[plane]] = random.normal(size=len(IN_PLANE[plane])) * 1e-4
    scene = make_scene(plane, strains=[strain_entry(components)], particles_per_cell=per_edge)
    dataset = grid_dataset(
        grid,
        host_everywhere(grid),
        FinestPieces.all_of([], grid.dimension),
        np.empty(0),
        EdgeNodes.none(grid.dimension),
        EdgePoints.none(grid.dimension),
        plane,
        {"mine": "test"},
    )
    state, facts = elastic_stage(scene, dataset, Path("unused.npz"))
    for _ in range(2):
        expected = dataset.node_position.values @ tensor(components)
        size = np.abs(expected).max()
        np.testing.assert_allclose(state.node_displacement, expected, rtol=0, atol=1e-12 * size)
        stress = voigt_of(hooke(tensor(components)))
        np.testing.assert_allclose(
            state.stress, np.tile(stress, (state.sizes["particle"], 1)), rtol=0, atol=1e-12 * np.abs(stress).max()
        )
        assert facts["iterations"] == 0
        assert facts["unbalanced_ratio"] < 1e-12
        state, facts = mining_step(scene, dataset, state, Path("unused.npz"))


def test_a_specimen_between_rollers_bulges_as_poisson_says(tmp_path):
    """2 m cells, hanging nodes, top and bottom rollers, sides free (x) and roller (y): uniaxial in the xz section is
    plane strain, in 3-D with free y it is uniaxial stress. Tolerance 1e-9; stress and bulge to 1e-7."""
    compression = -1e-4
    for plane, faces in (("xz", {}), (None, dict.fromkeys(("y_lower", "y_upper"), "free"))):
        boundary = ROLLERS | dict.fromkeys(("x_lower", "x_upper"), "free") | faces
        if plane is None:
            boundary |= {"x_lower": "roller", "y_lower": "roller"}  # else it may slide
        else:
            boundary |= {"x_lower": "roller"}
        scene = make_scene(
            plane,
            boundary=boundary,
            strains=[strain_entry([0, 0, compression, 0, 0, 0])],
            solver={"tolerance": 1e-10},
        )
        d = 2 if plane else 3
        dataset = make_dataset(scene, grid_around([ball([5.0] * d, 2.0)], [3] * d, 2, 4.0))
        state, facts = elastic_stage(scene, dataset, tmp_path / "failed.npz")
        assert facts["unbalanced_ratio"] <= 1e-10
        modulus, ratio = HOST["youngs_modulus"], HOST["poisson_ratio"]
        if plane:
            modulus, ratio = modulus / (1 - ratio**2), ratio / (1 - ratio)
        np.testing.assert_allclose(state.stress.values[:, 2], modulus * compression, rtol=1e-7)
        assert np.abs(state.stress.values[:, 0]).max() < 1e-7 * modulus * abs(compression)
        bulge = state.node_displacement.values[:, 0]
        np.testing.assert_allclose(
            bulge, -ratio * compression * dataset.node_position.values[:, 0], rtol=0, atol=1e-7 * abs(compression) * 12
        )


def test_strains_add_up_over_steps_and_restart_from_files(tmp_path):
    """Half of it in history and half in a step, around a void, is all of it in one step (elastic, 1e-5 of the largest
    stress: the tolerance is 1e-8); a step from files has the bits of a step from memory."""
    whole, half = np.array([-2e-4, 0, -1e-4, 0, 5e-5, 0]), np.array([-1e-4, 0, -0.5e-4, 0, 2.5e-5, 0])
    shape = ball([18.0, 20.0], 4.3)
    options = {"excavations": [excavation()], "solver": {"tolerance": 1e-8}, "stress": uniform(-5e6, -5e6, -5e6)}
    once = make_scene("xz", strains=[strain_entry(whole)], **options)
    grid = make_dataset(once, grid_around([shape], [5, 5], 2, 8.0), [shape])
    expected, _ = elastic_stage(once, grid, tmp_path / "f.npz")
    early = make_scene("xz", strains=[strain_entry(half)], **options)
    late = make_scene("xz", strains=[strain_entry(half), strain_entry(half, 1, "more")], steps=2, **options)
    elastic, _ = elastic_stage(early, grid, tmp_path / "f.npz")
    history, facts = mining_step(early, grid, elastic, tmp_path / "f.npz")
    assert facts["iterations"] == 0  # the elastic state has it already
    state, facts = mining_step(late, grid, history, tmp_path / "f.npz")
    assert facts["iterations"] > 0
    size = np.abs(expected.stress.values).max()
    np.testing.assert_allclose(state.stress, expected.stress, rtol=0, atol=1e-5 * size)
    held = np.zeros(grid.sizes["node"], bool)
    for axis in (0, 2):
        place = grid.node_position.values[:, axis]
        held |= (place == 0.0) | (place == 40.0)
    moved = grid.node_position.values @ tensor(whole)
    np.testing.assert_allclose(state.node_displacement.values[held], moved[held], rtol=0, atol=1e-15)
    write_dataset(history, tmp_path / "history.nc")
    again, _ = mining_step(late, grid, read_dataset(tmp_path / "history.nc"), tmp_path / "f.npz")
    for name in state.variables:
        assert np.array_equal(state[name], again[name]), name


def test_coulomb_rock_fails_in_the_increment_that_overloads_it(tmp_path):
    """One cell of Table 2 rock between rollers with free sides: at 4 increments of 1/4 of 1.6 times the peak strain it
    fails in the third, and its stress stays at the residual strength 2 c cos(phi) / (1 - sin(phi)) = 2.856 MPa."""
    boundary = ROLLERS | dict.fromkeys(("x_upper", "y_upper"), "free")
    peak = 2 * 2e6 * np.tan(np.pi / 4 + np.pi / 12)
    strain = -1.6 * peak / COULOMB["youngs_modulus"]
    scene = make_scene(
        boundary=boundary, host=COULOMB, strains=[strain_entry([0, 0, strain, 0, 0, 0], since=1)], steps=2
    )
    grid = make_dataset(scene, grid_around([], [1, 1, 1], 1, 2.0))
    first = make_scene(boundary=boundary, host=COULOMB)
    state, _ = elastic_stage(first, grid, tmp_path / "f.npz")
    state, facts = mining_step(first, grid, state, tmp_path / "f.npz")
    assert facts["failed_particles"] == 0
    state, facts = mining_step(scene, grid, state, tmp_path / "f.npz")
    assert facts["failed_particles"] == 1
    assert state.failure_order.values.tolist() == [[3, 0]]
    residual = 2 * 1e6 * np.cos(np.radians(20)) / (1 - np.sin(np.radians(20)))
    assert state.stress.values[0, 2] == pytest.approx(-residual, rel=1e-4)


@pytest.mark.parametrize(
    ("boundary", "components", "message"),
    [
        ("free", [1e-4, 0, 0, 0, 0, 0], "moves no face"),
        (dict.fromkeys(ROLLERS, "free") | {"x_lower": "roller"}, [1e-4, 0, 0, 0, 0, 0], "moves no face"),
        (dict.fromkeys(ROLLERS, "free") | {"x_upper": "roller"}, [0, 1e-4, 0, 0, 0, 0], "moves no face"),
    ],
)
def test_a_strain_that_moves_no_held_face_is_refused(boundary, components, message):
    """No face is held, or only one across which nothing moves."""
    with pytest.raises(InputError, match=rf"strains\.press: .*{message}"):
        make_scene(boundary=boundary, strains=[strain_entry(components)])


def test_a_strain_with_particles_that_move_is_refused():
    with pytest.raises(InputError, match=r"strains\.press: .*solver\.move"):
        make_scene(strains=[strain_entry([1e-4, 0, 0, 0, 0, 0])], solver={"move": True}, particles_per_cell=2)


def test_increments_that_are_tried_move_the_start_of_motion_once(tmp_path, monkeypatch):
    """It counts what the rock moves beside its boundary; each try that was undone was counted, too."""
    components = [0.0, 0.0, -1e-4, 0.0, 0.0, 0.0]
    scene = make_scene(
        "xz", host=COULOMB, stress=uniform(-2e6, -2e6, -2e6), strains=[strain_entry(components, since=1)], steps=2,
        solver={"increments": 0},
    )  # fmt: skip
    shape = ball([20.0, 20.0], 4.0)
    grid = make_dataset(scene, grid_around([shape], [5, 5], 2, 8.0), [])
    first = replace(scene, steps=scene.steps[:1])
    state, _ = elastic_stage(first, grid, tmp_path / "f.npz")
    state, _ = mining_step(first, grid, state, tmp_path / "f.npz")
    tries, moved, begin = [], [], cascade.begin_increment

    def note(scheme, brittle, ramp, increments, tolerance, history):
        body = scheme.body
        start, rest = body.start, body.rest
        begin(scheme, brittle, ramp, increments, tolerance, history)
        assert body is scheme.body
        expected = (body.model.node_position - body.model.grid.origin) @ tensor(components)[::2, ::2]
        expected = expected * (history.load - history.load_before)
        for now, before in ((body.start, start), (body.rest, rest)):
            moved.append(np.abs(now - before - expected).max() / np.abs(expected).max())

    def accept(self, body, brittle, history):
        tries.append(history.load)
        return self._resize(0.5, len(tries) > 2, history)

    monkeypatch.setattr(cascade, "begin_increment", note)
    monkeypatch.setattr(Increments, "accept", accept)
    mining_step(scene, grid, state, tmp_path / "f.npz")
    assert len(tries) > 2
    assert max(moved) < 1e-9
