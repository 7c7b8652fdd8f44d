"""Stress update and internal force of particles that stay in their cells (paper, Eqs 2 and 6).

A field on a cell is handled by its modes: the 2^d products of local coordinates xi_k (Walsh-Hadamard transform of the
corner values). Mode m is the product of those xi_k whose bit k is set in m; its derivative along xi_k is mode m without
bit k. One particle at the centre sees the linear modes only; the others are the hourglass modes, held by a stiffness of
their own (Flanagan and Belytschko 1981), with which a cell bends as a plate does (model.particles.bending_stiffness).

"Stress" here is what enters the force: the change since virgin for rock, the full stress for fill.
"""

import functools

import numpy as np
from numba import njit, prange

from mpm_core.constitutive.elastic import ELASTIC, contraction, strain_from_stress, stress_increment
from mpm_core.constitutive.general import strength_of
from mpm_core.kernels.modes import hourglass_share


@njit(error_model="numpy", inline="always")
def flow_at_residual(return_to_surface, particle, lame_lambda, shear_modulus, row, insitu, stress, later_strain):
    """Return a failed particle's stress to its residual surface; the elastic strain it gives up is plastic, aseismic.

    return_to_surface: of its law; row: its residual strength row; insitu, stress, later_strain (particle, 6). Returns
    what the flow dissipates, J/m3, at the stress it ends at: see
    equilibrium.energy_balance.
    """
    xx = stress[particle, 0] + insitu[particle, 0]
    yy = stress[particle, 1] + insitu[particle, 1]
    zz = stress[particle, 2] + insitu[particle, 2]
    yz = stress[particle, 3] + insitu[particle, 3]
    xz = stress[particle, 4] + insitu[particle, 4]
    xy = stress[particle, 5] + insitu[particle, 5]
    rxx, ryy, rzz, ryz, rxz, rxy, region = return_to_surface(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row)
    if region == ELASTIC:
        return 0.0
    dxx, dyy, dzz, dyz, dxz, dxy = xx - rxx, yy - ryy, zz - rzz, yz - ryz, xz - rxz, xy - rxy
    exx, eyy, ezz, eyz, exz, exy = strain_from_stress(lame_lambda, shear_modulus, dxx, dyy, dzz, dyz, dxz, dxy)
    stress[particle, 0] -= dxx
    stress[particle, 1] -= dyy
    stress[particle, 2] -= dzz
    stress[particle, 3] -= dyz
    stress[particle, 4] -= dxz
    stress[particle, 5] -= dxy
    later_strain[particle, 0] += exx
    later_strain[particle, 1] += eyy
    later_strain[particle, 2] += ezz
    later_strain[particle, 3] += eyz
    later_strain[particle, 4] += exz
    later_strain[particle, 5] += exy
    return contraction(rxx, ryy, rzz, ryz, rxz, rxy, exx, eyy, ezz, eyz, exz, exy)


