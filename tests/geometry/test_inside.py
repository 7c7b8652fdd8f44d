"""Points inside solids that are whole, broken, inverted, doubled or far away."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpm_core.geometry import Solid, build_shape, contains
from mpm_core.geometry import inside as inside_module
from mpm_core.geometry.crossing import box_around, in_box
from tests.geometry.solid_twins import joined, moved, rotation, winding_number

BOX = build_shape({"name": "box", "shape": "box", "lower": [-1, -2, -3], "upper": [1, 2, 3]}, 3)
BALL = build_shape({"name": "ball", "shape": "sphere", "center": [0, 0, 0], "radius": 3}, 3)
TUNNEL = build_shape(
    {"name": "t", "shape": "tunnel", "path": [[-4, -4, -1], [0, 0, -1], [5, 0, 0]], "width": 2, "height": 2,
     "profile": "arched"}, 3)  # fmt: skip
POLYGON = build_shape({"name": "p", "shape": "polygon", "points": [[-4, -4], [4, -3], [0, 0], [3, 4], [-3, 3]]}, 2)
SOLIDS = {"box": BOX, "tunnel": TUNNEL, "ball": BALL, "polygon": POLYGON}


def scatter(solid: Solid, count: int, seed: int = 0) -> np.ndarray:
    """Points in and a little around the solid's bounding box."""
    lower, upper = solid.bounds
    return lower + (upper - lower) * np.random.default_rng(seed).uniform(-0.2, 1.2, (count, solid.dimension))


@given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]), count=st.integers(1, 40))
def test_boxes_are_those_of_all_axes_at_once(seed, dimension, count):
    """Sides and corners of a box count as in it; a point that is no number is in none."""
    points = np.random.default_rng(seed).integers(-3, 4, (count, dimension)).astype(float)
    lower, upper = box_around(points)
    np.testing.assert_array_equal([lower, upper], [points.min(axis=0), points.max(axis=0)])
    assert in_box(points, lower, upper).all()
    smaller = np.append(points, np.full((1, dimension), np.nan), axis=0)
    expected = ((smaller >= -1.0) & (smaller <= 2.0)).all(axis=1)
    np.testing.assert_array_equal(in_box(smaller, np.full(dimension, -1.0), np.full(dimension, 2.0)), expected)


@pytest.mark.parametrize("name", SOLIDS)
def test_contains_agrees_with_the_textbook_winding_number(name):
    """By exact sums and, for the ball's 20480 facets, by libigl's tree (0.5 %, here never near 1/2)."""
    solid = SOLIDS[name]
    points = scatter(solid, 300 if name == "ball" else 5000)
    np.testing.assert_array_equal(contains(solid, points), np.abs(winding_number(solid, points)) > 0.5)


def test_exact_sum_and_tree_agree(monkeypatch):
    points = scatter(BALL, 2000)
    by_tree = contains(BALL, points)
    monkeypatch.setattr(inside_module, "MAX_EXACT_FACETS", len(BALL.facets))
    np.testing.assert_array_equal(contains(BALL, points), by_tree)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    scale=st.floats(1e-3, 1e4),
    shift=st.tuples(*[st.floats(-1e7, 1e7)] * 3),
    inverted=st.booleans(),
)
def test_box_anywhere_of_any_size_and_turn_holds_what_its_three_intervals_say(seed, scale, shift, inverted):
    """Points within 1e-6 of the size (or the round-off of the coordinates) of the surface are left out."""
    turn = rotation(seed)
    solid = moved(BOX, turn * scale, np.array(shift))
    if inverted:
        solid = Solid("box", solid.vertices, solid.facets[:, ::-1])
    local = np.random.default_rng(seed).uniform(-4, 4, (200, 3))
    excess = (np.abs(local) - [1, 2, 3]).max(axis=1)
    clear = np.abs(excess) > 1e-6 + 1e-8 / scale
    found = contains(solid, local @ (turn * scale).T + np.array(shift))
    np.testing.assert_array_equal(found[clear], (excess < 0)[clear])


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), scale=st.floats(0.1, 1e3), shift=st.tuples(*[st.floats(-1e6, 1e6)] * 3))
def test_ball_anywhere_holds_what_its_radius_says(seed, scale, shift):
    """The facets lie within 0.1 % of the sphere: points nearer than 0.2 % are left out."""
    solid = moved(BALL, rotation(seed) * scale, np.array(shift))
    local = np.random.default_rng(seed).uniform(-3.5, 3.5, (500, 3))
    radius = np.linalg.norm(local, axis=1) / 3
    clear = np.abs(radius - 1) > 2e-3
    np.testing.assert_array_equal(contains(solid, local * scale + np.array(shift))[clear], (radius < 1)[clear])


