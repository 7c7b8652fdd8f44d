"""Isotropic laws: a return of three principal stresses serves as a return of tensors, one at a time or eight.

`return_principal(s1, s2, s3, lame_lambda, shear_modulus, row) -> (t1, t2, t3, region)`, s1 >= s2 >= s3, Pa, tension
positive; t in the same order, region as in elastic.py. Principal directions are kept. What is made here is not
cached by itself, but with the kernels that call it.

The consistent tangent of the return says what a small strain takes off elastic stress.
`stiffness_reduction(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row, matrix) -> bool` writes the derivative of
(elastic trial stress - returned stress) by strain, with engineering shear (2 e_yz), to matrix (6, 6) Pa and says
whether rock yields; where it does not, matrix is left as it was. Stress xx ... xy Pa is the trial. Not symmetric unless
flow is associated.

Stress returns to  sum t_i n_i n_i  with the directions n_i of the trial stress  sum s_i n_i n_i.  Within one region of
the return t is linear in s: differences of two returns are exact. A turn of the directions changes the stress by
(t_i - t_j) / (s_i - s_j) of what it changes the trial stress (de Souza Neto, Peric & Owen 2008, appendix A).
"""

from numba import njit

from mpm_core.constitutive.elastic import ELASTIC
from mpm_core.constitutive.principal import (
    directions_from_root,
    extreme_stresses,
    principal_directions,
    scaled_deviator,
    split_deviator,
    tensor_from_principal,
)
from mpm_core.simd.lanes import choose

PRINCIPAL_DIFFERENCE_STEP = 1e-6  # Difference of principal stress between two returns, as a share of the stress.
MIN_PRINCIPAL_DIFFERENCE = 1e-8  # Principal values that differ by less than this share of the stress count as equal.


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


@njit(cache=True, error_model="numpy")
def _turning(t, s, i, j, slopes, least):
    """Share of a turn in the plane of directions i and j that remains, 0 to 1."""
    gap = s[i] - s[j]
    share = (t[i] - t[j]) / gap if gap > least else slopes[i][i] - slopes[i][j]
    return min(max(share, 0.0), 1.0)


@njit(cache=True, error_model="numpy", inline="always")
def _part(one, other, factor, a):
    """Component a of the symmetric tensor factor (n m + m n) / 2."""
    if a < 3:
        return factor * one[a] * other[a]
    j, k = (a - 2) % 3, (a - 1) % 3
    return factor * 0.5 * (one[j] * other[k] + one[k] * other[j])


@njit(cache=True, error_model="numpy")
def _add_dyad(matrix, weight, left, right, first, second, factor):
    """matrix += weight times the dyad of the symmetric tensors of two pairs of directions."""
    for a in range(6):
        row = weight * _part(left, right, factor, a)
        for b in range(6):
            matrix[a, b] += row * _part(first, second, factor, b)


def isotropic_tangent(return_principal):
    """A law's `stiffness_reduction`, of its return of principal stresses (see above)."""

    @njit(error_model="numpy")
    def stiffness_reduction(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row, matrix):
        s1, s2, s3, n1, n3 = principal_directions(xx, yy, zz, yz, xz, xy)
        t1, t2, t3, region = return_principal(s1, s2, s3, lame_lambda, shear_modulus, row)
        if region == ELASTIC:
            return False
        size = max(abs(s1), abs(s3))
        step = PRINCIPAL_DIFFERENCE_STEP * size
        middle = step if s1 - s2 > s2 - s3 else -step
        a1, a2, a3, _ = return_principal(s1 + step, s2, s3, lame_lambda, shear_modulus, row)
        b1, b2, b3, _ = return_principal(s1, s2 + middle, s3, lame_lambda, shear_modulus, row)
        c1, c2, c3, _ = return_principal(s1, s2, s3 - step, lame_lambda, shear_modulus, row)
        slopes = (
            ((a1 - t1) / step, (b1 - t1) / middle, (t1 - c1) / step),
            ((a2 - t2) / step, (b2 - t2) / middle, (t2 - c2) / step),
            ((a3 - t3) / step, (b3 - t3) / middle, (t3 - c3) / step),
        )
        n2 = (
            n3[1] * n1[2] - n3[2] * n1[1],
            n3[2] * n1[0] - n3[0] * n1[2],
            n3[0] * n1[1] - n3[1] * n1[0],
        )
        directions = (n1, n2, n3)
        for a in range(6):
            for b in range(6):
                matrix[a, b] = 0.0
        for k in range(3):
            rest = 0.0
            for j in range(3):
                rest += (1.0 if j == k else 0.0) - slopes[k][j]
            for m in range(3):
                weight = lame_lambda * rest + 2.0 * shear_modulus * ((1.0 if m == k else 0.0) - slopes[k][m])
                _add_dyad(matrix, weight, directions[k], directions[k], directions[m], directions[m], 1.0)
        s, t, least = (s1, s2, s3), (t1, t2, t3), MIN_PRINCIPAL_DIFFERENCE * size
        for i, j in ((0, 1), (1, 2), (0, 2)):
            weight = shear_modulus * (1.0 - _turning(t, s, i, j, slopes, least))
            _add_dyad(matrix, weight, directions[i], directions[j], directions[i], directions[j], 2.0)
        return True

    return stiffness_reduction
