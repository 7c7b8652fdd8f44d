"""Flow of failed rock does not depend on the scheme's way to rest: kernels beside slow twins, and a single cell."""

import numpy as np
import pytest

from mechanics.scenes import COULOMB, grid_around, make_dataset, make_scene, uniform
from mpm_core.kernels.flow import dissipate, take_back_flow
from mpm_core.stages import elastic_stage, mining_step

CONSTANTS = np.array([[20e9, 10e9], [1e9, 2e9]])  # lambda, mu


def particles(count=7):
    """Random stress (Pa), strain, dissipated energy and material of so many particles, some of them flowing."""
    random = np.random.default_rng(4)
    some = np.array([1, 2, 5])
    return (
        some,
        1e6 * random.normal(size=(count, 6)),
        1e-4 * random.normal(size=(count, 6)),
        random.random(count),
        random.integers(0, 2, count).astype(np.int16),
        1e-4 * random.normal(size=(len(some), 6)),
        random.random(len(some)),
    )


def test_flow_is_taken_back_through_hooke_and_twice_is_once():
    """Stress rises by C : flow, strain and energy are those of the start; who does not flow is left alone."""
    some, stress, strain, energy, material, start, start_energy = particles()
    flow = strain[some] - start
    lame, shear = CONSTANTS[material[some]].T
    expected = stress.copy()
    expected[some] += 2 * shear[:, None] * flow
    expected[some, :3] += (lame * flow[:, :3].sum(axis=1))[:, None]
    strain_after, energy_after = strain.copy(), energy.copy()
    strain_after[some], energy_after[some] = start, start_energy
    for _ in range(2):
        take_back_flow(some, start, start_energy, material, CONSTANTS, stress, strain, energy)
        np.testing.assert_allclose(stress, expected, rtol=1e-14)
        np.testing.assert_array_equal(strain, strain_after)
        np.testing.assert_array_equal(energy, energy_after)


def test_flow_dissipates_mean_stress_times_strain():
    """Total stress, shear counted twice."""
    some, stress, strain, energy, _, start, start_energy = particles()
    insitu = np.full(stress.shape, -3e6)
    before = 2e6 * np.ones((len(some), 6))
    mean = insitu[some] + 0.5 * (before + stress[some])
    expected = energy.copy()
    expected[some] = start_energy + (mean * (strain[some] - start) * [1, 1, 1, 2, 2, 2]).sum(axis=1)
    dissipate(some, before, start, start_energy, insitu, stress, strain, energy)
    np.testing.assert_allclose(energy, expected, rtol=1e-13)


def specimen(tmp_path, damping, compressions):
    """One cell of Table 2 rock under 10 MPa all round, its top pressed down to such strains, one step each: states."""
    boundary = dict.fromkeys(("x_lower", "y_lower", "z_lower", "z_upper"), "roller")
    boundary |= {"x_upper": "traction", "y_upper": "traction"}
    more = np.diff([0.0, *compressions])
    state, states = None, []
    for last in range(len(more)):
        strains = [{"name": f"press_{i}", "since": i, "strain": [0, 0, -more[i], 0, 0, 0]} for i in range(last + 1)]
        scene = make_scene(
            boundary=boundary,
            host=COULOMB,
            stress=uniform(-10e6, -10e6, -10e6),
            strains=strains,
            steps=last + 1,
            solver={"damping": damping, "tolerance": 1e-8, "increments": 1},
        )
        grid = make_dataset(scene, grid_around([], [1, 1, 1], 1, 2.0))
        if state is None:
            state, _ = elastic_stage(scene, grid, tmp_path / "f.npz")
        state, facts = mining_step(scene, grid, state, tmp_path / "f.npz")
        states.append((state, facts))
    return states


@pytest.mark.parametrize("damping", [0.6, 0.7, 0.85])
def test_a_cell_that_fails_under_pressure_comes_to_rest_at_residual_strength(damping, tmp_path):
    """Axial stress 2 c sqrt(N) + 10 N MPa whatever the damping, and lateral flow N_psi / 2 of the axial; the work of
    the top less that against the sides is what is dissipated. 1e-6: the tolerance is 1e-8 of the reaction."""
    factor = [(1 + np.sin(np.radians(angle))) / (1 - np.sin(np.radians(angle))) for angle in (20.0, 10.0)]
    residual = 2e6 * np.sqrt(factor[0]) + 10e6 * factor[0]
    states = specimen(tmp_path, damping, [5e-4, 8e-4, 10e-4])
    assert states[0][1]["failed_particles"] == 1
    for state, _ in states:
        assert state.stress.values[0, 2] == pytest.approx(-residual, rel=1e-6)
        assert state.stress.values[0, :2] == pytest.approx([-10e6, -10e6], rel=1e-6)
    last, facts = states[-1]
    axial, lateral = last.later_strain.values[0, 2], last.later_strain.values[0, 0]
    assert axial == pytest.approx(-2e-4, rel=1e-5)
    assert lateral == pytest.approx(-0.5 * factor[1] * axial, rel=1e-5)
    work = (residual * 2e-4 - 2 * 10e6 * lateral) * 8.0
    assert facts["energy_dissipated"] == pytest.approx(work, rel=1e-5)