@pytest.mark.parametrize("solid", [BOX, BALL], ids=["box", "ball"])
def test_inverted_doubled_or_overlapping_makes_no_difference(solid):
    points = scatter(solid, 3000)
    expected = contains(solid, points)
    inverted = Solid("i", solid.vertices, solid.facets[:, ::-1])
    doubled = Solid("d", solid.vertices, np.concatenate([solid.facets, solid.facets]))
    part_doubled = Solid("d", solid.vertices, np.concatenate([solid.facets, solid.facets[::7]]))
    overlapping = joined(solid, moved(solid, shift=[0.5, 0.25, 0.0]))
    for other in (inverted, doubled, part_doubled):
        np.testing.assert_array_equal(contains(other, points), expected)
    np.testing.assert_array_equal(contains(overlapping, points), expected | contains(solid, points - [0.5, 0.25, 0.0]))


def test_a_hole_of_a_few_triangles_changes_nothing_away_from_it():
    """Four neighbouring facets of a ball are missing. Beyond a tenth of the radius from them the ball is as before."""
    place = BALL.vertices[BALL.facets].mean(axis=1)
    order = np.argsort(np.linalg.norm(place - place[1000], axis=1))
    broken = Solid("b", BALL.vertices, np.delete(BALL.facets, order[:4], axis=0))
    assert not broken.is_closed
    points = scatter(BALL, 5000)
    away = np.linalg.norm(points - place[1000], axis=1) > 0.3
    np.testing.assert_array_equal(contains(broken, points)[away], contains(BALL, points)[away])


def test_open_topped_box_is_closed_by_the_winding_number():
    """Without its upper face (2 x 4 m) a 6 m high box still holds its middle; nothing outside becomes inside."""
    up = (BOX.vertices[BOX.facets][:, :, 2] == 3).all(axis=1)
    broken = Solid("b", BOX.vertices, BOX.facets[~up])
    points = scatter(BOX, 4000)
    found, whole = contains(broken, points), contains(BOX, points)
    assert not (found & ~whole).any()
    assert found[whole & (points[:, 2] < 1.5)].all()


def test_boxes_that_touch_in_a_face_edge_or_corner_hold_their_union():
    touching = joined(
        BOX, moved(BOX, shift=[2.0, 0, 0]), moved(BOX, shift=[4.0, 4.0, 0]), moved(BOX, shift=[6.0, 8.0, 6.0])
    )
    points = scatter(touching, 8000)
    expected = np.zeros(len(points), dtype=bool)
    for shift in ([0, 0, 0], [2, 0, 0], [4, 4, 0], [6, 8, 6]):
        expected |= (np.abs(points - shift) < [1, 2, 3]).all(axis=1)
    np.testing.assert_array_equal(contains(touching, points), expected)


@pytest.mark.parametrize("offset", [1e5, 1e6, 1e7])
@pytest.mark.parametrize("name", SOLIDS)
def test_far_from_the_origin_is_as_near_it(name, offset):
    """Offsets and points are multiples of 2^-20 m, so that shifting rounds nothing: the answers must be the same."""
    solid = SOLIDS[name]
    near = Solid(name, np.round(solid.vertices * 2**20) / 2**20, solid.facets)
    points = np.round(scatter(near, 2000) * 2**20) / 2**20
    np.testing.assert_array_equal(contains(moved(near, shift=offset), points + offset), contains(near, points))


def test_points_on_corners_edges_or_nowhere_are_answered():
    """On the surface either answer will do, NaN is outside; one such point does not spoil the others of its block."""
    points = np.concatenate([BOX.vertices, [[1, 2, 0.3], [1, 0, 0], [np.nan, 0, 0], [0, 0, 0], [0, 0, 5]]])
    assert contains(BOX, points)[-3:].tolist() == [False, True, False]
    assert contains(BOX, np.zeros((0, 3))).shape == (0,)


def test_answers_do_not_depend_on_order_or_number_of_points():
    points = scatter(TUNNEL, 777)
    order = np.random.default_rng(1).permutation(len(points))
    np.testing.assert_array_equal(contains(TUNNEL, points[order]), contains(TUNNEL, points)[order])
    np.testing.assert_array_equal(contains(TUNNEL, points[:5]), contains(TUNNEL, points)[:5])
