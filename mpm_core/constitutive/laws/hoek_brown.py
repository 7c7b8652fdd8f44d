"""Generalised Hoek-Brown failure with a tension cut-off: strength that curves with confinement, constant dilation.

Hoek, Carranza-Torres & Corkum (2002, Proc. NARMS-TAC, 267): with compression positive s1' = s3' + sigma_ci (mb s3' /
sigma_ci + s)^a. Here tension is positive and s1 >= s2 >= s3, so rock stands where

    s1 - s3 <= h(s1),    h(x) = sigma_ci (s - mb x / sigma_ci)^a,    and    s1 <= T

with T the cut-off, at most the apex s sigma_ci / mb, where h ends. h falls and (a <= 1) is concave: the set is convex.
Flow is that of Coulomb with a dilation angle, along (N_psi, 0, -1).

On the curve x = apex - sigma_ci / mb u^(1 / a) and h = sigma_ci u: u is smooth where h is not, at the apex. On a face
and on both edges the return is the root of one equation, k u^(1 / a) + u = c. Its left side rises and is convex, so
Newton's method from above falls to the root without a step back. Beyond the apex (c < 0) the curve goes on, odd in u,
with the same slope's sign; as for any Coulomb cone whose friction changes along it, the matrices of two faces have
positive principal minors, so which of face, edge and apex is the return follows from the order of the stresses there.
"""

import math
from typing import Annotated, Literal, Self

import numpy as np
from numba import njit
from pydantic import model_validator

from common.setting_types import Settings, Unit, choose, is_section, real_number, refusal
from mpm_core.constitutive.coulomb_return import tension_return
from mpm_core.constitutive.elastic import (
    ADMISSIBLE_ROUND_OFF,
    APEX_REGION,
    EDGE,
    ELASTIC,
    FACE,
    STRENGTH_FACTOR_CAP,
    TENSION,
)
from mpm_core.constitutive.general import lane_by_lane
from mpm_core.constitutive.isotropic import isotropic_return, isotropic_tangent
from mpm_core.constitutive.principal import principal_stresses, split_deviator
from mpm_core.settings import AnglePair, RockSettings, StrengthPair

NAME = "hoek_brown"
ROW_LENGTH = 7
SIGMA_CI, MB, EXPONENT, APEX, TENSILE_STRENGTH, DILATION_FACTOR, UNCONFINED_STRENGTH = range(ROW_LENGTH)
Stress = Annotated[float, Unit("Pa", ge=1.0, le=1e13)]
MAX_NEWTON_STEPS = 60  # Steps of Newton's method for one root.
# Friction factor of 60 degrees bounds that of a tangent, which would go to 90 degrees towards the apex.
MAX_FRICTION_FACTOR = 13.928203230275509
# Confinement over sigma_ci up to which residual rock must be no stronger than intact rock.
MAX_CONFINEMENT = 1e4
CONFINEMENTS_COMPARED = 400


class StressPair(Settings):
    """Values of intact rock and of rock that has failed."""

    intact: Stress
    residual: Stress


class SlopePair(Settings):
    """Values of intact rock and of rock that has failed."""

    intact: real_number(ge=1e-3, le=100)
    residual: real_number(ge=1e-3, le=100)


class SharePair(Settings):
    """Values of intact rock and of rock that has failed."""

    intact: real_number(ge=0, le=1)
    residual: real_number(ge=0, le=1)


class ExponentPair(Settings):
    """Values of intact rock and of rock that has failed."""

    intact: real_number(ge=0.3, le=1)
    residual: real_number(ge=0.3, le=1)


class IndexPair(Settings):
    """Values of intact rock and of rock that has failed."""

    intact: real_number(ge=0, le=100)
    residual: real_number(ge=0, le=100)


