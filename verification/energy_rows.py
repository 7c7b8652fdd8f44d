"""Rows on the energy of a stage: the energy that elastic mining releases, and what the balances leave over."""

from collections.abc import Iterable

import numpy as np
import xarray as xr

from verification.cavities.inclusion import SphericalInclusion
from verification.rows import Row

MAX_ENERGY_LEFT_SHARE = 1e-6  # Round-off of a balance, as a share of its largest term.


def sphere_rows(name: str, state: xr.Dataset, exact: SphericalInclusion, allowed: float) -> list[Row]:
    """Energy that an eighth of a sphere releases when mined at once, beside theory.

    The mined rock takes V s0 : C^-1 : s0 / 2 with it. Half the work of the support, V s0 : e / 2 with the strain e of
    the wall (u = e x), is set in motion (Salamon 1984, J. South. Afr. Inst. Min. Metall. 84, 233).
    """
    volume, virgin = np.pi / 6 * exact.radius**3, np.asarray(exact.virgin_stress)
    rock = exact.rock
    mean, deviator = np.trace(virgin) / 3, virgin - np.trace(virgin) / 3 * np.eye(3)
    mined = volume * (mean**2 / (2 * rock.bulk_modulus) + (deviator**2).sum() / (4 * rock.shear_modulus))
    motion = 0.5 * volume * float((virgin * exact.strain_inside).sum())
    found = {key: float(state.attrs[f"energy_{key}"]) / 1e6 for key in ("mined", "motion")}
    return [
        Row.relative(f"{name}: elastic energy of the mined rock, MJ", mined / 1e6, found["mined"], allowed),
        Row.relative(f"{name}: energy that mining at once sets in motion, MJ", motion / 1e6, found["motion"], allowed),
    ]


def closing_row(name: str, states: Iterable[xr.Dataset]) -> Row:
    """Row of the largest share that any state's energy balance leaves over."""
    left = max(float(state.attrs["energy_left_share"]) for state in states)
    return Row(f"{name}: energy left over, share of the balance's largest term", 0.0, left, left, MAX_ENERGY_LEFT_SHARE)
