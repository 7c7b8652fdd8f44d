"""Energy that mining releases, and where: in the rock that a step mines, and through the walls that it makes.

What mining makes available is W + U_m - dU (Salamon 1984, J. South. Afr. Inst. Min. Metall. 84, 233): work of far
stresses and weight, strain energy of the rock that is mined, less what the rock that stays stores more. It ends in
plastic work, motion and heat. U_m is the integral of s : C^-1 : s / 2 over what a step mines, s before the step. The
rest passes through the walls: the rock that was mined pushed against them with the traction s n, which is gone, while
they moved by du; in elastic rock that is the integral of s n . du / 2 over the walls, whatever mines them.

The rest of a step is that of its energy balance (mpm_core/equilibrium/energy_balance.py). The integral over the walls
of each excavation is what it is distributed by, and what the loading stiffness follows from.
"""

import json
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from common.voigt import tensor_from_voigt
from mpm_core.scene.scene import InsituStress
from response.field import fitted_stress
from response.rock import FAILED, INTACT, Rock, Voids
from response.wall_rays import STEP, wall_displacement
from response.walls import Walls

MULTIPLICITY = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # Of each component in a contraction of tensors.
STRAINS = ("seismic_strain", "overshoot_strain", "later_strain")
VARIABLES = {*STRAINS, "material"}
"""Variables of a state that this module reads beside those of Rock."""


def strain_energy_density(stress: NDArray, lame: NDArray, shear: NDArray) -> NDArray:
    """Elastic energy s : C^-1 : s / 2 (n,) J/m3 of stresses (n, 6) Pa; lame, shear (n,) Pa."""
    mean = stress[:, :3].mean(axis=1)
    deviator = (stress**2) @ MULTIPLICITY - 3.0 * mean**2
    return 3.0 * mean**2 / (2.0 * (3.0 * lame + 2.0 * shear)) + deviator / (4.0 * shear)


def moduli_of(state: xr.Dataset) -> tuple[NDArray, NDArray]:
    """Lame's constants (particle,) Pa of a state: lambda, and the shear modulus."""
    known = json.loads(state.attrs["elastic_moduli"])
    table = np.array([known[name] for name in json.loads(state.attrs["material_names"])])
    lame, shear = table[state["material"].values].T
    return lame, shear


@dataclass(frozen=True)
class Mined:
    """What a step mines of each excavation: volume (excavation,) m3, and the strain energy in it (excavation,) J."""

    volume: NDArray
    energy: NDArray


def mined_rock(grid: xr.Dataset, mined: NDArray, step: int, before: Rock, virgin: InsituStress | None) -> Mined:
    """What step number `step` mines of each excavation, mined (excavation,): number of its step, -1 never.

    before: the state before the step. virgin: given for the first step, whose rock has the virgin stress; `before` is
    then any state, for the moduli. What an earlier step has opened counts no more; what two excavations of the step
    share counts half for each.
    """
    owner, samples = grid["piece_excavation"].values.astype(np.int64), grid["piece_samples"].values
    own = np.flatnonzero(mined[owner] == step)
    count = len(mined)
    if not len(own):
        return Mined(np.zeros(count), np.zeros(count))
    place = grid["piece_origin"].values[own] + 0.5 * float(grid.attrs["fine_cell"])
    earlier = Voids.of(grid, (mined >= 0) & (mined < step))
    code = np.ravel_multi_index(np.floor(before.in_cells(place)).astype(np.int64).T, earlier.shape)
    opened = np.zeros(len(own), np.uint64)
    if len(earlier.code):
        row = np.minimum(np.searchsorted(earlier.code, code), len(earlier.code) - 1)
        opened = np.where(earlier.code[row] == code, earlier.samples[row], opened)
    new = samples[own] & ~opened
    _, group, shared = np.unique(np.stack([code.astype(np.uint64), new]), axis=1, return_inverse=True,
                                 return_counts=True)  # fmt: skip
    parts = np.maximum(np.bitwise_count(samples[own]), 1)
    volume = grid["piece_volume"].values[own] * np.bitwise_count(new) / parts / shared[group.reshape(-1)]
    density = _energy_at(before, place, virgin)
    return Mined(
        np.bincount(owner[own], volume, minlength=count), np.bincount(owner[own], volume * density, minlength=count)
    )


def _energy_at(before: Rock, place: NDArray, virgin: InsituStress | None) -> NDArray:
    """Strain energy (n,) J/m3 of the rock at points (n, xyz) m, the mean over their cells; 0 where there is none."""
    state = before.state
    cell = before.cells(before.in_cells(place))
    rock = np.flatnonzero(state["excavation"].values < 0)
    lame, shear = (column[rock] for column in moduli_of(state))
    of_cell = state["cell"].values[rock]
    if virgin is not None:
        first = np.full(len(before.grid.cell_level), -1)
        first[of_cell[::-1]] = np.arange(len(rock))[::-1]
        at = first[cell]
        return np.where(at >= 0, strain_energy_density(virgin.at(place[:, 2]), lame[at], shear[at]), 0.0)
    volume, count = state["volume"].values[rock], len(before.grid.cell_level)
    energy = volume * strain_energy_density(state["stress"].values[rock], lame, shear)
    total = np.bincount(of_cell, volume, minlength=count)
    return (np.bincount(of_cell, energy, minlength=count) / np.where(total > 0.0, total, 1.0))[cell]


