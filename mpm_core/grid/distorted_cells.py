"""Finest cells that have a moved node (edge_nodes.py) as a corner: their shape, and integrals over parts of them.

A distorted cell is the image of the reference cell, -1 to 1, by its trilinear shape functions (bilinear in 2-D); the
cells still fill space without gap. Its 64 samples are the images of the reference cell's sub-cells. Integrals over a
sub-cell are by Gauss points, two along each axis, which is exact for volumes and for gradients: so sums over cells that
share a node vanish where they should, and a patch of distorted cells takes a uniform strain exactly.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from mpm_core.geometry.sampling import sample_points
from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.mesh import MultiLevelGrid

SAMPLES = 64
GAUSS = 1.0 / np.sqrt(3.0)


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
        """Which of these each of some cells (n,) is, (n,) int64; -1 for cells that are cubes."""
        if not len(self.cell):
            return np.full(len(cells), -1, np.int64)
        row = np.minimum(np.searchsorted(self.cell, cells), len(self.cell) - 1)
        return np.where(self.cell[row] == cells, row, -1)

    def volumes(self, cells: np.ndarray) -> np.ndarray:
        """Volume of each of some cells (n,), in cubes of its size: (n,)."""
        volume, row = np.ones(len(cells)), self.rows(cells)
        bent = np.flatnonzero(row >= 0)
        volume[bent] = sample_volumes(self.corners[row[bent]]).sum(axis=1)
        return volume

    def of(self, chosen: np.ndarray, number: np.ndarray) -> "DistortedCells":
        """Those among chosen cells of the grid (cell,) bool; number (cell,) int32: what they are called there."""
        kept = chosen[self.cell]
        return DistortedCells(number[self.cell[kept]], self.corners[kept])


@dataclass(frozen=True)
class PartIntegrals:
    """Of parts of distorted cells (k,): volume, in cubes; place (k, d) of the centroid, -1 to 1 across the undistorted
    cell; modes (k, 2^d), means of the reference cell's modes (kernels/modes.py); gradients (k, 2^d, d), means of the
    corners' shape functions' along the axes, in units of 2 over the cell's edge."""

    volume: np.ndarray
    place: np.ndarray
    modes: np.ndarray
    gradients: np.ndarray


def corner_offsets(dimension: int) -> np.ndarray:
    """Corners (2^d, d) int32 of the unit cube in bit order."""
    return (np.arange(1 << dimension)[:, None] >> np.arange(dimension) & 1).astype(np.int32)


def sub_cell_middles(dimension: int) -> np.ndarray:
    """Middles (64, d) of the samples' sub-cells in the unit cube, in bit order."""
    per_edge = round(SAMPLES ** (1 / dimension))
    number = np.arange(SAMPLES)[:, None] // per_edge ** np.arange(dimension) % per_edge
    return (number + 0.5) / per_edge


