"""Budget of potency: the share of plastic strain that became events.

The template is "budget.html.j2".
"""

import json

from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.text import number

BUDGET_ROWS = {
    "events": "events",
    "aseismic_share": "seismic strain not taken as events (1 − α)",
    "overshoot": "overshoot before the drop (aseismic)",
    "later": "later flow of failed rock (aseismic)",
    "plastic": "all plastic strain of these steps",
}


def budget_rows(evidence: Evidence) -> tuple[list[str], list[dict], dict]:
    """The catalogue's potency budget: component names, rows of text, and the scalars; empty without a budget."""
    budget = json.loads(evidence.catalog.attrs.get("budget", "{}")) if evidence.catalog is not None else {}
    rows = [
        {"name": text, "values": [number(value) for value in budget[name]]}
        for name, text in BUDGET_ROWS.items()
        if name in budget
    ]
    if "closure" in budget:
        rows.append(
            {
                "name": "remainder, relative",
                "values": [f"{value:.0e}".replace("-", "−") for value in budget["closure"]],
            }
        )
    return budget.get("components", []), rows, budget


def section(evidence: Evidence, _: Gallery) -> dict | None:
    """Content of the section on the budget: names of components, rows of text, scalars of the budget, floor of potency
    (m3), seismic fraction and shear modulus (Pa) of the catalogue. None without a budget."""
    components, rows, budget = budget_rows(evidence)
    if not rows:
        return None
    return {
        "components": components,
        "rows": rows,
        "budget": budget,
        "floor": float(evidence.catalog.attrs["potency_floor"]),
        "seismic_fraction": float(evidence.catalog.attrs["seismic_fraction"]),
        "shear_modulus": float(evidence.catalog.attrs["shear_modulus"]),
    }
