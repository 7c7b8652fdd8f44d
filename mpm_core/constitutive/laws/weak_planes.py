"""Coulomb rock with planes of weakness of one orientation (ubiquitous joints): bedding, foliation, the rock of a fault.

Beside the rock's own Coulomb strength (coulomb_strength.py) the plane with unit normal n bears, with its traction's
normal part sn (tension positive) and shear part tau:

    |tau| <= c - sn tan phi    flow: slip along tau, opening tan psi of it        and    sn <= T    flow: opening

The planes have no place and no spacing: every point may slip. The return to the plane alone is closed-form in its axes:
with slip g (its part along n opens), stress loses lambda (g.n) I + G (n g + g n), so sn falls by (lambda + 2 G) (g.n)
and tau by G of the slip along it. Where both rock and plane act, by Koiter's rule stress is the return to each of what
the other leaves of the trial:

    t = R_rock(trial - C : plane(g)),    g = slip of R_plane(t + C : plane(g))

Both in turn are a block Gauss-Seidel iteration (for associated flow the cyclic projections of Boyle & Dykstra 1986,
Adv. in Order Restricted Statist. Inference, 28; multisurface plasticity: Simo, Kennedy & Govindjee 1988, Int. J. Numer.
Meth. Eng. 26, 2161). As equations for the three parts of g alone they are solved by Newton's method, with the slopes of
both returns by differences, and by a step in turn wherever Newton's is no better. What then is above strength by
round-off is returned once more to each. The return is unique for associated flow; without dilation rock that is torn
apart may have several, of which this is one.

One flag says that rock has failed: what fails on its planes has the residual strength of both from then on. In a fault,
whose slip alone is meant, give the rock between its planes the same strength intact and residual.
"""

import math
from typing import Annotated, Literal, Self

import numpy as np
from numba import njit
from pydantic import model_validator

from common.setting_types import Settings, Unit, choose, is_section, refusal
from mpm_core.constitutive.coulomb_strength import DILATION_FACTOR, FRICTION_FACTOR, UNCONFINED_STRENGTH
from mpm_core.constitutive.elastic import ADMISSIBLE_ROUND_OFF, ELASTIC, STRENGTH_FACTOR_CAP
from mpm_core.constitutive.general import lane_by_lane, tangent_by_differences
from mpm_core.constitutive.laws import coulomb
from mpm_core.settings import AnglePair, StrengthPair

NAME = "weak_planes"
ROCK_LENGTH = coulomb.ROW_LENGTH
ROW_LENGTH = ROCK_LENGTH + 8
NX, NY, NZ, COHESION, FRICTION, DILATION, TENSION, CORNER = range(ROCK_LENGTH, ROW_LENGTH)
SLIP, OPENING, BOTH = range(5, 8)
"""where a return ended, beside the regions of the rock alone: on the plane in shear, in tension, on plane and rock"""
# Rounds between rock and planes that one return may take. Rock and planes that hardly bear anything need many.
MAX_ROUNDS = 1000
# Returns to rock and plane that may follow, for stress that round-off leaves above strength; and repeats of all that.
MAX_RETURNS = 8
TRACTION_TOLERANCE = 1e-14  # Rounds end when the traction changes by at most this share of the stress.
SLIP_DIFFERENCE_STEP = 1e-7  # Difference of stress between two returns for the slope of slip, as a share of the stress.


class Planes(Settings):
    """Planes of weakness of one orientation, with a strength of their own."""

    dip: Annotated[float, Unit("deg", ge=0, le=90)]
    """Dip of the planes, measured from horizontal."""
    dip_direction: Annotated[float, Unit("deg", ge=0, le=360)]
    """Direction in which the planes dip most steeply, clockwise from the map's north."""
    friction_angle: AnglePair
    """Friction angle of intact and of failed planes."""
    dilation_angle: AnglePair
    """Dilation angle of intact and of failed planes."""
    cohesion: StrengthPair
    """Cohesion of intact and of failed planes."""
    tension_cutoff: choose(is_section, StrengthPair, Literal["none"])
    """Tensile strength of intact and of failed planes, or `none`."""

    @property
    def normal(self) -> np.ndarray:
        """Unit normal that points up, (3,) in the mine's frame: x east, y north, z up."""
        dip, direction = math.radians(self.dip), math.radians(self.dip_direction)
        return np.array([math.sin(dip) * math.sin(direction), math.sin(dip) * math.cos(direction), math.cos(dip)])

    @model_validator(mode="after")
    def _gain_nothing_by_slipping(self) -> Self:
        intact, residual = (plane_row(self, state) for state in ("intact", "residual"))
        cohesion, friction, _, tension, _ = range(5)
        for index, key in ((friction, "friction_angle"), (cohesion, "cohesion"), (tension, "tension_cutoff")):
            if residual[index] > intact[index] * (1.0 + 1e-12):
                raise refusal("residual is above intact; a plane gains no strength by slipping", key)
        at = residual[tension] if math.isfinite(residual[tension]) else 0.0
        if residual[cohesion] - at * residual[friction] > (intact[cohesion] - at * intact[friction]) * (1.0 + 1e-12):
            raise refusal("residual planes are stronger than intact ones in tension; lower their residual cohesion")
        return self


