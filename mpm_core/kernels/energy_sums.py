"""Sums of energy over particles and nodes, in one fixed order: the same bits with any number of threads."""

import functools

import numpy as np
from numba import njit, prange

from mpm_core.constitutive.elastic import ELASTIC, contraction, energy_density, strain_from_stress, stress_increment
from mpm_core.constitutive.general import strength_of
from mpm_core.kernels.modes import hourglass_share, to_modes

ENTRIES_PER_CHUNK = 8192  # Entries are summed one after the other within chunks, whose sums are then added in order.
FLOW_PATH_PARTS = 8  # The strain of a path with flow is applied in this many parts.


@njit(inline="always")
def total_stress(stress, insitu, entry, particle):
    """Six components, Pa: change since virgin (entry, 6) and the virgin stress (particle, 6)."""
    return (
        stress[entry, 0] + insitu[particle, 0],
        stress[entry, 1] + insitu[particle, 1],
        stress[entry, 2] + insitu[particle, 2],
        stress[entry, 3] + insitu[particle, 3],
        stress[entry, 4] + insitu[particle, 4],
        stress[entry, 5] + insitu[particle, 5],
    )


@njit(parallel=True, error_model="numpy", cache=True)
def _stored(stress, insitu, volume, material, elastic_constants, sums):
    for chunk in prange(len(sums)):
        total = 0.0
        for p in range(chunk * ENTRIES_PER_CHUNK, min((chunk + 1) * ENTRIES_PER_CHUNK, len(volume))):
            if volume[p] != 0.0:
                total += volume[p] * energy_density(
                    elastic_constants[material[p], 0],
                    elastic_constants[material[p], 1],
                    stress[p, 0] + insitu[p, 0],
                    stress[p, 1] + insitu[p, 1],
                    stress[p, 2] + insitu[p, 2],
                    stress[p, 3] + insitu[p, 3],
                    stress[p, 4] + insitu[p, 4],
                    stress[p, 5] + insitu[p, 5],
                )
        sums[chunk] = total


def stored_energy(stress, insitu, volume, material, elastic_constants) -> float:
    """Elastic energy of the full stress, J: stress (change) and insitu (particle, 6) Pa, volume (particle,) m3."""
    sums = np.empty(_chunks(volume))
    _stored(stress, insitu, volume, material, elastic_constants, sums)
    return float(sums.sum())


@njit(parallel=True, error_model="numpy", cache=True)
def _work_of_stress(cell_nodes, cell_size, cell, row, slopes, volume, stress, motion, sums):
    corners, dimension = cell_nodes.shape[1], motion.shape[1]
    component = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
    for chunk in prange(len(sums)):
        total = 0.0
        moved = np.empty((dimension, corners))
        for p in range(chunk * ENTRIES_PER_CHUNK, min((chunk + 1) * ENTRIES_PER_CHUNK, len(volume))):
            if volume[p] == 0.0:
                continue
            c = cell[p]
            work = 0.0
            for j in range(dimension):
                for corner in range(corners):
                    moved[j, corner] = motion[cell_nodes[c, corner], j]
                to_modes(moved, j, dimension)
                for k in range(dimension):
                    slope = 0.0
                    for mode in range(1, corners):
                        slope += moved[j, mode] * slopes[row[p], mode, k]
                    work += stress[p, component[j, k]] * slope
            total += work * volume[p] * 2.0 / corners / cell_size[c]
        sums[chunk] = total


def work_of_stress(cell_nodes, cell_size, cell, row, slopes, volume, stress, motion) -> float:
    """Work of stresses (particle, 6) Pa on the strain of a nodal motion (node, d) m, J: the sum of V stress : B motion.

    cell_nodes (cell, 2^d) in bit order; cell, volume (particle,); row (particle,): of slopes (row, 2^d, d). Hanging
    nodes have their motion.
    """
    sums = np.empty(_chunks(volume))
    _work_of_stress(cell_nodes, cell_size, cell, row, slopes, volume, stress, motion, sums)
    return float(sums.sum())


@njit(parallel=True, error_model="numpy", cache=True)
def _work_of_forces(force, motion, sums):
    for chunk in prange(len(sums)):
        total = 0.0
        for node in range(chunk * ENTRIES_PER_CHUNK, min((chunk + 1) * ENTRIES_PER_CHUNK, len(force))):
            for j in range(force.shape[1]):
                total += force[node, j] * motion[node, j]
        sums[chunk] = total


def work_of_forces(force: np.ndarray, motion: np.ndarray) -> float:
    """Work of nodal forces (node, d) N on a motion (node, d) m, J."""
    sums = np.empty(_chunks(force))
    _work_of_forces(force, motion, sums)
    return float(sums.sum())


