"""Hoek-Brown: strength and return by what defines them, against an enumeration of all active sets, and Coulomb's."""

import math
from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq, root

from common.errors import InputError
from mpm_core.constitutive.coulomb_return import return_principal as coulomb_return
from mpm_core.constitutive.coulomb_strength import strength_row as coulomb_row
from mpm_core.constitutive.elastic import APEX_REGION, EDGE, ELASTIC, FACE, STRENGTH_FACTOR_CAP, TENSION
from mpm_core.constitutive.laws import hoek_brown
from mpm_core.constitutive.laws.hoek_brown import (
    APEX,
    DILATION_FACTOR,
    EXPONENT,
    MB,
    SIGMA_CI,
    TENSILE_STRENGTH,
    Material,
    excess_shear_stress,
    overstress,
    return_principal,
    return_to_surface,
    rock_mass,
    strength_factor,
    strength_row,
    surely_admissible,
)
from mpm_core.settings import lame_parameters

from .law_twins import components, magnitudes, matrix, principal, rotated, rotation_from, stiffness, stresses, trials

MEGA = 1e6
ROWS = {
    "the issue's": strength_row(30 * MEGA, 1.7, 0.0039, 0.5, 0.0),
    "dilation": strength_row(30 * MEGA, 1.7, 0.0039, 0.5, 10.0),
    "cut-off": strength_row(100 * MEGA, 5.0, 0.02, 0.51, 10.0, 0.1 * MEGA),
    "cut-off zero": strength_row(100 * MEGA, 5.0, 0.02, 0.51, 10.0, 0.0),
    "intact": strength_row(150 * MEGA, 15.0, 1.0, 0.5, 15.0, 5 * MEGA),
    "crushed": strength_row(30 * MEGA, 0.8, 0.0, 0.6, 5.0),
    "straight": strength_row(30 * MEGA, 2.0, 0.1, 1.0, 10.0),
    "dilation above all": strength_row(30 * MEGA, 0.5, 0.001, 0.55, 50.0),
}


def room(x, row):
    """sigma_ci (s - mb x / sigma_ci)^a, odd beyond the apex as the kernel goes on there."""
    base = (row[APEX] - x) * row[MB] / row[SIGMA_CI]
    return math.copysign(row[SIGMA_CI] * abs(base) ** row[EXPONENT], base)


def koiter_returns(trial, lame_lambda, shear_modulus, row):
    """Every stress that Koiter's rule allows: sets of up to three of nine surfaces, roots by scipy's hybrid method."""
    hooke, size = stiffness(lame_lambda, shear_modulus), np.abs(trial).max()
    surfaces = []
    for i, j in permutations(range(3), 2):
        flow = np.zeros(3)
        flow[i], flow[j] = row[DILATION_FACTOR], -1.0
        surfaces.append((lambda t, i=i, j=j: t[i] - t[j] - room(t[i], row), flow))
    if row[TENSILE_STRENGTH] < row[APEX]:
        for k in range(3):
            surfaces.append((lambda t, k=k: t[k] - row[TENSILE_STRENGTH], np.eye(3)[k]))
    found = []
    for count in range(4):
        for chosen in combinations(surfaces, count):
            flows = np.array([flow for _, flow in chosen]).reshape(count, 3)

            def stress(multipliers, flows=flows):
                return trial - hooke @ flows.T @ (multipliers * size / shear_modulus)

            def left(multipliers, chosen=chosen, stress=stress):
                return [value(stress(multipliers)) / size for value, _ in chosen]

            solved = np.zeros(0)
            if count:
                answer = root(left, np.full(count, 0.1), tol=1e-14)
                if np.abs(answer.fun).max() > 1e-11:
                    continue
                solved = answer.x
            returned = stress(solved) if count else trial
            if (solved >= -1e-9).all() and max(value(returned) for value, _ in surfaces) <= 1e-9 * size:
                found.append(np.sort(returned)[::-1])
    return found


