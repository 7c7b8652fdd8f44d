"""Points along the sharp edges of openings."""

from typing import NamedTuple

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for

from mpm_core.geometry.solids import Outside, Solid
from mpm_core.grid.edge_nodes import EdgeNodes, is_edge, sharp_edges
from mpm_core.grid.splitting import code_of

SPACING = 0.5  # finest cells; largest distance of two points of an edge
NODE_DISTANCE = 1.0  # finest cells; an edge has a node at a point if one lies on it as near as this
ON_LATTICE = 1e-3  # finest cells; a node this near to an edge, or a wall this near to faces of cells, lies on it


class EdgePoints(NamedTuple):
    """Points along edges: place (k, d) in finest cells from the domain's lower corner; angle (k,) that rock fills
    around the edge, radians; excavation (k,) whose edge it is; shares_nodes (k,) bool: nodes there carry the motion of
    both its walls, since no node lies on the edge and neither wall lies on faces of cells."""

    place: np.ndarray
    angle: np.ndarray
    excavation: np.ndarray
    shares_nodes: np.ndarray

    @classmethod
    def none(cls, dimension: int) -> "EdgePoints":
        """No edge."""
        return cls(np.empty((0, dimension)), np.empty(0), np.empty(0, np.int16), np.empty(0, bool))


def edge_points(
    solids: list[Solid | Outside], nodes: EdgeNodes, origin: np.ndarray, fine_cell: float, shape: np.ndarray
) -> EdgePoints:
    """Points along the edges of these excavations; nodes: those that are moved; shape (d,) finest cells of the
    domain."""
    dimension = len(shape)
    places, ways, turns = [np.empty((0, dimension))], [np.empty((0, dimension))], [np.empty(0)]
    walls, owners = [np.empty((0, 2, dimension))], [np.empty(0, np.int16)]
    for number, solid in enumerate(solids):
        edges = sharp_edges(solid.solid if isinstance(solid, Outside) else solid)
        segments = (edges.segments - origin) / fine_cell
        chosen = is_edge(solid, segments.mean(axis=1), origin, fine_cell)
        segments, turn = segments[chosen], edges.turn[chosen]
        along = segments[:, 1] - segments[:, 0]
        steps = np.maximum(1, np.ceil(np.linalg.norm(along, axis=1) / SPACING).astype(np.int64))
        row = np.repeat(np.arange(len(steps)), steps)
        share = (np.arange(len(row)) - np.repeat(np.cumsum(steps) - steps, steps) + 0.5) / steps[row]
        place = segments[row, 0] + share[:, None] * along[row]
        within = ((place > ON_LATTICE) & (place < shape - ON_LATTICE)).all(axis=1)  # beyond there is no rock
        row = row[within]
        places.append(place[within])
        ways.append(along[row])
        turns.append(turn[row])
        walls.append(edges.normals[chosen][row])
        owners.append(np.full(len(row), number, np.int16))
    place = np.concatenate(places)
    shares = ~(has_node(place, np.concatenate(ways), nodes, shape) | on_faces(place, np.concatenate(walls)))
    return EdgePoints(place, np.pi + np.concatenate(turns), np.concatenate(owners), shares)


def has_node(place: np.ndarray, along: np.ndarray, nodes: EdgeNodes, shape: np.ndarray) -> np.ndarray:
    """(k,) bool: True where a node lies on the straight edge along (k, d) through place (k, d), NODE_DISTANCE away or
    less; along is 0 in plane strain. nodes: those that are moved; shape (d,) finest cells of the domain."""
    moved = nodes.place + nodes.shift
    trees = scipy.spatial.cKDTree(place), scipy.spatial.cKDTree(moved)
    pairs = trees[0].sparse_distance_matrix(trees[1], NODE_DISTANCE, output_type="ndarray")
    nearest = np.rint(place)
    stays = ~np.isin(code_of(nearest.astype(np.int64), shape + 1), code_of(nodes.place, shape + 1))
    point = np.append(np.flatnonzero(stays), pairs["i"])
    node = np.concatenate([nearest[stays], moved[pairs["j"]]])
    apart, length = node - place[point], np.linalg.norm(along, axis=1)
    direction = (along / np.where(length > 0.0, length, 1.0)[:, None])[point]
    apart -= np.sum(apart * direction, axis=1)[:, None] * direction
    return np.bincount(point[np.linalg.norm(apart, axis=1) <= ON_LATTICE], minlength=len(place)) > 0


def on_faces(place: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(k,) bool: True where one of the two walls through place (k, d), of normals (k, 2, d), lies on faces of cells."""
    across = np.abs(normals) > 1.0 - 1e-6
    near = np.abs(place - np.rint(place)) <= ON_LATTICE
    return (across & near[:, None, :]).any(axis=(1, 2))
