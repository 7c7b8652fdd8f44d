"""Nodes moved onto the edges of boxes that lie anywhere."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mpm_core.geometry.shapes import build_shape
from mpm_core.geometry.solids import Solid
from mpm_core.grid.distorted_cells import distorted_shapes, smallest_element, sub_cell_middles
from mpm_core.grid.edge_nodes import MIN_VOLUME_RATIO, choose_edge_nodes, sharp_edges

SHAPE = np.array([16, 16, 16])


def box(lower, edge, dimension=3):
    lower = np.broadcast_to(np.asarray(lower, float), dimension)
    return build_shape(
        {"name": "a", "shape": "box", "lower": lower.tolist(), "upper": (lower + edge).tolist()}, dimension
    )


def chosen(*solids, dimension=3):
    return choose_edge_nodes(list(solids), np.zeros(dimension), 1.0, SHAPE[:dimension])


@pytest.mark.parametrize("dimension", [2, 3])
def test_walls_on_faces_of_cells_move_nothing(dimension):
    assert not len(chosen(box(4.0, 6.0, dimension), dimension=dimension).place)


@given(st.tuples(*[st.floats(4.0, 5.0)] * 3), st.sampled_from([2, 3]))
@settings(max_examples=25, deadline=None)
def test_moved_nodes_are_of_the_opening_and_no_cell_gets_thin(lower, dimension):
    lower = np.array(lower[:dimension])
    nodes = chosen(box(lower, 5.3, dimension), dimension=dimension)
    inside = (nodes.place > lower).all(axis=1) & (nodes.place < lower + 5.3).all(axis=1)
    assert inside.all()
    assert len(np.unique(nodes.place, axis=0)) == len(nodes.place)
    moved = nodes.place + nodes.shift
    assert ((moved >= lower - 1e-9) & (moved <= lower + 5.3 + 1e-9)).all()
    for corners in distorted_shapes(nodes.place, nodes.shift)[1]:
        assert smallest_element(corners, sub_cell_middles(dimension)) >= MIN_VOLUME_RATIO


def test_a_node_half_a_cell_from_an_edge_goes_onto_it():
    """Walls half way through their cells on all axes: each edge has a node at every cell along it."""
    nodes = chosen(box(4.5, 6.0))
    moved = nodes.place + nodes.shift
    on = (np.abs(moved - 4.5) < 1e-9) | (np.abs(moved - 10.5) < 1e-9)
    assert (on.sum(axis=1) >= 2).mean() > 0.5


@pytest.mark.parametrize("lower", [8.6, 5.1, 4.2], ids=["apart", "near", "crossing"])
def test_the_order_of_excavations_does_not_matter(lower):
    one, other = box(2.3, 3.1), box(lower, 4.2)
    first, second = chosen(one, other), chosen(other, one)
    np.testing.assert_array_equal(first.place, second.place)
    np.testing.assert_array_equal(first.shift, second.shift)


def test_a_shift_by_whole_cells_shifts_the_nodes():
    one, other = chosen(box(3.4, 4.7)), chosen(box(5.4, 4.7))
    np.testing.assert_array_equal(one.place + 2, other.place)
    np.testing.assert_allclose(one.shift, other.shift, atol=1e-9)


def rough_box(lower, edge, noise, per_edge=12):
    """A box whose faces are many triangles with vertices moved at random by up to `noise` along each axis."""
    mesh = trimesh.creation.box(extents=[edge] * 3)
    while mesh.edges_unique_length.max() > edge / per_edge:
        mesh = mesh.subdivide()
    random = np.random.default_rng(3)
    vertices = mesh.vertices + random.uniform(-noise, noise, mesh.vertices.shape) + np.asarray(lower) + edge / 2
    return Solid("rough", vertices, mesh.faces)


def test_a_rough_surface_moves_nodes_at_its_edges_only():
    """Roughness of a seventh of a cell makes sharp edges all over. As many nodes are moved as at a smooth box, none far
    from its own edges."""
    lower, edge = np.array([4.4, 4.5, 4.6]), 5.3
    solid = rough_box(lower, edge, 0.15)
    assert len(sharp_edges(solid).segments) > 500
    nodes = chosen(solid)
    goal = nodes.place + nodes.shift
    from_wall = np.minimum(np.abs(goal - lower), np.abs(goal - lower - edge))
    assert len(nodes.place) >= len(chosen(box(lower, edge)).place) > 30
    assert (np.sort(from_wall, axis=1)[:, 1] < 1.5).all()


def test_a_rough_ball_moves_no_node():
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=5.0)
    random = np.random.default_rng(5)
    vertices = mesh.vertices * (1.0 + random.normal(0.0, 0.01, len(mesh.vertices)))[:, None] + 8.0
    solid = Solid("rough", vertices, mesh.faces)
    assert len(sharp_edges(solid).segments) > 1000
    assert not len(chosen(solid).place)


@given(st.integers(0, 2**32 - 1), st.integers(0, 60), st.sampled_from([2, 3]))
@settings(max_examples=25, deadline=None)
def test_cells_around_moved_nodes_are_found_once_in_order(seed, count, dimension):
    """As one by one; nodes at the edge of the domain have cells beyond it."""
    random = np.random.default_rng(seed)
    place = np.unique(random.integers(0, 6, (count, dimension)), axis=0)
    random.shuffle(place)
    shift = random.uniform(-0.4, 0.4, place.shape)
    offsets = np.arange(1 << dimension)[:, None] >> np.arange(dimension) & 1
    expected: dict[tuple, np.ndarray] = {}
    for node, moved in zip(place, shift, strict=True):
        for corner, offset in enumerate(offsets):
            expected.setdefault(tuple(node - offset), offsets.astype(float))[corner] += moved
    cells, corners = distorted_shapes(place, shift)
    assert cells.dtype == np.int32
    assert list(map(tuple, cells)) == sorted(expected)
    for cell, found in zip(cells, corners, strict=True):
        np.testing.assert_array_equal(found, expected[tuple(cell)])
