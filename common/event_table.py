"""The event table: every variable of a catalogue, defined once, one way to make it, one check.

Events of a step (events/<step>.nc), the synthetic catalogue (catalog.nc), a record (record.nc), a twin and what QuakeML
carries have this same form, so that every comparison reads both sides with the same lines. It is checked when a file is
written and when it is read. Missing values are NaN, NaT, -1 (integers) or "" (text).
"""

import os
from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import DTypeLike, NDArray

from common.datasets import read_dataset, write_dataset
from common.errors import InputError
from common.fields import FILE_REMEDY, TEXT, Field

CATALOG_KINDS = ("synthetic", "recorded", "twin")
DIMENSION_SIZES = {"xyz": 3, "axis": 3}
REQUIRED_ATTRIBUTES = ("mine", "kind")
UNDATED = {"start": "", "end": "", "dated": 0}  # Attributes of the events of a step without dates.
MISSING_VALUES = {"f": np.nan, "i": -1, "M": np.datetime64("NaT", "ns"), TEXT.kind: ""}
TIME_ENCODING = {  # xarray would choose the unit by the values, and one that may be coarser
    "units": "nanoseconds since 1970-01-01",
    "calendar": "proleptic_gregorian",
    "dtype": "int64",
    "_FillValue": np.iinfo(np.int64).min,  # how numpy itself stores NaT
}


def _field(name: str, dims: str, dtype: DTypeLike, unit: str, meaning: str) -> Field:
    return Field(name, tuple(dims.split()), dtype, unit, meaning)


FIELDS = (
    _field("time", "event", "datetime64[ns]", "", "origin time, UTC; of a model by rank within its step"),
    _field("time_lower_uncertainty", "event", "f8", "s", "the event is at most this much earlier than its time"),
    _field("time_upper_uncertainty", "event", "f8", "s", "the event is at most this much later than its time"),
    _field("location", "event xyz", "f8", "m", "source location in the mine frame: east, north, up"),
    _field("potency_tensor", "event xyz axis", "f8", "m3", "potency tensor, tensor shear, opening positive"),
    _field("potency", "event", "f8", "m3", "scalar potency sqrt(2 P_ij P_ij): slip times area for shear"),
    _field(
        "moment_tensor", "event xyz axis", "f8", "N m", "moment tensor lambda tr(P) I + 2 mu P, summed over the source"
    ),
    _field("moment", "event", "f8", "N m", "scalar moment sqrt(M_ij M_ij / 2)"),
    _field("mw", "event", "f8", "1", "moment magnitude 2/3 (log10 M0 - 9.1)"),
    _field("p_axis", "event xyz", "f8", "1", "most compressive axis, unit vector pointing down; NaN where none is"),
    _field("b_axis", "event xyz", "f8", "1", "intermediate axis, unit vector pointing down; NaN where none is"),
    _field("t_axis", "event xyz", "f8", "1", "most tensile axis, unit vector pointing down; NaN where none is"),
    _field("iso", "event", "f8", "1", "isotropic share of the potency tensor (Vavrycuk 2015), signed"),
    _field("clvd", "event", "f8", "1", "CLVD share of the potency tensor, signed"),
    _field("dc", "event", "f8", "1", "double-couple share of the potency tensor; |iso| + |clvd| + dc = 1"),
    _field("particles", "event", "i4", "1", "particles that make the event; -1 in a record"),
    _field("resolved", "event", "i1", "1", "1: counts in size, location and axis statistics; 0: in the budget only"),
    _field("source_size", "event", "f8", "m", "diameter of the uniform ball as spread out as the source"),
    _field(
        "step",
        "event",
        TEXT,
        "",
        "name of the mining step; in a record as its column says, else empty",
    ),
)
NAMES = tuple(field.name for field in FIELDS)
ON_PLANES = _field(
    "on_planes", "event", "f8", "1", "share of the potency that is slip on weak planes; only where rock has some"
)

