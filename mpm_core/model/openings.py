"""The openings of a mine, whatever the cells of a grid: what the rock around them depends on, step by step."""

from dataclasses import dataclass

import numpy as np

from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid.edge_nodes import MAX_BALL_SHARE
from mpm_core.grid.edge_points import EdgePoints
from mpm_core.grid.octree import all_cells
from mpm_core.grid.splitting import code_of
from mpm_core.model.skins import find_skins

BOX_HALF_WIDTH = 1.5  # finest cells; the void in a cube around a point decides whether rock has an edge there
NEVER = np.iinfo(np.int32).max


@dataclass(frozen=True)
class Openings:
    """Points along the edges of excavations, and the parts of finest cells that are mined.

    since, until (point,): steps from the first of which, and before the second of which, rock has an edge there; NEVER
    without one. place (piece, d) finest cells; share (piece,) of each that is mined in step mined (piece,). Rock that
    comes loose and falls is no part of it.
    """

    points: EdgePoints
    since: np.ndarray
    until: np.ndarray
    place: np.ndarray
    share: np.ndarray
    mined: np.ndarray

    @classmethod
    def of(
        cls, points: EdgePoints, place: np.ndarray, samples: np.ndarray, excavation: np.ndarray, mined: np.ndarray
    ) -> "Openings":
        """The openings of excavations, mined in steps mined (excavation,), negative: never; place (piece, d), samples
        (piece,) uint64, excavation (piece,): parts of finest cells."""
        step = mined[excavation]
        now = step >= 0
        place, step, excavation = place[now], step[now], excavation[now]
        share = _shares_mined(place, samples[now], step)
        point, piece, void = _parts_near(points, place, share)
        own = np.unique(point[points.excavation[point] == excavation[piece]])  # others are too small for these cells
        since = np.full(len(points.place), NEVER)
        since[own] = mined[points.excavation[own]]
        return cls(points, since, _end_of_edges(point, step[piece], void, len(since)), place, share, step)

    @classmethod
    def none(cls, dimension: int) -> "Openings":
        """Nothing is mined."""
        empty = np.empty(0, np.int64)
        return cls(EdgePoints.none(dimension), empty, empty, np.empty((0, dimension), np.int32), np.empty(0), empty)

    def edge_points(self, step: int) -> EdgePoints:
        """Points at which rock has an edge once `step` is mined."""
        return EdgePoints(*(column[(self.since <= step) & (step < self.until)] for column in self.points))

    def skins(self, step: int, shape: np.ndarray, free: list[tuple[int, int]]) -> np.ndarray:
        """Places (k, d) of the cells of skins once `step` is mined, see find_skins: a cell less than half rock is
        void."""
        now = self.mined <= step
        places, number = np.unique(self.place[now], axis=0, return_inverse=True)
        mined = np.bincount(number.reshape(-1), self.share[now], minlength=len(places))
        return find_skins(places[mined > 0.5], shape, free)


def _shares_mined(place: np.ndarray, samples: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Share (piece,) of its cell that each part opens: what an earlier one has mined is open already.

    place (piece, d), samples (piece,) uint64, step (piece,): parts of finest cells, and when they are mined.
    """
    _, cell, count = np.unique(place, axis=0, return_inverse=True, return_counts=True)
    cell = cell.reshape(-1)
    order = np.lexsort((step, cell))
    rank = np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
    opened, opens = np.zeros(len(count), np.uint64), np.zeros(len(cell), np.uint64)
    for place_in_order in range(count.max(initial=0)):
        part = order[rank == place_in_order]
        opens[part] = samples[part] & ~opened[cell[part]]
        opened[cell[part]] |= samples[part]
    return np.bitwise_count(opens) / SAMPLES_PER_CELL


def _parts_near(points: EdgePoints, place: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of a point and a part of a finest cell in the cube around it: point, piece (pair,), and the share of the
    cube that the part is. place (piece, d), share (piece,): see Openings."""
    dimension = points.place.shape[1]
    width = 2 * int(np.ceil(BOX_HALF_WIDTH))
    around = all_cells((width,) * dimension) - width // 2
    cells = np.floor(points.place + 0.5).astype(np.int64)[:, None, :] + around
    inner = np.minimum(cells + 1, points.place[:, None, :] + BOX_HALF_WIDTH)
    inner -= np.maximum(cells, points.place[:, None, :] - BOX_HALF_WIDTH)
    overlap = np.prod(np.maximum(inner, 0.0), axis=2).ravel() / (2.0 * BOX_HALF_WIDTH) ** dimension
    cells = cells.reshape(-1, dimension)
    lower = np.minimum(cells.min(axis=0, initial=0), place.min(axis=0, initial=0))
    shape = np.maximum(cells.max(axis=0, initial=0), place.max(axis=0, initial=0)) - lower + 1
    order = np.argsort(code_of(place - lower, shape), kind="stable")
    code = code_of(place - lower, shape)[order]
    own = code_of(cells - lower, shape)
    first, end = np.searchsorted(code, own, side="left"), np.searchsorted(code, own, side="right")
    row = np.repeat(np.arange(len(own)), end - first)
    piece = order[np.arange(len(row)) - np.repeat(np.cumsum(end - first) - (end - first), end - first) + first[row]]
    return row // len(around), piece, overlap[row] * share[piece]


def _end_of_edges(point: np.ndarray, step: np.ndarray, void: np.ndarray, count: int) -> np.ndarray:
    """The step (count,) in which mining next to an edge point leaves one flat wall, NEVER if none does.

    More of the cube around it than MAX_BALL_SHARE is void then. point, step, void (pair,): a share of the cube around a
    point is mined in a step.
    """
    by_step = np.lexsort((step, point))
    point, step, void = point[by_step], step[by_step], void[by_step]
    total = np.cumsum(void)
    total -= np.append(0.0, total)[np.searchsorted(point, point)]
    until = np.full(count, NEVER)
    flat = total > MAX_BALL_SHARE
    np.minimum.at(until, point[flat], step[flat])
    return until
