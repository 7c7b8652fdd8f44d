"""Convergence of each stage to equilibrium, and the uncertainty that cells and increments leave.

The template is "convergence.html.j2".
"""

import json

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

from catalogs.compare.grid_convergence import MIN_ERROR_SHARE, SAFETY_FACTOR
from catalogs.figures import style
from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.sections import section_number
from catalogs.report.text import DASH, MAX_NAMED, fixed, number, percent, plural, whole
from catalogs.settings import ALL_STEPS

# A larger share of the potency in rock that an increment brings to failure at once makes the events depend on the
# increments.
MAX_AT_ONCE_SHARE = 0.05
MAX_ERROR_SHARE = 0.5  # A larger change between two cell sizes is beyond first-order convergence.
PANELS_PER_ROW = 3
MAX_POINTS_PER_CURVE = 4000  # More points of one curve cannot be distinguished in a panel.


def section(evidence: Evidence, gallery: Gallery) -> dict:
    """Content of the section on convergence: discretisation (sentences), figure (None before any stage), constants of
    the error estimate, table (attributes and number of new failures of each stage); cells, sizes (m) and floor (log P)
    of the comparison of cell sizes, empty and NaN without one."""
    figure = gallery.add("convergence", convergence(evidence.stages)) if evidence.stages else None
    failures = [int(stage["convergence_new_failures"].values.sum()) for stage in evidence.stages]
    beside = evidence.grid_convergence
    return {
        "discretisation": discretisation(evidence),
        "figure": figure,
        "least_error": MIN_ERROR_SHARE,
        "safety": SAFETY_FACTOR,
        "too_coarse": MAX_ERROR_SHARE,
        "table": list(zip([stage.attrs for stage in evidence.stages], failures, strict=True)),
        "cells": [] if beside is None else cell_rows(beside),
        "sizes": [] if beside is None else [f"{cell:g}" for cell in beside["cell"].values],
        "floor": np.nan if beside is None else float(beside.attrs["floor"]),
    }


def discretisation(evidence: Evidence) -> list[str]:
    """Sentences on how far the numbers of the dated steps depend on cells and increments; empty without events."""
    if evidence.catalog is None or not evidence.catalog.sizes["event"]:
        return []
    share = increment_share(evidence)
    parts = f"unloading in increments makes the potency too large, roughly by {percent(share)} or less"
    parts = parts if np.isfinite(share) else ""
    table = evidence.grid_convergence
    if table is None:
        cell = f"{float(evidence.grid.attrs['fine_cell']):g}"
        draft = evidence.config.get("accuracy") == "draft"
        reason = "a draft has no second run" if draft else "grid_convergence: true measures it"
        text = f"The influence of the cell size, {cell} m, on these numbers was not measured ({reason})"
        return [f"{text}; {parts}." if parts else f"{text}.", *_at_once(evidence)]
    every = table.sel(period=ALL_STEPS)
    own, coarse = (f"{cell:g}" for cell in table["cell"].values)
    potency, volume = (every[name].values for name in ("potency", "failed_volume"))
    missed = _named(evidence, json.loads(table.attrs["left_out"]))
    wide = {row.name for row in evidence.excavations if not row.narrow}
    narrow = _named(evidence, [name for name in json.loads(table.attrs["narrow"]) if name in wide])
    without = f", which leave out {missed}," if missed else ""
    text = (
        f"On cells of {coarse} m instead of {own} m{without} the same steps release {number(potency[1])} m³ of potency "
        f"(here {number(potency[0])}) and {number(volume[1])} m³ of rock fail (here {number(volume[0])})"
    )
    if np.isfinite(table.attrs["floor"]):
        events = every["events"].values
        floor = fixed(float(table.attrs["floor"]), 1)
        text += f", with {plural(events[1], 'event')} of log P {floor} and more (here {whole(events[0])})"
    errors = [float(every[f"{name}_error"]) for name in ("potency", "failed_volume")]
    if not max(errors) <= MAX_ERROR_SHARE:
        text += f". Cells of {own} m are too large to say how far these numbers would still change: halve "
        text += "grid.finest_cell before using them"
        if narrow:
            text += f" (on cells of {coarse} m too little rock fails around openings narrow for them: {narrow})"
    else:
        text += f". Cells of {own} m therefore leave potency uncertain by about {percent(errors[0])}"
        text += f" and failed rock by about {percent(errors[1])}"
        if narrow:
            text += f". These shares may be too large: on cells of {coarse} m too little rock fails around openings "
            text += f"narrow for them: {narrow}"
    return [f"{text}; {parts}." if parts else f"{text}.", *_at_once(evidence)]


