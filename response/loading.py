"""The table of loading measures: step by step, for the step as a whole, its openings, and planes.

Its columns are declared in common/loading_table.py.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from common.datasets import read_dataset
from common.fields import TEXT
from common.loading_table import ALL, FIELDS, OPENING, PLANE, STEP
from mpm_core.geometry.solids import Solid
from mpm_core.geometry.thickness import MAX_CELLS_MEASURED, thickness_of
from mpm_core.scene.scene import InsituStress
from response.energy_release import VARIABLES as ENERGY_VARIABLES
from response.energy_release import Balance, mined_rock, plastic_work_density, unload
from response.excess_shear import find_excess
from response.loading_settings import ENERGY, PLASTIC, SHEAR, STIFFNESS, LoadingSettings, LoadingSlice
from response.rock import VARIABLES as ROCK_VARIABLES
from response.rock import Rock, Voids, axes_of, is_computed
from response.wall_rays import standing
from response.walls import Walls, sample_walls

MEGA = 1e6
VARIABLES = ROCK_VARIABLES | ENERGY_VARIABLES
DENSEST_SHARE = 0.9  # Of plastic work, which is done in the volume that the table gives.
THICKNESS_STEPS = 64  # Of a line through an excavation, before its end is bisected.
Row = dict[str, float | str]


def read_and_measure(settings: LoadingSlice, grid: Path, elastic: Path, states: Sequence[Path]) -> xr.Dataset:
    """The table of loading measures of files. states: of the steps, in order."""
    read = (read_dataset(path, VARIABLES) for path in states)
    return loading_table(settings, read_dataset(grid), read_dataset(elastic, VARIABLES), read)


def loading_table(
    settings: LoadingSlice, grid: xr.Dataset, elastic: xr.Dataset, states: Iterable[xr.Dataset]
) -> xr.Dataset:
    """The table of loading measures of steps that are computed. elastic: the elastic history; states: of the steps, in
    order."""
    names = json.loads(grid.attrs["excavation_names"])
    entries = {entry.name: entry for entry in settings.excavations}
    place = {name: number for number, name in enumerate(settings.steps)}
    mined = np.array([place.get(entries[name].mined, -1) for name in names])
    filled = np.array([entries[name].filled for name in names], bool)
    pressure = np.array([entries[name].pressure for name in names])
    walls = sample_walls(grid, [None] * len(names))
    walls = walls.at(np.flatnonzero(mined[walls.excavation] >= 0))
    stress = settings.insitu
    virgin = InsituStress(np.array(stress.constant), np.array(stress.gradient), stress.surface)
    thickness = thicknesses(grid, mined)
    wanted, before = settings.loading_measures.wanted, Rock(elastic, Voids.of(grid, mined < -1))
    rows: list[Row] = []
    for number, (step, state) in enumerate(zip(settings.steps, states, strict=True)):
        if not is_computed(state):
            break  # nor are those after it
        rock = Rock(state, Voids.of(grid, (mined >= 0) & (mined <= number)))
        here = walls.at(np.flatnonzero(mined[walls.excavation] <= number))
        here = here.at(np.flatnonzero(standing(rock, here)))
        new = here.at(np.flatnonzero(mined[here.excavation] == number))
        balance = Balance.of([elastic, state] if number == 0 else [state])
        gone = mined_rock(grid, mined, number, before, virgin if number == 0 else None)
        unloaded = unload(
            None if number == 0 else before, rock, new, virgin, filled[new.excavation], pressure[new.excavation]
        )
        area, work, square = (
            np.bincount(new.excavation, values * unloaded.area, minlength=len(names))
            for values in (np.ones(len(new)), unloaded.work, unloaded.square)
        )
        mined_area = np.where(gone.volume > 0.0, gone.volume / thickness, 0.0)
        of_opening, of_step = {"mined_volume": gone.volume, "mined_area": mined_area}, {}
        if ENERGY in wanted:
            through_walls = shared_out(balance.released, work, mined == number)
            of_opening |= {"energy_mined": gone.energy / MEGA, "energy_released": (gone.energy + through_walls) / MEGA}
            of_step["energy_released"] = (gone.energy.sum() + balance.released) / MEGA
        if PLASTIC in wanted:
            of_opening |= _plastic(state, here, balance.plastic, len(names))
            of_step |= {
                "plastic_work": balance.plastic / MEGA,
                "plastic_volume": _densest_volume(*_plastic_rock(state)[1:]),
            }
        if STIFFNESS in wanted:
            of_opening |= {"area": area, "work": work, "square": square}
        whole = {key: float(column.sum()) for key, column in of_opening.items()} | of_step
        rows.append({"step": step, "kind": STEP, "name": ALL, **_derived(whole)})
        for excavation in np.flatnonzero((mined >= 0) & (mined <= number)).tolist():
            own = {key: float(column[excavation]) for key, column in of_opening.items()}
            rows.append({"step": step, "kind": OPENING, "name": names[excavation], **_derived(own)})
        if SHEAR in wanted:
            rows += _planes(rock, here, names, settings.loading_measures, step)
        before = rock
    return table(rows)


def shared_out(total: float, weight: NDArray, is_new: NDArray) -> NDArray:
    """A total in proportion to weights (n,), 0 but for new ones; NaN for these where weights add up to nothing."""
    whole = float(weight.sum())
    return total * weight / whole if whole > 0.0 else np.where(is_new, np.nan, 0.0)


def thicknesses(grid: xr.Dataset, mined: NDArray) -> NDArray:
    """Thickness (excavation,) m of excavations that are mined, mined (excavation,) >= 0, as the grid counts cells
    across them (mpm_core/geometry/thickness.py); NaN for others, and for those that are the outside of a solid."""
    across, cell = json.loads(grid.attrs["excavation_cells_across"]), float(grid.attrs["fine_cell"])
    found = cell * np.array(across)
    found[(mined < 0) | (found == 0.0)] = np.nan
    facets, owner = grid["solid_facets"].values, grid["solid_excavation"].values
    axes = axes_of(grid)
    vertices = grid["solid_position"].values[:, axes]
    for index in np.flatnonzero(np.array(across) >= MAX_CELLS_MEASURED * (1.0 - 1e-6)):  # it counts no more
        own = facets[owner == index][:, : len(axes)]
        if not len(own) or mined[index] < 0:
            found[index] = np.nan
            continue
        solid = Solid(str(index), vertices, own)
        found[index] = thickness_of(solid, float(np.linalg.norm(np.ptp(solid.bounds, axis=0))), THICKNESS_STEPS)[0]
    return found


def _plastic(state: xr.Dataset, walls: Walls, total: float, count: int) -> dict[str, NDArray]:
    """Plastic work (excavation,) MJ of a step by the nearest wall, and the volume (excavation,) m3 of the rock in which
    most of it is done. total: J, what the step dissipates."""
    own, volume, work = _plastic_rock(state)
    if not len(own) or not len(walls):
        return {"plastic_work": np.zeros(count), "plastic_volume": np.zeros(count)}
    nearest = walls.excavation[cKDTree(walls.place).query(state["position"].values[own])[1]]
    densest = np.zeros(count)
    for excavation in np.unique(nearest):
        parts = np.flatnonzero(nearest == excavation)
        densest[excavation] = _densest_volume(volume[parts], work[parts])
    by_opening = np.bincount(nearest, work, minlength=count)
    return {"plastic_work": shared_out(total, by_opening, by_opening > 0.0) / MEGA, "plastic_volume": densest}


def _plastic_rock(state: xr.Dataset) -> tuple[NDArray, NDArray, NDArray]:
    """Particles (n,) in which plastic work is done in a step, the densest first; their volume m3 and work J."""
    density, volume = plastic_work_density(state), state["volume"].values
    own = np.flatnonzero((density > 0.0) & (volume > 0.0))
    own = own[np.argsort(-density[own], kind="stable")]
    return own, volume[own], volume[own] * density[own]


def _densest_volume(volume: NDArray, work: NDArray) -> float:
    """Volume, m3, of the rock in which DENSEST_SHARE of the work (n,) J is done, the densest first."""
    done = np.cumsum(work)
    return float(volume[: 1 + np.searchsorted(done, DENSEST_SHARE * done[-1])].sum()) if len(done) else 0.0


def _derived(found: dict[str, float]) -> Row:
    """Columns of a row from its sums: area (m2), work (J) and square (Pa2 m2) of unloaded walls become stress and
    stiffness; energy is divided by what is mined."""
    area, work, square = (found.pop(key, 0.0) for key in ("area", "work", "square"))
    if area > 0.0:
        found["unloaded_stress"] = float(np.sqrt(square / area)) / MEGA
    if work > 0.0:
        found["loading_stiffness"] = square / work / MEGA
    if "energy_released" in found and found["mined_volume"] > 0.0:
        found["release_rate"] = found["energy_released"] / found["mined_area"]
        found["release_density"] = found["energy_released"] / found["mined_volume"]
    return dict(found)


def _planes(rock: Rock, walls: Walls, names: list[str], settings: LoadingSettings, step: str) -> Iterator[Row]:
    """Rows of planes after a step. walls: those that stand."""
    tree = cKDTree(walls.place) if len(walls) else None
    for plane in settings.planes:
        found = find_excess(rock, plane, settings.dynamic_friction)
        known = np.isfinite(found.largest)
        nearest = names[walls.excavation[tree.query(found.place)[1]]] if tree is not None and known else ""
        yield {
            "step": step, "kind": PLANE, "name": plane.name, "ess_at_point": found.at_point / MEGA,
            "ess_largest": found.largest / MEGA, "ess_mean": found.mean / MEGA, "ess_area": found.area,
            "ess_volume": found.volume, "nearest_opening": nearest,
            **dict(zip("xyz", found.place.tolist(), strict=True)),
        }  # fmt: skip


def table(rows: list[Row]) -> xr.Dataset:
    """Dataset of rows, with the units and meanings of FIELDS."""
    return xr.Dataset(
        {
            field.name: (
                field.dims,
                np.array([row.get(field.name, "" if field.dtype == TEXT else np.nan) for row in rows], field.dtype),
                field.attributes,
            )
            for field in FIELDS
        }
    )
