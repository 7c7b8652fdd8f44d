"""Balances of mass, momentum and energy of every state that a run stores. The stages record them."""

import json

import numpy as np
import xarray as xr

from mpm_core.files.state_datasets import read_edge_nodes, read_pieces
from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid.distorted_cells import distorted_shapes, sample_volumes
from mpm_core.model.occupancy import MIN_SAMPLES_KEPT
from verification.comparisons import MAX_ENERGY_LEFT_SHARE
from verification.extremes.outcomes import Outcome
from verification.scenes import value_of

MAX_MASS_ERROR = 1e-9  # Share of the mass. Sums of volumes in another order differ by round-off.
MAX_MOMENTUM_ERROR = 1e-9  # Share of the forces between cells, whose sum vanishes but for round-off.
MAX_ENERGY_GAINED_SHARE = 1e-9  # Round-off of energy gained or dissipated, as a share of the largest term.
NO_TERMS = {
    *("energy_balance", "energy_left", "energy_left_share", "energy_elastic", "energy_round_off"),
    "energy_refined",  # It is recorded, but is no term of the balance.
}


def broken(values: dict, outcome: Outcome) -> list[str]:
    """One line for each quantity that is not conserved; none for a sound run."""
    found, largest = [], 0.0
    for name, state in outcome.states.items():
        found += [f"{name}: {fault}" for fault in (*_mass(values, outcome.stored["grid"], state), *_momentum(state))]
        largest = max(largest, *_sizes(state))
        found += [f"{name}: {fault}" for fault in _gained(values, state, largest)]
    return found


def lacking(outcome: Outcome) -> tuple[float, str]:
    """The largest energy that a balance leaves over, as a share of its largest term, and a line where it is too much.

    The work of the forces that an equilibrium leaves unbalanced is one of the terms.
    """
    worst, line, largest = 0.0, "", 0.0
    for name, state in outcome.states.items():
        largest = max(largest, *_sizes(state))
        happened = largest > float(state.attrs["energy_round_off"])
        share = abs(float(state.attrs["energy_left"])) / largest if happened else 0.0
        if share > worst:  # NaN where particles move
            worst = share
            if share > MAX_ENERGY_LEFT_SHARE:
                line = f"{name}: the energy balance lacks {share:.2g} of its largest term"
    return worst, line


def _mass(values: dict, grid: xr.Dataset, state: xr.Dataset):
    """Yield a line where a volume is negative, mass is not density times volume, or volumes do not fill the domain."""
    volume, attributes = state.volume.values, state.attrs
    if (volume < 0.0).any():
        yield f"{(volume < 0.0).sum()} particles of negative volume"
    names = json.loads(attributes["material_names"])
    density = np.array([value_of(values["materials"][name]["density"]) for name in names])
    mass = float(np.sum(volume * density[state.material.values]))
    if not abs(attributes["mass"] - mass) <= MAX_MASS_ERROR * mass:
        yield f"mass {attributes['mass']:.10g} kg, its particles {mass:.10g} kg"
    plain = not state.sizes["loose"] and all(entry.get("fill", "none") == "none" for entry in values["excavations"])
    if not plain or len(state.cell_level) != len(grid.cell_level):
        return  # Falling pieces, fill and split cells assign shares of cells again.
    sides = np.asarray(grid.attrs["domain_upper"]) - np.asarray(grid.attrs["domain_lower"])
    domain = float(np.prod(sides[sides > 0.0])) * float(attributes["thickness"])
    order = [step["name"] for step in values["steps"]]
    gone, cut = _gone(grid, [order.index(entry["step"]) <= attributes["step_index"] for entry in values["excavations"]])
    there = float(volume.sum())
    if not -MAX_MASS_ERROR * domain <= domain - gone - there <= cut + MAX_MASS_ERROR * domain:
        yield f"{there:.10g} m3 are there, {domain - gone:.10g} m3 should be"


def _gone(grid: xr.Dataset, mined: list[bool]) -> tuple[float, float]:
    """Volume, m3, that excavations take of finest cells, each sample once, and that of slivers they may also take."""
    pieces = read_pieces(grid)
    chosen = np.flatnonzero(np.asarray(mined)[pieces.excavation])
    places, cell = np.unique(pieces.place[chosen], axis=0, return_inverse=True)
    samples = np.zeros(cell.max(initial=-1) + 1, np.uint64)
    np.bitwise_or.at(samples, cell.reshape(-1), pieces.samples[chosen])
    cube = float(grid.attrs["fine_cell"]) ** grid.attrs["dimension"] * float(grid.attrs["thickness"])
    of_samples = np.full((len(samples), SAMPLES_PER_CELL), 1.0 / SAMPLES_PER_CELL)
    nodes = read_edge_nodes(grid)
    for place, corners in zip(*distorted_shapes(nodes.place, nodes.shift), strict=True):
        of_samples[(places == place).all(axis=1)] = sample_volumes(corners[None])
    held = (samples[:, None] >> np.arange(SAMPLES_PER_CELL, dtype=np.uint64)) & np.uint64(1)
    slivers = np.bitwise_count(samples) < SAMPLES_PER_CELL
    largest = of_samples.max(initial=0.0) * cube
    return float((of_samples * held).sum()) * cube, float(slivers.sum()) * (MIN_SAMPLES_KEPT - 1) * largest


def _momentum(state: xr.Dataset):
    error = float(state.attrs["momentum_error"])
    if error > MAX_MOMENTUM_ERROR:  # NaN where particles move
        yield f"forces between cells leave {error:.2g} of themselves over"


def _sizes(state: xr.Dataset) -> list[float]:
    """Sizes of the terms of the energy balance, J, without those that are NaN."""
    terms = [abs(float(value)) for key, value in state.attrs.items() if _is_term(key)]
    return [term for term in terms if np.isfinite(term)] or [0.0]


def _is_term(key: str) -> bool:
    return key.startswith("energy_") and key not in NO_TERMS


def _gained(values: dict, state: xr.Dataset, largest: float):
    """Yield a line where energy is gained although no rock dilates above its friction, or failure dissipates none."""
    gained, dissipated = (float(state.attrs[f"energy_{name}"]) for name in ("gained", "dissipated"))
    if gained > MAX_ENERGY_GAINED_SHARE * largest and not any(
        rock.get("allow_psi_above_phi") for rock in values["materials"].values()
    ):
        yield f"{gained:.3g} J gained"
    if dissipated < -MAX_ENERGY_GAINED_SHARE * largest:
        yield f"{dissipated:.3g} J dissipated"
