"""The spread of an ensemble as sentences and rows: how far one run differs from another."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import spread_figure
from catalogs.report.inputs import Evidence
from catalogs.report.text import DASH, fixed, number, percent, plural, typeset, whole, with_unit
from catalogs.settings import ALL_STEPS
from catalogs.sources.sizes import log_potency

ONE_RUN = (
    "One run is one realisation: brittle failure localises, so equally valid choices of loading change the potency and "
    "the number of events."
)
QUANTITY_ROWS = {  # quantity, its name, what its values are divided by, how they are written
    "potency": ("potency of all events (m³)", 1.0, number),
    "failed_volume": ("volume of rock that failed (m³)", 1.0, number),
    "events": ("events (of enough particles)", 1.0, number),
    "b": ("b of potency", 1.0, lambda value: fixed(value, 2)),
    "energy_released": ("energy released (MJ)", 1e6, number),
    "energy_dissipated": ("energy dissipated by failure (MJ)", 1e6, number),
}


def section(evidence: Evidence, add: Callable[[str, Figure], dict]) -> dict:
    """What the section of the page shows; without an ensemble the sentence alone. add: saves a figure by name."""
    runs, record = evidence.spread, evidence.record
    if runs is None:
        return {"one_run": ONE_RUN, "rows": []}
    beside = None if record is None else (evidence.record_label, log_potency(record["potency"].values))
    return {
        "figure": add("spread", spread_figure.spread(runs, beside)),
        "headline": headline(evidence),
        "rows": spread_rows(evidence),
        "members": int(runs.attrs["members"]),
        "overstress": percent(runs.attrs["largest_overstress"]),
        "cut": typeset(str(runs.attrs["cut_text"])),
    }


def spread_rows(evidence: Evidence) -> list[dict]:
    """Each quantity over all dated steps: the mine's own run, mean, standard deviation, range of the members."""
    runs, rows = evidence.spread.sel(period=ALL_STEPS), []
    for quantity, (name, unit, form) in QUANTITY_ROWS.items():
        own = float(runs[quantity].values[0]) / unit
        mean, deviation, least, largest = runs[f"{quantity}_statistics"].values / unit
        written = whole if quantity == "events" else form
        own_text, least_text, largest_text = (
            written(value) if np.isfinite(value) else DASH for value in (own, least, largest)
        )
        if quantity == "b":
            own_text = with_unit(own_text, f" ± {fixed(float(runs['b_error'].values[0]), 2)}")
        rows.append(
            {
                "name": name,
                "own": own_text,
                "mean": form(mean),
                "deviation": form(deviation),
                "share": percent(deviation / mean) if mean > 0 else DASH,
                "least": least_text,
                "largest": largest_text,
            }
        )
    return rows


def headline(evidence: Evidence) -> str:
    """The spread in one sentence."""
    runs = evidence.spread.sel(period=ALL_STEPS)
    _, _, least, largest = runs["potency_statistics"].values
    _, _, fewest, most = runs["events_statistics"].values
    members = plural(int(evidence.spread.attrs["members"]), "perturbed member")
    return (
        f"In {members} of the ensemble all events release {number(least)} to {number(largest)} m³ (here "
        f"{number(runs['potency'].values[0])}), and {whole(fewest)} to {whole(most)} events are of enough particles "
        f"(here {whole(runs['events'].values[0])})."
    )
