"""Dynamic demand on support by area of the surface, and the class of support that carries it.

  E = m v^2 / 2 + q m g d,        m = density times depth of the rock that is thrown

(Kaiser, McCreath and Tannant 1996). v is the peak ground velocity, d the displacement that is allowed. q is 1 where the
rock moves down (roof) and 0 where it moves level (walls, face). Kaiser et al. take -1 for the floor, where gravity
brakes; here it is 0, so that gravity never lowers a demand. A class of support states its capacity up to a displacement
that is not larger than d, so gravity does no more work on it than the demand has.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shaking.settings import SupportClass

GRAVITY = 9.81  # m/s2
GRAVITY_SHARE = {"roof": 1.0, "walls": 0.0, "floor": 0.0, "face": 0.0}  # q by side


def energy_demand(
    velocity: ArrayLike, depth: ArrayLike, density: float, displacement: float, gravity_share: ArrayLike
) -> NDArray:
    """Demand, J/m2, of rock of a depth (m) and density (kg/m3) that is thrown with a velocity (m/s).

    displacement: allowed, m; gravity_share: q of the module docstring. Arrays broadcast; NaN where one is NaN.

    >>> round(float(energy_demand(2.0, 1.0, 2700.0, 0.2, 1.0)))  # 5400 J/m2 of velocity, 5297 of weight
    10697
    """
    mass = density * np.asarray(depth, float)
    return mass * (0.5 * np.square(velocity) + np.asarray(gravity_share) * GRAVITY * displacement)


def weakest_class(demand: float, support: Sequence[SupportClass]) -> str:
    """Name of the class of least energy whose stated capacity is above the demand (J/m2); empty where none is, or where
    the demand is NaN."""
    enough = [one for one in support if one.energy * 1e3 > demand]
    return min(enough, key=lambda one: (one.energy, one.displacement)).name if enough else ""
