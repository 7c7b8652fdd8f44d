"""Slow and obvious versions of the kernels, and grids of cells: what the tests measure against."""

import numpy as np

from mpm_core.geometry import Solid


def winding_number(solid: Solid, points: np.ndarray) -> np.ndarray:
    """Generalised winding number by the textbook formula: an arc tangent per facet (per segment in 2-D)."""
    total = np.zeros(len(points))
    for corners in solid.vertices[solid.facets]:
        seen = [corner - points for corner in corners]
        if solid.dimension == 2:
            a, b = seen
            total += np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(1)) / (2 * np.pi)
            continue
        a, b, c = seen
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in seen)
        triple = (a * np.cross(b, c)).sum(1)
        below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        total += 2 * np.arctan2(triple, below) / (4 * np.pi)
    return total


def facet_meets_open_cube(corners: np.ndarray, center: np.ndarray, half: float) -> bool:
    """Clip the facet (corner, dimension) by the cube's half-spaces (Sutherland-Hodgman): does anything remain?"""
    polygon = [corner - center for corner in corners]
    if (np.min(polygon, axis=0) > half).any() or (np.max(polygon, axis=0) < -half).any():
        return False
    for axis in range(corners.shape[1]):
        for side in (-1.0, 1.0):
            clipped = []
            for n, p in enumerate(polygon):
                q = polygon[(n + 1) % len(polygon)]
                p_in, q_in = side * p[axis] <= half, side * q[axis] <= half
                if p_in:
                    clipped.append(p)
                if p_in != q_in:
                    clipped.append(p + (side * half - p[axis]) / (q[axis] - p[axis]) * (q - p))
            polygon = clipped
            if not polygon:
                return False
    return True


def classify(solid: Solid, origin, cell_size: float, index: np.ndarray) -> np.ndarray:
    """0 outside, 1 crossed, 2 inside: every facet clipped against every cell."""
    corners = (solid.vertices - origin)[solid.facets] / cell_size
    kind = np.zeros(len(index), dtype=np.int8)
    for n, cell in enumerate(index):
        if any(facet_meets_open_cube(facet, cell + 0.5, 0.5 - 1e-6) for facet in corners):
            kind[n] = 1
    rest = np.flatnonzero(kind == 0)
    centers = origin + (index[rest] + 0.5) * cell_size
    kind[rest[np.abs(winding_number(solid, centers)) > 0.5]] = 2
    return kind


def cells(*counts: int, start: int = 0) -> np.ndarray:
    """Indices (cell, dimension) int32 of a block of cells from `start` per axis."""
    axes = np.meshgrid(*[np.arange(start, start + count) for count in counts], indexing="ij")
    return np.stack([axis.ravel() for axis in axes], axis=1).astype(np.int32)


def rotation(seed: int) -> np.ndarray:
    """A random proper rotation matrix (3, 3)."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q if np.linalg.det(q) > 0 else q[:, ::-1]


def moved(solid: Solid, matrix: np.ndarray | None = None, shift=0.0) -> Solid:
    """The solid turned or stretched by a matrix, then shifted."""
    vertices = solid.vertices if matrix is None else solid.vertices @ matrix.T
    return Solid(solid.name, vertices + shift, solid.facets)


def joined(*solids: Solid) -> Solid:
    """Several solids as one."""
    before = np.cumsum([0] + [len(solid.vertices) for solid in solids])
    facets = [solid.facets + start for solid, start in zip(solids, before, strict=False)]
    return Solid(solids[0].name, np.concatenate([s.vertices for s in solids]), np.concatenate(facets))
