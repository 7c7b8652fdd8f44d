"""Loading measures, plan beside plan, as the page's table has them."""

from collections.abc import Sequence
from functools import partial

import numpy as np
import xarray as xr

from catalogs.report.text import DASH, number
from common.loading_table import OPENING, PLANE
from plans.layout import PlanSummary

# Variables of loading.nc (common.loading_table) that the page reads.
LOADING_VARIABLES = ("step", "kind", "name", "release_rate", "loading_stiffness", "ess_largest")
MAX_ROWS = 15  # Openings, those with the largest release rates in any plan.
WRITTEN = partial(number, digits=2)


def loading_rows(plans: Sequence[PlanSummary], loading: Sequence[xr.Dataset]) -> dict:
    """Content of the table: rows of openings, by the largest release rate in any plan, and of planes; empty without.

    loading: of each plan. A release rate and a stiffness are those of the step that mines the opening; an excess shear
    stress is that of the step in which it is largest.
    """
    if not loading:
        return {}
    rates = [_largest(one, OPENING, "release_rate") for one in loading]
    shear = [_largest(one, PLANE, "ess_largest") for one in loading]
    order = _order(rates)
    return {
        "openings": [{"name": name, "cells": [_cell(one.get(name)) for one in rates]} for name in order[:MAX_ROWS]],
        "planes": [{"name": name, "cells": [_cell(one.get(name)) for one in shear]} for name in _order(shear)],
        "left_out": f"{MAX_ROWS} of {len(order)} openings are shown. " if len(order) > MAX_ROWS else "",
    }


def _largest(table: xr.Dataset, kind: str, column: str) -> dict[str, dict]:
    """Largest value of each name of a kind, its step, and the loading stiffness there."""
    found: dict[str, dict] = {}
    values, stiffness = table[column].values, table["loading_stiffness"].values
    for row in np.flatnonzero((table["kind"].values == kind) & np.isfinite(values)):
        name = str(table["name"].values[row])
        if name not in found or values[row] > found[name]["value"]:
            step = str(table["step"].values[row])
            found[name] = {"value": float(values[row]), "step": step, "stiffness": float(stiffness[row])}
    return found


def _order(found: Sequence[dict[str, dict]]) -> list[str]:
    """Names, that with the largest value of any plan first."""
    names = dict.fromkeys(name for one in found for name in one)
    return sorted(names, key=lambda name: -max(one[name]["value"] for one in found if name in one))


def _cell(found: dict | None) -> dict[str, str]:
    """Texts of a cell of the table."""
    if found is None:
        return {"value": DASH, "step": "", "stiffness": ""}
    stiffness = WRITTEN(found["stiffness"]) if np.isfinite(found["stiffness"]) else ""
    return {"value": WRITTEN(found["value"]), "step": found["step"], "stiffness": stiffness}
