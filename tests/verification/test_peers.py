"""Cases that other codes ship: Kratos' returns, and FLAC3D's hole on cells twice as large."""

import numpy as np
import pytest
from running import run_study

from verification.kirsch.fields import Rock
from verification.peers.answer import answer, return_rows, wall_rows
from verification.peers.kratos import AS_STATED, cutoff_multipliers, ours


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
    results.settings["pressed"] = {}
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
