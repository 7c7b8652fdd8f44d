"""Rows and measures that several studies share."""

from collections.abc import Iterable

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mpm_core.equilibrium.increments import potency
from verification.rows import Row

MPA = 1e-6  # MPa in a Pa.
VOIGT_MULTIPLICITY = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # Of each component in a sum over the tensor.
MIN_UNCUT_SHARE = 0.999  # Share of rock from which a cell counts as uncut.
MAX_ENERGY_LEFT_SHARE = 1e-6  # Round-off of a balance, as a share of its largest term.


def vanishing(quantity: str, found: float, allowed: float | None = None, remark: str = "") -> Row:
    """Row of a quantity that must vanish: its error is its size."""
    return Row(quantity, 0.0, found, abs(found), allowed, remark)


def reported(quantity: str, found: float, remark: str = "", error: float = np.nan) -> Row:
    """Row of a quantity without theory and without a bound."""
    return Row(quantity, np.nan, found, error, None, remark)


def bounded(quantity: str, found: float, allowed: float, remark: str = "") -> Row:
    """Row of a quantity without theory that must not exceed its bound: its error is the quantity itself."""
    return Row(quantity, np.nan, found, found, allowed, remark)


def reaching(quantity: str, expected: float, found: float, least: float, allowed: float = 0.0, remark: str = "") -> Row:
    """Row of a share whose error is what it lacks of `least`. The expected share may be larger."""
    return Row(quantity, expected, found, float(np.maximum(0.0, least - found)), allowed, remark)


def monte_carlo_error(share: float, draws: float) -> float:
    """Standard error of a share that is found from so many independent draws (binomial)."""
    return (share * (1.0 - share) / draws) ** 0.5


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
    """Particles (particle,) bool that first failed in the step of this state."""
    return state.failed.values == state.attrs["step_index"]


def released_potency(state: xr.Dataset) -> float:
    """Seismic potency, m3, of the rock that failed first in the step of this state."""
    return float(seismic_potency(state, failed_in_step(state)).sum())


def in_uncut_cell(cell: NDArray, volume: NDArray, whole: NDArray | float) -> NDArray:
    """Particles (particle,) bool in cells full of rock.

    cell (particle,): index of the particle's cell; volume (particle,): its volume, m3; whole: its cell's volume, m3.
    """
    return np.bincount(cell, volume)[cell] > MIN_UNCUT_SHARE * whole


def convergence_orders(sizes: ArrayLike, errors: ArrayLike) -> list[float]:
    """Orders of convergence between neighbouring runs: logarithm of the errors' ratio over that of the cells' sizes."""
    h, error = np.asarray(sizes, float), np.asarray(errors, float)
    return (np.log(error[:-1] / error[1:]) / np.log(h[:-1] / h[1:])).tolist()


def mean_square_root(error: ArrayLike, weights: NDArray | None = None) -> NDArray:
    """Root mean square along the last axis, weighted if weights are given."""
    return np.sqrt(np.average(np.square(error), axis=-1, weights=weights))


def tensor_error(error: NDArray, weights: NDArray) -> float:
    """Root mean square over particles and six components of an error of stress (particle, 3, 3), weighted.

    A shear component stands twice in a tensor and counts as often.
    """
    return float(np.sqrt(np.average(np.square(error).sum(axis=(1, 2)) / 6, weights=weights)))
