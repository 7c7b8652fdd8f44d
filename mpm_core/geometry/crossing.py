"""The cells that the facets of a solid pass through (numba, plain arrays; lengths in cells from the grid's origin).

Cell i covers i .. i + 1 per axis. A facet crosses a cell if it meets the open cell: one that lies in a face does not,
so that a box aligned with the grid crosses nothing. Open means shrunk by CROSSING_TOLERANCE on each side.
2-D: a segment is a triangle with a repeated corner at height 1/2, in a grid one cell high.
"""

import numpy as np
from numba import njit, prange

from mpm_core.simd.threads import threads_for

# Cells are shrunk on each side by this share when crossed with facets, far above the round-off of a mine's coordinates.
CROSSING_TOLERANCE = 1e-6
PLANE_SLACK = 1e-3  # Candidates from a facet's plane may be off by this share of a cell; each is tested after.
# A facet whose area over the product of two edges is smaller has a normal that is round-off, which is not used.
MIN_FACET_SHAPE = 1e-9


def in_box(points: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """(point,) bool: True where a point (point, dimension) lies between the corners (dimension,) of a box, or on a
    side."""
    inside = np.ones(len(points), bool)
    for along, first, last in zip(points.T, lower, upper, strict=True):
        inside &= along >= first
        inside &= along <= last
    return inside


def box_around(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (dimension,) of the box around points (point, dimension), at least one."""
    return np.array([along.min() for along in points.T]), np.array([along.max() for along in points.T])


@njit(cache=True, error_model="numpy")
def _separated(x, y, z, a, b, c, half):
    """True if the axis (x, y, z) separates triangle a, b, c from the cube of half side `half` round the origin."""
    reach = half * (abs(x) + abs(y) + abs(z))
    pa = x * a[0] + y * a[1] + z * a[2]
    pb = x * b[0] + y * b[1] + z * b[2]
    pc = x * c[0] + y * c[1] + z * c[2]
    return min(pa, pb, pc) > reach or max(pa, pb, pc) < -reach


@njit(cache=True, error_model="numpy")
def overlaps_cube(a, b, c, normal, has_plane, half):
    """True if triangle a, b, c (tuples, from the cube's centre) meets the cube: separating axes (Akenine-Moller 2001).

    Thirteen axes: the cube's three, the triangle's normal (only if `has_plane`), nine cross products of edges.
    """
    if _separated(1.0, 0.0, 0.0, a, b, c, half) or _separated(0.0, 1.0, 0.0, a, b, c, half):
        return False
    if _separated(0.0, 0.0, 1.0, a, b, c, half):
        return False
    if has_plane and _separated(normal[0], normal[1], normal[2], a, b, c, half):
        return False
    for p, q in ((a, b), (b, c), (c, a)):
        x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        if _separated(0.0, -z, y, a, b, c, half) or _separated(z, 0.0, -x, a, b, c, half):
            return False
        if _separated(-y, x, 0.0, a, b, c, half):
            return False
    return True


@njit(cache=True, error_model="numpy")
def _facet_cells(corner, lower, upper, keys, first):
    """Write the keys of the cells that one facet crosses to keys[first:], if there is room; return how many there are.

    Walks the columns of cells along the axis nearest to the facet's normal and tests only the few cells of a column
    that the facet's plane can reach: the work grows with the facet's area, not with the volume of its bounding box.
    """
    half = 0.5 - CROSSING_TOLERANCE
    low = np.empty(3, np.int64)
    high = np.empty(3, np.int64)
    for axis in range(3):
        values = (corner[0, axis], corner[1, axis], corner[2, axis])
        # clip before the cast: a facet may reach far beyond what an integer holds
        low[axis] = int(max(np.floor(min(values) + CROSSING_TOLERANCE), float(lower[axis])))
        high[axis] = int(min(np.floor(max(values) - CROSSING_TOLERANCE), float(upper[axis] - 1)))
        if high[axis] < low[axis]:  # beside the box of cells, or in a face
            return 0
    ex, ey, ez = corner[1, 0] - corner[0, 0], corner[1, 1] - corner[0, 1], corner[1, 2] - corner[0, 2]
    ox, oy, oz = corner[2, 0] - corner[0, 0], corner[2, 1] - corner[0, 1], corner[2, 2] - corner[0, 2]
    normal = (ey * oz - ez * oy, ez * ox - ex * oz, ex * oy - ey * ox)  # by hand: numpy's takes long to compile
    area = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    has_plane = area > MIN_FACET_SHAPE * np.sqrt((ex * ex + ey * ey + ez * ez) * (ox * ox + oy * oy + oz * oz))
    along = 2
    if has_plane:
        along = 0
        for axis in range(1, 3):
            if abs(normal[axis]) > abs(normal[along]):
                along = axis
    across, beside = (along + 1) % 3, (along + 2) % 3
    cell = np.empty(3, np.int64)
    found = 0
    for i in range(low[across], high[across] + 1):
        for j in range(low[beside], high[beside] + 1):
            start, stop = low[along], high[along]
            if has_plane:
                slope_i, slope_j = normal[across] / normal[along], normal[beside] / normal[along]
                height = (
                    corner[0, along] - slope_i * (i + 0.5 - corner[0, across]) - slope_j * (j + 0.5 - corner[0, beside])
                )
                reach = 0.5 * (abs(slope_i) + abs(slope_j)) + PLANE_SLACK
                start = max(start, int(np.floor(height - reach)))
                stop = min(stop, int(np.floor(height + reach)))
            cell[across], cell[beside] = i, j
            for k in range(start, stop + 1):
                cell[along] = k
                x, y, z = cell[0] + 0.5, cell[1] + 0.5, cell[2] + 0.5
                a = (corner[0, 0] - x, corner[0, 1] - y, corner[0, 2] - z)
                b = (corner[1, 0] - x, corner[1, 1] - y, corner[1, 2] - z)
                c = (corner[2, 0] - x, corner[2, 1] - y, corner[2, 2] - z)
                if overlaps_cube(a, b, c, normal, has_plane, half):
                    if first + found < keys.size:
                        key = (cell[2] - lower[2]) * (upper[1] - lower[1]) + (cell[1] - lower[1])
                        keys[first + found] = key * (upper[0] - lower[0]) + (cell[0] - lower[0])
                    found += 1
    return found


@njit(parallel=True, cache=True, error_model="numpy")
def _count_cells(corners, lower, upper, counts):
    """counts (facet,) int64, written in place: how many cells from `lower` to `upper` each facet crosses."""
    nothing = np.empty(0, np.int64)
    for f in prange(corners.shape[0]):
        counts[f] = _facet_cells(corners[f], lower, upper, nothing, nothing.size)  # not 0: that compiles anew


@njit(parallel=True, cache=True, error_model="numpy")
def _list_cells(corners, lower, upper, first, keys):
    """keys (sum of counts,) int64, written in place: each facet's cells from keys[first[facet]] on."""
    for f in prange(corners.shape[0]):
        _facet_cells(corners[f], lower, upper, keys, first[f])


def crossed_keys(corners: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Sorted keys of the cells that any facet crosses, among those from `lower` up to, not including, `upper`.

    corners (facet, 3, 3) float64, in cells; lower, upper (3,) int64. The key of cell (i, j, k) is its place in the
    box of cells, x fastest. Work and memory grow with the number of pairs of facet and crossed cell.
    """
    counts = np.empty(len(corners), dtype=np.int64)
    _count_cells(corners, lower, upper, counts)
    first = np.concatenate([[0], np.cumsum(counts)])
    keys = np.empty(first[-1], dtype=np.int64)
    _list_cells(corners, lower, upper, first[:-1], keys)
    return np.unique(keys)


@njit(parallel=True, cache=True)
def mark_cells(index, lower, upper, keys, crossed, undecided):
    """Look the cells up among the crossed ones.

    index (cell, 3) int32; lower, upper (3,) int64; keys sorted int64 (crossed_keys); written in place: crossed
    (cell,) bool, and undecided (cell,) bool: in the box, not crossed.
    """
    for n in prange(index.shape[0]):
        inside_box = True
        for axis in range(3):
            inside_box &= lower[axis] <= index[n, axis] < upper[axis]
        crossed[n] = False
        undecided[n] = inside_box
        if inside_box:
            key = (index[n, 2] - lower[2]) * (upper[1] - lower[1]) + (index[n, 1] - lower[1])
            key = key * (upper[0] - lower[0]) + (index[n, 0] - lower[0])
            place, end = 0, keys.size
            while place < end:
                middle = (place + end) // 2
                if keys[middle] < key:
                    place = middle + 1
                else:
                    end = middle
            if place < keys.size and keys[place] == key:
                crossed[n] = True
                undecided[n] = False


def cross_cells(corners: np.ndarray, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The cells that a surface crosses, and those in its bounding box that it does not: (cell,) bool each.

    corners (facet, corner, dimension) float64, in cells from the grid's origin; index (cell, dimension) int32.
    """
    crossed, undecided = np.zeros(len(index), dtype=bool), np.zeros(len(index), dtype=bool)
    lower, upper = cell_box(corners, index)
    if len(index) == 0 or (lower >= upper).any():
        return crossed, undecided
    if corners.shape[2] == 2:
        as_triangles = np.full((len(corners), 3, 3), 0.5)
        as_triangles[:, :, :2] = corners[:, [0, 1, 1]]
        in_space = np.zeros((len(index), 3), dtype=np.int32)
        in_space[:, :2] = index
        lower, upper = np.append(lower, 0), np.append(upper, 1)
    else:
        as_triangles, in_space = corners, index
    with threads_for(len(index) + len(corners)):
        keys = crossed_keys(as_triangles, lower, upper)
        mark_cells(np.ascontiguousarray(in_space), lower, upper, keys, crossed, undecided)
    return crossed, undecided


def cell_box(corners: np.ndarray, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and one past the last cell, per axis int64, of those of `index` that the solid's bounding box meets."""
    if len(index) == 0:
        return np.zeros(corners.shape[2], dtype=np.int64), np.zeros(corners.shape[2], dtype=np.int64)
    places = corners.reshape(-1, corners.shape[2])
    (first, last), (lowest, highest) = box_around(index), box_around(places)
    lower = np.clip(np.floor(lowest + CROSSING_TOLERANCE), first, last + 1.0).astype(np.int64)
    upper = np.clip(np.ceil(highest - CROSSING_TOLERANCE), first, last + 1.0).astype(np.int64)
    return lower, upper
