"""The synthetic catalogue: events of all dated steps, in order of time."""

import json
import os
from collections.abc import Sequence

import numpy as np
import pandas as pd
import xarray as xr

from common.datasets import atomic_path
from common.errors import InputError
from common.event_table import NAMES, ON_PLANES, event_dataset
from common.frame import Frame, grid_of
from common.voigt import COMPONENTS, voigt_from_tensor
from seismic.budget import add_budgets

# What the steps of one catalogue must share, with a plain name for the user.
SHARED_ATTRIBUTES = (
    *("mine", "kind", "lame_lambda", "shear_modulus", "frame"),
    *("seismic_fraction", "method", "closeness", "link_length", "parts", "least_particles", "cluster"),
)
EXTRACTION = "extraction"  # Variable (event,): number of the set that an event is from.


def merge(steps: list[xr.Dataset]) -> xr.Dataset:
    """One catalogue from the event datasets of steps: dated steps only, by time, then step, then event.

    Steps without dates failed before the record begins (or are only planned): they are left out, and so is their
    budget. The potency floor is the largest of the steps', above which every step is complete; the location error
    likewise (NaN where nothing failed at all). Raises InputError if steps differ in mine, rock or settings, or if one
    appears twice.
    """
    if not steps:
        raise InputError("catalog: no event datasets: give the events of at least one step")
    first = steps[0].attrs
    for step in steps:
        for name in SHARED_ATTRIBUTES:
            if step.attrs.get(name) != first.get(name) or name not in first:
                raise InputError(
                    f"catalog: steps {first.get('step')} and {step.attrs.get('step')} differ in {name}: "
                    "extract the events of all steps with the same settings"
                )
    dated = sorted((step for step in steps if step.attrs["dated"]), key=lambda step: int(step.attrs["step_index"]))
    names = [step.attrs["step"] for step in dated]
    if len(set(names)) < len(names):
        raise InputError(f"catalog: a step appears twice among {', '.join(names)}: give each step once")

    sources = dated or [steps[0].isel(event=[])]
    planes = ON_PLANES.name in steps[0]
    names_of = [*NAMES, *([ON_PLANES.name] if planes else [])]
    joined = {name: np.concatenate([step[name].values for step in sources]) for name in names_of}
    order = np.argsort(joined["time"], kind="stable")  # ties stay in the order of steps, and of events in a step
    values = {name: column[order] for name, column in joined.items()}

    truncated = [step for step in dated if step.attrs["truncated"]]
    budgets = [json.loads(step.attrs["budget"]) for step in dated]
    budget = add_budgets(budgets)
    attributes = {name: first[name] for name in SHARED_ATTRIBUTES} | {
        "steps": json.dumps(names),
        "potency_floor": _largest(dated, "potency_floor"),
        "location_error": _largest(dated, "location_error"),
        "truncated": int(bool(truncated)),
        "truncated_share": float(max((step.attrs["truncated_share"] for step in dated), default=0.0)),
        "truncated_where": "; ".join(f"{step.attrs['step']}: {step.attrs['truncated_where']}" for step in truncated),
        "unlike_share": _mean_share("unlike_share", dated, budgets),
        "budget": json.dumps(budget),
    }
    on_planes = values.pop(ON_PLANES.name, None)
    catalog = event_dataset(values, attributes)
    if planes:
        catalog[ON_PLANES.name] = (ON_PLANES.dims, on_planes, ON_PLANES.attributes)
    return catalog


def join_extractions(sets: Sequence[xr.Dataset]) -> xr.Dataset:
    """One dataset of several sets of events from the rock of one trial, extracted with different settings.

    It has the attributes of the first set, and the potency floors of all.
    """
    together = xr.concat(list(sets), dim="event", combine_attrs="override")
    together[EXTRACTION] = ("event", np.repeat(np.arange(len(sets)), [one.sizes["event"] for one in sets]))
    return together.assign_attrs(potency_floors=[float(one.attrs["potency_floor"]) for one in sets])


