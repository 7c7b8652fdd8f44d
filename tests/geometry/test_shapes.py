"""Shapes enclose the volume that their numbers say, look outward, and complain by name."""

from itertools import pairwise

import numpy as np
import pytest

from common.errors import InputError
from mpm_core.geometry import Solid, build_shape, contains
from mpm_core.geometry.shapes import SHAPES, shape_of, solid_of
from mpm_core.geometry.shapes.prism import Prism

RAMP = [[0, 0, 0], [40, 0, 0], [70, 30, 0], [70, 80, 0]]
BEND_3D = [
    ({"shape": "box", "lower": [1, 2, 3], "upper": [4, 6, 8]}, 60),
    ({"shape": "sphere", "center": [5, 5, 5], "radius": 6}, 4 / 3 * np.pi * 216),
    ({"shape": "cylinder", "start": [0, 0, 0], "end": [3, 4, 12], "radius": 2}, np.pi * 4 * 13),
    ({"shape": "tunnel", "path": [[0, 0, 0], [30, 40, 10]], "width": 5, "height": 4}, 20 * np.sqrt(2600)),
    ({"shape": "tunnel", "path": RAMP, "width": 5, "height": 4}, 20 * (90 + np.hypot(30, 30))),
    (
        {"shape": "tunnel", "path": RAMP, "width": 4, "height": 5, "profile": "arched"},
        (12 + 2 * np.pi) * (90 + np.hypot(30, 30)),
    ),
    (
        {"shape": "tunnel", "path": RAMP[:2], "width": 4, "height": 2, "profile": "arched"},
        2 * np.pi * 40,
    ),
    ({"shape": "prism", "polygon": [[0, 0], [9, 0], [9, 9], [6, 9], [6, 3], [0, 3]], "lower": -2, "upper": 5}, 45 * 7),
    ({"shape": "prism", "polygon": [[0, 0], [0, 8], [8, 8], [8, 0]], "base": [0, 0, 4, 4], "top": [3, 3, 7, 7]}, 192),
]


@pytest.mark.parametrize(("specification", "volume"), BEND_3D)
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_shape_has_the_closed_form_volume_here_and_in_mine_coordinates(specification, volume, offset):
    """Curved facets are scaled so that no part of the volume is lost; at 1e6 m a coordinate is good to 1e-10 m."""
    shifted = dict(specification, name="x")
    if offset:
        for key in ("lower", "upper", "center", "start", "end", "path", "polygon"):
            if key in shifted and np.ndim(shifted[key]):
                shifted[key] = (np.array(shifted[key]) + offset).tolist()
    solid = build_shape(shifted, 3)
    assert solid.volume == pytest.approx(volume, rel=1e-12 if offset == 0 else 1e-8)
    assert solid.signed_volume > 0
    assert solid.is_closed


@pytest.mark.parametrize(("specification", "volume"), BEND_3D)
def test_openings_and_extent_hold_the_surface(specification, volume):
    """A tunnel's openings are its stretches, and rectangular."""
    shape = shape_of(specification, 3, "x")
    solid = solid_of(shape, 3, "x")
    lower, upper = shape.extent(3)
    slack = 1e-3 * (upper - lower)  # facets of curved surfaces reach beyond them
    assert ((solid.bounds[0] >= lower - slack) & (solid.bounds[1] <= upper + slack)).all()
    openings = list(shape.openings(3))
    assert len(openings) == len(specification.get("path", [0, 0])) - 1
    exact = specification.get("profile") != "arched"
    assert sum(one.volume for one in openings) == pytest.approx(volume, rel=1e-9 if exact else 0.3)
    assert all(np.prod(one.sides) >= (1 - 1e-9) * one.volume for one in openings)


def test_every_shape_is_tried():
    assert {keys["shape"] for keys, _ in BEND_3D} == set(SHAPES[3])


@pytest.mark.parametrize(
    ("specification", "area"),
    [
        ({"shape": "box", "lower": [1, 2], "upper": [4, 6]}, 12),
        ({"shape": "circle", "center": [5, 5], "radius": 3}, 9 * np.pi),
        ({"shape": "sphere", "center": [5, 5], "radius": 3}, 9 * np.pi),
        ({"shape": "polygon", "points": [[0, 0], [0, 4], [3, 4], [3, 0], [0, 0]]}, 12),
    ],
)
def test_plane_shape_has_the_closed_form_area(specification, area):
    solid = build_shape(dict(specification, name="x"), 2)
    assert solid.signed_volume == pytest.approx(area, rel=1e-12)
    assert solid.is_closed