def distorted_shapes(place: np.ndarray, shift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Finest cells around moved nodes, place (k, d) fine units, shift (k, d) finest cells: places (n, d) int32 of their
    lower corners, and their corners (n, 2^d, d) as in DistortedCells."""
    dimension = place.shape[1]
    offsets = corner_offsets(dimension)
    around = (place[:, None, :] - offsets).reshape(-1, dimension)
    cells, row = np.unique(around, axis=0, return_inverse=True)
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


def sample_places(corners: np.ndarray) -> np.ndarray:
    """Where the sample points of cells with these corners (k, 2^d, d) lie, (k, 64, d), in the corners' units."""
    points = sample_points(corners.shape[2]).T  # 0 to 1
    bits = corner_offsets(corners.shape[2])
    shape = np.prod(np.where(bits == 1, points[:, None, :], 1.0 - points[:, None, :]), axis=2)  # (sample, corner)
    return np.einsum("sc,kcj->ksj", shape, corners)


def part_integrals(corners: np.ndarray, samples: np.ndarray) -> PartIntegrals:
    """Integrals over sets of samples (k,) uint64, none of them empty, of cells with corners (k, 2^d, d)."""
    count, corner_count, dimension = len(corners), corners.shape[1], corners.shape[2]
    volume, place = np.zeros(count), np.zeros((count, dimension))
    modes, gradients = np.zeros((count, corner_count)), np.zeros((count, corner_count, dimension))
    _integrate(corners, samples, volume, place, modes, gradients)
    place = 2.0 * place / volume[:, None] - 1.0
    return PartIntegrals(volume, place, modes / volume[:, None], 0.5 * gradients / volume[:, None, None])


def sample_volumes(corners: np.ndarray) -> np.ndarray:
    """Volume (k, 64) of each sample of cells with corners (k, 2^d, d), in cubes."""
    count, corner_count, dimension = len(corners), corners.shape[1], corners.shape[2]
    bits = np.tile(np.uint64(1) << np.arange(SAMPLES, dtype=np.uint64), count)
    each = np.repeat(corners, SAMPLES, axis=0)
    volume = np.zeros(len(each))
    _integrate(
        each, bits, volume, np.zeros((len(each), dimension)), np.zeros((len(each), corner_count)),
        np.zeros((len(each), corner_count, dimension)),
    )  # fmt: skip
    return volume.reshape(count, SAMPLES)


def smallest_volume_ratio(corners: np.ndarray) -> float:
    """The smallest ratio of a cell's volume element to a cube's, at the middle of any sub-cell of cells with corners
    (k, 2^d, d)."""
    bits = corner_offsets(corners.shape[2])
    places = sub_cell_middles(corners.shape[2])
    slopes = []
    for axis in range(corners.shape[2]):
        shape = np.where(bits == 1, places[:, None, :], 1.0 - places[:, None, :])
        shape[:, :, axis] = np.where(bits[:, axis] == 1, 1.0, -1.0)
        slopes.append(np.prod(shape, axis=2))
    jacobian = np.einsum("apc,kcj->kpja", np.stack(slopes), corners)
    return float(np.linalg.det(jacobian).min())


@njit(parallel=True, error_model="numpy", cache=True)
def _integrate(corners, samples, volume, place, modes, gradients):
    """Sums over the Gauss points of the samples held: volume (k,), place (k, d), modes (k, 2^d), gradients
    (k, 2^d, d), written."""
    count, dimension = corners.shape[1], corners.shape[2]
    per_edge = 4 if dimension == 3 else 8
    half = 1.0 / per_edge
    for cell in prange(len(corners)):
        shape = np.empty(count)
        slope = np.empty((count, dimension))
        jacobian = np.zeros((3, 3))
        cofactor = np.zeros((3, 3))
        xi = np.zeros(3)
        for sample in range(64):
            if not (samples[cell] >> np.uint64(sample)) & np.uint64(1):
                continue
            for gauss in range(count):
                rest = sample
                for axis in range(dimension):
                    middle = (2 * (rest % per_edge) + 1) * half - 1.0
                    rest //= per_edge
                    xi[axis] = middle + (GAUSS if (gauss >> axis) & 1 else -GAUSS) * half
                for c in range(count):
                    shape[c] = 1.0
                    for axis in range(dimension):
                        sign = 1.0 if (c >> axis) & 1 else -1.0
                        shape[c] *= 0.5 * (1.0 + sign * xi[axis])
                    for k in range(dimension):
                        slope[c, k] = 1.0
                        for axis in range(dimension):
                            sign = 1.0 if (c >> axis) & 1 else -1.0
                            slope[c, k] *= 0.5 * sign if axis == k else 0.5 * (1.0 + sign * xi[axis])
                for j in range(dimension):
                    for k in range(dimension):
                        jacobian[j, k] = 0.0
                        for c in range(count):
                            jacobian[j, k] += corners[cell, c, j] * slope[c, k]
                if dimension == 2:
                    jacobian[2, 2] = 1.0
                for j in range(3):
                    for k in range(3):
                        a, b = (j + 1) % 3, (j + 2) % 3
                        m, n = (k + 1) % 3, (k + 2) % 3
                        cofactor[j, k] = jacobian[a, m] * jacobian[b, n] - jacobian[a, n] * jacobian[b, m]
                weight = half**dimension
                element = jacobian[0, 0] * cofactor[0, 0] + jacobian[0, 1] * cofactor[0, 1]
                element = (element + jacobian[0, 2] * cofactor[0, 2]) * weight
                volume[cell] += element
                for c in range(count):
                    for j in range(dimension):
                        place[cell, j] += shape[c] * corners[cell, c, j] * element
                        for k in range(dimension):
                            gradients[cell, c, j] += cofactor[j, k] * slope[c, k] * weight
                for mode in range(count):
                    value = 1.0
                    for axis in range(dimension):
                        if (mode >> axis) & 1:
                            value *= xi[axis]
                    modes[cell, mode] += value * element