def extractions(trial: xr.Dataset) -> list[xr.Dataset]:
    """The sets of events of a trial, in order, each with its own potency floor."""
    number = trial[EXTRACTION].values
    return [
        trial.isel(event=np.flatnonzero(number == one)).assign_attrs(potency_floor=float(floor))
        for one, floor in enumerate(np.atleast_1d(trial.attrs["potency_floors"]))
    ]


def _mean_share(name: str, steps: list[xr.Dataset], budgets: list[dict]) -> float:
    """Mean of an attribute of steps, weighted by what their particles released; 0 where nothing failed."""
    weights = [budget["particle_scalars"] for budget in budgets]
    return float(np.average([step.attrs[name] for step in steps], weights=weights)) if sum(weights) else 0.0


def write_csv(catalog: xr.Dataset, path: str | os.PathLike) -> None:
    """Write the catalogue as a plain table, one row per event below one row of column names, atomically.

    date, time_utc: to the second, which keeps the order of a step's events; time_lower_uncertainty_s and
    time_upper_uncertainty_s: back to the start and on to the end of the step, as the model dates no event within it,
    in whole seconds from the time in the table; x_m, y_m, z_m east, north, up, and in a mine with a grid of its own
    grid_x, grid_y, grid_z with the grid's unit, as grid_x_ft; location_uncertainty_m: the size of a
    cell; log10_potency_m3; moment_n_m and mw, with the moduli of the rock that failed; potency_xx_m3 ... potency_xy_m3
    (tensor shear, opening positive); step; resolved (0: too few particles, counts in the budget only); on_planes, where
    rock has weak planes: share of the potency that is slip on them.
    """
    day = pd.DatetimeIndex(catalog["time"].values)
    cut_off = (day - day.floor("s")).total_seconds().to_numpy()  # of the time, which is written in whole seconds
    table = {
        "date": day.strftime("%Y-%m-%d"),
        "time_utc": day.strftime("%H:%M:%S"),
        "time_lower_uncertainty_s": _text(np.floor(catalog["time_lower_uncertainty"].values - cut_off), ".0f"),
        "time_upper_uncertainty_s": _text(np.floor(catalog["time_upper_uncertainty"].values + cut_off), ".0f"),
    }
    location = catalog["location"].values
    table |= {f"{axis}_m": _text(location[:, i], ".3f") for i, axis in enumerate("xyz")}
    frame = Frame.of(json.loads(catalog.attrs.get("frame", '{"surface": 0}')), "frame")
    if frame.grid:
        grid = grid_of(frame)
        own = grid.to_grid(location) / grid.metres_per_unit
        table |= {f"grid_{axis}_{grid.units}": _text(own[:, i], ".3f") for i, axis in enumerate("xyz")}
    error = np.full(len(day), float(catalog.attrs["location_error"]))
    table |= {
        "location_uncertainty_m": _text(error, ".3g"),
        "log10_potency_m3": _text(np.log10(catalog["potency"].values), ".6f"),
        "moment_n_m": _text(catalog["moment"].values, ".9e"),
        "mw": _text(catalog["mw"].values, ".4f"),
    }
    tensor = voigt_from_tensor(catalog["potency_tensor"].values)
    table |= {f"potency_{name}_m3": _text(tensor[:, i], ".9e") for i, name in enumerate(COMPONENTS)}
    table |= {"step": catalog["step"].values, "resolved": catalog["resolved"].values}
    if ON_PLANES.name in catalog:
        table[ON_PLANES.name] = _text(catalog[ON_PLANES.name].values, ".4f")
    with atomic_path(path) as temporary:
        pd.DataFrame(table).to_csv(temporary, index=False, lineterminator="\n", encoding="utf-8")


def _largest(steps: list[xr.Dataset], name: str) -> float:
    """Largest value of an attribute, NaN if no step has one."""
    return float(np.fmax.reduce([step.attrs[name] for step in steps] or [np.nan]))


def _text(values: np.ndarray, form: str) -> list[str]:
    """Numbers in a fixed format: the bytes do not depend on pandas."""
    return [format(float(value), form) for value in values]
