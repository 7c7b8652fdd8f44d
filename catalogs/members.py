"""The events of an ensemble's members: other runs of the model, as likely as the mine's own."""

import os
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from common.errors import InputError
from common.event_table import NAMES, check_events, read_events


def read_members(folders: list[str | os.PathLike], steps: list[str], mine: str) -> list[xr.Dataset]:
    """One catalogue (form of common.event_table) of each member: events of the dated steps, in order of time.

    folders: each with events/<step>.nc. Raises InputError for a missing or unreadable file, or one of another mine.
    """
    return [_read_member(Path(folder), steps, mine) for folder in folders]


def _read_member(folder: Path, steps: list[str], mine: str) -> xr.Dataset:
    parts = []
    for step in steps:
        path = folder / "events" / f"{step}.nc"
        events = read_events(path)
        if events.attrs["mine"] != mine:
            raise InputError(f"{path}: is of mine {events.attrs['mine']}, not of {mine}")
        parts.append(events[list(NAMES)].drop_attrs(deep=False))
    joined = xr.concat(parts, "event").sortby("time")  # stable: ties stay in the order of steps, and of events in one
    return check_events(joined.assign_attrs(mine=mine, kind="synthetic"), str(folder))


def all_runs(catalog: xr.Dataset, members: list[xr.Dataset]) -> tuple[xr.Dataset, NDArray | None]:
    """Events of all runs, the mine's own first, and the number of the run of each (event,); None if there is one."""
    if not members:
        return catalog, None
    runs = [catalog, *members]
    joined = xr.concat([run[list(NAMES)].drop_attrs(deep=False) for run in runs], "event").assign_attrs(catalog.attrs)
    return joined, np.repeat(np.arange(len(runs)), [run.sizes["event"] for run in runs])
