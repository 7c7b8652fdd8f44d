"""What failed rock no longer carries, on the rows of the elastic operator (multigrid.families).

While equilibrium is sought, stress is thought to change elastically everywhere, as the operator has it. Failed rock
returns to its residual surface: what its stress changes less is a force that elastic rock would have had.
"""

import numpy as np
from numba import njit, prange

from mpm_core.constitutive.coulomb import return_to_surface
from mpm_core.constitutive.strength import strength_of
from mpm_core.kernels.modes import to_corners, to_modes


@njit(parallel=True, error_model="numpy", cache=True)
def total_stresses(particles, stress, insitu, total):
    """Total stress of some particles (k,), Pa: total (k, 6), written; stress, insitu (particle, 6)."""
    for i in prange(len(particles)):
        for k in range(6):
            total[i, k] = stress[particles[i], k] + insitu[particles[i], k]


@njit(parallel=True, error_model="numpy", cache=True)
def add_flow_forces(
    block_start,
    particles,
    corner_rows,
    slope,
    table_row,
    mode_values,
    width,
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

    block_start (block + 1,): first entry of each block; by entry (k,): particles, indices; corner_rows (k, 2^d); slope
    1/m: 2 / 2^d over the cell's edge; table_row: of mode_values (point row, 2^d); carried (k, 6) Pa: total stress at
    values 0; trial_stress (k, 6) Pa: the same had nothing flowed since it last counts. values (row * width,) m:
    displacement, copies filled in. volume, material (particle,); elastic_constants (material, 2) Pa; residual_rows
    (material, column).
    """
    corners = corner_rows.shape[1]
    dimension = 2 if corners == 4 else 3
    for block in prange(len(block_start) - 1):
        amplitude = np.empty((3, corners))
        force = np.empty((3, corners))
        gradient = np.zeros((3, 3))
        for entry in range(block_start[block], block_start[block + 1]):
            particle = particles[entry]
            for j in range(dimension):
                for corner in range(corners):
                    amplitude[j, corner] = values[corner_rows[entry, corner] * width + j]
                    force[j, corner] = 0.0
                to_modes(amplitude, j, dimension)
                for k in range(dimension):
                    total = 0.0
                    for mode in range(corners):
                        if (mode >> k) & 1:
                            total += amplitude[j, mode] * mode_values[table_row[entry], mode ^ (1 << k)]
                    gradient[j, k] = total * slope[entry]
            lame = elastic_constants[material[particle], 0]
            twice = 2.0 * elastic_constants[material[particle], 1]
            volumetric = lame * (gradient[0, 0] + gradient[1, 1] + gradient[2, 2])
            xx = trial_stress[entry, 0] + volumetric + twice * gradient[0, 0]
            yy = trial_stress[entry, 1] + volumetric + twice * gradient[1, 1]
            zz = trial_stress[entry, 2] + volumetric + twice * gradient[2, 2]
            yz = trial_stress[entry, 3] + 0.5 * twice * (gradient[1, 2] + gradient[2, 1])
            xz = trial_stress[entry, 4] + 0.5 * twice * (gradient[0, 2] + gradient[2, 0])
            xy = trial_stress[entry, 5] + 0.5 * twice * (gradient[0, 1] + gradient[1, 0])
            row = strength_of(residual_rows, material[particle])
            rxx, ryy, rzz, ryz, rxz, rxy, _ = return_to_surface(xx, yy, zz, yz, xz, xy, lame, 0.5 * twice, row)
            weight = volume[particle] * slope[entry]
            sx = (xx - rxx - (trial_stress[entry, 0] - carried[entry, 0])) * weight
            sy = (yy - ryy - (trial_stress[entry, 1] - carried[entry, 1])) * weight
            sz = (zz - rzz - (trial_stress[entry, 2] - carried[entry, 2])) * weight
            syz = (yz - ryz - (trial_stress[entry, 3] - carried[entry, 3])) * weight
            sxz = (xz - rxz - (trial_stress[entry, 4] - carried[entry, 4])) * weight
            sxy = (xy - rxy - (trial_stress[entry, 5] - carried[entry, 5])) * weight
            if sx == 0.0 and sy == 0.0 and sz == 0.0 and syz == 0.0 and sxz == 0.0 and sxy == 0.0:
                continue  # elastic then as now
            for mode in range(1, corners):
                for k in range(dimension):
                    if (mode >> k) & 1:
                        share = mode_values[table_row[entry], mode ^ (1 << k)]
                        if k == 0:
                            force[0, mode] += share * sx
                            force[1, mode] += share * sxy
                            if dimension == 3:
                                force[2, mode] += share * sxz
                        elif k == 1:
                            force[0, mode] += share * sxy
                            force[1, mode] += share * sy
                            if dimension == 3:
                                force[2, mode] += share * syz
                        else:
                            force[0, mode] += share * sxz
                            force[1, mode] += share * syz
                            force[2, mode] += share * sz
            for j in range(dimension):
                to_corners(force, j, dimension)
                for corner in range(corners):
                    forces[corner_rows[entry, corner] * width + j] += force[j, corner]
