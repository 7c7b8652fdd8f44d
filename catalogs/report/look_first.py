"""Openings and steps of the mine to look at first: those with most potency, modelled and recorded."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.report.by_opening import nearest_mined, step_of_events
from catalogs.report.evidence import MODEL_LABEL, Evidence, compared_events, shown_catalogues
from catalogs.report.sections.steps import shear_modulus
from catalogs.report.text import fixed, magnitude, percent

MAX_PLACES = 2  # Places of the model that are listed where the record adds none; else one of each.
MIN_SHARE = 0.01  # Of a catalogue's potency; a smaller share is not worth a number.


@dataclass(frozen=True)
class Place:
    """An opening, the step that mines it, a step with events, whose most potency that is (the model's, the record's or
    both), and a sentence on the potency of the events nearest to the opening in the step of the events."""

    opening: str
    mined: str
    step: str
    source: str
    text: str


def look_first(evidence: Evidence) -> list[Place]:
    """At most MAX_PLACES places: those with most modelled potency, and that with most recorded potency.

    Events are those that the comparison counts, where there is one. None without events near openings in dated steps.
    """
    shown = shown_catalogues(evidence)
    counted = compared_events(evidence, shown)
    tables = {label: _by_place(evidence, events, counted[label]) for label, events in shown.items()}
    modelled = tables.get(MODEL_LABEL, {})
    keys = sorted(modelled, key=lambda place: -modelled[place][0])[:MAX_PLACES]
    found = dict(zip(keys, ("most in the model", "second in the model"), strict=False))
    for label, table in tables.items():
        if label != MODEL_LABEL and table:
            place = max(table, key=lambda one: table[one][0])
            if place not in found:
                found = dict([*list(found.items())[: MAX_PLACES - 1], (place, "most in the record")])
            else:
                found[place] += ", most in the record"
    return [_place(evidence, key, source, tables) for key, source in found.items()]


def _by_place(evidence: Evidence, events: xr.Dataset, counted: NDArray) -> dict[tuple[int, int], tuple[float, float]]:
    """Share of the potency and largest potency, m3, by opening and step (indices)."""
    potency = np.where(counted & np.isfinite(events["potency"].values), events["potency"].values, 0.0)
    total = potency.sum()
    opening, step = nearest_mined(evidence, events)[0], step_of_events(evidence, events)
    dated = [place for place, one in enumerate(evidence.steps) if int(one["dated"])]
    near = (opening >= 0) & np.isin(step, dated) & (potency > 0.0)
    found, place = np.unique(np.column_stack([opening, step])[near], axis=0, return_inverse=True)
    order = np.argsort(place.reshape(-1), kind="stable")
    bounds = np.searchsorted(place.reshape(-1)[order], np.arange(1, len(found)))
    return {
        (one, when): (float(here.sum() / total), float(here.max()))
        for (one, when), here in zip(found.tolist(), np.split(potency[near][order], bounds), strict=False)
    }


def _place(evidence: Evidence, key: tuple[int, int], source: str, tables: dict[str, dict]) -> Place:
    parts = []
    for label, table in tables.items():
        share, largest = table.get(key, (0.0, np.nan))
        which = label.lower().replace(" (twin)", "")
        text = f"{percent(share)} of the {which} potency" if share >= MIN_SHARE else f"hardly any {which} potency"
        if np.isfinite(largest):
            text += f", largest event Mw {fixed(magnitude(largest, shear_modulus(evidence)), 1)}"
        parts.append(text)
    opening = evidence.excavations[key[0]]
    return Place(opening.name, opening.step, str(evidence.steps[key[1]]["step"]), source, "; ".join(parts))
