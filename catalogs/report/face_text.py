"""Places against the face: rows, figure and sentences of the section `events`; None where the mine gives no face."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from catalogs.compare.face_measures import MEASURES, WEIGHTS
from catalogs.compare.locations import UNIFORM_SHARE
from catalogs.figures.face_figure import against_face
from catalogs.report.inputs import MODEL_LABEL, Evidence
from catalogs.report.text import DASH, between, number, percent, plural, whole

NAMES = {
    "median ahead": "median distance ahead of the face (m)",
    "share ahead": "share ahead of the face",
    "median across": "median distance across, from its middle (m)",
    "half width": "half of the width across that holds 68 % (m)",
}
OUT_OF_REACH = (
    "Where rock, stress and advance stay the same, the model breaks as much rock for each metre: it does not follow a "
    "rate that drifts along a panel. A record of earlier months, moved with the face, may tell the places of the next "
    "month better; snakemake baselines compares them. Directions of slip, b and elevations are out of reach, too: near "
    "a face they do not tell a good model from a bad one. What no record gives is a panel's start, a changed geometry, "
    "closure and stress."
)


def section(evidence: Evidence, add: Callable[[str, Figure], dict]) -> dict | None:
    """What the template shows; add: how a figure is saved."""
    comparison = evidence.comparison
    if comparison is None or "face_measure" not in comparison:
        return None
    counts = [int(count) for count in comparison["face_events"].values]
    if not all(counts):
        which = "the model" if not counts[0] else "the record"
        return {
            "figure": None,
            "rows": [],
            "text": f"Places are not compared with the face: no event of {which} that counts is of a step at whose end "
            "there is one.",
        }
    labels = {"model": MODEL_LABEL, "record": evidence.record_label}
    return {"figure": add("face", against_face(comparison, labels)), "rows": _rows(comparison), "text": _text(evidence)}


def _rows(comparison) -> list[dict]:
    """A row for each weight and measure: both catalogues with their intervals."""
    rows = []
    for weight in WEIGHTS:
        for measure in MEASURES:
            form = percent if measure == "share ahead" else number
            cells = []
            for name in ("model", "record"):
                pick = {"catalogue": name, "weight": weight, "measure": measure}
                ends = between(comparison["face_measure_interval"].sel(pick).values, form)
                value = form(float(comparison["face_measure"].sel(pick)))
                cells.append(value if DASH in (value, ends) else f"{value} ({ends})")
            rows.append({"name": NAMES[measure], "weight": weight, "cells": cells})
    return rows


def _text(evidence: Evidence) -> str:
    comparison = evidence.comparison
    model, record = (int(count) for count in comparison["face_events"].values)
    error = float(comparison.attrs["location_error"])
    without = int(comparison["events_above_cut"].sel(catalogue="record")) - record
    text = (
        f"{plural(record, 'recorded event')} and {whole(model)} modelled ones count. Distances are in plan, since the "
        "face is a line in plan. They are from the face at the end of each event's step, for both catalogues, since a "
        "modelled event has no time within its step. So an event is farther behind than it was when it happened. "
        "As a record would show them, modelled events are moved at random by the location error "
        f"({number(error)} m), and {percent(UNIFORM_SHARE)} of them lie anywhere in the box of all events. "
    )
    if without > 0:
        text += f"{plural(without, 'recorded event')} are of steps at whose end no face stands. "
    if not np.isfinite(comparison["face_measure_interval"].sel(catalogue="model")).any():
        text += "The model has no interval: fewer than three of its runs have such events. "
    return text + OUT_OF_REACH
