"""Layout of outcome.nc: every variable with its dimensions, unit and meaning, in one table.

Dimensions: run (the plan's own first), step (the dated ones, in order), opening (those that the plan mines, then "any"
for all together), distance, size (the classes of the mine file, the smallest first; none without any), period (the
steps, then "all": those that are ahead of the record, or all if none is), interval (lower, upper: 95 %), event (of the
plan's own run and of its members), draw, xyz. Steps, openings, sizes, periods and intervals carry their names,
distances their value.

Events count if they are resolved and at least as large as `floor`, the largest of the floors of the own runs of all
plans, of their members and, with a record, of the cut of its comparison. Runs on other cells have a larger floor. So
numbers of all kinds of runs are counted from `shared_floor`, too.

NaN: numbers by opening of runs on other cells or in other rock, a size where there is no event, forecasts of steps that
are not ahead, chances near an opening in steps before it is mined, and of a size below the floor.

Attributes: mine, plan, floor and shared_floor (log10 m3), shear_modulus (Pa), recorded_until (ISO; time of the last
recorded event, or the later end that the configuration states; empty without a record), steps_ahead (JSON), differs_in
(JSON: sections of the mine file that the plan has otherwise, beside the sequence), contains and lacks (JSON: what the
intervals contain and lack), law_source ("record" | "model" | "none"), law_events, law_b, law_bound (log10 m3; medians),
law_b_interval, law_bound_interval, runs (the plan's own and its members), number_dispersion (variance over mean of the
number that a step is forecast with), config_hash, source_hash, made_from, versions. ratio_text is a sentence for the
reader.
"""

import os

import numpy as np
import xarray as xr
from numpy.typing import DTypeLike

from common.datasets import read_dataset
from common.errors import InputError
from common.fields import FILE_REMEDY, TEXT, Field

ANY = "any"  # Name, in addition to those of the openings, of all of them together.
OWN, MEMBER, COARSE, DRAW = "own", "member", "coarse", "draw"
LOG_M3 = "log10(m3)"
LIKE_OWN = (OWN, MEMBER)  # Kinds of runs that differ from the plan's own by chance only.


def _field(name: str, dims: str, unit: str, meaning: str, dtype: DTypeLike = np.float64) -> Field:
    return Field(name, tuple(dims.split()), dtype, unit, meaning)


FIELDS = (
    # what the runs made
    _field("run_kind", "run", "", "own, member (of the ensemble), coarse (doubled cells) or draw (of the rock)", TEXT),
    _field("number", "run step opening", "1", "events from the floor on, by the nearest opening mined by then"),
    _field("potency", "run step opening", "m3", "their summed potency"),
    _field("squares", "run step opening", "m6", "sum of their squared potencies"),
    _field("largest", "run step opening", LOG_M3, "largest of them"),
    _field("number_within", "run step opening distance", "1", "events within a distance of an opening mined by then"),
    _field("shared_number", "run step", "1", "events from the shared floor on"),
    _field("whole_potency", "run step", "m3", "summed potency of all events, of whatever size"),
    _field("energy_released", "run step", "J", "energy released (Salamon 1984)"),
    _field("failed_volume", "run step", "m3", "rock that failed"),
    # the plan
    _field("start", "step", "", "first date, ISO, UTC", TEXT),
    _field("end", "step", "", "first date after it", TEXT),
    _field("days", "step", "d", "duration"),
    _field("mined", "step", "m3", "rock that the step mines, on the grid"),
    _field("made_by", "step", "", "digest of states and events of all runs: the same in plans that share it", TEXT),
    _field("opening_step", "opening", "", "step that mines it; empty: mined before the first of them", TEXT),
    _field("opening_volume", "opening", "m3", "its volume on the grid"),
    # hazard
    _field("size_magnitude", "size", "1", "moment magnitude of the class"),
    _field("size_log_potency", "size", LOG_M3, "its potency, by the shear modulus of the host"),
    _field("period_days", "period", "d", "duration of the steps of the period"),
    _field("expected", "period opening distance", "1", "expected number of events from the floor on"),
    _field("expected_interval", "period opening distance interval", "1", "its 95 % interval"),
    _field("chance", "period opening distance size", "1", "chance of an event of the class or a larger one"),
    _field("chance_interval", "period opening distance size interval", "1", "its 95 % interval"),
    _field("yearly_chance", "period opening distance size", "1", "the same of a year at the rate of the period"),
    _field("yearly_chance_interval", "period opening distance size interval", "1", "its 95 % interval"),
    _field("yearly_number", "period opening distance size", "1", "expected number of such events a year"),
    # forecast of each step that is ahead
    _field("forecast_number", "step draw", "1", "number of events from the floor on"),
    _field("forecast_potency", "step draw", "m3", "their summed potency"),
    _field("forecast_largest", "step draw", LOG_M3, "largest of them; -inf without one"),
    # events of the plan's own run and of its members
    _field("event_location", "event xyz", "m", "location in the mine frame"),
    _field("event_potency", "event", "m3", "potency"),
    _field("event_step", "event", "1", "index of the step", np.int32),
    _field("event_run", "event", "1", "index of the run", np.int32),
    # coordinates
    _field("step", "step", "", "name of the step", TEXT),
    _field("opening", "opening", "", "name of the opening", TEXT),
    _field("size", "size", "", "name of the class of size", TEXT),
    _field("period", "period", "", "name of the step, or all", TEXT),
    _field("interval", "interval", "", "lower and upper end of a 95 % interval", TEXT),
    _field("distance", "distance", "m", "distance from the opening"),
)  # fmt: skip


def described(dataset: xr.Dataset) -> xr.Dataset:
    """The outcome with unit and meaning on every variable. Raises ValueError for one that is not in the table."""
    fields = {field.name: field for field in FIELDS}
    if foreign := set(map(str, dataset.variables)) - set(fields):
        raise ValueError(f"outcome: {', '.join(sorted(foreign))} not in the layout")
    for name, variable in dataset.variables.items():
        variable.attrs = fields[str(name)].attributes
    return check_outcome(dataset, "outcome")


def check_outcome(dataset: xr.Dataset, source: str) -> xr.Dataset:
    """The same outcome, text as the table has it. Raises InputError, one line, where it is not of this form."""
    for name in ("mine", "plan", "floor", "shared_floor", "recorded_until", "steps_ahead"):
        if name not in dataset.attrs:
            raise InputError(f"{source}: attribute {name} is missing; {FILE_REMEDY}")
    dataset = dataset.copy()
    for field in FIELDS:
        if field.dtype == TEXT and field.name in dataset.variables:
            dataset[field.name] = dataset[field.name].astype(TEXT)
        field.check(dataset, source)
    return dataset


def read_outcome(path: str | os.PathLike) -> xr.Dataset:
    """The outcome of a file. Raises InputError for one that is missing, unreadable or of another form."""
    return check_outcome(read_dataset(path), os.fspath(path))
