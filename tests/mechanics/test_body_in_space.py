"""A body in empty space: the box around it is mined in history, nothing holds it, loads balance."""

import numpy as np
import pytest

from common.errors import InputError
from mechanics.scenes import COULOMB, HOST, make_scene
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.grid_stage import make_grid

RADIUS = 9.0
HARDLY_SOFTER = COULOMB | {  # the usual residual strength would bring the whole disc down under a load that stays
    "friction_angle": {"intact": 30.0, "residual": 30.0},
    "cohesion": {"intact": 2e6, "residual": 1.9e6},
    "tension_cutoff": {"intact": 1e6, "residual": 0.9e6},
}


def run(plane, tmp_path, *, boundary="free", host=HOST, force=1e6, steps=0, sides=("top", "bottom"), solver=None):
    """A disc (cylinder along y) of 9 m radius in a box of 24 m, pressed along z from both sides: last state, facts."""
    dimension = 2 if plane else 3
    if plane:
        shape = {"name": "space", "shape": "circle", "center": [12.0, 12.0], "radius": RADIUS, "outside": True}
        lower, upper = [10.0, 0.0], [14.0, 24.0]
        upper_half, lower_half = ([10.0, 18.0], upper), (lower, [14.0, 6.0])
        toward = [12.0, 12.0]
    else:
        shape = {"name": "space", "shape": "cylinder", "start": [12.0, 0.0, 12.0], "end": [12.0, 24.0, 12.0]}
        shape |= {"radius": RADIUS, "outside": True}
        upper_half, lower_half = ([10.0, 0.0, 18.0], [14.0, 24.0, 24.0]), ([10.0, 0.0, 0.0], [14.0, 24.0, 6.0])
        toward = [12.0, 12.0, 12.0]
    grid = make_grid(
        {
            "name": "test",
            "plane": plane,
            "thickness": 1.0,
            "domain": {"lower": [0.0] * dimension, "upper": [24.0] * dimension},
            "grid": {"coarse_cell": 4.0, "levels": 2, "buffer_cells": 1, "cut_cells": "mean", "volume_error": 0.2},
            "excavations": [shape],
            "rock_bodies": [],
        },
        {},
    )
    loads = [
        {"name": name, "since": 0, "force": force, "toward": toward,
         "shape": {"shape": "box", "lower": list(low), "upper": list(high)}}
        for name, (low, high) in (("top", upper_half), ("bottom", lower_half))
        if name in sides
    ]  # fmt: skip
    scene = make_scene(
        plane,
        host=host,
        boundary=boundary,
        excavations=[{"name": "space", "mined": 0, "fill": None, "filled": -1}],
        loads=loads,
        solver={"tolerance": 1e-6} | (solver or {}),
    )
    state, facts = elastic_stage(scene, grid, tmp_path / "failed.npz")
    for _ in range(steps):
        state, facts = mining_step(scene, grid, state, tmp_path / "failed.npz")
    return state, facts


@pytest.mark.parametrize("boundary", ["free", "traction", "fixed"])
def test_a_disc_under_load_comes_to_rest_where_it_is(boundary, tmp_path):
    """Whatever the faces of the box are: the disc touches none of them. It is symmetric, so it neither moves nor
    turns; pressed along z it shortens along z and widens along x."""
    state, facts = run("xz", tmp_path, boundary=boundary)
    volume, place, u = state.volume.values, state.position.values, state.displacement.values
    assert facts["unbalanced_ratio"] <= 1e-6
    assert np.isclose(volume.sum(), np.pi * RADIUS**2, rtol=1e-2)
    moved = np.abs(u).max()
    assert 0.0 < moved < 1e-2
    np.testing.assert_allclose((volume[:, None] * u).sum(axis=0) / volume.sum(), 0.0, atol=1e-3 * moved)
    x, z = place[:, 0] - 12.0, place[:, 2] - 12.0
    spin = (volume * (x * u[:, 2] - z * u[:, 0])).sum() / (volume * (x**2 + z**2)).sum()
    assert abs(spin) * RADIUS < 1e-3 * moved
    assert (volume * z * u[:, 2]).sum() < 0.0 < (volume * x * u[:, 0]).sum()
    assert (state.node_displacement.values[state.node_displacement.values[:, 1] != 0.0] == 0.0).all()
    # centre under a diametral load: tension across, compression along it, of three times the size (Hertz)
    centre = (np.hypot(x, z) < 1.5) & (volume > 0.0)
    across, along = state.stress.values[centre, 0].mean(), state.stress.values[centre, 2].mean()
    assert 0.0 < across < -along