def _at_once(evidence: Evidence) -> list[str]:
    """A sentence where increments of the load decide how many events there are; else none."""
    share = float(evidence.catalog.attrs.get("at_once_share", 0.0))
    if share <= MAX_AT_ONCE_SHARE:
        return []
    return [
        f"{percent(share)} of the potency is in rock that one increment of mining brought above its strength at once. "
        "Such patches are events because of the size of the increment, so number, sizes and b of the events depend in "
        "part on the increments. Smaller increments (a smaller solver.max_overshoot, or more solver.increments) "
        "separate them."
    ]


def _named(evidence: Evidence, names: list[str]) -> str:
    """Names of the mined ones among these excavations, in a list for a sentence; empty if none is mined."""
    mined = [row.name for row in evidence.excavations if row.name in names and not row.planned]
    more = f" and {len(mined) - MAX_NAMED} more" if len(mined) > MAX_NAMED else ""
    return ", ".join(mined[:MAX_NAMED]) + more


def cells_too_large(evidence: Evidence) -> str:
    """A sentence or two where the cells are too large to estimate an uncertainty; else empty."""
    errors = cell_errors(evidence)
    if errors is None or max(errors) <= MAX_ERROR_SHARE:
        return ""
    own, coarse = (f"{cell:g}" for cell in evidence.grid_convergence["cell"].values)
    return (
        f"Potency or failed volume changes too much from cells of {coarse} m to cells of {own} m to say how far "
        f"smaller cells would change it (section {section_number('convergence')}). Do not use these numbers before "
        "grid.finest_cell is halved."
    )


def cell_errors(evidence: Evidence) -> tuple[float, float] | None:
    """Share by which other cells may change potency and failed volume of all steps; infinite where more is unknown;
    None where it was not measured, and without events."""
    table = evidence.grid_convergence
    if table is None or evidence.catalog is None or not evidence.catalog.sizes["event"]:
        return None
    every = table.sel(period=ALL_STEPS)
    potency, volume = (float(every[f"{name}_error"]) for name in ("potency", "failed_volume"))
    return (potency if np.isfinite(potency) else np.inf), (volume if np.isfinite(volume) else np.inf)


def increment_share(evidence: Evidence) -> float:
    """Share by which loading in increments makes the potency of the dated steps too large, estimated from their
    overshoot (docs/explanation/uncertainty.md: no bound in theory); NaN where it is not known."""
    steps, catalog = evidence.dated, evidence.catalog
    step, potency = catalog["step"].values, catalog["potency"].values
    shares = np.array([float(one.get("overshoot_share", np.nan)) for one in steps])
    weights = np.array([potency[step == one["step"]].sum() for one in steps])
    if not weights.sum() > 0 or not np.isfinite(shares[weights > 0]).all():
        return np.nan
    return float(np.average(shares, weights=weights))


def cell_rows(table: xr.Dataset) -> list[dict]:
    """Rows of the comparison of cell sizes, one for each dated step and one for all: numbers on both cell sizes and the
    relative errors of potency and failed volume, as text."""
    found = []
    for period in table["period"].values:
        here = table.sel(period=period)
        text = {name: [number(value) for value in here[name].values] for name in ("potency", "failed_volume")}
        text["events"] = [whole(value) for value in here["events"].values]
        text["largest"] = [fixed(value, 2) for value in here["largest"].values]
        errors = [float(here[f"{name}_error"]) for name in ("potency", "failed_volume")]
        found.append(
            {"name": "all" if period == ALL_STEPS else str(period)}
            | text
            | {"errors": [percent(error) if error <= MAX_ERROR_SHARE else DASH for error in errors]}
        )
    return found


