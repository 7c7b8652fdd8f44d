"""Inside, outside, crossed, and how much of a cell: what the grid needs of a solid.

Inside is where the generalised winding number W exceeds 1/2 in size. So an inverted solid has the same inside
(W = -1), facets repeated or solids overlapping change nothing (W = 2), and a hole is closed by the surface where W
is 1/2. Patches that look outward next to patches that look inward cancel: orientation.py turns or refuses them.
A point outside the bounding box is outside. For `Outside`, what a solid leaves of a box, every answer is reversed.

The 64 sample points of a cell tell how much of it a solid holds.
"""

import numpy as np

from mpm_core.geometry.crossing import CROSSING_TOLERANCE, cell_box, cross_cells, in_box
from mpm_core.geometry.solids import Outside, Solid
from mpm_core.geometry.winding import (
    MAX_EXACT_FACETS,
    PAIRS_PER_CELL,
    POINTS_PER_BLOCK,
    inside_points,
    sample_cells,
    sample_cells_nearby,
    winding_number_by_tree,
)
from mpm_core.simd.threads import threads_for

# 4 x 4 x 4 in 3-D, 8 x 8 in 2-D; a set of them is the bits of one integer.
SAMPLES_PER_CELL = 64  # numba compiles it into kernels (common/kernel_cache.py)

# Sample points are moved outward from the cell's middle by this much of a cell, so that of two solids sharing a face on
# a plane of sample points one and only one owns them. The components differ (powers of a golden ratio), else points
# would stay on diagonal planes.
SAMPLE_OFFSET = CROSSING_TOLERANCE * np.array([1.0, 0.8191725, 0.6710436])

# How far from the cell's middle a sub-cell's point lies within the sub-cell, along one axis, in quarters of the
# sub-cell's edge: 0 nearest. It depends on the sub-cell's place along the other axes, counted from the middle, too. The
# best of the patterns of this form by the error of a half-space's share, over directions of its face.
OUTWARD_2D = np.array([3, 0, 1, 2])
OUTWARD_3D = np.array([[1, 0], [3, 2]])
OUTSIDE, CROSSED, INSIDE = 0, 1, 2
MAX_TREE_POINTS = 1 << 21  # Points handed to the tree at once.


