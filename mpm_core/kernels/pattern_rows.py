"""What stands against the hourglass patterns of distorted cells, on the rows of the elastic operator."""

import numpy as np
from numba import njit, prange

from mpm_core.kernels.flow_rows import sum_corners, sum_modes
from mpm_core.kernels.tangent_rows import give, take
from mpm_core.simd.lanes import LANES as W
from mpm_core.simd.lanes import fill, load, store


def make_add_patterns(dimension):
    """The kernel for d = dimension."""
    corners = 1 << dimension
    held = dimension * corners * W

    @njit(parallel=True, error_model="numpy", cache=True)
    def add_patterns(batch_start, places, patterns, stiffness, values, forces):
        """forces += g p (p . values) along each axis, of all entries, eight at a time: flat nodal arrays, copies filled
        in.

        batch_start (block + 1,), places: see tangent_rows.take_tangents_off; patterns p (batch * 2^d * LANES,) of the
        modes; stiffness g (batch * LANES,). One precision throughout.
        """
        for block in prange(len(batch_start) - 1):
            work = np.zeros(held + 3 * W, values.dtype)
            for batch in range(batch_start[block], batch_start[block + 1]):
                start = batch * corners * W
                take(work, values, places, start, dimension)
                sum_modes(work, dimension)
                for j in range(dimension):
                    total = fill(work, 0.0)
                    for mode in range(1, corners):
                        total += load(work, (dimension * mode + j) * W) * load(patterns, start + mode * W)
                    store(work, held + j * W, load(stiffness, batch * W) * total)
                for mode in range(corners):
                    for j in range(dimension):
                        pattern = load(patterns, start + mode * W)
                        store(work, (dimension * mode + j) * W, pattern * load(work, held + j * W))
                sum_corners(work, dimension)
                give(work, forces, places, start, dimension)

    return add_patterns


ADD_PATTERNS = {2: make_add_patterns(2), 3: make_add_patterns(3)}
"""by dimension"""
