"""The closed surface of boxes that do not overlap: watertight triangles that look outward.

A face of a box is part of the surface as far as no other box lies behind it. Faces of unequal boxes meet, so a face has
on its sides all corners of other faces that lie there: no triangle ends in the middle of another one's side.

Two boxes may touch along an edge or in a corner only. Four faces meet at such an edge, which many programs refuse.
There each of the two bodies gets corners of its own, GAP of the lattice's unit inside of it. So two faces meet at every
edge.
"""

from typing import NamedTuple

import numpy as np
import scipy  # imports its parts as they are used
from numpy.typing import NDArray

from export.failed_boxes import Boxes

# Distance of corners from where two bodies touch, in units of the lattice along each axis. If all units touched others
# along all of their edges, as in a chess-board, they would lose 0.9 % of their volume.
GAP = 0.0015


class Surface(NamedTuple):
    """Vertices (vertex, 3) and triangles (triangle, 3), counter-clockwise as seen from outside."""

    vertices: NDArray
    triangles: NDArray

    @property
    def volume(self) -> float:
        """Volume enclosed, that of cavities left out, by the theorem of Gauss."""
        if not len(self.triangles):
            return 0.0
        corners = (self.vertices - self.vertices[0])[self.triangles]
        return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)


class Rectangles(NamedTuple):
    """Faces across an axis of space: axis (face,), side (face,) 1 if they look along it, else 0; lower corner (face, 3)
    and extent (face, 3), which is 0 along the axis."""

    axis: NDArray
    side: NDArray
    lower: NDArray
    extent: NDArray


def closed_surface(boxes: Boxes, axes: tuple[int, ...]) -> Surface:
    """Closed surface of boxes, in units of their lattice.

    axes: of space, of the boxes' own. In 2-D the boxes are extruded from 0 to 1 along the third one.
    """
    if not len(boxes.width):
        return Surface(np.empty((0, 3)), np.empty((0, 3), np.int64))
    faces = in_space(outer_faces(boxes), axes)
    if len(axes) == 2:
        faces = _joined(faces, caps(boxes, axes))
    return triangulated(faces)


def outer_faces(boxes: Boxes) -> Rectangles:
    """Faces of boxes with no box behind them: their axis is one of the boxes' own, lower and extent have d columns."""
    dimension = boxes.lower.shape[1]
    base = boxes.lower.min(axis=0)
    shape = tuple((boxes.lower + boxes.width[:, None]).max(axis=0) - base + 1)
    found = []
    for axis in range(dimension):
        waiting: dict[int, tuple[NDArray, NDArray]] = {}  # faces of each width: side and lower corner
        for width in boxes.widths:
            own = boxes.lower[boxes.width == width] - base
            behind = own + np.where(np.arange(dimension) == axis, width, 0)
            waiting[width] = (np.repeat([0, 1], len(own)), np.concatenate([own, behind]))
        for number in range(len(boxes.widths) - 1, -1, -1):
            width = boxes.widths[number]
            side, lower = without_opposite(*waiting[width], shape)
            divided = np.zeros(len(side), bool)
            across = np.arange(dimension) != axis
            for narrower in boxes.widths[:number]:
                divided |= _has_within(side, lower, *waiting[narrower], width, across, base, shape)
            kept = np.flatnonzero(~divided)
            extent = np.where(across, width, 0)
            found.append(
                Rectangles(np.full(len(kept), axis), side[kept], lower[kept] + base, np.tile(extent, (len(kept), 1)))
            )
            if divided.any():
                narrower = boxes.widths[number - 1]
                side, lower = _parts(side[divided], lower[divided], width, narrower, across)
                before = waiting[narrower]
                waiting[narrower] = np.concatenate([before[0], side]), np.concatenate([before[1], lower])
    return _joined(*found)


def _joined(*parts: Rectangles) -> Rectangles:
    return Rectangles(*map(np.concatenate, zip(*parts, strict=True)))


def without_opposite(side: NDArray, lower: NDArray, shape: tuple[int, ...]) -> tuple[NDArray, NDArray]:
    """Faces of one width that lie on no other one, which looks the other way."""
    code = np.ravel_multi_index(tuple(lower.T), shape)
    _, row, count = np.unique(code, return_inverse=True, return_counts=True)
    kept = count[row] == 1
    return side[kept], lower[kept]


