"""The stiffness of a model's cells for the elastic operator, in the discretisation of scheme `explicit`."""

from dataclasses import dataclass

import numpy as np

from mpm_core.kernels.operator_cells import largest_row_sums, sum_cell_stiffness
from mpm_core.model.model import Model

CELLS_AT_ONCE = 256  # The matrices of so many stay in a near cache; those of all would not fit into any.


@dataclass(frozen=True)
class CellParts:
    """The particles of irregular cells (k,), as kernels.operator_cells.sum_cell_stiffness takes them."""

    particle_start: np.ndarray
    particles: np.ndarray
    cell_size: np.ndarray
    row: np.ndarray
    slopes: np.ndarray
    lame_volume: np.ndarray
    shear_volume: np.ndarray

    def stiffness(self, first: int = 0, last: int | None = None) -> np.ndarray:
        """Stiffness of cells from first to before last, or of all: (n, 2^d d, 2^d d) N/m."""
        size, rows = self.cell_size[first:last], self.slopes.shape[1] * self.slopes.shape[2]
        matrices = np.empty((len(size), rows, rows))
        sum_cell_stiffness(
            self.particle_start[first : first + len(size) + 1], self.particles, size, self.row, self.slopes,
            self.lame_volume, self.shear_volume, matrices,
        )  # fmt: skip
        return matrices


@dataclass(frozen=True)
class ElasticCells:
    """Elastic stiffness of a model's cells.

    constants (cell, 4): l, m, g (N/m) and s of kernels.sibling_operators; 0 where nothing is left. irregular (k,) cells
    whose particles are single samples or means over some: the stiffness of their parts stands for that of l and m,
    which their constants hold all the same; g counts besides. distorted (n,) cells in which g acts on the modal sums
    that patterns (n, 2^d - 1 - d, 2^d) take, not on the higher modes (Model.hourglass_patterns). averaged: the same
    stiffness particle by particle where each stands for a mean over samples: cells (n,), slopes (n, 2^d, d), matrices
    (n, 36) as in kernels.flow_rows.
    """

    constants: np.ndarray
    irregular: np.ndarray
    parts: CellParts | None
    distorted: np.ndarray
    patterns: np.ndarray
    averaged: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

    def row_sums(self) -> np.ndarray:
        """A bound of the stiffness of the irregular cells, with what their hourglass patterns add where they are
        distorted: (k, 2^d) N/m, see `largest_row_sums`."""
        bits = np.arange(self.patterns.shape[2])
        if self.parts is None or not len(self.irregular):
            return np.empty((0, len(bits)))
        place = np.minimum(np.searchsorted(self.irregular, self.distorted), len(self.irregular) - 1)
        own = np.flatnonzero(self.irregular[place] == self.distorted)
        pattern = np.full(len(self.irregular), -1)
        pattern[place[own]] = np.arange(len(own))
        sign = (-1.0) ** np.bitwise_count(bits & ~bits[:, None])  # (corner, mode)
        patterns, hourglass = self.patterns[own] @ sign.T, self.constants[self.distorted[own], 2]
        sums = []
        for first in range(0, len(self.irregular), CELLS_AT_ONCE):
            last = first + CELLS_AT_ONCE
            sums.append(largest_row_sums(self.parts.stiffness(first, last), pattern[first:last], patterns, hourglass))
        return np.concatenate(sums)

    @property
    def wave_over_shear(self) -> float:
        """Largest (l + 2 m) / m of any cell."""
        lame, shear = self.constants[:, :2].T
        present = shear > 0.0
        return float((lame[present] / shear[present]).max(initial=0.0)) + 2.0


def elastic_cells(model: Model, volume: np.ndarray, hourglass: np.ndarray) -> ElasticCells:
    """Stiffness with these particle volumes (particle,) m3 and hourglass stiffnesses (cell,) N/m."""
    particles, grid, dimension = model.particles, model.grid, model.dimension
    cells, corners = len(model.cell_nodes), 1 << dimension
    lame, shear = model.elastic_constants[particles.material].T
    lame, shear = lame * volume, shear * volume
    slope = 2.0 / grid.cell_size / corners  # of modal sums
    constants = np.empty((cells, 4))
    constants[:, 0] = np.bincount(particles.cell, lame, minlength=cells) * slope**2
    constants[:, 1] = np.bincount(particles.cell, shear, minlength=cells) * slope**2
    constants[:, 2] = hourglass / corners**2
    per_edge = np.diff(particles.group_start)[:cells] ** (1.0 / dimension)
    constants[:, 3] = (1.0 - 1.0 / per_edge**2) / 3.0

    row, present = particles.row, volume > 0.0
    cut = np.zeros(cells, bool)
    cut[particles.cell[present & ((particles.sample >= 0) | (row >= particles.shared_rows))]] = True
    single = np.flatnonzero(cut[particles.cell] & present)
    single = single[np.argsort(particles.cell[single], kind="stable")]
    irregular, start = np.unique(particles.cell[single], return_index=True)
    particle_start = np.append(start, len(single))
    parts = CellParts(particle_start, single, grid.cell_size[irregular], row, particles.slopes, lame, shear)
    averaged = None
    if not (particles.sample[single] >= 0).any():
        cell = particles.cell[single]
        matrices = _matrices(lame[single] * slope[cell] ** 2, shear[single] * slope[cell] ** 2)
        averaged = cell, particles.slopes[row[single]], matrices
    return ElasticCells(constants, irregular, parts, particles.distorted.cell, model.hourglass_patterns, averaged)


def _matrices(lame: np.ndarray, shear: np.ndarray) -> np.ndarray:
    """Matrices (k, 36) that take engineering strain to stress, of lambda and mu (k,)."""
    matrices = np.zeros((len(lame), 6, 6))
    matrices[:, :3, :3] = lame[:, None, None]
    matrices[:, range(3), range(3)] += 2.0 * shear[:, None]
    matrices[:, range(3, 6), range(3, 6)] = shear[:, None]
    return matrices.reshape(-1, 36)
