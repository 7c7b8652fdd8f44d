"""Functions for any law that need its return to the surface alone.

These are the brittle drop, rows as tuples, lanes, a tangent, and the return of arrays of particles (for studies,
benchmarks and tests).
"""

import functools

from numba import njit, prange, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import load_item, make_array

from mpm_core.constitutive.elastic import ELASTIC, strain_from_stress, stress_increment
from mpm_core.simd.lanes import LANES

TANGENT_DIFFERENCE_STEP = 1e-6  # Difference of stress between two returns for the tangent, as a share of the stress.


@intrinsic(prefer_literal=True)
def strength_of(typing, rows, index, length):
    """The first `length` (a constant) numbers of row `index` of rows (row, column), as a tuple.

    A slice rows[index] would count references to the array: an atomic operation per particle on a line of memory that
    all threads share.
    """
    kind = types.UniTuple(rows.dtype, length.literal_value)

    def generate(context, builder, sig, args):
        array_type = sig.args[0]
        array = make_array(array_type)(context, builder, args[0])
        row = context.cast(builder, args[1], sig.args[1], types.intp)
        numbers = []
        for column in range(kind.count):
            place = [row, context.get_constant(types.intp, column)]
            pointer = cgutils.get_item_pointer(context, builder, array_type, array, place, wraparound=False)
            numbers.append(load_item(context, builder, array_type, pointer))
        return context.make_tuple(builder, kind, numbers)

    return kind(rows, index, length), generate


@njit(error_model="numpy")
def brittle_drop(
    return_to_surface, xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, intact_row, residual_row, scale
):
    """First yield: (peak stress (6), residual stress (6), overshoot strain (6), seismic strain (6), region).

    The trial stress is projected to the intact surface, and that point to the residual surface, by a law's
    `return_to_surface`. Through the elastic compliance the first drop is the overshoot (aseismic: it depends on the
    step size), the second the seismic strain. Both strains are plastic, tensor shear. region is that of the return to
    the intact surface; where it is ELASTIC the rock has not failed: both stresses are the trial and both strains zero.
    scale: strength of this intact rock over that of intact_row (kernels/failure.py).
    """
    trial = (xx, yy, zz, yz, xz, xy)
    nothing = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    once = 1.0 / scale
    pxx, pyy, pzz, pyz, pxz, pxy, region = return_to_surface(
        once * xx, once * yy, once * zz, once * yz, once * xz, once * xy, lame_lambda, shear_modulus, intact_row
    )
    if region == ELASTIC:
        return trial, trial, nothing, nothing, region
    pxx, pyy, pzz = scale * pxx, scale * pyy, scale * pzz
    pyz, pxz, pxy = scale * pyz, scale * pxz, scale * pxy
    rxx, ryy, rzz, ryz, rxz, rxy, _ = return_to_surface(
        pxx, pyy, pzz, pyz, pxz, pxy, lame_lambda, shear_modulus, residual_row
    )
    overshoot = strain_from_stress(
        lame_lambda, shear_modulus, xx - pxx, yy - pyy, zz - pzz, yz - pyz, xz - pxz, xy - pxy
    )
    seismic = strain_from_stress(
        lame_lambda, shear_modulus, pxx - rxx, pyy - ryy, pzz - rzz, pyz - ryz, pxz - rxz, pxy - rxy
    )
    return (pxx, pyy, pzz, pyz, pxz, pxy), (rxx, ryy, rzz, ryz, rxz, rxy), overshoot, seismic, region


@intrinsic
def _numbers_at(typing, values, lane):
    """One lane of a tuple of lanes: a tuple of numbers."""
    kind = types.UniTuple(values.dtype.element, values.count)

    def generate(context, builder, sig, args):
        place = context.cast(builder, args[1], sig.args[1], types.int32)
        parts = cgutils.unpack_tuple(builder, args[0], kind.count)
        return context.make_tuple(builder, kind, [builder.extract_element(part, place) for part in parts])

    return kind(values, lane), generate


@intrinsic
def _with_numbers_at(typing, values, lane, numbers):
    """A tuple of lanes with one lane of each replaced by a number of a tuple."""

    def generate(context, builder, sig, args):
        place = context.cast(builder, args[1], sig.args[1], types.int32)
        old, new = (cgutils.unpack_tuple(builder, args[k], values.count) for k in (0, 2))
        parts = [builder.insert_element(part, number, place) for part, number in zip(old, new, strict=True)]
        return context.make_tuple(builder, values, parts)

    return values(values, lane, numbers), generate


@njit(error_model="numpy")
def lane_sum(values):
    """Sum of all lanes."""
    total = 0.0
    for lane in range(LANES):
        total += _numbers_at((values,), lane)[0]
    return total


def lane_by_lane(return_to_surface):
    """A law's `return_lanes`, one lane after the other."""

    @njit(error_model="numpy")
    def return_lanes(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row):
        stress = (xx, yy, zz, yz, xz, xy)
        for lane in range(LANES):
            sxx, syy, szz, syz, sxz, sxy = _numbers_at(stress, lane)
            lame, shear = _numbers_at((lame_lambda, shear_modulus), lane)
            rxx, ryy, rzz, ryz, rxz, rxy, _ = return_to_surface(
                sxx, syy, szz, syz, sxz, sxy, lame, shear, _numbers_at(row, lane)
            )
            stress = _with_numbers_at(stress, lane, (rxx, ryy, rzz, ryz, rxz, rxy))
        return stress

    return return_lanes


def tangent_by_differences(return_to_surface):
    """A law's `stiffness_reduction` (see isotropic.py), by forward differences of its return."""

    @njit(error_model="numpy")
    def stiffness_reduction(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row, matrix):
        trial = (xx, yy, zz, yz, xz, xy)
        txx, tyy, tzz, tyz, txz, txy, region = return_to_surface(
            xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row
        )
        if region == ELASTIC:
            return False
        returned = (txx, tyy, tzz, tyz, txz, txy)
        size = 0.0
        for a in range(6):
            size = max(size, abs(trial[a]))
        step = TANGENT_DIFFERENCE_STEP * size / shear_modulus
        for b in range(6):
            change = stress_increment(
                lame_lambda,
                shear_modulus,
                step if b == 0 else 0.0,
                step if b == 1 else 0.0,
                step if b == 2 else 0.0,
                0.5 * step if b == 3 else 0.0,
                0.5 * step if b == 4 else 0.0,
                0.5 * step if b == 5 else 0.0,
            )
            rxx, ryy, rzz, ryz, rxz, rxy, _ = return_to_surface(
                xx + change[0], yy + change[1], zz + change[2], yz + change[3], xz + change[4], xy + change[5],
                lame_lambda, shear_modulus, row,
            )  # fmt: skip
            after = (rxx, ryy, rzz, ryz, rxz, rxy)
            for a in range(6):
                matrix[a, b] = (change[a] - (after[a] - returned[a])) / step
        return True

    return stiffness_reduction


@functools.cache
def make_return_particles(law):
    """The kernel for a law."""
    length = law.ROW_LENGTH

    @njit(cache=True, parallel=True, error_model="numpy")
    def return_particles(stress, lame_lambda, shear_modulus, rows, indices, plastic_strain, regions):
        """Return trial stresses to the surface, in place.

        stress (particle, 6) Pa, overwritten; lame_lambda, shear_modulus (particle,) Pa; rows (row, ROW_LENGTH) strength
        rows; indices (particle,) row of each particle; plastic_strain (particle, 6), increased by the compliance times
        the drop, tensor shear; regions (particle,) int8, overwritten (elastic.py).
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
