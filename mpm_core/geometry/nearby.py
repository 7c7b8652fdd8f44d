"""Sample points of cells in a closed solid of many facets: only the facets near a cell are summed point by point.

Between the sample points of one cell, the winding number W of all facets further than NEAR_CELLS cells changes little:
at most by 0.2 from the cell's middle, where they leave a round opening of that radius. In a closed solid W is a whole
number, so a constant serves for them: W at one sample point (libigl's tree) less the near facets' part there. Two such
points must agree, else one of them lies on the surface and the cell is left to the tree.
"""

from collections.abc import Callable

import numpy as np
from numba import njit, prange

from mpm_core.geometry.winding import POINTS_PER_BLOCK, inside_block

CELLS_PER_BIN = 4  # Cells per edge of the bins that share a list of near facets.
NEAR_CELLS = 3.0  # Facets within this many cells of a bin are near.
MAX_NEAR_FACETS = 3000  # Where a bin has more near facets, the tree is the faster way for its cells.
# Sample points next to the cell's middle, (1, 1, 1) and (2, 2, 2) of 4 x 4 x 4.
REFERENCE_SAMPLES = np.array([21, 42])
MAX_WINDING_DIFFERENCE = 0.3  # Far facets count the same for both reference samples if they differ by less.


def sample_cells_nearby(
    corners: np.ndarray, index: np.ndarray, samples: np.ndarray, winding_number: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Masks (cell,) uint64 as by winding.sample_cells, and which cells (cell,) bool have got one.

    corners (facet, 3, 3) float64 of a closed solid, in cells; index (cell, 3) int32; samples (3, POINTS_PER_BLOCK)
    float64; winding_number of points (point, 3), in cells.
    """
    bins, bin_of_cell = np.unique(index // CELLS_PER_BIN, axis=0, return_inverse=True)
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    counts = np.empty(len(bins), dtype=np.int64)
    nothing = np.empty(0, dtype=np.int64)
    _near_facets(bins, lower, upper, False, nothing, nothing, counts)
    counts[counts > MAX_NEAR_FACETS] = 0
    first = np.concatenate([[0], np.cumsum(counts)])
    facets = np.empty(first[-1], dtype=np.int64)
    _near_facets(bins, lower, upper, True, first[:-1], facets, counts)
    mask, done = np.zeros(len(index), dtype=np.uint64), np.zeros(len(index), dtype=bool)
    cells = np.flatnonzero(counts[bin_of_cell.reshape(-1)] > 0)
    points = index[cells][:, None, :] + samples.T[REFERENCE_SAMPLES]
    known = winding_number(points.reshape(-1, 3)).reshape(-1, len(REFERENCE_SAMPLES))
    list_of_cell = bin_of_cell.reshape(-1)[cells]
    found, settled = np.zeros(len(cells), dtype=np.uint64), np.zeros(len(cells), dtype=bool)
    _sample_cells(
        corners, index[cells], samples, known, first[list_of_cell], counts[list_of_cell], facets, found, settled
    )
    mask[cells], done[cells] = found, settled
    return mask, done


@njit(parallel=True, cache=True)
def _near_facets(bins, lower, upper, listing, first, facets, counts):
    """Count the facets whose bounding box is within NEAR_CELLS of each bin, or list them if `listing`.

    bins (bin, 3) int32; lower, upper (facet, 3) float64; first, counts (bin,) int64; facets (sum of counts,) int64.
    Written in place: `counts`; when listing, the counts[bin] entries of `facets` from first[bin] on (none if 0).
    """
    for b in prange(bins.shape[0]):
        if listing and counts[b] == 0:
            continue
        found = 0
        for f in range(lower.shape[0]):
            near = True
            for axis in range(3):
                near &= lower[f, axis] < (bins[b, axis] + 1) * CELLS_PER_BIN + NEAR_CELLS
                near &= upper[f, axis] > bins[b, axis] * CELLS_PER_BIN - NEAR_CELLS
            if near:
                if listing:
                    facets[first[b] + found] = f
                found += 1
        if not listing:
            counts[b] = found


@njit(parallel=True, cache=True, error_model="numpy")
def _sample_cells(corners, index, samples, known, first, counts, facets, mask, settled):
    """mask (cell,) uint64 and settled (cell,) bool, written in place, from near facets and W at REFERENCE_SAMPLES.

    corners (facet, 3, 3), samples (3, POINTS_PER_BLOCK), known (cell, reference) float64; index (cell, 3) int32; the
    near facets of cell n are facets[first[n] : first[n] + counts[n]].
    """
    for n in prange(index.shape[0]):
        points = np.empty((3, POINTS_PER_BLOCK))
        for axis in range(3):
            for s in range(POINTS_PER_BLOCK):
                points[axis, s] = index[n, axis] + samples[axis, s]
        near = np.empty((counts[n], 3, 3))
        for m in range(counts[n]):
            near[m] = corners[facets[first[n] + m]]
        real, imaginary, turns = np.empty(POINTS_PER_BLOCK), np.empty(POINTS_PER_BLOCK), np.empty(POINTS_PER_BLOCK)
        inside_block(near, points, real, imaginary, turns)
        for s in range(POINTS_PER_BLOCK):
            turns[s] += np.arctan2(imaginary[s], real[s]) / (2.0 * np.pi)  # now the near facets' winding number
        far = known[n, 0] - turns[REFERENCE_SAMPLES[0]]
        other = known[n, 1] - turns[REFERENCE_SAMPLES[1]]
        settled[n] = abs(far - other) < MAX_WINDING_DIFFERENCE
        bits = np.uint64(0)
        for s in range(POINTS_PER_BLOCK):
            if abs(turns[s] + 0.5 * (far + other)) > 0.5:
                bits |= np.uint64(1) << np.uint64(s)
        mask[n] = bits
