"""Prisms whose outlines are lines of a drawing."""

import logging

import numpy as np
import pytest

from common.errors import InputError
from mpm_core.geometry.inside import contains
from tests.geometry.drawings import add_box, drawing, solid_of, square


@pytest.mark.parametrize("kind", ["flag", "repeated", "3-D"])
def test_a_prism_takes_its_outline_from_a_drawing(tmp_path, kind):
    """With heights of its own, or standing on the polyline; in feet; another layer's outline beside it."""
    corners = [(100, 100), (200, 100), (200, 150), (100, 150)]

    def add(document, space):
        space.add_lwpolyline([(0, 0), (1, 0), (1, 1)], close=True, dxfattribs={"layer": "OTHER"})
        on = {"layer": "STOPE"}
        if kind == "3-D":
            space.add_polyline3d([(*corner, 80) for corner in corners], close=True, dxfattribs=on)
        elif kind == "repeated":
            space.add_lwpolyline([*corners, corners[0]], dxfattribs={**on, "elevation": 80})
        else:
            space.add_lwpolyline(corners, close=True, dxfattribs={**on, "elevation": 80})

    path = drawing(tmp_path / "level.dxf", add, units=2)
    entry = {"shape": "prism", "file": str(path), "layer": "STOPE"}
    foot = 0.3048
    for keys, levels in (({"lower": 20.0, "upper": 30.0}, (20, 30)), ({"height": 10.0}, (80 * foot, 80 * foot + 10))):
        solid = solid_of(entry | keys)
        np.testing.assert_allclose(solid.bounds[:, :2], np.array([[100, 100], [200, 150]]) * foot)
        np.testing.assert_allclose(solid.bounds[:, 2], levels)
        assert solid.volume == pytest.approx(5000 * foot**2 * 10)
    with pytest.raises(InputError, match=r"level\.dxf: stope: has 2 layers: name one by `layer`"):
        solid_of({"shape": "prism", "file": str(path), "height": 10.0})


def test_arcs_of_an_outline_are_chords(tmp_path):
    """Two half circles of 20 m."""
    path = drawing(
        tmp_path / "shaft.dxf", lambda d, s: s.add_lwpolyline([(50, 50, 1), (90, 50, 1)], format="xyb", close=True)
    )
    solid = solid_of({"shape": "prism", "file": str(path), "lower": 0.0, "upper": 1.0})
    assert solid.volume == pytest.approx(np.pi * 400, rel=2e-3)


def test_a_prism_of_a_drawing_without_one_outline_is_refused(tmp_path):
    path = drawing(tmp_path / "a.dxf", add_box)
    with pytest.raises(
        InputError, match=r"excavations\.stope: .*a\.dxf: stope: holds faces but no closed polyline: leave out"
    ):
        solid_of({"shape": "prism", "file": str(path), "height": 10.0})
    with pytest.raises(InputError, match="reads its outline from a DXF polyline"):
        solid_of({"shape": "prism", "file": "b.obj", "height": 10.0})


def outlines(path, *lines, layers=(), elevation=0.0):
    """A drawing of closed polylines [(x, y), ...], all on layer PANELS or each on its own, at one elevation or each."""

    def add(document, space):
        for number, line in enumerate(lines):
            level = elevation if np.isscalar(elevation) else elevation[number]
            on = {"layer": layers[number] if layers else "PANELS", "elevation": level}
            space.add_lwpolyline(line, close=True, dxfattribs=on)

    return str(drawing(path, add, 6))


FLAT_PRISM = {"shape": "prism", "layer": "PANELS", "lower": 10.0, "upper": 15.0}


