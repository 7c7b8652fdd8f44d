"""Isotropic linear elasticity, and the numbers that all laws share: where a return ends, and round-off.

Tensors are six numbers xx, yy, zz, yz, xz, xy with TENSOR shear (half the engineering shear), tension positive.
The kernels are scalar for use inside loops over particles; numba also compiles them for whole arrays, and takes the
numbers as constants.
"""

from numba import njit

# Where a return ended. TENSION: the tension cut-off acts, alone or together with other planes.
ELASTIC, FACE, EDGE, APEX_REGION, TENSION = range(5)

# A stress this little above strength, relative to its size, counts as admissible: some ten times the round-off that an
# eigen-solve and the rebuilding of a tensor leave, so that a returned stress is never returned again.
ADMISSIBLE_ROUND_OFF = 1e-13

STRENGTH_FACTOR_CAP = 10.0


@njit(cache=True, error_model="numpy", inline="always")
def stress_increment(lame_lambda, shear_modulus, xx, yy, zz, yz, xz, xy):
    """Stress increment (6 components, Pa) of a strain increment (6 components): lambda tr(e) I + 2 G e."""
    volumetric = lame_lambda * (xx + yy + zz)
    twice = 2.0 * shear_modulus
    return (
        volumetric + twice * xx,
        volumetric + twice * yy,
        volumetric + twice * zz,
        twice * yz,
        twice * xz,
        twice * xy,
    )


@njit(cache=True, error_model="numpy", inline="always")
def strain_from_stress(lame_lambda, shear_modulus, xx, yy, zz, yz, xz, xy):
    """Strain (6 components) of a stress or stress change (6 components, Pa) through the elastic compliance."""
    compliance = 0.5 / shear_modulus
    volumetric = lame_lambda / (3.0 * lame_lambda + 2.0 * shear_modulus) * (xx + yy + zz)
    return (
        compliance * (xx - volumetric),
        compliance * (yy - volumetric),
        compliance * (zz - volumetric),
        compliance * yz,
        compliance * xz,
        compliance * xy,
    )


@njit(cache=True, error_model="numpy", inline="always")
def contraction(axx, ayy, azz, ayz, axz, axy, bxx, byy, bzz, byz, bxz, bxy):
    """Double contraction a : b of two symmetric tensors; stress : strain is work per volume, J/m3."""
    return axx * bxx + ayy * byy + azz * bzz + 2.0 * (ayz * byz + axz * bxz + axy * bxy)


@njit(cache=True, error_model="numpy", inline="always")
def energy_density(lame_lambda, shear_modulus, xx, yy, zz, yz, xz, xy):
    """Elastic energy stored per volume by a stress (6 components, Pa), J/m3: half of stress : strain."""
    exx, eyy, ezz, eyz, exz, exy = strain_from_stress(lame_lambda, shear_modulus, xx, yy, zz, yz, xz, xy)
    return 0.5 * contraction(xx, yy, zz, yz, xz, xy, exx, eyy, ezz, eyz, exz, exy)