class Material(coulomb.Material):
    """Coulomb rock with weak planes of one orientation: bedding, foliation, and in a rock body a fault."""

    model: Literal["weak_planes"]
    planes: Planes

    @model_validator(mode="after")
    def _planes_gain_no_energy(self) -> Self:
        for state in ("intact", "residual"):
            friction = getattr(self.planes.friction_angle, state)
            dilation = getattr(self.planes.dilation_angle, state)
            if dilation > friction and not self.allow_psi_above_phi:
                raise refusal(
                    f"{dilation:g} deg is above the friction angle {friction:g} deg, which creates energy; set "
                    "allow_psi_above_phi: true if that is meant",
                    "planes",
                    "dilation_angle",
                    state,
                )
        return self


def plane_row(planes: Planes, state: str) -> np.ndarray:
    """Cohesion Pa, tan phi, tan psi, tensile strength and shear strength at that (5,) of "intact" or "residual" planes.

    A cut-off above c / tan phi never acts and is lowered to it.
    """
    cohesion = getattr(planes.cohesion, state)
    friction = math.tan(math.radians(getattr(planes.friction_angle, state)))
    dilation = math.tan(math.radians(getattr(planes.dilation_angle, state)))
    apex = cohesion / friction if friction > 0.0 else math.inf
    cutoff = apex if planes.tension_cutoff == "none" else min(getattr(planes.tension_cutoff, state), apex)
    corner = max(0.0, cohesion - friction * cutoff) if friction > 0.0 else cohesion
    return np.array([cohesion, friction, dilation, cutoff, corner])


