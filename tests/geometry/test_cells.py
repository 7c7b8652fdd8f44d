"""Which cells are crossed or inside, and how much of them: against brute force, and where grid and solid align."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mpm_core.geometry import (
    CROSSED,
    INSIDE,
    OUTSIDE,
    Outside,
    Solid,
    build_shape,
    classify_cells,
    contains,
    popcount,
    sample_mask,
    solids,
)
from mpm_core.geometry import inside as inside_module
from tests.geometry import solid_twins
from tests.geometry.solid_twins import cells, joined, moved, rotation

BOX = build_shape({"name": "box", "shape": "box", "lower": [-1, -2, -3], "upper": [1, 2, 3]}, 3)
ORIGIN = np.zeros(3)


def sampled_volume(solid: Solid, origin: np.ndarray, size: float, index: np.ndarray) -> float:
    """Volume as the grid sees it: cells inside, and the shares of crossed ones."""
    kind = classify_cells(solid, origin, size, index)
    shares = popcount(sample_mask(solid, origin, size, index[kind == CROSSED])).sum() / 64
    return ((kind == INSIDE).sum() + shares) * size**solid.dimension


@settings(max_examples=12, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    stretch=st.tuples(*[st.floats(0.02, 2.0)] * 3),
    shift=st.tuples(*[st.floats(2.0, 5.0)] * 3),
)
def test_classification_is_that_of_clipping_every_facet_by_every_cell(seed, stretch, shift):
    """Turned boxes from slabs thinner than a cell to bars that leave the block of cells."""
    solid = moved(BOX, rotation(seed) * stretch, np.array(shift))
    index = cells(6, 6, 6)
    np.testing.assert_array_equal(
        classify_cells(solid, ORIGIN, 1.0, index), solid_twins.classify(solid, ORIGIN, 1.0, index)
    )


@settings(max_examples=15, deadline=None)
@given(points=st.lists(st.tuples(st.floats(-1, 11), st.floats(-1, 11)), min_size=3, max_size=6, unique=True))
def test_plane_classification_is_that_of_clipping(points):
    ring = np.arange(len(points))
    solid = Solid("p", points, np.column_stack([ring, np.roll(ring, -1)]))
    index = cells(10, 10)
    np.testing.assert_array_equal(
        classify_cells(solid, np.zeros(2), 1.0, index), solid_twins.classify(solid, np.zeros(2), 1.0, index)
    )


@pytest.mark.parametrize("offset", [0.0, 1e5, 1e6, 1e7])
@pytest.mark.parametrize("size", [1.25, 0.1])
@pytest.mark.parametrize("dimension", [2, 3])
def test_aligned_box_is_exactly_its_cells(dimension, size, offset):
    """Faces in cell faces cross nothing, even where offset + 3 * 0.1 is not a number; the sampled volume is exact."""
    lower, upper = np.array([2, 3, 4])[:dimension], np.array([6, 5, 9])[:dimension]
    origin = np.full(dimension, offset)
    corners = {"lower": (origin + lower * size).tolist(), "upper": (origin + upper * size).tolist()}
    solid = build_shape({"name": "b", "shape": "box", **corners}, dimension)
    index = cells(*[11] * dimension)
    kind = classify_cells(solid, origin, size, index)
    expected = ((index >= lower) & (index < upper)).all(axis=1)
    np.testing.assert_array_equal(kind, np.where(expected, INSIDE, OUTSIDE))
    np.testing.assert_array_equal(popcount(sample_mask(solid, origin, size, index)), np.where(expected, 64, 0))


@pytest.mark.parametrize("offset", [1e5, 1e6])
def test_far_from_the_origin_is_as_near_it(offset):
    solid = moved(BOX, rotation(3), np.array([4.0, 4.0, 4.0]))
    near = Solid("b", np.round(solid.vertices * 2**20) / 2**20, solid.facets)
    far, origin, index = moved(near, shift=offset), np.full(3, offset), cells(32, 32, 32)
    np.testing.assert_array_equal(classify_cells(far, origin, 0.25, index), classify_cells(near, ORIGIN, 0.25, index))
    np.testing.assert_array_equal(sample_mask(far, origin, 0.25, index), sample_mask(near, ORIGIN, 0.25, index))


def test_slab_thinner_than_a_cell_crosses_every_cell_on_its_way():
    """A tilted 1 mm seam: no centre, hardly a sample point inside, and yet no cell is missed."""
    solid = moved(BOX, np.diag([4.0, 2.0, 1.7e-4]), np.array([5.0, 5.0, 5.3]))
    tilt = np.array([[1, 0, 0], [0, 1, 0], [0.1, 0.05, 1]])
    solid = moved(solid, tilt)
    index = cells(10, 10, 10)
    crossed = classify_cells(solid, ORIGIN, 1.0, index) == CROSSED
    np.testing.assert_array_equal(crossed, solid_twins.classify(solid, ORIGIN, 1.0, index) == CROSSED)
    columns = {tuple(cell[:2]) for cell in index[crossed]}
    assert columns == {(i, j) for i in range(1, 9) for j in range(1, 9)}


def test_box_within_one_cell_crosses_that_cell_alone():
    solid = moved(BOX, np.eye(3) * 0.05, np.array([3.5, 4.5, 5.5]))
    index = cells(8, 8, 8)
    kind = classify_cells(solid, ORIGIN, 1.0, index)
    assert index[kind != OUTSIDE].tolist() == [[3, 4, 5]]
    assert kind.max() == CROSSED


def test_solid_outside_the_cells_touches_none():
    index = cells(4, 4, 4)
    for shift in ([1e6, 0, 0], [-50, 2, 2], [2, 2, 1e12]):
        far = moved(BOX, shift=np.array(shift, dtype=float))
        assert not classify_cells(far, ORIGIN, 1.0, index).any()
        assert not sample_mask(far, ORIGIN, 1.0, index).any()
    assert classify_cells(BOX, ORIGIN, 1.0, cells(0, 4, 4)).shape == (0,)
    assert sample_mask(BOX, ORIGIN, 1.0, cells(0, 4, 4)).shape == (0,)


def test_solid_that_swallows_the_cells_has_them_all_inside():
    index = cells(4, 4, 4, start=-2)
    assert (classify_cells(moved(BOX, np.eye(3) * 1e5), ORIGIN, 1.0, index) == INSIDE).all()


def test_cells_need_no_order_and_may_be_few():
    """A refined level is a scattered subset of cells: each answer depends on its own cell alone."""
    solid, index = moved(BOX, rotation(5), np.array([4.0, 4.0, 4.0])), cells(16, 16, 16)
    whole, mask = classify_cells(solid, ORIGIN, 0.5, index), sample_mask(solid, ORIGIN, 0.5, index)
    some = np.random.default_rng(0).permutation(len(index))[:500]
    np.testing.assert_array_equal(classify_cells(solid, ORIGIN, 0.5, index[some]), whole[some])
    np.testing.assert_array_equal(sample_mask(solid, ORIGIN, 0.5, index[some]), mask[some])


@pytest.mark.parametrize("dimension", [2, 3])
def test_mask_bits_are_the_sub_cells_in_the_documented_order(dimension):
    """A box over one sub-cell, cell 1 of 3, sets that sub-cell's bit and no other: bit i + 4 j + 16 k (i + 8 j)."""
    edge = {2: 8, 3: 4}[dimension]
    for place in cells(*[edge] * dimension)[::5]:
        lower = 1 + place / edge
        solid = build_shape({"name": "b", "shape": "box", "lower": lower, "upper": lower + 1 / edge}, dimension)
        mask = sample_mask(solid, np.zeros(dimension), 1.0, cells(*[3] * dimension))
        expected = np.uint64(1) << np.uint64((place * edge ** np.arange(dimension)).sum())
        assert np.unique(mask).tolist() == [0, expected]
        assert (mask != 0).sum() == 1


