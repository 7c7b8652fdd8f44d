"""The table of scanned voids, scans.nc: overbreak of each wall beside the rock that the model has failed there.

A row is a side of the excavations that a scan shows: their roof, floor and face, their walls by the bearing that they
look to, or `all` of them. A point is a point of their walls, with its own values.
"""

import os

import numpy as np
import xarray as xr

from common.datasets import read_dataset
from common.fields import TEXT, Field

ALL = "all"
ROWS, POINTS = ("row",), ("point",)
FIELDS = (
    Field("scan", ROWS, TEXT, "", "name of the scan"),
    Field("step", ROWS, TEXT, "", "step at whose end it is compared"),
    Field("side", ROWS, TEXT, "", f"roof, floor, face, wall with the bearing that it looks to, or {ALL} of them"),
    Field(
        "bearing", ROWS, np.float64, "deg", "direction from the opening into the rock of a wall, from north; else NaN"
    ),
    Field("wall_area", ROWS, np.float64, "m2", "area of the design with rock behind it"),
    Field("seen_area", ROWS, np.float64, "m2", "part of it that the scan shows; all other columns are of this part"),
    Field("overbreak_mean", ROWS, np.float64, "m", "mean overbreak along the wall's normal, 0 where there is none"),
    Field("overbreak_p90", ROWS, np.float64, "m", "overbreak that nine tenths of the wall do not exceed"),
    Field("overbreak_largest", ROWS, np.float64, "m", "largest overbreak"),
    Field("overbreak_volume", ROWS, np.float64, "m3", "scanned void beyond the design to which this wall is nearest"),
    Field("elos", ROWS, np.float64, "m", "equivalent linear overbreak slough: that volume over the area"),
    Field("underbreak_mean", ROWS, np.float64, "m", "mean underbreak along the wall's normal, 0 where there is none"),
    Field("underbreak_volume", ROWS, np.float64, "m3", "design that is no scanned void, to which this wall is nearest"),
    Field("through_share", ROWS, np.float64, "1", "share of the wall whose overbreak meets another opening"),
    Field("depth_mean", ROWS, np.float64, "m", "mean modelled depth of failure, fallen rock included"),
    Field("depth_p90", ROWS, np.float64, "m", "modelled depth of failure that nine tenths of the wall do not exceed"),
    Field("fallen_mean", ROWS, np.float64, "m", "mean modelled depth of fallen rock"),
    Field(
        "failed_volume", ROWS, np.float64, "m3", "modelled failed rock, fallen or not, to which this wall is nearest"
    ),
    Field("fallen_volume", ROWS, np.float64, "m3", "part of it that has fallen"),
    Field("misfit", ROWS, np.float64, "m", "mean overbreak less mean depth of failure"),
    Field(
        "misfit_low", ROWS, np.float64, "m", "lower end of its 95 % interval: roughness of the wall, place of the scan"
    ),
    Field("misfit_high", ROWS, np.float64, "m", "upper end of its 95 % interval"),
    Field("misfit_fallen", ROWS, np.float64, "m", "mean overbreak less mean depth of fallen rock"),
    Field("misfit_fallen_low", ROWS, np.float64, "m", "lower end of its 95 % interval"),
    Field("misfit_fallen_high", ROWS, np.float64, "m", "upper end of its 95 % interval"),
    Field("cell", ROWS, np.float64, "m", "edge of the finest cells; a single depth is known to half of it"),
)
POINT_FIELDS = (
    Field("point_row", POINTS, np.int32, "1", "row of the point's side"),
    Field("place", ("point", "xyz"), np.float64, "m", "place of the point on the design"),
    Field("area", POINTS, np.float64, "m2", "area that the point stands for"),
    Field("scanned", POINTS, np.float64, "m", "overbreak, negative underbreak; NaN where the scan shows no wall"),
    Field("depth", POINTS, np.float64, "m", "modelled depth of failure, fallen rock included"),
    Field("fallen", POINTS, np.float64, "m", "modelled depth of fallen rock"),
)


def read_scans(path: str | os.PathLike) -> xr.Dataset:
    """The table of scanned voids. Raises InputError for a file of another version."""
    table = read_dataset(path)
    for field in (*FIELDS, *POINT_FIELDS):
        field.check(table, os.fspath(path))
    return table
