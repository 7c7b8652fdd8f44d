"""Where the energy of each step went, as rows of text for the report."""

import numpy as np

from catalogs.report.inputs import Evidence
from catalogs.report.text import number, percent

ENERGY_COLUMNS = {  # of a step's row: its heading, and the energies that are summed
    "work done on the rock": ("work",),
    "increase of stored energy": ("stored",),
    "taken up by the mined rock": ("support",),
    "seismic drop": ("seismic",),
    "overshoot": ("overshoot",),
    "later plastic flow": ("flow",),
    "hourglass": ("hourglass", "hourglass_released"),
    "motion": ("motion",),
    "unbalanced": ("unbalanced",),
}
GAIN_COLUMN, SPLIT_COLUMN = "gained", "refinement"
MIN_GAIN_SHARE = 1e-6  # Smaller gains, relative to the dissipated energy, are round-off.
NO_ENERGY = "no energy"


def section(evidence: Evidence) -> dict | None:
    """Headings and rows (text, MJ); None without steps. What dilation above friction gains, if any, is a column."""
    steps = evidence.steps
    if not steps:
        return None
    gains = any(energy(step, "gained") > MIN_GAIN_SHARE * abs(energy(step, "dissipated")) for step in steps)
    splits = any(energy(step, "refined") for step in steps)
    columns = ENERGY_COLUMNS | ({SPLIT_COLUMN: ("refined",)} if splits else {})
    columns |= {GAIN_COLUMN: ("gained",)} if gains else {}
    rows = [_row(step, columns) for step in steps]
    return {"columns": list(columns), "rows": rows, "gains": gains, "splits": splits, "unknown": _unknown(steps)}


def totals(evidence: Evidence) -> list[dict]:
    """The steps with what each released and dissipated, MJ."""
    return [step | {name: energy(step, name) / 1e6 for name in ("released", "dissipated")} for step in evidence.steps]


def energy(step: dict, *names: str) -> float:
    """Sum of a step's energies of these names, J; 0 where it is round-off of the energy that its rock holds."""
    value = sum(float(step[f"energy_{name}"]) for name in names)
    return 0.0 if abs(value) <= float(step["energy_round_off"]) else value


def _row(step: dict, columns: dict[str, tuple[str, ...]]) -> dict:
    values = [energy(step, *names) for names in columns.values()]
    left = percent(step["energy_left_share"]) if any(values) else NO_ENERGY
    return {"name": step["step"], "values": [number(value / 1e6) for value in values], "left": left}


def _unknown(steps: list[dict]) -> bool:
    """Whether a step's balance is not known: its particles moved."""
    return any(not np.isfinite(float(step["energy_left_share"])) for step in steps)
