"""Sharp edges of solids whose edges one can count."""

import numpy as np
import pytest

from mpm_core.geometry.shapes import build_shape
from mpm_core.geometry.solids import Solid
from mpm_core.grid.edge_nodes import sharp_edges


def lengths(edges):
    """Length of all segments together, m."""
    return np.linalg.norm(edges.segments[:, 1] - edges.segments[:, 0], axis=1).sum()


def test_a_box_has_twelve_edges_and_eight_corners():
    edges = sharp_edges(build_shape({"name": "a", "shape": "box", "lower": [0, 0, 0], "upper": [2, 3, 4]}, 3))
    assert lengths(edges) == pytest.approx(4 * (2 + 3 + 4))
    assert len(edges.corners) == 8


def test_an_inverted_box_and_one_whose_vertices_repeat_have_the_same_edges():
    box = build_shape({"name": "a", "shape": "box", "lower": [0, 0, 0], "upper": [2, 3, 4]}, 3)
    inverted = Solid("a", box.vertices, box.facets[:, ::-1])
    soup = Solid("a", box.vertices[box.facets].reshape(-1, 3), np.arange(box.facets.size).reshape(-1, 3))
    for other in (inverted, soup):
        edges = sharp_edges(other)
        assert lengths(edges) == pytest.approx(36)
        assert len(edges.corners) == 8


def test_a_sphere_has_none_and_a_cylinder_its_two_rims():
    ball = sharp_edges(build_shape({"name": "a", "shape": "sphere", "center": [0, 0, 0], "radius": 5}, 3))
    assert not len(ball.segments)
    rod = {"name": "a", "shape": "cylinder", "start": [0, 0, 0], "end": [0, 0, 9], "radius": 2}
    edges = sharp_edges(build_shape(rod, 3))
    assert lengths(edges) == pytest.approx(2 * 2 * np.pi * 2, rel=1e-3)
    assert not len(edges.corners)


def test_an_inward_edge_is_none():
    """An L in plan: five of its six upright edges turn outward."""
    polygon = [[0, 0], [4, 0], [4, 2], [2, 2], [2, 4], [0, 4]]
    edges = sharp_edges(build_shape({"name": "a", "shape": "prism", "polygon": polygon, "lower": 0, "upper": 3}, 3))
    upright = np.abs(edges.segments[:, 1, 2] - edges.segments[:, 0, 2]) > 1
    assert np.count_nonzero(upright) == 5


def test_in_plane_strain_vertices_are_edges():
    edges = sharp_edges(build_shape({"name": "a", "shape": "box", "lower": [0, 0], "upper": [2, 3]}, 2))
    assert (edges.segments[:, 0] == edges.segments[:, 1]).all()
    assert len(edges.segments) == 4
    assert np.degrees(edges.turn) == pytest.approx(90)
    circle = build_shape({"name": "a", "shape": "circle", "center": [0, 0], "radius": 3}, 2)
    assert not len(sharp_edges(circle).segments)
