"""What closeness and links, choices of the extraction, make of the number, b and the largest of the modelled events."""

import numpy as np

from catalogs.report.inputs import Evidence
from catalogs.report.section_numbers import section_number
from catalogs.report.text import fixed, percent, whole, with_unit
from catalogs.sources.size_law import NONE
from catalogs.sources.sizes import estimate_b, log_potency

LINKS_BY_REACH = {0: "", 1: "faces", 2: "faces, edges", 3: "faces, edges, corners"}  # by reach, of seismic.regions


def closeness_rows(evidence: Evidence, cut: float) -> list[dict]:
    """A row for each choice tried: events, those from the cut (log10 m3) on, their b, the largest log P."""
    found = evidence.closeness
    if found is None or not found.sizes["event"]:
        return []
    size, choice, rows = log_potency(found["potency"].values), found["choice"].values, []
    for index, (value, reach) in enumerate(zip(found["closeness"].values, found["reach"].values, strict=True)):
        own = size[choice == index]
        fit = estimate_b(own, cut)
        rows.append(
            {
                "closeness": f"{value:g}",
                "over": LINKS_BY_REACH[int(reach)],
                "own": index == int(found.attrs["own"]),
                "events": whole(len(own)),
                "above": whole(fit.events),
                "b": fit.b,
                "b_text": with_unit(fixed(fit.b, 2), f" ± {fixed(fit.error, 2)}"),
                "largest": fixed(own.max(initial=-np.inf), 2),
            }
        )
    return rows


def intervals_contain(evidence: Evidence, rows: list[dict]) -> list[str]:
    """What the intervals of the report's head contain and what they do not, in one sentence; none without rows."""
    known = [row for row in rows if np.isfinite(row["b"])]
    law = "" if evidence.comparison is None else evidence.comparison.attrs.get("law_model", "")
    if not known:
        return []
    low, high = (pick(known, key=lambda row: row["b"]) for pick in (min, max))
    own = next(row["closeness"] for row in rows if row["own"])
    range_of_b = f"{fixed(low['b'], 2)} to {fixed(high['b'], 2)} (section {section_number('sizes')})."
    values = [float(row["closeness"]) for row in known]
    tried = f"at a closeness of {min(values):g} to {max(values):g}"
    tried += " and with links over faces to corners" if len({row["over"] for row in known}) > 1 else ""
    if law == NONE:
        text = "No power law describes the sizes of the model's events. "
        return [text + f"If it is fitted nevertheless, to the same failed rock {tried}, b is {range_of_b}"]
    return [
        f"The interval of the model's b reflects the finite number of its events at closeness {own} only, not the "
        f"choice of closeness, links, increments or cell size. For the same failed rock {tried}, b is {range_of_b}"
    ]


def unlike(evidence: Evidence) -> str:
    """Which share of the potency lies in particles unlike their event; empty where no event was made."""
    if evidence.catalog is None or "unlike_share" not in evidence.catalog.attrs or not evidence.catalog.sizes["event"]:
        return ""
    share = percent(evidence.catalog.attrs["unlike_share"])
    return f"{share} of the potency is in particles whose closeness to their event's tensor is below the threshold."