def test_round_shapes_stay_within_a_thousandth_of_their_radius():
    """An exact volume alone could hide a coarse shape: vertices and facet centres are within 0.1 % of it."""
    sphere = build_shape({"name": "s", "shape": "sphere", "center": [0, 0, 0], "radius": 1}, 3)
    for points in (sphere.vertices, sphere.vertices[sphere.facets].mean(axis=1)):
        np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1, atol=1e-3)
    circle = build_shape({"name": "c", "shape": "circle", "center": [0, 0], "radius": 1}, 2)
    for points in (circle.vertices, circle.vertices[circle.facets].mean(axis=1)):
        np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1, atol=1e-3)


def test_tunnel_stands_upright_on_its_path():
    """A decline: points above the path are in the tunnel, below the floor and beside the walls are not."""
    path = np.array([[0.0, 0, 0], [70, 0, -10], [70, 70, -20]])
    tunnel = build_shape({"name": "t", "shape": "tunnel", "path": path, "width": 5, "height": 4}, 3)
    along = np.concatenate([path[0] + np.linspace(0.1, 0.9, 9)[:, None] * (path[1] - path[0]),
                            path[1] + np.linspace(0.1, 0.9, 9)[:, None] * (path[2] - path[1])])  # fmt: skip
    for height, beside, expected in [(0.1, 0, True), (3.9, 0, True), (-0.1, 0, False), (4.2, 0, False),
                                     (2, 2.4, True), (2, -2.4, True), (2, 2.6, False), (2, -2.6, False)]:  # fmt: skip
        side = np.repeat([[0.0, beside, 0], [beside, 0, 0]], 9, axis=0)
        assert (contains(tunnel, along + side + [0, 0, height]) == expected).all(), (height, beside)


@pytest.mark.parametrize(
    "path",
    [
        [[0, 0, 0], [80, 0, 0], [0, 8, 0]],
        [[3 * np.cos(a), 3 * np.sin(a), 0] for a in np.linspace(0, 3, 40)],
        [[0.6 * np.cos(a), 0.6 * np.sin(a), 0] for a in np.linspace(0, 3, 40)],
        [[s, 0.05 * (-1) ** n, 0.03 * n] for n, s in enumerate(np.linspace(0, 40, 161))],
    ],
    ids=["hairpin", "curve", "curve tighter than the width", "survey noise"],
)
def test_tunnel_of_any_bends_holds_its_own_centre_line(path):
    """Too sharp for a mitre or too short for one: the stretches overlap, and nothing on the way is left out."""
    path = np.array(path, dtype=float)
    tunnel = build_shape({"name": "t", "shape": "tunnel", "path": path.tolist(), "width": 5, "height": 4}, 3)
    share = np.linspace(0, 1, 7)[:, None]
    line = np.concatenate([a + share * (b - a) for a, b in pairwise(path)])
    line = line[(np.linalg.norm(line - path[0], axis=1) > 0.1) & (np.linalg.norm(line - path[-1], axis=1) > 0.1)]
    assert contains(tunnel, line + np.array([0, 0, 2])).all()
    assert not contains(tunnel, line - [0, 0, 0.6]).any()
    assert tunnel.is_closed


def test_tunnel_corner_has_no_notch_where_stretches_overlap():
    """Right angle, second stretch shorter than the mitre: the outer corner is rock removed all the same."""
    path = [[0, 0, 0], [40, 0, 0], [40, 2, 0]]
    tunnel = build_shape({"name": "t", "shape": "tunnel", "path": path, "width": 5, "height": 4}, 3)
    assert contains(tunnel, [[42.4, -2.4, 2.0], [42.4, 1.9, 2.0]]).all()


def test_self_crossing_polygon_is_a_prism_of_its_two_loops():
    """A figure of eight of unequal loops, which check() refuses: both wind by one, in opposite senses, and both are
    inside."""
    polygon = [[0, 0], [8, 6], [8, 0], [0, 4]]
    prism = solid_of(Prism.of({"polygon": polygon, "lower": 0, "upper": 2}), 3, "p")
    assert prism.is_closed
    assert contains(prism, [[0.5, 2, 1], [7.5, 2, 1], [3.2, 3.9, 1], [3.2, 0.5, 1]]).tolist() == [
        True,
        True,
        False,
        False,
    ]


