"""What the elastic operator needs of a model: constants of each cell, in the discretisation of scheme `explicit`."""

from dataclasses import dataclass

import numpy as np

from mpm_core.kernels.operator_cells import sum_cell_stiffness
from mpm_core.model.model import Model


@dataclass(frozen=True)
class ElasticCells:
    """Elastic stiffness of a model's cells.

    constants (cell, 4): l, m, g (N/m) and s of kernels.operator_3; 0 where nothing is left. irregular (k,) cells whose
    particles are single samples or means over some: stiffness (k, 2^d d, 2^d d) N/m stands for that of l and m, which
    their constants hold all the same; g counts besides. distorted (n,) cells in which g acts on the modal sums that
    patterns (n, 2^d - 1 - d, 2^d) take, not on the higher modes (Model.hourglass_patterns). averaged: the same
    stiffness particle by particle where each stands for a mean over samples: cells (n,), slopes (n, 2^d, d), matrices
    (n, 36) as in kernels.tangent_rows.
    """

    constants: np.ndarray
    irregular: np.ndarray
    stiffness: np.ndarray
    distorted: np.ndarray
    patterns: np.ndarray
    averaged: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

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
    stiffness = np.empty((len(irregular), corners * dimension, corners * dimension))
    sum_cell_stiffness(
        np.append(start, len(single)), single, grid.cell_size[irregular], row, particles.slopes, lame, shear, stiffness
    )
    averaged = None
    if not (particles.sample[single] >= 0).any():
        cell = particles.cell[single]
        matrices = _matrices(lame[single] * slope[cell] ** 2, shear[single] * slope[cell] ** 2)
        averaged = cell, particles.slopes[row[single]], matrices
    return ElasticCells(constants, irregular, stiffness, particles.distorted.cell, model.hourglass_patterns, averaged)


def _matrices(lame: np.ndarray, shear: np.ndarray) -> np.ndarray:
    """Matrices (k, 36) that take engineering strain to stress, of lambda and mu (k,)."""
    matrices = np.zeros((len(lame), 6, 6))
    matrices[:, :3, :3] = lame[:, None, None]
    matrices[:, range(3), range(3)] += 2.0 * shear[:, None]
    matrices[:, range(3, 6), range(3, 6)] = shear[:, None]
    return matrices.reshape(-1, 36)
