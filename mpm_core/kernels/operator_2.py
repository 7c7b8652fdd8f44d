"""The elastic operator in plane strain: forces K u of groups of four sibling cells, eight groups at a time.

As operator_3.py with 9 nodes per group; per cell with modal sums a

    linear      f_x = (l (a_x,x + a_y,y) + 2 m a_x,x ; m (a_y,x + a_x,y))    and so on
    quadratic   f_xy = p a_xy        p = s (l + 3 m) + g

where l and m are sums of lambda V and mu V over the cell's particles times (2 / (4 h))^2.
"""

import numpy as np
from numba import njit, prange

from mpm_core.simd.lanes import LANES as W
from mpm_core.simd.lanes import add_to_points_2, gather_points_2, load, store

GROUP_NODES_2 = 9  # Nodes of a group in 2-D; x + 3 y is the number of each.
SCRATCH_ROWS_2 = 24  # Rows of the scratch: sums along y by layer, x and component, then differences.


@njit(parallel=True, error_model="numpy", cache=True)
def apply_siblings_2(batch_start, row_start, places, constants, values, forces):
    """Forces K u of all groups, on the rows of their own blocks: `forces`, written.

    batch_start, row_start (block + 1,), places (batch * 9 * LANES,) int32: see multigrid.siblings; constants
    (batch * 4 * 4 * LANES,): l, m, g (N/m2) and s above, by cell of the group; values, forces (row * 2,): displacement
    and force of each row. float64 or float32 throughout. Copies of a node hold their own part of the force.
    """
    for block in prange(len(batch_start) - 1):
        work = np.empty(SCRATCH_ROWS_2 * W, values.dtype)
        back = np.empty(SCRATCH_ROWS_2 * W, values.dtype)
        for element in range(2 * row_start[block], 2 * row_start[block + 1]):
            forces[element] = 0.0
        for batch in range(batch_start[block], batch_start[block + 1]):
            start = batch * GROUP_NODES_2 * W
            for j in range(3):
                ax, ay = gather_points_2(values, places, start + j * W)
                bx, by = gather_points_2(values, places, start + (3 + j) * W)
                cx, cy = gather_points_2(values, places, start + (6 + j) * W)
                row = 2 * j * W
                store(work, row, ax + bx)
                store(work, row + W, ay + by)
                store(work, row + 6 * W, bx + cx)
                store(work, row + 7 * W, by + cy)
                store(work, row + 12 * W, bx - ax)
                store(work, row + 13 * W, by - ay)
                store(work, row + 18 * W, cx - bx)
                store(work, row + 19 * W, cy - by)
            for layer in range(2):
                for along in range(2):
                    cell = (4 * batch + 2 * layer + along) * 4 * W
                    lam, mu = load(constants, cell), load(constants, cell + W)
                    stiffness, s = load(constants, cell + 2 * W), load(constants, cell + 3 * W)
                    row = (6 * layer + 2 * along) * W
                    ax, ay, bx, by = (
                        load(work, row), load(work, row + W), load(work, row + 2 * W), load(work, row + 3 * W)
                    )  # fmt: skip
                    xx, xy = bx - ax, by - ay
                    row += 12 * W
                    ax, ay, bx, by = (
                        load(work, row), load(work, row + W), load(work, row + 2 * W), load(work, row + 3 * W)
                    )  # fmt: skip
                    yx, yy = ax + bx, ay + by
                    bend = s * (lam + mu + mu + mu) + stiffness
                    dx, dy = bend * (bx - ax), bend * (by - ay)
                    volumetric = lam * (xx + yy)
                    sxx, syy = volumetric + (mu + mu) * xx, volumetric + (mu + mu) * yy
                    sxy = mu * (xy + yx)
                    zero = lam - lam
                    row -= 12 * W
                    if along == 0:
                        store(back, row, zero - sxx)
                        store(back, row + W, zero - sxy)
                        store(back, row + 12 * W, sxy - dx)
                        store(back, row + 13 * W, syy - dy)
                    else:
                        store(back, row, load(back, row) - sxx)
                        store(back, row + W, load(back, row + W) - sxy)
                        store(back, row + 12 * W, load(back, row + 12 * W) + (sxy - dx))
                        store(back, row + 13 * W, load(back, row + 13 * W) + (syy - dy))
                    store(back, row + 2 * W, sxx)
                    store(back, row + 3 * W, sxy)
                    store(back, row + 14 * W, sxy + dx)
                    store(back, row + 15 * W, syy + dy)
            for j in range(3):
                row = 2 * j * W
                ax, ay, bx, by = (
                    load(back, row), load(back, row + W), load(back, row + 6 * W), load(back, row + 7 * W)
                )  # fmt: skip
                row += 12 * W
                cx, cy, dx, dy = (
                    load(back, row), load(back, row + W), load(back, row + 6 * W), load(back, row + 7 * W)
                )  # fmt: skip
                add_to_points_2(forces, places, start + j * W, ax - cx, ay - cy)
                add_to_points_2(forces, places, start + (3 + j) * W, (ax + cx) + (bx - dx), (ay + cy) + (by - dy))
                add_to_points_2(forces, places, start + (6 + j) * W, bx + dx, by + dy)
