"""Sets of events that were extracted from the rock of one trial with different settings, in one dataset."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

EXTRACTION = "extraction"  # Variable (event,): number of the set that an event is of.


def joined(sets: Sequence[xr.Dataset]) -> xr.Dataset:
    """One dataset of several sets of events, with the attributes of the first and the potency floor of each."""
    together = xr.concat(list(sets), dim="event", combine_attrs="override")
    together[EXTRACTION] = ("event", np.repeat(np.arange(len(sets)), [one.sizes["event"] for one in sets]))
    return together.assign_attrs(potency_floors=[float(one.attrs["potency_floor"]) for one in sets])


def extractions(trial: xr.Dataset) -> list[xr.Dataset]:
    """The sets of events of a trial, in order, each with its own potency floor."""
    number = trial[EXTRACTION].values
    return [
        trial.isel(event=np.flatnonzero(number == one)).assign_attrs(potency_floor=float(floor))
        for one, floor in enumerate(np.atleast_1d(trial.attrs["potency_floors"]))
    ]
