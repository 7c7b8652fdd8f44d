"""Nodes of finest cells that are moved onto the edges of openings.

Shape functions of a cut cell reach to nodes in the opening. Along a flat wall such a node carries on what the rock of
the wall does. At an edge of the opening within a cell two walls share it: it would have to carry on the motion of both,
holds each of them, and the opening releases too little energy. A node that lies on the edge itself moves as the rock
there does. So the node of the opening that is nearest to an edge is moved onto it, once for all steps; the cells around
it are distorted (distorted_cells.py), all others stay as they are.
"""

from dataclasses import dataclass

import numpy as np

from mpm_core.geometry.inside import contains
from mpm_core.geometry.sharp_edges import sharp_edges
from mpm_core.geometry.solids import Outside, Solid
from mpm_core.grid.distorted_cells import corner_offsets, smallest_volume_ratio
from mpm_core.grid.octree import all_cells

MAX_REACH = 1.42  # cells: a node farther from an edge than a square cell's diagonal is not moved onto it
ON_LATTICE = 1e-6  # cells: a node as near as that to an edge lies on it
MIN_VOLUME_RATIO = 0.1  # of a distorted cell's volume to a cube's, at each of its samples
SHARES = (1.0, 0.8, 0.6, 0.4)  # of the way to the edge that a node may go where it cannot go all of it
APART = 0.5  # cells: nodes do not go to one place of an edge


@dataclass(frozen=True)
class EdgeNodes:
    """Which nodes are moved, and by how much: place (k, d) int32, fine units; shift (k, d), finest cells."""

    place: np.ndarray
    shift: np.ndarray

    @classmethod
    def none(cls, dimension: int) -> "EdgeNodes":
        """No node is moved."""
        return cls(np.empty((0, dimension), np.int32), np.empty((0, dimension)))

    def of(self, chosen: np.ndarray) -> "EdgeNodes":
        """Those that are chosen, (k,) bool or indices."""
        return EdgeNodes(self.place[chosen], self.shift[chosen])


def choose_edge_nodes(
    solids: list[Solid | Outside], origin: np.ndarray, fine_cell: float, shape: np.ndarray
) -> EdgeNodes:
    """The nodes that edges of these excavations ask for; shape (d,) finest cells of the domain.

    Corners come first, then edges, the nearest node first. A node moves once, and no cell gets smaller than
    MIN_VOLUME_RATIO; if it would, the node goes a part of the way.
    """
    moved: dict[tuple, np.ndarray] = {}
    for solid in solids:
        edges = sharp_edges(solid.solid if isinstance(solid, Outside) else solid)
        to_cells = [(points - origin) / fine_cell for points in edges]
        for segments in (np.repeat(to_cells[1][:, None], 2, axis=1), to_cells[0]):
            _move(solid, segments, origin, fine_cell, shape, moved)
    if not moved:
        return EdgeNodes.none(len(shape))
    place = np.array(list(moved), np.int32)
    order = np.lexsort(place.T)
    return EdgeNodes(place[order], np.array(list(moved.values()))[order])


def _move(solid, segments: np.ndarray, origin, fine_cell: float, shape, moved: dict[tuple, np.ndarray]) -> None:
    """Move nodes inside a solid onto segments (k, 2, d), in finest cells from the origin: into `moved`, by place."""
    place, goal = _nearest_goals(segments, shape)
    if not len(place):
        return
    place, goal = _inside(solid, place, goal, origin, fine_cell)
    distance = np.linalg.norm(goal - place, axis=1)
    goals: dict[tuple, list[np.ndarray]] = {}
    order = np.lexsort((*place.T, np.round(distance, 9)))
    for share in SHARES:
        for i in order:
            key = tuple(place[i].tolist())
            bin_of = np.floor(goal[i]).astype(int)
            near = [g for b in all_cells((3,) * len(shape)) - 1 for g in goals.get(tuple((bin_of + b).tolist()), ())]
            if any(np.sum((g - goal[i]) ** 2) < APART**2 for g in near):
                continue
            if distance[i] > ON_LATTICE:
                if key in moved:
                    continue
                moved[key] = share * (goal[i] - place[i])
                if _smallest_around(place[i], moved) < MIN_VOLUME_RATIO:
                    del moved[key]
                    continue
            goals.setdefault(tuple(bin_of.tolist()), []).append(goal[i])


def _nearest_goals(segments: np.ndarray, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, d) of the lattice, none of the domain's border, within MAX_REACH of segments (k, 2, d), each once; the
    nearest point (n, d) of any of them."""
    dimension = len(shape)
    around = all_cells((4,) * dimension) - 1
    places, goals = [], []
    for start, end in segments:
        steps = max(1, int(np.ceil(2.0 * np.linalg.norm(end - start))))
        points = start + np.linspace(0.0, 1.0, steps + 1)[:, None] * (end - start)
        nodes = np.unique((np.floor(points).astype(np.int64)[:, None, :] + around).reshape(-1, dimension), axis=0)
        along = end - start
        length = along @ along
        share = np.clip((nodes - start) @ along / length, 0.0, 1.0) if length > 0.0 else np.zeros(len(nodes))
        goal = start + share[:, None] * along
        near = np.linalg.norm(goal - nodes, axis=1) <= MAX_REACH
        places.append(nodes[near])
        goals.append(goal[near])
    if not places:
        return np.empty((0, dimension), np.int64), np.empty((0, dimension))
    place, goal = np.concatenate(places), np.concatenate(goals)
    inner = ((place > 0) & (place < shape)).all(axis=1)
    place, goal = place[inner], goal[inner]
    distance = np.linalg.norm(goal - place, axis=1)
    order = np.lexsort((distance, *place.T))
    place, goal = place[order], goal[order]
    first = np.append(True, (place[1:] != place[:-1]).any(axis=1))[: len(place)]
    return place[first], goal[first]


def _inside(solid, place: np.ndarray, goal: np.ndarray, origin, fine_cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Those nodes of which all around lies inside the solid; and those that lie on an edge as they are."""
    corners = ON_LATTICE * 1e3 * (2 * all_cells((2,) * place.shape[1]) - 1)
    points = origin + (place[:, None, :] + corners) * fine_cell
    inside = contains(solid, points.reshape(-1, place.shape[1])).reshape(len(place), -1).all(axis=1)
    kept = inside | (np.linalg.norm(goal - place, axis=1) <= ON_LATTICE)
    return place[kept], goal[kept]


def _smallest_around(node: np.ndarray, moved: dict[tuple, np.ndarray]) -> float:
    """The smallest volume ratio of the cells around a node (d,)."""
    offsets = corner_offsets(len(node))
    corners = (node - offsets)[:, None, :] + offsets
    shifted = offsets.astype(float) + np.array(
        [[moved.get(tuple(corner.tolist()), np.zeros(len(node))) for corner in cell] for cell in corners]
    )
    return smallest_volume_ratio(shifted)
