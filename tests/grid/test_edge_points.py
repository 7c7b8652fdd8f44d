"""Points along edges of boxes, and the steps in which rock has an edge there."""

import numpy as np
import pytest

from mpm_core.geometry.shapes import build_shape
from mpm_core.grid.edge_nodes import EdgeNodes, choose_edge_nodes
from mpm_core.grid.edge_points import SPACING, edge_points, has_node
from mpm_core.grid.octree import all_cells
from mpm_core.model.occupancy import ALL_SAMPLES
from mpm_core.model.openings import NEVER, Openings

SHAPE = np.array([20, 20, 20])


def box(lower, upper):
    return build_shape({"name": "a", "shape": "box", "lower": list(lower), "upper": list(upper)}, len(lower))


def points_of(*solids):
    dimension = solids[0].dimension
    nodes = choose_edge_nodes(list(solids), np.zeros(dimension), 1.0, SHAPE[:dimension])
    return edge_points(list(solids), nodes, np.zeros(dimension), 1.0, SHAPE[:dimension])


def cells_in(lower, upper):
    """Places of finest cells that a box on the lattice fills."""
    return all_cells(np.subtract(upper, lower)) + np.asarray(lower)


def openings_of(boxes, steps):
    """The openings of boxes (lower, upper) on the lattice, mined in these steps."""
    points = points_of(*(box([*map(float, lower)], [*map(float, upper)]) for lower, upper in boxes))
    cells = [cells_in(lower, upper) for lower, upper in boxes]
    number = np.repeat(np.arange(len(boxes)), [len(own) for own in cells])
    return Openings.of(points, np.concatenate(cells), np.full(len(number), ALL_SAMPLES), number, np.array(steps))


def test_a_box_has_points_along_its_twelve_edges_at_which_rock_fills_270_degrees():
    points = points_of(box([4.3, 5.1, 6.0], [9.0, 9.5, 12.2]))
    assert np.degrees(points.angle) == pytest.approx(270)
    low, high = np.array([4.3, 5.1, 6.0]), np.array([9.0, 9.5, 12.2])
    on = (np.abs(points.place - low) < 1e-9) | (np.abs(points.place - high) < 1e-9)
    assert (on.sum(axis=1) == 2).all()
    length = 4 * (high - low).sum()
    assert length / SPACING <= len(points.place) <= length / SPACING + 12


def test_in_plane_strain_each_vertex_is_one():
    points = points_of(box([4.3, 5.1], [9.0, 9.5]))
    assert sorted(map(tuple, points.place.tolist())) == [(4.3, 5.1), (4.3, 9.5), (9.0, 5.1), (9.0, 9.5)]


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_edge_on_the_lattice_has_nodes_without_any_being_moved(dimension):
    low, high = [6.0] * dimension, [12.0] * dimension
    solids, origin = [box(low, high)], np.zeros(dimension)
    assert not edge_points(solids, EdgeNodes.none(dimension), origin, 1.0, SHAPE[:dimension]).shares_nodes.any()
    within = [box([x + 0.4 for x in low], high)]
    without = edge_points(within, EdgeNodes.none(dimension), origin, 1.0, SHAPE[:dimension])
    low_wall = np.isclose(without.place % 1.0, 0.4).sum(axis=1) >= 2  # its walls at the upper corner lie on faces
    assert (without.shares_nodes == low_wall).all()


def test_nodes_on_one_of_its_walls_are_not_shared_by_the_other():
    points = points_of(box([6.0, 6.2], [12.3, 12.2]))
    found = dict(zip(map(tuple, points.place.tolist()), points.shares_nodes.tolist(), strict=True))
    assert not found[(6.0, 6.2)]
    assert not found[(6.0, 12.2)]
    assert found[(12.3, 6.2)]


def test_an_edge_through_a_place_whose_node_moved_away_has_no_node():
    """Plane strain: the node of the upper vertex's place in the lattice has moved."""
    away = EdgeNodes(np.array([[12, 12]], np.int32), np.array([[0.3, 0.2]]))
    solids = [box([6.2, 6.2], [12.0005, 12.0005])]
    for nodes, shared in ((EdgeNodes.none(2), False), (away, True)):
        points = edge_points(solids, nodes, np.zeros(2), 1.0, SHAPE[:2])
        at_upper = np.isclose(points.place, 12.0005).all(axis=1)
        assert has_node(points.place, np.zeros((4, 2)), nodes, SHAPE[:2])[at_upper].tolist() == [not shared]