class Material(RockSettings):
    """Rock whose strength curves with confinement (Hoek and Brown). It is given by mb, s and a, or by gsi, mi and
    disturbance."""

    model: Literal["hoek_brown"]
    sigma_ci: StressPair
    """Uniaxial compressive strength of an intact piece."""
    mb: SlopePair = None
    """Parameter mb of the rock mass, intact and failed. It needs s and a, too."""
    s: SharePair = None
    """Parameter s of the rock mass, intact and failed."""
    a: ExponentPair = None
    """Exponent a of the rock mass, intact and failed."""
    gsi: IndexPair = None
    """Geological strength index of intact and of failed rock. It gives mb, s and a (Hoek, Carranza-Torres and Corkum
    2002)."""
    mi: SlopePair = None
    """Constant mi of an intact piece, with gsi."""
    disturbance: SharePair = None
    """Disturbance factor D, with gsi. Default: 0."""
    dilation_angle: AnglePair
    """Dilation angle of intact and of failed rock."""
    tension_cutoff: choose(is_section, StrengthPair, Literal["none"])
    """Tensile strength of intact and of failed rock. `none`: the apex s sigma_ci / mb."""

    @model_validator(mode="after")
    def _one_description(self) -> Self:
        by_index = self.gsi is not None
        required = ("gsi", "mi") if by_index else ("mb", "s", "a")
        foreign = ("mb", "s", "a") if by_index else ("mi", "disturbance")
        for key in foreign:
            if getattr(self, key) is not None:
                raise refusal("give either mb, s and a, or gsi, mi and disturbance", key)
        for key in required:
            if getattr(self, key) is None:
                raise refusal("missing key" + ("" if by_index else "; give mb, s and a, or gsi and mi"), key)
        return self

    @model_validator(mode="after")
    def _residual_within_intact(self) -> Self:
        intact, residual = (_row(self, state) for state in ("intact", "residual"))
        for state, row in (("intact", intact), ("residual", residual)):
            if gains_energy.py_func(row):
                reason = "above the friction angle of unconfined rock, which creates energy"
                raise refusal(reason, "dilation_angle", state)
        low, high = residual[TENSILE_STRENGTH], intact[TENSILE_STRENGTH]
        if low > high:
            raise refusal(
                f"residual tensile strength {low:.6g} Pa (cut-off or apex) is above intact {high:.6g} Pa; rock gains "
                "no strength by failing"
            )
        depths = np.append(0.0, np.geomspace(1e-6, MAX_CONFINEMENT, CONFINEMENTS_COMPARED)) * intact[SIGMA_CI]
        room = _room.py_func  # nothing is compiled for a check of a configuration
        over = [x for x in low - depths if room(x, residual) > room(x, intact) * (1.0 + 1e-12)]
        if over:
            raise refusal(
                f"residual rock is stronger than intact rock at a confinement of {-over[0] / 1e6:.4g} MPa; rock gains "
                "no strength by failing: lower residual sigma_ci, mb, s or gsi"
            )
        return self


def rock_mass(gsi: float, mi: float, disturbance: float) -> tuple[float, float, float]:
    """mb, s and a of a rock mass (Hoek, Carranza-Torres & Corkum 2002, Eqs 2 to 5).

    >>> mb, s, a = rock_mass(gsi=60, mi=12, disturbance=0)
    >>> print(f"mb {mb:.2f}, s {s:.4f}, a {a:.3f}")
    mb 2.88, s 0.0117, a 0.503
    """
    return (
        mi * math.exp((gsi - 100.0) / (28.0 - 14.0 * disturbance)),
        math.exp((gsi - 100.0) / (9.0 - 3.0 * disturbance)),
        0.5 + (math.exp(-gsi / 15.0) - math.exp(-20.0 / 3.0)) / 6.0,
    )


def strength_row(
    sigma_ci: float, mb: float, s: float, a: float, dilation_angle: float, tension_cutoff: float | None = None
) -> np.ndarray:
    """Strength row (ROW_LENGTH,) of these parameters: Pa, degrees; no cut-off as None.

    A cut-off above the apex s sigma_ci / mb never acts and is lowered to it.
    """
    apex, dilation = s * sigma_ci / mb, math.radians(dilation_angle)
    row = np.empty(ROW_LENGTH)
    row[SIGMA_CI], row[MB], row[EXPONENT], row[APEX] = sigma_ci, mb, a, apex
    row[TENSILE_STRENGTH] = apex if tension_cutoff is None else min(tension_cutoff, apex)
    row[DILATION_FACTOR] = (1.0 + math.sin(dilation)) / (1.0 - math.sin(dilation))
    row[UNCONFINED_STRENGTH] = sigma_ci * s**a
    return row


def _row(material: Material, state: str) -> np.ndarray:
    """Strength row of rock that is "intact" or "residual"."""

    def of(pair: Settings | None) -> float:
        return getattr(pair, state) if pair is not None else 0.0

    if material.gsi is not None:
        mb, s, a = rock_mass(of(material.gsi), of(material.mi), of(material.disturbance))
    else:
        mb, s, a = of(material.mb), of(material.s), of(material.a)
    cutoff = None if material.tension_cutoff == "none" else of(material.tension_cutoff)
    return strength_row(of(material.sigma_ci), mb, s, a, of(material.dilation_angle), cutoff)


