"""Kirsch's hole: the closed forms by what makes them right, and the study at 2 and 1 m."""

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from running import run_study

from verification.answers.kirsch import answer, displacement_rows, ring, stress_rows
from verification.answers.kirsch.closed_form import BoxedPlate, InfinitePlate
from verification.answers.kirsch.fields import Rock, extrapolated, interpolated, measure, order
from verification.results import Results, Variant

RADIUS, SHEAR, POISSON = 10.0, 2.8e9, 0.2103448275862069
ALL_ROUND = (-30e6, -30e6, 0.0)
SKEW = (-30e6, -15e6, 6e6)
AROUND = np.exp(2j * np.pi * np.arange(24) / 24)
BOXES = [(stress, boundary) for stress in (ALL_ROUND, SKEW) for boundary in ("fixed", "traction")]


@lru_cache
def plate(stress, boundary=None, half_width=100.0):
    """The plate of the paper; a box if a boundary is named."""
    if boundary is None:
        return InfinitePlate(RADIUS, stress, SHEAR, POISSON)
    return BoxedPlate(RADIUS, stress, SHEAR, POISSON, half_width, boundary)


def tensor(field):
    return np.moveaxis(np.array([[field.xx, field.xy], [field.xy, field.yy]]), -1, 0)


def differences(field_at, points, step=1e-3):
    """Central differences of stress and displacement: d/dx, d/dy of (point, 2, 2) and of (point, 2)."""
    result = []
    for shift in (step, 1j * step):
        high, low = field_at(points + shift), field_at(points - shift)
        moved = np.stack([high.ux - low.ux, high.uy - low.uy], axis=1)
        result.append(((tensor(high) - tensor(low)) / (2 * step), moved / (2 * step)))
    return result


def require_elastic_equilibrium(rock, stress):
    """div sigma = 0, and the change of stress is Hooke's of the displacement's gradient, in plane strain."""
    points = np.concatenate([11.0 * AROUND, 17.0 * AROUND + 1.0, 60.0 * AROUND - 2.0j])
    (stress_x, moved_x), (stress_y, moved_y) = differences(rock.at, points)
    divergence = stress_x[:, 0] + stress_y[:, 1]
    np.testing.assert_allclose(divergence * RADIUS, 0.0, atol=1e-6 * 30e6)
    gradient = np.stack([moved_x, moved_y], axis=2)
    strain = 0.5 * (gradient + gradient.transpose(0, 2, 1))
    trace = strain[:, 0, 0] + strain[:, 1, 1]
    lame = 2 * SHEAR * POISSON / (1 - 2 * POISSON)
    change = 2 * SHEAR * strain + lame * trace[:, None, None] * np.eye(2)
    virgin = np.array([[stress[0], stress[2]], [stress[2], stress[1]]])
    np.testing.assert_allclose(tensor(rock.at(points)) - virgin, change, atol=1e-6 * 30e6)


@pytest.mark.parametrize("stress", [ALL_ROUND, SKEW])
def test_kirsch_is_elastic_and_leaves_the_wall_free(stress):
    """Equilibrium, Hooke's law, no traction on the wall, the virgin stress and no displacement far away."""
    rock = plate(stress)
    require_elastic_equilibrium(rock, stress)
    radial, _, shear = rock.at(RADIUS * AROUND).polar_stress(np.angle(AROUND))
    np.testing.assert_allclose([radial, shear], 0.0, atol=1e-6)
    far = rock.at(1e6 * AROUND)
    np.testing.assert_allclose(far.xx, stress[0], rtol=1e-8)
    np.testing.assert_allclose(far.xy, stress[2], atol=1.0)
    assert np.hypot(far.ux, far.uy).max() < 1e-6


def test_kirsch_has_the_textbook_wall():
    """Hoop stress 3 sx - sy and 3 sy - sx on the axes; all round, the wall closes by p a / (2 G)."""
    hoop = plate((-30e6, -15e6, 0.0)).at(np.array([10.0, 10.0j])).polar_stress(np.array([0.0, np.pi / 2]))[1]
    np.testing.assert_allclose(hoop, [3 * -15e6 + 30e6, 3 * -30e6 + 15e6])
    outward, around = plate(ALL_ROUND).at(RADIUS * AROUND).polar_displacement(np.angle(AROUND))
    np.testing.assert_allclose(outward, -30e6 * RADIUS / (2 * SHEAR))
    np.testing.assert_allclose(around, 0.0, atol=1e-15)


@given(st.tuples(*[st.floats(-60e6, 60e6)] * 3), st.floats(0.0, 2 * np.pi), st.floats(10.0, 90.0))
def test_turning_the_stress_turns_the_field(stress, turn, distance):
    """Kirsch has no preferred axis: with the virgin stress turned, the whole field turns."""
    mean, half = 0.5 * (stress[0] + stress[1]), 0.5 * (stress[0] - stress[1]) + 1j * stress[2]
    half *= np.exp(2j * turn)
    turned = plate((mean + half.real, mean - half.real, half.imag))
    point = np.array([distance * np.exp(0.3j)])
    before, after = plate(stress).at(point), turned.at(point * np.exp(1j * turn))
    angle = np.angle(point)
    np.testing.assert_allclose(after.polar_stress(angle + turn), before.polar_stress(angle), atol=1e-6 * 60e6)
    np.testing.assert_allclose(
        after.polar_displacement(angle + turn), before.polar_displacement(angle), atol=1e-6 * 60e6 * RADIUS / SHEAR
    )