def _has_within(side, lower, other_side, other_lower, width, across, base, shape) -> NDArray:
    """Faces (face,) bool of a width that have a narrower face within, which looks the other way."""
    place = other_lower + base
    place = np.where(across, place // width * width, place) - base
    # the face of this width around a narrower one may begin before the lattice's first box
    inside = (place >= 0).all(axis=1)
    code = np.ravel_multi_index(tuple(lower.T), shape) * 2 + side
    return np.isin(code, np.ravel_multi_index(tuple(place[inside].T), shape) * 2 + 1 - other_side[inside])


def _parts(side, lower, width, narrower, across) -> tuple[NDArray, NDArray]:
    """Faces divided into narrower ones."""
    steps = [np.arange(width // narrower) * narrower if free else np.zeros(1, np.int64) for free in across]
    offsets = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, len(across))
    return np.repeat(side, len(offsets)), (lower[:, None] + offsets).reshape(-1, len(across))


def in_space(faces: Rectangles, axes: tuple[int, ...]) -> Rectangles:
    """Faces of boxes of these axes in space; those of squares are extruded from 0 to 1."""
    lower, extent = (np.zeros((len(faces.axis), 3), np.int64) for _ in range(2))
    lower[:, list(axes)], extent[:, list(axes)] = faces.lower, faces.extent
    for missing in {0, 1, 2} - {*axes}:
        extent[:, missing] = 1
    return Rectangles(np.array(axes)[faces.axis], faces.side, lower, extent)


def caps(boxes: Boxes, axes: tuple[int, ...]) -> Rectangles:
    """Both ends of extruded squares."""
    (missing,) = {0, 1, 2} - {*axes}
    count = len(boxes.width)
    lower, extent = np.zeros((2 * count, 3), np.int64), np.zeros((2 * count, 3), np.int64)
    lower[:, list(axes)] = np.tile(boxes.lower, (2, 1))
    extent[:, list(axes)] = np.tile(boxes.width, 2)[:, None]
    side = np.repeat([0, 1], count)
    lower[:, missing] = side
    return Rectangles(np.full(2 * count, missing), side, lower, extent)


class Loops(NamedTuple):
    """Sides of polygons, one after another: start and end (side,) rows of points, face (side,) ascending."""

    start: NDArray
    end: NDArray
    face: NDArray


def triangulated(faces: Rectangles) -> Surface:
    """Triangles of faces that enclose bodies; every edge is one of two triangles."""
    corners = _corners(faces) * 2  # so that the middle of each edge is a place, too
    place, loops = with_corners_on_sides(corners)
    normal = np.zeros((len(faces.axis), 3), np.int64)
    normal[np.arange(len(faces.axis)), faces.axis] = 2 * faces.side - 1
    place, loops = with_middles(place, loops)
    center = faces.lower * 2 + faces.extent
    place, triangles, of_face = _fans(place, loops, center)
    return _separated(place, triangles, normal[of_face])


def _corners(faces: Rectangles) -> NDArray:
    """Corners (face, 4, 3), counter-clockwise as seen from outside."""
    first, second = (faces.axis + 1) % 3, (faces.axis + 2) % 3
    rows = np.arange(len(faces.axis))
    along = np.zeros((2, len(rows), 3), np.int64)
    along[0, rows, first] = faces.extent[rows, first]
    along[1, rows, second] = faces.extent[rows, second]
    one, two = np.where(faces.side[:, None] == 1, along, along[::-1])
    return np.stack([faces.lower, faces.lower + one, faces.lower + one + two, faces.lower + two], axis=1)


def with_corners_on_sides(corners: NDArray) -> tuple[NDArray, Loops]:
    """Places (point, 3) of all corners, each once, and loops of faces with all of them that lie on their sides.

    corners (face, 4, 3) int64.
    """
    base = corners.min(axis=(0, 1))
    shape = tuple(corners.max(axis=(0, 1)) - base + 1)
    code = np.ravel_multi_index(tuple((corners - base).reshape(-1, 3).T), shape)
    known, row = np.unique(code, return_inverse=True)
    place = np.stack(np.unravel_index(known, shape), axis=1) + base
    start = row.reshape(-1)
    end = row.reshape(-1, 4)[:, [1, 2, 3, 0]].reshape(-1)
    difference = place[end] - place[start]
    axis, forward = np.abs(difference).argmax(axis=1), difference.sum(axis=1) > 0
    first, count = np.zeros(len(start), np.int64), np.zeros(len(start), np.int64)
    ranked = np.empty((3, len(place)), np.int64)
    for direction in range(3):
        order = [other for other in range(3) if other != direction] + [direction]
        line = np.ravel_multi_index(tuple((place - base)[:, order].T), tuple(shape[other] for other in order))
        ranked[direction] = np.argsort(line)
        sorted_line = line[ranked[direction]]
        own = np.flatnonzero(axis == direction)
        low, high = np.where(forward[own], start[own], end[own]), np.where(forward[own], end[own], start[own])
        first[own] = np.searchsorted(sorted_line, line[low]) + 1
        count[own] = np.searchsorted(sorted_line, line[high]) - first[own]
    side = np.repeat(np.arange(len(start)), count + 1)
    number = np.arange(len(side)) - np.repeat(np.cumsum(count + 1) - count - 1, count + 1)  # 0: the side's own start
    rank = first[side] + np.where(forward[side], number - 1, count[side] - number)
    inner = ranked[axis[side], np.clip(rank, 0, len(place) - 1)]
    points = np.where(number == 0, start[side], inner)
    return place, _loops(points, side // 4)


def _loops(points: NDArray, face: NDArray) -> Loops:
    """Loops through points (side,), the start of each side in order."""
    last = np.flatnonzero(np.append(face[1:] != face[:-1], True))
    first = np.append(0, last[:-1] + 1)
    following = np.append(points[1:], points[:1])
    following[last] = points[first]
    return Loops(points, following, face)


def with_middles(place: NDArray, loops: Loops) -> tuple[NDArray, Loops]:
    """The same with the middle of each side at which more than two faces meet."""
    low, high = np.minimum(loops.start, loops.end), np.maximum(loops.start, loops.end)
    _, first, edge, count = np.unique(
        low * len(place) + high, return_index=True, return_inverse=True, return_counts=True
    )
    shared = np.flatnonzero(count > 2)
    if not len(shared):
        return place, loops
    number = np.full(len(count), -1)
    number[shared] = len(place) + np.arange(len(shared))
    middle = (place[low[first[shared]]] + place[high[first[shared]]]) // 2
    added = number[edge] >= 0
    side = np.repeat(np.arange(len(edge)), 1 + added)
    is_middle = np.append(False, side[1:] == side[:-1])
    points = np.where(is_middle, number[edge[side]], loops.start[side])
    return np.concatenate([place, middle]), _loops(points, loops.face[side])


def _fans(place: NDArray, loops: Loops, center: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Triangles of loops: two of one with four sides, else one of each side and the face's centre (face, 3).

    Gives the places with the centres, triangles (triangle, 3) and the face of each.
    """
    sides = np.bincount(loops.face, minlength=len(center))
    plain = np.flatnonzero(sides == 4)
    first = (np.cumsum(sides) - sides)[plain]
    a, b, c, d = (loops.start[first + number] for number in range(4))
    fanned = np.flatnonzero(sides[loops.face] != 4)
    face = loops.face[fanned]
    named, row = np.unique(face, return_inverse=True)
    fans = np.stack([loops.start[fanned], loops.end[fanned], len(place) + row], axis=1)
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1), fans])
    return np.concatenate([place, center[named]]), triangles, np.concatenate([plain, plain, face])


def _separated(place: NDArray, triangles: NDArray, normal: NDArray) -> Surface:
    """The surface in units of the lattice (places are doubled), with own points of each body where two of them touch.

    normal (triangle, 3) int64.
    """
    start, end = triangles.reshape(-1), triangles[:, [1, 2, 0]].reshape(-1)
    corner = np.arange(len(start))
    following = corner.reshape(-1, 3)[:, [1, 2, 0]].reshape(-1)
    edge = np.minimum(start, end) * len(place) + np.maximum(start, end)
    edge = np.unique(edge, return_inverse=True)[1]
    # of four faces at an edge, two bound the same quarter around it: n x e leads into the face, -n into the body
    outward = np.repeat(normal, 3, axis=0)
    quarter = np.cross(outward, np.sign(place[end] - place[start])) - outward
    shared = np.bincount(edge)[edge] > 2
    code = np.where(shared, (quarter + 2) @ np.array([25, 5, 1]), 0)
    order = np.lexsort((code, edge))
    one, two = order[::2], order[1::2]
    assert np.array_equal(edge[one], edge[two])  # every side has its pair
    assert np.array_equal(code[one], code[two])
    # triangles on both sides run along an edge in opposite directions
    links = np.concatenate([np.stack([one, following[two]]), np.stack([following[one], two])], axis=1)
    graph = scipy.sparse.coo_array((np.ones(links.shape[1], np.int8), tuple(links)), shape=(len(start), len(start)))
    count, body = scipy.sparse.csgraph.connected_components(graph, directed=False)
    point = np.empty(count, np.int64)
    point[body] = start
    is_split = np.bincount(point, minlength=len(place))[point] > 1
    vertices = place[point] / 2.0
    inward = np.zeros((count, 3))
    for sign in (-1, 1):
        for axis in range(3):
            looks = np.zeros(count, bool)
            looks[body[outward[:, axis] == sign]] = True
            inward[:, axis] -= sign * looks
    vertices[is_split] += GAP * inward[is_split]
    return Surface(vertices, body.reshape(-1, 3))