@functools.cache
def make_update(law, dimension: int):
    """The kernel for a law and 2 (plane strain) or 3 dimensions; its arguments are described in it."""
    length = law.ROW_LENGTH
    modes = 1 << dimension

    @njit(parallel=True, error_model="numpy", cache=True)
    def update(
        blocks,
        block_start,
        slot_start,
        cell_nodes,
        cell_slots,
        cell_size,
        cell_groups_start,
        cell_groups,
        group_start,
        group_table,
        slopes,
        time_step,
        velocity,
        volume,
        material,
        elastic_constants,
        residual_rows,
        failed,
        insitu,
        hourglass_stiffness,
        pattern_row,
        patterns,
        stress,
        later_strain,
        hourglass_force,
        slot_force,
    ):
        """Advance stress by `time_step` of nodal velocity and write the forces -B^T sigma V to the blocks' slots.

        blocks (k,): which are updated; block_start, slot_start, cell_slots: see block_scatter.Scatter; cell_nodes,
        cell_slots (cell, 2^d) in bit order (bit k of the corner: side along axis k); cell_size (cell,) m;
        cell_groups_start, cell_groups, group_start, group_table: see particles.Particles; slopes (point row, 2^d, d);
        velocity (node, d) m/s; volume, material (particle,); elastic_constants (material, 2) lambda and mu, Pa;
        residual_rows (material, column); failed (particle,) bool; insitu (particle, 6) Pa; hourglass_stiffness (cell,)
        N/m; pattern_row (cell,): of patterns (row, 2^d - 1 - d, 2^d) in a distorted cell, -1 in a cube. In place:
        stress, later_strain (particle, 6), hourglass_force (cell, 2^d - 1 - d, d) N, slot_force (slot, d) N.
        """
        for which in prange(len(blocks)):
            block = blocks[which]
            amplitude = np.empty((modes, dimension))
            force = np.empty((modes, dimension))
            gradient = np.empty((dimension, dimension))
            for slot in range(slot_start[block], slot_start[block + 1]):
                for j in range(dimension):
                    slot_force[slot, j] = 0.0

            for cell in range(block_start[block], block_start[block + 1]):
                for corner in range(modes):
                    node = cell_nodes[cell, corner]
                    for j in range(dimension):
                        amplitude[corner, j] = velocity[node, j]
                        force[corner, j] = 0.0
                for k in range(dimension):
                    for corner in range(modes):
                        if not (corner >> k) & 1:
                            for j in range(dimension):
                                low = amplitude[corner, j]
                                high = amplitude[corner | (1 << k), j]
                                amplitude[corner, j] = low + high
                                amplitude[corner | (1 << k), j] = high - low
                slope = 2.0 / cell_size[cell] / modes  # from modal sums to a gradient, and from stress to modal forces
                step = slope * time_step

                for g in range(cell_groups_start[cell], cell_groups_start[cell + 1]):
                    group = cell_groups[g]
                    first = group_start[group]
                    points = group_start[group + 1] - first
                    for point in range(points):
                        particle = first + point
                        if volume[particle] == 0.0:
                            continue
                        row = group_table[group] + point
                        for j in range(dimension):
                            for k in range(dimension):
                                gradient[j, k] = 0.0
                        if points == 1 and row == 0:
                            for k in range(dimension):
                                for j in range(dimension):
                                    gradient[j, k] = amplitude[1 << k, j]
                        else:
                            for k in range(dimension):
                                for m in range(1, modes):
                                    if slopes[row, m, k] != 0.0:
                                        for j in range(dimension):
                                            gradient[j, k] += amplitude[m, j] * slopes[row, m, k]
                        lame = elastic_constants[material[particle], 0]
                        shear = elastic_constants[material[particle], 1]
                        double = 2.0 * shear * step
                        if dimension == 3:
                            volumetric = lame * step * (gradient[0, 0] + gradient[1, 1] + gradient[2, 2])
                            stress[particle, 0] += volumetric + double * gradient[0, 0]
                            stress[particle, 1] += volumetric + double * gradient[1, 1]
                            stress[particle, 2] += volumetric + double * gradient[2, 2]
                            stress[particle, 3] += 0.5 * double * (gradient[1, 2] + gradient[2, 1])
                            stress[particle, 4] += 0.5 * double * (gradient[0, 2] + gradient[2, 0])
                            stress[particle, 5] += 0.5 * double * (gradient[0, 1] + gradient[1, 0])
                        else:
                            volumetric = lame * step * (gradient[0, 0] + gradient[1, 1])
                            stress[particle, 0] += volumetric + double * gradient[0, 0]
                            stress[particle, 1] += volumetric + double * gradient[1, 1]
                            stress[particle, 2] += volumetric
                            stress[particle, 5] += 0.5 * double * (gradient[0, 1] + gradient[1, 0])
                        if failed[particle]:
                            flow_at_residual(
                                law.return_to_surface,
                                particle,
                                lame,
                                shear,
                                strength_of(residual_rows, material[particle], length),
                                insitu,
                                stress,
                                later_strain,
                            )

                        weight = volume[particle] * slope
                        s0 = stress[particle, 0] * weight
                        s1 = stress[particle, 1] * weight
                        s2 = stress[particle, 2] * weight
                        s3 = stress[particle, 3] * weight
                        s4 = stress[particle, 4] * weight
                        s5 = stress[particle, 5] * weight
                        for m in range(1, modes):
                            if points == 1 and row == 0 and (m & (m - 1)) != 0:
                                continue  # at the centre only the linear modes have a gradient
                            for k in range(dimension):
                                share = slopes[row, m, k]
                                if share != 0.0:
                                    if dimension == 2:
                                        if k == 0:
                                            force[m, 0] += share * s0
                                            force[m, 1] += share * s5
                                        else:
                                            force[m, 0] += share * s5
                                            force[m, 1] += share * s1
                                    elif k == 0:
                                        force[m, 0] += share * s0
                                        force[m, 1] += share * s5
                                        force[m, 2] += share * s4
                                    elif k == 1:
                                        force[m, 0] += share * s5
                                        force[m, 1] += share * s1
                                        force[m, 2] += share * s3
                                    else:
                                        force[m, 0] += share * s4
                                        force[m, 1] += share * s3
                                        force[m, 2] += share * s2

                if hourglass_stiffness[cell] > 0.0 and pattern_row[cell] >= 0:
                    gain = hourglass_stiffness[cell] * time_step / modes
                    mode = 0
                    for higher in range(1, modes):
                        if (higher & (higher - 1)) != 0:
                            for j in range(dimension):
                                total = 0.0
                                for m in range(modes):
                                    total += patterns[pattern_row[cell], mode, m] * amplitude[m, j]
                                share = hourglass_share(higher, j)
                                held = hourglass_force[cell, mode, j] + gain * share * total
                                hourglass_force[cell, mode, j] = held
                                for m in range(modes):
                                    force[m, j] += patterns[pattern_row[cell], mode, m] * held / modes
                            mode += 1
                elif hourglass_stiffness[cell] > 0.0:
                    gain = hourglass_stiffness[cell] * time_step / modes
                    mode = 0
                    for m in range(1, modes):
                        if (m & (m - 1)) != 0:
                            for j in range(dimension):
                                share = hourglass_share(m, j)
                                held = hourglass_force[cell, mode, j] + gain * share * amplitude[m, j]
                                hourglass_force[cell, mode, j] = held
                                force[m, j] += held / modes
                            mode += 1

                for k in range(dimension):
                    for corner in range(modes):
                        if not (corner >> k) & 1:
                            for j in range(dimension):
                                even = force[corner, j]
                                odd = force[corner | (1 << k), j]
                                force[corner, j] = even - odd
                                force[corner | (1 << k), j] = even + odd
                for corner in range(modes):
                    slot = cell_slots[cell, corner]
                    for j in range(dimension):
                        slot_force[slot, j] -= force[corner, j]

    return update


