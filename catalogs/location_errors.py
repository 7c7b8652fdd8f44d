"""Location error of each recorded event: its own stated uncertainty, else the record's location error."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from common.event_table import LOCATION_UNCERTAINTY


def location_errors(record: xr.Dataset) -> NDArray:
    """Root mean square location error (event,), m; 0 where nothing is known."""
    general = float(record.attrs.get("location_error", 0.0))
    name = LOCATION_UNCERTAINTY.name
    stated = record[name].values if name in record else np.full(record.sizes["event"], np.nan)
    return np.where(np.isfinite(stated), stated, general if np.isfinite(general) else 0.0)
