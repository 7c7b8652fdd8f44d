"""The study of loading measures on its cheapest scenes; its closed forms by their limits."""

import numpy as np
import pytest
from running import run_study

from verification.answers.loading import answer, energy_of, slit_energy
from verification.answers.slit import Slit
from verification.cavities.inclusion import Elastic, SphericalInclusion


def test_a_slit_releases_half_of_the_pressure_times_what_it_closes():
    """By the area of closure that study slit computes as a series."""
    slit = Slit(half_width=30.0, pressure=14e6, modulus=16e9, spring=0.0)
    assert slit_energy(14e6, 16e9, 30.0) == pytest.approx(0.5 * 14e6 * slit.closed_area / 1e6)


def test_energy_of_a_sphere_is_that_of_its_parts():
    """All-round: p2 V / 2K and 3 p2 V / 8G. Nothing is released through the wall where fill is as stiff as rock and
    bears as much."""
    rock, pressure, volume = Elastic(57e9, 0.25), 30e6, np.pi / 6.0 * 8.0**3
    mined, through = energy_of(SphericalInclusion(8.0, -pressure * np.eye(3), rock), 8.0)
    assert mined == pytest.approx(volume * pressure**2 / (2 * rock.bulk_modulus) / 1e6)
    assert through == pytest.approx(3 * volume * pressure**2 / (8 * rock.shear_modulus) / 1e6)
    stiff = SphericalInclusion(8.0, -pressure * np.eye(3), rock, Elastic(57e15, 0.25))
    assert energy_of(stiff, 8.0)[1] == pytest.approx(0.0, abs=1e-4)


def test_cheap_scenes_pass(tmp_path):
    results = run_study("loading", tmp_path, ["slit_10", "sphere", "sphere_wider", "sphere_filled", "sphere_triaxial"])
    rows, _ = answer(results)
    assert {row.quantity for row in rows if row.passed is False} == set()
    assert sum(row.passed is True for row in rows) >= 15
    assert sum("excess shear stress" in row.quantity for row in rows) == 3
