"""Layout of shaking.nc: every variable with its dimensions, unit and meaning, in one table.

Dimensions: step (the dated ones, in order), opening (those that are mined), chance, interval (lower, upper: 95 %), side
(roof, walls, floor, face), velocity_of_curve, magnitude_class, distance_class (their edges have one more), xyz.

NaN: what is about an opening in steps before it is mined; magnitudes, distances and shares where no event makes the
velocity; demands of a side without a depth. A velocity of 0 means that the model has too few events for the chance.

Attributes: mine, relation (its name), relation_text, source (citation), fit_text (of fitted coefficients, else empty),
runs (the mine's own and its members), dispersion, run_dispersion, event_ratio (model over record; NaN without one),
displacement (m; NaN if no demand is asked for), density (kg/m3), depth_source (words), support (JSON), and those of a
job's provenance.
"""

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import DTypeLike

from common.datasets import read_dataset
from common.errors import InputError
from common.fields import FILE_REMEDY, TEXT, Field

ATTRIBUTES = (
    *("mine", "relation", "relation_text", "source", "fit_text", "runs", "dispersion", "event_ratio"),
    *("displacement", "density", "depth_source", "support"),
)


def _field(name: str, dims: str, unit: str, meaning: str, dtype: DTypeLike = np.float64) -> Field:
    return Field(name, tuple(dims.split()), dtype, unit, meaning)


FIELDS = (
    _field("days", "step", "d", "duration"),
    _field("expected_events", "step", "1", "resolved events in the step, mean of the runs"),
    _field("filled", "step opening", "1", "1: filled in this step or before; 0: open; -1: not mined yet", np.int8),
    _field("velocity", "step opening chance", "m/s", "peak ground velocity that is exceeded with the chance"),
    _field("velocity_interval", "step opening chance interval", "m/s", "its 95 % interval"),
    _field("magnitude", "step opening chance", "1", "mean Mw of the events that exceed it, by their chances to"),
    _field("distance", "step opening chance", "m", "their mean distance from the opening"),
    _field("top_share", "step opening chance", "1", "share of the exceedances that the event with most of them makes"),
    _field("top_magnitude", "step opening chance", "1", "Mw of this event"),
    _field("top_distance", "step opening chance", "m", "its distance from the opening"),
    _field("top_location", "step opening chance xyz", "m", "its location in the mine frame"),
    _field("outside_share", "step opening chance", "1", "share of exceedances beyond the range of the relation"),
    _field("share", "step opening chance magnitude_class distance_class", "1", "share of exceedances by class"),
    _field("curve", "step opening velocity_of_curve", "1", "chance in the step that the velocity is exceeded"),
    _field("depth", "step opening side", "m", "depth of the rock that is thrown"),
    _field("demand", "step opening chance side", "J/m2", "dynamic demand on support at the velocity"),
    _field("demand_interval", "step opening chance side interval", "J/m2", "at the ends of the velocity's interval"),
    _field("carried_by", "step opening chance side", "", "weakest class of support of enough stated capacity", TEXT),
    _field("magnitude_edge", "magnitude_edge", "1", "edges of the classes of Mw"),
    _field("distance_edge", "distance_edge", "m", "edges of the classes of distance; the last one is open"),
    _field("step", "step", "", "name of the step", TEXT),
    _field("opening", "opening", "", "name of the opening", TEXT),
    _field("side", "side", "", "side of the opening", TEXT),
    _field("chance", "chance", "1", "chance in the step"),
    _field("interval", "interval", "", "lower and upper end of a 95 % interval", TEXT),
    _field("velocity_of_curve", "velocity_of_curve", "m/s", "velocity"),
)  # fmt: skip


def new_shaking(values: Mapping[str, Any], attributes: Mapping) -> xr.Dataset:
    """A dataset of these variables. Raises InputError where one is missing or not of the table's form."""
    fields = {field.name: field for field in FIELDS}
    variables = {
        name: (fields[name].dims, np.array(one, object) if fields[name].dtype == TEXT else one, fields[name].attributes)
        for name, one in values.items()
    }
    return check_shaking(xr.Dataset(variables, attrs=dict(attributes)), "shaking")


def check_shaking(dataset: xr.Dataset, source: str) -> xr.Dataset:
    """The dataset with text as the table has it. Raises InputError, one line, where it is not of this form."""
    for name in ATTRIBUTES:
        if name not in dataset.attrs:
            raise InputError(f"{source}: attribute {name} is missing; {FILE_REMEDY}")
    dataset = dataset.copy()
    for field in FIELDS:
        if field.dtype == TEXT and field.name in dataset.variables:
            dataset[field.name] = dataset[field.name].astype(TEXT)
        field.check(dataset, source)
    return dataset


def read_shaking(path: str | os.PathLike) -> xr.Dataset:
    """The shaking of a file. Raises InputError for one that is missing, unreadable or of another form."""
    return check_shaking(read_dataset(path), os.fspath(path))
