"""The table of an event dataset's variables: one schema for the events of a step and for a catalogue."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

MISSING_TIME = np.iinfo(np.int64).min  # numpy's own NaT
TIME_ENCODING = {
    "units": "microseconds since 1970-01-01",  # fixed: xarray would choose unit and origin by the content
    "calendar": "proleptic_gregorian",
    "dtype": "int64",
    "_FillValue": MISSING_TIME,
}


@dataclass(frozen=True)
class Field:
    """One variable: its name, dimensions, type, unit ("" for none) and meaning."""

    name: str
    dims: tuple[str, ...]
    dtype: str
    unit: str
    meaning: str


FIELDS = (
    Field("time", ("event",), "datetime64[ns]", "", "by rank within the step; NaT in a step without dates"),
    Field(
        "time_uncertainty", ("event",), "float64", "s", "half the step: the model orders events, it does not date them"
    ),
    Field(
        "location", ("event", "xyz"), "float64", "m", "potency-weighted mean of the particles; x east, y north, z up"
    ),
    Field("potency_tensor", ("event", "xyz", "axis"), "float64", "m3", "sum over the particles; opening is positive"),
    Field("potency", ("event",), "float64", "m3", "scalar, sqrt(2 P_ij P_ij)"),
    Field("moment", ("event",), "float64", "N m", "scalar, sqrt(M_ij M_ij / 2), M of the host rock's moduli"),
    Field("mw", ("event",), "float64", "1", "moment magnitude, 2/3 (log10 moment - 9.1)"),
    Field("p_axis", ("event", "xyz"), "float64", "1", "most compressive axis, unit vector pointing down"),
    Field("b_axis", ("event", "xyz"), "float64", "1", "intermediate axis, unit vector pointing down"),
    Field("t_axis", ("event", "xyz"), "float64", "1", "most tensile axis, unit vector pointing down"),
    Field("iso", ("event",), "float64", "1", "isotropic share of the potency tensor (Vavrycuk 2015), opening positive"),
    Field("clvd", ("event",), "float64", "1", "CLVD share, signed; sum of absolutes of the three shares is 1"),
    Field("dc", ("event",), "float64", "1", "double-couple share"),
    Field("particles", ("event",), "int32", "1", "failed particles of the event"),
    Field("resolved", ("event",), "int8", "1", "0: too few particles; in the budget, in no statistics"),
    Field(
        "source_size", ("event",), "float64", "m", "diameter of the uniform ball (2-D: disc) as spread out as the event"
    ),
    Field("step", ("event",), "str", "", "name of the mining step"),
)


def event_dataset(values: dict[str, NDArray], attributes: dict) -> xr.Dataset:
    """A dataset of all FIELDS from arrays by name, checked for completeness, with an encoding that round-trips."""
    if set(values) != {field.name for field in FIELDS}:
        raise ValueError(f"event fields differ from the schema: {set(values) ^ {field.name for field in FIELDS}}")
    variables = {}
    for field in FIELDS:
        described = {"long_name": field.meaning} | ({"units": field.unit} if field.unit else {})
        variables[field.name] = xr.Variable(field.dims, np.asarray(values[field.name]).astype(field.dtype), described)
    dataset = xr.Dataset(variables, attrs=attributes)
    dataset["time"].encoding = dict(TIME_ENCODING)
    return dataset