@njit(parallel=True, error_model="numpy", cache=True)
def record_flow_start(particles, stress, later_strain, stress_before, flow):
    """Copy what flow counts from, of particles (k,): stress_before, flow (k, 6), written."""
    for i in prange(len(particles)):
        p = particles[i]
        for k in range(6):
            stress_before[i, k] = stress[p, k]
            flow[i, k] = later_strain[p, k]


@njit(parallel=True, error_model="numpy", cache=True)
def undo_flow(particles, flow, material, elastic_constants, stress, later_strain):
    """Undo what has flowed since the start: stress becomes the elastic trial stress of all strain since then.

    particles (k,) indices; flow (k, 6) later_strain at the start; material (particle,); elastic_constants (material, 2)
    Pa. In place: stress, later_strain (particle, 6).
    """
    for i in prange(len(particles)):
        p = particles[i]
        xx, yy, zz, yz, xz, xy = stress_increment(
            elastic_constants[material[p], 0],
            elastic_constants[material[p], 1],
            later_strain[p, 0] - flow[i, 0],
            later_strain[p, 1] - flow[i, 1],
            later_strain[p, 2] - flow[i, 2],
            later_strain[p, 3] - flow[i, 3],
            later_strain[p, 4] - flow[i, 4],
            later_strain[p, 5] - flow[i, 5],
        )
        stress[p, 0] += xx
        stress[p, 1] += yy
        stress[p, 2] += zz
        stress[p, 3] += yz
        stress[p, 4] += xz
        stress[p, 5] += xy
        for k in range(6):
            later_strain[p, k] = flow[i, k]
