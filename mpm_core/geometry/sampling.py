"""The 64 points of a cell that say how much of it a solid holds."""

import numpy as np

from mpm_core.geometry.crossing import CROSSING_TOLERANCE

# 4 x 4 x 4 in 3-D, 8 x 8 in 2-D; a set of them is the bits of one integer.
SAMPLES_PER_CELL = 64

# Sample points are moved outward from the cell's middle by this much of a cell, so that of two solids sharing a face on
# a plane of sample points one and only one owns them. The components differ (powers of a golden ratio), else points
# would stay on diagonal planes.
SAMPLE_OFFSET = CROSSING_TOLERANCE * np.array([1.0, 0.8191725, 0.6710436])

# How far from the cell's middle a sub-cell's point lies within the sub-cell, along one axis, in quarters of the
# sub-cell's edge: 0 nearest. It depends on the sub-cell's place along the other axes, counted from the middle, too. The
# best of the patterns of this form by the error of a half-space's share, over directions of its face.
OUTWARD_2D = np.array([3, 0, 1, 2])
OUTWARD_3D = np.array([[1, 0], [3, 2]])


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