def strength_rows(material: Material, axes: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Intact and residual strength row, the same in all axes."""
    return _row(material, "intact"), _row(material, "residual")


def overstress_of_tensor(tensor: np.ndarray, row: np.ndarray) -> float:
    """`overstress` of a stress (3, 3) Pa, by numpy."""
    s3, _, s1 = np.linalg.eigvalsh(tensor)
    return max(s1 - s3 - _room.py_func(s1, row), s1 - row[TENSILE_STRENGTH])


@njit(cache=True, error_model="numpy", inline="always")
def _room(x, row):
    """h(x), Pa: how far s1 may be above s3 where s1 is x; 0 beyond the apex."""
    base = (row[APEX] - x) * row[MB] / row[SIGMA_CI]
    return row[SIGMA_CI] * base ** row[EXPONENT] if base > 0.0 else 0.0


@njit(cache=True, error_model="numpy", inline="always")
def _root(k, c, power):
    """u with k |u|^(power - 1) u + u = c; k > 0, power >= 1."""
    size = abs(c)
    if size == 0.0:
        return 0.0
    u = min(size, (size / k) ** (1.0 / power))
    for _ in range(MAX_NEWTON_STEPS):
        steep = k * u ** (power - 1.0)
        following = u - (steep * u + u - size) / (power * steep + 1.0)
        if not following < u:
            break
        u = following
    return math.copysign(u, c)


@njit(cache=True, error_model="numpy", inline="always")
def _on_curve(s, difference, share, row):
    """Point (x, x - h(x), u) of the curve where  difference - share (s - x) = h(x).

    s is the larger stress of the trial (of a pair of equal ones the mean), difference that to the smaller one, share
    what this difference loses for each Pa that s does.
    """
    power = 1.0 / row[EXPONENT]
    u = _root(share / row[MB], (difference - share * (s - row[APEX])) / row[SIGMA_CI], power)
    x = row[APEX] - math.copysign(row[SIGMA_CI] / row[MB] * abs(u) ** power, u)
    return x, x - row[SIGMA_CI] * u, u


@njit(cache=True, error_model="numpy", inline="always")
def _above(s1, s3, row):
    """True if principal stresses are above strength by more than round-off, which the steep curve at the apex lifts."""
    size = ADMISSIBLE_ROUND_OFF * max(abs(s1), abs(s3))
    return s1 - row[TENSILE_STRENGTH] > size or s1 - s3 - 2.0 * size > _room(s1 - size, row)


@njit(cache=True, error_model="numpy")
def _return_without_cutoff(s1, s2, s3, lame_lambda, shear_modulus, row):
    """Return to the curved cone alone: (t1, t2, t3, region); the trial where it is inside.

    A face return that breaks t1 >= t2 belongs to the edge s1 = s2, one that breaks t2 >= t3 to the edge s2 = s3; where
    the edge's return lies beyond the tip the apex is what remains, also where no flow leads to it, by convention.
    """
    if s1 <= row[APEX] and s1 - s3 <= _room(s1, row):
        return s1, s2, s3, ELASTIC
    m = row[DILATION_FACTOR]
    volumetric = lame_lambda * (m - 1.0)
    loss = volumetric + 2.0 * shear_modulus * m
    t1, t3, _ = _on_curve(s1, s1 - s3, 2.0 * shear_modulus * (m + 1.0) / loss, row)
    t2 = s2 - volumetric * (s1 - t1) / loss
    if t3 <= t2 <= t1:
        return t1, t2, t3, FACE
    if t2 > t1:
        pair = 0.5 * (s1 + s2)
        share = shear_modulus * (m + 2.0) / (volumetric + shear_modulus * m)
        first, third, u = _on_curve(pair, pair - s3, share, row)
        if u > 0.0:
            return first, first, third, EDGE
    if t2 < t3:
        share = shear_modulus * (2.0 * m + 1.0) / loss
        first, third, u = _on_curve(s1, s1 - 0.5 * (s2 + s3), share, row)
        if u > 0.0:
            return first, third, third, EDGE
    return row[APEX], row[APEX], row[APEX], APEX_REGION


@njit(cache=True, error_model="numpy")
def return_principal(s1, s2, s3, lame_lambda, shear_modulus, row):
    """Return of principal trial stresses s1 >= s2 >= s3: (t1, t2, t3, region), Pa, in the same order.

    As for Coulomb: the cone alone, if that satisfies the cut-off; else the cut-off alone, if that satisfies the cone;
    else both act and stress ends on the line where they meet, (T, t2, T - h(T)), or at one of its ends.
    """
    if not _above(s1, s3, row):
        return s1, s2, s3, ELASTIC
    tension = row[TENSILE_STRENGTH]
    t1, t2, t3, region = _return_without_cutoff(s1, s2, s3, lame_lambda, shear_modulus, row)
    if t1 <= tension:
        return t1, t2, t3, region
    room = _room(tension, row)
    if s1 > tension:
        t1, t2, t3 = tension_return(s1, s2, s3, lame_lambda, shear_modulus, tension)
        if t1 - t3 <= room:
            return t1, t2, t3, TENSION
    # On the line t1 and t3 are known, hence two components of the plastic strain (none along s2), its trace, and t2.
    third = tension - room
    trace = (s1 - tension + s3 - third) / (2.0 * (lame_lambda + shear_modulus))
    return tension, min(max(s2 - lame_lambda * trace, third), tension), third, TENSION


@njit(cache=True, error_model="numpy", inline="always")
def _bound(mean, j2, row):
    """True if no Lode angle could bring a stress of this mean and J2 above strength; s1 <= mean + 2 sqrt(J2 / 3)."""
    root = math.sqrt(j2)
    highest = mean + 2.0 / math.sqrt(3.0) * root
    return highest <= row[TENSILE_STRENGTH] and 2.0 * root <= _room(highest, row)


@njit(cache=True, error_model="numpy", inline="always")
def _bound_principal(s1, s3, error, row):
    """True if stress is admissible with s1 and s3 known to within an error."""
    return s1 + error <= row[TENSILE_STRENGTH] and s1 - s3 + 2.0 * error <= _room(s1 + error, row)


return_to_surface = isotropic_return(return_principal, _bound, _bound_principal)
return_lanes = lane_by_lane(return_to_surface)
stiffness_reduction = isotropic_tangent(return_principal)


@njit(cache=True, error_model="numpy", inline="always")
def surely_admissible(xx, yy, zz, yz, xz, xy, row):
    """True if bounds from mean stress and J2 alone prove a stress admissible (False: it may or may not be)."""
    mean, _, _, _, j2 = split_deviator(xx, yy, zz, yz, xz, xy)
    return _bound(mean, j2, row)


@njit(cache=True, error_model="numpy")
def overstress(xx, yy, zz, yz, xz, xy, row):
    """Overstress, Pa: max(s1 - s3 - h(s1), s1 - T); at most 0 where admissible.

    The first is the excess of the major compression over the strength at this confinement, the second that of tension.
    """
    s1, _, s3 = principal_stresses(xx, yy, zz, yz, xz, xy)
    return max(s1 - s3 - _room(s1, row), s1 - row[TENSILE_STRENGTH])


@njit(cache=True, error_model="numpy")
def _radius_at_failure(centre, row):
    """Radius of the Mohr circle about a centre that touches the curve, Pa, and u there; 0 beyond the apex."""
    _, _, u = _on_curve(centre, 0.0, 2.0, row)
    u = max(0.0, u)
    return 0.5 * row[SIGMA_CI] * u, u


@njit(cache=True, error_model="numpy")
def strength_factor(xx, yy, zz, yz, xz, xy, row):
    """Strength over stress: at least 1 where admissible, below 1 above strength, from 0 to STRENGTH_FACTOR_CAP.

    The radius of the Mohr circle of s1 and s3 that reaches strength, its centre unchanged, over the actual radius.
    """
    s1, _, s3 = principal_stresses(xx, yy, zz, yz, xz, xy)
    centre, radius = 0.5 * (s1 + s3), 0.5 * (s1 - s3)
    at_failure = min(_radius_at_failure(centre, row)[0], row[TENSILE_STRENGTH] - centre)
    if at_failure < radius and not _above(s1, s3, row):
        return 1.0  # round-off, as the return forgives it
    if at_failure >= STRENGTH_FACTOR_CAP * radius:
        return STRENGTH_FACTOR_CAP
    return max(0.0, at_failure / radius)


@njit(cache=True, error_model="numpy")
def excess_shear_stress(xx, yy, zz, yz, xz, xy, row):
    """Ryder's excess shear stress, Pa, over the tangent of the curve; negative below strength.

    The tangent is that Coulomb line which the curve has where the circle of strength_factor touches it: the difference
    of both radii over the cosine of its friction angle, counted up to 60 degrees. The cut-off does not enter.
    """
    s1, _, s3 = principal_stresses(xx, yy, zz, yz, xz, xy)
    at_failure, u = _radius_at_failure(0.5 * (s1 + s3), row)
    a = row[EXPONENT]
    steep = a * row[MB] * u ** (1.0 - 1.0 / a) if u > 0.0 else math.inf  # -h', of the curve in u
    friction = min(1.0 + steep, MAX_FRICTION_FACTOR)
    return (0.5 * (s1 - s3) - at_failure) * (friction + 1.0) / (2.0 * math.sqrt(friction))


@njit(cache=True, error_model="numpy", inline="always")
def strength_size(row):
    """Unconfined strength of the rock mass, Pa: what margins are in proportion to."""
    return row[UNCONFINED_STRENGTH]


@njit(cache=True, error_model="numpy", inline="always")
def gains_energy(row):
    """True if flow may gain energy: dilation above the tangent's friction without confinement."""
    s = row[APEX] * row[MB] / row[SIGMA_CI]
    return s > 0.0 and row[DILATION_FACTOR] > 1.0 + row[EXPONENT] * row[MB] * s ** (row[EXPONENT] - 1.0)
