"""Coulomb failure with a tension cut-off: overstress, return to the strength surface, brittle drop, strength factors.

Stress is xx, yy, zz, yz, xz, xy in Pa, tension positive, with principal values s1 >= s2 >= s3 (principal.py). `row` is
a strength row of strength.py, as an array or a tuple. Kernels allocate nothing; but for `return_lanes` they are scalar
and use no fastmath.
"""

import math

from numba import njit

from mpm_core.constitutive.elastic import strain_from_stress
from mpm_core.constitutive.principal import (
    directions_from_root,
    extreme_stresses,
    principal_stresses,
    scaled_deviator,
    split_deviator,
    tensor_from_principal,
)
from mpm_core.constitutive.returning import ADMISSIBLE_ROUND_OFF, ELASTIC, return_principal
from mpm_core.constitutive.strength import FRICTION_FACTOR, TENSILE_STRENGTH, UNCONFINED_STRENGTH
from mpm_core.simd.choices import choose

STRENGTH_FACTOR_CAP = 10.0


@njit(cache=True, error_model="numpy", inline="always")
def _surely_admissible(mean, j2, row):
    """Whether no Lode angle could bring a stress of this mean and J2 above strength; no eigen-solve, no square root.

    With s_i = mean + 2 sqrt(J2/3) cos(...), N s1 - s3 is at most (N - 1) mean + 2 sqrt(J2/3) sqrt(N^2 + N + 1).
    """
    friction = row[FRICTION_FACTOR]
    shear_room = row[UNCONFINED_STRENGTH] - (friction - 1.0) * mean
    tension_room = row[TENSILE_STRENGTH] - mean
    radius = (4.0 / 3.0) * j2
    return (
        shear_room >= 0.0
        and tension_room >= 0.0
        and radius * (friction * friction + friction + 1.0) <= shear_room * shear_room
        and radius <= tension_room * tension_room
    )


@njit(cache=True, error_model="numpy", inline="always")
def _surely_admissible_principal(s1, s3, error, row):
    """Whether stress is admissible with s1 and s3 known to within an error."""
    friction = row[FRICTION_FACTOR]
    return (
        friction * s1 - s3 + (friction + 1.0) * error <= row[UNCONFINED_STRENGTH]
        and s1 + error <= row[TENSILE_STRENGTH]
    )


@njit(cache=True, error_model="numpy", inline="always")
def surely_admissible(xx, yy, zz, yz, xz, xy, row):
    """Whether bounds from mean stress and J2 alone prove a stress admissible (False: it may or may not be)."""
    mean, _, _, _, j2 = split_deviator(xx, yy, zz, yz, xz, xy)
    return _surely_admissible(mean, j2, row)


@njit(cache=True, error_model="numpy")
def overstress(xx, yy, zz, yz, xz, xy, row):
    """How far stress is above strength, Pa: max(N s1 - s3 - sigma_c, s1 - T); at most 0 where admissible.

    The first is the excess of the major compression over the strength at this confinement, the second the excess of
    tension. Exact: no early exit (see `surely_admissible`).
    """
    s1, _, s3 = principal_stresses(xx, yy, zz, yz, xz, xy)
    return max(row[FRICTION_FACTOR] * s1 - s3 - row[UNCONFINED_STRENGTH], s1 - row[TENSILE_STRENGTH])


@njit(cache=True, error_model="numpy", inline="always")
def return_to_surface(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row):
    """Plastic return of an elastic trial stress: (xx, yy, zz, yz, xz, xy, region), stress in Pa.

    Non-associated Coulomb flow (dilation angle) and associated tension, exact in one step for isotropic elasticity
    (returning.py). Principal directions are kept. The plastic strain is the compliance times (trial - returned).
    An admissible stress comes back bit for bit with region ELASTIC; so does a returned one. region: returning.py.
    """
    mean, dx, dy, dz, j2 = split_deviator(xx, yy, zz, yz, xz, xy)
    if _surely_admissible(mean, j2, row):
        return xx, yy, zz, yz, xz, xy, ELASTIC
    if j2 == 0.0:
        t, _, _, region = return_principal(mean, mean, mean, lame_lambda, shear_modulus, row)
        return (t, t, t, 0.0, 0.0, 0.0, region) if region != ELASTIC else (xx, yy, zz, yz, xz, xy, ELASTIC)
    bx, by, bz, byz, bxz, bxy, size, root = scaled_deviator(dx, dy, dz, yz, xz, xy, j2)
    s1, s3, error = extreme_stresses(mean, size, root)
    if _surely_admissible_principal(s1, s3, error, row):
        return xx, yy, zz, yz, xz, xy, ELASTIC
    s1, s2, s3, n1, n3 = directions_from_root(mean, size, root, bx, by, bz, byz, bxz, bxy)
    t1, t2, t3, region = return_principal(s1, s2, s3, lame_lambda, shear_modulus, row)
    if region == ELASTIC:
        return xx, yy, zz, yz, xz, xy, ELASTIC
    rxx, ryy, rzz, ryz, rxz, rxy = tensor_from_principal(t1, t2, t3, n1, n3)
    return rxx, ryy, rzz, ryz, rxz, rxy, region