@pytest.mark.parametrize("name", ROWS)
@pytest.mark.parametrize("poisson_ratio", [0.0, 0.25, 0.45])
def test_return_is_the_one_that_koiters_rule_allows(name, poisson_ratio):
    """All active sets are tried; those that pass agree on one stress, and ours is that, to 1e-8 of the trial."""
    row, constants = ROWS[name], lame_parameters(57e9, poisson_ratio)
    some = 0
    for trial in trials(12, seed=len(name)):
        *returned, region = return_principal(*trial, *constants, row)
        allowed = koiter_returns(trial, *constants, row)
        some += len(allowed)
        for other in allowed:
            np.testing.assert_allclose(returned, other, rtol=0, atol=1e-7 * np.abs(trial).max())
        if region in (ELASTIC, FACE):
            assert allowed
    assert some


def test_every_region_is_reached():
    """Guards the test above: draws like its own end in every region."""
    constants = lame_parameters(57e9, 0.25)
    regions = {return_principal(*trial, *constants, row)[3] for row in ROWS.values() for trial in trials(60, 3)}
    assert regions == {ELASTIC, FACE, EDGE, APEX_REGION, TENSION}


@pytest.mark.parametrize("name", ROWS)
def test_flow_and_surface_hold_to_round_off_of_the_trial(name):
    """Returned stress is ordered; on face and edges it lies on the curve, and what it lost is along the flows there."""
    row = ROWS[name]
    lame_lambda, shear_modulus = lame_parameters(57e9, 0.3)
    compliance, m = np.linalg.inv(stiffness(lame_lambda, shear_modulus)), row[DILATION_FACTOR]
    for trial in trials(200, 11):
        t1, t2, t3, region = return_principal(*trial, lame_lambda, shear_modulus, row)
        assert t1 >= t2 >= t3
        assert t1 <= row[TENSILE_STRENGTH] or region == ELASTIC
        size = np.abs(trial).max()
        if region not in (FACE, EDGE):
            continue
        assert abs(t1 - t3 - room(t1, row)) <= 1e-12 * max(size, row[SIGMA_CI])
        strain = compliance @ (trial - np.array([t1, t2, t3])) * shear_modulus / size
        if region == FACE:
            np.testing.assert_allclose(strain, -strain[2] * np.array([m, 0.0, -1.0]), atol=1e-12 * m)
            assert strain[2] < 0.0
        else:  # two multipliers, none negative
            pair = strain[:2] / m if t1 == t2 else -strain[1:]
            assert pair.min() >= -1e-12
            total = pair.sum()
            np.testing.assert_allclose(strain.sum(), (m - 1.0) * total, atol=1e-12 * m)


@settings(max_examples=300, deadline=None)
@given(
    st.tuples(*[st.floats(-1.0, 1.0)] * 3), magnitudes(), st.floats(0.0, 0.49), st.floats(0.01, 8.0),
    st.floats(0.0, 1.0), st.floats(0.0, 45.0), st.one_of(st.none(), st.floats(0.0, 1.0)),
)  # fmt: skip
def test_with_exponent_one_it_is_coulomb(values, size, poisson_ratio, mb, s, dilation, cutoff):
    """a = 1: N = 1 + mb and sigma_c = s sigma_ci, at any stress and cut-off. 1e-9 of the stress."""
    sigma_ci = 50 * MEGA
    friction = math.degrees(math.asin(mb / (mb + 2.0)))
    cohesion = s * sigma_ci / (2.0 * math.sqrt(1.0 + mb))
    tension = None if cutoff is None else cutoff * sigma_ci * 0.1
    straight = strength_row(sigma_ci, mb, s, 1.0, dilation, tension)
    coulomb = coulomb_row(friction, dilation, cohesion, tension)
    trial = np.sort(np.array(values))[::-1] * size
    constants = lame_parameters(57e9, poisson_ratio)
    *ours, _ = return_principal(*trial, *constants, straight)
    *theirs, _ = coulomb_return(*trial, *constants, coulomb)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9 * max(size, s * sigma_ci / mb))


