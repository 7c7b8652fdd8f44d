"""Coulomb failure with a tension cut-off, a law of failure (see laws/__init__.py): residual strength by the same keys.

Stress is xx, yy, zz, yz, xz, xy in Pa, tension positive, with principal values s1 >= s2 >= s3 (principal.py). `row` is
a strength row of coulomb_strength.py, as an array or a tuple. Kernels allocate nothing; but for `return_lanes` they are
scalar and use no fastmath.

The return: non-associated Coulomb flow (dilation angle) and associated tension, exact in one step for isotropic
elasticity (coulomb_return.py). The plastic strain is the compliance times (trial - returned). An admissible stress
comes back bit for bit with region ELASTIC; so does a returned one.
"""

import math
from typing import Literal, Self

import numpy as np
from numba import njit
from pydantic import model_validator

from common.setting_types import choose, is_section, refusal, refuse
from mpm_core.constitutive.coulomb_return import return_principal
from mpm_core.constitutive.coulomb_strength import (
    DILATION_FACTOR,
    FRICTION_FACTOR,
    TENSILE_STRENGTH,
    UNCONFINED_STRENGTH,
    residual_outside_intact,
    strength_row,
)
from mpm_core.constitutive.coulomb_strength import ROW_LENGTH as ROW_LENGTH
from mpm_core.constitutive.elastic import ADMISSIBLE_ROUND_OFF, STRENGTH_FACTOR_CAP
from mpm_core.constitutive.isotropic import isotropic_lanes, isotropic_return, isotropic_tangent
from mpm_core.constitutive.principal import principal_stresses, split_deviator
from mpm_core.settings import AnglePair, RockSettings, StrengthPair

NAME = "coulomb"


class Material(RockSettings):
    """Rock that fails by Coulomb's criterion with a tension cut-off."""

    model: Literal["coulomb"]
    friction_angle: AnglePair
    """Friction angle of intact and of failed rock."""
    dilation_angle: AnglePair
    """Dilation angle of intact and of failed rock."""
    cohesion: StrengthPair
    """Cohesion of intact and of failed rock."""
    tension_cutoff: choose(is_section, StrengthPair, Literal["none"])
    """Tensile strength of intact and of failed rock, or `none`."""
    allow_psi_above_phi: bool = False
    """Whether the dilation angle may exceed the friction angle. Such rock creates energy."""

    @model_validator(mode="after")
    def _gains_nothing_by_failing(self) -> Self:
        found = []
        for key in ("friction_angle", "cohesion", "tension_cutoff"):
            pair = getattr(self, key)
            if pair != "none" and pair.residual > pair.intact:
                gains = f"residual {pair.residual:g} is above intact {pair.intact:g}; rock gains no strength by failing"
                found.append(refusal(gains, key))
        if not found and (reason := residual_outside_intact(*strength_rows(self, (0, 1, 2)))):
            found.append(refusal(reason))
        for state in ("intact", "residual"):
            friction, dilation = (getattr(getattr(self, key), state) for key in ("friction_angle", "dilation_angle"))
            if dilation > friction and not self.allow_psi_above_phi:
                gains = (
                    f"{dilation:g} deg is above the friction angle {friction:g} deg, which creates energy; set "
                    "allow_psi_above_phi: true if that is meant"
                )
                found.append(refusal(gains, "dilation_angle", state))
        refuse(found)
        return self


def strength_rows(material: Material, axes: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Intact and residual strength row; no direction of the mine's frame (axes) enters."""
    intact, residual = (
        strength_row(
            getattr(material.friction_angle, state),
            getattr(material.dilation_angle, state),
            getattr(material.cohesion, state),
            None if material.tension_cutoff == "none" else getattr(material.tension_cutoff, state),
        )
        for state in ("intact", "residual")
    )
    return intact, residual


def overstress_of_tensor(tensor: np.ndarray, row: np.ndarray) -> float:
    """`overstress` of a stress (3, 3) Pa, by numpy."""
    s3, _, s1 = np.linalg.eigvalsh(tensor)
    return max(row[FRICTION_FACTOR] * s1 - s3 - row[UNCONFINED_STRENGTH], s1 - row[TENSILE_STRENGTH])


@njit(cache=True, error_model="numpy", inline="always")
def strength_size(row):
    """Unconfined compressive strength, Pa."""
    return row[UNCONFINED_STRENGTH]


@njit(cache=True, error_model="numpy", inline="always")
def gains_energy(row):
    """True if flow may gain energy: rock that dilates above its friction."""
    return row[DILATION_FACTOR] > row[FRICTION_FACTOR]


@njit(cache=True, error_model="numpy", inline="always")
def _surely_admissible(mean, j2, row):
    """True if no Lode angle could bring a stress of this mean and J2 above strength; no eigen-solve, no square root.

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
    """True if stress is admissible with s1 and s3 known to within an error."""
    friction = row[FRICTION_FACTOR]
    return (
        friction * s1 - s3 + (friction + 1.0) * error <= row[UNCONFINED_STRENGTH]
        and s1 + error <= row[TENSILE_STRENGTH]
    )


@njit(cache=True, error_model="numpy", inline="always")
def surely_admissible(xx, yy, zz, yz, xz, xy, row):
    """True if bounds from mean stress and J2 alone prove a stress admissible (False: it may or may not be)."""
    mean, _, _, _, j2 = split_deviator(xx, yy, zz, yz, xz, xy)
    return _surely_admissible(mean, j2, row)


@njit(cache=True, error_model="numpy")
def overstress(xx, yy, zz, yz, xz, xy, row):
    """Overstress, Pa: max(N s1 - s3 - sigma_c, s1 - T); at most 0 where admissible.

    The first is the excess of the major compression over the strength at this confinement, the second the excess of
    tension. Exact: no early exit (see `surely_admissible`).

    Compression of 60 MPa and a confinement of 5 MPa, in rock of cohesion 10 MPa and friction angle 30 degrees, which
    bears 3 x 5 + 34.6 MPa:

    >>> row = strength_row(friction_angle=30, dilation_angle=0, cohesion=10e6)
    >>> round(overstress(-5e6, -10e6, -60e6, 0.0, 0.0, 0.0, row) / 1e6, 2)
    10.36
    """
    s1, _, s3 = principal_stresses(xx, yy, zz, yz, xz, xy)
    return max(row[FRICTION_FACTOR] * s1 - s3 - row[UNCONFINED_STRENGTH], s1 - row[TENSILE_STRENGTH])


return_to_surface = isotropic_return(return_principal, _surely_admissible, _surely_admissible_principal)
return_lanes = isotropic_lanes(return_principal)
stiffness_reduction = isotropic_tangent(return_principal)


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
