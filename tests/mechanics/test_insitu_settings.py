"""Principal stresses with trend and plunge as components, against rotations done by hand; and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import InputError
from common.voigt import NAMES, tensor_from_voigt
from mpm_core.insitu_settings import InsituSettings

Axis = tuple[float, float] | None


def principal(sizes, axes: list[Axis], key: str = "constant") -> InsituSettings:
    """Settings of three principal stresses (MPa) with axes (trend, plunge) in degrees; None: it follows."""
    unit = {"constant": "MPa", "gradient": "MPa/m"}[key]
    section = {}
    for number, (size, axis) in enumerate(zip(sizes, axes, strict=True), 1):
        section[f"sigma_{number}"] = {key: f"{size!r} {unit}"}
        if axis is not None:
            section[f"sigma_{number}"] |= {"trend": f"{axis[0]!r} deg", "plunge": f"{axis[1]!r} deg"}
    return InsituSettings.read({"principal": section}, "insitu_stress")


def components(*stress, key: str = "constant") -> list[float]:
    """Six components in MPa."""
    return [value / 1e6 for value in principal(*stress, key=key).voigt(key)]


def voigt(**values: float) -> list[float]:
    return [values.get(name, 0.0) for name in NAMES]


@pytest.mark.parametrize("key", ["constant", "gradient"])
def test_axes_along_those_of_the_mine(key):
    """Trend 0 is y (north), trend 90 is x (east); a plunge of 90 is z. The other of the two keys is zero."""
    sizes = (-30.0, -20.0, -10.0)
    for axes, expected in (
        ([(0.0, 0.0), (90.0, 0.0), (0.0, 90.0)], voigt(yy=-30, xx=-20, zz=-10)),
        ([(90.0, 0.0), (0.0, 0.0), (77.0, 90.0)], voigt(xx=-30, yy=-20, zz=-10)),
        ([(0.0, 90.0), (0.0, 0.0), (90.0, 0.0)], voigt(zz=-30, yy=-20, xx=-10)),
        ([(180.0, 0.0), (270.0, 0.0), (0.0, -90.0)], voigt(yy=-30, xx=-20, zz=-10)),
    ):
        assert components(sizes, axes, key=key) == pytest.approx(expected, abs=1e-12)
    other = "gradient" if key == "constant" else "constant"
    assert principal(sizes, axes, key).voigt(other) == [0.0] * 6


def test_a_turn_in_plan_makes_the_shear_of_the_circle_of_mohr():
    """North-east: xx = yy = (a + b) / 2, and xy = (a - b) / 2, since the axis lies where x and y have one sign."""
    sizes = (-30.0, -20.0, -10.0)
    found = components(sizes, [(45.0, 0.0), (135.0, 0.0), (0.0, 90.0)])
    assert found == pytest.approx(voigt(xx=-25, yy=-25, zz=-10, xy=-5), abs=1e-12)
    found = components(sizes, [(315.0, 0.0), (45.0, 0.0), (0.0, 90.0)])
    assert found == pytest.approx(voigt(xx=-25, yy=-25, zz=-10, xy=5), abs=1e-12)


@pytest.mark.parametrize(("trend", "sign"), [(0.0, 1.0), (180.0, -1.0)])
def test_an_axis_that_plunges_north_makes_yz(trend, sign):
    """a plunges by 30 degrees, c by 60 on the other side: as y grows along a, z falls, so yz = -(a - c) sin cos."""
    a, b, c, cos, sin = -40.0, -25.0, -20.0, np.cos(np.radians(30)), np.sin(np.radians(30))
    expected = voigt(
        xx=b, yy=a * cos**2 + c * sin**2, zz=a * sin**2 + c * cos**2, yz=-sign * (a - c) * sin * cos
    )  # fmt: skip
    for axes in ([(trend, 30.0), (90.0, 0.0), (trend + 180.0, 60.0)], [(trend, 30.0), None, (trend + 180.0, 60.0)]):
        assert components((a, b, c), axes) == pytest.approx(expected, abs=1e-12)


@given(st.floats(-360, 360), st.floats(-89, 89), st.floats(0, 360), st.sampled_from([None, 0, 1, 2]))
def test_any_rotation_keeps_the_sizes_and_their_axes(trend, plunge, turn, missing):
    """A frame that is turned about its first axis; one axis of the three may follow from the others."""
    t, p, r = np.radians([trend, plunge, turn])
    first = np.array([np.sin(t) * np.cos(p), np.cos(t) * np.cos(p), -np.sin(p)])
    level = np.array([np.cos(t), -np.sin(t), 0.0])
    second = np.cos(r) * level + np.sin(r) * np.cross(first, level)
    frame, sizes = [first, second, np.cross(first, second)], (-41.0, -23.0, -17.0)
    axes: list[Axis] = [
        (float(np.degrees(np.arctan2(x, y))), float(np.degrees(-np.arcsin(np.clip(z, -1, 1))))) for x, y, z in frame
    ]
    if missing is not None:
        axes[missing] = None
    tensor = tensor_from_voigt(components(sizes, axes))
    expected = sum(size * np.outer(axis, axis) for size, axis in zip(sizes, frame, strict=True))
    np.testing.assert_allclose(tensor, expected, atol=1e-6)  # of MPa: arcsin loses digits at 90 degrees


def test_rounded_directions_keep_the_sizes():
    """Directions are rounded to degrees; the sizes are the eigenvalues of the stress."""
    found = components((-42.1, -28.9, -23.0), [(180.0, 16.0), (68.0, 52.0), (280.0, 33.0)])
    np.testing.assert_allclose(np.linalg.eigvalsh(tensor_from_voigt(found)), [-42.1, -28.9, -23.0], rtol=1e-12)


def test_equal_stresses_have_no_shear_in_any_direction():
    found = components((-30.0, -30.0, -30.0), [(37.0, 21.0), None, (127.0, 0.0)])
    assert found == pytest.approx(voigt(xx=-30, yy=-30, zz=-30), abs=1e-12)


UP, EAST, NORTH = {"plunge": "90 deg"}, {"trend": "90 deg", "plunge": "0 deg"}, {"trend": "0 deg", "plunge": "0 deg"}
SIZE = {"constant": "-30 MPa"}


@pytest.mark.parametrize(
    ("axes", "line"),
    [
        ([NORTH, EAST, {"trend": "0 deg", "plunge": "86 deg"}], r"principal\.sigma_3: its axis and that of sigma_1 "),
        ([NORTH, NORTH, UP], r"principal\.sigma_2: its axis .* are 0\.0 degrees apart; .* within 3 deg"),
        ([NORTH, {"trend": "180 deg", "plunge": "0 deg"}, UP], r"principal\.sigma_2: its axis .* are 0\.0 degrees"),
        ([NORTH, {}, {}], r"principal\.sigma_3: give trend and plunge, .*; sigma_2 has none"),
        ([{}, EAST, {}], r"principal\.sigma_3: give trend and plunge"),
        ([{"trend": "0 deg"}, EAST, UP], r"principal\.sigma_1\.plunge: missing; give 0 deg for a horizontal axis"),
        ([{"plunge": "10 deg"}, EAST, UP], r"principal\.sigma_1\.trend: missing"),
        ([NORTH | {"plunge": "91 deg"}, EAST, UP], r"principal\.sigma_1\.plunge: 91 deg is out of range"),
        ([NORTH | {"plunge": 0}, EAST, UP], r"principal\.sigma_1\.plunge: 0 has no unit"),
    ],
)  # fmt: skip
def test_axes_that_are_none_are_one_line(axes, line):
    section = {f"sigma_{number}": SIZE | axis for number, axis in enumerate(axes, 1)}
    with pytest.raises(InputError, match=rf"^insitu_stress\.{line}") as refused:
        InsituSettings.read({"principal": section}, "insitu_stress")
    assert len(refused.value.lines) == 1


@pytest.mark.parametrize("tilt", [2.9, -2.9])
def test_axes_within_the_tolerance_are_taken(tilt):
    axes = [(0.0, 0.0), (90.0, 0.0), (0.0, 90.0 - abs(tilt))]
    found = tensor_from_voigt(components((-30.0, -20.0, -10.0), axes))
    np.testing.assert_allclose(np.linalg.eigvalsh(found), [-30, -20, -10], rtol=1e-12)


@pytest.mark.parametrize(
    ("section", "line"),
    [
        ({}, "insitu_stress.constant: missing key"),
        ({"gradient": {"zz": "-0.027 MPa/m"}}, "insitu_stress.constant: missing key"),
        ({"principal": {"sigma_1": NORTH | SIZE, "sigma_2": SIZE | EAST}}, "principal.sigma_3: missing key"),
        ({"principal": {f"sigma_{n}": SIZE for n in "123"} | {"sigma_1": NORTH}}, "sigma_1: has no size"),
        (
            {"constant": {}, "principal": {"sigma_1": NORTH | SIZE, "sigma_2": EAST | SIZE, "sigma_3": UP | SIZE}},
            "insitu_stress.principal: stands beside components",
        ),
    ],
)
def test_a_stress_in_no_form_or_in_two_is_refused(section, line):
    with pytest.raises(InputError) as refused:
        InsituSettings.read(section, "insitu_stress")
    assert line in refused.value.lines[0]
    assert len(refused.value.lines) == 1
