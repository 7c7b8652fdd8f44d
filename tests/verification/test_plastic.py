"""Plastic rings and the brittle row: closed forms by what makes them right, and reduced studies."""

from itertools import pairwise

import numpy as np
import pytest
from running import run_study

from verification.answers import brittle_row, plastic
from verification.answers.brittle_row import BrittleRow
from verification.cavities.coulomb import CoulombRock, PlasticSphere, PlasticTunnel

RADIUS = 8.0
TABLE_2 = {
    "youngs_modulus": 57e9,
    "poisson_ratio": 0.25,
    "friction_angle": {"intact": 30.0, "residual": 20.0},
    "dilation_angle": {"intact": 10.0, "residual": 10.0},
    "cohesion": {"intact": 2e6, "residual": 1e6},
}
BRITTLE = CoulombRock.of(TABLE_2)
PERFECT = CoulombRock.of(
    TABLE_2
    | {key: dict.fromkeys(("intact", "residual"), TABLE_2[key]["intact"]) for key in ("friction_angle", "cohesion")}
)
RINGS = [
    kind(RADIUS, pressure, rock)
    for kind in (PlasticTunnel, PlasticSphere)
    for pressure in (10e6, 30e6)
    for rock in (PERFECT, BRITTLE)
]
ALL_RINGS = pytest.mark.parametrize(
    "ring", RINGS, ids=lambda r: f"{type(r).__name__}-{r.pressure:.0e}-{r.rock.brittle}"
)


def places(ring):
    """Distances within every zone and outside, none at a front."""
    fronts = [ring.radius, *sorted(zone.outer for zone in ring.zones()), 4 * ring.plastic_radius]
    return np.concatenate([np.linspace(a, b, 9)[1:-1] for a, b in pairwise(fronts)])


def slope(function, r, step=1e-4):
    return (function(r + step) - function(r - step)) / (2 * step)


@ALL_RINGS
def test_ring_is_in_equilibrium_and_bears_nothing_at_the_wall(ring):
    """d s_r / dr = n (s_t - s_r) / r; no radial stress at the wall, none but the virgin one far away, no jump of it."""
    r = places(ring)
    radial, hoop, _ = ring.stress(r)
    balance = slope(lambda x: ring.stress(x)[0], r) * r - ring.hoop_directions * (hoop - radial)
    np.testing.assert_allclose(balance, 0.0, atol=1e-6 * ring.pressure)
    np.testing.assert_allclose(ring.stress(RADIUS)[0], 0.0, atol=1e-6)
    np.testing.assert_allclose(ring.stress(1e5 * RADIUS)[:2], -ring.pressure, rtol=1e-6)
    front = ring.plastic_radius
    np.testing.assert_allclose(ring.stress(front * (1 - 1e-12))[0], ring.stress(front * (1 + 1e-12))[0], rtol=1e-9)


@ALL_RINGS
def test_rock_is_at_residual_strength_inside_the_front_and_at_the_peak_on_it(ring):
    """N s1 - s3 = sigma_c with the residual row inside, with the intact one at the front, below outside."""
    r = places(ring)
    stress = np.sort(ring.stress(r), axis=0)
    inside = r < ring.plastic_radius
    residual = ring.rock.residual_friction * stress[2] - stress[0] - ring.rock.residual_strength
    np.testing.assert_allclose(residual[inside], 0.0, atol=1e-6 * ring.pressure)
    intact = ring.rock.intact_friction * stress[2] - stress[0] - ring.rock.intact_strength
    assert (intact[~inside] < 0.0).all()
    at_front = np.sort(ring.stress(ring.plastic_radius * (1 + 1e-12)))
    peak = ring.rock.intact_friction * at_front[2] - at_front[0] - ring.rock.intact_strength
    np.testing.assert_allclose(peak, 0.0, atol=1e-6 * ring.pressure)