def strength_rows(material: Material, axes: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Intact and residual strength row; axes: axis of the mine's frame along each axis of the computation."""
    normal = material.planes.normal[list(axes)]
    rock = coulomb.strength_rows(material, axes)
    intact, residual = (
        np.concatenate([row, normal, plane_row(material.planes, state)])
        for row, state in zip(rock, ("intact", "residual"), strict=True)
    )
    return intact, residual


def plane_normal(material: Material) -> np.ndarray:
    """Unit normal (3,) of the planes in the mine's frame."""
    return material.planes.normal


def overstress_of_tensor(tensor: np.ndarray, row: np.ndarray) -> float:
    """`overstress` of a stress (3, 3) Pa, by numpy."""
    normal = row[[NX, NY, NZ]]
    traction = tensor @ normal
    across = traction @ normal
    shear = np.linalg.norm(traction - across * normal)
    of_plane = max(shear + row[FRICTION] * across - row[COHESION], across - row[TENSION])
    return max(of_plane, coulomb.overstress_of_tensor(tensor, row[:ROCK_LENGTH]))


@njit(cache=True, error_model="numpy", inline="always")
def _rock(row):
    """Strength row of the rock without its planes."""
    return row[0], row[1], row[2], row[3], row[4]


@njit(cache=True, error_model="numpy", inline="always")
def _size(xx, yy, zz, yz, xz, xy):
    return max(abs(xx), abs(yy), abs(zz), abs(yz), abs(xz), abs(xy))


@njit(cache=True, error_model="numpy", inline="always")
def _on_plane(xx, yy, zz, yz, xz, xy, row):
    """Traction on the plane, Pa: normal part, size of its shear part, and that part's direction x, y, z (0 without)."""
    nx, ny, nz = row[NX], row[NY], row[NZ]
    tx, ty, tz = xx * nx + xy * ny + xz * nz, xy * nx + yy * ny + yz * nz, xz * nx + yz * ny + zz * nz
    normal = tx * nx + ty * ny + tz * nz
    tx, ty, tz = tx - normal * nx, ty - normal * ny, tz - normal * nz
    shear = math.sqrt(tx * tx + ty * ty + tz * tz)
    scale = 1.0 / shear if shear > 0.0 else 0.0
    return normal, shear, tx * scale, ty * scale, tz * scale


@njit(cache=True, error_model="numpy", inline="always")
def _plane_stands(xx, yy, zz, yz, xz, xy, row):
    """True if the plane is not above its strength by more than round-off of the stress."""
    normal, shear, _, _, _ = _on_plane(xx, yy, zz, yz, xz, xy, row)
    size = ADMISSIBLE_ROUND_OFF * _size(xx, yy, zz, yz, xz, xy)
    slips = shear + row[FRICTION] * normal - row[COHESION] > (1.0 + row[FRICTION]) * size
    return not slips and normal - row[TENSION] <= size


@njit(cache=True, error_model="numpy", inline="always")
def _rock_stands(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row):
    """True if the rock without its planes is not above its strength by more than round-off."""
    return coulomb.return_to_surface(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, _rock(row))[6] == ELASTIC


@njit(cache=True, error_model="numpy", inline="always")
def _slip(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row):
    """Slip g that returns a trial stress to the plane's strength, times G: (x, y, z) Pa, and where it ends.

    Shear alone, if that satisfies the cut-off; else tension alone, if that satisfies the shear strength; else both.
    """
    normal, shear, sx, sy, sz = _on_plane(xx, yy, zz, yz, xz, xy, row)
    stiff = (lame_lambda + 2.0 * shear_modulus) / shear_modulus
    excess = shear + row[FRICTION] * normal - row[COHESION]
    opening, along, where = 0.0, 0.0, ELASTIC
    if excess > 0.0:
        along = excess / (1.0 + stiff * row[FRICTION] * row[DILATION])
        opening, where = along * row[DILATION], SLIP
    if normal - stiff * opening > row[TENSION]:
        opening, along, where = (normal - row[TENSION]) / stiff, max(0.0, shear - row[CORNER]), OPENING
    return (
        opening * row[NX] + along * sx,
        opening * row[NY] + along * sy,
        opening * row[NZ] + along * sz,
        where,
    )


@njit(cache=True, error_model="numpy", inline="always")
def _relieved(xx, yy, zz, yz, xz, xy, gx, gy, gz, lame_lambda, shear_modulus, row):
    """Stress less what it loses by slip g (times G, Pa): lambda (g.n) I + G (n g + g n)."""
    nx, ny, nz = row[NX], row[NY], row[NZ]
    all_round = lame_lambda / shear_modulus * (gx * nx + gy * ny + gz * nz)
    return (
        xx - all_round - 2.0 * nx * gx,
        yy - all_round - 2.0 * ny * gy,
        zz - all_round - 2.0 * nz * gz,
        yz - ny * gz - nz * gy,
        xz - nx * gz - nz * gx,
        xy - nx * gy - ny * gx,
    )


@njit(cache=True, error_model="numpy")
def _next_slip(xx, yy, zz, yz, xz, xy, gx, gy, gz, lame_lambda, shear_modulus, row):
    """Slip of the plane where the rock has taken its part next to slip g of the plane; both times G, Pa."""
    txx, tyy, tzz, tyz, txz, txy = _relieved(xx, yy, zz, yz, xz, xy, gx, gy, gz, lame_lambda, shear_modulus, row)
    txx, tyy, tzz, tyz, txz, txy, _ = coulomb.return_to_surface(
        txx, tyy, tzz, tyz, txz, txy, lame_lambda, shear_modulus, _rock(row)
    )
    txx, tyy, tzz, tyz, txz, txy = _relieved(
        txx, tyy, tzz, tyz, txz, txy, -gx, -gy, -gz, lame_lambda, shear_modulus, row
    )
    px, py, pz, _ = _slip(txx, tyy, tzz, tyz, txz, txy, lame_lambda, shear_modulus, row)
    return px, py, pz


@njit(cache=True, error_model="numpy", inline="always")
def _solved(a, b, c, r):
    """x with a x0 + b x1 + c x2 = r, of three columns and the right side, by Cramer's rule."""
    bc = (b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0])
    rc = (r[1] * c[2] - r[2] * c[1], r[2] * c[0] - r[0] * c[2], r[0] * c[1] - r[1] * c[0])
    br = (b[1] * r[2] - b[2] * r[1], b[2] * r[0] - b[0] * r[2], b[0] * r[1] - b[1] * r[0])
    determinant = a[0] * bc[0] + a[1] * bc[1] + a[2] * bc[2]
    scale = 1.0 / determinant if determinant != 0.0 else 0.0
    return (
        (r[0] * bc[0] + r[1] * bc[1] + r[2] * bc[2]) * scale,
        (a[0] * rc[0] + a[1] * rc[1] + a[2] * rc[2]) * scale,
        (a[0] * br[0] + a[1] * br[1] + a[2] * br[2]) * scale,
    )


