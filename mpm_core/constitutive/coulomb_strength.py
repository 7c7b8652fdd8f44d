"""The strength of Coulomb rock: a cone with a tension cut-off, as one row of numbers, and what is checked about it.

A strength row is float64 (ROW_LENGTH,):

| column              | meaning                                                                             | unit |
|---------------------|-------------------------------------------------------------------------------------|------|
| FRICTION_FACTOR     | N_phi = (1 + sin phi) / (1 - sin phi); 1 without friction                           | 1    |
| DILATION_FACTOR     | N_psi, the same of the dilation angle                                               | 1    |
| UNCONFINED_STRENGTH | sigma_c = 2 c cos phi / (1 - sin phi), uniaxial compressive strength                | Pa   |
| TENSILE_STRENGTH    | T: the cut-off, at most the apex; inf where neither exists (no friction, no cut-off) | Pa   |
| APEX                | c / tan phi, hydrostatic tension at the tip of the cone; inf without friction       | Pa   |

Kernels take a row as an array or as a tuple; in parallel loops take the tuple from `general.strength_of`. numba takes
the columns as constants.

Stress is admissible where N_phi s1 - s3 <= sigma_c and s1 <= T, with s1 >= s2 >= s3 and tension positive.
"""

import math

import numpy as np

from common.errors import InputError

FRICTION_FACTOR, DILATION_FACTOR, UNCONFINED_STRENGTH, TENSILE_STRENGTH, APEX = range(5)
ROW_LENGTH = 5
MAX_ANGLE = 89.9  # degrees; (1 + sin) / (1 - sin) grows without a limit towards 90

STRENGTH_ROUND_OFF = 1e-12  # Strengths that differ by at most this share count as equal.


def strength_row(
    friction_angle: float, dilation_angle: float, cohesion: float, tension_cutoff: float | None = None
) -> np.ndarray:
    """Strength row of these parameters: angles in degrees, cohesion and cut-off in Pa, no cut-off as None.

    A cut-off above the apex c / tan phi never acts and is lowered to it. Raises InputError for angles outside
    0 <= angle < 90 degrees and for negative or infinite cohesion or cut-off.

    >>> row = strength_row(friction_angle=30, dilation_angle=10, cohesion=5e6, tension_cutoff=1e6)
    >>> print(f"N_phi {row[FRICTION_FACTOR]:.2f}, sigma_c {row[UNCONFINED_STRENGTH] / 1e6:.2f} MPa")
    N_phi 3.00, sigma_c 17.32 MPa
    """
    for name, angle in (("friction_angle", friction_angle), ("dilation_angle", dilation_angle)):
        if not 0.0 <= angle <= MAX_ANGLE:
            raise InputError(f"{name}: {angle} degrees: must be from 0 to {MAX_ANGLE:g}")
    for name, strength in (("cohesion", cohesion), ("tension_cutoff", tension_cutoff)):
        if strength is not None and not (math.isfinite(strength) and strength >= 0.0):
            raise InputError(f"{name}: {strength} Pa: must be zero or positive, and finite")
    friction, dilation = math.radians(friction_angle), math.radians(dilation_angle)
    apex = cohesion / math.tan(friction) if friction > 0.0 else math.inf
    row = np.empty(ROW_LENGTH)
    row[FRICTION_FACTOR] = (1.0 + math.sin(friction)) / (1.0 - math.sin(friction))
    row[DILATION_FACTOR] = (1.0 + math.sin(dilation)) / (1.0 - math.sin(dilation))
    row[UNCONFINED_STRENGTH] = 2.0 * cohesion * math.cos(friction) / (1.0 - math.sin(friction))
    row[TENSILE_STRENGTH] = apex if tension_cutoff is None else min(tension_cutoff, apex)
    row[APEX] = apex
    return row


def residual_outside_intact(intact: np.ndarray, residual: np.ndarray) -> str:
    """Why the residual strength surface leaves the intact one somewhere, as one line; empty where it does not.

    The residual surface must lie inside for every stress: a brittle drop from the one to the other would gain strength
    there. N_i s1 - s3 is largest on the residual surface, where s3 = N_r s1 - sigma_r; it is then
    (N_i - N_r) s1 + sigma_r, bounded in compression only if N_i >= N_r, and largest at s1 = T_r.
    """
    n_intact, _, c_intact, t_intact, _ = (float(value) for value in intact)
    n_residual, _, c_residual, t_residual, _ = (float(value) for value in residual)
    if n_residual > n_intact * (1.0 + STRENGTH_ROUND_OFF):
        return (
            "residual friction_angle is above the intact one: residual rock would be the stronger at high confinement"
        )
    if t_residual > t_intact * (1.0 + STRENGTH_ROUND_OFF):
        limits = f"{t_residual:.6g} Pa above {t_intact:.6g} Pa"
        return f"residual tensile strength (cut-off or apex c / tan phi) is above the intact one: {limits}"
    slope = max(0.0, n_intact - n_residual)
    if slope <= n_intact * STRENGTH_ROUND_OFF:
        slope = 0.0
    if slope > 0.0 and math.isinf(t_residual):
        return "residual rock has neither friction nor tension_cutoff: in tension it would be stronger than intact rock"
    needed = c_residual + (slope * t_residual if slope > 0.0 else 0.0)
    if needed > c_intact * (1.0 + STRENGTH_ROUND_OFF):
        strengths = f"{needed:.6g} Pa needed, {c_intact:.6g} Pa given"
        return (
            "residual rock is stronger than intact rock at its own tensile strength: lower the residual cohesion or "
            f"tension_cutoff, or raise the intact cohesion (intact unconfined strength: {strengths})"
        )
    return ""