@ALL_RINGS
def test_strain_that_is_not_elastic_flows_by_the_dilation_angle(ring):
    """Plastic strain (total minus Hooke's) is zero outside; inside radial = -N_psi (hoop + third), both of these
    compressive; where the third stress is intermediate, it has none."""
    r, nu = places(ring), ring.rock.poisson_ratio
    moved = ring.displacement(r)
    total = np.array([slope(ring.displacement, r), moved / r, moved / r if ring.hoop_directions == 2 else 0 * r])
    change = np.array(ring.stress(r)) + ring.pressure
    elastic = ((1 + nu) * change - nu * change.sum(axis=0)) / ring.rock.youngs_modulus
    strain = total - elastic
    size = ring.pressure / ring.rock.youngs_modulus
    inside = r < ring.plastic_radius
    np.testing.assert_allclose(strain[:, ~inside], 0.0, atol=1e-6 * size)
    np.testing.assert_allclose(strain[0], -ring.rock.dilation * (strain[1] + strain[2]), atol=1e-5 * size)
    assert (strain[1, inside] < 0.0).all()
    assert (strain[2, inside] < 1e-6 * size).all()
    if ring.hoop_directions == 1:
        face = inside & (r > ring.edge_radius)
        np.testing.assert_allclose(strain[2, face], 0.0, atol=1e-6 * size)
        assert (np.diff(np.array(ring.stress(r[face]))[[1, 2, 0]], axis=0) > 0.0).all()  # the axial one in between


@pytest.mark.parametrize(("pressure", "expected"), [(10e6, 2.125), (30e6, 5.451)])
def test_brittle_tunnel_fails_as_far_as_known(pressure, expected):
    """R / a of Table 2 rock, found before by another code."""
    np.testing.assert_allclose(PlasticTunnel(RADIUS, pressure, BRITTLE).plastic_radius / RADIUS, expected, atol=6e-4)


def test_axial_stress_becomes_a_major_one_where_known():
    """Perfectly plastic, 30 MPa: inside 1.55 a, and closure 1.8 % above the classical one; nowhere at 10 MPa."""
    tunnel = PlasticTunnel(RADIUS, 30e6, PERFECT)
    classical = PlasticTunnel(RADIUS, 30e6, PERFECT, edge=False)
    np.testing.assert_allclose(tunnel.edge_radius / RADIUS, 1.55, atol=0.005)
    np.testing.assert_allclose(tunnel.displacement(RADIUS) / classical.displacement(RADIUS), 1.018, atol=5e-4)
    assert PlasticTunnel(RADIUS, 10e6, PERFECT).edge_radius == RADIUS


def test_perfectly_plastic_tunnel_moves_as_salencon_has_it():
    """Salencon (1969) as the manuals print it: one expression for the displacement of the plastic zone."""
    tunnel = PlasticTunnel(RADIUS, 30e6, PERFECT, edge=False)
    rock, r = PERFECT, np.linspace(RADIUS, tunnel.plastic_radius, 5)
    n, dilation, nu = rock.intact_friction, rock.dilation, rock.poisson_ratio
    k = rock.intact_strength / (n - 1)
    front = tunnel.plastic_radius
    chi = (2 * nu - 1) * (30e6 + k)
    chi += (1 - nu) * (n**2 - 1) / (n + dilation) * k * (front / RADIUS) ** (n - 1) * (front / r) ** (dilation + 1)
    chi += ((1 - nu) * (n * dilation + 1) / (n + dilation) - nu) * k * (r / RADIUS) ** (n - 1)
    np.testing.assert_allclose(tunnel.displacement(r), -chi * r / (2 * rock.shear_modulus), rtol=1e-9)


@pytest.mark.parametrize("kind", [PlasticTunnel, PlasticSphere])
def test_weak_stress_leaves_the_wall_elastic(kind):
    """Below half the strength of the wall nothing fails: Lame's field, u = p a / (2 n G)."""
    ring = kind(RADIUS, 1e6, BRITTLE)
    assert ring.plastic_radius == RADIUS
    n = ring.hoop_directions
    np.testing.assert_allclose(ring.stress(RADIUS)[1], -(n + 1) / n * 1e6)
    np.testing.assert_allclose(ring.displacement(RADIUS), -1e6 * RADIUS / (2 * n * BRITTLE.shear_modulus))