LOCATION_UNCERTAINTY = _field(
    "location_uncertainty", "event", "f8", "m", "root mean square location error of the event, where a record states it"
)
EVENT_ID = _field("event_id", "event", TEXT, "", "name of the event: its step, and its rank among the step's events")
NEAREST_OPENING = _field(
    "nearest_opening", "event", TEXT, "", "name of the nearest excavation that is mined in the event's step or before"
)
OPENING_DISTANCE = _field("opening_distance", "event", "f8", "m", "distance to the cells of that excavation, 0 inside")
LABELS = (EVENT_ID, NEAREST_OPENING, OPENING_DISTANCE)
RADIATED_ENERGY = _field("radiated_energy", "event", "f8", "J", "radiated energy, where a record states it")
SOURCE_RADIUS = _field("source_radius", "event", "f8", "m", "source radius, where a record states it")
STATIC_STRESS_DROP = _field("static_stress_drop", "event", "f8", "Pa", "static stress drop, where a record states it")
STATED = (RADIATED_ENERGY, SOURCE_RADIUS, STATIC_STRESS_DROP)  # By the networks of some records.
OPTIONAL_FIELDS = (ON_PLANES, LOCATION_UNCERTAINTY, *LABELS, *STATED)


def event_dataset(values: Mapping[str, NDArray], attributes: Mapping) -> xr.Dataset:
    """A dataset of all FIELDS from arrays by name. Raises InputError where one is missing, unknown or misshapen."""
    for name in sorted(set(NAMES) ^ set(values)):
        raise InputError(f"events: {name} is {'unknown' if name in values else 'missing'}; all are {', '.join(NAMES)}")
    data = {}
    for field in FIELDS:
        array = np.asarray(values[field.name]).astype(field.dtype)
        expected = (len(values[NAMES[0]]), *(DIMENSION_SIZES[dim] for dim in field.dims[1:]))
        if array.shape != expected:
            raise InputError(f"events: {field.name} has shape {array.shape}, not {expected}")
        data[field.name] = (field.dims, array, field.attributes)
    return check_events(xr.Dataset(data, attrs=dict(attributes)), "events")


def new_catalog(count: int, attributes: Mapping, **values) -> xr.Dataset:
    """A catalogue of `count` events with the given variables; every variable not given holds its missing value.

    `resolved` is the exception: it is 1 unless given, as every recorded event is an event. Raises as event_dataset.
    """
    absent = {}
    for field in FIELDS:
        missing = 1 if field.name == "resolved" else MISSING_VALUES[field.dtype.kind]
        absent[field.name] = np.full((count, *(DIMENSION_SIZES[dim] for dim in field.dims[1:])), missing, field.dtype)
    return event_dataset(absent | values, attributes)


def check_events(dataset: xr.Dataset, source: str) -> xr.Dataset:
    """Copy of events, text and time as the table has them. Other variables are allowed; `source` names it in errors.

    Raises InputError, one line, where a variable or attribute is missing or is not what the table says.
    """
    for name in REQUIRED_ATTRIBUTES:
        if name not in dataset.attrs:
            raise InputError(f"{source}: attribute {name} is missing; {FILE_REMEDY}")
    if dataset.attrs["kind"] not in CATALOG_KINDS:
        raise InputError(
            f"{source}: attribute kind is {dataset.attrs['kind']!r}, none of {', '.join(CATALOG_KINDS)}; {FILE_REMEDY}"
        )
    dataset = dataset.copy()
    for field in FIELDS:
        field.check(dataset, source)
        if field.dtype == TEXT:
            dataset[field.name] = dataset[field.name].astype(TEXT)
    for field in OPTIONAL_FIELDS:
        if field.name in dataset:
            field.check(dataset, source)
            if field.dtype == TEXT:
                dataset[field.name] = dataset[field.name].astype(TEXT)
    for dim, size in DIMENSION_SIZES.items():
        if dataset.sizes[dim] != size:
            raise InputError(f"{source}: dimension {dim} has length {dataset.sizes[dim]}, not {size}; {FILE_REMEDY}")
    dataset["time"].encoding = dict(TIME_ENCODING)
    return dataset


def read_events(path: str | os.PathLike) -> xr.Dataset:
    """The events of a file. Raises InputError for one that is missing, unreadable or of another form."""
    return check_events(read_dataset(path), os.fspath(path))


def write_events(dataset: xr.Dataset, path: str | os.PathLike) -> None:
    """Write events to netCDF atomically. Raises InputError, and writes nothing, if they are not of this form."""
    write_dataset(check_events(dataset, os.fspath(path)), path)
