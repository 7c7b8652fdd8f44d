"""How far a domain has to reach: against exact fields between circles and spheres, and for openings drawn at random."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpm_core.grid.domain import base_cells, marks_memory
from mpm_core.scene.far_field import (
    MAX_BOUNDARY_ERROR,
    MAX_MARKS_BYTES,
    MEMORY,
    STRENGTH,
    Opening,
    bounds,
    coefficients,
    covered,
    derive_domain,
    effective_volume,
    own_volume,
    reach_of,
    worst_coefficient,
)
from mpm_core.settings import MAX_LEVELS
from verification.answers.kirsch.closed_form import BoxedPlate, InfinitePlate

RATIOS = (0.0, 0.1, 0.25, 0.4, 0.49)
CONDITIONS = ("fixed", "roller", "traction")
FAR = 40.0  # radii: what is left out falls as its square


def box(lower, upper) -> Opening:
    lower, upper = np.array(lower, float), np.array(upper, float)
    return Opening(lower, upper, upper - lower, float(np.prod(upper - lower)), np.stack([lower, upper])[None])


def ring_share(nu: float, outer: float, condition: str) -> float:
    """Share that a boundary at so many radii takes from a hole's dipole under a deviator: the exact ring, cos 2 theta.

    phi = c / z + e z^3, psi = d / z^3 + g z - z; the wall bears nothing.
    """
    kappa = 3 - 4 * nu
    wall = [[1, 3, 0, 1, 1], [-1, 1, 1, 0, 0]]  # c, e, d, g, right side; of e^-i theta, e^3 i theta

    def outside(power_3, power_1):  # of 2 G u (kappa) or of the force (-1 in its place)
        k = kappa if power_3 == "moves" else -1.0
        rows = {
            "out": [1 / outer, k * outer**3, -1 / outer**3, 0, 0],
            "in": [k / outer, -3 * outer**3, 0, -outer, 0],
        }
        return rows[power_1]

    if condition == "fixed":
        held = [outside("moves", "out"), outside("moves", "in")]
    elif condition == "traction":
        held = [outside("force", "out"), outside("force", "in")]
    else:  # u_r = 0: the sum of both; no shear: 2 c / r^2 - 6 e r^2 - g, and of d / z^3 the same as its own normal part
        both = np.add(outside("moves", "out"), outside("moves", "in"))
        held = [both, [2 / outer**2, -6 * outer**2, -3 / outer**4, -1, 0]]
    system = np.array([*wall, *held], float)
    return 1.0 - np.linalg.solve(system[:, :4], system[:, 4])[0]


def shell_share(nu: float, outer: float, condition: str) -> float:
    """The same of a sphere's dipole, u = F d.x + H x (n.d.n): dipole, harmonic of order 2, uniform strain, cubic."""
    fields = [(2 * (1 - 2 * nu), 3.0, -3), (2.0, -5.0, -5), (1.0, 0.0, 0), (-(7 - 4 * nu) / (7 - 10 * nu), 1.0, 2)]

    def rows(r: float) -> np.ndarray:
        found = []
        for f, h, n in fields:
            f, h = f * r**n, h * r**n
            along = f + 0.5 * n * f + h
            found.append([f, h, along, 0.5 * n * f + n * h + nu / (1 - 2 * nu) * (n * f + (3 + n) * h)])
        return np.array(found).T

    at_wall, f_h = rows(1.0)[2:], rows(outer)
    held = {"fixed": f_h[:2], "roller": [f_h[0] + f_h[1], f_h[2]], "traction": f_h[2:]}[condition]
    found = np.linalg.solve(np.array([*at_wall, *held]), [-1.0, 0.0, 0.0, 0.0])[0]
    alone = np.linalg.solve(at_wall[:, :2], [-1.0, 0.0])[0]
    return 1.0 - found / alone


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("nu", RATIOS)
def test_a_deviator_loses_what_the_exact_ring_and_shell_take(nu, condition):
    """The coefficients are the first term in (a / R)^d of fields that meet wall and boundary exactly."""
    for share, dimension in ((ring_share, 2), (shell_share, 3)):
        exact = share(nu, FAR, condition) * FAR**dimension
        np.testing.assert_allclose(coefficients(dimension, nu, condition)[1], exact, rtol=0.02)


@pytest.mark.parametrize("nu", RATIOS)
def test_all_round_stress_loses_what_the_thick_walled_cylinder_and_sphere_take(nu):
    """Lame: u = A r + B / r^(d - 1), no displacement at R; hoop stress of the wall over that in infinite rock."""
    shear, lame = 0.5 / (1 + nu), nu / ((1 + nu) * (1 - 2 * nu))
    for d, far in ((2, 2.0), (3, 1.5)):
        bulk = 2 * (lame + shear) if d == 2 else 3 * lame + 2 * shear
        q = FAR**-d
        strength = 1 / (2 * (d - 1) * shear + bulk * q)  # B of unit stress and radius
        hoop = 1 + strength * (2 * shear - bulk * q)
        np.testing.assert_allclose((1 - hoop / far) / q, coefficients(d, nu, "fixed")[0], rtol=0.06)


