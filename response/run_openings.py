"""Openings of a mining plan in each of its runs, after the last step: opening_runs.nc.

A plan's own run has the whole table of openings, as the mine has. Of its members only the end is kept, which tells a
difference between plans from chance. The layout is declared in common/opening_table.py.
"""

from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from common.datasets import read_dataset
from common.opening_table import ALL, RUN_FIELDS, SIDES
from response.openings import read_and_measure
from response.settings import PlanOpeningSlice

COLUMNS = {"depth_largest": "depth_largest", "closure": "closure_median", "failed_volume": "failed_volume"}


def plan_tables(settings: PlanOpeningSlice, grid: Path, record: Path | None) -> tuple[xr.Dataset, xr.Dataset]:
    """The table of openings of the plan's own run, and the openings of all runs after the last step."""
    tables = (
        read_and_measure(
            settings, grid, [Path(path) for path in run.states], [Path(path) for path in run.events], record
        )
        for run in settings.runs
    )
    own = next(tables)
    ends = [own_end := at_the_end(own, settings), *(at_the_end(one, settings) for one in tables)]
    names = [entry.name for entry in settings.excavations if entry.mined]
    with_rows = np.flatnonzero(own_end["has_rows"])
    values: dict[str, object] = {
        "run": [run.kind for run in settings.runs],
        "opening": [names[place] for place in with_rows],
        "filled": own_end["filled"][with_rows],
    }
    for name in ("depth_largest", "depth_p90", "side", "closure", "failed_volume"):
        values[name] = np.stack([end[name][with_rows] for end in ends])
    found = xr.Dataset(
        {field.name: (field.dims, np.array(values[field.name], field.dtype), field.attributes) for field in RUN_FIELDS},
        attrs={
            "plan": settings.plan,
            "step": settings.steps[-1].name,
            "fine_cell": float(read_dataset(grid, names=()).attrs["fine_cell"]),
        },
    )
    return own, found


def at_the_end(table: xr.Dataset, settings: PlanOpeningSlice) -> dict[str, NDArray]:
    """Columns of RUN_FIELDS (opening,) after the last step, of the excavations that the plan mines, in their order.

    has_rows (opening,) bool: those with walls of their own. An excavation has none where others have mined its rock.
    """
    names = {entry.name: place for place, entry in enumerate(one for one in settings.excavations if one.mined)}
    found: dict[str, NDArray] = {name: np.full(len(names), np.nan) for name in (*COLUMNS, "depth_p90")}
    found |= {"side": np.full(len(names), "", object), "filled": np.zeros(len(names), np.int8)}
    found["has_rows"] = np.zeros(len(names), bool)
    ends = (table["step"].values == settings.steps[-1].name) & np.isnan(table["chainage_from"].values)
    for row in np.flatnonzero(ends):
        place, side = names[str(table["excavation"].values[row])], str(table["side"].values[row])
        if side == ALL:
            found["has_rows"][place], found["filled"][place] = True, table["filled"].values[row]
            for name, column in COLUMNS.items():
                found[name][place] = table[column].values[row]
        elif side in SIDES:
            depth = float(table["depth_p90"].values[row])
            if not found["depth_p90"][place] >= depth:
                found["depth_p90"][place], found["side"][place] = depth, side if depth > 0.0 else ""
    return found
