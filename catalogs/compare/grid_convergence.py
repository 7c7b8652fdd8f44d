"""Influence of the cells on a mine's numbers: its run beside the same run on cells of twice the size.

The uncertainty of potency and failed volume follows from how many cells thick the failed rock is
(catalogs.compare.cell_error). The change from doubled cells tests that: where it is larger than the uncertainties of
both runs together, it is the uncertainty. It tests nothing where doubled cells lose a mechanism: where openings are
left out or narrow, or failed rock is too thin, most of the change is what the doubled cells miss.

Layout of grid_convergence.nc
-----------------------------
Dimensions: cell (edge of the finest cells, m: the mine's, twice it), period (the dated steps, then "all" of them).

  potency (cell, period) m3            of all events
  failed_volume (cell, period) m3      rock that failed in the period
  thickness (cell, period)             mean thickness of that rock in finest cells, NaN without any
  events (cell, period)                resolved events from the larger floor of both catalogues on
  largest (cell, period)               log10 of the largest potency (m3), NaN without events
  potency_error, failed_volume_error (period)   uncertainty as a share of these, NaN where nothing failed
Attributes: mine, floor (log10 P in m3), left_out (excavations that cells of twice the size have no part of, JSON),
narrow (others that are narrow for these cells, JSON), and those of a job's provenance (common.job).
"""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from catalogs.compare.cell_error import MAX_ERROR, error_at, failed_thickness
from catalogs.settings import ALL_STEPS, GridConvergenceSettings
from catalogs.sources.sizes import log_potency
from common.errors import InputError

QUANTITIES = {  # unit and meaning
    "potency": ("m3", "potency of all events"),
    "failed_volume": ("m3", "rock that failed in the period"),
    "thickness": ("1", "mean thickness of the rock that failed in the period, in finest cells"),
    "events": ("1", "resolved events from the larger floor of both catalogues on"),
    "largest": ("1", "log10 of the largest potency in m3"),
}


def compare_cells(
    catalogs: list[xr.Dataset],
    steps: list[list[xr.Dataset]],
    coarse_grid: dict,
    settings: GridConvergenceSettings | dict,
) -> xr.Dataset:
    """Numbers of both runs and the estimated error; layout as at the head of this module.

    catalogs: of both runs; steps: states of their dated steps with FRONT_VARIABLES; each the mine's own first.
    coarse_grid: attributes of the grid of cells of twice the size.
    Raises InputError for files of another mine or of other steps.
    """
    settings = GridConvergenceSettings.of(settings)
    for catalog, states in zip(catalogs, steps, strict=True):
        found = [catalog.attrs.get("mine"), *(state.attrs.get("mine") for state in states)]
        names = [state.attrs.get("step") for state in states]
        if set(found) != {settings.mine} or names != list(settings.steps):
            raise InputError(
                f"grid_convergence: steps {', '.join(map(str, names))} of {', '.join(sorted(set(map(str, found))))}, "
                f"not {', '.join(settings.steps)} of {settings.mine}; run again"
            )
    floors = [float(catalog.attrs["potency_floor"]) for catalog in catalogs]
    floor = np.log10(max(floors)) if max(floors) > 0 else np.nan
    periods = [*settings.steps, ALL_STEPS]
    rows: dict[str, list] = {name: [] for name in QUANTITIES}
    for catalog, states in zip(catalogs, steps, strict=True):
        for name, values in _by_period(catalog, states, settings.steps, floor).items():
            rows[name].append(values)
    table = {name: np.array(values) for name, values in rows.items()}
    data: dict[str, Any] = {
        name: (("cell", "period"), values, {"units": QUANTITIES[name][0], "long_name": QUANTITIES[name][1]})
        for name, values in table.items()
    }
    names, volumes, narrow = (
        json.loads(coarse_grid[f"excavation_{key}"]) for key in ("names", "volume_grid", "narrow")
    )
    left_out = [name for name, volume in zip(names, volumes, strict=True) if not volume > 0.0]
    collapsed = any(state.attrs.get("collapsed") for run in steps for state in run)
    lost = bool(left_out or narrow or collapsed)
    for name in ("potency", "failed_volume"):
        numbers = zip(table[name].T, table["thickness"].T, strict=True)
        errors = [cell_error(values, thickness, lost) for values, thickness in numbers]
        meaning = f"uncertainty of {name} as a share of it"
        data[f"{name}_error"] = ("period", errors, {"units": "1", "long_name": meaning})
    return xr.Dataset(
        data,
        coords={
            "cell": ("cell", list(settings.cells), {"units": "m", "long_name": "edge of the finest cells"}),
            "period": ("period", periods, {"long_name": "dated step, or all of them"}),
        },
        attrs={"mine": settings.mine, "floor": floor, "left_out": json.dumps(left_out), "narrow": json.dumps(narrow)}
        | {"collapsed": int(collapsed)},
    )


def cell_error(values: Sequence[float], thickness: Sequence[float], lost: bool) -> float:
    """Relative uncertainty of a number from the cells; NaN where nothing failed.

    values, thickness: the number, and the thickness of the failed rock in cells, on the mine's cells and on doubled
    ones; lost: doubled cells leave openings out or have narrow ones, or a run has collapsed.
    """
    own, coarse = values
    if not own > 0.0:
        return np.nan
    by_study, by_study_doubled = (error_at(one) for one in thickness)
    change = abs(np.log(own / coarse)) if coarse > 0.0 and doubled_cells_tell(thickness[1], lost) else 0.0
    return float(np.expm1(change if change > by_study + by_study_doubled else by_study))


def doubled_cells_tell(coarse_thickness: float, lost: bool) -> bool:
    """True if the change from doubled cells says anything of the mine's own: no opening is lost, and rock fails in a
    zone that doubled cells resolve."""
    return not lost and error_at(coarse_thickness) <= MAX_ERROR


def _by_period(
    catalog: xr.Dataset, states: list[xr.Dataset], steps: tuple[str, ...], floor: float
) -> dict[str, list[float]]:
    """Numbers of one run by step, then of all steps."""
    potency, step = catalog["potency"].values, catalog["step"].values
    counted = (catalog["resolved"].values == 1) & ~(log_potency(potency) < floor)
    within = [step == name for name in steps] + [np.isin(step, steps)]
    volumes = [float(state.attrs["failed_volume"]) for state in states]
    places = [int(state.attrs["step_index"]) for state in states]
    thickness = [failed_thickness(state, [place]) for state, place in zip(states, places, strict=True)]
    return {
        "potency": [float(potency[here].sum()) for here in within],
        "failed_volume": [*volumes, sum(volumes)],
        "thickness": [*thickness, failed_thickness(states[-1], places)],
        "events": [float((here & counted).sum()) for here in within],
        "largest": [float(log_potency(potency[here]).max()) if here.any() else np.nan for here in within],
    }
