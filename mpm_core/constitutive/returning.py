"""Return mapping in principal stress space: Coulomb faces, edges and apex, tension planes, and where they meet.

Active-set solution in closed form. For each candidate set the linear problem "on these planes, plastic strain along
their flow directions" is solved exactly; the order of the questions below finds the set whose multipliers are all
positive and whose stress is admissible (Koiter 1953; the regions are those of Clausen, Damkilde & Andersen 2007,
Comput. Struct. 85, 1795, and de Souza Neto, Peric & Owen 2008, ch. 8). For lambda >= 0 the matrices of the two faces at
an edge, and of face and tension plane, have positive principal minors at any friction and dilation angle: each of these
pairs has exactly one solution, so the order of the questions does not matter.

Planes (the other faces and tension planes are images of these under exchange of equal principal stresses):
    face     N s1 - s3 = sigma_c    flow (N_psi, 0, -1)
    tension  s1 = T                 flow (1, 0, 0)
"""

from numba import njit

from mpm_core.constitutive.strength import (
    APEX,
    DILATION_FACTOR,
    FRICTION_FACTOR,
    TENSILE_STRENGTH,
    UNCONFINED_STRENGTH,
)

# Where a return ended. TENSION: the tension cut-off acts, alone or together with Coulomb planes.
ELASTIC, FACE, EDGE, APEX_REGION, TENSION = range(5)

# A stress this little above strength, relative to its size, counts as admissible: some ten times the round-off that an
# eigen-solve and the rebuilding of a tensor leave, so that a returned stress is never returned again.
ADMISSIBLE_ROUND_OFF = 1e-13


@njit(cache=True, error_model="numpy", inline="always")
def _above(s1, s3, row):
    """Whether principal stresses are above strength by more than round-off."""
    friction = row[FRICTION_FACTOR]
    size = ADMISSIBLE_ROUND_OFF * max(abs(s1), abs(s3))
    return friction * s1 - s3 - row[UNCONFINED_STRENGTH] > (friction + 1.0) * size or s1 - row[TENSILE_STRENGTH] > size


@njit(cache=True, error_model="numpy", inline="always")
def _coulomb_return(s1, s2, s3, lame_lambda, shear_modulus, row):
    """Return to the Coulomb cone without its cut-off: (t1, t2, t3, region); the trial where it is inside.

    A face return that breaks t1 >= t2 belongs to the edge s1 = s2, one that breaks t2 >= t3 to the edge s2 = s3; one
    that breaks both is beyond the tip (in a million such draws no edge return was admissible). There, and wherever an
    edge return lies beyond the tip, the apex is what remains: also where no flow direction leads to it (zero dilation
    in hydrostatic tension), by convention. Rock with dilation but neither friction nor cohesion has several returns
    by Koiter's rule; this is one of them, and continuous.
    In each case the last component comes from the surface itself, so round-off of a large trial leaves no overstress.
    """
    n = row[FRICTION_FACTOR]
    m = row[DILATION_FACTOR]
    strength = row[UNCONFINED_STRENGTH]
    apex = row[APEX]
    excess = n * s1 - s3 - strength
    if excess <= 0.0:
        return s1, s2, s3, ELASTIC
    volumetric = lame_lambda * (m - 1.0)
    twice = 2.0 * shear_modulus

    multiplier = excess / (volumetric * (n - 1.0) + twice * (n * m + 1.0))
    t2 = s2 - multiplier * volumetric
    t3 = s3 - multiplier * (volumetric - twice)
    t1 = (t3 + strength) / n
    beyond_first = t2 > t1
    beyond_second = t2 < t3
    if not beyond_first and not beyond_second:
        return t1, t2, t3, FACE
    if not beyond_second:
        pair = 0.5 * (s1 + s2)
        multiplier = (n * pair - s3 - strength) / (volumetric * (n - 1.0) + shear_modulus * (n * m + 2.0))
        t3 = s3 - multiplier * (volumetric - twice)
        t1 = (t3 + strength) / n
        if t1 <= apex:
            return t1, t1, min(t3, t1), EDGE
    elif not beyond_first:
        pair = 0.5 * (s2 + s3)
        multiplier = (n * s1 - pair - strength) / (volumetric * (n - 1.0) + shear_modulus * (2.0 * n * m + 1.0))
        t3 = pair - multiplier * (volumetric - shear_modulus)
        t1 = (t3 + strength) / n
        if t1 <= apex:
            return t1, min(t3, t1), min(t3, t1), EDGE
    return apex, apex, apex, APEX_REGION


@njit(cache=True, error_model="numpy", inline="always")
def _tension_return(s1, s2, s3, lame_lambda, shear_modulus, tension):
    """Return to s1 <= T alone (Rankine, associated), with s1 > T: onto one plane, the edge of two, or (T, T, T)."""
    drop = lame_lambda * (s1 - tension) / (lame_lambda + 2.0 * shear_modulus)
    if s2 - drop <= tension:
        return tension, s2 - drop, s3 - drop
    drop = lame_lambda * (s1 + s2 - 2.0 * tension) / (2.0 * (lame_lambda + shear_modulus))
    return tension, tension, min(s3 - drop, tension)


@njit(cache=True, error_model="numpy")
def return_principal(s1, s2, s3, lame_lambda, shear_modulus, row):
    """Return of principal trial stresses s1 >= s2 >= s3: (t1, t2, t3, region), Pa, in the same order.

    The cone alone, if that satisfies the cut-off; else the cut-off alone, if that satisfies the cone; else both act and
    stress ends on the line where they meet, (T, t2, N T - sigma_c), or at one of its ends.
    """
    if not _above(s1, s3, row):
        return s1, s2, s3, ELASTIC
    n = row[FRICTION_FACTOR]
    tension = row[TENSILE_STRENGTH]
    t1, t2, t3, region = _coulomb_return(s1, s2, s3, lame_lambda, shear_modulus, row)
    if t1 <= tension:
        return t1, t2, t3, region
    if s1 > tension:
        t1, t2, t3 = _tension_return(s1, s2, s3, lame_lambda, shear_modulus, tension)
        if n * t1 - t3 <= row[UNCONFINED_STRENGTH]:
            return t1, t2, t3, TENSION
    # On the line t1 and t3 are known, hence two components of the plastic strain (none along s2 while t2 lies between
    # them), hence its trace, hence t2: whatever the dilation angle.
    t3 = min(n * tension - row[UNCONFINED_STRENGTH], tension)
    trace = (s1 - tension + s3 - t3) / (2.0 * (lame_lambda + shear_modulus))
    t2 = min(max(s2 - lame_lambda * trace, t3), tension)
    return tension, t2, t3, TENSION
