"""The table of openings, openings.nc: what each step has done to each side of each excavation, and along each drive.

A row is a side of an excavation after a step: its roof, walls, floor or face, or `all` of them together. Rows with a
chainage are stretches of a drive.

opening_runs.nc has the openings of a mining plan in each of its runs after the last step. Its attributes: plan, step
(the last one), fine_cell (m).
"""

import os

import numpy as np
import xarray as xr

from common.datasets import read_dataset
from common.fields import TEXT, Field

ROOF_FROM = 45  # degrees; walls are steeper, roof and floor are flatter.
SIDES = ("roof", "walls", "floor", "face")
ALL = "all"
ROWS = ("row",)
FIELDS = (
    Field("step", ROWS, TEXT, "", "step after which the row holds"),
    Field("excavation", ROWS, TEXT, "", "name of the excavation"),
    Field("side", ROWS, TEXT, "", f"{', '.join(SIDES)} or {ALL}"),
    Field("chainage_from", ROWS, np.float64, "m", "start of the stretch along the drive; NaN: the whole excavation"),
    Field("chainage_to", ROWS, np.float64, "m", "end of the stretch along the drive"),
    Field("filled", ROWS, np.int8, "1", "1 where the excavation has been filled"),
    Field("wall_area", ROWS, np.float64, "m2", "area of its walls with rock behind them"),
    Field("depth_largest", ROWS, np.float64, "m", "largest depth of failure, along the wall's normal"),
    Field("depth_p90", ROWS, np.float64, "m", "depth of failure that nine tenths of the wall do not exceed"),
    Field("depth_mean", ROWS, np.float64, "m", "mean depth of failure over the wall"),
    Field("through_share", ROWS, np.float64, "1", "share of the wall whose failed rock meets another opening, or its"),
    Field(
        "failed_volume",
        ROWS,
        np.float64,
        "m3",
        "volume of failed rock that has not fallen and to which this wall is nearest",
    ),
    Field("failed_volume_step", ROWS, np.float64, "m3", "part of it that failed in this step"),
    Field("fallen_volume", ROWS, np.float64, "m3", "volume of rock that has fallen and to which this wall is nearest"),
    Field("closure_largest", ROWS, np.float64, "m", "largest closure of opposite walls since they were mined"),
    Field("closure_median", ROWS, np.float64, "m", "median closure of opposite walls since they were mined"),
    Field("closure_radial", ROWS, np.float64, "m", "mean inward displacement of the walls since they were mined"),
    Field("major_stress", ROWS, np.float64, "MPa", "largest compression in the first intact rock, mean over the wall"),
    Field("major_stress_change", ROWS, np.float64, "MPa", "what it has changed by since virgin rock"),
    Field("strength_factor", ROWS, np.float64, "1", "least strength over stress of the first intact rock"),
    Field("events_modelled", ROWS, np.int64, "1", "modelled events of the step to which this wall is nearest"),
    Field(
        "events_recorded",
        ROWS,
        np.float64,
        "1",
        "recorded events of the step's dates to which this wall is nearest, if the record reaches them",
    ),
)
RUN_OPENING = ("run", "opening")
RUN_FIELDS = (
    Field("run", ("run",), TEXT, "", "own: the plan's run; member: of its ensemble"),
    Field("opening", ("opening",), TEXT, "", "name of an excavation that the plan mines"),
    Field("filled", ("opening",), np.int8, "1", "1 where the excavation has been filled"),
    Field("depth_largest", RUN_OPENING, np.float64, "m", "largest depth of failure, along the wall's normal"),
    Field("depth_p90", RUN_OPENING, np.float64, "m", "largest depth that nine tenths of a side do not exceed"),
    Field("side", RUN_OPENING, TEXT, "", "the side that has it; empty where rock fails at no side"),
    Field("closure", RUN_OPENING, np.float64, "m", "median closure of opposite walls since they were mined"),
    Field("failed_volume", RUN_OPENING, np.float64, "m3", "volume of failed rock that is nearest to it"),
)


def read_opening_runs(path: str | os.PathLike) -> xr.Dataset:
    """Openings after the last step in each run of a plan. Raises InputError for a file of another version."""
    found = read_dataset(path)
    for field in RUN_FIELDS:
        if field.dtype == TEXT and field.name in found.variables:
            found[field.name] = found[field.name].astype(TEXT)
        field.check(found, os.fspath(path))
    return found


def read_openings(path: str | os.PathLike) -> xr.Dataset:
    """The table of openings. Raises InputError for a file of another version."""
    table = read_dataset(path)
    for field in FIELDS:
        field.check(table, os.fspath(path))
    return table
