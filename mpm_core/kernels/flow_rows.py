"""Failed rock on the rows of the elastic operator (multigrid.siblings): forces that it does not carry, and its tangent.

While equilibrium is sought, stress is thought to change elastically everywhere, as the operator has it. Failed rock
returns to its residual surface: what its stress changes less is a force that elastic rock would have had.
Eight particles go side by side in vector registers (simd).

The tangent says what stiffness rock lacks that flows. A particle's matrix (6, 6) takes engineering strain to the stress
that flow takes off the elastic one, in units of the operator: strain is that of modal sums (kernels.modes) without
their factor, stress that of modal forces.
"""

import functools

import numpy as np
from numba import njit, prange

from mpm_core.constitutive.general import strength_of
from mpm_core.simd.lanes import LANES as W
from mpm_core.simd.lanes import (
    POINT_WIDTH,
    add_to_points_2,
    add_to_points_3,
    fill,
    gather_points_2,
    gather_points_3,
    load,
    load_row,
    store,
)

VOIGT = ((0, 5, 4), (5, 1, 3), (4, 3, 2))
"""place of the tensor's component j, k among six numbers"""


@njit(parallel=True, error_model="numpy", cache=True)
def total_stresses(particles, stress, insitu, total):
    """Total stress of some particles (k,), Pa: total (k, 6), written; stress, insitu (particle, 6)."""
    for i in prange(len(particles)):
        for k in range(6):
            total[i, k] = stress[particles[i], k] + insitu[particles[i], k]


@njit(inline="always", error_model="numpy")
def sum_modes(work, dimension):
    """Values at corners, in rows corner * d + component, to sums by mode (modes.to_modes), in place."""
    for k in range(dimension):
        for corner in range(1 << dimension):
            if not (corner >> k) & 1:
                for j in range(dimension):
                    one, other = (dimension * corner + j) * W, (dimension * (corner | (1 << k)) + j) * W
                    low, high = load(work, one), load(work, other)
                    store(work, one, low + high)
                    store(work, other, high - low)


@njit(inline="always", error_model="numpy")
def sum_corners(work, dimension):
    """The transpose of sum_modes (modes.to_corners), in place."""
    for k in range(dimension):
        for corner in range(1 << dimension):
            if not (corner >> k) & 1:
                for j in range(dimension):
                    one, other = (dimension * corner + j) * W, (dimension * (corner | (1 << k)) + j) * W
                    even, odd = load(work, one), load(work, other)
                    store(work, one, even - odd)
                    store(work, other, even + odd)


