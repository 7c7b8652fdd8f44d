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

from mpm_core.constitutive.coulomb_strength import (
    APEX,
    DILATION_FACTOR,
    FRICTION_FACTOR,
    TENSILE_STRENGTH,
    UNCONFINED_STRENGTH,
)
from mpm_core.constitutive.elastic import ADMISSIBLE_ROUND_OFF, APEX_REGION, EDGE, ELASTIC, FACE, TENSION
from mpm_core.simd.lanes import choose


@njit(cache=True, error_model="numpy", inline="always")
def _above(s1, s3, row):
    """True if principal stresses are above strength by more than round-off."""
    friction = row[FRICTION_FACTOR]
    size = ADMISSIBLE_ROUND_OFF * max(abs(s1), abs(s3))
    beyond_cone = friction * s1 - s3 - row[UNCONFINED_STRENGTH] > (friction + 1.0) * size
    return beyond_cone | (s1 - row[TENSILE_STRENGTH] > size)


@njit(cache=True, error_model="numpy", inline="always")
def _coulomb_return(s1, s2, s3, lame_lambda, shear_modulus, row):
    """Return to the Coulomb cone without its cut-off: (t1, t2, t3, region); the trial where it is inside.

    A face return that breaks t1 >= t2 belongs to the edge s1 = s2, one that breaks t2 >= t3 to the edge s2 = s3; one
    that breaks both is beyond the tip. There, and wherever an
    edge return lies beyond the tip, the apex is what remains: also where no flow direction leads to it (zero dilation
    in hydrostatic tension), by convention. Rock with dilation but neither friction nor cohesion has several returns
    by Koiter's rule; this is one of them, and continuous.
    In each case the last component comes from the surface itself, so round-off of a large trial leaves no overstress.
    """
    n = row[FRICTION_FACTOR]
    m = row[DILATION_FACTOR]
    strength = row[UNCONFINED_STRENGTH]
    apex = row[APEX]
    volumetric = lame_lambda * (m - 1.0)
    twice = 2.0 * shear_modulus

    excess = n * s1 - s3 - strength
    multiplier = excess / (volumetric * (n - 1.0) + twice * (n * m + 1.0))
    t2 = s2 - multiplier * volumetric
    t3 = s3 - multiplier * (volumetric - twice)
    t1 = (t3 + strength) / n
    beyond_first = t2 > t1
    beyond_second = t2 < t3

    pair = 0.5 * (s1 + s2)
    multiplier = (n * pair - s3 - strength) / (volumetric * (n - 1.0) + shear_modulus * (n * m + 2.0))
    first3 = s3 - multiplier * (volumetric - twice)
    first1 = (first3 + strength) / n
    pair = 0.5 * (s2 + s3)
    multiplier = (n * s1 - pair - strength) / (volumetric * (n - 1.0) + shear_modulus * (2.0 * n * m + 1.0))
    second3 = pair - multiplier * (volumetric - shear_modulus)
    second1 = (second3 + strength) / n

    edge1 = choose(beyond_first, first1, second1)
    edge3 = min(choose(beyond_first, first3, second3), edge1)
    edge2 = choose(beyond_first, edge1, edge3)
    beyond_tip = (beyond_first & beyond_second) | (edge1 > apex)
    on_face = (t2 <= t1) & (t2 >= t3)
    inside = excess <= 0.0
    region = choose(on_face, FACE, choose(beyond_tip, APEX_REGION, EDGE))
    t1 = choose(on_face, t1, choose(beyond_tip, apex, edge1))
    t2 = choose(on_face, t2, choose(beyond_tip, apex, edge2))
    t3 = choose(on_face, t3, choose(beyond_tip, apex, edge3))
    return choose(inside, s1, t1), choose(inside, s2, t2), choose(inside, s3, t3), choose(inside, ELASTIC, region)


@njit(cache=True, error_model="numpy", inline="always")
def tension_return(s1, s2, s3, lame_lambda, shear_modulus, tension):
    """Return to s1 <= T alone (Rankine, associated), with s1 > T: onto one plane, the edge of two, or (T, T, T)."""
    drop = lame_lambda * (s1 - tension) / (lame_lambda + 2.0 * shear_modulus)
    one_plane = s2 - drop <= tension
    drop_of_two = lame_lambda * (s1 + s2 - 2.0 * tension) / (2.0 * (lame_lambda + shear_modulus))
    return (
        tension,
        choose(one_plane, s2 - drop, tension),
        choose(one_plane, s3 - drop, min(s3 - drop_of_two, tension)),
    )


@njit(cache=True, error_model="numpy")
def return_principal(s1, s2, s3, lame_lambda, shear_modulus, row):
    """Return of principal trial stresses s1 >= s2 >= s3: (t1, t2, t3, region), Pa, in the same order.

    The cone alone, if that satisfies the cut-off; else the cut-off alone, if that satisfies the cone; else both act and
    stress ends on the line where they meet, (T, t2, N T - sigma_c), or at one of its ends. Numbers or lanes.
    """
    n = row[FRICTION_FACTOR]
    tension = row[TENSILE_STRENGTH]
    strength = row[UNCONFINED_STRENGTH]
    above = _above(s1, s3, row)
    c1, c2, c3, region = _coulomb_return(s1, s2, s3, lame_lambda, shear_modulus, row)
    r1, r2, r3 = tension_return(s1, s2, s3, lame_lambda, shear_modulus, tension)
    # On the line t1 and t3 are known, hence two components of the plastic strain (none along s2 while t2 lies between
    # them), hence its trace, hence t2: whatever the dilation angle.
    l3 = min(n * tension - strength, tension)
    trace = (s1 - tension + s3 - l3) / (2.0 * (lame_lambda + shear_modulus))
    l2 = min(max(s2 - lame_lambda * trace, l3), tension)

    cone = c1 <= tension
    cut_off = (s1 > tension) & (n * r1 - r3 <= strength)
    t1 = choose(cone, c1, tension)
    t2 = choose(cone, c2, choose(cut_off, r2, l2))
    t3 = choose(cone, c3, choose(cut_off, r3, l3))
    region = choose(cone, region, TENSION)
    return choose(above, t1, s1), choose(above, t2, s2), choose(above, t3, s3), choose(above, region, ELASTIC)