@njit(cache=True, error_model="numpy")
def _slip_with_rock(xx, yy, zz, yz, xz, xy, gx, gy, gz, lame_lambda, shear_modulus, row):
    """Slip of the plane where rock and plane both act (times G, Pa), from a first guess g."""
    size = _size(xx, yy, zz, yz, xz, xy)
    step = SLIP_DIFFERENCE_STEP * size
    px, py, pz = _next_slip(xx, yy, zz, yz, xz, xy, gx, gy, gz, lame_lambda, shear_modulus, row)
    for _ in range(MAX_ROUNDS):
        rest = (px - gx, py - gy, pz - gz)
        left = max(abs(rest[0]), abs(rest[1]), abs(rest[2]))
        if left <= TRACTION_TOLERANCE * size:
            break
        ax, ay, az = _next_slip(xx, yy, zz, yz, xz, xy, gx + step, gy, gz, lame_lambda, shear_modulus, row)
        bx, by, bz = _next_slip(xx, yy, zz, yz, xz, xy, gx, gy + step, gz, lame_lambda, shear_modulus, row)
        cx, cy, cz = _next_slip(xx, yy, zz, yz, xz, xy, gx, gy, gz + step, lame_lambda, shear_modulus, row)
        dx, dy, dz = _solved(
            (1.0 - (ax - px) / step, -(ay - py) / step, -(az - pz) / step),
            (-(bx - px) / step, 1.0 - (by - py) / step, -(bz - pz) / step),
            (-(cx - px) / step, -(cy - py) / step, 1.0 - (cz - pz) / step),
            rest,
        )
        nx, ny, nz = gx + dx, gy + dy, gz + dz
        qx, qy, qz = _next_slip(xx, yy, zz, yz, xz, xy, nx, ny, nz, lame_lambda, shear_modulus, row)
        if not max(abs(qx - nx), abs(qy - ny), abs(qz - nz)) < left:  # a step in turn instead
            nx, ny, nz = px, py, pz
            qx, qy, qz = _next_slip(xx, yy, zz, yz, xz, xy, nx, ny, nz, lame_lambda, shear_modulus, row)
        gx, gy, gz, px, py, pz = nx, ny, nz, qx, qy, qz
    return px, py, pz


@njit(cache=True, error_model="numpy")
def _return_once(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row):
    """`return_to_surface` to round-off of the trial stress, which may be much for the stress that is left."""
    rock = _rock(row)
    txx, tyy, tzz, tyz, txz, txy, region = coulomb.return_to_surface(
        xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, rock
    )
    if _plane_stands(txx, tyy, tzz, tyz, txz, txy, row):
        return txx, tyy, tzz, tyz, txz, txy, region
    gx, gy, gz, where = _slip(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row)
    txx, tyy, tzz, tyz, txz, txy = _relieved(xx, yy, zz, yz, xz, xy, gx, gy, gz, lame_lambda, shear_modulus, row)
    if region == ELASTIC or _rock_stands(txx, tyy, tzz, tyz, txz, txy, lame_lambda, shear_modulus, row):
        region = where
    if region != where:
        region = BOTH
        gx, gy, gz = _slip_with_rock(xx, yy, zz, yz, xz, xy, gx, gy, gz, lame_lambda, shear_modulus, row)
        txx, tyy, tzz, tyz, txz, txy = _relieved(xx, yy, zz, yz, xz, xy, gx, gy, gz, lame_lambda, shear_modulus, row)
    for _ in range(MAX_RETURNS):
        txx, tyy, tzz, tyz, txz, txy, more = coulomb.return_to_surface(
            txx, tyy, tzz, tyz, txz, txy, lame_lambda, shear_modulus, rock
        )
        if more != ELASTIC and region != BOTH:
            region = BOTH
        if _plane_stands(txx, tyy, tzz, tyz, txz, txy, row):
            break
        gx, gy, gz, _ = _slip(txx, tyy, tzz, tyz, txz, txy, lame_lambda, shear_modulus, row)
        txx, tyy, tzz, tyz, txz, txy = _relieved(
            txx, tyy, tzz, tyz, txz, txy, gx, gy, gz, lame_lambda, shear_modulus, row
        )
    return txx, tyy, tzz, tyz, txz, txy, region