@st.composite
def rows(draw):
    """Rock of 1 kPa to 1 TPa, all exponents, with and without s, with and without a cut-off."""
    sigma_ci = draw(st.floats(3.0, 12.0).map(lambda power: 10.0**power))
    cutoff = draw(st.one_of(st.none(), st.just(0.0), st.floats(0.0, 1.0)))
    return strength_row(
        sigma_ci, draw(st.floats(0.01, 40.0)), draw(st.one_of(st.just(0.0), st.floats(1e-8, 1.0))),
        draw(st.sampled_from([0.5, 0.51, 0.58, 2 / 3, 1.0])), draw(st.floats(0.0, 50.0)),
        None if cutoff is None else cutoff * sigma_ci,
    )  # fmt: skip


@settings(max_examples=300, deadline=None)
@given(stresses(), rows(), st.floats(0.0, 0.49))
def test_what_is_returned_is_admissible_and_stays(tensor, row, poisson_ratio):
    """Returned stress comes back bit for bit; an admissible one does at once; strength factor 1 at least."""
    constants = lame_parameters(57e9, poisson_ratio)
    *returned, region = return_to_surface(*tensor, *constants, row)
    if region == ELASTIC:
        assert tuple(returned) == tuple(tensor)
    *again, second = return_to_surface(*returned, *constants, row)
    assert second == ELASTIC
    assert again == returned
    assert strength_factor(*returned, row) >= 1.0
    if surely_admissible(*tensor, row):
        assert region == ELASTIC
        assert overstress(*tensor, row) <= 1e-13 * np.abs(tensor).max()


@settings(max_examples=300, deadline=None)
@given(stresses(), rows(), st.floats(0.0, 0.49), st.integers(0, 10**6), st.floats(-60.0, 60.0))
def test_turning_and_scaling_commute_with_the_return(tensor, row, poisson_ratio, seed, power):
    """In turned axes the turned stress; all stresses and strengths in another unit, the same numbers. Near the apex,
    where the curve is steep, what round-off of the trial makes is set against the strength there."""
    constants = lame_parameters(57e9, poisson_ratio)
    rotation, factor = rotation_from(seed), 2.0 ** round(power)
    returned = np.array(return_to_surface(*tensor, *constants, row)[:6])
    size = np.abs(tensor).max() + 1e-300
    allowed = 1e-9 * size + 100.0 * room(row[APEX] - 1e-15 * size, row)
    turned = np.array(return_to_surface(*rotated(tensor, rotation), *constants, row)[:6])
    np.testing.assert_allclose(turned, rotated(returned, rotation), rtol=0, atol=allowed)
    scaled_row = row.copy()
    scaled_row[[SIGMA_CI, APEX, TENSILE_STRENGTH, 6]] *= factor
    scaled = np.array(return_to_surface(*(tensor * factor), *constants, scaled_row)[:6])
    np.testing.assert_allclose(scaled / factor, returned, rtol=0, atol=1e-11 * size)
    order = [2, 0, 1, 5, 3, 4]
    permuted = np.array(return_to_surface(*tensor[order], *constants, row)[:6])
    np.testing.assert_allclose(permuted, returned[order], rtol=0, atol=allowed)


@settings(max_examples=300, deadline=None)
@given(stresses(), rows())
def test_strength_factor_and_excess_are_those_of_circles(tensor, row):
    """The circle grown by the factor about its centre touches the curve or the cut-off; both measures change sign at
    the surface, as overstress does."""
    factor = strength_factor(*tensor, row)
    s1, _, s3 = principal(tensor)
    centre, radius = 0.5 * (s1 + s3), 0.5 * (s1 - s3)
    size = max(abs(s1), abs(s3))
    above = overstress(*tensor, row)
    forgiven = max(0.0, room(s1 - 1e-6 * size, row))  # towards the apex the curve is so steep that round-off decides
    if above > 1e-6 * size and max(s1 - s3 - forgiven, s1 - row[TENSILE_STRENGTH]) > 1e-6 * size:
        assert factor < 1.0
    if above < -1e-6 * size:
        assert factor >= 1.0
    if 0.0 < factor < STRENGTH_FACTOR_CAP and radius > 1e-6 * size:
        grown = factor * radius
        on_curve = abs(2.0 * grown - room(centre + grown, row)) <= 1e-6 * (size + row[SIGMA_CI])
        assert on_curve or abs(centre + grown - row[TENSILE_STRENGTH]) <= 1e-9 * size or factor == 1.0
    beyond = s1 - s3 - max(0.0, room(s1, row))
    if abs(beyond) > 1e-6 * size and s1 < row[APEX]:
        assert (excess_shear_stress(*tensor, row) > 0.0) == (beyond > 0.0)


