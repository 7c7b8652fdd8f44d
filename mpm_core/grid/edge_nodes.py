"""Nodes of finest cells that are moved onto the edges of openings.

Shape functions of a cut cell reach to nodes in the opening. Along a flat wall such a node carries on what the rock of
the wall does. At an edge of the opening within a cell two walls share it: it would have to carry on the motion of both,
holds each of them, and the opening releases too little energy. A node that lies on the edge itself moves as the rock
there does. So the node of the opening that is nearest to an edge is moved onto it, once for all steps; the cells around
it are distorted (distorted_cells.py), all others stay as they are.

Such an edge is sharp: the surface of the opening turns there by so much that the rock around it has two walls.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for
from numba import njit

from mpm_core.geometry.inside import contains
from mpm_core.geometry.solids import Outside, Solid, unique_rows
from mpm_core.grid.distorted_cells import corner_offsets, smallest_element, sub_cell_middles
from mpm_core.grid.octree import all_cells
from mpm_core.grid.splitting import code_of

MIN_TURN = np.radians(55.0)  # between the normals of two facets that meet in a sharp edge
MIN_BEND = np.radians(30.0)  # between two sharp edges that meet in a corner
# Lengths are in finest cells.
MAX_REACH = 1.42  # A node is moved at most by the diagonal of a cell's face.
MAX_DISTANCE_ON_LATTICE = 1e-6  # A node as near to an edge as this lies on it.
MIN_VOLUME_RATIO = 0.1  # Smallest ratio of a distorted cell's volume element to a cube's, at each of its samples.
PATH_SHARES = (1.0, 0.8, 0.6, 0.4)  # A node that cannot go all the way to the edge goes the next smaller share.
MIN_GOAL_DISTANCE = 0.5  # Two nodes do not go to places of an edge nearer to each other than this.
# At an edge, at most this share of a ball around it is inside the solid: 0.5 at a flat wall, 0.25 at 90 degrees.
MAX_BALL_SHARE = 0.345
BALL_RADIUS = 1.5
POINTS_PER_CHUNK = 20000  # Points, or places, whose neighbourhood is held in memory.


class SharpEdges(NamedTuple):
    """Edges on which a solid is convex and turns by MIN_TURN or more, and the corners in which they end.

    The rock outside has a re-entrant edge there. In plane strain a segment is a vertex of the outline, twice, and there
    are no corners.
    """

    segments: np.ndarray
    """(segment, 2, d) m"""
    normals: np.ndarray
    """(segment, 2, d) unit normals of its two facets, outward"""
    turn: np.ndarray
    """(segment,) angle between them, radians"""
    corners: np.ndarray
    """(corner, d) m"""


def sharp_edges(solid: Solid) -> SharpEdges:
    """Sharp edges of a solid whose facets look outward or inward alike.

    Vertices at the same place count as one. An edge of which there are not two facets is none.
    """
    sign = 1.0 if solid.signed_volume >= 0.0 else -1.0
    vertices, place = unique_rows(solid.vertices)
    facets = place[solid.facets]
    dimension = solid.dimension
    # Each facet's sides: in 3-D its edges, in 2-D its two end points; the corner opposite to each.
    if dimension == 3:
        sides = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2)
        opposite = np.roll(facets, -2, axis=1).ravel()
        a, b, c = (vertices[facets[:, i]] for i in range(3))
        normals = sign * np.cross(b - a, c - a)
    else:
        sides, opposite = facets.reshape(-1, 1), facets[:, ::-1].ravel()
        along = vertices[facets[:, 1]] - vertices[facets[:, 0]]
        normals = sign * np.stack([along[:, 1], -along[:, 0]], axis=1)
    size = np.linalg.norm(normals, axis=1)
    normals = normals / np.where(size > 0.0, size, 1.0)[:, None]
    facet = np.repeat(np.arange(len(facets)), len(sides) // len(facets))
    real = size[facet] > 0.0
    sides, opposite, facet = np.sort(sides[real], axis=1), opposite[real], facet[real]
    keys, number, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(number.reshape(-1), kind="stable")
    first = np.cumsum(count) - count
    pairs = np.flatnonzero(count == 2)
    one, other = order[first[pairs]], order[first[pairs] + 1]
    turn = np.arccos(np.clip(np.sum(normals[facet[one]] * normals[facet[other]], axis=1), -1.0, 1.0))
    beyond = vertices[opposite[other]] - vertices[keys[pairs, 0]]  # below the first facet's plane where convex
    convex = np.sum(beyond * normals[facet[one]], axis=1) < 0.0
    sharp = (turn >= MIN_TURN) & convex
    keys, turn = keys[pairs[sharp]], turn[sharp]
    of_edge = np.stack([normals[facet[one[sharp]]], normals[facet[other[sharp]]]], axis=1)
    if dimension == 2:
        return SharpEdges(vertices[np.repeat(keys, 2, axis=1)], of_edge, turn, np.empty((0, 2)))
    return SharpEdges(vertices[keys], of_edge, turn, vertices[_bends(vertices, keys)])


def _bends(vertices: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Vertices (k,) at which edges (edge, 2) meet that are not one straight line."""
    if not len(edges):
        return np.empty(0, np.int64)
    along = vertices[edges[:, 1]] - vertices[edges[:, 0]]
    along = along / np.linalg.norm(along, axis=1)[:, None]
    ends = np.concatenate([edges[:, 0], edges[:, 1]])
    out = np.concatenate([along, -along])  # away from the vertex
    count = np.bincount(ends, minlength=len(vertices))
    total = np.stack([np.bincount(ends, axis, len(vertices)) for axis in out.T], axis=1)
    two_in_line = (count == 2) & (np.linalg.norm(total, axis=1) <= 2.0 * np.sin(0.5 * MIN_BEND))
    return np.flatnonzero((count >= 2) & ~two_in_line)