def test_masks_are_contains_at_the_sample_points_by_sum_and_by_tree(monkeypatch):
    ball = build_shape({"name": "s", "shape": "sphere", "center": [3.1, 3.2, 3.3], "radius": 2}, 3)
    index = cells(6, 6, 6)
    mask = sample_mask(ball, ORIGIN, 1.0, index)
    points = (index[:, None, :] + inside_module.sample_points(3).T).reshape(-1, 3)
    bits = (mask[:, None] >> np.arange(64, dtype=np.uint64)) & np.uint64(1)
    np.testing.assert_array_equal(bits.ravel().astype(bool), contains(ball, points))
    few = build_shape({"name": "c", "shape": "cylinder", "start": [1, 1, 1], "end": [5, 5, 5], "radius": 1}, 3)
    by_sum = sample_mask(few, ORIGIN, 1.0, index)
    monkeypatch.setattr(inside_module, "MAX_EXACT_FACETS", 1)
    monkeypatch.setattr(inside_module, "MAX_TREE_POINTS", 64 * 7)
    np.testing.assert_array_equal(sample_mask(few, ORIGIN, 1.0, index), by_sum)


def lattice_box(lower, upper, roughness: float = 0.0) -> Solid:
    """A box of 3072 triangles, too many to be summed for every sample point, its vertices moved at random."""
    box = trimesh.creation.box(bounds=[lower, upper]).subdivide().subdivide().subdivide().subdivide()
    shift = roughness * np.random.default_rng(0).normal(size=box.vertices.shape)
    return Solid("b", box.vertices + shift, box.faces)