@settings(max_examples=300, deadline=None)
@given(stresses(), rows())
def test_overstress_is_what_numpy_makes_of_it(tensor, row):
    """The check of a configuration and the kernel agree, but for round-off, which the apex makes large."""
    size = np.abs(tensor).max()
    allowed = 1e-9 * size + 100.0 * room(row[APEX] - 1e-15 * size, row)
    assert overstress(*tensor, row) == pytest.approx(hoek_brown.overstress_of_tensor(matrix(tensor), row), abs=allowed)


def test_tangent_is_the_slope_of_the_return():
    """What small strains take off elastic stress, beside central differences of the return of tensors: 1e-4."""
    lame, shear = lame_parameters(57e9, 0.25)
    row, random, found, seen = ROWS["dilation"], np.random.default_rng(3), np.zeros((6, 6)), 0
    for trial in trials(400, 9):
        tensor = rotated(components(np.diag(trial)), rotation_from(int(random.integers(10**6))))
        apart = np.diff(trial).max() < -1e-2 * np.abs(trial).max()
        if not apart or return_principal(*trial, lame, shear, row)[3] != FACE:
            continue
        assert hoek_brown.stiffness_reduction(*tensor, lame, shear, row, found)
        exact = np.zeros((6, 6))
        for b in range(6):
            strain = np.zeros(6)
            strain[b] = 1e-5 * np.abs(trial).max() / shear * (1.0 if b < 3 else 0.5)
            change = 2.0 * shear * strain + lame * strain[:3].sum() * np.array([1, 1, 1, 0, 0, 0])
            ends = [np.array(return_to_surface(*(tensor + way * change), lame, shear, row)[:6]) for way in (1, -1)]
            exact[:, b] = (2.0 * change - (ends[0] - ends[1])) / (2.0 * strain[b] * (1.0 if b < 3 else 2.0))
        np.testing.assert_allclose(found, exact, rtol=0, atol=1e-4 * shear)
        seen += 1
    assert seen > 3


def test_excess_shear_stress_of_a_straight_curve_is_ryders():
    """a = 1: (N s1 - s3 - sigma_c) / (2 sqrt N)."""
    row = strength_row(30 * MEGA, 2.0, 0.1, 1.0, 0.0)
    for s1, s3 in [(-1.0, -30.0), (0.0, -2.0), (-5.0, -40.0)]:
        excess = excess_shear_stress(s1 * MEGA, 0.5 * (s1 + s3) * MEGA, s3 * MEGA, 0.0, 0.0, 0.0, row)
        expected = (3.0 * s1 - s3 - 3.0) * MEGA / (2.0 * math.sqrt(3.0))
        assert excess == pytest.approx(expected, rel=1e-9)


def test_zero_radius_and_hydrostatic_tension():
    """Equal principal stresses beyond the apex end at the apex, or at the cut-off; in compression nothing happens."""
    constants = lame_parameters(57e9, 0.25)
    for name, row in ROWS.items():
        p = 50 * MEGA
        *returned, region = return_to_surface(p, p, p, 0.0, 0.0, 0.0, *constants, row)
        np.testing.assert_allclose(returned, [row[TENSILE_STRENGTH]] * 3 + [0.0] * 3, atol=1e-9)
        assert region in (APEX_REGION, TENSION), name
        assert return_to_surface(-p, -p, -p, 0.0, 0.0, 0.0, *constants, row)[6] == ELASTIC


