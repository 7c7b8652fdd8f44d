"""Places and times of events of both catalogues: in space, by opening, in time and relative to the face.

The template is "events.html.j2".
"""

import numpy as np
import xarray as xr
from matplotlib import dates
from matplotlib.figure import Figure

from catalogs.compare.exposure import window
from catalogs.compare.face_measures import MEASURES, WEIGHTS
from catalogs.compare.locations import UNIFORM_SHARE
from catalogs.figures import events_figure, style
from catalogs.figures.events_figure import days_since_1970
from catalogs.report.by_opening import opening_rows, with_most_potency
from catalogs.report.evidence import MODEL_LABEL, Evidence, compared_events, selection, shown_catalogues
from catalogs.report.gallery import Gallery
from catalogs.report.text import (
    DASH,
    as_sentence,
    between,
    comparison_row,
    number,
    percent,
    plural,
    whole,
    with_unit,
)
from catalogs.sources.completeness import fullest_bin
from catalogs.sources.sizes import log_potency

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
BINS = 40
SHARE_OUTSIDE = 0.01  # Of the events of a catalogue that may lie beyond either end of an axis.
AXIS_LABELS = {"ahead": "ahead of the face (m); behind it below 0", "across": "across, from the middle of the face (m)"}
WEIGHT_LABELS = {"number": "share of events", "potency": "share of potency"}
EVENTS_PER_WINDOW = 100  # Events whose fullest bin is found; more where there would be over MAX_WINDOWS windows.
MAX_WINDOWS = 30
MIN_EVENTS_IN_TIME = 40  # Fewer events have no completeness in time.


def section(evidence: Evidence, gallery: Gallery) -> dict | None:
    """Content of the section on events: figures of places and of nearness, selection, location error (m; 0 if places
    are not compared), rows by opening, labels of the catalogues, rows and text of the comparison of places, events in
    time and relative to the face. None without events."""
    shown = shown_catalogues(evidence)
    if not shown:
        return None
    chosen = compared_events(evidence, shown)
    rows = opening_rows(evidence, list(shown.values()), list(chosen.values()))
    compared = evidence.comparison is not None
    located = compared and bool(np.isfinite(evidence.comparison["energy_distance"]))
    return {
        "figure": gallery.add("events", events_figure.locations(evidence.grid, shown, chosen, evidence.planned)),
        "selection": selection(chosen),
        "smeared": float(evidence.comparison.attrs["location_error"]) if located else 0.0,
        "openings": with_most_potency(rows) if MODEL_LABEL in shown else [],
        "labels": list(shown),
        "nearness": gallery.add("nearness", events_figure.nearness(evidence.comparison)) if located else None,
        "rows": location_rows(evidence) if located else [],
        "text": as_sentence(evidence.comparison.attrs.get("location_text", "")) if compared else "",
        "crowd": any(events_figure.is_crowd(catalog) for catalog in shown.values()),
        "beside": len(shown) > 1,
        "in_time": _in_time(evidence, gallery),
        "window": EVENTS_PER_WINDOW,
        "face": _against_face(evidence, gallery),
    }


def _in_time(evidence: Evidence, gallery: Gallery) -> dict | None:
    """The record in time; None without one, or without a cut."""
    if evidence.comparison is None or not np.isfinite(evidence.comparison["cut"]):
        return None
    figure = in_time(
        evidence.record, evidence.resolved, evidence.dated, evidence.record_label, float(evidence.comparison["cut"])
    )
    return None if figure is None else gallery.add("record_in_time", figure)


def location_rows(evidence: Evidence) -> list[dict]:
    """Location: number and 95 % interval of each measure."""
    comparison = evidence.comparison
    if comparison is None:
        return []

    def near(pair: int) -> tuple[str, str]:
        here = comparison["nearest_distance"].isel(pair=pair), comparison["nearest_distance_interval"].isel(pair=pair)
        return with_unit(number(here[0]), " m"), between(here[1].values)

    chance = between(comparison["energy_distance_null"].values)
    return [
        comparison_row(
            "distance between the centroids", "", "", with_unit(number(comparison["centroid_distance"]), " m"),
            between(comparison["centroid_distance_interval"].values),
        ),
        comparison_row(
            "energy distance (0: one distribution" + (")" if chance == DASH else f"; by chance {chance} m)"), "", "",
            with_unit(number(comparison["energy_distance"]), " m"),
            between(comparison["energy_distance_interval"].values),
        ),
        comparison_row("from a modelled event to the nearest recorded, median", "", "", *near(0)),
        comparison_row("from a recorded event to the nearest modelled, median", "", "", *near(1)),
        comparison_row("from a recorded event to the nearest recorded, median", "", "", *near(2)),
    ]  # fmt: skip


def _against_face(evidence: Evidence, gallery: Gallery) -> dict | None:
    """Places against the face; None where the mine gives none."""
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
    return {
        "figure": gallery.add("face", against_face(comparison, labels)),
        "rows": _face_rows(comparison),
        "text": _face_text(evidence),
    }


def _face_rows(comparison) -> list[dict]:
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


