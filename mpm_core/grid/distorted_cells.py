"""Finest cells that have a moved node (edge_nodes.py) as a corner: their shape, and integrals over parts of them.

A distorted cell is the image of the reference cell, -1 to 1, by its trilinear shape functions (bilinear in 2-D); the
cells still fill space without gap. Its 64 samples are the images of the reference cell's sub-cells. Integrals over a
sub-cell are by Gauss points, two along each axis, which is exact for volumes and for gradients: so sums over cells that
share a node vanish where they should, and a patch of distorted cells takes a uniform strain exactly.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit, prange

from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.mesh import BIT_ORDER, MultiLevelGrid

FACTORS = np.random.default_rng(1).integers(0, 1 << 63, 64, np.uint64) * np.uint64(2) + np.uint64(1)
"""Odd factors of a row's numbers in its key."""
GAUSS_POINT = 1.0 / np.sqrt(3.0)  # Of the rule with two points along each axis, -1 to 1.
ORDER_2D = np.array([0, 4, 2, 6, 1, 5, 3, 7])
ORDER_3D = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]])
"""Ordered dither (Bayer 1973): how far outward a point is moved, by its place along the other axes from the middle."""
MAX_PARTS_KNOWN = 200_000  # Parts of cells whose integrals are remembered: 0.1 GB.
MAX_CELLS_KNOWN = 200_000  # Cells of which the samples' volumes are: 0.15 GB.


