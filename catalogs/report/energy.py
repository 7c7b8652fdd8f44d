"""Where the energy of each step went, as rows of text for the report."""

import numpy as np

from catalogs.report.inputs import Evidence
from catalogs.report.text import number, percent

COLUMNS = {  # of a step's row: its heading, and the attributes that are summed
    "work done on the rock": ("energy_work",),
    "stored more in it": ("energy_stored",),
    "taken up while mined": ("energy_support",),
    "seismic drop": ("energy_seismic",),
    "overshoot": ("energy_overshoot",),
    "later flow": ("energy_flow",),
    "hourglass": ("energy_hourglass", "energy_hourglass_released"),
    "motion": ("energy_motion",),
}
GAINED, SPLIT = "gained", "cells split"
SMALLEST = 1e-6  # of what is dissipated: gains below this are round-off


def section(evidence: Evidence) -> dict | None:
    """Headings and rows (text, MJ); None without steps. What dilation above friction gains, if any, is a column."""
    steps = evidence.steps
    if not steps:
        return None
    gains = any(step["energy_gained"] > SMALLEST * abs(step["energy_dissipated"]) for step in steps)
    splits = any(float(step["energy_refined"]) for step in steps)
    columns = COLUMNS | ({SPLIT: ("energy_refined",)} if splits else {})
    columns |= {GAINED: ("energy_gained",)} if gains else {}
    rows = [
        {
            "name": step["step"],
            "values": [number(sum(float(step[name]) for name in names) / 1e6) for names in columns.values()],
            "left": percent(step["energy_left_share"]),
        }
        for step in steps
    ]
    return {"columns": list(columns), "rows": rows, "gains": gains, "splits": splits, "unknown": _unknown(steps)}


def _unknown(steps: list[dict]) -> bool:
    """Whether a step's balance is not known: its particles moved."""
    return any(not np.isfinite(float(step["energy_left_share"])) for step in steps)
