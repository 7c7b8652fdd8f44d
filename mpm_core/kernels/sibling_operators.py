"""The elastic operator: forces K u of groups of sibling cells, eight in 3-D and four in 2-D; eight groups at a time.

In 3-D the cells of a group share 27 nodes. Sums and differences of neighbouring nodes along z, then y, then x give the
modes of all eight cells (kernels/modes.py) with a third of the additions and reads that cell by cell would take. Per
cell with modal sums a of the displacement (mode: product of local coordinates; component: x, y, z) the modal forces are

    linear      f_x = (l t + 2 m a_x,x ; m (a_y,x + a_x,y) ; m (a_z,x + a_x,z))      t = a_x,x + a_y,y + a_z,z
    quadratic   f_xy = (p a_xy,x + q a_yz,z ; p a_xy,y + q a_xz,z ; r a_xy,z + w (a_xz,y + a_yz,x))    and so on
    cubic       f_xyz = v a_xyz

with p = s (l + 3 m) + g, q = s l, w = s m, r = 2 s m + 2 g / 3 (modes.hourglass_share), v = s^2 (l + 4 m) + g. l and m
are sums of lambda V and mu V over the cell's particles times (2 / (8 h))^2, g is the hourglass stiffness in the same
terms, and s the mean square of a particle's local coordinate: 0 for one particle at the centre, (1 - 1/n^2) / 3 for n^3
at sub-cell centres. All other means of products vanish by symmetry: the form is exact, and the same for every number of
particles.

In plane strain a group has 9 nodes. Per cell

    linear      f_x = (l (a_x,x + a_y,y) + 2 m a_x,x ; m (a_y,x + a_x,y))    and so on
    quadratic   f_xy = p a_xy        p = s (l + 3 m) + g

where the factor of l and m is (2 / (4 h))^2.
"""

import numpy as np
from numba import njit, prange

from mpm_core.kernels.modes import TWIST_SHARE
from mpm_core.simd.lanes import LANES as W
from mpm_core.simd.lanes import (
    add_to_points_2,
    add_to_points_3,
    fill,
    gather_points_2,
    gather_points_3,
    load,
    prefetch,
    store,
)

GROUP_NODES_3 = 27  # Nodes of a group in 3-D; x + 3 y + 9 z is the number of each.
# First row of the half of the scratch that holds sums along z and y. Forces use the halves the other way round.
FIRST_Y_ROW = 144
SCRATCH_ROWS_3 = 288
GROUP_NODES_2 = 9  # Nodes of a group in 2-D; x + 3 y is the number of each.
SCRATCH_ROWS_2 = 24  # Rows of the scratch: sums along y by layer, x and component, then differences.


@njit(inline="always", error_model="numpy")
def _sum_along_z(values, places, start, work):
    """Rows 0..53 of `work`: sums along z by layer, y, x, component; rows 54..107 differences."""
    for j in range(9):
        ax, ay, az = gather_points_3(values, places, start + j * W)
        bx, by, bz = gather_points_3(values, places, start + (9 + j) * W)
        cx, cy, cz = gather_points_3(values, places, start + (18 + j) * W)
        row = 3 * j * W
        store(work, row, ax + bx)
        store(work, row + W, ay + by)
        store(work, row + 2 * W, az + bz)
        store(work, row + 27 * W, bx + cx)
        store(work, row + 28 * W, by + cy)
        store(work, row + 29 * W, bz + cz)
        store(work, row + 54 * W, bx - ax)
        store(work, row + 55 * W, by - ay)
        store(work, row + 56 * W, bz - az)
        store(work, row + 81 * W, cx - bx)
        store(work, row + 82 * W, cy - by)
        store(work, row + 83 * W, cz - bz)