@pytest.mark.parametrize("stress", [(-30e6, -30e6, 0.0), (-30e6, -1e3, 0.0), (-30e6, -15e6, 6e6)])
@pytest.mark.parametrize("boundary", ["fixed", "traction"])
def test_a_square_box_takes_less_than_the_rule_says(stress, boundary):
    """The exact field of a hole in a square box; its faces are nearest in four points only."""
    around = np.exp(2j * np.pi * np.arange(72) / 72)
    hoops = [
        plate.at(10.0 * around).polar_stress(np.angle(around))[1]
        for plate in (BoxedPlate(10.0, stress, 3e9, 0.25, 200.0, boundary), InfinitePlate(10.0, stress, 3e9, 0.25))
    ]
    error = np.abs(hoops[0] - hoops[1]).max() / np.abs(hoops[1]).max()
    expected = worst_coefficient(2, [0.25], [boundary]) * 0.05**2
    assert 0.2 * expected < error < expected


def test_the_distance_of_a_hole_and_a_sphere():
    """26.5 and 7.6 radii in rock of Poisson's ratio 0.25; a sphere has the volume of a sphere."""
    sides = np.full(3, 2.0)
    sphere = Opening(-sides / 2, sides / 2, sides, 4 / 3 * np.pi, np.stack([-sides / 2, sides / 2])[None])
    assert reach_of([sphere], [0.25], ["fixed"]).distance(MAX_BOUNDARY_ERROR) == pytest.approx(7.57, abs=0.01)
    hole = Opening(-sides[:2] / 2, sides[:2] / 2, sides[:2], np.pi, np.stack([-sides[:2] / 2, sides[:2] / 2])[None])
    assert reach_of([hole], [0.25], ["fixed"]).distance(MAX_BOUNDARY_ERROR) == pytest.approx(
        np.sqrt(3.5 / 0.005), rel=1e-6
    )


def test_a_long_tunnel_is_no_cavern():
    """A kilometre of a 5 m tunnel needs no more than a hole in plane strain does, not a cavern of 500 m."""
    tunnel = box([0, 0, 0], [1000, 5, 5])
    distance = reach_of([tunnel], [0.25], ["fixed"]).distance(MAX_BOUNDARY_ERROR)
    assert distance == pytest.approx(np.sqrt(4 / 0.005 * 3.5 / 4) * 5 / np.sqrt(np.pi), rel=1e-6)
    found = derive_domain([tunnel], 1.25, [0.25])
    assert (found.upper - found.lower)[1:].max() < 250.0


def test_a_box_cut_into_stopes_reaches_as_far_as_the_whole():
    """Stopes side by side in one reef disturb as the reef does, however many they are."""
    whole = box([0, 0, 0], [80, 60, 4])
    parts = [box([x, y, 0], [x + 10, y + 10, 4]) for x in range(0, 80, 10) for y in range(0, 60, 10)]
    assert effective_volume([whole]) == pytest.approx(80 * 60 * 60)
    assert covered(parts) == pytest.approx(1.0)
    assert effective_volume(parts) == pytest.approx(effective_volume([whole]), rel=1e-6)


def test_openings_far_apart_disturb_each_by_itself():
    """Two drives a kilometre apart are no cavern of a kilometre."""
    pair = [box([0, 0, 0], [5, 60, 5]), box([1000, 0, 0], [1005, 60, 5])]
    assert effective_volume(pair) == pytest.approx(2 * 60 * 25, rel=0.02)


def test_a_domain_too_large_for_its_split_marks_ends_where_they_do_and_says_so():
    """It says what is expected of it all the same."""
    found = derive_domain([box([0, 0, 0], [2000, 2000, 800])], 1.0, [0.25])
    shape = base_cells(found.lower, found.upper, found.coarse_cell)
    assert found.limited == MEMORY
    assert found.error > MAX_BOUNDARY_ERROR
    assert marks_memory(shape, found.levels) > 0.3 * MAX_MARKS_BYTES or found.distance <= 1.0


def test_ground_ends_the_domain():
    """At the ground exactly; what is below keeps its distance."""
    opening = [box([0, 0, -40], [20, 20, -20])]
    deep, shallow = (derive_domain(opening, 1.0, [0.25], ground=ground) for ground in (1000.0, -10.5))
    assert deep.upper[2] < 1000.0
    assert shallow.upper[2] == -10.5
    assert shallow.distance >= reach_of(opening, [0.25], ["fixed"]).distance(MAX_BOUNDARY_ERROR) - 10.0 - 1e-6
    base_cells(shallow.lower, shallow.upper, shallow.coarse_cell)