@dataclass(frozen=True)
class EdgeNodes:
    """The nodes that are moved, and by how much: place (k, d) int32, fine units; shift (k, d), finest cells."""

    place: np.ndarray
    shift: np.ndarray

    @classmethod
    def none(cls, dimension: int) -> "EdgeNodes":
        """No node is moved."""
        return cls(np.empty((0, dimension), np.int32), np.empty((0, dimension)))

    def of(self, chosen: np.ndarray) -> "EdgeNodes":
        """The chosen ones, (k,) bool or indices."""
        return EdgeNodes(self.place[chosen], self.shift[chosen])


class Wishes(NamedTuple):
    """Nodes that may move, in the order in which they are tried: place (n, d), and where each would go, goal (n, d), in
    finest cells from the origin; batch (n,): 0 of corners, 1 of edges."""

    place: np.ndarray
    goal: np.ndarray
    batch: np.ndarray


def choose_edge_nodes(
    solids: list[Solid | Outside], origin: np.ndarray, fine_cell: float, shape: np.ndarray
) -> EdgeNodes:
    """The nodes that edges of these excavations need; shape (d,) finest cells of the domain.

    Corners come first, then edges, the nearest node first. A node moves once, no two go to one place, and no cell gets
    smaller than MIN_VOLUME_RATIO; if it would, the node goes a part of the way.
    """
    wishes = _wishes(solids, origin, fine_cell, shape)
    if not len(wishes.place):
        return EdgeNodes.none(len(shape))
    around = all_cells((3,) * len(shape)) - 1
    known = code_of((wishes.place[:, None, :] + around).reshape(-1, len(shape)), shape + 1)
    codes, number = np.unique(known, return_inverse=True)
    number = number.reshape(len(wishes.place), -1)
    close = scipy.spatial.cKDTree(wishes.goal).query_pairs(MIN_GOAL_DISTANCE, output_type="ndarray")
    close = np.concatenate([close, close[:, ::-1]])
    close = close[np.lexsort(close.T[::-1])]
    first = np.searchsorted(close[:, 0], np.arange(len(wishes.place) + 1))
    batches = np.flatnonzero(np.diff(wishes.batch, prepend=-1, append=-1))
    shift, moved = np.zeros((len(codes), len(shape))), np.zeros(len(codes), bool)
    _move(
        batches, wishes.place.astype(float), wishes.goal, number, first, close[:, 1].copy(), np.array(PATH_SHARES),
        corner_offsets(len(shape)), sub_cell_middles(len(shape)), shift, moved,
    )  # fmt: skip
    place = np.stack(np.unravel_index(codes[moved], tuple(shape + 1)), axis=1).astype(np.int32)
    return EdgeNodes(place, shift[moved])