@njit(cache=True, error_model="numpy", inline="always")
def return_lanes(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row):
    """`return_to_surface` of lanes (simd/lanes.py), all arguments such: the returned stress, without its region.

    Nothing is left out for stress that is far from the surface, and products may be rounded together with sums: to
    round-off the same.
    """
    mean, dx, dy, dz, j2 = split_deviator(xx, yy, zz, yz, xz, xy)
    isotropic = j2 <= 0.0
    bx, by, bz, byz, bxz, bxy, size, root = scaled_deviator(dx, dy, dz, yz, xz, xy, choose(isotropic, 1.0, j2))
    size = choose(isotropic, 0.0, size)
    s1, s2, s3, n1, n3 = directions_from_root(mean, size, root, bx, by, bz, byz, bxz, bxy)
    t1, t2, t3, region = return_principal(s1, s2, s3, lame_lambda, shear_modulus, row)
    rxx, ryy, rzz, ryz, rxz, rxy = tensor_from_principal(t1, t2, t3, n1, n3)
    yields = region > ELASTIC
    return (
        choose(yields, rxx, xx),
        choose(yields, ryy, yy),
        choose(yields, rzz, zz),
        choose(yields, ryz, yz),
        choose(yields, rxz, xz),
        choose(yields, rxy, xy),
    )


@njit(cache=True, error_model="numpy")
def brittle_drop(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, intact_row, residual_row):
    """First yield: (peak stress (6), residual stress (6), overshoot strain (6), seismic strain (6), region).

    The trial stress is projected to the intact surface, and that point to the residual surface. Through the elastic
    compliance the first drop is the overshoot (aseismic: it depends on the step size), the second the seismic strain.
    Both strains are plastic, tensor shear. region is that of the return to the intact surface; where it is ELASTIC the
    rock has not failed: both stresses are the trial and both strains zero.
    """
    trial = (xx, yy, zz, yz, xz, xy)
    nothing = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    pxx, pyy, pzz, pyz, pxz, pxy, region = return_to_surface(
        xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, intact_row
    )
    if region == ELASTIC:
        return trial, trial, nothing, nothing, region
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


@njit(cache=True, error_model="numpy")
def strength_factor(xx, yy, zz, yz, xz, xy, row):
    """Strength over stress: at least 1 where admissible, below 1 above strength, from 0 to STRENGTH_FACTOR_CAP.

    The radius of the Mohr circle of s1 and s3 that touches the strength line (or the tension cut-off), its centre
    m = (s1 + s3) / 2 unchanged, over the actual radius: min(sigma_c - (N - 1) m, (N + 1)(T - m)) / (N + 1) / radius.
    """
    s1, _, s3 = principal_stresses(xx, yy, zz, yz, xz, xy)
    friction = row[FRICTION_FACTOR]
    centre = 0.5 * (s1 + s3)
    radius = 0.5 * (s1 - s3)
    at_failure = (row[UNCONFINED_STRENGTH] - (friction - 1.0) * centre) / (friction + 1.0)
    at_failure = min(at_failure, row[TENSILE_STRENGTH] - centre)
    # A stress that a return has put on the surface is not above it: the same round-off is forgiven here as there.
    allowed = ADMISSIBLE_ROUND_OFF * max(abs(s1), abs(s3))
    if at_failure < radius and at_failure >= radius - allowed:
        return 1.0
    if at_failure >= STRENGTH_FACTOR_CAP * radius:
        return STRENGTH_FACTOR_CAP
    return max(0.0, at_failure / radius)


@njit(cache=True, error_model="numpy")
def excess_shear_stress(xx, yy, zz, yz, xz, xy, row):
    """Ryder's excess shear stress, Pa: max over all planes of |tau| - (c - sigma_n tan phi), sigma_n tension positive.

    In closed form (N s1 - s3 - sigma_c) / (2 sqrt N); negative below strength (Ryder 1988, J. South. Afr. Inst. Min.
    Metall. 88, 27). Planes in tension are not treated apart: the tension cut-off does not enter.
    """
    s1, _, s3 = principal_stresses(xx, yy, zz, yz, xz, xy)
    friction = row[FRICTION_FACTOR]
    return (friction * s1 - s3 - row[UNCONFINED_STRENGTH]) / (2.0 * math.sqrt(friction))
