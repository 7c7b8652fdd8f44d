"""Rows on the energy of a stage: what elastic mining releases by theory, and whether every balance closes."""

from collections.abc import Iterable

import numpy as np
import xarray as xr

from verification.rows import Row
from verification.sphere.closed_form import SphericalInclusion

CLOSED = 1e-6  # of the largest term: round-off


def sphere_rows(name: str, state: xr.Dataset, exact: SphericalInclusion, allowed: float) -> list[Row]:
    """What an eighth of a sphere, mined at once, releases (Salamon 1984, J. South. Afr. Inst. Min. Metall. 84, 233).

    With its rock goes V s0 : C^-1 : s0 / 2; half the work of the support, V s0 : e / 2 with the strain e of the wall
    (u = e x), is set in motion.
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
    """Largest share that any balance leaves over."""
    left = max(float(state.attrs["energy_left_share"]) for state in states)
    return Row(f"{name}: energy left over, share of the balance's largest term", 0.0, left, left, CLOSED)