@pytest.mark.parametrize("inverted", [False, True])
def test_summing_only_near_facets_changes_no_bit(monkeypatch, inverted):
    """A rough closed solid, its surface folded within cells: the same masks as by summing all facets."""
    solid = lattice_box([10, 10, 10], [42, 34, 50], roughness=0.5)
    solid = Solid("b", solid.vertices, solid.facets[:, :: -1 if inverted else 1])
    index = cells(60, 60, 60)
    index = index[classify_cells(solid, ORIGIN, 1.0, index) == CROSSED][::9]
    nearby, settled = inside_module.sample_cells_nearby, []

    def spy(*arguments):
        mask, done = nearby(*arguments)
        settled.append(done.mean())
        return mask, done

    monkeypatch.setattr(inside_module, "sample_cells_nearby", spy)
    mask = sample_mask(solid, ORIGIN, 1.0, index)
    assert settled[0] > 0.99
    monkeypatch.setattr(inside_module, "MAX_EXACT_FACETS", len(solid.facets))
    np.testing.assert_array_equal(sample_mask(solid, ORIGIN, 1.0, index), mask)


def test_reference_sample_on_the_surface_spoils_no_other(monkeypatch):
    """A face through sample 21, from which the others are counted: only points in that plane may go either way."""
    points = inside_module.sample_points(3)
    solid = lattice_box([9 + points[0, 21], 5, 5], [30, 30, 30])
    index = cells(1, 20, 20, start=9)
    mask = sample_mask(solid, ORIGIN, 1.0, index)
    in_plane = np.flatnonzero(points[0] == points[0, 21]).astype(np.uint64)
    clear = ~np.bitwise_or.reduce(np.uint64(1) << in_plane)
    monkeypatch.setattr(inside_module, "MAX_EXACT_FACETS", len(solid.facets))
    np.testing.assert_array_equal(sample_mask(solid, ORIGIN, 1.0, index) & clear, mask & clear)