class RowCache:
    """A cache of a function from rows (k, n) uint64 to results (k, m) float64, row by row, of at most `capacity`
    rows."""

    def __init__(self, function: Callable[[np.ndarray], np.ndarray], capacity: int):
        self.function, self.capacity = function, capacity
        self.clear()

    def clear(self) -> None:
        """Empty the cache."""
        self.keys, self.rows, self.results = np.empty(0, np.uint64), np.empty((0, 0)), np.empty((0, 0))

    def __call__(self, rows: np.ndarray) -> np.ndarray:
        """Results (k, m) of rows (k, n); what is not known is calculated once."""
        keys = rows @ FACTORS[: rows.shape[1]]  # modulo 2^64
        place, known = self._find(keys, rows)
        if not known.all():
            new = np.flatnonzero(~known)
            if len(self.keys) + len(new) > self.capacity:
                self.clear()
                new = np.arange(len(rows))
            self._keep(keys, rows, new)
            place, known = self._find(keys, rows)
        results = self.results[place]
        other = np.flatnonzero(~known)  # rows that differ and have one key: hardly ever any
        if len(other):
            results[other] = self.function(rows[other])
        return results

    def _find(self, keys: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Place of each row among those in the cache, and (k,) bool: True where it is there."""
        if not len(self.keys):
            return np.zeros(len(rows), int), np.zeros(len(rows), bool)
        place = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
        return place, (self.keys[place] == keys) & (self.rows[place] == rows).all(axis=1)

    def _keep(self, keys: np.ndarray, rows: np.ndarray, new: np.ndarray) -> None:
        """Add the results of new rows, one for each key."""
        _, first = np.unique(keys[new], return_index=True)
        new = new[first]
        new = new[~np.isin(keys[new], self.keys)]
        if not len(new):
            return
        keys, rows, results = keys[new], rows[new], self.function(rows[new])
        if len(self.keys):
            keys, rows = np.concatenate([self.keys, keys]), np.concatenate([self.rows, rows])
            results = np.concatenate([self.results, results])
        order = np.argsort(keys)
        self.keys, self.rows, self.results = keys[order], rows[order], results[order]


@dataclass(frozen=True)
class DistortedCells:
    """Cells (k,) int32 of a grid, ascending, and where their corners (k, 2^d, d), in bit order, are: in finest cells
    from the lower corner that the cell would have."""

    cell: np.ndarray
    corners: np.ndarray

    @classmethod
    def none(cls, dimension: int) -> "DistortedCells":
        """No cell is distorted."""
        return cls(np.empty(0, np.int32), np.empty((0, 1 << dimension, dimension)))

    def rows(self, cells: np.ndarray) -> np.ndarray:
        """Row of each of some cells (n,) among these, (n,) int64; -1 for cells that are cubes."""
        return self._row_of_cell.take(cells, mode="clip")

    @cached_property
    def _row_of_cell(self) -> np.ndarray:
        """The row of each cell up to the last of these, and -1 once more, for all that follow: int64."""
        row = np.full(self.cell[-1] + 2 if len(self.cell) else 1, -1)
        row[self.cell] = np.arange(len(self.cell))
        return row

    def volumes(self, cells: np.ndarray) -> np.ndarray:
        """Volume of each of some cells (n,), in cubes of its size: (n,)."""
        volume, row = np.ones(len(cells)), self.rows(cells)
        bent = np.flatnonzero(row >= 0)
        volume[bent] = self.sample_volumes[row[bent]].sum(axis=1)
        return volume

    def part_volumes(self, cells: np.ndarray, samples: np.ndarray) -> np.ndarray:
        """Volume of parts of some cells (n,), samples (n,) uint64, none of them empty, in cubes of the cell's size."""
        volume, row = np.bitwise_count(samples) / SAMPLES_PER_CELL, self.rows(cells)
        bent = np.flatnonzero(row >= 0)
        volume[bent] = part_integrals(self.corners[row[bent]], samples[bent]).volume
        return volume

    def node_positions(self, grid: MultiLevelGrid) -> np.ndarray:
        """Positions of the nodes of the grid that has these cells, (node, d) m."""
        position = grid.node_position.copy()
        nodes = grid.vtk_nodes[self.cell][:, BIT_ORDER[grid.dimension]]
        position[nodes] = grid.origin + (grid.cell_index[self.cell][:, None] + self.corners) * grid.fine_cell
        return position

    @cached_property
    def sample_volumes(self) -> np.ndarray:
        """Volume (k, 64) of each sample, in cubes."""
        return sample_volumes(self.corners)

    def of(self, chosen: np.ndarray, number: np.ndarray) -> "DistortedCells":
        """The distorted cells among chosen cells of the grid (cell,) bool; number (cell,) int32: their index there."""
        kept = chosen[self.cell]
        return DistortedCells(number[self.cell[kept]], self.corners[kept])


@dataclass(frozen=True)
class PartIntegrals:
    """Integrals over parts of distorted cells (k,): volume, in cubes; place (k, d) of the centroid, -1 to 1 across the
    undistorted cell; modes (k, 2^d), means of the reference cell's modes (kernels/modes.py); gradients (k, 2^d, d),
    means of the corners' shape functions' along the axes, in units of 2 over the cell's edge."""

    volume: np.ndarray
    place: np.ndarray
    modes: np.ndarray
    gradients: np.ndarray


def corner_offsets(dimension: int) -> np.ndarray:
    """Corners (2^d, d) int32 of the unit cube in bit order."""
    return (np.arange(1 << dimension)[:, None] >> np.arange(dimension) & 1).astype(np.int32)


def sub_cell_middles(dimension: int) -> np.ndarray:
    """Middles (64, d) of the samples' sub-cells in the unit cube, in bit order."""
    per_edge = round(SAMPLES_PER_CELL ** (1 / dimension))
    number = np.arange(SAMPLES_PER_CELL)[:, None] // per_edge ** np.arange(dimension) % per_edge
    return (number + 0.5) / per_edge


def distorted_shapes(place: np.ndarray, shift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Finest cells around moved nodes, place (k, d) fine units, shift (k, d) finest cells: places (n, d) int32 of their
    lower corners, and their corners (n, 2^d, d) as in DistortedCells."""
    dimension = place.shape[1]
    offsets = corner_offsets(dimension)
    around = (place[:, None, :] - offsets).reshape(-1, dimension)
    lowest = around.min(axis=0, initial=0)
    shape = tuple(around.max(axis=0, initial=0) - lowest + 1)
    codes = np.ravel_multi_index(tuple((around - lowest).T), shape)  # to sort rows would take many times as long
    codes, row = np.unique(codes, return_inverse=True)
    cells = np.stack(np.unravel_index(codes, shape), axis=1) + lowest
    corners = np.repeat(offsets[None].astype(float), len(cells), axis=0)
    corners[row.reshape(len(place), len(offsets)), np.arange(len(offsets))] += shift[:, None, :]
    return cells.astype(np.int32), corners


def distorted_cells(grid: MultiLevelGrid, place: np.ndarray, shift: np.ndarray) -> DistortedCells:
    """Cells of a grid that moved nodes distort: place (k, d) fine units, shift (k, d) finest cells.

    A node is moved if all cells around it that the grid has are finest ones.
    """
    if not len(place):
        return DistortedCells.none(grid.dimension)
    around = (place[:, None, :] - corner_offsets(grid.dimension)).reshape(-1, grid.dimension)
    cell = holding_cells(grid, around).reshape(len(place), -1)
    moved = ((cell < 0) | (grid.cell_level[cell] == grid.levels - 1)).all(axis=1)
    cells, corners = distorted_shapes(place[moved], shift[moved])
    cell = holding_cells(grid, cells)
    there = np.flatnonzero(cell >= 0)
    there = there[np.argsort(cell[there])]
    return DistortedCells(cell[there], corners[there])


def points_with_volume(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points at which cells with corners (k, 2^d, d) are tested for what they hold, 2^d in each sample: places
    (k, 64, 2^d, d), in the corners' units, and the volumes (k, 64, 2^d) that they stand for, in cubes."""
    count, corner_count, dimension = corners.shape
    places = np.empty((count, SAMPLES_PER_CELL, corner_count, dimension))
    volume = np.empty((count, SAMPLES_PER_CELL, corner_count))
    _place_points(np.ascontiguousarray(corners), *_shapes_and_slopes(points_of_samples(dimension)), places, volume)
    return places, volume


def points_of_samples(dimension: int) -> np.ndarray:
    """Points (64, 2^d, d) in the unit cube, 2^d in each sample's sub-cell.

    Twice as many along each edge as inside.sample_points has, in a pattern of the same kind: each is moved within its
    part of the sub-cell, by an amount that hangs on its place along the other axes, so that a flat wall meets few of
    them at a time; the pattern is its own image in mirrors across the axes.
    """
    per_edge = 2 * round(SAMPLES_PER_CELL ** (1 / dimension))
    along = np.meshgrid(*[np.arange(per_edge)] * dimension, indexing="ij")
    side = [np.where(2 * i < per_edge, -1, 1) for i in along]
    ring = [np.abs(2 * i + 1 - per_edge) // 2 for i in along]
    outward = [
        ORDER_2D[ring[1 - axis]] if dimension == 2 else ORDER_3D[ring[(axis + 1) % 3], ring[(axis + 2) % 3]]
        for axis in range(dimension)
    ]
    steps = ORDER_2D.size if dimension == 2 else ORDER_3D.size
    places = np.stack(
        [0.5 + side[axis] * (ring[axis] + (outward[axis] + 0.5) / steps) / per_edge for axis in range(dimension)],
        axis=-1,
    )
    sample = sum((i // 2) * (per_edge // 2) ** axis for axis, i in enumerate(along))
    child = sum((i % 2) << axis for axis, i in enumerate(along))
    points = np.empty((SAMPLES_PER_CELL, 1 << dimension, dimension))
    points[sample, child] = places
    return points


def fullest_samples(filled: np.ndarray, volume: np.ndarray, dimension: int) -> np.ndarray:
    """The samples (k,) uint64 that are filled most, as many as have the volume filled of their cell.

    filled, volume (k, 64): of each sample, cubes. Samples that are filled alike, such as mirror images of each other,
    are taken together: so mirrored openings have mirrored samples.
    """
    total = filled.sum(axis=1)[:, None]
    from_middle = np.abs(sub_cell_middles(dimension) - 0.5).sum(axis=1)
    rank = np.round(1.0 - filled / volume, 6) + 1e-7 * from_middle
    order = np.argsort(rank, axis=1, kind="stable")
    rank, ordered = np.take_along_axis(rank, order, axis=1), np.take_along_axis(volume, order, axis=1)
    after = np.cumsum(ordered, axis=1)
    differ = np.diff(rank, axis=1) >= 1e-9
    first, last = (np.pad(differ, ((0, 0), side), constant_values=True) for side in ((1, 0), (0, 1)))
    low = np.maximum.accumulate(np.where(first, after - ordered, 0.0), axis=1)
    high = np.minimum.accumulate(np.where(last, after, np.inf)[:, ::-1], axis=1)[:, ::-1]
    inside = np.zeros(volume.shape, bool)
    np.put_along_axis(inside, order, (0.5 * (low + high) <= total + 1e-9) & (total > 0.0), axis=1)
    return np.packbits(inside, axis=1, bitorder="little").view("<u8")[:, 0].astype(np.uint64)


def part_integrals(corners: np.ndarray, samples: np.ndarray) -> PartIntegrals:
    """Integrals over sets of samples (k,) uint64, none of them empty, of cells with corners (k, 2^d, d)."""
    corner_count, dimension = corners.shape[1:]
    ends = np.cumsum([1, dimension, corner_count, corner_count * dimension])
    sums = np.empty((0, ends[-1]))
    if len(corners):
        sums = _INTEGRALS[dimension](np.column_stack([_bits(corners), samples]))
    volume, place, modes, gradients = np.split(sums, ends[:-1], axis=1)
    gradients = gradients.reshape(-1, corner_count, dimension)
    return PartIntegrals(volume[:, 0], 2.0 * place / volume - 1.0, modes / volume, 0.5 * gradients / volume[:, :, None])


def sample_volumes(corners: np.ndarray) -> np.ndarray:
    """Volume (k, 64) of each sample of cells with corners (k, 2^d, d), in cubes."""
    if not len(corners):
        return np.empty((0, SAMPLES_PER_CELL))
    return _VOLUMES[corners.shape[2]](_bits(corners))


def _bits(corners: np.ndarray) -> np.ndarray:
    """Corners (k, 2^d, d) as rows (k, 2^d d) uint64."""
    return np.ascontiguousarray(corners).view(np.uint64).reshape(len(corners), -1)


def _corners(rows: np.ndarray, dimension: int) -> np.ndarray:
    return np.ascontiguousarray(rows).view(np.float64).reshape(len(rows), 1 << dimension, dimension)


def _integrals(rows: np.ndarray) -> np.ndarray:
    """Sums over sets of samples as `_integrate` writes them, side by side, (k, 1 + d + 2^d + 2^d d); rows (k, 2^d d +
    1): `_bits` and samples."""
    dimension = 2 if rows.shape[1] == 9 else 3
    corners, samples = _corners(rows[:, :-1], dimension), rows[:, -1].copy()
    count, corner_count = len(rows), 1 << dimension
    volume, place = np.zeros(count), np.zeros((count, dimension))
    modes, gradients = np.zeros((count, corner_count)), np.zeros((count, corner_count, dimension))
    _integrate(corners, samples, *_tables(dimension), volume, place, modes, gradients)
    return np.concatenate([volume[:, None], place, modes, gradients.reshape(count, -1)], axis=1)


def _volumes(rows: np.ndarray) -> np.ndarray:
    """Volumes (k, 64) of the samples of cells; rows (k, 2^d d): `_bits`."""
    dimension = 2 if rows.shape[1] == 8 else 3
    volume = np.zeros((len(rows), SAMPLES_PER_CELL))
    _sum_volumes(_corners(rows, dimension), _tables(dimension)[1], volume)
    return volume


# A mine asks for the same cells and parts again with each split and each part of the mine.
_INTEGRALS = {dimension: RowCache(_integrals, MAX_PARTS_KNOWN) for dimension in (2, 3)}
_VOLUMES = {dimension: RowCache(_volumes, MAX_CELLS_KNOWN) for dimension in (2, 3)}


@functools.cache
def _tables(dimension: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """At the Gauss points of all samples: shape functions (64, 2^d, 2^d), their slopes (64, 2^d, 2^d, d) in the unit
    cube, and values of the modes (64, 2^d, 2^d)."""
    bits = corner_offsets(dimension)
    per_edge = round(SAMPLES_PER_CELL ** (1 / dimension))
    points = sub_cell_middles(dimension)[:, None, :] + GAUSS_POINT * (bits - 0.5) / per_edge
    modes = np.prod(np.where(bits == 1, 2.0 * points[:, :, None, :] - 1.0, 1.0), axis=3)
    return *_shapes_and_slopes(points), modes


def _shapes_and_slopes(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions of the corners at points (64, 2^d, d) of the unit cube (64, 2^d, 2^d) and their slopes
    (64, 2^d, 2^d, d) there."""
    dimension = points.shape[2]
    bits = corner_offsets(dimension)
    along = np.where(bits == 1, points[:, :, None, :], 1.0 - points[:, :, None, :])  # (sample, point, corner, axis)
    slopes = []
    for axis in range(dimension):
        across = along.copy()
        across[..., axis] = np.where(bits[:, axis] == 1, 1.0, -1.0)
        slopes.append(np.prod(across, axis=3))
    return np.prod(along, axis=3), np.ascontiguousarray(np.stack(slopes, axis=3))


@njit(error_model="numpy", cache=True)
def smallest_element(corners, points):
    """The smallest ratio of a cell's volume element to a cube's at points (n, d) of the unit cube; corners (2^d, d)."""
    count, dimension = corners.shape
    smallest = np.inf
    jacobian = np.eye(3)
    for point in points:
        for j in range(dimension):
            for k in range(dimension):
                jacobian[j, k] = 0.0
                for c in range(count):
                    slope = corners[c, j]
                    for axis in range(dimension):
                        high = (c >> axis) & 1
                        if axis == k:
                            slope *= 1.0 if high else -1.0
                        else:
                            slope *= point[axis] if high else 1.0 - point[axis]
                    jacobian[j, k] += slope
        element = jacobian[0, 0] * (jacobian[1, 1] * jacobian[2, 2] - jacobian[1, 2] * jacobian[2, 1])
        element -= jacobian[0, 1] * (jacobian[1, 0] * jacobian[2, 2] - jacobian[1, 2] * jacobian[2, 0])
        element += jacobian[0, 2] * (jacobian[1, 0] * jacobian[2, 1] - jacobian[1, 1] * jacobian[2, 0])
        smallest = min(smallest, element)
    return smallest


@njit(inline="always", error_model="numpy")
def _set_jacobian(corners, cell, slopes, sample, gauss, jacobian, cofactor):
    """Derivatives (3, 3) of places by the unit cube's coordinates and their cofactors, written; returns their
    determinant."""
    count, dimension = corners.shape[1], corners.shape[2]
    for j in range(dimension):
        for k in range(dimension):
            total = 0.0
            for c in range(count):
                total += corners[cell, c, j] * slopes[sample, gauss, c, k]
            jacobian[j, k] = total
    for j in range(3):
        a, b = (j + 1) % 3, (j + 2) % 3
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            cofactor[j, k] = jacobian[a, m] * jacobian[b, n] - jacobian[a, n] * jacobian[b, m]
    return jacobian[0, 0] * cofactor[0, 0] + jacobian[0, 1] * cofactor[0, 1] + jacobian[0, 2] * cofactor[0, 2]


@njit(parallel=True, error_model="numpy", cache=True)
def _place_points(corners, shapes, slopes, places, volume):
    """Places (k, 64, 2^d, d) of points in cells and the volumes (k, 64, 2^d) that they stand for, written; shapes and
    slopes: see `_shapes_and_slopes`."""
    count, dimension = corners.shape[1], corners.shape[2]
    weight = 1.0 / (SAMPLES_PER_CELL * count)
    for cell in prange(len(corners)):
        jacobian, cofactor = np.eye(3), np.empty((3, 3))
        for sample in range(SAMPLES_PER_CELL):
            for point in range(count):
                element = _set_jacobian(corners, cell, slopes, sample, point, jacobian, cofactor)
                volume[cell, sample, point] = weight * element
                for j in range(dimension):
                    total = 0.0
                    for c in range(count):
                        total += shapes[sample, point, c] * corners[cell, c, j]
                    places[cell, sample, point, j] = total


@njit(parallel=True, error_model="numpy", cache=True)
def _sum_volumes(corners, slopes, volume):
    """Volumes (k, 64) of the samples, written."""
    weight = 1.0 / (SAMPLES_PER_CELL * corners.shape[1])
    for cell in prange(len(corners)):
        jacobian, cofactor = np.eye(3), np.empty((3, 3))
        for sample in range(SAMPLES_PER_CELL):
            for gauss in range(corners.shape[1]):
                element = _set_jacobian(corners, cell, slopes, sample, gauss, jacobian, cofactor)
                volume[cell, sample] += weight * element


@njit(parallel=True, error_model="numpy", cache=True)
def _integrate(corners, samples, shapes, slopes, values, volume, place, modes, gradients):
    """Sums over the Gauss points of the samples held: volume (k,), place (k, d), modes (k, 2^d), gradients
    (k, 2^d, d), written. shapes, slopes, values: see `_tables`."""
    count, dimension = corners.shape[1], corners.shape[2]
    weight = 1.0 / (SAMPLES_PER_CELL * count)
    for cell in prange(len(corners)):
        jacobian, cofactor = np.eye(3), np.empty((3, 3))
        for sample in range(SAMPLES_PER_CELL):
            if not (samples[cell] >> np.uint64(sample)) & np.uint64(1):
                continue
            for gauss in range(count):
                element = weight * _set_jacobian(corners, cell, slopes, sample, gauss, jacobian, cofactor)
                volume[cell] += element
                for c in range(count):
                    share = shapes[sample, gauss, c] * element
                    modes[cell, c] += values[sample, gauss, c] * element
                    for j in range(dimension):
                        place[cell, j] += share * corners[cell, c, j]
                        total = 0.0
                        for k in range(dimension):
                            total += cofactor[j, k] * slopes[sample, gauss, c, k]
                        gradients[cell, c, j] += weight * total