def _wishes(solids: list[Solid | Outside], origin: np.ndarray, fine_cell: float, shape: np.ndarray) -> Wishes:
    """Wishes of all excavations, in an order that does not depend on theirs."""
    places, goals = [np.empty((0, len(shape)), np.int64)], [np.empty((0, len(shape)))]
    batches = [np.empty(0, np.int64)]
    for solid in solids:
        edges = sharp_edges(solid.solid if isinstance(solid, Outside) else solid)
        corners, segments = ((points - origin) / fine_cell for points in (edges.corners, edges.segments))
        for number, pairs in enumerate((np.repeat(corners[:, None], 2, axis=1), segments)):
            pairs = pairs[is_edge(solid, pairs.mean(axis=1), origin, fine_cell)]
            place, goal = _nearest_goals(pairs, shape)
            place, goal = _inside(solid, place, goal, origin, fine_cell)
            places.append(place)
            goals.append(goal)
            batches.append(np.full(len(place), number))
    place, goal, batch = (np.concatenate(columns) for columns in (places, goals, batches))
    order = np.lexsort((*goal.T, *place.T, np.round(np.linalg.norm(goal - place, axis=1), 9), batch))
    return Wishes(place[order], goal[order], batch[order])


@njit(error_model="numpy", cache=True)
def _move(batches, place, goal, number, first, close, shares, offsets, points, shift, moved):
    """Fulfil wishes: shift (node, d) and moved (node,) of the nodes numbered in number (n, 3^d), C order, in place.

    batches: first wish of each batch, and their end; first (n + 1,), close: wishes whose goals are close to each one's;
    offsets (2^d, d), points (64, d): see distorted_cells.
    """
    dimension, corners = place.shape[1], len(offsets)
    done = np.zeros(len(place), np.bool_)
    cell = np.empty((corners, dimension))
    for batch in range(len(batches) - 1):
        for share in shares:
            for i in range(batches[batch], batches[batch + 1]):
                taken = done[i]
                for other in range(first[i], first[i + 1]):
                    taken |= done[close[other]]
                if taken:
                    continue
                node = number[i, number.shape[1] // 2]
                distance = 0.0
                for axis in range(dimension):
                    distance += (goal[i, axis] - place[i, axis]) ** 2
                if distance > MAX_DISTANCE_ON_LATTICE**2:
                    if moved[node]:
                        continue
                    for axis in range(dimension):
                        shift[node, axis] = share * (goal[i, axis] - place[i, axis])
                    smallest = 1.0
                    for c in range(corners):  # the cell whose corner c the node is
                        for corner in range(corners):
                            at = 0
                            for axis in range(dimension):
                                at = 3 * at + 1 + offsets[corner, axis] - offsets[c, axis]
                            for axis in range(dimension):
                                cell[corner, axis] = offsets[corner, axis] + shift[number[i, at], axis]
                        smallest = min(smallest, smallest_element(cell, points))
                    if smallest < MIN_VOLUME_RATIO:
                        for axis in range(dimension):
                            shift[node, axis] = 0.0
                        continue
                    moved[node] = True
                done[i] = True


def is_edge(solid: Solid | Outside, place: np.ndarray, origin: np.ndarray, fine_cell: float) -> np.ndarray:
    """(k,) bool: True where a solid has an edge at places (k, d), finest cells, at the size of the cells; not where its
    surface is only rough."""
    lattice = (all_cells((6,) * place.shape[1]) - 2.5) / 3.0 * BALL_RADIUS
    ball, convex = lattice[np.linalg.norm(lattice, axis=1) <= BALL_RADIUS], solid
    if isinstance(solid, Outside):
        convex = solid.solid
    share = np.empty(len(place))
    for first in range(0, len(place), POINTS_PER_CHUNK):
        chunk = slice(first, first + POINTS_PER_CHUNK)
        points = origin + (place[chunk, None, :] + ball) * fine_cell
        share[chunk] = contains(convex, points.reshape(-1, place.shape[1])).reshape(points.shape[:2]).mean(axis=1)
    return share <= MAX_BALL_SHARE


def _nearest_goals(segments: np.ndarray, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, d) of the lattice, none of the domain's border, within MAX_REACH of segments (k, 2, d), each once; the
    nearest point (n, d) of any of them."""
    dimension, none = len(shape), (np.empty((0, len(shape)), np.int64), np.empty((0, len(shape))))
    around = all_cells((4,) * dimension) - 1
    steps = np.maximum(1, np.ceil(2.0 * np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)).astype(np.int64))
    found = [none]
    for first, last in _chunks(steps + 1):
        number = np.repeat(np.arange(first, last), steps[first:last] + 1)
        step = np.arange(len(number)) - np.searchsorted(number, number)
        start, along = segments[number, 0], segments[number, 1] - segments[number, 0]
        points = start + (step / steps[number])[:, None] * along
        nodes = (np.floor(points).astype(np.int64)[:, None, :] + around).reshape(-1, dimension)
        start, along = (np.repeat(values, len(around), axis=0) for values in (start, along))
        length = np.sum(along**2, axis=1)
        share = np.sum((nodes - start) * along, axis=1) / np.where(length > 0.0, length, 1.0)
        goal = start + np.clip(share, 0.0, 1.0)[:, None] * along
        near = np.linalg.norm(goal - nodes, axis=1) <= MAX_REACH
        found.append(_nearest_of_each(nodes[near], goal[near]))
    place, goal = _nearest_of_each(*(np.concatenate(columns) for columns in zip(*found, strict=True)))
    within = (goal > MAX_DISTANCE_ON_LATTICE) & (goal < shape - MAX_DISTANCE_ON_LATTICE)  # beyond there is no rock
    inner = ((place > 0) & (place < shape) & within).all(axis=1)
    return place[inner], goal[inner]


def _chunks(sizes: np.ndarray) -> Iterator[tuple[int, int]]:
    """First and last + 1 of runs of items (k,), of sizes (k,), that have some POINTS_PER_CHUNK together."""
    chunk = np.cumsum(sizes) // POINTS_PER_CHUNK
    bounds = np.flatnonzero(np.diff(chunk, prepend=-1, append=-1))
    yield from zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)


def _nearest_of_each(place: np.ndarray, goal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each node of places (n, d) once, with the nearest of its goals (n, d)."""
    order = np.lexsort((np.linalg.norm(goal - place, axis=1), *place.T))
    place, goal = place[order], goal[order]
    first = np.append(True, (place[1:] != place[:-1]).any(axis=1))[: len(place)]
    return place[first], goal[first]


def _inside(
    solid: Solid | Outside, place: np.ndarray, goal: np.ndarray, origin: np.ndarray, fine_cell: float
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of which all around lies inside the solid; and those that lie on an edge as they are."""
    corners = MAX_DISTANCE_ON_LATTICE * 1e3 * (2 * all_cells((2,) * place.shape[1]) - 1)
    points = origin + (place[:, None, :] + corners) * fine_cell
    inside = contains(solid, points.reshape(-1, place.shape[1])).reshape(points.shape[:2]).all(axis=1)
    kept = inside | (np.linalg.norm(goal - place, axis=1) <= MAX_DISTANCE_ON_LATTICE)
    return place[kept], goal[kept]
