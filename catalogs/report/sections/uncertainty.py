"""Uncertainty of potency, failed rock and events by source, and what the sources leave together.

The template is "uncertainty.html.j2".
"""

import numpy as np

from catalogs.report.cell_effects import (
    MAX_ERROR_SHARE,
    cell_errors,
    cell_rows,
    doubled_cells,
    increment_share,
)
from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.text import DASH, between, fixed, number
from catalogs.report.uncertainty import CELLS, CHANCE, DEVIATIONS, Source, deviation_share, event_rule, sources

NOT_COMPUTED = "not computed"
PLACE = "Place of walls in the cells"
PLACES = "the study's mines have four places each, so its figure for cells contains it"


def section(evidence: Evidence, _: Gallery) -> dict:
    """Content of the section: rows (a source each), sentences on all sources together and on doubled cells; cells,
    sizes (m) and floor (log P) of the comparison of cell sizes, empty and NaN without one."""
    found, table = sources(evidence), evidence.grid_convergence
    details = " ".join(doubled_cells(evidence))
    return {
        "rows": rows(evidence, found),
        "together": together(evidence, found),
        "details": [details] if details else [],
        "too_coarse": MAX_ERROR_SHARE,
        "cells": [] if table is None else cell_rows(table),
        "sizes": [] if table is None else [f"{cell:g}" for cell in table["cell"].values],
        "floor": np.nan if table is None else float(table.attrs["floor"]),
    }


def rows(evidence: Evidence, found: list[Source]) -> list[dict]:
    """Sources as texts of the table; the place of walls follows the cells, which contain it. Empty without events."""
    made = []
    for source in found + (event_rule(evidence) if found else []):
        potency = NOT_COMPUTED if np.isnan(source.factor) else "too large" if source.factor == np.inf else ""
        made.append(
            {
                "name": source.name,
                "potency": potency or f"factor {fixed(source.factor, 2)}",
                "failed_rock": source.failed_rock,
                "events": source.events,
                "note": source.note,
                "key": source.key,
            }
        )
        if source.name == CELLS:
            held = NOT_COMPUTED if np.isnan(source.factor) else "in cells"
            made.append(
                {"name": PLACE, "potency": held, "failed_rock": held, "events": DASH, "note": PLACES, "key": ""}
            )
    return made


def together(evidence: Evidence, found: list[Source]) -> str:
    """Sentences on what cells, chance and increments leave of the potency together, and what that does not contain;
    empty where the cells leave no figure.

    The runs behind the figure of the cells differ by chance, too: the larger of these two counts. Increments make
    potency too large: only the lower end moves.
    """
    errors, share = cell_errors(evidence), increment_share(evidence) if found else np.nan
    if errors is None or errors[0] == np.inf:
        return ""
    by_chance = DEVIATIONS * deviation_share(evidence, "potency")
    is_measured = any(one.name == CHANCE and np.isfinite(one.factor) for one in found)
    widest = max(errors[0], by_chance) if is_measured else errors[0]
    potency = float(evidence.catalog["potency"].values.sum())
    low = potency / (1.0 + widest) / (1.0 + (share if np.isfinite(share) else 0.0))
    parts = "cells, or chance, whichever is larger" if is_measured else "cells with the place of walls in them"
    parts += ", and increments" if np.isfinite(share) else ""
    left = [one.name.lower() for one in found if one.name not in ("The record",) and np.isnan(one.factor)]
    ends = between((low, potency * (1.0 + widest)))
    text = f"The model's potency is {number(potency)} m³; {parts} leave it within {ends} m³"
    return text + (f". Not contained: {', '.join(left)}." if left else ".")
