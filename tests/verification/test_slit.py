"""A slit on springs: the closed form by its limits and by a slow twin, and the study on its cheapest scenes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from running import run_study

from verification.answers.slit import Slit, answer, closed_area, closure, exact_slit

OPEN = Slit(half_width=120.0, pressure=14e6, modulus=16e9, spring=0.0)
X = np.linspace(-120.0, 120.0, 25)


def by_elements(slit: Slit, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Middles and closures of `count` elements of constant closure each (Crouch 1976): the slow twin.

    f.p. integral ds / (x - s)^2 from s1 to s2 is 1 / (x - s2) - 1 / (x - s1).
    """
    ends = np.linspace(-slit.half_width, slit.half_width, count + 1)
    middle = 0.5 * (ends[1:] + ends[:-1])
    rock = slit.modulus / (4 * np.pi) * (1 / (middle[:, None] - ends[1:]) - 1 / (middle[:, None] - ends[:-1]))
    return middle, np.linalg.solve(slit.spring * np.eye(count) - rock, np.full(count, slit.pressure))


def test_an_open_slit_closes_as_an_ellipse():
    """4 p sqrt(a^2 - x^2) / E', of area 2 pi p a^2 / E'."""
    np.testing.assert_allclose(OPEN.closure(X), 4 * 14e6 * np.sqrt(120.0**2 - X**2) / 16e9, atol=1e-12)
    assert OPEN.closed_area == pytest.approx(2 * np.pi * 14e6 * 120.0**2 / 16e9)


@pytest.mark.parametrize("spring", [1.8e6, 40e6, 400e6])
def test_closure_is_that_of_many_elements(spring):
    slit = replace(OPEN, spring=spring)
    middle, found = by_elements(slit, 1200)
    inner = np.abs(middle) < 110.0
    np.testing.assert_allclose(slit.closure(middle[inner]), found[inner], rtol=3e-3)
    assert slit.closed_area == pytest.approx(found.sum() * (middle[1] - middle[0]), rel=3e-3)


def test_stiff_springs_bear_all_of_the_pressure():
    """c = p / k away from the ends."""
    slit = replace(OPEN, spring=1e11)
    np.testing.assert_allclose(slit.closure(np.linspace(-60.0, 60.0, 7)), 14e6 / 1e11, rtol=2e-3)


@given(st.floats(0.0, 1e9), st.floats(1.0, 10.0))
def test_closure_scales(spring, factor):
    """A slit twice as wide on springs half as stiff closes twice as much; closure is in proportion to pressure; more
    stiffness closes less."""
    slit = replace(OPEN, spring=spring)
    wide = replace(slit, half_width=factor * 120.0, spring=spring / factor)
    np.testing.assert_allclose(wide.closure(factor * X), factor * slit.closure(X), rtol=1e-9, atol=1e-12)
    pressed = replace(slit, pressure=factor * 14e6)
    np.testing.assert_allclose(pressed.closure(X), factor * slit.closure(X), rtol=1e-9, atol=1e-12)
    assert replace(slit, spring=spring + 1e6).closed_area < slit.closed_area


def test_level_gob_of_one_cell_closes_as_the_slit(tmp_path):
    results = run_study("slit", tmp_path, ["level_20", "stiff_20", "dip_20"])
    rows, _ = answer(results)
    by_name = {row.quantity.split(",")[0]: row for row in rows}
    assert {name for name, row in by_name.items() if row.passed is False} == {
        "dip_20: closed area against the level one's"
    }
    for name in ("level_20", "stiff_20"):
        place, found = closure(results[name])
        assert np.trapezoid(found, place) == pytest.approx(closed_area(results[name]), rel=0.03)
    assert exact_slit(results["stiff_20"]).spring == pytest.approx(500e6 * 1.2 / 20.0)
