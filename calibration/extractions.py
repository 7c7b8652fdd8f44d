"""Sets of events that were extracted from the rock of one trial with different settings, in one dataset."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

EXTRACTION = "extraction"  # Variable (event,): number of the set that an event is of.


def joined(sets: Sequence[xr.Dataset]) -> xr.Dataset:
    """One dataset of several sets of events, with the attributes of the first."""
    together = xr.concat(list(sets), dim="event", combine_attrs="override")
    together[EXTRACTION] = ("event", np.repeat(np.arange(len(sets)), [one.sizes["event"] for one in sets]))
    return together.assign_attrs(extractions=len(sets))


def extractions(trial: xr.Dataset) -> list[xr.Dataset]:
    """The sets of events of a trial, in order."""
    number = trial[EXTRACTION].values
    return [trial.isel(event=np.flatnonzero(number == one)) for one in range(int(trial.attrs["extractions"]))]
