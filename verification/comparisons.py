"""Rows and measures that several studies share."""

from collections.abc import Iterable

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mpm_core.equilibrium.increments import potency
from verification.rows import Row

MAX_ENERGY_LEFT_SHARE = 1e-6  # Round-off of a balance, as a share of its largest term.


def vanishing(quantity: str, found: float, allowed: float | None = None, remark: str = "") -> Row:
    """Row of a quantity that must vanish: its error is its size."""
    return Row(quantity, 0.0, found, abs(found), allowed, remark)


def reported(quantity: str, found: float, remark: str = "", error: float = np.nan) -> Row:
    """Row of a quantity without theory and without a bound."""
    return Row(quantity, np.nan, found, error, None, remark)


def closing_row(name: str, states: Iterable[xr.Dataset]) -> Row:
    """Row of the largest share that any state's energy balance leaves over."""
    left = max(float(state.attrs["energy_left_share"]) for state in states)
    return vanishing(f"{name}: energy left over, share of the balance's largest term", left, MAX_ENERGY_LEFT_SHARE)


def truncated_row(name: str, states: Iterable[xr.Dataset]) -> Row:
    """Row of the largest share of rock above its strength that coarse cells keep from failing in any state."""
    held = max(float(state.attrs["truncated_share"]) for state in states)
    quantity = f"{name}: rock above strength that coarse cells keep from failing, largest share of what fails"
    return vanishing(quantity, held, 0.0)


def seismic_potency(state: xr.Dataset, chosen: NDArray) -> NDArray:
    """Seismic potency (particle,) m3 of chosen particles of a step."""
    return potency(state.seismic_strain.values[chosen], state.volume.values[chosen])


def failed_in_step(state: xr.Dataset) -> NDArray:
    """Whether each particle failed first in the step of this state, (particle,)."""
    return state.failed.values == state.attrs["step_index"]


def mean_square_root(error: ArrayLike, weights: NDArray | None = None) -> NDArray:
    """Root mean square along the last axis, weighted if weights are given."""
    return np.sqrt(np.average(np.square(error), axis=-1, weights=weights))