@njit(inline="always", error_model="numpy")
def _sum_along_y(work):
    """Rows FIRST_Y_ROW...: four parts of 36 rows (sums or differences along z; then along y) by layer z, y, x,
    component."""
    for part in range(2):
        for layer in range(2):
            for j in range(9):
                row = (54 * part + 27 * layer + j) * W
                a, b, c = load(work, row), load(work, row + 9 * W), load(work, row + 18 * W)
                row = (FIRST_Y_ROW + 72 * part + 18 * layer + j) * W
                store(work, row, a + b)
                store(work, row + 9 * W, b + c)
                store(work, row + 36 * W, b - a)
                store(work, row + 45 * W, c - b)


@njit(inline="always", error_model="numpy")
def _add(work, row, first, x, y, z):
    """Put three components into rows from `row` on; add them where another cell of the row was there first."""
    if first:
        store(work, row, x)
        store(work, row + W, y)
        store(work, row + 2 * W, z)
    else:
        store(work, row, load(work, row) + x)
        store(work, row + W, load(work, row + W) + y)
        store(work, row + 2 * W, load(work, row + 2 * W) + z)


@njit(inline="always", error_model="numpy")
def _cell_forces(work, source, target, first, lame, shear, stiffness, s):
    """Modal forces of one cell, undone along x: rows `source` (displacement) to `target` (force) of the four parts.

    The parts, 36 rows apart: sums along z and y, sums and differences, differences and sums, differences.
    """
    ax, ay, az = load(work, source), load(work, source + W), load(work, source + 2 * W)
    bx, by, bz = load(work, source + 3 * W), load(work, source + 4 * W), load(work, source + 5 * W)
    xx, xy, xz = bx - ax, by - ay, bz - az  # mode x, components x, y, z
    source += 36 * W
    ax, ay, az = load(work, source), load(work, source + W), load(work, source + 2 * W)
    bx, by, bz = load(work, source + 3 * W), load(work, source + 4 * W), load(work, source + 5 * W)
    yx, yy, yz = ax + bx, ay + by, az + bz  # mode y
    dx, dy, dz = bx - ax, by - ay, bz - az  # mode xy
    source += 36 * W
    ax, ay, az = load(work, source), load(work, source + W), load(work, source + 2 * W)
    bx, by, bz = load(work, source + 3 * W), load(work, source + 4 * W), load(work, source + 5 * W)
    zx, zy, zz = ax + bx, ay + by, az + bz  # mode z
    ex, ey, ez = bx - ax, by - ay, bz - az  # mode xz
    source += 36 * W
    ax, ay, az = load(work, source), load(work, source + W), load(work, source + 2 * W)
    bx, by, bz = load(work, source + 3 * W), load(work, source + 4 * W), load(work, source + 5 * W)
    fx, fy, fz = ax + bx, ay + by, az + bz  # mode yz
    hx, hy, hz = bx - ax, by - ay, bz - az  # mode xyz

    volumetric = lame * (xx + yy + zz)
    double = shear + shear
    sxx, syy, szz = volumetric + double * xx, volumetric + double * yy, volumetric + double * zz
    sxy, sxz, syz = shear * (xy + yx), shear * (xz + zx), shear * (yz + zy)
    q, w = s * lame, s * shear
    r = w + w + fill(work, TWIST_SHARE) * stiffness
    p = q + w + w + w + stiffness
    v = s * (q + w + w + w + w) + stiffness
    twist = w * (dz + ey + fx)
    rest = r - w
    dx, dy, dz, ex, ey, ez, fx, fy, fz = (
        p * dx + q * fz,
        p * dy + q * ez,
        rest * dz + twist,
        p * ex + q * fy,
        rest * ey + twist,
        p * ez + q * dy,
        rest * fx + twist,
        p * fy + q * ex,
        p * fz + q * dx,
    )
    hx, hy, hz = v * hx, v * hy, v * hz
    zero = lame - lame
    _add(work, target, first, zero - sxx, zero - sxy, zero - sxz)
    _add(work, target + 3 * W, True, sxx, sxy, sxz)
    target += 36 * W
    _add(work, target, first, sxy - dx, syy - dy, syz - dz)
    _add(work, target + 3 * W, True, sxy + dx, syy + dy, syz + dz)
    target += 36 * W
    _add(work, target, first, sxz - ex, syz - ey, szz - ez)
    _add(work, target + 3 * W, True, sxz + ex, syz + ey, szz + ez)
    target += 36 * W
    _add(work, target, first, fx - hx, fy - hy, fz - hz)
    _add(work, target + 3 * W, True, fx + hx, fy + hy, fz + hz)