@functools.cache
def make_add_flow_forces(law, dimension):
    """The kernel for a law and d = dimension."""
    length = law.ROW_LENGTH
    width, corners = POINT_WIDTH[dimension], 1 << dimension
    # First elements of the parts of `work`, in rows of LANES numbers; before them values at corners, then by mode.
    shape = corners * dimension * W
    gradient = shape + corners * dimension * W
    trial = gradient + 9 * W
    held = trial + 6 * W
    stress = held + 6 * W
    constant = stress + 6 * W
    strength = constant + 4 * W
    size = strength + length * W

    @njit(parallel=True, error_model="numpy", cache=True)
    def add_flow_forces(
        block_start,
        particles,
        corner_rows,
        slope,
        table_row,
        slopes,
        values,
        volume,
        material,
        elastic_constants,
        residual_rows,
        carried,
        trial_stress,
        forces,
    ):
        """Add the forces B^T (elastic - true change of stress) V of failed particles: forces (row * width,), in place.

        block_start (block + 1,): first entry of each block; by entry (k,): particles, indices; corner_rows (k, 2^d);
        slope 1/m: 2 / 2^d over the cell's edge; table_row: of slopes (point row, 2^d, d); carried (k, 6) Pa:
        total stress at values 0; trial_stress (k, 6) Pa: the same had nothing flowed since it last counts. values
        (row * width,) m: displacement, copies filled in. volume, material (particle,); elastic_constants (material, 2)
        Pa; residual_rows (material, column).
        """
        for block in prange(len(block_start) - 1):
            end = block_start[block + 1]
            work = np.zeros(size)
            for start in range(block_start[block], end, W):
                for lane in range(W):
                    entry = min(start + lane, end - 1)  # lanes left over repeat the last one
                    particle = particles[entry]
                    rock = material[particle]
                    for corner in range(corners):
                        place = corner_rows[entry, corner] * width
                        for j in range(dimension):
                            work[(dimension * corner + j) * W + lane] = values[place + j]
                            work[shape + (dimension * corner + j) * W + lane] = slopes[table_row[entry], corner, j]
                    for k in range(6):
                        work[trial + k * W + lane] = trial_stress[entry, k]
                        work[held + k * W + lane] = carried[entry, k]
                    work[constant + lane] = elastic_constants[rock, 0]
                    work[constant + W + lane] = elastic_constants[rock, 1]
                    work[constant + 2 * W + lane] = slope[entry]
                    work[constant + 3 * W + lane] = volume[particle] * slope[entry]
                    for k in range(length):
                        work[strength + k * W + lane] = residual_rows[rock, k]

                sum_modes(work, dimension)
                for j in range(dimension):
                    for k in range(dimension):
                        total = fill(work, 0.0)
                        for mode in range(1, corners):
                            derivative = load(work, shape + (dimension * mode + k) * W)
                            total += load(work, (dimension * mode + j) * W) * derivative
                        store(work, gradient + (3 * j + k) * W, total * load(work, constant + 2 * W))
                lame, shear = load(work, constant), load(work, constant + W)
                dilation = load(work, gradient) + load(work, gradient + 4 * W) + load(work, gradient + 8 * W)
                for j in range(3):
                    for k in range(j + 1):
                        one, other = load(work, gradient + (3 * j + k) * W), load(work, gradient + (3 * k + j) * W)
                        change = shear * (one + other)
                        if j == k:
                            change += lame * dilation
                        place = VOIGT[j][k] * W
                        store(work, stress + place, load(work, trial + place) + change)
                xx, yy, zz = load(work, stress), load(work, stress + W), load(work, stress + 2 * W)
                yz, xz, xy = load(work, stress + 3 * W), load(work, stress + 4 * W), load(work, stress + 5 * W)
                row = load_row(work, strength, length)
                rxx, ryy, rzz, ryz, rxz, rxy = law.return_lanes(xx, yy, zz, yz, xz, xy, lame, shear, row)
                store(work, stress, xx - rxx)
                store(work, stress + W, yy - ryy)
                store(work, stress + 2 * W, zz - rzz)
                store(work, stress + 3 * W, yz - ryz)
                store(work, stress + 4 * W, xz - rxz)
                store(work, stress + 5 * W, xy - rxy)
                for k in range(6):
                    before = load(work, trial + k * W) - load(work, held + k * W)
                    fallen = load(work, stress + k * W) - before
                    store(work, stress + k * W, fallen * load(work, constant + 3 * W))

                for mode in range(corners):
                    for j in range(dimension):
                        total = fill(work, 0.0)
                        for k in range(dimension):
                            derivative = load(work, shape + (dimension * mode + k) * W)
                            total += derivative * load(work, stress + VOIGT[j][k] * W)
                        store(work, (dimension * mode + j) * W, total)
                sum_corners(work, dimension)
                for lane in range(min(W, end - start)):
                    for corner in range(corners):
                        place = corner_rows[start + lane, corner] * width
                        for j in range(dimension):
                            forces[place + j] += work[(dimension * corner + j) * W + lane]

    return add_flow_forces


@functools.cache
def make_measure_tangents(law, dimension):
    """The kernel for a law and d = dimension."""
    length = law.ROW_LENGTH
    width, corners = POINT_WIDTH[dimension], 1 << dimension

    @njit(parallel=True, error_model="numpy", cache=True)
    def measure_tangents(
        particles,
        corner_rows,
        slope,
        table_row,
        slopes,
        values,
        volume,
        material,
        elastic_constants,
        residual_rows,
        trial_stress,
        matrices,
        yields,
    ):
        """Matrices (k, 36) of failed particles at the displacement `values`, written; yields (k,) bool: not all zero.

        Other arguments: see add_flow_forces. Copies in `values` are filled in.
        """
        for entry in prange(len(particles)):
            particle = particles[entry]
            rock = material[particle]
            lame, shear = elastic_constants[rock, 0], elastic_constants[rock, 1]
            gradient = np.zeros((3, 3))
            for corner in range(corners):
                place = corner_rows[entry, corner] * width
                for k in range(dimension):
                    derivative = 0.0  # of the corner's shape function, in modal sums
                    for mode in range(1, corners):
                        negative = False  # where the corner lies on the low side of an odd number of its axes
                        for axis in range(dimension):
                            negative ^= bool((mode >> axis) & 1) and not (corner >> axis) & 1
                        value = slopes[table_row[entry], mode, k]
                        derivative += -value if negative else value
                    for j in range(dimension):
                        gradient[j, k] += slope[entry] * derivative * values[place + j]
            dilation = lame * (gradient[0, 0] + gradient[1, 1] + gradient[2, 2])
            matrix = np.zeros((6, 6))
            yields[entry] = law.stiffness_reduction(
                trial_stress[entry, 0] + dilation + 2.0 * shear * gradient[0, 0],
                trial_stress[entry, 1] + dilation + 2.0 * shear * gradient[1, 1],
                trial_stress[entry, 2] + dilation + 2.0 * shear * gradient[2, 2],
                trial_stress[entry, 3] + shear * (gradient[1, 2] + gradient[2, 1]),
                trial_stress[entry, 4] + shear * (gradient[0, 2] + gradient[2, 0]),
                trial_stress[entry, 5] + shear * (gradient[0, 1] + gradient[1, 0]),
                lame,
                shear,
                strength_of(residual_rows, rock, length),
                matrix,
            )
            scale = volume[particle] * slope[entry] ** 2
            for a in range(6):
                for b in range(6):
                    matrices[entry, 6 * a + b] = scale * matrix[a, b]

    return measure_tangents


