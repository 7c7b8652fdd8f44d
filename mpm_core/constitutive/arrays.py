"""The return to the strength surface over arrays of particles: for studies, benchmarks and tests."""

import functools

from numba import njit, prange

from mpm_core.constitutive.elastic import strain_from_stress
from mpm_core.constitutive.general import strength_of
from mpm_core.constitutive.return_regions import ELASTIC


@functools.cache
def make_return_particles(law):
    """The kernel for a law."""
    length = law.ROW_LENGTH

    @njit(cache=True, parallel=True, error_model="numpy")
    def return_particles(stress, lame_lambda, shear_modulus, rows, indices, plastic_strain, regions):
        """Return trial stresses to the surface, in place.

        stress (particle, 6) Pa, overwritten; lame_lambda, shear_modulus (particle,) Pa; rows (row, ROW_LENGTH) strength
        rows; indices (particle,) row of each particle; plastic_strain (particle, 6), increased by the compliance times
        the drop, tensor shear; regions (particle,) int8, overwritten (return_regions.py).
        Each particle is written by one thread: the result does not depend on the thread count.
        """
        for p in prange(stress.shape[0]):
            xx, yy, zz = stress[p, 0], stress[p, 1], stress[p, 2]
            yz, xz, xy = stress[p, 3], stress[p, 4], stress[p, 5]
            rxx, ryy, rzz, ryz, rxz, rxy, region = law.return_to_surface(
                xx, yy, zz, yz, xz, xy, lame_lambda[p], shear_modulus[p], strength_of(rows, indices[p], length)
            )
            regions[p] = region
            if region != ELASTIC:
                exx, eyy, ezz, eyz, exz, exy = strain_from_stress(
                    lame_lambda[p], shear_modulus[p], xx - rxx, yy - ryy, zz - rzz, yz - ryz, xz - rxz, xy - rxy
                )
                stress[p, 0], stress[p, 1], stress[p, 2] = rxx, ryy, rzz
                stress[p, 3], stress[p, 4], stress[p, 5] = ryz, rxz, rxy
                plastic_strain[p, 0] += exx
                plastic_strain[p, 1] += eyy
                plastic_strain[p, 2] += ezz
                plastic_strain[p, 3] += eyz
                plastic_strain[p, 4] += exz
                plastic_strain[p, 5] += exy

    return return_particles