@pytest.mark.parametrize(("stress", "boundary"), BOXES)
def test_box_is_elastic_and_meets_its_boundary(stress, boundary):
    """Equilibrium, Hooke, a free wall; faces that do not move, or carry their virgin traction (but near corners)."""
    rock = plate(stress, boundary)
    assert rock.residual < {"fixed": 1e-5, "traction": 2e-7}[boundary]
    require_elastic_equilibrium(rock, stress)
    radial, _, shear = rock.at(RADIUS * AROUND).polar_stress(np.angle(AROUND))
    np.testing.assert_allclose([radial, shear], 0.0, atol=1e-6)
    place = np.linspace(-95.0, 95.0, 39)
    right, top = rock.at(100.0 + 1j * place), rock.at(place + 100.0j)
    if boundary == "fixed":
        largest = 30e6 * RADIUS / SHEAR
        np.testing.assert_allclose([right.ux, right.uy, top.ux, top.uy], 0.0, atol=1e-5 * largest)
    else:
        np.testing.assert_allclose([right.xx - stress[0], right.xy - stress[2]], 0.0, atol=1e-5 * 30e6)
        np.testing.assert_allclose([top.yy - stress[1], top.xy - stress[2]], 0.0, atol=1e-5 * 30e6)


@pytest.mark.parametrize(
    ("boundary", "expected"), [("traction", (60.54, 37.83, 22.71)), ("fixed", (59.15, 36.98, 22.17))]
)
def test_box_of_200_m_changes_the_stress_as_an_independent_solution_says(boundary, expected):
    """Hoop stress at the wall, hoop and radial stress at 2 a (MPa) of a 200 m box, found before by another method."""
    wall, twice = plate(ALL_ROUND, boundary).at(np.array([10.0, 20.0])).polar_stress(np.zeros(2))[1]
    radial = plate(ALL_ROUND, boundary).at(np.array([20.0])).xx[0]
    np.testing.assert_allclose(-np.array([wall, twice, radial]) / 1e6, expected, atol=0.011)


@pytest.mark.parametrize(("stress", "boundary"), BOXES)
def test_wide_box_is_an_infinite_plate(stress, boundary):
    """What a box adds falls with the square of its size: 4 times less for twice the width."""
    points = np.concatenate([RADIUS * AROUND, 30.0 * AROUND])
    exact = tensor(plate(stress).at(points))
    added = [np.abs(tensor(plate(stress, boundary, width).at(points)) - exact).max() for width in (400.0, 800.0)]
    assert added[1] < 2e-3 * 30e6
    np.testing.assert_allclose(added[0] / added[1], 4.0, rtol=0.05)


@pytest.mark.parametrize(("stress", "boundary"), BOXES)
def test_more_terms_change_nothing_near_the_hole(stress, boundary):
    """The series has converged to 1e-8 of the far stress within 4 radii; what is left sits in the corners."""
    points = np.concatenate([RADIUS * AROUND, 40.0 * AROUND])
    more = BoxedPlate(RADIUS, stress, SHEAR, POISSON, 100.0, boundary, terms=80).at(points)
    field = plate(stress, boundary).at(points)
    np.testing.assert_allclose(tensor(field), tensor(more), atol=1e-8 * 30e6)
    np.testing.assert_allclose(field.ux, more.ux, atol=1e-8 * 30e6 * RADIUS / SHEAR)


COARSE = {
    "regular": {"grid": {"coarse_cell": "1 m", "levels": 1}},
    "multilevel": {"grid": {"coarse_cell": "8 m", "levels": 4, "buffer_cells": 6}},
    "biaxial": {
        "grid": {"coarse_cell": "8 m", "levels": 4, "buffer_cells": 6},
        "insitu_stress": {"constant": {"yy": "-15 MPa"}},
    },
}
PRESSED = COARSE["biaxial"] | {
    "excavations": [
        {"name": "hole", "step": "history", "shape": "circle", "center": ["100 m", "100 m"], "radius": "10 m",
         "fill": "none", "pressure": "20 MPa"}
    ]
}  # fmt: skip
SERIES = ["mean_200cm", "mean_100cm", "subdivide_200cm", "subdivide_100cm"]


@pytest.fixture(scope="module")
def coarse(tmp_path_factory) -> Results:
    """The study at h = 1 m, with the coarse half of two series, in a box of 120 m: it adds 3 % to the stress."""
    folder = tmp_path_factory.mktemp("kirsch")
    box = {"domain.lower": ["40 m", "40 m"], "domain.upper": ["160 m", "160 m"]}
    results = run_study("kirsch", folder, COARSE, **box)
    results.variants |= run_study("kirsch", folder, SERIES, **box).variants
    return results