@njit(cache=True, error_model="numpy")
def return_to_surface(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row):
    """Plastic return of an elastic trial stress: (xx, yy, zz, yz, xz, xy, region), Pa: rock, plane, or both.

    The rock's return alone, if the plane bears it; else the plane's alone, if the rock bears that; else both act. An
    admissible stress comes back bit for bit with region ELASTIC; so does a returned one.
    """
    txx, tyy, tzz, tyz, txz, txy, region = _return_once(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row)
    if region == ELASTIC:
        return txx, tyy, tzz, tyz, txz, txy, region
    for _ in range(MAX_RETURNS):
        txx, tyy, tzz, tyz, txz, txy, more = _return_once(txx, tyy, tzz, tyz, txz, txy, lame_lambda, shear_modulus, row)
        if more == ELASTIC:
            break
        if more != region:
            region = BOTH
    return txx, tyy, tzz, tyz, txz, txy, region


return_lanes = lane_by_lane(return_to_surface)
stiffness_reduction = tangent_by_differences(return_to_surface)


@njit(cache=True, error_model="numpy", inline="always")
def surely_admissible(xx, yy, zz, yz, xz, xy, row):
    """True if a bound on the rock and the plane's own strength prove a stress admissible (False: it may be)."""
    normal, shear, _, _, _ = _on_plane(xx, yy, zz, yz, xz, xy, row)
    stands = shear + row[FRICTION] * normal <= row[COHESION] and normal <= row[TENSION]
    return stands and coulomb.surely_admissible(xx, yy, zz, yz, xz, xy, _rock(row))


@njit(cache=True, error_model="numpy")
def overstress(xx, yy, zz, yz, xz, xy, row):
    """Overstress, Pa: the larger of the rock's and the plane's; at most 0 where admissible.

    Of the plane: max(|tau| + sn tan phi - c, sn - T).
    """
    normal, shear, _, _, _ = _on_plane(xx, yy, zz, yz, xz, xy, row)
    of_plane = max(shear + row[FRICTION] * normal - row[COHESION], normal - row[TENSION])
    return max(of_plane, coulomb.overstress(xx, yy, zz, yz, xz, xy, _rock(row)))


@njit(cache=True, error_model="numpy")
def strength_factor(xx, yy, zz, yz, xz, xy, row):
    """Strength over stress, the smaller of the rock's and the plane's: at least 1 where admissible, up to the cap.

    Of the plane: its shear strength over shear stress, and in tension tensile strength over normal stress.
    """
    factor = coulomb.strength_factor(xx, yy, zz, yz, xz, xy, _rock(row))
    normal, shear, _, _, _ = _on_plane(xx, yy, zz, yz, xz, xy, row)
    strength = max(0.0, row[COHESION] - row[FRICTION] * normal)
    of_plane = STRENGTH_FACTOR_CAP
    if strength < STRENGTH_FACTOR_CAP * shear:
        of_plane = strength / shear
    if normal > 0.0 and row[TENSION] < STRENGTH_FACTOR_CAP * normal:
        of_plane = min(of_plane, row[TENSION] / normal)
    if of_plane < 1.0 and _plane_stands(xx, yy, zz, yz, xz, xy, row):
        of_plane = 1.0  # round-off, as the return forgives it
    return min(factor, of_plane)


@njit(cache=True, error_model="numpy")
def excess_shear_stress(xx, yy, zz, yz, xz, xy, row):
    """Ryder's excess shear stress, Pa: the larger of the rock's and that on the plane, |tau| - (c - sn tan phi)."""
    normal, shear, _, _, _ = _on_plane(xx, yy, zz, yz, xz, xy, row)
    of_rock = coulomb.excess_shear_stress(xx, yy, zz, yz, xz, xy, _rock(row))
    return max(of_rock, shear + row[FRICTION] * normal - row[COHESION])


@njit(cache=True, error_model="numpy", inline="always")
def strength_size(row):
    """Unconfined strength of the rock, Pa: what margins are in proportion to."""
    return row[UNCONFINED_STRENGTH]


@njit(cache=True, error_model="numpy", inline="always")
def gains_energy(row):
    """True if flow may gain energy: dilation above friction, of the rock or its planes."""
    return row[DILATION_FACTOR] > row[FRICTION_FACTOR] or row[DILATION] > row[FRICTION]
