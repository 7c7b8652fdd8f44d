"""Sharp edges of a solid: where its surface turns by so much that the rock around it has two walls."""

from typing import NamedTuple

import numpy as np

from mpm_core.geometry.edges import unique_rows
from mpm_core.geometry.solids import Solid

MIN_TURN = np.radians(55.0)  # between the normals of two facets that meet in a sharp edge
MIN_BEND = np.radians(30.0)  # between two sharp edges that meet in a corner


class SharpEdges(NamedTuple):
    """Edges on which a solid is convex and turns by MIN_TURN or more, and the corners in which they end.

    The rock outside has a re-entrant edge there. In plane strain the vertices of the outline are the corners.
    """

    segments: np.ndarray
    """(segment, 2, d) m"""
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
    keys = keys[pairs[(turn >= MIN_TURN) & convex]]
    if dimension == 2:
        return SharpEdges(np.empty((0, 2, 2)), vertices[keys[:, 0]])
    return SharpEdges(vertices[keys], vertices[_bends(vertices, keys)])


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
