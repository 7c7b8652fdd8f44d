"""What tells the events of a synthetic catalogue apart and where they are: a name that stays, and the nearest opening.

The name of an event is that of its step and its rank among the events of the step, in the order in which these begin
(seismic/events.py). So it is the same in repeated runs and with any number of threads, and steps that are added later
do not change it. It is another one where the events of its own step change: with other rock, cells or settings.
"""

import os
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from catalogs.sources.openings import NEVER, Mining
from common.datasets import atomic_path
from common.event_table import EVENT_ID, NEAREST_OPENING, OPENING_DISTANCE

DIGITS = 5  # At least so many of a rank.


def event_ids(step: Sequence[str] | NDArray) -> NDArray:
    """Names of events from their steps (event,) in the catalogue's order, which is that of their beginnings in a step.

    >>> event_ids(["2019-08", "2019-08", "2019-09"]).tolist()
    ['2019-08-00001', '2019-08-00002', '2019-09-00001']
    """
    rank = pd.Series(np.asarray(step, object)).groupby(np.asarray(step, object)).cumcount().to_numpy() + 1
    return np.array([f"{name}-{number:0{DIGITS}d}" for name, number in zip(step, rank, strict=True)], object)


def label_events(
    catalog: xr.Dataset, grid: xr.Dataset, openings: Sequence[Mapping], steps: Sequence[str]
) -> xr.Dataset:
    """The catalogue with the name of each event, the nearest opening and the distance to it.

    An opening counts from the step that mines it on, as far as it is not filled and mined again by another one; of
    several as near, the one mined last is named. The distance is that to the finest cells of which the opening has a
    part, 0 within them. grid: dataset of grid.nc; openings: of all excavations in its order the `name` and the places
    in the order of `steps` that they are `mined` and `filled` in, negative for none; steps: names of all steps.
    """
    mined, filled = (
        np.array([one[key] if one[key] >= 0 else NEVER for one in openings], np.int64) for key in ("mined", "filled")
    )
    place = {name: number for number, name in enumerate(steps)}
    own = np.array([place[str(name)] for name in catalog["step"].values], np.int64)
    names, distance = np.full(len(own), "", object), np.full(len(own), np.nan)
    if len(openings) and len(own):
        axes = list(range(3)) if grid.attrs["plane"] == "none" else ["xyz".index(axis) for axis in grid.attrs["plane"]]
        mining, edge = Mining.of(grid, mined, filled), float(grid.attrs["fine_cell"])
        found, distance = mining.nearest_open(catalog["location"].values[:, axes], own, edge, axes)
        names[found >= 0] = np.array([one["name"] for one in openings], object)[found[found >= 0]]
    values = {EVENT_ID: event_ids(catalog["step"].values), NEAREST_OPENING: names, OPENING_DISTANCE: distance}
    return catalog.assign({field.name: (field.dims, column, field.attributes) for field, column in values.items()})


def label_columns(catalog: xr.Dataset) -> dict[str, ArrayLike]:
    """Columns of these labels for catalog.csv; none for a catalogue without them."""
    if EVENT_ID.name not in catalog:
        return {}
    distance = [f"{value:.2f}" if np.isfinite(value) else "" for value in catalog[OPENING_DISTANCE.name].values]
    return {
        EVENT_ID.name: catalog[EVENT_ID.name].values,
        NEAREST_OPENING.name: catalog[NEAREST_OPENING.name].values,
        f"{OPENING_DISTANCE.name}_m": distance,
    }


def append_columns(columns: Mapping[str, ArrayLike], path: str | os.PathLike) -> None:
    """Append columns to a CSV file atomically; those that it has stay as they are, letter by letter."""
    table = pd.read_csv(path, dtype=str, keep_default_na=False)
    with atomic_path(path) as temporary:
        table.assign(**columns).to_csv(temporary, index=False, lineterminator="\n", encoding="utf-8")
