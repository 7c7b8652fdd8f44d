"""shaking.csv: the velocities and demands as a plain table."""

import os

import numpy as np
import pandas as pd
import xarray as xr

from common.datasets import atomic_path

STATE = {0: "open", 1: "filled"}


def table_of(shaking: xr.Dataset) -> pd.DataFrame:
    """One row for each step, opening that is mined, chance, and side that has a depth (one row where none has).

    velocity_m_s: exceeded with the chance in the step, anywhere at the opening, with its 95 % interval; 0: too few
    events for the chance. mw, distance_m: means of the events that exceed it. outside_range: share of the exceedances
    by events that the relation was not found from. demand_kJ_m2: m v^2 / 2 + q m g d (shaking.demand), at the velocity
    and at the ends of its interval. carried_by: weakest class of support whose stated capacity the demand is below;
    none: the demand is above all of them; empty: no class is stated.
    """
    rows = []
    values = {str(name): variable.values for name, variable in shaking.variables.items()}
    density, has_support = float(shaking.attrs.get("density", np.nan)), shaking.attrs["support"] != "[]"
    for step, opening in np.argwhere(values["filled"] >= 0):
        depth = values["depth"][step, opening]
        sides = np.flatnonzero(~np.isnan(depth)) if not np.isnan(depth).all() else [-1]
        for chance in range(len(values["chance"])):
            at = (step, opening, chance)
            row = {
                "step": values["step"][step],
                "opening": values["opening"][opening],
                "state": STATE[int(values["filled"][step, opening])],
                "chance": f"{values['chance'][chance]:g}",
                "velocity_m_s": _text(values["velocity"][at]),
                "velocity_lower_m_s": _text(values["velocity_interval"][at][0]),
                "velocity_upper_m_s": _text(values["velocity_interval"][at][1]),
                "mw": _text(values["magnitude"][at], ".2f"),
                "distance_m": _text(values["distance"][at]),
                "outside_range": _text(values["outside_share"][at], ".2f"),
            }
            for side in sides:
                own = dict.fromkeys(("side", "depth_m", "mass_kg_m2", "demand_kJ_m2"), "")
                own |= dict.fromkeys(("demand_lower_kJ_m2", "demand_upper_kJ_m2", "carried_by"), "")
                if side >= 0:
                    low, high = values["demand_interval"][at][side] / 1e3
                    own = {
                        "side": values["side"][side],
                        "depth_m": _text(depth[side]),
                        "mass_kg_m2": _text(density * depth[side], ".0f"),
                        "demand_kJ_m2": _text(values["demand"][at][side] / 1e3),
                        "demand_lower_kJ_m2": _text(low),
                        "demand_upper_kJ_m2": _text(high),
                        "carried_by": (values["carried_by"][at][side] or "none") if has_support else "",
                    }
                rows.append(row | own)
    return pd.DataFrame(rows)


def _text(value: float, form: str = ".4g") -> str:
    """A number as text; empty where it is not known."""
    return "" if np.isnan(value) else format(value, form)


def write_csv(shaking: xr.Dataset, path: str | os.PathLike) -> None:
    """Write the table, atomically."""
    with atomic_path(path) as temporary:
        table_of(shaking).to_csv(temporary, index=False, lineterminator="\n", encoding="utf-8")