def test_what_fails_in_a_disc_is_rest_again(tmp_path):
    """Coulomb rock under a load that breaks some of it: equilibrium, no drift."""
    state, facts = run("xz", tmp_path, host=HARDLY_SOFTER, force=36e6, steps=1)
    assert facts["failed_particles"] > 0
    assert facts["unbalanced_ratio"] <= 1e-6
    volume, u = state.volume.values, state.displacement.values
    moved = np.abs(u[volume > 0.0]).max()
    np.testing.assert_allclose((volume[:, None] * u).sum(axis=0) / volume.sum(), 0.0, atol=5e-2 * moved)


def test_a_collapse_is_an_error_or_its_last_rest(tmp_path):
    """The usual residual strength: the disc comes down. Kept, the result is a state of rest in which rock has failed
    and more stands above strength; what failed then is not in it, and no later step is computed."""
    error = {"max_iterations": 3000, "collapse": "error"}
    with pytest.raises(InputError, match=r"runs away|no convergence"):
        run("xz", tmp_path, host=COULOMB, force=36e6, steps=1, solver=error)
    keep = {"max_iterations": 3000, "weakest_first": 0.8, "collapse": "keep"}
    state, facts = run("xz", tmp_path, host=COULOMB, force=36e6, steps=1, solver=keep)
    assert facts["collapsed"] == 1
    assert facts["unbalanced_ratio"] <= 3e-3
    failed = state.failed.values >= 0
    assert failed.any()
    assert (state.strength_factor.values[~failed & (state.volume.values > 0.0)] < 1.0).any()
    assert (state.seismic_strain.values[~failed] == 0.0).all()
    generations = state.failure_order.values[failed, 1]
    assert generations.max() < state.convergence_generation.values.max()
    _, after = run("xz", tmp_path, host=COULOMB, force=36e6, steps=2, solver=keep)
    assert (after["computed"], after["failed_particles"]) == (0, 0)


def test_a_cascade_without_end_is_an_error_or_its_last_rest(tmp_path):
    """Two generations are asked for, more would follow: kept, the state is at rest with two of them."""
    few = {"max_generations": 2, "weakest_first": 0.8, "collapse": "error"}
    with pytest.raises(InputError, match="has not ended after 2 generations"):
        run("xz", tmp_path, host=HARDLY_SOFTER, force=36e6, steps=1, solver=few)
    keep = {**few, "collapse": "keep"}
    state, facts = run("xz", tmp_path, host=HARDLY_SOFTER, force=36e6, steps=1, solver=keep)
    assert facts["collapsed"] == 1
    assert facts["unbalanced_ratio"] <= 3e-3
    failed = state.failed.values >= 0
    assert set(state.failure_order.values[failed, 1]) == {0, 1}
    assert (state.strength_factor.values[~failed & (state.volume.values > 0.0)] < 1.0).any()


def test_a_cylinder_under_load_comes_to_rest(tmp_path):
    """3-D; its end faces lie in faces of the domain, which are free."""
    state, facts = run(None, tmp_path)
    assert facts["unbalanced_ratio"] <= 1e-6
    volume, u = state.volume.values, state.displacement.values
    assert np.isclose(volume.sum(), np.pi * RADIUS**2 * 24.0, rtol=1e-2)
    moved = np.abs(u).max()
    np.testing.assert_allclose((volume[:, None] * u).sum(axis=0) / volume.sum(), 0.0, atol=1e-3 * moved)
    assert 0.0 < moved < 1e-2


def test_a_load_on_one_side_is_refused_though_faces_are_fixed(tmp_path):
    """The box is fixed all round, but the disc touches no face of it."""
    with pytest.raises(InputError, match="balance"):
        run("xz", tmp_path, boundary="fixed", sides=("top",))