def test_a_large_overshoot_lies_on_the_curve():
    """1 TPa beyond weak rock: the surface equation holds to round-off of the result, found by bisection here."""
    row, constants = ROWS["crushed"], lame_parameters(57e9, 0.25)
    trial = (-1e8, -5e11, -1e12)
    t1, t2, t3, region = return_principal(*trial, *constants, row)
    assert region in (FACE, EDGE)
    exact = brentq(lambda x: x - t3 - room(x, row), -1e14, 0.0, xtol=1e-6, rtol=1e-15)
    assert t1 == pytest.approx(exact, rel=1e-12)
    assert t1 >= t2 >= t3


def test_rock_mass_parameters_are_the_published_ones():
    """GSI 45, mi 10: mb 1.403, s 0.0022, a 0.508 (Hoek, Carranza-Torres and Corkum 2002); D = 0.8 by hand; GSI 100 is
    the intact piece."""
    assert rock_mass(45, 10, 0) == pytest.approx((1.403, 0.00222, 0.508), rel=2e-3)
    mb, s, a = rock_mass(60, 12, 0.8)
    assert (mb, s) == pytest.approx((12 * math.exp(-40 / 16.8), math.exp(-40 / 6.6)))
    assert a == pytest.approx(0.5 + (math.exp(-4) - math.exp(-20 / 3)) / 6)
    assert rock_mass(100, 25, 0) == pytest.approx((25, 1, 0.5), rel=1e-3)


SOUND = {
    "model": "hoek_brown", "youngs_modulus": "10 GPa", "poisson_ratio": 0.25, "density": "2700 kg/m^3",
    "sigma_ci": {"intact": "100 MPa", "residual": "100 MPa"}, "mb": {"intact": 5.0, "residual": 1.5},
    "s": {"intact": 0.02, "residual": 0.001}, "a": {"intact": 0.5, "residual": 0.51},
    "dilation_angle": {"intact": "10 deg", "residual": "5 deg"}, "tension_cutoff": "none",
}  # fmt: skip
BY_INDEX = {key: value for key, value in SOUND.items() if key not in ("mb", "s", "a")} | {
    "gsi": {"intact": 60.0, "residual": 30.0}, "mi": {"intact": 12.0, "residual": 12.0},
}  # fmt: skip


def test_materials_are_read_by_both_descriptions():
    """Rows of intact and residual rock; a cut-off above the apex is lowered to it."""
    intact, residual = hoek_brown.strength_rows(Material.read(SOUND), (0, 1, 2))
    np.testing.assert_allclose(intact, strength_row(100e6, 5.0, 0.02, 0.5, 10.0))
    np.testing.assert_allclose(residual, strength_row(100e6, 1.5, 0.001, 0.51, 5.0))
    intact, _ = hoek_brown.strength_rows(Material.read(BY_INDEX), (0, 1, 2))
    np.testing.assert_allclose(intact, strength_row(100e6, *rock_mass(60, 12, 0), 10.0))


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"mb": {"intact": 5.0, "residual": 6.0}}, "confinement"),
        ({"s": {"intact": 0.02, "residual": 0.03}}, "tensile strength"),
        ({"gsi": {"intact": 60.0, "residual": 30.0}}, "mb"),
        ({"mi": {"intact": 10.0, "residual": 10.0}}, "mi"),
        ({"dilation_angle": {"intact": "10 deg", "residual": "80 deg"}}, "dilation_angle"),
        ({"tension_cutoff": {"intact": "0.04 MPa", "residual": "0.05 MPa"}}, "tensile strength"),
        ({"sigma_ci": {"intact": "20 MPa", "residual": "100 MPa"}, "tension_cutoff": "none"}, "confinement"),
        ({"a": {"intact": 0.5, "residual": 1.2}}, "a.residual"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(change, key):
    """Residual strength outside the intact surface, two descriptions at once, dilation above friction, bounds."""
    with pytest.raises(InputError) as error:
        Material.read(SOUND | change)
    assert key in str(error.value)
    assert "\n" not in str(error.value)
