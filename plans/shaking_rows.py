"""Velocities at openings, plan beside plan, as the page's table has them."""

from collections.abc import Sequence
from functools import partial

import numpy as np
import xarray as xr

from catalogs.report.text import DASH, between, number, typeset
from plans.layout import PlanSummary

# Variables of shaking.nc (shaking.layout) that the page reads.
SHAKING_VARIABLES = ("velocity", "velocity_interval", "demand", "filled", "step", "opening", "chance")
MAX_ROWS = 15  # Openings, those with the largest velocities in any plan.
WRITTEN = partial(number, digits=2)


def shaking_rows(plans: Sequence[PlanSummary], shaking: Sequence[xr.Dataset]) -> dict:
    """Content of the table: the chance, the relation and a row for each opening; empty without shaking.

    shaking: of each plan. The chance is the one in the middle of those asked for; a velocity is that of the step in
    which it is largest.
    """
    if not shaking:
        return {}
    place = len(shaking[0]["chance"]) // 2
    cells = {plan.name: _cells(one, place) for plan, one in zip(plans, shaking, strict=True)}
    largest: dict[str, float] = {}
    for of_plan in cells.values():
        for opening, (velocity, _) in of_plan.items():
            largest[opening] = max(largest.get(opening, 0.0), velocity)
    order = sorted(largest, key=lambda opening: -largest[opening])
    missing = {"velocity": DASH, "interval": "", "step": "", "demand": ""}
    return {
        "chance": f"{100 * shaking[0]['chance'].values[place]:g} %",
        "relation": typeset(str(shaking[0].attrs["relation_text"]).replace(" - ", " − ")),
        "depth_source": str(shaking[0].attrs.get("depth_source", "")),
        "has_demand": bool(np.isfinite(shaking[0]["demand"].values).any()),
        "rows": [
            {"opening": opening, "cells": [cells[plan.name].get(opening, (0.0, missing))[1] for plan in plans]}
            for opening in order[:MAX_ROWS]
        ],
        "left_out": f"{MAX_ROWS} of {len(order)} openings are shown. " if len(order) > MAX_ROWS else "",
    }


def _cells(shaking: xr.Dataset, place: int) -> dict[str, tuple[float, dict[str, str]]]:
    """Largest velocity (m/s) of each opening that a plan mines, and its cell of the table."""
    velocity, filled = shaking["velocity"].values[:, :, place], shaking["filled"].values
    demand = shaking["demand"].values[:, :, place]
    found = {}
    for opening, name in enumerate(shaking["opening"].values):
        if not (filled[:, opening] >= 0).any():
            continue
        step = int(np.where(np.isnan(velocity[:, opening]), -1.0, velocity[:, opening]).argmax())
        known = demand[step, opening][np.isfinite(demand[step, opening])]
        cell = {
            "velocity": WRITTEN(velocity[step, opening]),
            "interval": between(shaking["velocity_interval"].values[step, opening, place], WRITTEN),
            "step": str(shaking["step"].values[step]),
            "demand": WRITTEN(known.max() / 1e3) if len(known) else "",
        }
        found[str(name)] = float(velocity[step, opening]), cell
    return found