def _chunks(values: np.ndarray) -> int:
    return -(-len(values) // ENTRIES_PER_CHUNK)


@functools.cache
def make_flow_energy(law):
    """The kernel for a law."""
    length = law.ROW_LENGTH

    @njit(parallel=True, error_model="numpy", cache=True)
    def flow_energy(
        particles, stress_before, flow, insitu, stress, later_strain, material, elastic_constants, residual_rows, energy
    ):
        """Energy of the flow since the start: energy (k, 2) J/m3, written: dissipated, and how much more than mean
        stress.

        The strain since then is taken in FLOW_PATH_PARTS, each returned to the surface. A part dissipates the mean
        stress of its ends times its flow; that of its end where that of its start is negative: rock that unloads and
        opens does so at its end, and not at half the pressure before it. Only rock whose law says so (Coulomb: that
        dilates above its friction) gains energy. Mean stress: that of start and end of the whole, times its flow.
        particles (k,) indices; stress_before, flow (k, 6): stress (change since virgin, Pa) and later_strain at the
        start; insitu, stress, later_strain (particle, 6); material (particle,); elastic_constants (material, 2) Pa;
        residual_rows (material, column).
        """
        for i in prange(len(particles)):
            p = particles[i]
            m = material[p]
            lame, shear = elastic_constants[m, 0], elastic_constants[m, 1]
            exx, eyy, ezz = (
                later_strain[p, 0] - flow[i, 0],
                later_strain[p, 1] - flow[i, 1],
                later_strain[p, 2] - flow[i, 2],
            )
            eyz, exz, exy = (
                later_strain[p, 3] - flow[i, 3],
                later_strain[p, 4] - flow[i, 4],
                later_strain[p, 5] - flow[i, 5],
            )
            energy[i] = 0.0
            if max(abs(exx), abs(eyy), abs(ezz), abs(eyz), abs(exz), abs(exy)) == 0.0:
                continue
            xx, yy, zz, yz, xz, xy = total_stress(stress_before, insitu, i, p)
            dxx, dyy, dzz, dyz, dxz, dxy = total_stress(stress, insitu, p, p)
            mean = 0.5 * contraction(
                xx + dxx, yy + dyy, zz + dzz, yz + dyz, xz + dxz, xy + dxy, exx, eyy, ezz, eyz, exz, exy
            )
            fxx, fyy, fzz, fyz, fxz, fxy = stress_increment(lame, shear, exx, eyy, ezz, eyz, exz, exy)
            dxx, dyy, dzz = (
                (dxx - xx + fxx) / FLOW_PATH_PARTS,
                (dyy - yy + fyy) / FLOW_PATH_PARTS,
                (dzz - zz + fzz) / FLOW_PATH_PARTS,
            )
            dyz, dxz, dxy = (
                (dyz - yz + fyz) / FLOW_PATH_PARTS,
                (dxz - xz + fxz) / FLOW_PATH_PARTS,
                (dxy - xy + fxy) / FLOW_PATH_PARTS,
            )
            row = strength_of(residual_rows, m, length)
            gains = law.gains_energy(row)
            dissipated = 0.0
            for _ in range(FLOW_PATH_PARTS):
                bxx, byy, bzz, byz, bxz, bxy = xx, yy, zz, yz, xz, xy
                txx, tyy, tzz, tyz, txz, txy = xx + dxx, yy + dyy, zz + dzz, yz + dyz, xz + dxz, xy + dxy
                xx, yy, zz, yz, xz, xy, region = law.return_to_surface(txx, tyy, tzz, tyz, txz, txy, lame, shear, row)
                if region == ELASTIC:
                    continue
                exx, eyy, ezz, eyz, exz, exy = strain_from_stress(
                    lame, shear, txx - xx, tyy - yy, tzz - zz, tyz - yz, txz - xz, txy - xy
                )
                at_end = contraction(xx, yy, zz, yz, xz, xy, exx, eyy, ezz, eyz, exz, exy)
                at_start = contraction(bxx, byy, bzz, byz, bxz, bxy, exx, eyy, ezz, eyz, exz, exy)
                dissipated += 0.5 * (at_end + (at_start if at_start > 0.0 or gains else at_end))
            energy[i, 0] = dissipated
            energy[i, 1] = dissipated - mean

    return flow_energy


@njit(parallel=True, error_model="numpy", cache=True)
def energy_of_hourglass(force, stiffness, energy):
    """Energy (cell,) J of hourglass forces (cell, mode, d) N, written; none without stiffness (cell,) N/m."""
    dimension = force.shape[2]
    for cell in prange(len(force)):
        squares = 0.0
        mode = 0
        for m in range(1 << dimension):
            if (m & (m - 1)) != 0:
                for j in range(dimension):
                    squares += force[cell, mode, j] ** 2 / hourglass_share(m, j)
                mode += 1
        energy[cell] = 0.5 * squares / stiffness[cell] if stiffness[cell] > 0.0 else 0.0