def with_exact_field(variant: Variant) -> Variant:
    """The same variant, its computed stress and displacement replaced by the exact ones."""
    rock = Rock(variant)
    center = rock.hole.center

    def exact(positions):
        place = positions[:, :2] @ np.array([1.0, 1.0j]) - center
        near = np.abs(place) > 0.5 * rock.hole.radius  # the series goes on into the hole; its middle plays no part
        return near, rock.hole.plate.at(np.where(near, place, rock.hole.radius))

    def embedded(values, near, field):
        moved = np.stack([field.ux, field.uy, np.zeros_like(field.ux)], axis=1)
        return values.copy(data=np.where(near[:, None], moved, 0.0))

    state = variant.elastic.copy()
    near, field = exact(state.position.values)
    stress = np.zeros(state.stress.shape)
    stress[:, 0], stress[:, 1], stress[:, 5] = field.xx, field.yy, field.xy
    state["stress"] = state.stress.copy(data=stress)
    state["displacement"] = embedded(state.displacement, near, field)
    near, field = exact(variant.grid.node_position.values)
    state["node_displacement"] = embedded(state.node_displacement, near, field)
    return Variant(variant.mine, {"grid.nc": variant.grid, "elastic.nc": state}.__getitem__)


def test_the_exact_field_has_no_error(coarse):
    """What the answer measures is zero for the exact field, but for reading it between the points of a 1 m grid."""
    rock = Rock(with_exact_field(coarse["biaxial"]))
    for row in stress_rows("exact", rock, 1e-12):
        assert row.passed, row
    *closure, _, around = displacement_rows("exact", rock, 0.01, 1e-12)
    assert all(row.passed for row in closure), closure
    assert around.passed
    points = rock.hole.radius * AROUND
    wall, exact = extrapolated(rock, points), rock.hole.plate.at(points).polar_stress(np.angle(AROUND))
    np.testing.assert_allclose(wall, exact, atol=0.35 * 30e6)  # 2 cells off, a/h = 10, hoop stress to 75 MPa
    exact = rock.hole.plate.at(2 * points).polar_stress(np.angle(AROUND))
    np.testing.assert_allclose(interpolated(rock, 2 * points), exact, atol=0.005 * 30e6)


def test_a_hole_with_pressure_inside(tmp_path):
    """30 and 15 MPa, 20 MPa inside, at 1 m: stress and displacement as good as without; by theory the wall bears it."""
    box = {"domain.lower": ["40 m", "40 m"], "domain.upper": ["160 m", "160 m"]}
    results = run_study("kirsch", tmp_path, {"multilevel": PRESSED}, **box)
    rock = Rock(results["multilevel"])
    radial, _, shear = rock.hole.plate.at(rock.hole.radius * AROUND).polar_stress(np.angle(AROUND))
    np.testing.assert_allclose(radial, -20e6, rtol=1e-9)
    np.testing.assert_allclose(shear, 0.0, atol=1e-3)
    assert rock.stress_error(*ring(rock)).max() < 0.008
    largest = np.abs(rock.hole.plate.at(rock.hole.radius * AROUND).moved).max()
    assert rock.displacement_error(*ring(rock)) < 0.02 * largest


def test_a_wrong_field_has_the_error_it_was_given(coarse):
    """A tenth of the far stress added to xx and yy, and 1 mm to all displacements, are found as such."""
    variant = with_exact_field(coarse["multilevel"])
    variant.elastic["stress"] = variant.elastic.stress + np.array([3e6, 3e6, 0.0, 0.0, 0.0, 0.0])
    variant.elastic["displacement"] = variant.elastic.displacement + np.array([1e-3, 0.0, 0.0])
    rock = Rock(variant)
    np.testing.assert_allclose(rock.stress_error(*ring(rock)), [0.1, 0.1, 0.0], atol=1e-12)
    np.testing.assert_allclose(rock.displacement_error(*ring(rock)), 1e-3)


def test_reduced_study(coarse):
    """At 1 m all rows hold but three: the price of so small a grid, extrapolation to the wall (good from a/h = 20 on),
    and the closure of the biaxial case along y, a seventh of that along x: 3 % of itself.

    Stress within 0.8 % (0.4 at 0.5 m); closure and stress converge with an order above 1.
    """
    rows, figure = answer(coarse)
    assert figure.axes
    failing = {row.quantity: row for row in rows if row.passed is False}
    small = "biaxial: closure of the hole along y, mm"
    if small in failing:
        assert failing.pop(small).error < 0.03
    assert all("over regular: cells" in name or "extrapolated over" in name for name in failing), failing
    for name in ("multilevel", "biaxial"):
        rock = Rock(coarse[name])
        assert rock.stress_error(*ring(rock)).max() < 0.008
    for method in ("mean", "subdivide"):
        points = [measure(Rock(coarse[f"{method}_{cell}"]), 1.2) for cell in ("200cm", "100cm")]
        assert order(points, "closure") > 1.0
        assert order(points, "stress") > 1.0
        assert points[1].wall < 0.1
        assert abs(points[1].mean_closure) < 0.002
