"""Closed surfaces of boxes: closed, outward, of the boxes' volume, whatever touches whatever."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from export.closed_surface import closed_surface
from export.failed_boxes import Boxes, chain_of_widths

PER_CELL, LEVELS = 4, 2
WIDTHS = chain_of_widths(PER_CELL, LEVELS)


def boxes_of(lower, width) -> Boxes:
    return Boxes(np.array(lower, np.int64), np.array(width, np.int64), PER_CELL, WIDTHS)


def random_boxes(seed: int, dimension: int, share: float) -> Boxes:
    """Boxes of all widths in a block of coarse cells: each is taken, left out or divided."""
    generator = np.random.default_rng(seed)
    lower, width, waiting = [], [], []
    for place in np.ndindex(*[2] * dimension):
        waiting.append((np.array(place) * WIDTHS[-1] - WIDTHS[-1], len(WIDTHS) - 1))
    while waiting:
        corner, number = waiting.pop()
        drawn = generator.random()
        if number and drawn < 0.6:
            factor = WIDTHS[number] // WIDTHS[number - 1]
            for step in np.ndindex(*[factor] * dimension):
                waiting.append((corner + np.array(step) * WIDTHS[number - 1], number - 1))
        elif drawn < 0.6 + 0.4 * share or (not number and drawn < share):
            lower.append(corner)
            width.append(WIDTHS[number])
    return boxes_of(np.array(lower).reshape(-1, dimension), width)


def check_closed(surface, volume):
    """Every edge is run along once in each direction, also where points at one place are one; the volume is right."""
    triangles = surface.triangles
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    directed = {tuple(edge) for edge in edges.tolist()}
    assert len(directed) == len(edges)
    assert all((end, start) in directed for start, end in directed)
    assert surface.volume == pytest.approx(volume, rel=1e-2)
    corners = surface.vertices[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert area.min() > 0.1 * WIDTHS[0] ** 2 / 4


def as_read(surface) -> trimesh.Trimesh:
    """The triangles as a program gets them that reads each by its corners, and finds again which are the same."""
    soup = surface.vertices[surface.triangles].reshape(-1, 3)
    return trimesh.Trimesh(soup, np.arange(len(soup)).reshape(-1, 3), process=True)


def test_a_cube_has_twelve_triangles_that_look_outward():
    surface = closed_surface(boxes_of([[4, 8, -4]], [4]), (0, 1, 2))
    assert len(surface.vertices) == 8
    assert len(surface.triangles) == 12
    assert surface.volume == pytest.approx(64.0, rel=1e-12)
    center = surface.vertices.mean(axis=0)
    corners = surface.vertices[surface.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", normal, corners.mean(axis=1) - center) > 0).all()


def test_cells_that_touch_have_no_wall_between_them():
    """A coarse cell beside two of four finer ones: 9 faces of the coarse one's size, less what they share."""
    surface = closed_surface(boxes_of([[0, 0, 0], [8, 0, 0], [8, 4, 4]], [8, 4, 4]), (0, 1, 2))
    check_closed(surface, 512 + 2 * 64)
    corners = surface.vertices[surface.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(6 * 64 + 2 * 4 * 16, rel=1e-2)


@pytest.mark.parametrize(
    ("lower", "name"), [([[0, 0, 0], [4, 4, 0]], "edge"), ([[0, 0, 0], [4, 4, 4]], "corner")], ids=["edge", "corner"]
)
def test_bodies_that_touch_are_two_closed_bodies(lower, name):
    surface = closed_surface(boxes_of(lower, [4, 4]), (0, 1, 2))
    check_closed(surface, 128.0)
    read = as_read(surface)
    assert read.is_volume
    assert [part.volume for part in read.split()] == pytest.approx([64.0, 64.0], rel=1e-2)


def test_a_chess_board_of_units_keeps_its_volume_to_one_percent():
    """The most that bodies can touch each other: along all edges of each."""
    places = np.array([place for place in np.ndindex(5, 5, 5) if sum(place) % 2 == 0])
    surface = closed_surface(boxes_of(places, [1] * len(places)), (0, 1, 2))
    check_closed(surface, len(places))
    assert as_read(surface).body_count == len(places)


def test_a_cavity_is_left_out():
    places = [place for place in np.ndindex(3, 3, 3) if place != (1, 1, 1)]
    surface = closed_surface(boxes_of(4 * np.array(places), [4] * 26), (0, 1, 2))
    check_closed(surface, 26 * 64.0)
    assert as_read(surface).body_count == 2


def test_a_ring_pinched_at_one_edge_stays_closed():
    """Two cells that touch along an edge and hang together at both of its ends: the edge itself has two copies."""
    places = [(0, 0, 1), (1, 1, 1), *[(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 2)]]
    surface = closed_surface(boxes_of(4 * np.array(places), [4] * len(places)), (0, 1, 2))
    check_closed(surface, 64.0 * len(places))
    assert as_read(surface).is_volume


@given(seed=st.integers(0, 2**32 - 1), dimension=st.sampled_from([2, 3]), share=st.floats(0.05, 0.95))
@settings(max_examples=60, deadline=None)
def test_any_boxes_have_a_closed_surface_of_their_volume(seed, dimension, share):
    boxes = random_boxes(seed, dimension, share)
    axes = (0, 2) if dimension == 2 else (0, 1, 2)
    surface = closed_surface(boxes, axes)
    if not len(boxes.width):
        assert not len(surface.triangles)
        return
    check_closed(surface, float(np.sum(boxes.width.astype(float) ** dimension)))
    read = as_read(surface)
    assert read.is_watertight
    assert read.is_winding_consistent


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_the_surface_winds_once_around_every_box_and_around_nothing_else(seed):
    """The solid angle under which the surface is seen is 4 pi from within a box and 0 from outside: a slow twin."""
    boxes = random_boxes(seed, 3, 0.5)
    surface = closed_surface(boxes, (0, 1, 2))
    generator = np.random.default_rng(seed)
    points = generator.uniform(-2 * WIDTHS[-1], 2 * WIDTHS[-1], (40, 3))
    points = np.floor(points) + generator.uniform(0.2, 0.8, points.shape)
    inside = ((points[:, None] > boxes.lower) & (points[:, None] < boxes.lower + boxes.width[:, None])).all(axis=2)
    a, b, c = np.moveaxis(surface.vertices[surface.triangles][None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(side, axis=2) for side in (a, b, c))
    top = np.einsum("ptj,ptj->pt", a, np.cross(b, c))
    below = la * lb * lc + np.sum(a * b, 2) * lc + np.sum(b * c, 2) * la + np.sum(c * a, 2) * lb
    winding = np.sum(np.arctan2(top, below), axis=1) / (2 * np.pi)
    np.testing.assert_allclose(winding, inside.any(axis=1), atol=1e-6)
