"""The table of loading measures, loading.nc: energy that each step releases, plastic work, loading stiffness, and
excess shear stress on planes.

A row is a step as a whole, an excavation in a step, or a plane after a step. What a row has no value for is NaN.
"""

import os

import numpy as np
import xarray as xr

from common.datasets import read_dataset
from common.fields import TEXT, Field

STEP, OPENING, PLANE = "step", "opening", "plane"
ALL = "all"  # Name in the row of a step.
ROWS = ("row",)
FIELDS = (
    Field("step", ROWS, TEXT, "", "step in which the row holds, or at whose end"),
    Field("kind", ROWS, TEXT, "", f"{STEP}, {OPENING} or {PLANE}"),
    Field("name", ROWS, TEXT, "", f"name of the excavation or plane; {ALL} for a step"),
    Field("mined_volume", ROWS, np.float64, "m3", "volume of rock that the step mines"),
    Field("mined_area", ROWS, np.float64, "m2", "this volume over the thickness of the excavation"),
    Field("energy_mined", ROWS, np.float64, "MJ", "strain energy in the rock that the step mines"),
    Field(
        "energy_released", ROWS, np.float64, "MJ",
        "energy that mining makes available: work of far stresses and weight and energy of the mined rock, less what "
        "the rock that stays stores more (Salamon 1984)",
    ),
    Field("release_rate", ROWS, np.float64, "MJ/m2", "energy released per area mined (ERR)"),
    Field("release_density", ROWS, np.float64, "MJ/m3", "energy released per volume mined"),
    Field("plastic_work", ROWS, np.float64, "MJ", "energy that plastic strain dissipates in the step"),
    Field("plastic_volume", ROWS, np.float64, "m3", "volume of rock in which nine tenths of it are dissipated"),
    Field("unloaded_stress", ROWS, np.float64, "MPa", "traction that the step takes off walls it makes, r.m.s."),
    Field(
        "loading_stiffness", ROWS, np.float64, "MPa/m",
        "traction that the step takes off walls it makes, over their motion into the opening",
    ),
    Field("ess_at_point", ROWS, np.float64, "MPa", "excess shear stress at the point of the plane"),
    Field("ess_largest", ROWS, np.float64, "MPa", "largest excess shear stress on the plane"),
    Field("ess_mean", ROWS, np.float64, "MPa", "mean excess shear stress where it is above 0"),
    Field("ess_area", ROWS, np.float64, "m2", "area of the plane with excess shear stress above 0"),
    Field("ess_volume", ROWS, np.float64, "m3", "volume of rock with weak planes whose excess shear stress is above 0"),
    Field("x", ROWS, np.float64, "m", "where the excess shear stress is largest"),
    Field("y", ROWS, np.float64, "m", "where the excess shear stress is largest"),
    Field("z", ROWS, np.float64, "m", "where the excess shear stress is largest"),
    Field("nearest_opening", ROWS, TEXT, "", "excavation that is nearest to this place"),
)  # fmt: skip


def read_loading(path: str | os.PathLike) -> xr.Dataset:
    """The table of loading measures. Raises InputError for a file of another version."""
    table = read_dataset(path)
    for field in FIELDS:
        field.check(table, os.fspath(path))
    return table
