"""Isotropic laws: a return of three principal stresses serves as a return of tensors, one at a time or eight.

`return_principal(s1, s2, s3, lame_lambda, shear_modulus, row) -> (t1, t2, t3, region)`, s1 >= s2 >= s3, Pa, tension
positive; t in the same order, region as in return_regions.py. Principal directions are kept. What is made here is not
cached by itself, but with the kernels that call it.
"""

from numba import njit

from mpm_core.constitutive.principal import (
    directions_from_root,
    extreme_stresses,
    scaled_deviator,
    split_deviator,
    tensor_from_principal,
)
from mpm_core.constitutive.return_regions import ELASTIC
from mpm_core.simd.choices import choose


@njit(error_model="numpy", inline="always")
def _no_bound(mean, j2, row):
    return False


@njit(error_model="numpy", inline="always")
def _no_bound_principal(s1, s3, error, row):
    return False


def isotropic_return(return_principal, bound=_no_bound, bound_principal=_no_bound_principal):
    """A law's `return_to_surface`.

    bound(mean, j2, row), bound_principal(s1, s3, error, row): whether mean stress and J2, or s1 and s3 known to within
    an error, prove a stress admissible, so that no direction is sought.
    """

    @njit(error_model="numpy", inline="always")
    def return_to_surface(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row):
        mean, dx, dy, dz, j2 = split_deviator(xx, yy, zz, yz, xz, xy)
        if bound(mean, j2, row):
            return xx, yy, zz, yz, xz, xy, ELASTIC
        if j2 == 0.0:
            t, _, _, region = return_principal(mean, mean, mean, lame_lambda, shear_modulus, row)
            return (t, t, t, 0.0, 0.0, 0.0, region) if region != ELASTIC else (xx, yy, zz, yz, xz, xy, ELASTIC)
        bx, by, bz, byz, bxz, bxy, size, root = scaled_deviator(dx, dy, dz, yz, xz, xy, j2)
        s1, s3, error = extreme_stresses(mean, size, root)
        if bound_principal(s1, s3, error, row):
            return xx, yy, zz, yz, xz, xy, ELASTIC
        s1, s2, s3, n1, n3 = directions_from_root(mean, size, root, bx, by, bz, byz, bxz, bxy)
        t1, t2, t3, region = return_principal(s1, s2, s3, lame_lambda, shear_modulus, row)
        if region == ELASTIC:
            return xx, yy, zz, yz, xz, xy, ELASTIC
        rxx, ryy, rzz, ryz, rxz, rxy = tensor_from_principal(t1, t2, t3, n1, n3)
        return rxx, ryy, rzz, ryz, rxz, rxy, region

    return return_to_surface


def isotropic_lanes(return_principal):
    """A law's `return_lanes`; return_principal takes lanes (simd/lanes.py), too.

    Nothing is left out for stress that is far from the surface, and products may be rounded together with sums: to
    round-off the same as `isotropic_return`.
    """

    @njit(error_model="numpy", inline="always")
    def return_lanes(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row):
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

    return return_lanes
