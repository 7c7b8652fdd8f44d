"""The outcome of a plan: what its runs made, the hazard that follows, and the forecast of what is ahead.

Layout of outcome.nc: plans.layout.
"""

import json
from typing import Any

import numpy as np
import xarray as xr

from catalogs.exposure import DAY, window
from catalogs.periods import ALL_STEPS
from common.errors import InputError
from common.source_tensors import moment_of_magnitude
from plans.hazard import Hazard, find_hazard
from plans.layout import ANY, LIKE_OWN, OWN, described
from plans.record import is_ahead, read_recorded
from plans.runs import Geometry, StepEvents, common_floor, counts, digest, read_run, read_states, run_floor
from plans.settings import OutcomeSlice


def make_outcome(
    settings: OutcomeSlice, grid: xr.Dataset, record: xr.Dataset | None = None, comparison: xr.Dataset | None = None
) -> xr.Dataset:
    """The outcome of a plan; layout: plans.layout.

    grid: grid.nc of the plan's own cells; record, comparison: of the mine, None without a record. Raises InputError for
    files of another mine, and for a plan whose first run is not its own.
    """
    steps, kinds = settings.steps, [run.kind for run in settings.runs]
    if kinds[0] != OWN or kinds.count(OWN) != 1:
        raise InputError(f"plans: the runs of {settings.plan} are {', '.join(kinds)}; give its own first, and once")
    if len({step.name for step in steps}) < len(steps):
        raise InputError(f"plans: a step stands twice among those of {settings.plan}")
    geometry = Geometry.of(grid, settings.openings, steps)
    runs = [read_run(run, steps, settings.mine) for run in settings.runs]
    like_own = [number for number, kind in enumerate(kinds) if kind in LIKE_OWN]
    recorded = read_recorded(settings, record, comparison) if record is not None and comparison is not None else None
    others = [(run.kind, run_floor(run, settings.mine)) for run in settings.compared_runs]
    alike = [one for kind, one in others if kind in LIKE_OWN]
    floor = float(np.fmax.reduce([common_floor([runs[number] for number in like_own]), *alike]))
    floor = recorded.floor_above(floor) if recorded else floor
    shared = float(np.fmax.reduce([common_floor(runs), floor, *(one for _, one in others)]))
    numbers = recorded.numbers(floor, shared) if recorded else None
    states = [read_states(run, steps, settings.mine) for run in settings.runs]
    data = _made(settings, geometry, runs, like_own, floor, shared)
    data |= {
        name: (("run", "step"), np.array([getattr(one, name) for one in states]))
        for name in ("energy_released", "failed_volume")
    }
    data["mined"] = ("step", np.array(geometry.step_volume))
    data["made_by"] = ("step", [digest(runs, states, kinds, number) for number in range(len(steps))])
    data |= _plan(settings, geometry)
    until = recorded.until if recorded else None
    ahead = np.array([is_ahead(step, until) for step in steps])
    counted = [[step.from_floor(floor) for step in runs[number]] for number in like_own]
    hazard = find_hazard(settings, data, counted, ahead, floor, numbers)
    attributes = {
        "mine": settings.mine,
        "plan": settings.plan,
        "floor": floor,
        "shared_floor": shared,
        "shear_modulus": settings.shear_modulus,
        "differs_in": json.dumps(list(settings.differs_in)),
        "recorded_until": str(until)[:19] if until is not None else "",
        "steps_ahead": json.dumps([step.name for step, one in zip(steps, ahead, strict=True) if one]),
    }
    return described(_dataset(settings, data, hazard, attributes))


def _made(
    settings: OutcomeSlice,
    geometry: Geometry,
    runs: list[list[StepEvents]],
    like_own: list[int],
    floor: float,
    shared: float,
) -> dict[str, Any]:
    """What the runs made, as variables."""
    shape = (len(runs), len(settings.steps), len(geometry.mined) + 1)
    by_opening = {name: np.full(shape, np.nan) for name in ("number", "potency", "squares", "largest")}
    within = np.full((*shape, len(settings.hazard.distances)), np.nan)
    of_events: dict[str, list] = {"location": [], "potency": [], "step": [], "run": []}
    for number in like_own:
        for index, step in enumerate(runs[number]):
            events = step.from_floor(floor)
            found = counts(events, geometry, index, settings.hazard.distances)
            within[number, index] = found.pop("number_within")
            for name, values in found.items():
                by_opening[name][number, index] = values
            of_events["location"].append(events.location)
            of_events["potency"].append(events.potency)
            of_events["step"].append(np.full(len(events.potency), index, np.int32))
            of_events["run"].append(np.full(len(events.potency), number, np.int32))
    every = ("run", "step")
    return {
        **{name: ((*every, "opening"), values) for name, values in by_opening.items()},
        "number_within": ((*every, "opening", "distance"), within),
        "shared_number": (
            every,
            np.array([[len(step.from_floor(shared).potency) for step in run] for run in runs], float),
        ),
        "whole_potency": (every, np.array([[step.whole for step in run] for run in runs])),
        "event_location": (("event", "xyz"), np.concatenate(of_events["location"]).reshape(-1, 3)),
        **{f"event_{name}": ("event", np.concatenate(of_events[name])) for name in ("potency", "step", "run")},
    }


def _plan(settings: OutcomeSlice, geometry: Geometry) -> dict[str, Any]:
    """Dates, openings and classes of a plan, as variables."""
    steps, sizes = settings.steps, list(settings.hazard.sizes.values())
    windows = [window(step.model_dump()) for step in steps]
    log_potency = np.log10(moment_of_magnitude(np.array(sizes, float))) - np.log10(settings.shear_modulus)
    return {
        "run_kind": ("run", [run.kind for run in settings.runs]),
        "start": ("step", [step.start for step in steps]),
        "end": ("step", [step.end for step in steps]),
        "days": ("step", np.array([(end - start) / DAY for start, end in windows])),
        "opening_step": ("opening", [*(opening.step for opening in settings.openings), ""]),
        "opening_volume": ("opening", np.append(geometry.volume, geometry.volume.sum())),
        "size_magnitude": ("size", np.array(sizes, float)),
        "size_log_potency": ("size", log_potency),
    }


def _dataset(settings: OutcomeSlice, data: dict[str, Any], hazard: Hazard, attributes: dict) -> xr.Dataset:
    """All variables with their coordinates."""
    names = [step.name for step in settings.steps]
    text = {
        "run_kind", "start", "end", "made_by", "opening_step",
    }  # fmt: skip
    values = {
        name: (dims, np.array(one, object) if name in text else one)
        for name, (dims, one) in (data | hazard.data).items()
    }
    coordinates = {
        "step": np.array(names, object),
        "opening": np.array([*(opening.name for opening in settings.openings), ANY], object),
        "distance": np.array(settings.hazard.distances, float),
        "size": np.array(list(settings.hazard.sizes), object),
        "period": np.array([*names, ALL_STEPS], object),
        "interval": np.array(["lower", "upper"], object),
    }
    return xr.Dataset(values, coords=coordinates, attrs=attributes | hazard.attributes)
