"""Influence of the cells on a mine's numbers: its run is compared with the same run on cells of twice the size.

The remaining change of a number is estimated from its change when cells were halved, assuming first order, times
SAFETY_FACTOR. The estimate is no bound: study openings shows how often it covers the numbers on finer cells. Two runs
may agree by chance, since different rock fails first in each and walls cut the cells differently. Therefore the
estimate is never less than MIN_ERROR_SHARE.

Layout of grid_convergence.nc
-----------------------------
Dimensions: cell (edge of the finest cells, m: the mine's, twice it), period (the dated steps, then "all" of them).

  potency (cell, period) m3            of all events
  failed_volume (cell, period) m3      rock that failed in the period
  events (cell, period)                resolved events from the larger floor of both catalogues on
  largest (cell, period)               log10 of the largest potency (m3), NaN without events
  potency_error, failed_volume_error (period)   uncertainty as a share of these, NaN where nothing failed
Attributes: mine, floor (log10 P in m3), left_out (excavations that cells of twice the size have no part of, JSON),
narrow (others that are narrow for these cells, JSON), and those of a job's provenance (common.job).
"""

import json
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.settings import ALL_STEPS, GridConvergenceSettings
from catalogs.sources.sizes import log_potency
from common.errors import InputError

SAFETY_FACTOR = 1.25  # Factor on the change between two cell sizes.
"""times the change from doubled cells, by which a number of first order still changes; study openings tests it"""
MIN_ERROR_SHARE = 0.10
"""share that a number may be off by, however little it changed"""

QUANTITIES = {  # unit and meaning
    "potency": ("m3", "potency of all events"),
    "failed_volume": ("m3", "rock that failed in the period"),
    "events": ("1", "resolved events from the larger floor of both catalogues on"),
    "largest": ("1", "log10 of the largest potency in m3"),
}


def compare_cells(
    catalogs: list[xr.Dataset], steps: list[list[dict]], coarse_grid: dict, settings: GridConvergenceSettings | dict
) -> xr.Dataset:
    """Numbers of both runs and the estimated error; layout as at the head of this module.

    catalogs: of both runs; steps: attributes of the states of their dated steps; each the mine's own first.
    coarse_grid: attributes of the grid of cells of twice the size.
    Raises InputError for files of another mine or of other steps.
    """
    settings = GridConvergenceSettings.of(settings)
    for catalog, states in zip(catalogs, steps, strict=True):
        found = [catalog.attrs.get("mine"), *(state.get("mine") for state in states)]
        names = [state.get("step") for state in states]
        if set(found) != {settings.mine} or names != list(settings.steps):
            raise InputError(
                f"grid_convergence: steps {', '.join(map(str, names))} of {', '.join(sorted(set(map(str, found))))}, "
                f"not {', '.join(settings.steps)} of {settings.mine}; run again"
            )
    floors = [float(catalog.attrs["potency_floor"]) for catalog in catalogs]
    floor = np.log10(max(floors)) if max(floors) > 0 else np.nan
    rows: dict[str, list] = {name: [] for name in QUANTITIES}
    for catalog, states in zip(catalogs, steps, strict=True):
        for name, values in _by_period(catalog, states, settings.steps, floor).items():
            rows[name].append(values)
    table = {name: np.array(values) for name, values in rows.items()}
    data: dict[str, Any] = {
        name: (("cell", "period"), values, {"units": QUANTITIES[name][0], "long_name": QUANTITIES[name][1]})
        for name, values in table.items()
    }
    for name in ("potency", "failed_volume"):
        meaning = f"uncertainty of {name} as a share of it"
        data[f"{name}_error"] = ("period", share_off(*table[name]), {"units": "1", "long_name": meaning})
    names, volumes, narrow = (
        json.loads(coarse_grid[f"excavation_{key}"]) for key in ("names", "volume_grid", "narrow")
    )
    left_out = [name for name, volume in zip(names, volumes, strict=True) if not volume > 0.0]
    return xr.Dataset(
        data,
        coords={
            "cell": ("cell", list(settings.cells), {"units": "m", "long_name": "edge of the finest cells"}),
            "period": ("period", [*settings.steps, ALL_STEPS], {"long_name": "dated step, or all of them"}),
        },
        attrs={"mine": settings.mine, "floor": floor, "left_out": json.dumps(left_out), "narrow": json.dumps(narrow)},
    )


def share_off(own: NDArray, coarse: NDArray) -> NDArray:
    """Relative uncertainty of numbers (n,), from those on cells of twice the size; NaN where both are zero."""
    own, coarse = np.asarray(own, float), np.asarray(coarse, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.maximum(SAFETY_FACTOR * np.abs(own - coarse) / own, MIN_ERROR_SHARE)


def _by_period(catalog: xr.Dataset, states: list[dict], steps: tuple[str, ...], floor: float) -> dict[str, list[float]]:
    """Numbers of one run by step, then of all steps."""
    potency, step = catalog["potency"].values, catalog["step"].values
    counted = (catalog["resolved"].values == 1) & ~(log_potency(potency) < floor)
    within = [step == name for name in steps] + [np.isin(step, steps)]
    volumes = [float(state["failed_volume"]) for state in states]
    return {
        "potency": [float(potency[here].sum()) for here in within],
        "failed_volume": [*volumes, sum(volumes)],
        "events": [float((here & counted).sum()) for here in within],
        "largest": [float(log_potency(potency[here]).max()) if here.any() else np.nan for here in within],
    }