@dataclass(frozen=True)
class Unloaded:
    """What happens to walls (point,) that a step makes. work, square, area (point,): of the traction t that was on
    them and is gone, t . du (J/m2, positive where they move into the opening), t . t (Pa2), and m2."""

    work: NDArray
    square: NDArray
    area: NDArray


def unload(
    before: Rock | None, after: Rock, walls: Walls, virgin: InsituStress, filled: NDArray, pressure: NDArray
) -> Unloaded:
    """Traction and motion of new walls (point,), with rock behind them after the step.

    before: None for the first step, whose rock has the virgin stress. filled (point,) bool: the step fills the opening;
    pressure (point,) Pa: acts on the wall after the step. Walls that were walls of another opening already count
    nothing.
    """
    moved = np.nan_to_num(wall_displacement(after, walls))
    if before is None:
        stress, was_rock = virgin.at(walls.place[:, 2]), np.ones(len(walls), bool)
    else:
        moved = moved - np.nan_to_num(wall_displacement(before, walls))
        what, particle = before.what(walls.place - 0.5 * STEP * after.edge * walls.normal)
        was_rock = ((what == INTACT) | (what == FAILED)) & (particle >= 0)  # no particle: rock that has fallen
        stress = np.zeros((len(walls), 6))
        stress[was_rock] = fitted_stress(before, walls.place[was_rock], particle[was_rock])[0]
    if filled.any():
        stress[filled] -= fill_stress(after, walls.place[filled])
    stress[:, :3] += pressure[:, None]
    gone = np.einsum("pij,pj->pi", tensor_from_voigt(stress), walls.normal)
    return Unloaded(
        work=np.where(was_rock, np.einsum("pi,pi->p", gone, moved), 0.0),
        square=np.where(was_rock, np.einsum("pi,pi->p", gone, gone), 0.0),
        area=np.where(was_rock, walls.area, 0.0),
    )


def fill_stress(rock: Rock, place: NDArray) -> NDArray:
    """Stress (n, 6) Pa of the fill nearest to points (n, xyz) m, 0 where there is none. Fill in cells with rock has the
    strain of that rock, so it counts only without any other."""
    state, axes = rock.state, rock.axes
    volume, is_fill = state["volume"].values, state["excavation"].values >= 0
    has_rock = np.zeros(len(rock.grid.cell_level), bool)
    has_rock[state["cell"].values[(volume > 0.0) & ~is_fill]] = True
    fill = np.flatnonzero((volume > 0.0) & is_fill)
    alone = fill[~has_rock[state["cell"].values[fill]]]
    own = alone if len(alone) else fill
    if not len(own):
        return np.zeros((len(place), 6))
    nearest = cKDTree(state["position"].values[own][:, axes]).query(place[:, axes])[1]
    return state["stress"].values[own[nearest]]


def plastic_work_density(state: xr.Dataset) -> NDArray:
    """Plastic work (particle,) J/m3 of a step, at least 0, from its state alone: s : e of each plastic strain e at the
    mean stress of its path.

    The brittle drop is elastic at fixed strain, so that stress falls by C : e. What is known is the stress s after it:
    (s + C : e_s / 2) : e_s for the drop to the residual strength e_s, (s + C : (e_s + e_o / 2)) : e_o for the overshoot
    e_o, and s : e_l for flow at the residual strength.
    """
    stress, (lame, shear) = state["stress"].values, moduli_of(state)
    seismic, overshoot, later = (state[name].values for name in STRAINS)

    def elastic(strain: NDArray) -> NDArray:
        found = 2.0 * shear[:, None] * strain
        found[:, :3] += (lame * strain[:, :3].sum(axis=1))[:, None]
        return found

    drop = elastic(seismic)
    found = ((stress + 0.5 * drop) * seismic) @ MULTIPLICITY
    found += ((stress + drop + 0.5 * elastic(overshoot)) * overshoot) @ MULTIPLICITY
    found += (stress * later) @ MULTIPLICITY
    return np.maximum(found, 0.0)


@dataclass(frozen=True)
class Balance:
    """Terms of the energy balance of a step, J: released: all that mining makes available but the energy of the mined
    rock; plastic: what plastic strain dissipates."""

    released: float
    plastic: float

    @classmethod
    def of(cls, states: list[xr.Dataset]) -> "Balance":
        """Of a step: its state, for the first one after the elastic history. NaN after a collapse.

        The support of mined rock that is ramped down takes energy from the rock, the less the fewer increments there
        are; nothing in the mine does. So it counts as released.
        """
        if any(state.attrs.get("collapsed") or not state.attrs.get("computed", 1) for state in states):
            return cls(np.nan, np.nan)

        def total(name: str) -> float:
            return sum(float(state.attrs[f"energy_{name}"]) for state in states)

        return cls(total("released") - total("mined") + total("support"), total("dissipated"))