@njit(inline="always", error_model="numpy")
def gather_corners(work, values, places, start, dimension):
    """Rows corner * d + component of `work` from a nodal array."""
    for corner in range(1 << dimension):
        row = dimension * corner * W
        if dimension == 3:
            x, y, z = gather_points_3(values, places, start + corner * W)
            store(work, row + 2 * W, z)
        else:
            x, y = gather_points_2(values, places, start + corner * W)
        store(work, row, x)
        store(work, row + W, y)


@njit(inline="always", error_model="numpy")
def scatter_corners(work, forces, places, start, dimension):
    """Add rows corner * d + component of `work` to a nodal array."""
    for corner in range(1 << dimension):
        row, place = dimension * corner * W, start + corner * W
        if dimension == 3:
            add_to_points_3(forces, places, place, load(work, row), load(work, row + W), load(work, row + 2 * W))
        else:
            add_to_points_2(forces, places, place, load(work, row), load(work, row + W))


def make_subtract_tangents(dimension):
    """The kernel for d = dimension."""
    corners = 1 << dimension
    gradient = corners * dimension * W
    strain = gradient + 9 * W
    stress = strain + 6 * W
    size = stress + 6 * W

    @njit(parallel=True, error_model="numpy", cache=True)
    def subtract_tangents(batch_start, places, slopes, matrices, values, forces):
        """forces -= B^T D B values of all entries, eight at a time: flat nodal arrays, copies filled in.

        batch_start (block + 1,): first batch of each block; places (batch * 2^d * LANES,) rows of the corners; slopes
        (batch * 2^d * d * LANES,) of the modes at the entry's place; matrices (batch * 36 * LANES,). One
        precision throughout.
        """
        for block in prange(len(batch_start) - 1):
            work = np.zeros(size, values.dtype)
            for batch in range(batch_start[block], batch_start[block + 1]):
                start = batch * corners * W
                gather_corners(work, values, places, start, dimension)
                sum_modes(work, dimension)
                for j in range(dimension):
                    for k in range(dimension):
                        total = fill(work, 0.0)
                        for mode in range(1, corners):
                            derivative = load(slopes, dimension * start + (dimension * mode + k) * W)
                            total += load(work, (dimension * mode + j) * W) * derivative
                        store(work, gradient + (3 * j + k) * W, total)
                for j in range(3):
                    one, other = (j + 1) % 3, (j + 2) % 3
                    turn, back = gradient + (3 * one + other) * W, gradient + (3 * other + one) * W
                    store(work, strain + j * W, load(work, gradient + 4 * j * W))
                    store(work, strain + (3 + j) * W, load(work, turn) + load(work, back))
                for a in range(6):
                    total = fill(work, 0.0)
                    for b in range(6):
                        total -= load(matrices, (36 * batch + 6 * a + b) * W) * load(work, strain + b * W)
                    store(work, stress + a * W, total)
                for mode in range(corners):
                    for j in range(dimension):
                        total = fill(work, 0.0)
                        for k in range(dimension):
                            derivative = load(slopes, dimension * start + (dimension * mode + k) * W)
                            total += derivative * load(work, stress + VOIGT[j][k] * W)
                        store(work, (dimension * mode + j) * W, total)
                sum_corners(work, dimension)
                scatter_corners(work, forces, places, start, dimension)

    return subtract_tangents


SUBTRACT_TANGENTS = {2: make_subtract_tangents(2), 3: make_subtract_tangents(3)}
"""by dimension"""
