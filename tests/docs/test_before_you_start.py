"""The code of the page "Before you start": principal stresses to components, against rotations done by hand."""

import doctest
from pathlib import Path

import numpy as np
import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs/how-to/before-you-start.md"


@pytest.fixture(scope="module")
def components():
    """The function of the page, whose examples hold."""
    names: dict = {}
    text = PAGE.read_text(encoding="utf-8")
    examples = doctest.DocTestParser().get_doctest(text, names, PAGE.name, str(PAGE), 0)
    found = doctest.DocTestRunner().run(examples, clear_globs=False)
    assert found.attempted == 3
    assert found.failed == 0
    return examples.globs["components"]


def stress(**given: float) -> dict[str, float]:
    return dict.fromkeys(("xx", "yy", "zz", "yz", "xz", "xy"), 0.0) | given


def test_principal_stresses_along_the_axes_are_negative_components(components):
    """Trend 0 is y (north), trend 90 is x (east); a plunge of 90 is z."""
    assert components([30, 20, 10], [0, 90, 0], [0, 0, 90]) == stress(yy=-30, xx=-20, zz=-10)
    assert components([30, 20, 10], [90, 0, 0], [0, 0, 90]) == stress(xx=-30, yy=-20, zz=-10)
    assert components([30, 20, 10], [0, 0, 90], [90, 0, 0]) == stress(zz=-30, yy=-20, xx=-10)


def test_a_turn_in_plan_makes_the_shear_of_the_circle_of_mohr(components):
    """North-east: xx = yy = -(a + b) / 2, and xy = -(a - b) / 2, since the axis lies where x and y have one sign."""
    assert components([30, 20, 10], [45, 135, 0], [0, 0, 90]) == stress(xx=-25, yy=-25, zz=-10, xy=-5)
    assert components([30, 20, 10], [315, 45, 0], [0, 0, 90]) == stress(xx=-25, yy=-25, zz=-10, xy=5)


@pytest.mark.parametrize(("trend", "sign"), [(0.0, 1.0), (180.0, -1.0)])
def test_an_axis_that_plunges_north_has_positive_yz(components, trend, sign):
    """a plunges by p, c by 90 - p on the other side: yy = -(a cos2 + c sin2), zz = -(a sin2 + c cos2), yz = (a - c) sin
    cos, as y and -z grow together along a."""
    a, b, c, cos, sin = 40.0, 25.0, 20.0, np.cos(np.radians(30)), np.sin(np.radians(30))
    found = components([a, b, c], [trend, 90, trend + 180], [30, 0, 60])
    expected = stress(
        xx=-b,
        yy=-(a * cos**2 + c * sin**2),
        zz=-(a * sin**2 + c * cos**2),
        yz=sign * (a - c) * sin * cos,
    )
    assert found == pytest.approx(expected, abs=0.0051)  # the page rounds to 0.01


def test_rounded_directions_keep_the_sizes_and_others_are_refused(components):
    """Directions are rounded to degrees; the sum of the sizes is minus the trace of the stress (0.02: rounding)."""
    found = components([42.1, 28.9, 23.0], [180, 68, 280], [16, 52, 33])
    assert found["xx"] + found["yy"] + found["zz"] == pytest.approx(-94.0, abs=0.02)
    with pytest.raises(ValueError, match="right angles"):
        components([30, 20, 10], [0, 60, 0], [0, 0, 90])


def test_the_demo_says_where_its_largest_compression_plunges(components):
    """42 MPa at 1000 m, 16 degrees to the south; the stress of the mine file from its principal stresses (0.5 MPa)."""
    found = components([42.1, 28.9, 23.0], [180, 68, 280], [16, 52, 33])
    at_1000_m = stress(xx=-24.9, yy=-40.97, zz=-28.13, yz=-3.95, xz=2.7, xy=-0.7)
    assert found == pytest.approx(at_1000_m, abs=0.5)
