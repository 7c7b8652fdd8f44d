"""The hand calculation of a pressed or pulled cell against independent limits, and the study itself."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from running import run_study

from verification.answers.one_particle import answer
from verification.answers.one_particle.closed_form import Axial, Specimen, Surface

TABLE_2 = {
    "youngs_modulus": 57e9,
    "poisson_ratio": 0.25,
    "friction_angle": {"intact": 30.0, "residual": 20.0},
    "dilation_angle": {"intact": 10.0, "residual": 10.0},
    "cohesion": {"intact": 2e6, "residual": 1e6},
    "tension_cutoff": {"intact": 1e6, "residual": 0.2e6},
}
ROCKS = st.builds(
    lambda modulus, ratio, phi, drop, psi, cohesion, kept: {
        "youngs_modulus": modulus,
        "poisson_ratio": ratio,
        "friction_angle": {"intact": phi, "residual": phi - drop},
        "dilation_angle": {"intact": psi, "residual": 0.5 * psi},
        "cohesion": {"intact": cohesion, "residual": kept * cohesion},
        "tension_cutoff": {"intact": 0.3 * cohesion, "residual": 0.1 * cohesion},
    },
    st.floats(1e9, 1e11),
    st.floats(0.0, 0.45),
    st.floats(20.0, 50.0),
    st.floats(0.0, 15.0),
    st.floats(0.0, 20.0),
    st.floats(1e5, 1e7),
    st.floats(0.1, 0.9),
)


def test_strengths_are_those_of_mohr():
    """2 c cos(phi) / (1 - sin(phi)) of Table 2: 6.928 and 2.856 MPa; N of 30 degrees is 3, so 10 MPa add 30."""
    intact, residual = (Surface.of(TABLE_2, state) for state in ("intact", "residual"))
    assert intact.unconfined == pytest.approx(6.9282e6, rel=1e-5)
    assert residual.unconfined == pytest.approx(2.8563e6, rel=1e-5)
    assert intact.compression(10e6) == pytest.approx(36.9282e6, rel=1e-5)


def tensors(stress: Axial) -> np.ndarray:
    return np.array([stress.lateral, stress.lateral, stress.axial])


@settings(max_examples=60, deadline=None)
@given(ROCKS, st.floats(0.0, 2e7), st.floats(1e-4, 0.5), st.booleans())
def test_each_drop_ends_on_its_surface_along_the_flow_of_active_faces(rock, pressure, beyond, pulled):
    """Written out with three principal values and 3 x 3 stiffness: strain is the compliance of the drop, stress is on
    the surface, and strain is a sum of face flows with positive shares, equal for the two faces by symmetry."""
    specimen = Specimen.of(rock, 0.0 if pulled else pressure)
    now = (1 + beyond) * specimen.peak_strain(pulled)
    point = specimen.walk([now])[0]
    lame, shear = specimen.lame
    stiffness = lame * np.ones((3, 3)) + 2 * shear * np.eye(3)
    trial = tensors(Axial(-specimen.pressure, -specimen.pressure + rock["youngs_modulus"] * now))
    for before, after, strain, surface in (
        (trial, tensors(point.peak), tensors(point.overshoot), specimen.intact),
        (tensors(point.peak), tensors(point.dropped), tensors(point.seismic), specimen.residual),
    ):
        size = np.abs(before).max() + surface.unconfined
        np.testing.assert_allclose(stiffness @ strain, before - after, rtol=0, atol=1e-9 * size)
        s1, _, s3 = np.sort(after)[::-1]
        if pulled:
            faces = np.array([[0.0, 0.0, 1.0]])
            assert s1 == pytest.approx(surface.tensile, abs=1e-9 * size)
        else:
            n = surface.dilation
            faces = np.array([[n, 0.0, -1.0], [0.0, n, -1.0]])
            assert surface.friction * s1 - s3 == pytest.approx(surface.unconfined, abs=1e-9 * size)
        share, *_ = np.linalg.lstsq(faces.T, strain, rcond=None)
        assert (share > 0).all()
        assert np.ptp(share) <= 1e-9 * share.max()
        np.testing.assert_allclose(faces.T @ share, strain, rtol=0, atol=1e-9 * np.abs(strain).max())


@pytest.mark.parametrize(("pressure", "strain"), [(0.0, -1.3e-4), (10e6, -4.8e-4), (0.0, 1.8e-5)])
def test_the_way_to_rest_is_what_small_steps_of_it_add_up_to(pressure, strain):
    """Lateral strain let out in 20,000 steps, each an elastic trial and a return to the residual surface: stress, flow
    and energy. 1e-3: steps of first order."""
    specimen = Specimen.of(TABLE_2, pressure)
    point = specimen.walk([strain])[0]
    pulled = strain > 0
    lame, shear = specimen.lame
    stress, flow, energy = point.dropped, Axial(0.0, 0.0), 0.0
    total = point.strain.lateral + specimen.poisson_ratio * strain  # all that the sides still move
    steps = 20_000
    for _ in range(steps):
        out = total / steps
        trial = stress + Axial(2 * (lame + shear) * out, 2 * lame * out)
        after, plastic = specimen.project(trial, specimen.residual, pulled)
        energy += (stress + after).times(0.5).work(plastic)
        stress, flow = after, flow + plastic
    assert stress.axial == pytest.approx(point.stress.axial, rel=1e-3)
    assert stress.lateral == pytest.approx(-pressure, abs=1e-3 * abs(point.dropped.lateral))
    assert flow.axial == pytest.approx(point.later.axial, rel=1e-3)
    assert flow.lateral == pytest.approx(point.later.lateral, rel=1e-3, abs=1e-12)
    start = Axial(-pressure, -pressure + 57e9 * strain)
    drop = (start + point.dropped).times(0.5).work(point.overshoot + point.seismic)
    assert drop + energy == pytest.approx(point.energy, rel=1e-3)


def test_residual_flow_dilates_by_its_angle_and_costs_its_work():
    """Volume over axial strain is -2 sin(psi) / (1 - sin(psi)); energy is stress times plastic strain."""
    specimen = Specimen.of(TABLE_2, 10e6)
    *_, last = specimen.walk([-4e-4, -5e-4, -7e-4])
    sine = np.sin(np.radians(10.0))
    assert last.later.volumetric / last.later.axial == pytest.approx(-2 * sine / (1 - sine))
    work = specimen.residual.compression(10e6) * 2e-4 - 2 * 10e6 * last.later.lateral
    assert last.energy == pytest.approx(work)


def test_the_cell_does_what_the_hand_calculation_says(tmp_path):
    """The whole study: four paths of one cell through four steps each."""
    rows, figure = answer(run_study("one_particle", tmp_path))
    assert len(rows) == 68
    assert [row.quantity for row in rows if not row.passed] == []
    assert len(figure.axes) == 8


def test_a_cell_of_another_strength_is_told_apart(tmp_path):
    """Rows fail if the rock that was computed is not the rock that is compared with."""
    results = run_study("one_particle", tmp_path, ["confined"])
    for name in results["confined"].step_names:
        results["confined"].step(name)
    results["confined"].values["materials"]["host"]["friction_angle"]["residual"] = 20.01
    rows, _ = answer(results)
    failing = [row.quantity for row in rows if not row.passed]
    assert any("residual flow, MPa" in quantity for quantity in failing)
    assert any("seismic strain" in quantity for quantity in failing)
    assert not any("Young" in quantity for quantity in failing)
