"""Terms that the elastic operator adds for single cells.

Cells whose particles follow no rule (samples of a cut cell) have a full stiffness matrix each. Distorted cells have
hourglass patterns of their own.
"""

import numpy as np
from numba import njit, prange

from mpm_core.kernels.flow_rows import gather_corners, scatter_corners, sum_corners, sum_modes
from mpm_core.kernels.modes import to_corners
from mpm_core.simd.lanes import LANES as W
from mpm_core.simd.lanes import fill, load, store


@njit(parallel=True, error_model="numpy", cache=True)
def sum_cell_stiffness(particle_start, particles, cell_size, row, slopes, lame_volume, shear_volume, stiffness):
    """Stiffness sum B^T C B V over the particles of each cell: stiffness (cell, 2^d d, 2^d d), written.

    particle_start (cell + 1,), particles: indices; cell_size (cell,) m; row (particle,): of slopes (row, 2^d, d);
    lame_volume, shear_volume (particle,) lambda V and mu V. Row and column: corner * d + component, corners in bit
    order.
    """
    corners = slopes.shape[1]
    dimension = stiffness.shape[1] // corners
    for cell in prange(len(cell_size)):
        gradient = np.empty((dimension, corners))
        stiffness[cell] = 0.0
        for q in range(particle_start[cell], particle_start[cell + 1]):
            p = particles[q]
            lame, shear = lame_volume[p], shear_volume[p]
            if shear == 0.0:
                continue
            for k in range(dimension):
                for mode in range(corners):
                    gradient[k, mode] = 2.0 / cell_size[cell] / corners * slopes[row[p], mode, k]
                to_corners(gradient, k, dimension)
            for a in range(corners):
                for b in range(corners):
                    both = 0.0
                    for k in range(dimension):
                        both += gradient[k, a] * gradient[k, b]
                    for i in range(dimension):
                        stiffness[cell, a * dimension + i, b * dimension + i] += shear * both
                        for j in range(dimension):
                            stiffness[cell, a * dimension + i, b * dimension + j] += (
                                lame * gradient[i, a] * gradient[j, b] + shear * gradient[j, a] * gradient[i, b]
                            )


@njit(parallel=True, error_model="numpy", cache=True)
def apply_cells(block_cells, cell_rows, stiffness, width, values, forces):
    """Add the forces of these cells: forces (row * width,), in place, each block on its own rows.

    block_cells (block + 1,): first cell of each block; cell_rows (cell, 2^d) rows of the corners; stiffness
    (cell, 2^d d, 2^d d); values (row * width,).
    """
    corners = cell_rows.shape[1]
    dimension = stiffness.shape[1] // corners
    for block in prange(len(block_cells) - 1):
        for cell in range(block_cells[block], block_cells[block + 1]):
            for a in range(corners):
                for i in range(dimension):
                    total = values.dtype.type(0.0)
                    for b in range(corners):
                        for j in range(dimension):
                            total += (
                                stiffness[cell, a * dimension + i, b * dimension + j]
                                * values[cell_rows[cell, b] * width + j]
                            )
                    forces[cell_rows[cell, a] * width + i] += total


@njit(parallel=True, error_model="numpy", cache=True)
def largest_row_sums(stiffness, pattern, patterns, hourglass):
    """The largest sum of sizes along the rows of each corner, (cell, 2^d); stiffness (cell, 2^d d, 2^d d).

    pattern (cell,): of patterns (k, mode, 2^d) at the corners, whose stiffness (k,) comes on top in each component; -1
    where none does.
    """
    corners = patterns.shape[2]
    largest = np.zeros((len(stiffness), corners))
    dimension = stiffness.shape[1] // corners
    for cell in prange(len(stiffness)):
        own = pattern[cell]
        for row in range(stiffness.shape[1]):
            total = 0.0
            for column in range(stiffness.shape[1]):
                entry = stiffness[cell, row, column]
                if own >= 0 and row % dimension == column % dimension:
                    added = 0.0
                    for mode in range(patterns.shape[1]):
                        both = patterns[own, mode, row // dimension] * patterns[own, mode, column // dimension]
                        added += both * hourglass[own]
                    entry += added
                total += abs(entry)
            largest[cell, row // dimension] = max(largest[cell, row // dimension], total)
    return largest


@njit(parallel=True, error_model="numpy", cache=True)
def add_row_sums(block_cells, cell_rows, row_sums, sums):
    """Add to each corner what `largest_row_sums` has of it, row_sums (cell, 2^d): sums (row * 4,), in place.

    That much on the diagonal outweighs the cell (Gershgorin). Into places 0 and 1, its square into 2: see
    multigrid.level.
    """
    for block in prange(len(block_cells) - 1):
        for cell in range(block_cells[block], block_cells[block + 1]):
            for corner in range(cell_rows.shape[1]):
                element = 4 * cell_rows[cell, corner]
                sums[element] += row_sums[cell, corner]
                sums[element + 1] += row_sums[cell, corner]
                sums[element + 2] += row_sums[cell, corner] ** 2


def make_add_patterns(dimension):
    """The kernel for d = dimension."""
    corners = 1 << dimension
    held = dimension * corners * W

    @njit(parallel=True, error_model="numpy", cache=True)
    def add_patterns(batch_start, places, patterns, stiffness, values, forces):
        """forces += g p (p . values) along each axis, of all entries, eight at a time: flat nodal arrays, copies filled
        in.

        batch_start (block + 1,), places: see flow_rows.subtract_tangents; patterns p (batch * 2^d * LANES,) of the
        modes; stiffness g (batch * d * LANES,) by axis. One precision throughout.
        """
        for block in prange(len(batch_start) - 1):
            work = np.zeros(held + 3 * W, values.dtype)
            for batch in range(batch_start[block], batch_start[block + 1]):
                start = batch * corners * W
                gather_corners(work, values, places, start, dimension)
                sum_modes(work, dimension)
                for j in range(dimension):
                    total = fill(work, 0.0)
                    for mode in range(1, corners):
                        total += load(work, (dimension * mode + j) * W) * load(patterns, start + mode * W)
                    store(work, held + j * W, load(stiffness, (batch * dimension + j) * W) * total)
                for mode in range(corners):
                    for j in range(dimension):
                        pattern = load(patterns, start + mode * W)
                        store(work, (dimension * mode + j) * W, pattern * load(work, held + j * W))
                sum_corners(work, dimension)
                scatter_corners(work, forces, places, start, dimension)

    return add_patterns


ADD_PATTERNS = {2: make_add_patterns(2), 3: make_add_patterns(3)}
"""by dimension"""
