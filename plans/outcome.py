"""The outcome of a plan: results of its runs, the hazard that follows, and the forecast of what is ahead.

Layout of outcome.nc: plans.layout.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.exposure import DAY, window
from catalogs.settings import ALL_STEPS
from common.datasets import read_dataset
from common.errors import InputError
from common.event_table import read_events
from common.source_tensors import moment_of_magnitude
from plans.hazard import find_hazard
from plans.layout import ANY, LIKE_OWN, OWN, RATE_BY_MEASURES, new_outcome
from plans.measured_rate import rates_by_measures, read_amounts, to_attribute
from plans.record import RecordedNumbers, RecordedSteps, is_ahead, read_recorded
from plans.runs import (
    Geometry,
    StepResult,
    collapsed_in,
    common_floor,
    counts,
    digest,
    has_collapsed,
    read_run,
    read_steps,
)
from plans.settings import OutcomeSlice


def outcome_stage(
    given: Mapping, *, grid: Path, record: Path | None = None, comparison: Path | None = None
) -> xr.Dataset:
    """The outcome of a plan from files; given: the stage's slice (OutcomeSlice), which names the files of the runs.

    record, comparison: files of the mine, both or neither. Raises InputError as make_outcome.
    """
    if (record is None) != (comparison is None):
        raise InputError("plans: record.nc and comparison.nc: give both or neither")
    settings = OutcomeSlice.of(given, "plans")
    events = read_events(record) if record else None
    return make_outcome(settings, read_dataset(grid), events, read_dataset(comparison, ["cut"]) if comparison else None)


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
    collapsed = collapsed_in(runs[0], steps)  # If the plan's own run has, its page leaves the plan out as a whole.
    stands = np.array([bool(collapsed) or not has_collapsed(run) for run in runs])
    like_own = [number for number, kind in enumerate(kinds) if kind in LIKE_OWN and stands[number]]
    recorded = read_recorded(settings, record, comparison) if record is not None and comparison is not None else None
    known = {step.file: step for run in runs for step in run}
    compared = _standing([(run.kind, read_steps(run, settings.mine, known)) for run in settings.compared_runs])
    other_floors = [(kind, common_floor([run])) for kind, run in compared]
    own_floors = [common_floor([runs[number] for number in like_own])]
    own_floors += [one for kind, one in other_floors if kind in LIKE_OWN]
    floor = float(np.fmax.reduce(own_floors))
    floor = recorded.floor_above(floor) if recorded else floor
    all_floors = [common_floor([runs[number] for number in np.flatnonzero(stands)]), *(one for _, one in other_floors)]
    shared = float(np.fmax.reduce([floor, *all_floors]))
    values = _plan_values(settings, geometry)
    values |= _run_values(runs, stands, shared)
    values |= _values_from_floor(runs, like_own, geometry, settings.hazard.distances, floor)
    values["made_by"] = [digest(runs, kinds, number) for number in range(len(steps))]
    until = recorded.until if recorded else None
    ahead = np.array([is_ahead(step, until) for step in steps])
    counted = [[step.from_floor(floor) for step in runs[number]] for number in like_own]
    numbers = recorded.numbers(floor, shared) if recorded else None
    others: list[list[list[StepResult]]] = []
    for kind, run in compared:
        if kind == OWN:
            others.append([])
        if kind in LIKE_OWN:
            others[-1].append([step.from_floor(floor) for step in run])
    rate = ""
    if recorded and numbers is not None and settings.recorded_states and not collapsed:
        rate = _measured_rate(settings, recorded, numbers, ahead)
    hazard, attributes = find_hazard(settings, values, counted, ahead, floor, numbers, others)
    attributes = {
        "mine": settings.mine,
        "plan": settings.plan,
        "collapsed": collapsed,
        "fallen_volume": float(np.mean([sum(step.fallen_volume for step in runs[number]) for number in like_own])),
        "floor": floor,
        "shared_floor": shared,
        "shear_modulus": settings.shear_modulus,
        "differs_in": json.dumps(list(settings.differs_in)),
        "recorded_until": str(until) if until is not None else "",
        RATE_BY_MEASURES: rate,
        "steps_ahead": json.dumps([step.name for step, one in zip(steps, ahead, strict=True) if one]),
    } | attributes
    return new_outcome(values | hazard, attributes)


def _measured_rate(settings: OutcomeSlice, recorded: RecordedSteps, numbers: RecordedNumbers, ahead: NDArray) -> str:
    """The numbers of the steps ahead by measures of the mine's and the plan's own runs, as an attribute."""
    covered = {step.name for step in recorded.steps}
    place = [number for number, step in enumerate(settings.recorded_steps) if step.name in covered]
    own = read_amounts(settings.recorded_states, settings.recorded_steps, settings.mine)
    amounts = read_amounts(settings.runs[0].states, settings.steps, settings.mine)
    own = {label: values[place] for label, values in own.items()}
    return to_attribute(*rates_by_measures(numbers, recorded.steps, own, settings.steps, amounts, ahead))


def _standing(runs: Sequence[tuple[str, list[StepResult]]]) -> list[tuple[str, list[StepResult]]]:
    """Kinds and results of runs of several plans, each plan's own first, without what has collapsed: a run, or a plan
    whose own run has."""
    found, is_lost = [], False
    for kind, run in runs:
        is_lost = has_collapsed(run) if kind == OWN else is_lost
        if not (is_lost or has_collapsed(run)):
            found.append((kind, run))
    return found


def _plan_values(settings: OutcomeSlice, geometry: Geometry) -> dict[str, Any]:
    """Steps, openings and classes of a plan, and the names along each dimension, as variables of plans.layout."""
    steps, sizes = settings.steps, np.array(list(settings.hazard.sizes.values()), float)
    windows = [window(step.model_dump()) for step in steps]
    names = [step.name for step in steps]
    return {
        "run_kind": [run.kind for run in settings.runs],
        "start": [step.start for step in steps],
        "end": [step.end for step in steps],
        "days": np.array([(end - start) / DAY for start, end in windows]),
        "mined": np.array(geometry.step_volume),
        "opening_step": [*(opening.step for opening in settings.openings), ""],
        "opening_volume": np.append(geometry.volume, geometry.volume.sum()),
        "size_magnitude": sizes,
        "size_log_potency": np.log10(moment_of_magnitude(sizes)) - np.log10(settings.shear_modulus),
        "step": names,
        "opening": [*(opening.name for opening in settings.openings), ANY],
        "distance": np.array(settings.hazard.distances, float),
        "size": list(settings.hazard.sizes),
        "period": [*names, ALL_STEPS],
        "interval": ["lower", "upper"],
    }


def _run_values(runs: Sequence[Sequence[StepResult]], stands: NDArray, shared: float) -> dict[str, Any]:
    """Sums of each step of all runs (run, step), as variables of plans.layout: NaN where one does not stand, (run,).

    shared: the shared floor, log10 m3.
    """
    sums = {
        name: np.array([[getattr(step, name) for step in run] for run in runs])
        for name in ("whole_potency", "energy_released", "failed_volume")
    }
    numbers = np.array([[len(step.from_floor(shared).potency) for step in run] for run in runs], float)
    return {name: np.where(stands[:, None], one, np.nan) for name, one in (sums | {"shared_number": numbers}).items()}


def _values_from_floor(
    runs: Sequence[Sequence[StepResult]],
    like_own: Sequence[int],
    geometry: Geometry,
    distances: Sequence[float],
    floor: float,
) -> dict[str, Any]:
    """Numbers by opening from a floor on (log10 m3), and the events counted, as variables of plans.layout.

    They are those of the runs `like_own`; numbers of other runs are NaN.
    """
    shape = (len(runs), len(runs[0]), len(geometry.mined) + 1)
    values = {name: np.full(shape, np.nan) for name in ("number", "potency", "squares", "largest")}
    values["number_within"] = np.full((*shape, len(distances)), np.nan)
    events: dict[str, list] = {"location": [], "potency": [], "step": [], "run": []}
    for number in like_own:
        for index, step in enumerate(runs[number]):
            counted = step.from_floor(floor)
            for name, by_opening in counts(counted, geometry, index, distances).items():
                values[name][number, index] = by_opening
            events["location"].append(counted.location)
            events["potency"].append(counted.potency)
            events["step"].append(np.full(len(counted.potency), index, np.int32))
            events["run"].append(np.full(len(counted.potency), number, np.int32))
    of_events = {f"event_{name}": np.concatenate(parts) for name, parts in events.items()}
    return values | of_events | {"event_location": of_events["event_location"].reshape(-1, 3)}