@pytest.mark.parametrize(
    ("dimension", "specification", "message"),
    [
        (3, {"shape": "egg"}, "stope.shape: 'egg' is not one of the 3-D shapes box"),
        (2, {"shape": "tunnel"}, "stope.shape: 'tunnel' is not one of the 2-D shapes box"),
        (3, {"shape": "box", "lower": [0, 0, 0]}, "stope.upper: missing"),
        (3, {"shape": "box", "lower": [0, 0], "upper": [1, 1, 1]}, "stope.lower: 2 coordinates; this scene has 3"),
        (
            2,
            {"shape": "box", "lower": [0, 0, 0], "upper": [1, 1, 1]},
            "stope.lower: 3 coordinates; this scene has 2",
        ),
        (3, {"shape": "box", "lower": [0, 0, 0], "upper": [1, 0, 1]}, "stope.upper: upside down"),
        (3, {"shape": "box", "lower": [0, 0, "deep"], "upper": [1, 1, 1]}, "stope.lower[2]: 'deep' is not a number"),
        (3, {"shape": "sphere", "center": [0, 0, float("nan")], "radius": 1}, "stope.center[2]: nan is out of range"),
        (3, {"shape": "sphere", "center": [0, 0, 0], "radius": -1}, "stope.radius: -1 is out of range"),
        (3, {"shape": "cylinder", "start": [1, 1, 1], "end": [1, 1, 1], "radius": 1}, "stope.end: the same point"),
        (
            3,
            {"shape": "tunnel", "path": [[1, 1, 1], [1, 1, 1]], "width": 1, "height": 1},
            "stope.path: the same point",
        ),
        (
            3,
            {"shape": "tunnel", "path": [[0, 0, 0], [0, 0, 9]], "width": 1, "height": 1},
            "stope.path: stretch 1 is too",
        ),
        (
            3,
            {"shape": "tunnel", "path": [[0, 0, 0], [9, 0, 0]], "width": 0, "height": 1},
            "stope.width: 0 is out",
        ),
        (
            3,
            {"shape": "tunnel", "path": [[0, 0, 0], [9, 0, 0]], "width": 1, "height": 1, "profile": "oval"},
            "stope.profile: 'oval' is not one of rectangular, arched",
        ),
        (
            3,
            {"shape": "tunnel", "path": [[0, 0, 0], [9, 0, 0]], "width": 4, "height": 1, "profile": "arched"},
            "stope.height: an arched profile needs at least half its width",
        ),
        (
            3,
            {"shape": "prism", "polygon": [[0, 0], [1, 1], [2, 2]], "lower": 0, "upper": 1},
            "stope.polygon: needs three",
        ),
        (
            3,
            {"shape": "prism", "polygon": [[0, 0], [1, 0], [1, 1]], "lower": 1, "upper": 1},
            "stope.upper: upside down",
        ),
        (
            3,
            {"shape": "prism", "polygon": [[0, 0], [1, 0], [1, 1]], "base": [0, 0], "top": 1},
            "stope.top: 1 is not of type 'array'",
        ),
        (2, {"shape": "polygon", "points": [[0, 0], [1, 1], [0, 0]]}, "stope.points: needs three points"),
    ],
)
def test_wrong_shape_is_refused_by_name_and_key(dimension, specification, message):
    with pytest.raises(InputError) as caught:
        build_shape(dict(specification, name="stope"), dimension)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ("vertices", "facets", "message"),
    [
        (np.zeros((3, 3)), np.zeros((0, 3)), "has no facets"),
        (np.zeros((3, 3)), [[0, 1, 3]], "do not exist"),
        ([[0, 0, 0], [1, 0, 0], [0, np.inf, 0]], [[0, 1, 2]], "not finite"),
    ],
)
def test_solid_refuses_what_is_no_surface(vertices, facets, message):
    with pytest.raises(InputError, match=message):
        Solid("stope", vertices, facets)


def test_closed_means_every_edge_is_passed_both_ways():
    """A missing facet or a flipped one opens the surface; corners repeated at one place (as in STL) do not."""
    box = build_shape({"name": "b", "shape": "box", "lower": [0, 0, 0], "upper": [1, 1, 1]}, 3)
    soup = Solid("b", box.vertices[box.facets].reshape(-1, 3), np.arange(36).reshape(12, 3))
    flipped = box.facets.copy()
    flipped[0] = flipped[0, ::-1]
    assert soup.is_closed
    assert not Solid("b", box.vertices, box.facets[1:]).is_closed
    assert not Solid("b", box.vertices, flipped).is_closed
