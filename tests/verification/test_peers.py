"""Cases that other codes ship: Kratos' returns, the holes, the roof and the slope on larger cells, the log spiral."""

import math

import numpy as np
import pytest
import yaml
from running import DEFAULT, STUDIES, run_study

from verification.answers.kirsch.fields import Rock
from verification.answers.peers import answer, return_rows, wall_rows
from verification.answers.peers.figure import draw
from verification.answers.peers.kratos import AS_STATED, cutoff_multipliers, ours
from verification.answers.peers.printed import particle_rows, roof_rows, row_of_slits
from verification.answers.peers.slope import Slope, limits, slope_rows, worst_spiral
from verification.cavities.cavity import plastic_ring
from verification.cavities.runs import read_run
from verification.studies import load_study, merge


def test_all_returns_but_one_are_theirs():
    rows = return_rows(1e-9)
    assert [row.passed for row in rows] == [True] * 5 + [None] + [True] * 9 + [None] * 3
    assert "without dilation" in rows[5].remark
    assert "Koiter" in rows[-1].remark


def test_a_return_to_the_corner_has_its_faces_flow_backwards_at_its_poisson_ratio():
    """Worked by hand: strains 12.6205, 10.1205 and -12.9821 over E; N_psi of 20 degrees is 2.0396."""
    case = AS_STATED[2]
    assert case.trial == (24, 22, -8)
    theirs = np.array(case.returned)
    drop = np.array(case.trial) - theirs
    strain = [drop[0] - 0.25 * (drop[1] + drop[2]), drop[1] - 0.25 * (drop[0] + drop[2])]
    shear = drop[2] - 0.25 * (drop[0] + drop[1])
    factor = (1 + np.sin(np.radians(20))) / (1 - np.sin(np.radians(20)))
    assert cutoff_multipliers(case, theirs) == pytest.approx(sum(strain) + factor * shear)
    assert cutoff_multipliers(case, theirs) < -3.0
    assert cutoff_multipliers(case, ours(case)) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(ours(case), [9.3935, 9.3935, -3.7562], atol=1e-4)


def test_the_hole_on_larger_cells(tmp_path):
    results = run_study("peers", tmp_path, ["associated"], **{"grid.levels": 6})
    rows, _ = answer(results)
    hole = [row for row in rows if row.quantity.startswith("associated")]
    printed = [row for row in hole if "closed form here" in row.quantity]
    assert len(printed) == 2
    assert all(row.passed for row in printed)
    radius = next(row for row in hole if "plastic radius" in row.quantity)
    assert radius.passed


def test_the_pressed_hole_on_larger_cells(tmp_path):
    """Half a metre, 16 to the radius: a few per cent; the closed form is the printed one in this wide box."""
    results = run_study("peers", tmp_path, ["geos"], **{"grid.levels": 8})
    rows = wall_rows("geos", Rock(results["geos"]), results.settings["pressed"]["geos"], 0.04)
    assert all(row.passed for row in rows)
    exact = [float(row.remark.split()[-1]) for row in rows]
    np.testing.assert_allclose(exact, [row.expected for row in rows], rtol=2e-3)


def test_the_hole_in_hoek_brown_rock_has_the_printed_closed_form(tmp_path):
    results = run_study("peers", tmp_path, ["hoek_brown"])
    theory, printed = plastic_ring(results["hoek_brown"]), results.settings["hoek_brown"]
    assert theory.plastic_radius / theory.radius == pytest.approx(printed["radius"], abs=0.005)
    assert 1e-6 * theory.critical_pressure == pytest.approx(printed["critical_pressure"], abs=0.05)


@pytest.mark.parametrize(("name", "exact"), [("cbgeo_10", [8.516, 37.498]), ("cbgeo_30", [5.675, 28.975])])
def test_the_particle_that_cb_geo_prints(tmp_path, name, exact):
    """The closed form by hand: q / 2 ((r / a)^2 - 1), q = 2 c sqrt(3). Two metres, 4 cells to the radius: a tenth."""
    results = run_study("peers", tmp_path, [name], **{"grid.levels": 4})
    rows = particle_rows(read_run(name, results[name]), **results.settings["particles"][name], allowed=0.1)
    np.testing.assert_allclose([row.expected for row in rows[::2]], exact, atol=2e-3)
    assert [row.passed for row in rows] == [None, True] * 2


def test_the_roof_sags_by_more_than_is_printed_and_the_surface_by_that(tmp_path):
    """Slits by hand: 2 (1 - 1/16) 9.975 MPa / 8 GPa times 900 m / pi arccosh(1 / cos(30 degrees)), 157.4 m."""
    results = run_study("peers", tmp_path, ["roof"], **{"grid.levels": 2})
    surface, roof = roof_rows("roof", results["roof"], results.settings["roof"]["roof"], 0.03)
    assert surface.passed
    assert row_of_slits(results["roof"]) == pytest.approx(0.3679, abs=1e-4)
    assert row_of_slits(results["roof"]) < roof.obtained < 0.42
    assert [axes.get_title() for axes in draw(results, []).axes] == ["MOOSE's panel"]


@pytest.mark.parametrize(("friction", "number"), [(10, 0.108), (15, 0.083), (20, 0.062), (25, 0.044)])
def test_the_worst_log_spiral_has_taylors_stability_number(friction, number):
    """c / (gamma H) of a slope of 45 degrees, Taylor (1937), to the three digits of his table."""
    height, spiral = worst_spiral(math.radians(friction), math.radians(45.0))
    assert 1.0 / height == pytest.approx(number, abs=1e-3)
    np.testing.assert_allclose(spiral.points()[-1], 0.0, atol=1e-9)


def test_slopes_have_the_strength_of_their_factors():
    study = load_study(STUDIES / "peers.yaml", DEFAULT)
    slope = Slope(**study.settings["slope"]["rock"])
    for name, factor in study.settings["slope"]["factors"].items():
        host = study.mines[name].settings.materials["host"]
        cohesion, friction = slope.reduced(factor)
        for state in ("intact", "residual"):
            assert getattr(host.cohesion, state) == pytest.approx(cohesion, rel=1e-6)
            assert getattr(host.friction_angle, state) == pytest.approx(friction, rel=1e-6)
            assert getattr(host.dilation_angle, state) == getattr(host.friction_angle, state)


def test_a_slope_stands_below_its_limit_and_not_well_above(tmp_path):
    """Cells of a metre, whose limit is higher: between 1.26 and 1.30 where the log spiral's is 1.157."""
    cohesion, friction = Slope(6e3, 45.0, 2e4, 10.0, 45.0).reduced(1.4)
    angle, both = f"{friction} deg", lambda value: {"intact": value, "residual": value}
    weak = {"friction_angle": both(angle), "dilation_angle": both(angle), "cohesion": both(f"{cohesion} Pa")}
    text = yaml.safe_load((STUDIES / "peers.yaml").read_text())["variants"]["slope_115"]
    variants = {"slope_115": text, "slope_140": merge(text, {"materials": {"host": weak}})}
    results = run_study("peers", tmp_path, variants, **{"grid.coarse_cell": "1 m", "solver.max_iterations": 2000})
    results.settings["slope"]["factors"] = {"slope_115": 1.15, "slope_140": 1.4}
    assert limits(results) == (1.15, 1.4)
    theirs, largest, *_ = slope_rows(results)
    assert largest.passed
    assert theirs.expected == pytest.approx(1.1568, abs=1e-4)
    assert len(draw(results, []).axes) == 3  # a colour bar among them