sizes = st.floats(0.5, 200.0)
places = st.floats(-500.0, 500.0)


def corners(dimension: int):
    return st.lists(st.tuples(*[places] * dimension, *[sizes] * dimension), min_size=1, max_size=5).map(
        lambda rows: [box(row[:dimension], np.add(row[:dimension], row[dimension:])) for row in rows]
    )


@settings(max_examples=150, deadline=None)
@given(
    st.one_of(corners(2), corners(3)),
    st.sampled_from([0.7, 1.0, 1.25, 5.0]),
    st.sampled_from(RATIOS),
    st.sampled_from([None, 3]),
)
def test_a_derived_domain_is_whole_base_cells_around_all_openings(openings, finest, nu, levels):
    """With the distance on every side, about in the middle; the same elsewhere, and mirrored."""
    chosen = (levels, levels) if levels else (1, MAX_LEVELS)
    found = derive_domain(openings, finest, [nu], levels=chosen)
    shape = base_cells(found.lower, found.upper, found.coarse_cell)
    assert found.levels <= MAX_LEVELS
    assert found.coarse_cell == finest * 2 ** (found.levels - 1)
    assert (shape >= 4).all() or levels or found.levels == 1
    assert levels or shape.min() < 8 or found.levels == MAX_LEVELS
    lower, upper = bounds(openings)
    assert min((lower - found.lower).min(), (found.upper - upper).min()) >= found.distance - 1e-6
    needed = reach_of(openings, [nu], ["fixed"]).distance(MAX_BOUNDARY_ERROR) - 0.5 * min(
        one.sides.min() for one in openings
    )
    if not found.limited:
        assert found.distance >= min(needed, 1e9) - 1e-6 * finest
        assert found.error <= MAX_BOUNDARY_ERROR
    assert (np.abs(0.5 * (found.lower + found.upper) - 0.5 * (lower + upper)) <= finest).all()

    shift = np.array([1e6, -2e6, 3e6][: len(lower)])
    moved = derive_domain([box(one.lower + shift, one.upper + shift) for one in openings], finest, [nu], levels=chosen)
    np.testing.assert_array_equal(base_cells(moved.lower, moved.upper, moved.coarse_cell), shape)
    assert (np.abs(moved.lower - shift - found.lower) <= finest).all()
    base_cells(moved.lower, moved.upper, moved.coarse_cell)

    flip = np.array([-1.0, 1.0, 1.0][: len(lower)])
    ends = [np.sort([one.lower * flip, one.upper * flip], axis=0) for one in openings]
    mirrored = derive_domain([box(*pair) for pair in ends], finest, [nu], levels=chosen)
    np.testing.assert_array_equal(base_cells(mirrored.lower, mirrored.upper, mirrored.coarse_cell), shape)
    assert abs(mirrored.upper[0] + found.lower[0]) <= finest


@given(corners(3))
def test_more_openings_or_larger_ones_never_disturb_less(openings):
    """Up to counting what they cover on a raster."""
    before = effective_volume(openings)
    assert before >= sum(own_volume(one) for one in openings) * (1 - 1e-9) or len(openings) > 1
    assert before <= np.sort(np.ptp(bounds(openings), axis=0))[-2] ** 2 * np.ptp(bounds(openings), axis=0).max() * 1.001


@settings(max_examples=150, deadline=None)
@given(
    corners(3),
    st.sampled_from([0.7, 1.25, 5.0]),
    st.floats(1.0, 3000.0),
    st.floats(1.0, 3000.0),
    st.booleans(),
)
def test_a_domain_stays_between_the_elevations_where_rock_bears_its_stress(openings, finest, below, above, is_ground):
    """Where its largest cell fits between them; what it gives up by that is told, and the ground is met exactly."""
    lower, upper = bounds(openings)
    heights = lower[2] - below, upper[2] + above
    ground = {"ground": heights[1]} if is_ground else {}
    sound = (heights[0], np.inf) if is_ground else heights
    found = derive_domain(openings, finest, [0.25], **ground, sound=sound)
    base_cells(found.lower, found.upper, found.coarse_cell)
    assert found.error <= MAX_BOUNDARY_ERROR or found.limited
    if heights[1] - heights[0] > 2 * finest:
        assert heights[0] - 1e-9 <= found.lower[2]
        assert found.upper[2] <= heights[1] + 1e-9
    if found.limited != STRENGTH:
        assert (
            min((lower - found.lower).min(), (found.upper - upper)[: 2 if is_ground else 3].min())
            >= found.distance - 1e-6
        )
    far = derive_domain(openings, finest, [0.25], sound=(-1e8, 1e8))
    np.testing.assert_array_equal(far.lower, derive_domain(openings, finest, [0.25]).lower)