def _face_text(evidence: Evidence) -> str:
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


def against_face(comparison: xr.Dataset, labels: dict[str, str]) -> Figure:
    """Histograms, a column for each axis and a row for each weight; labels of `model` and `record`."""
    colours = {"model": style.MODELLED, "record": style.RECORDED}
    figure = style.new_figure(height=5.2)
    array = figure.subplots(2, 2, sharex="col", squeeze=False)
    for column, axis in enumerate(AXIS_LABELS):
        places = {name: comparison[f"{name}_face"].sel(face_axis=axis).values for name in labels}
        ends = [np.quantile(one, [SHARE_OUTSIDE, 1.0 - SHARE_OUTSIDE]) for one in places.values() if len(one)]
        edges = np.linspace(min(low for low, _ in ends), max(high for _, high in ends), BINS + 1)
        for row, weight in enumerate(WEIGHT_LABELS):
            axes = array[row, column]
            for name, label in labels.items():
                shares = comparison[f"{name}_face_weight"].sel(weight=weight).values
                counted = np.histogram(places[name], edges, weights=shares)[0]
                axes.stairs(100.0 * counted, edges, color=colours[name], linewidth=1.5, label=label)
            if axis == "ahead":
                axes.axvline(0.0, color=style.OUTLINE, linewidth=0.9, linestyle="--", label="the face")
            axes.set_xlim(edges[0], edges[-1])
            axes.set_ylim(0, None)
            axes.set_ylabel(f"{WEIGHT_LABELS[weight]}\nper {np.diff(edges)[0]:.2g} m (%)")
        array[1, column].set_xlabel(AXIS_LABELS[axis])
    array[0, 1].legend(*array[0, 0].get_legend_handles_labels(), loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def in_time(record: xr.Dataset, model: xr.Dataset, steps: list[dict], label: str, cut: float) -> Figure | None:
    """Sizes against time, cumulative potency of record and model (m3, from the cut on), completeness in time.

    steps: attributes of the dated steps, with start and end; label: of the record; cut: log10 of potency in m3. The
    model's events are ordered within a step, not dated: its potency is drawn at the ends of steps. None without times.
    """
    days, size = days_since_1970(record), log_potency(record["potency"].values)
    known = np.isfinite(days) & np.isfinite(size)
    if not known.any():
        return None
    order = np.flatnonzero(known)[np.argsort(days[known], kind="stable")]
    days, size = days[order], size[order]
    figure = style.new_figure(height=4.6)
    top, bottom = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [3, 2]})
    top.plot(
        days, size, ".", markersize=3.5 if len(days) < 2000 else 1.5, color=style.RECORDED, alpha=0.6, rasterized=True,
        label=label,
    )  # fmt: skip
    if len(days) >= MIN_EVENTS_IN_TIME:
        top.step(*completeness(days, size), where="mid", color="k", linewidth=1.4, label="complete from (fullest bin)")
    top.axhline(cut, color="k", linestyle="--", linewidth=0.8, label=f"cut {cut:.2f}".replace("-", "−"))
    top.set_ylabel("log P")
    top.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    counted = size >= cut
    bottom.step(
        np.append(days[counted], days[-1]), np.append(np.cumsum(10.0 ** size[counted]), np.sum(10.0 ** size[counted])),
        where="post", color=style.RECORDED, label=label,
    )  # fmt: skip
    edges: list = []
    sums: list = []
    own, name = log_potency(model["potency"].values), model["step"].values
    inside = np.flatnonzero(own >= cut)
    inside = inside[np.argsort(name[inside], kind="stable")]
    found, first = np.unique(name[inside], return_index=True)
    by_step = dict(zip(found.tolist(), np.split(own[inside], first)[1:], strict=True))
    many = style.are_many(steps)
    for step in steps:
        start, end = (dates.date2num(moment) for moment in window(step))
        total = sums[-1] if sums else 0.0
        edges += [start, end]
        sums += [total, total + float(np.sum(10.0 ** by_step.get(step["step"], np.empty(0))))]
        for axes in (top, bottom):
            axes.axvline(start, color="#bbbbbb", linewidth=0.7, zorder=0, rasterized=many)
    bottom.plot(
        edges, sums, color=style.MODELLED, marker="o", markersize=4, label="Modelled, by step", rasterized=many
    )  # fmt: skip
    bottom.set_ylabel("potency from the\ncut on (m³)")
    bottom.set_ylim(0, None)
    bottom.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    locator = dates.AutoDateLocator(minticks=3, maxticks=9)
    bottom.xaxis.set_major_locator(locator)
    bottom.xaxis.set_major_formatter(dates.ConciseDateFormatter(locator))
    return figure


def completeness(days: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middle day and fullest bin (log10 m3) of windows of events in a row, half overlapping; days ascending."""
    width = min(max(EVENTS_PER_WINDOW, len(days) // MAX_WINDOWS), len(days))
    starts = range(0, len(days) - width + 1, max(width // 2, 1))
    found = [fullest_bin(size[start : start + width]) for start in starts]
    return np.array([np.median(days[start : start + width]) for start in starts]), np.array(found)