def sample_points(dimension: int) -> np.ndarray:
    """Offsets (dimension, 64) of the sample points from a cell's lower corner, in cells, in bit order, nudged.

    One point per sub-cell, moved within it so that a flat wall moving through the cell meets few points at a time
    (multi-jittered sampling, Chiu et al. 1994), where sub-cell centres would come in whole layers. The pattern is its
    own image in mirrors across the axes and in exchanges of axes (3-D: cyclic ones), so mirrored openings have mirrored
    cells. Along each axis the points lie at 32 (3-D: 16) evenly spaced places, the most that mirrors across the other
    axes allow. So an axis-parallel wall that lies at a 32nd (16th) of a cell has its exact share. Any other has a share
    within 1/64 (2/64).
    """
    per_edge = 8 if dimension == 2 else 4
    along = np.meshgrid(*[np.arange(per_edge)] * dimension, indexing="ij")
    side = [np.where(2 * i < per_edge, -1, 1) for i in along]
    ring = [np.abs(2 * i + 1 - per_edge) // 2 for i in along]  # 0 beside the middle
    if dimension == 2:
        outward = [OUTWARD_2D[ring[1]], OUTWARD_2D[ring[0]]]
    else:
        outward = [OUTWARD_3D[ring[(axis + 1) % 3], ring[(axis + 2) % 3]] for axis in range(3)]
    places = [
        0.5 + side[axis] * ((ring[axis] + (outward[axis] + 0.5) / 4) / per_edge + SAMPLE_OFFSET[axis])
        for axis in range(dimension)
    ]
    # bit i + 4 j + 16 k: the first axis runs fastest
    return np.stack([place.ravel(order="F") for place in places])


def contains(solid: Solid | Outside, points: np.ndarray) -> np.ndarray:
    """(point,) bool: True where a point (point, dimension) m lies inside the solid. On the surface it may be either.

    Exact up to MAX_EXACT_FACETS facets and in 2-D; beyond, in 3-D, W by libigl's tree (Barill et al. 2018) is good to
    0.5 % and coordinates to 1e-7 of the solid's size. Deterministic, whatever the number of threads.
    """
    if isinstance(solid, Outside):
        return ~contains(solid.solid, points)
    points = np.asarray(points, dtype=np.float64).reshape(-1, solid.dimension)
    center = solid.bounds.mean(axis=0)
    inside = np.zeros(len(points), dtype=bool)
    near = np.flatnonzero(in_box(points, *solid.bounds))
    inside[near] = _contains(solid.corners(center), points[near] - center)
    return inside


def _contains(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """`contains` for corners (facet, corner, dimension) and points (point, dimension) near one local origin."""
    inside = np.zeros(len(points), dtype=bool)
    if corners.shape[2] == 2 or len(corners) <= MAX_EXACT_FACETS:
        with threads_for(len(points) * len(corners) // PAIRS_PER_CELL):
            inside_points(corners, np.ascontiguousarray(points), inside)
        return inside
    winding_number = winding_number_by_tree(corners)
    for first in range(0, len(points), MAX_TREE_POINTS):
        chunk = slice(first, first + MAX_TREE_POINTS)
        inside[chunk] = np.abs(winding_number(points[chunk])) > 0.5
    return inside


def classify_cells(solid: Solid | Outside, origin: np.ndarray, cell_size: float, index: np.ndarray) -> np.ndarray:
    """Position of each cell: OUTSIDE (0), CROSSED (1) by the surface, INSIDE (2), as (cell,) int8.

    Cell n covers origin + index[n] * cell_size to one cell_size more. origin (dimension,) m; cell_size m; index (cell,
    dimension) int32. A facet within 1e-6 of a cell from a cell's face lies in that face and crosses neither neighbour.
    A crossed cell need not hold any volume of the solid, nor need a cell in a hole of the surface be crossed.
    """
    if isinstance(solid, Outside):
        return INSIDE - classify_cells(solid.solid, origin, cell_size, index)
    index = np.asarray(index, dtype=np.int32).reshape(-1, solid.dimension)
    kind = np.zeros(len(index), dtype=np.int8)
    corners = solid.corners(origin) / cell_size
    crossed, undecided = cross_cells(corners, index)
    kind[crossed] = CROSSED
    rest = np.flatnonzero(undecided)
    center = corners.reshape(-1, solid.dimension).mean(axis=0)
    kind[rest[_contains(corners - center, index[rest] + 0.5 - center)]] = INSIDE
    return kind


def sample_mask(solid: Solid | Outside, origin: np.ndarray, cell_size: float, index: np.ndarray) -> np.ndarray:
    """The points of each cell, of 64, that lie inside, one bit each, as (cell,) uint64. Arguments as in classify_cells.

    One point in each of 4 x 4 x 4 sub-cells, bit i + 4 j + 16 k; in 2-D in each of 8 x 8, bit i + 8 j (i along the
    first axis). popcount(mask) / 64 is the share of the cell inside; `a & ~b` takes solid b out of solid a. A share is
    good to some 2 % of the cell where a smooth surface passes (sample_points); a sheet thinner than a sub-cell may miss
    all points.
    """
    if isinstance(solid, Outside):
        return ~sample_mask(solid.solid, origin, cell_size, index)
    index = np.asarray(index, dtype=np.int32).reshape(-1, solid.dimension)
    mask = np.zeros(len(index), dtype=np.uint64)
    corners = solid.corners(origin) / cell_size
    lower, upper = cell_box(corners, index)
    near = np.flatnonzero(in_box(index, lower, upper - 1))
    samples = sample_points(solid.dimension)
    if solid.dimension == 2 or len(corners) <= MAX_EXACT_FACETS:
        found = np.zeros(len(near), dtype=np.uint64)
        with threads_for(len(near) * len(corners) * SAMPLES_PER_CELL // PAIRS_PER_CELL):
            sample_cells(corners, index[near], samples, found)
        mask[near] = found
        return mask
    center = corners.reshape(-1, 3).mean(axis=0)
    winding_number = winding_number_by_tree(corners - center)
    if solid.is_closed:
        mask[near], done = sample_cells_nearby(
            corners, index[near], samples, lambda points: winding_number(points - center)
        )
        near = near[~done]
    for first in range(0, len(near), MAX_TREE_POINTS // POINTS_PER_BLOCK):
        cells = near[first : first + MAX_TREE_POINTS // POINTS_PER_BLOCK]
        points = (index[cells] - center)[:, None, :] + samples.T
        inside = (np.abs(winding_number(points.reshape(-1, 3))) > 0.5).reshape(-1, POINTS_PER_BLOCK)
        mask[cells] = np.packbits(inside, axis=1, bitorder="little").view("<u8")[:, 0]
    return mask


def popcount(mask: np.ndarray) -> np.ndarray:
    """Number of sample points set in each mask: (cell,) uint8, 0 to 64."""
    return np.bitwise_count(np.asarray(mask, dtype=np.uint64))