@njit(inline="always", error_model="numpy")
def _undo_along_y(work):
    """Rows 0..143, four parts, to rows FIRST_Y_ROW...: two parts (sums, differences along z) of 54 rows by layer, y,
    x."""
    for part in range(2):
        for layer in range(2):
            for j in range(9):
                row = (72 * part + 18 * layer + j) * W
                a, b = load(work, row), load(work, row + 9 * W)
                c, d = load(work, row + 36 * W), load(work, row + 45 * W)
                row = (FIRST_Y_ROW + 54 * part + 27 * layer + j) * W
                store(work, row, a - c)
                store(work, row + 9 * W, (a + c) + (b - d))
                store(work, row + 18 * W, b + d)


@njit(inline="always", error_model="numpy")
def _undo_along_z(work, places, start, forces):
    """Add forces to the nodes from rows FIRST_Y_ROW...: sums along z, and 54 rows on differences."""
    for j in range(9):
        row = (FIRST_Y_ROW + 3 * j) * W
        ax, ay, az = load(work, row), load(work, row + W), load(work, row + 2 * W)
        bx, by, bz = load(work, row + 27 * W), load(work, row + 28 * W), load(work, row + 29 * W)
        cx, cy, cz = load(work, row + 54 * W), load(work, row + 55 * W), load(work, row + 56 * W)
        dx, dy, dz = load(work, row + 81 * W), load(work, row + 82 * W), load(work, row + 83 * W)
        add_to_points_3(forces, places, start + j * W, ax - cx, ay - cy, az - cz)
        add_to_points_3(
            forces, places, start + (9 + j) * W, (ax + cx) + (bx - dx), (ay + cy) + (by - dy), (az + cz) + (bz - dz)
        )
        add_to_points_3(forces, places, start + (18 + j) * W, bx + dx, by + dy, bz + dz)


@njit(parallel=True, error_model="numpy", cache=True)
def apply_siblings_3(batch_start, row_start, places, constants, values, forces):
    """Forces K u of all groups, on the rows of their own blocks: `forces`, written.

    batch_start, row_start (block + 1,), places (batch * 27 * LANES,) int32: see multigrid.siblings; constants
    (batch * 8 * 4 * LANES,): l, m, g (N/m) and s above, by cell of the group; values, forces (row * 4,): displacement
    and force of each row. float64 or float32 throughout. Copies of a node hold their own part of the force.
    """
    for block in prange(len(batch_start) - 1):
        work = np.empty(SCRATCH_ROWS_3 * W, values.dtype)
        for element in range(4 * row_start[block], 4 * row_start[block + 1]):
            forces[element] = 0.0
        for batch in range(batch_start[block], batch_start[block + 1]):
            start = batch * GROUP_NODES_3 * W
            if batch + 1 < batch_start[block + 1]:  # else the processor waits for memory
                for place in range(start + GROUP_NODES_3 * W, start + 2 * GROUP_NODES_3 * W):
                    prefetch(values, places[place] * 4)
            _sum_along_z(values, places, start, work)
            _sum_along_y(work)
            for row in range(4):
                for along in range(2):
                    cell = (8 * batch + 2 * row + along) * 4 * W
                    _cell_forces(
                        work,
                        (FIRST_Y_ROW + 9 * row + 3 * along) * W,
                        (9 * row + 3 * along) * W,
                        along == 0,
                        load(constants, cell),
                        load(constants, cell + W),
                        load(constants, cell + 2 * W),
                        load(constants, cell + 3 * W),
                    )
            _undo_along_y(work)
            _undo_along_z(work, places, start, forces)


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