def test_an_edge_has_a_node_where_one_is_moved_onto_it():
    """Plane strain: at the lower left vertex a node of the opening would have to cross its cell, and does not."""
    points = points_of(box([6.2, 6.2], [12.2, 12.2]))
    found = dict(zip(map(tuple, points.place.tolist()), points.shares_nodes.tolist(), strict=True))
    assert not found[(12.2, 12.2)]
    assert found[(6.2, 6.2)]


def test_an_upright_edge_has_nodes_along_its_whole_length():
    points = points_of(box([6.0, 6.0, 6.3], [12.2, 12.2, 12.4]))
    upright = np.isclose(points.place[:, 0], 12.2) & np.isclose(points.place[:, 1], 12.2)
    assert upright.sum() > 8
    assert not points.shares_nodes[upright].any()


def test_an_excavation_beyond_the_domain_has_none_beside_one_within():
    within, beyond = box([8.2, 8.2], [14.2, 14.2]), box([-9.0, -9.0], [-3.0, -3.0])
    assert set(points_of(beyond, within).excavation) == {1}
    assert len(points_of(beyond).place) == 0


def test_beyond_the_domain_there_is_none():
    points = points_of(box([-5.0, 4.0, 4.0], [9.0, 9.0, 25.0]))
    assert ((points.place > 0) & (points.place < 20)).all()
    assert (points.place[:, 0] > 8).any()


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_edge_lasts_until_a_neighbour_makes_one_wall_of_both(dimension):
    """A box in step 1, one on top of it in step 3: the edges between them are none any more, all others stay."""
    low, high = [6] * dimension, [12] * dimension
    above = [*low[:-1], 12], [*high[:-1], 18]
    openings = openings_of([(low, high), above], [1, 3])
    own = openings.points.excavation == 0
    place = openings.points.place
    between, later = place[:, -1] == 12.0, openings.points.excavation == 1
    # next to an upright edge, rock has that edge there still
    upright = (np.minimum(place[:, :-1] - 6.0, 12.0 - place[:, :-1]) < 1.0).all(axis=1)
    assert (openings.since[own] == 1).all()
    assert set(openings.until[~between]) == {NEVER}
    assert set(openings.until[between & (~upright if dimension == 3 else True)]) == {3}
    assert len(openings.edge_points(0).place) == 0
    assert len(openings.edge_points(1).place) == len(openings.edge_points(2).place) == own.sum()
    assert len(openings.edge_points(3).place) < own.sum() + later.sum()


def test_the_order_of_excavations_does_not_matter():
    one, other = ([6, 6, 6], [10, 10, 10]), ([10, 6, 6], [15, 10, 10])
    first, second = openings_of([one, other], [0, 2]), openings_of([other, one], [2, 0])
    for step in range(4):
        assert sorted(map(tuple, first.edge_points(step).place)) == sorted(map(tuple, second.edge_points(step).place))


def test_what_is_planned_has_no_edge():
    assert len(openings_of([([6, 6, 6], [10, 10, 10])], [-1]).edge_points(5).place) == 0


def test_parts_of_one_box_have_the_edges_of_the_whole():
    """A box in four slices, mined at once: the slices' own edges are none."""
    slices = [([4 + 3 * k, 5, 5], [7 + 3 * k, 11, 11]) for k in range(4)]
    parts = openings_of(slices, [0] * 4).edge_points(0).place
    whole = openings_of([([4, 5, 5], [16, 11, 11])], [0]).edge_points(0).place
    distance = np.abs(parts[:, None] - whole).sum(axis=2)
    assert distance.min(axis=0).max() <= SPACING
    assert distance.min(axis=1).max() <= SPACING


def test_what_is_mined_again_opens_nothing_more():
    """A box that is filled and mined again by another solid, and one that a drive ran through: their edges stay."""
    low, high = [6, 6, 6], [12, 12, 12]
    again = openings_of([(low, high), (low, high)], [0, 2])
    assert len(again.edge_points(2).place) == 2 * len(again.edge_points(0).place)
    crossed = openings_of([([2, 6, 6], [12, 8, 8]), (low, high)], [0, 1])
    own = crossed.points.excavation == 1
    alone = openings_of([(low, high)], [1])
    assert (crossed.until[own] == alone.until)[crossed.points.place[own][:, 0] > 8].all()
