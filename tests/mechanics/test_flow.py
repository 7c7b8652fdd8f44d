"""Flow of failed rock does not depend on the scheme's way to rest: kernels beside slow twins, and a single cell."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mechanics.scenes import COULOMB, grid_around, make_dataset, make_scene, uniform
from mpm_core.constitutive.coulomb_strength import strength_row
from mpm_core.constitutive.general import make_return_particles
from mpm_core.constitutive.laws import coulomb
from mpm_core.kernels.energy_sums import make_flow_energy
from mpm_core.kernels.stress_update import undo_flow
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step

CONSTANTS = np.array([[20e9, 10e9], [1e9, 2e9]])  # lambda, mu


def particles(count=7):
    """Random stress (Pa), strain and material of so many particles, some of them flowing; their strain at the start."""
    random = np.random.default_rng(4)
    some = np.array([1, 2, 5])
    return (
        some,
        1e6 * random.normal(size=(count, 6)),
        1e-4 * random.normal(size=(count, 6)),
        random.integers(0, 2, count).astype(np.int16),
        1e-4 * random.normal(size=(len(some), 6)),
    )


def test_flow_is_taken_back_through_hooke_and_twice_is_once():
    """Stress rises by C : flow, strain is that of the start; who does not flow is left alone."""
    some, stress, strain, material, start = particles()
    flow = strain[some] - start
    lame, shear = CONSTANTS[material[some]].T
    expected = stress.copy()
    expected[some] += 2 * shear[:, None] * flow
    expected[some, :3] += (lame * flow[:, :3].sum(axis=1))[:, None]
    strain_after = strain.copy()
    strain_after[some] = start
    for _ in range(2):
        undo_flow(some, start, material, CONSTANTS, stress, strain)
        np.testing.assert_allclose(stress, expected, rtol=1e-14)
        np.testing.assert_array_equal(strain, strain_after)


ROCK = np.array([30e9, 25e9])  # lambda, mu
ROW = strength_row(20.0, 10.0, 0.5e6, 0.1e6)
TWICE = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])


def flow_between(before, strain):
    """Stress after a strain (both (6,)) from a stress on or inside ROW's surface, and what has flowed."""
    after = before + 2 * ROCK[1] * strain
    after[:3] += ROCK[0] * strain[:3].sum()
    stress, flow = after[None].copy(), np.zeros((1, 6))
    one = np.zeros(1, np.int64)
    make_return_particles(coulomb)(stress, *ROCK[:, None], ROW[None], one, flow, np.zeros(1, np.int8))
    return stress[0], flow[0]


def dissipation_of(before, strain):
    """What the kernel says, J/m3, split half and half between virgin stress and change: it must not matter."""
    after, flow = flow_between(before, strain)
    tensors = [values[None] for values in (0.5 * before, np.zeros(6), 0.5 * before, after - 0.5 * before, flow)]
    energy, material = np.empty((1, 2)), np.zeros(1, np.int16)
    make_flow_energy(coulomb)(np.zeros(1, np.int64), *tensors, material, ROCK[None], ROW[None], energy)
    mean = float((0.5 * (before + after) * flow * TWICE).sum())
    assert energy[0, 1] == pytest.approx(energy[0, 0] - mean, rel=1e-9, abs=1e-6)
    return energy[0, 0]


@given(st.integers(0, 2**32 - 1))
@example(909)  # whose stress grows tenfold
@settings(max_examples=50, deadline=None)
def test_flow_dissipates_the_path_integral_of_its_stress(seed):
    """Beside 1,000 small returns on the same straight way, from a stress inside the surface or on it. 3 % of the flow
    times the larger stress at its ends: ways turn at edges of the surface within a part. Never negative."""
    random = np.random.default_rng(seed)
    before, _ = flow_between(-5e6 * np.array([1, 1, 1, 0, 0, 0]) + 2e6 * random.normal(size=6), np.zeros(6))
    strain = 4e-4 * random.normal(size=6)
    found = dissipation_of(before, strain)
    exact, stress, count = 0.0, before, 1000
    for _ in range(count):
        after, flow = flow_between(stress, strain / count)
        exact += float((0.5 * (stress + after) * flow * TWICE).sum())
        stress = after
    after, flow = flow_between(before, strain)
    largest = max((before**2 * TWICE).sum(), (after**2 * TWICE).sum())
    assert found >= 0.0
    assert abs(found - exact) <= 0.03 * np.sqrt(largest * (flow**2 * TWICE).sum())


def test_rock_that_unloads_and_opens_dissipates_nothing_of_its_pressure():
    """From 10 MPa all round it expands far: to the tip at 0.1 MPa, and opens there by 3 e - (10.1 MPa / K) in volume.
    The mean of both ends would make energy of it."""
    strain = 2e-3
    before = -10e6 * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    opening = 3 * strain - 10.1e6 / (ROCK[0] + 2 / 3 * ROCK[1])
    found = dissipation_of(before, strain * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    assert found == pytest.approx(0.1e6 * opening, rel=0.02)


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