@pytest.mark.parametrize("edge", [False, True])
def test_row_obeys_weight_strength_flow_and_its_sides(edge):
    """zz is the weight; failed rock is at residual strength, intact rock below the peak; no strain sideways; the face
    rises by the sum of vertical strains (a fine sum of what `stress` and the flow rule give)."""
    face = np.array([-12.2635e6, -12.2635e6 if edge else -7.5e6, -13.9e6])
    gradient = np.array([-24.9e3, -24.9e3, -27.8e3])
    row = BrittleRow(BRITTLE, face, gradient)
    depth = (np.arange(40000) + 0.5) * 1e-3
    stress, failed = row.stress(depth), depth < row.failed_depth
    assert 11.9 < row.failed_depth < 12.1
    np.testing.assert_allclose(np.diff(stress[2]) / 1e-3, gradient[2])
    order = np.sort(stress, axis=0)
    np.testing.assert_allclose(
        (BRITTLE.residual_friction * order[2] - order[0])[failed], BRITTLE.residual_strength, rtol=1e-9
    )
    assert (BRITTLE.intact_friction * order[2] - order[0] < BRITTLE.intact_strength)[~failed].all()
    change = stress - face[:, None] - gradient[:, None] * depth
    elastic = ((1 + 0.25) * change - 0.25 * change.sum(axis=0)) / 57e9
    np.testing.assert_allclose(elastic[:2, ~failed], 0.0, atol=1e-12)
    if not edge:
        np.testing.assert_allclose(elastic[1], 0.0, atol=1e-12)  # its plastic strain is zero as well
    plastic_part = -elastic[:2] * failed  # sideways the two cancel
    vertical = elastic[2] - BRITTLE.dilation * plastic_part.sum(axis=0)
    np.testing.assert_allclose(row.rise(40.0), vertical.sum() * 1e-3, rtol=1e-4)


def test_strong_row_stays_elastic():
    """No failure where strength is never reached: rise of a confined column."""
    face, gradient = np.array([-3e6, -3e6, -9e6]), np.array([-5e3, -5e3, -20e3])
    row = BrittleRow(BRITTLE, face, gradient)
    assert row.failed_depth == 0.0
    confined = 57e9 * 0.75 / (1.25 * 0.5)
    np.testing.assert_allclose(row.rise(40.0), 9e6 / confined * 40.0)


def test_brittle_row_study(tmp_path):
    """All rows of the shorter of its two variants: the same bounds as at full size."""
    rows, _ = brittle_row.answer(run_study("brittle_row", tmp_path, ["face"]))
    assert len(rows) == 4
    assert all(row.passed for row in rows), [row for row in rows if not row.passed]


def test_perfectly_plastic_tunnel_and_sphere_on_coarse_cells(tmp_path):
    """a/h = 4: plastic radius within a cell, stress and closure within about twice the study's bounds (first order in
    h; the sphere's closure is 10.5 % too small in 16 increments as in 4)."""
    smaller = {"excavations.0.radius": "4 m", "solver.increments": 4}
    tunnel = run_study(
        "plastic_tunnel",
        tmp_path,
        ["perfect_30"],
        **smaller,
        **{"domain.upper": ["384 m", "384 m"], "excavations.1.radius": "12 m"},
    )
    sphere = run_study(
        "plastic_sphere",
        tmp_path,
        ["perfect_30"],
        **smaller,
        **{"domain.upper": ["80 m"] * 3, "excavations.1.radius": "8 m"},
    )
    for results in (tunnel, sphere):
        rows, _ = plastic.answer(results)
        allowed = {"plastic radius": 1.0, "stress": 0.06, "displacement": 0.11, "coarse cells": 0.0}
        for name, bound in allowed.items():
            chosen = [row for row in rows if name in row.quantity and row.allowed is not None]
            assert chosen
            for row in chosen:
                assert row.error <= bound, row


def test_brittle_tunnel_on_coarse_cells(tmp_path):
    """10 MPa, a/h = 4, two loading paths: their rings reach theory's front within two cells, as in the study."""
    changes = {
        "excavations.0.radius": "4 m",
        "excavations.1.radius": "14 m",
        "domain.upper": ["384 m", "384 m"],
    }
    results = run_study("plastic_tunnel", tmp_path, ["brittle_10_08", "brittle_10_11"], **changes)
    rows, _ = plastic.answer(results)
    by_name = {row.quantity.split(": ")[1]: row for row in rows}
    assert by_name["95 % of the failed volume lie within, cells, mean of 2 runs"].passed
    assert 0.5 < by_name["share of theory's ring that failed, mean"].obtained <= 1.0
    assert 0.8 < by_name["inward displacement of the wall over theory, mean"].obtained < 1.3
