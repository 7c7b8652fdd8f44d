"""Plastic flow between two states near rest, whatever the way from the one to the other."""

from numba import njit, prange

from mpm_core.constitutive.elastic import contraction, stress_increment


@njit(parallel=True, error_model="numpy", cache=True)
def note_flow_start(particles, stress, later_strain, dissipated, stress_before, flow, dissipated_before):
    """Copy what flow counts from, of particles (k,): stress_before, flow (k, 6), dissipated_before (k,), written."""
    for i in prange(len(particles)):
        p = particles[i]
        for k in range(6):
            stress_before[i, k] = stress[p, k]
            flow[i, k] = later_strain[p, k]
        dissipated_before[i] = dissipated[p]


@njit(parallel=True, error_model="numpy", cache=True)
def take_back_flow(particles, flow, dissipated_before, material, elastic_constants, stress, later_strain, dissipated):
    """Undo what has flowed since the start: stress becomes the elastic trial stress of all strain since then.

    particles (k,) indices; flow (k, 6) later_strain and dissipated_before (k,) J/m3 at the start; material (particle,);
    elastic_constants (material, 2) Pa. In place: stress, later_strain (particle, 6), dissipated (particle,).
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
        dissipated[p] = dissipated_before[i]


@njit(parallel=True, error_model="numpy", cache=True)
def dissipate(particles, stress_before, flow, dissipated_before, insitu, stress, later_strain, dissipated):
    """Energy of the flow since the start: the mean of the stresses at both ends times its strain.

    stress_before (k, 6) Pa: change since virgin at the start; insitu, stress, later_strain (particle, 6); other
    arguments as above; dissipated (particle,) J/m3, in place.
    """
    for i in prange(len(particles)):
        p = particles[i]
        dissipated[p] = dissipated_before[i] + contraction(
            insitu[p, 0] + 0.5 * (stress_before[i, 0] + stress[p, 0]),
            insitu[p, 1] + 0.5 * (stress_before[i, 1] + stress[p, 1]),
            insitu[p, 2] + 0.5 * (stress_before[i, 2] + stress[p, 2]),
            insitu[p, 3] + 0.5 * (stress_before[i, 3] + stress[p, 3]),
            insitu[p, 4] + 0.5 * (stress_before[i, 4] + stress[p, 4]),
            insitu[p, 5] + 0.5 * (stress_before[i, 5] + stress[p, 5]),
            later_strain[p, 0] - flow[i, 0],
            later_strain[p, 1] - flow[i, 1],
            later_strain[p, 2] - flow[i, 2],
            later_strain[p, 3] - flow[i, 3],
            later_strain[p, 4] - flow[i, 4],
            later_strain[p, 5] - flow[i, 5],
        )
