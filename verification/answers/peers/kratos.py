"""Returns to a Coulomb surface with a tension cut-off that Kratos tests its own law with.

Facts from KratosMultiphysics/Kratos, applications/GeoMechanicsApplication/tests/cpp_tests/custom_constitutive/
test_mohr_coulomb_with_tension_cutoff.cpp (commit 033d505): principal stresses, tension positive, friction 35 degrees,
cohesion 10. Its three returns to the corner of shear and cut-off are said to have Poisson's ratio 0.25, but keep the
intermediate stress. Their numbers are those of a ratio of 0, and they are compared as such.
"""

from dataclasses import dataclass, replace

import numpy as np

from mpm_core.constitutive.coulomb_strength import DILATION_FACTOR, strength_row
from mpm_core.constitutive.general import make_return_particles
from mpm_core.constitutive.laws import coulomb
from mpm_core.settings import lame_parameters

FRICTION, COHESION, YOUNGS_MODULUS = 35.0, 10.0, 1e6


@dataclass(frozen=True)
class Return:
    """Trial stress and where Kratos returns it to, (3,) each; dilation degrees, Poisson's ratio, cut-off."""

    trial: tuple[float, float, float]
    returned: tuple[float, float, float]
    dilation: float
    poisson_ratio: float
    cutoff: float = 10.0


SHEAR, TO_CORNER = (7.338673315592010089, 0.0, -11.338673315592010089), -1.5179192179966735
APEX = 14.2814800674211450
CASES = (
    Return((6, 0, -10), (6, 0, -10), 20, 0.25),
    Return((8, 6, 4), (8, 6, 4), 20, 0.25),
    Return((8, 0, -12), SHEAR, 0, 0.25),
    Return((12, 0, -16), SHEAR, 0, 0.25),
    Return((12, 10, -16), (7.806379130008, 7.806379130008, -9.61275826001616129), 0, 0.25),
    Return((12, -12, -16), (6.78245195822, -13.3912259791, -13.3912259791), 0, 0.25),
    Return((18, 8, -2), (10, 8, TO_CORNER), 20, 0.0),
    Return((24, 8, -8), (10, 8, TO_CORNER), 20, 0.0),
    Return((24, 22, -8), (10, 10, TO_CORNER), 20, 0.0),
    Return((12, 9, 8), (10, 9, 8), 20, 0.0),
    Return((14, 9, 6), (10, 9, 6), 20, 0.0),
    Return((14, 12, 6), (10, 10, 6), 20, 0.0),
    Return((19, 12, 11), (10, 10, 10), 20, 0.0),
    Return((11.5, 10, 10.5), (10, 10, 10), 20, 0.0),
    Return((22, 20, 18), (APEX, APEX, APEX), 20, 0.25, 20.0),
)
AS_STATED = tuple(replace(case, poisson_ratio=0.25) for case in CASES if case.returned[2] == TO_CORNER)


def ours(case: Return) -> np.ndarray:
    """Stress to which the law `coulomb` returns a trial stress: principal values (3,) in the given order."""
    lame, shear = lame_parameters(YOUNGS_MODULUS, case.poisson_ratio)
    stress = np.array([[*case.trial, 0.0, 0.0, 0.0]], float)
    row = strength_row(FRICTION, case.dilation, COHESION, case.cutoff)
    one, strain = np.zeros(1, np.int64), np.zeros((1, 6))
    make_return_particles(coulomb)(
        stress, np.array([lame]), np.array([shear]), row[None], one, strain, np.zeros(1, np.int8)
    )
    return stress[0, :3]


def cutoff_multipliers(case: Return, returned: np.ndarray) -> float:
    """Sum of the plastic multipliers of the cut-off's faces times Young's modulus, for a return to `returned` (3,).

    The return is on faces of shear and cut-off. Plastic strain is the compliance times the drop. Only shear shortens
    along the least stress, by lambda in all, and stretches the other two by N_psi lambda. The cut-off's faces stretch
    these by the rest, which must be positive (Koiter 1953).
    """
    drop = np.asarray(case.trial, float) - returned
    strain = drop - case.poisson_ratio * (drop.sum() - drop)
    dilation = strength_row(FRICTION, case.dilation, COHESION, case.cutoff)[DILATION_FACTOR]
    return float(strain[0] + strain[1] + dilation * strain[2])
