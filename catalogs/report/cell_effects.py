"""How far potency and failed rock of the dated steps depend on cells and increments: shares, and sentences on them."""

import json

import numpy as np
import xarray as xr

from catalogs.compare.cell_error import COVERAGE, MAX_ERROR, error_at
from catalogs.compare.grid_convergence import doubled_cells_tell
from catalogs.report.evidence import Evidence
from catalogs.report.sections import section_number
from catalogs.report.text import DASH, MAX_NAMED, fixed, number, percent, plural, whole
from catalogs.settings import ALL_STEPS

MAX_ERROR_SHARE = float(np.expm1(MAX_ERROR))
MEASURED = ("potency", "failed_volume")
ROUND_OFF = 1e-9


def cell_errors(evidence: Evidence) -> tuple[float, float] | None:
    """Share by which other cells may change potency and failed volume of all steps; infinite where the cells are too
    large to say; None where it was not computed, and without events."""
    table = evidence.grid_convergence
    if table is None or evidence.catalog is None or not evidence.catalog.sizes["event"]:
        return None
    errors = [float(table[f"{name}_error"].sel(period=ALL_STEPS)) for name in MEASURED]
    potency, volume = (error if error <= MAX_ERROR_SHARE else np.inf for error in errors)
    return potency, volume


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


def doubled_cells(evidence: Evidence) -> list[str]:
    """Sentences on the same steps on cells of twice the size, and on what follows from them; empty without such a run
    or without events."""
    errors, table = cell_errors(evidence), evidence.grid_convergence
    if errors is None:
        return []
    every = table.sel(period=ALL_STEPS)
    own, coarse = (f"{cell:g}" for cell in table["cell"].values)
    potency, volume, thickness = (every[name].values for name in (*MEASURED, "thickness"))
    missed = _named(evidence, json.loads(table.attrs["left_out"]))
    without = f", which leave out {missed}," if missed else ""
    change = (
        f"On cells of {coarse} m instead of {own} m{without} the same steps release {number(potency[1])} m³ of potency "
        f"(here {number(potency[0])}) and {number(volume[1])} m³ of rock fail (here {number(volume[0])})"
    )
    if np.isfinite(table.attrs["floor"]):
        events = every["events"].values
        floor = fixed(float(table.attrs["floor"]), 1)
        change += f", with {plural(events[1], 'event')} of log P {floor} and more (here {whole(events[0])})"
    sentences = [_law(own, thickness[0], errors), f"{change}."]
    if losses := _losses(evidence, coarse, thickness[1]):
        return [*sentences, f"This change tells little of cells of {own} m, since {losses}."]
    expected = np.expm1(error_at(thickness[0])) * (1.0 + ROUND_OFF)
    words = {"potency": "potency", "failed_volume": "failed rock"}
    larger = [words[name] for name in MEASURED if float(every[f"{name}_error"]) > expected]
    if larger:
        return [
            *sentences,
            f"The change in {' and in '.join(larger)} is larger than the study lets expect of both sizes of cells: the "
            "uncertainty is this change.",
        ]
    return [*sentences, "The change is within what the study lets expect of both sizes of cells."]


def _law(cell: str, thickness: float, errors: tuple[float, float]) -> str:
    """A sentence or two on the thickness of the failed rock and what study openings says of it."""
    text = f"Rock failed in a zone that is {number(thickness, 2)} cells of {cell} m thick on average."
    if not error_at(thickness) <= MAX_ERROR:
        return f"{text} Cells of {cell} m are too large to say how far smaller cells would change its numbers."
    return (
        f"{text} In study openings, {percent(COVERAGE)} of the runs with zones of this thickness differ by up to "
        f"{percent(np.expm1(error_at(thickness)))} in potency and failed rock from much smaller cells, wherever walls "
        "lie in the cells."
    )


def _losses(evidence: Evidence, coarse: str, thickness: float) -> str:
    """A clause on what doubled cells lose; empty if they show what the mine's own cells show."""
    table = evidence.grid_convergence
    left_out, narrow = (json.loads(table.attrs[name]) for name in ("left_out", "narrow"))
    if table.attrs["collapsed"]:
        return "one of both runs found no equilibrium"
    if doubled_cells_tell(thickness, bool(left_out or narrow)):
        return ""
    if narrow:
        named = _named(evidence, narrow)
        return f"on cells of {coarse} m too little rock fails around openings narrow for them" + (
            f": {named}" if named else ""
        )
    if left_out:
        return f"cells of {coarse} m leave openings out"
    return f"failed rock is only {number(thickness, 2)} cells thick there" if thickness > 0 else "no rock fails there"


def _named(evidence: Evidence, names: list[str]) -> str:
    """Names of the mined ones among these excavations, in a list for a sentence; empty if none is mined."""
    mined = [row.name for row in evidence.excavations if row.name in names and not row.planned]
    more = f" and {len(mined) - MAX_NAMED} more" if len(mined) > MAX_NAMED else ""
    return ", ".join(mined[:MAX_NAMED]) + more


def cells_too_large(evidence: Evidence) -> str:
    """A sentence or two where the cells are too large to state an uncertainty; else empty."""
    errors = cell_errors(evidence)
    if errors is None or max(errors) <= MAX_ERROR_SHARE:
        return ""
    table = evidence.grid_convergence.sel(period=ALL_STEPS)
    own, coarse = (f"{cell:g}" for cell in evidence.grid_convergence["cell"].values)
    thickness = float(table["thickness"][0])
    why = f"Failed rock is only {number(thickness, 2)} cells of {own} m thick on average"
    if error_at(thickness) <= MAX_ERROR:
        why = f"Potency or failed volume changes too much from cells of {coarse} m to cells of {own} m"
    return (
        f"{why}, too little to say how far smaller cells would change potency and failed volume (section "
        f"{section_number('uncertainty')}). Do not use these numbers before grid.finest_cell is halved."
    )


def cell_rows(table: xr.Dataset) -> list[dict]:
    """Rows of the comparison of cell sizes, one for each dated step and one for all: numbers on both cell sizes and the
    relative uncertainties of potency and failed volume, as text."""
    found = []
    for period in table["period"].values:
        here = table.sel(period=period)
        text = {name: [number(value) for value in here[name].values] for name in MEASURED}
        text["thickness"] = [number(value, 2) for value in here["thickness"].values]
        text["events"] = [whole(value) for value in here["events"].values]
        text["largest"] = [fixed(value, 2) for value in here["largest"].values]
        errors = [float(here[f"{name}_error"]) for name in MEASURED]
        found.append(
            {"name": "all" if period == ALL_STEPS else str(period)}
            | text
            | {"errors": [percent(error) if error <= MAX_ERROR_SHARE else DASH for error in errors]}
        )
    return found