@pytest.mark.parametrize(
    "line",
    [
        pytest.param([(0, 0), (40, 20), (40, 0), (0, 30)], id="crossing"),
        pytest.param([(0, 0), (20, 20), (40, 40), (40, 0), (20, 20), (0, 40)], id="crossing at a corner"),
        pytest.param(square(0, 0, 40) + square(0, 0, 40), id="twice around"),
        pytest.param([(0, 0), (60, 0), (60, 40), (20, 40), (20, 10), (40, 10), (40, 60), (0, 60)], id="over itself"),
    ],
)
def test_an_outline_that_crosses_itself_is_refused(tmp_path, line):
    """It was mined: some places by the sign of one lobe, some twice. Far from the origin, too."""
    for shift in (0.0, 512000.0):
        path = outlines(tmp_path / "level.dxf", [(x + shift, y + 2 * shift) for x, y in line])
        with pytest.raises(
            InputError, match=r"level\.dxf: stope: layer PANELS: crosses itself near [-\d.]+, [-\d.]+ m: put its points"
        ) as caught:
            solid_of({**FLAT_PRISM, "file": path, "offset": [-shift, -2 * shift, 0.0]})
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "line",
    [
        pytest.param([(0, 0), (100, 0), (100, 100), (50, 0), (0, 100)], id="touching at a corner"),
        pytest.param(
            [
                (0, 0),
                (100, 0),
                (100, 100),
                (0, 100),
                (0, 50),
                (30, 50),
                (30, 70),
                (60, 70),
                (60, 50),
                (30, 50),
                (0, 50),
            ],
            id="a hole at the end of a slit",
        ),
        pytest.param([(0, 0), (100, 0), (150, 0), (100, 0), (100, 100), (0, 100)], id="a spike"),
    ],
)
def test_an_outline_that_touches_itself_is_taken(tmp_path, line):
    solid = solid_of({**FLAT_PRISM, "file": outlines(tmp_path / "level.dxf", line)})
    area = abs(sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(line, line[1:] + line[:1], strict=True))) / 2
    assert solid.volume == pytest.approx(5 * area, rel=2e-3)


@pytest.mark.parametrize(
    ("lines", "area", "inside", "outside"),
    [
        pytest.param([square(0, 0, 40), square(60, 0, 20)], 2000, (70, 10), (50, 10), id="apart"),
        pytest.param([square(0, 0, 40), square(40, 0, 20)], 2000, (50, 10), (50, 30), id="side by side"),
        pytest.param([square(0, 0, 40), square(40, 40, 20)], 2000, (50, 50), (50, 30), id="touching at a corner"),
        pytest.param([square(10, 10, 20), square(0, 0, 40)], 1200, (5, 5), (20, 20), id="one within the other"),
        pytest.param([square(0, 10, 20), square(0, 0, 40)], 1200, (5, 5), (10, 20), id="within, at its side"),
        pytest.param(
            [square(0, 0, 40), square(10, 10, 20), square(15, 15, 10)], 1300, (20, 20), (12, 12), id="within a hole"
        ),
        pytest.param([square(0, 0, 40), square(0, 0, 40)[::-1], square(50, 0, 9)], 1681, (5, 5), (45, 5), id="twice"),
        pytest.param([square(20 * n, 0, 20, 50) for n in range(7)], 7000, (130, 5), (145, 5), id="seven panels"),
    ],
)
def test_outlines_of_one_layer_are_prisms_and_holes(tmp_path, caplog, lines, area, inside, outside):
    """Side by side each is a prism, one within another a hole."""
    with caplog.at_level(logging.WARNING):
        solid = solid_of({**FLAT_PRISM, "file": outlines(tmp_path / "level.dxf", *lines)})
    assert solid.volume == pytest.approx(5 * area, rel=1e-9)
    assert contains(solid, np.array([[*inside, 12.0], [*outside, 12.0], [*inside, 16.0]])).tolist() == [
        True,
        False,
        False,
    ]
    assert ("layer PANELS: 1 of " in caplog.text) == (area in (1200, 1300))


@pytest.mark.parametrize("other", [square(20, 20, 40), square(20, 0, 40), square(-10, 10, 60, 10)])
def test_outlines_that_overlap_are_refused(tmp_path, other):
    path = outlines(tmp_path / "level.dxf", square(0, 0, 40), other)
    with pytest.raises(InputError, match=r"level\.dxf: stope: layer PANELS: two closed polylines overlap near .* draw"):
        solid_of({**FLAT_PRISM, "file": path})


def test_each_outline_has_its_own_elevation(tmp_path):
    """Panels at 10 and 20 m; levels above one another overlap in plan alone; a hole keeps to its outline."""
    standing = {"shape": "prism", "layer": "PANELS", "height": 4.0}
    path = outlines(tmp_path / "a.dxf", square(0, 0, 40), square(60, 0, 20), elevation=(10.0, 20.0))
    solid = solid_of({**standing, "file": path})
    assert solid.volume == pytest.approx(8000)
    points = np.array([[5, 5, 12], [5, 5, 22], [65, 5, 22], [65, 5, 12]], float)
    assert contains(solid, points).tolist() == [True, False, True, False]
    levels = outlines(tmp_path / "b.dxf", square(0, 0, 40), square(10, 0, 40), square(0, 0, 40), elevation=(0, 10, 20))
    assert solid_of({**standing, "file": levels}).volume == pytest.approx(3 * 6400)
    ring = outlines(tmp_path / "c.dxf", square(0, 0, 40), square(10, 10, 20), elevation=10.0)
    assert solid_of({**standing, "file": ring}).volume == pytest.approx(4800)