def running_iteration(iteration: np.ndarray) -> np.ndarray:
    """Iteration counted through the whole stage, where the recorded one starts from zero in each relaxation."""
    iteration = np.asarray(iteration, dtype=np.int64)
    restart = np.flatnonzero(np.diff(iteration) < 0) + 1
    offset = np.zeros(len(iteration), dtype=np.int64)
    offset[restart] = iteration[restart - 1] + (iteration[restart] <= 0)
    return iteration + np.cumsum(offset)


def convergence(stages: list[xr.Dataset]) -> Figure:
    """One panel per stage: unbalanced ratio of the whole mine (line), tolerance (dashed), new failures (bars)."""
    columns = min(PANELS_PER_ROW, len(stages))
    rows = -(-len(stages) // columns)
    figure = style.new_figure(height=2.6 * rows + 0.4)
    array = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
    for axes, stage in zip(array, stages, strict=False):
        _panel(axes, stage, first=axes.get_subplotspec().is_first_col())
    for axes in array[len(stages) :]:
        axes.set_axis_off()
    return figure


def _panel(axes: Axes, stage: xr.Dataset, first: bool) -> None:
    name = stage.attrs.get("step") if stage.attrs.get("stage") == "step" else "elastic"
    axes.set_title(str(name))
    axes.set_xlabel("iteration")
    axes.set_yscale("log")
    axes.yaxis.set_minor_locator(NullLocator())
    if first:
        axes.set_ylabel("unbalanced force ratio (1)")
    ratio = stage["convergence_unbalanced_ratio"].values
    if not (ratio > 0).any():  # an axis of logarithms has no place for zero
        axes.text(0.5, 0.5, "nothing to solve", transform=axes.transAxes, ha="center", color=style.OUTLINE)
        return
    iteration = running_iteration(stage["convergence_iteration"].values)
    cells = stage["convergence_cells"].values
    # A part of the mine in equilibrium says nothing of the mine, which has the more cells the more are split.
    whole = np.flatnonzero(cells == np.maximum.accumulate(cells))
    whole = whole[:: -(-len(whole) // MAX_POINTS_PER_CURVE)]
    shown = np.where(ratio > 0, ratio, np.nan)[whole]
    increment = stage["convergence_increment"].values
    starts = np.flatnonzero(np.diff(increment)) + 1
    _mark(axes, iteration[starts], 1.0, color="#cccccc", linewidth=0.7)
    generation = stage["convergence_generation"].values
    generations = np.flatnonzero((np.diff(generation) != 0) & (np.diff(increment) == 0)) + 1
    _mark(axes, iteration[generations], 0.03, color=style.OUTLINE, linewidth=0.5)
    axes.plot(iteration[whole], shown, color=style.MODELLED, linewidth=1.0, marker="." if len(whole) < 60 else None)
    axes.axhline(float(stage.attrs["tolerance"]), color="k", linestyle="--", linewidth=0.8)
    axes.set_xlim(-0.03 * max(iteration[-1], 1), 1.03 * max(iteration[-1], 1))
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    failures = stage["convergence_new_failures"].values
    if failures.any():
        twin = axes.twinx()
        twin.spines["right"].set_visible(True)
        twin.vlines(iteration[failures > 0], 0, failures[failures > 0], color=style.RECORDED, linewidth=1.6, alpha=0.75)
        twin.set_ylim(0, failures.max() * 2.2)
        twin.yaxis.set_major_locator(MaxNLocator(4, integer=True))
        twin.tick_params(axis="y", colors=style.RECORDED)
        twin.set_ylabel("new failures", color=style.RECORDED)
        axes.set_zorder(twin.get_zorder() + 1)
        axes.patch.set_visible(False)


def _mark(axes: Axes, iteration: np.ndarray, share: float, **look) -> None:
    """Lines from the bottom of a panel up to a share of its height; as one artist, since there may be hundreds."""
    axes.vlines(iteration, 0.0, share, transform=axes.get_xaxis_transform(), zorder=0, **look)
