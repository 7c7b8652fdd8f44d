"""Plastic flow between two states near equilibrium, whatever the way from the one to the other."""

from numba import njit, prange

from mpm_core.constitutive.elastic import stress_increment


@njit(parallel=True, error_model="numpy", cache=True)
def note_flow_start(particles, stress, later_strain, stress_before, flow):
    """Copy what flow counts from, of particles (k,): stress_before, flow (k, 6), written."""
    for i in prange(len(particles)):
        p = particles[i]
        for k in range(6):
            stress_before[i, k] = stress[p, k]
            flow[i, k] = later_strain[p, k]


@njit(parallel=True, error_model="numpy", cache=True)
def take_back_flow(particles, flow, material, elastic_constants, stress, later_strain):
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
