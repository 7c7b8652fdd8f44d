"""Generalised winding number against 1/2: exact, in float64, without an arc tangent (numba, plain arrays).

W(x) is the sum of the triangles' solid angles over 4 pi (Jacobson, Kavan, Sorkine-Hornung 2013), in 2-D the sum of the
segments' angles over 2 pi. An angle is the argument of a complex number z (half of it: Van Oosterom, Strackee 1983):

    3-D  half the solid angle:  z = a b c + (a.b) c + (b.c) a + (c.a) b + i a.(b x c)
    2-D  the angle:             z = a.b + i a x b

with a, b, c the corners as seen from x: vectors in products, their lengths alone. Either way 2 pi W is the sum of the
arguments: the argument of the product of all z, if its passages through the negative real axis are counted. Now
|W| > 1/2 means that the sum is beyond +-pi, which means that this count is not zero.

In a closed solid of many facets only those near a cell are summed for each of its sample points
(`sample_cells_nearby`). Between the sample points of one cell, the winding number W of all facets further than
NEAR_CELLS cells changes little: at most by 0.2 from the cell's middle, where they leave a round opening of that radius.
In a closed solid W is a whole number, so a constant serves for them: W at one sample point (libigl's tree) less the
near facets' part there. Two such points must agree, else one of them lies on the surface and the cell is left to the
tree.
"""

from collections.abc import Callable

import igl
import numpy as np
from numba import njit, prange

from mpm_core.simd.threads import threads_for

PAIRS_PER_CELL = 20  # So many pairs of point and facet are as much work as a cell of the mechanics.
MAX_EXACT_FACETS = 1000  # Up to so many facets the exact sum takes less time than libigl's tree.
POINTS_PER_BLOCK = 64  # Points of a block are summed together, so that inner loops become vector instructions.
CELLS_PER_BIN = 4  # Cells per edge of the bins that share a list of near facets.
NEAR_CELLS = 3.0  # Facets within this many cells of a bin are near.
MAX_NEAR_FACETS = 3000  # Where a bin has more near facets, the tree is the faster way for its cells.
# Sample points next to the cell's middle, (1, 1, 1) and (2, 2, 2) of 4 x 4 x 4.
REFERENCE_SAMPLES = np.array([21, 42])
MAX_WINDING_DIFFERENCE = 0.3  # Far facets count the same for both reference samples if they differ by less.


@njit(inline="always")
def _turn(z_real, z_imaginary, real, imaginary, turns, s):
    """Multiply the running product of point s by z, keep its size near 1, count a passage through the negative axis."""
    product_real = real[s] * z_real - imaginary[s] * z_imaginary
    product_imaginary = real[s] * z_imaginary + imaginary[s] * z_real
    size = abs(product_real) + abs(product_imaginary)
    shrink = 1.0 / size if size > 0.0 else 0.0
    up = (imaginary[s] >= 0.0) & (z_imaginary > 0.0) & (product_imaginary < 0.0)
    down = (imaginary[s] < 0.0) & (z_imaginary < 0.0) & (product_imaginary >= 0.0)
    turns[s] += (1.0 if up else 0.0) - (1.0 if down else 0.0)
    # z = 0: the point is a corner or on an edge, where no angle exists; the facet is left out
    real[s] = product_real * shrink if size > 0.0 else real[s]
    imaginary[s] = product_imaginary * shrink if size > 0.0 else imaginary[s]


@njit(cache=True, error_model="numpy")
def inside_block(corners, points, real, imaginary, turns):
    """Count the turns of POINTS_PER_BLOCK points: `turns` is not zero where a point is inside.

    corners (facet, corner, dimension) float64; points (dimension, POINTS_PER_BLOCK) float64, same origin and unit;
    real, imaginary (POINTS_PER_BLOCK,) float64 scratch; turns (POINTS_PER_BLOCK,) float64, written in place.
    """
    for s in range(POINTS_PER_BLOCK):
        real[s] = 1.0
        imaginary[s] = 0.0
        turns[s] = 0.0
    if corners.shape[2] == 2:
        for f in range(corners.shape[0]):
            for s in range(POINTS_PER_BLOCK):
                ax = corners[f, 0, 0] - points[0, s]
                ay = corners[f, 0, 1] - points[1, s]
                bx = corners[f, 1, 0] - points[0, s]
                by = corners[f, 1, 1] - points[1, s]
                _turn(ax * bx + ay * by, ax * by - ay * bx, real, imaginary, turns, s)
        return
    for f in range(corners.shape[0]):
        for s in range(POINTS_PER_BLOCK):
            ax = corners[f, 0, 0] - points[0, s]
            ay = corners[f, 0, 1] - points[1, s]
            az = corners[f, 0, 2] - points[2, s]
            bx = corners[f, 1, 0] - points[0, s]
            by = corners[f, 1, 1] - points[1, s]
            bz = corners[f, 1, 2] - points[2, s]
            cx = corners[f, 2, 0] - points[0, s]
            cy = corners[f, 2, 1] - points[1, s]
            cz = corners[f, 2, 2] - points[2, s]
            a = np.sqrt(ax * ax + ay * ay + az * az)
            b = np.sqrt(bx * bx + by * by + bz * bz)
            c = np.sqrt(cx * cx + cy * cy + cz * cz)
            z_real = (
                a * b * c
                + (ax * bx + ay * by + az * bz) * c
                + (bx * cx + by * cy + bz * cz) * a
                + (cx * ax + cy * ay + cz * az) * b
            )
            z_imaginary = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
            _turn(z_real, z_imaginary, real, imaginary, turns, s)


