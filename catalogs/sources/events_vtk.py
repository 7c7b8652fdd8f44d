"""A catalogue as points for ParaView, with sizes and axes for glyphs, and times for an animation."""

import os

import numpy as np
import xarray as xr

from catalogs.sources.sizes import log_potency
from common.voigt import voigt_from_tensor
from common.vtk import TENSOR_ORDER, write_mesh

EVENT_ARRAYS = {  # variable of the catalogue: its array, with its unit
    "potency": "potency_m3",
    "moment": "moment_N_m",
    "mw": "mw",
    "p_axis": "p_axis",
    "b_axis": "b_axis",
    "t_axis": "t_axis",
    "iso": "iso",
    "clvd": "clvd",
    "dc": "dc",
    "particles": "particles",
    "resolved": "resolved",
    "source_size": "source_size_m",
    "time_lower_uncertainty": "time_lower_uncertainty_s",
    "time_upper_uncertainty": "time_upper_uncertainty_s",
}


def write_points(catalog: xr.Dataset, path: str | os.PathLike) -> None:
    """Write one vertex per event, in the catalogue's order; what is not known is NaN, or -1 (particles).

    step: number of the event's mining step in the order of the events, -1 in a record.
    """
    location = catalog["location"].values
    data = {name: catalog[field].values for field, name in EVENT_ARRAYS.items()}
    data["log10_potency"] = log_potency(catalog["potency"].values)
    data["potency_tensor_m3"] = voigt_from_tensor(catalog["potency_tensor"].values)[:, TENSOR_ORDER]
    time = catalog["time"].values.astype("datetime64[ns]")
    days = (time - np.datetime64("1970-01-01", "ns")) / np.timedelta64(1, "D")
    data["time_days_since_1970"] = np.where(np.isnat(time), np.nan, days)
    steps = catalog["step"].values.astype(str)
    names = list(dict.fromkeys(steps[steps != ""]))
    data["step"] = np.array([names.index(step) if step else -1 for step in steps], np.int32)
    write_mesh(path, location, "vertex", np.arange(len(location))[:, None], point_data=data)
