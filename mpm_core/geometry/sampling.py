"""The 64 points of a cell that say how much of it a solid holds."""

import numpy as np

from mpm_core.geometry.crossing import TOLERANCE

# Sample points are moved by this much of a cell, so that of two solids sharing a face on a plane of sample points one
# and only one owns them. The components differ (powers of a golden ratio), else points would stay on diagonal planes.
NUDGE = TOLERANCE * np.array([1.0, 0.8191725, 0.6710436])

# A sub-cell's point along one axis, in 8ths (16ths) of the sub-cell, by the sub-cell's place along the other axes. The
# best of the point-symmetric patterns of this form by the error of a half-space's share; in 2-D, bit reversal.
PLACES_2D = np.array([0, 4, 2, 6, 1, 5, 3, 7])
PLACES_3D = 4 * np.array([2, 0, 3, 1])[:, None] + np.array([0, 2, 1, 3])


def sample_points(dimension: int) -> np.ndarray:
    """Offsets (dimension, 64) of the sample points from a cell's lower corner, in cells, in bit order, nudged.

    One point per sub-cell, moved within it so that along each axis all 64 points are at different, evenly spaced places
    (multi-jittered sampling, Chiu et al. 1994). A flat wall moving through the cell then meets one point after the
    other, where sub-cell centres would come in whole layers: the share beside an axis-parallel wall is good to 1 %
    instead of 8 %, beside a wall at 45 degrees to 1.4 instead of 4.3 %. The pattern is symmetric about a cell's centre,
    but not its own image in a mirror: mirrored openings are sampled alike only to these figures (1/64 or 2/64).
    """
    if dimension == 2:
        i, j = np.meshgrid(np.arange(8), np.arange(8), indexing="ij")
        places = [(i + (PLACES_2D[j] + 0.5) / 8) / 8, (j + (PLACES_2D[i] + 0.5) / 8) / 8]
    else:
        i, j, k = np.meshgrid(np.arange(4), np.arange(4), np.arange(4), indexing="ij")
        places = [(a + (PLACES_3D[b, c] + 0.5) / 16) / 4 for a, b, c in ((i, j, k), (j, k, i), (k, i, j))]
    # bit i + 4 j + 16 k: the first axis runs fastest
    return np.stack([place.ravel(order="F") for place in places]) + NUDGE[:dimension, None]