def test_sample_points_are_their_own_image_in_mirrors_and_exchanges_of_axes():
    """One in each sub-cell; along each axis at 32 (3-D: 16) evenly spaced places, as many at each."""
    for dimension, per_edge in ((2, 8), (3, 4)):
        nudge = (
            np.where(inside_module.sample_points(dimension) > 0.5, 1, -1)
            * inside_module.SAMPLE_OFFSET[:dimension, None]
        )
        points = inside_module.sample_points(dimension) - nudge
        places = {2: 32, 3: 16}[dimension]
        for axis in points:
            np.testing.assert_allclose(np.sort(axis), np.repeat((np.arange(places) + 0.5) / places, 64 // places))
        bits = per_edge ** np.arange(dimension) @ np.floor(points * per_edge)
        np.testing.assert_array_equal(bits, np.arange(64))

        def rounded(points):
            return {tuple(point) for point in points.T.round(9)}

        for axis in range(dimension):
            mirrored = inside_module.sample_points(dimension)
            mirrored[axis] = 1.0 - mirrored[axis]
            assert rounded(mirrored) == rounded(inside_module.sample_points(dimension))
        assert rounded(np.roll(points, 1, axis=0)) == rounded(points)


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("middle", [8.0, 8.5])
@pytest.mark.parametrize(
    "specification",
    [
        {"shape": "circle", "center": [0.0, 0.0], "radius": 4.3},
        {"shape": "polygon", "points": [[-3.2, -4.1], [2.7, -4.1], [5.0, 1.3], [0.4, 5.2]]},
        {"shape": "sphere", "center": [0.0, 0.0, 0.0], "radius": 4.3},
        {"shape": "box", "lower": [-4.0625, -3.3, -2.96875], "upper": [4.0625, 3.3, 2.96875]},
        {"shape": "cylinder", "start": [-3.0, -4.0, -1.2], "end": [3.5, 4.0, 2.0], "radius": 2.1},
    ],
)
def test_mirrored_solids_have_mirrored_cells(specification, middle, exact, monkeypatch):
    """About a face of cells and about their middle, wherever walls lie, sample planes too; no sample differs in number.

    A circle had 1.95 and 1.17 m2 of rock in two cells of 5 m that are mirror images.
    """
    dimension = 2 if specification["shape"] in ("circle", "polygon") else 3
    solid = build_shape({"name": "s", **specification}, dimension)
    if not exact:
        monkeypatch.setattr(inside_module, "MAX_EXACT_FACETS", 0)
    count = int(2 * middle)
    index, origin = cells(*[count] * dimension), np.zeros(dimension)

    def shares(vertices):
        mask = sample_mask(Solid("s", vertices + middle, solid.facets), origin, 1.0, index)
        return popcount(mask).reshape([count] * dimension)

    here = shares(solid.vertices)
    assert 0 < here.min() + ((here > 0) & (here < 64)).sum()
    for axis in range(dimension):
        turn = np.ones(dimension)
        turn[axis] = -1.0
        np.testing.assert_array_equal(np.flip(shares(solid.vertices * turn), axis), here)
    # x to y, y to z, z to x
    turned = shares(np.roll(solid.vertices, 1, axis=1))
    np.testing.assert_array_equal(turned, np.moveaxis(here, range(dimension), np.roll(range(dimension), -1)))


@pytest.mark.parametrize("height", [0.1, 0.33, 0.5078125, 0.9])
def test_share_of_a_cell_below_a_level_roof(height):
    solid = build_shape({"name": "b", "shape": "box", "lower": [-9, -9, -9], "upper": [9, 9, height]}, 3)
    share = popcount(sample_mask(solid, ORIGIN, 1.0, cells(1, 1, 1)))[0] / 64
    assert share == pytest.approx(height, abs=2 / 64 + 1e-9)


@pytest.mark.parametrize("sixteenths", range(1, 16))
def test_share_of_a_cell_below_a_roof_at_a_sixteenth_is_exact(sixteenths):
    top = 3.0 + sixteenths / 16
    solid = build_shape({"name": "b", "shape": "box", "lower": [0, 0, 0], "upper": [9, 9, top]}, 3)
    assert popcount(sample_mask(solid, ORIGIN, 1.0, np.array([[4, 4, 3]])))[0] / 64 == sixteenths / 16


@pytest.mark.parametrize("place", [33 / 32 - 0.5, 0.5 + 7 / 32])
def test_solids_that_share_a_face_share_no_sample_and_leave_none_out(place):
    """The face lies in a plane of sample points, where round-off would otherwise decide."""
    face = 1 + place
    left = build_shape({"name": "l", "shape": "box", "lower": [0, 0, 0], "upper": [face, 3, 3]}, 3)
    right = build_shape({"name": "r", "shape": "box", "lower": [face, 0, 0], "upper": [3, 3, 3]}, 3)
    index = cells(3, 3, 3)
    a, b = sample_mask(left, ORIGIN, 1.0, index), sample_mask(right, ORIGIN, 1.0, index)
    assert not (a & b).any()
    assert (popcount(a | b) == 64).all()


@pytest.mark.parametrize(
    ("specification", "bound"),
    [
        ({"shape": "sphere", "center": [20.3, 20.1, 19.8], "radius": 6}, 2e-3),
        ({"shape": "cylinder", "start": [8, 9, 10], "end": [30, 25, 20], "radius": 4}, 2e-3),
        ({"shape": "tunnel", "path": [[3, 5, 5], [25, 9, 6], [33, 33, 8]], "width": 5, "height": 5}, 5e-3),
        ({"shape": "box", "lower": [3.4375, 3.515625, 3.90625], "upper": [8.125, 31.71875, 8.75]}, 3e-3),
        ({"shape": "box", "lower": [3.3, 3.4, 3.9], "upper": [8.1, 31.7, 8.8]}, 1.3e-2),
    ],
)
def test_shares_add_up_to_the_volume(specification, bound):
    """Cells of 1.25 m, as in a mine. Of a box whose walls lie at 16ths of a cell only cells at its edges are off.

    Any other is off by 2/64 of a cell at each wall, at most.
    """
    solid = build_shape(dict(specification, name="x"), 3)
    assert sampled_volume(solid, ORIGIN, 1.25, cells(32, 32, 32)) == pytest.approx(solid.volume, rel=bound)


def test_overlap_counts_once():
    """Two boxes that overlap by a third, as one solid: the shares give the union's volume."""
    both = joined(moved(BOX, shift=[4.1, 4.2, 4.3]), moved(BOX, shift=[4.1, 4.2, 6.3]))
    assert both.volume == pytest.approx(64)
    assert sampled_volume(both, ORIGIN, 0.5, cells(20, 20, 24)) == pytest.approx(64, rel=5e-3)


def test_broken_or_inverted_solid_fills_the_same_cells():
    ball = build_shape({"name": "s", "shape": "sphere", "center": [4, 4, 4], "radius": 3}, 3)
    index = cells(16, 16, 16)
    whole = sampled_volume(ball, ORIGIN, 0.5, index)
    assert sampled_volume(Solid("i", ball.vertices, ball.facets[:, ::-1]), ORIGIN, 0.5, index) == whole
    holed = Solid("h", ball.vertices, ball.facets[5:])
    assert sampled_volume(holed, ORIGIN, 0.5, index) == pytest.approx(whole, rel=1e-3)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_outside_of_a_solid_is_all_that_the_solid_is_not(dimension):
    """Cell by cell, sample by sample and point by point; the volumes add up to the box."""
    ball = build_shape({"name": "ball", "shape": "sphere", "center": [3.1] * dimension, "radius": 2.2}, dimension)
    outside = Outside(ball, np.zeros(dimension), np.full(dimension, 6.0))
    index, origin = cells(*[12] * dimension), np.zeros(dimension)
    kind = classify_cells(ball, origin, 0.5, index)
    reverse = {INSIDE: OUTSIDE, OUTSIDE: INSIDE, CROSSED: CROSSED}
    assert classify_cells(outside, origin, 0.5, index).tolist() == [reverse[one] for one in kind]
    assert set(kind) == {INSIDE, OUTSIDE, CROSSED}
    np.testing.assert_array_equal(sample_mask(outside, origin, 0.5, index), ~sample_mask(ball, origin, 0.5, index))
    points = np.random.default_rng(3).uniform(0, 6, (500, dimension))
    np.testing.assert_array_equal(contains(outside, points), ~contains(ball, points))
    assert outside.volume == pytest.approx(6.0**dimension - ball.volume, rel=1e-12)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    lower=st.tuples(*[st.floats(-4.0, 1.0)] * 3),
    size=st.tuples(*[st.floats(0.5, 5.0)] * 3),
    dimension=st.sampled_from([2, 3]),
)
def test_volume_within_a_box_is_that_of_the_part_in_it(seed, lower, size, dimension):
    """A box that is not turned against another: the product of overlaps; a turned one: both sides of a cut add up."""
    lower, upper = np.array(lower[:dimension]), np.array(lower[:dimension]) + size[:dimension]
    corners = {"lower": [-1, -2, -3][:dimension], "upper": [1, 2, 3][:dimension]}
    block = build_shape({"name": "b", "shape": "box", **corners}, dimension)
    overlap = np.minimum(upper, block.bounds[1]) - np.maximum(lower, block.bounds[0])
    assert block.volume_within(lower, upper) == pytest.approx(np.prod(np.maximum(overlap, 0.0)), abs=1e-12)
    turn = rotation(seed)[:dimension, :dimension]
    turned = Solid("turned", block.vertices @ turn.T, block.facets)
    middle = upper.copy()
    middle[seed % dimension] = 0.5 * (lower + upper)[seed % dimension]
    start = np.where(middle == upper, lower, middle)
    parts = turned.volume_within(lower, middle) + turned.volume_within(start, upper)
    assert parts == pytest.approx(turned.volume_within(lower, upper), abs=1e-12)
    assert turned.volume_within(np.full(dimension, -9.0), np.full(dimension, 9.0)) == pytest.approx(turned.volume)


@pytest.mark.parametrize("seed", range(4))
def test_a_body_on_its_hull_has_the_volume_that_cells_would_add_up(seed, monkeypatch):
    """To the last bit: turned boxes, cut by a box; wound twice it is neither empty nor twice as large."""
    random = np.random.default_rng(seed)
    turn = np.linalg.qr(random.standard_normal((3, 3)))[0]
    box = build_shape({"name": "b", "shape": "box", "lower": [-3, -2, -1], "upper": [3, 2, 1]}, 3)
    corners = (box.vertices @ turn)[box.facets]
    lower, upper = np.array([-9.0, -9.0, -0.5]), np.full(3, 9.0)
    assert solids.is_on_its_hull(corners)
    assert not solids.is_on_its_hull(np.concatenate([corners, corners + 1.0]))
    once = solids.volume_within(corners, True, lower, upper)
    assert solids.volume_within(np.repeat(corners, 2, axis=0), True, lower, upper) == pytest.approx(once, rel=0.02)
    monkeypatch.setattr(solids, "is_on_its_hull", lambda corners: False)
    assert solids.volume_within(corners, True, lower, upper) == once