@njit(parallel=True, cache=True, error_model="numpy")
def inside_points(corners, points, inside):
    """Write True where |winding number| > 1/2 at a point, by summing over all facets.

    corners (facet, corner, dimension) float64; points (point, dimension) float64; inside (point,) bool, written in
    place. Each block of points is one thread's, facets in their order: the result does not depend on the thread count.
    """
    count, dimension = points.shape
    for block in prange((count + POINTS_PER_BLOCK - 1) // POINTS_PER_BLOCK):
        first = block * POINTS_PER_BLOCK
        here = min(POINTS_PER_BLOCK, count - first)
        gathered = np.zeros((dimension, POINTS_PER_BLOCK))
        for s in range(here):
            for axis in range(dimension):
                gathered[axis, s] = points[first + s, axis]
        turns = np.empty(POINTS_PER_BLOCK)
        inside_block(corners, gathered, np.empty(POINTS_PER_BLOCK), np.empty(POINTS_PER_BLOCK), turns)
        for s in range(here):
            inside[first + s] = turns[s] != 0.0


@njit(parallel=True, cache=True, error_model="numpy")
def sample_cells(corners, index, samples, mask):
    """Bit s of mask[n]: whether sample s of cell n is inside, by summing over all facets.

    corners (facet, corner, dimension) float64 in cells from the grid's origin; index (cell, dimension) int32;
    samples (dimension, POINTS_PER_BLOCK) float64, offsets in cells from a cell's lower corner; mask (cell,) uint64,
    written in place.
    """
    dimension = index.shape[1]
    for n in prange(index.shape[0]):
        points = np.empty((dimension, POINTS_PER_BLOCK))
        for axis in range(dimension):
            for s in range(POINTS_PER_BLOCK):
                points[axis, s] = index[n, axis] + samples[axis, s]
        turns = np.empty(POINTS_PER_BLOCK)
        inside_block(corners, points, np.empty(POINTS_PER_BLOCK), np.empty(POINTS_PER_BLOCK), turns)
        bits = np.uint64(0)
        for s in range(POINTS_PER_BLOCK):
            if turns[s] != 0.0:
                bits |= np.uint64(1) << np.uint64(s)
        mask[n] = bits


@njit(parallel=True, cache=True, error_model="numpy")
def sum_winding_number(corners, points, number):
    """W at each point, by summing over all facets; arguments as in inside_points, number (point,) float64."""
    count, dimension = points.shape
    for block in prange((count + POINTS_PER_BLOCK - 1) // POINTS_PER_BLOCK):
        first = block * POINTS_PER_BLOCK
        here = min(POINTS_PER_BLOCK, count - first)
        gathered = np.zeros((dimension, POINTS_PER_BLOCK))
        for s in range(here):
            for axis in range(dimension):
                gathered[axis, s] = points[first + s, axis]
        real, imaginary, turns = np.empty(POINTS_PER_BLOCK), np.empty(POINTS_PER_BLOCK), np.empty(POINTS_PER_BLOCK)
        inside_block(corners, gathered, real, imaginary, turns)
        for s in range(here):
            number[first + s] = turns[s] + np.arctan2(imaginary[s], real[s]) / (2.0 * np.pi)


def winding_number_of(corners: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """A function that gives W at points (point, dimension): by the sum, or of many facets by libigl's tree.

    corners (facet, corner, dimension), with the points near one local origin.
    """

    def by_sum(points: np.ndarray) -> np.ndarray:
        number = np.empty(len(points))
        with threads_for(len(points) * len(corners) // PAIRS_PER_CELL):
            sum_winding_number(corners, np.ascontiguousarray(points), number)
        return number

    return by_sum if corners.shape[2] == 2 or len(corners) <= MAX_EXACT_FACETS else winding_number_by_tree(corners)


def winding_number_by_tree(corners: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """W by libigl's tree (Barill et al. 2018), in 3-D: good to 0.5 % and, in float32, to 1e-7 of the solid's size.

    Arguments as in winding_number_of.
    """
    vertices = np.ascontiguousarray(corners.reshape(-1, 3))
    tree = igl.FastWindingNumberBVH()
    tree.init(vertices, np.arange(len(vertices), dtype=np.int64).reshape(-1, 3))
    return lambda points: tree.winding_number(np.ascontiguousarray(points))


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
    found, decided = np.zeros(len(cells), dtype=np.uint64), np.zeros(len(cells), dtype=bool)
    _sample_cells(
        corners, index[cells], samples, known, first[list_of_cell], counts[list_of_cell], facets, found, decided
    )
    mask[cells], done[cells] = found, decided
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
def _sample_cells(corners, index, samples, known, first, counts, facets, mask, decided):
    """mask (cell,) uint64 and decided (cell,) bool, written in place, from near facets and W at REFERENCE_SAMPLES.

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
        decided[n] = abs(far - other) < MAX_WINDING_DIFFERENCE
        bits = np.uint64(0)
        for s in range(POINTS_PER_BLOCK):
            if abs(turns[s] + 0.5 * (far + other)) > 0.5:
                bits |= np.uint64(1) << np.uint64(s)
        mask[n] = bits
