"""The tangent of rock that flows, on the rows of the elastic operator (multigrid.siblings): what it lacks in stiffness.

A particle's matrix (6, 6) takes engineering strain to the stress that flow takes off the elastic one, in units of the
operator: strain is that of modal sums (kernels.modes) without their factor, stress that of modal forces.
"""

import functools

import numpy as np
from numba import njit, prange

from mpm_core.constitutive.general import strength_of
from mpm_core.kernels.flow_rows import VOIGT, sum_corners, sum_modes
from mpm_core.simd.lanes import LANES as W
from mpm_core.simd.lanes import (
    POINT_WIDTH,
    add_to_points_2,
    add_to_points_3,
    fill,
    gather_points_2,
    gather_points_3,
    load,
    store,
)


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

        Other arguments: see flow_rows.add_flow_forces. Copies in `values` are filled in.
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
            yields[entry] = law.fallen_stiffness(
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
def take(work, values, places, start, dimension):
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
def give(work, forces, places, start, dimension):
    """Add rows corner * d + component of `work` to a nodal array."""
    for corner in range(1 << dimension):
        row, place = dimension * corner * W, start + corner * W
        if dimension == 3:
            add_to_points_3(forces, places, place, load(work, row), load(work, row + W), load(work, row + 2 * W))
        else:
            add_to_points_2(forces, places, place, load(work, row), load(work, row + W))


def make_take_tangents_off(dimension):
    """The kernel for d = dimension."""
    corners = 1 << dimension
    gradient = corners * dimension * W
    strain = gradient + 9 * W
    stress = strain + 6 * W
    size = stress + 6 * W

    @njit(parallel=True, error_model="numpy", cache=True)
    def take_tangents_off(batch_start, places, slopes, matrices, values, forces):
        """forces -= B^T D B values of all entries, eight at a time: flat nodal arrays, copies filled in.

        batch_start (block + 1,): first batch of each block; places (batch * 2^d * LANES,) rows of the corners; slopes
        (batch * 2^d * d * LANES,) of the modes at the entry's place; matrices (batch * 36 * LANES,). One
        precision throughout.
        """
        for block in prange(len(batch_start) - 1):
            work = np.zeros(size, values.dtype)
            for batch in range(batch_start[block], batch_start[block + 1]):
                start = batch * corners * W
                take(work, values, places, start, dimension)
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
                give(work, forces, places, start, dimension)

    return take_tangents_off


TAKE_TANGENTS_OFF = {2: make_take_tangents_off(2), 3: make_take_tangents_off(3)}
"""by dimension"""
