"""The catalogue: one table of its variables, one way to make it, one check.

A synthetic catalogue (written by `seismic`), a recorded one and a twin have this same form, so that every comparison
reads both with the same lines. Missing values are NaN, NaT, -1 (integers) or "" (text).
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from pipeline.errors import InputError

KINDS = ("synthetic", "recorded", "twin")
TIME_UNITS = "nanoseconds since 1970-01-01T00:00:00"
NOT_A_TIME = np.iinfo(np.int64).min  # how numpy itself stores NaT


@dataclass(frozen=True)
class Variable:
    """One variable of a catalogue: its dimensions, type, unit, and what it means."""

    name: str
    dims: tuple[str, ...]
    dtype: np.dtype
    unit: str
    meaning: str

    @property
    def missing(self):
        """The value that stands for 'not known' in this variable."""
        return {"f": np.nan, "i": -1, "M": np.datetime64("NaT", "ns"), "O": ""}[self.dtype.kind]


def _variable(name: str, dims: str, dtype: str, unit: str, meaning: str) -> Variable:
    return Variable(name, tuple(dims.split()), np.dtype(dtype), unit, meaning)


VARIABLES = (
    _variable("time", "event", "datetime64[ns]", "", "origin time, UTC"),
    _variable("time_uncertainty", "event", "f8", "s", "half width of the interval that holds the time"),
    _variable("location", "event xyz", "f8", "m", "source location in the mine frame: east, north, up"),
    _variable("potency_tensor", "event xyz axis", "f8", "m3", "potency tensor, tensor shear, opening positive"),
    _variable("potency", "event", "f8", "m3", "scalar potency sqrt(2 P_ij P_ij): slip times area for shear"),
    _variable("moment", "event", "f8", "N m", "scalar moment sqrt(M_ij M_ij / 2), M = lambda tr(P) I + 2 mu P"),
    _variable("mw", "event", "f8", "1", "moment magnitude 2/3 (log10 M0 - 9.1)"),
    _variable("p_axis", "event xyz", "f8", "1", "most compressive axis, unit vector pointing down"),
    _variable("b_axis", "event xyz", "f8", "1", "intermediate axis, unit vector pointing down"),
    _variable("t_axis", "event xyz", "f8", "1", "most tensile axis, unit vector pointing down"),
    _variable("iso", "event", "f8", "1", "isotropic share of the potency tensor (Vavrycuk 2015), signed"),
    _variable("clvd", "event", "f8", "1", "CLVD share of the potency tensor, signed"),
    _variable("dc", "event", "f8", "1", "double-couple share of the potency tensor; |iso| + |clvd| + dc = 1"),
    _variable("particles", "event", "i4", "1", "particles that make the event; -1 in a record"),
    _variable("resolved", "event", "i1", "1", "1: counts in size, location and axis statistics; 0: in the budget only"),
    _variable("source_size", "event", "f8", "m", "diameter of the uniform ball as spread out as the source"),
    _variable("step", "event", "O", "", "name of the mining step; empty in a record"),
)
NAMES = tuple(variable.name for variable in VARIABLES)
REQUIRED_ATTRIBUTES = ("mine", "kind")
SIZES = {"xyz": 3, "axis": 3}


def new_catalog(count: int, attributes: dict, **values) -> xr.Dataset:
    """A catalogue of `count` events with the given variables; every variable not given holds its missing value.

    `resolved` is the exception: it is 1 unless given, as every recorded event is an event.
    Raises InputError where a variable is unknown or has the wrong shape, or an attribute is missing.
    """
    unknown = set(values) - set(NAMES)
    if unknown:
        raise InputError(f"catalogue: unknown variable {sorted(unknown)[0]!r}; a catalogue has {', '.join(NAMES)}")
    data = {}
    for variable in VARIABLES:
        shape = (count, *(SIZES[dim] for dim in variable.dims[1:]))
        missing = 1 if variable.name == "resolved" else variable.missing
        array = np.full(shape, missing, dtype=variable.dtype)
        if variable.name in values:
            given = np.asarray(values[variable.name])
            if given.shape != shape:
                raise InputError(f"catalogue: {variable.name} has shape {given.shape}, expected {shape}")
            array[...] = given
        data[variable.name] = (variable.dims, array, _description(variable))
    dataset = xr.Dataset(data, attrs=dict(attributes))
    return check_catalog(dataset)


def _description(variable: Variable) -> dict[str, str]:
    return {"long_name": variable.meaning} | ({"units": variable.unit} if variable.unit else {})


def check_catalog(dataset: xr.Dataset, source: str = "catalogue") -> xr.Dataset:
    """The same catalogue with its types made exact; `source` names it in errors.

    Raises InputError where a variable or attribute is missing, a dimension differs, or a type does not convert.
    """
    for name in REQUIRED_ATTRIBUTES:
        if name not in dataset.attrs:
            raise InputError(f"{source}: attribute {name!r} is missing; make the file again")
    if dataset.attrs["kind"] not in KINDS:
        raise InputError(f"{source}: kind {dataset.attrs['kind']!r} is none of {', '.join(KINDS)}")
    dataset = dataset.copy()
    for variable in VARIABLES:
        if variable.name not in dataset:
            raise InputError(f"{source}: variable {variable.name!r} is missing; make the file again")
        present = dataset[variable.name]
        if present.dims != variable.dims:
            raise InputError(f"{source}: {variable.name} has dimensions {present.dims}, expected {variable.dims}")
        if present.dtype != variable.dtype:
            if present.dtype.kind not in {"O": "UOT", "i": "iu", "f": "fiu", "M": "M"}[variable.dtype.kind]:
                raise InputError(f"{source}: {variable.name} is of type {present.dtype}, expected {variable.dtype}")
            dataset[variable.name] = present.astype(variable.dtype)
        if variable.dtype.kind == "M":
            # int64 nanoseconds: the encoding that xarray would choose depends on the values, and may be coarser
            dataset[variable.name].encoding = {"units": TIME_UNITS, "dtype": "int64", "_FillValue": NOT_A_TIME}
    return dataset
