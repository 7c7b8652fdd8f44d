"""The sections of the report: of each its figures, rows and numbers, as the template shows them."""

import json
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from catalogs.compare.size_measures import fit
from catalogs.figures import (
    beachballs,
    convergence_figure,
    events_figure,
    record_figure,
    rock_figure,
    scene_figure,
    sizes_figure,
    source_types,
    stereonets,
    style,
    views,
)
from catalogs.report import energy_text, match, text
from catalogs.report.by_opening import opening_rows, with_most_potency
from catalogs.report.catalogues_shown import compared_events, selection, shown_catalogues
from catalogs.report.closeness_text import closeness_rows, intervals_contain, unlike
from catalogs.report.face_text import section as section_of_face
from catalogs.report.gallery import Gallery
from catalogs.report.grid_convergence_text import rows as cell_rows
from catalogs.report.inputs import MODEL_LABEL, Evidence
from catalogs.report.mechanism_inputs import insitu_axes, iso_share
from catalogs.report.record_text import as_sentence
from catalogs.report.scene_text import above_cap, by_step, far_field
from catalogs.report.spread_text import section as section_of_spread
from catalogs.report.view_section import section as section_of_view
from catalogs.settings import ComparisonSettings
from catalogs.sources.mechanisms import describe_axes, trend_plunge
from catalogs.sources.size_law import NONE, TRUNCATED
from catalogs.sources.sizes import B_MAGNITUDE_PER_B_POTENCY, b_by_cut, cut_grid, log_potency

LARGEST_EVENTS_DRAWN = 10  # Number of beach balls.
MAX_ROWS_UNFOLDED = 40  # A longer table is folded, or scrolls.


def sections_of(evidence: Evidence) -> dict[str, Callable[[Gallery], Any]]:
    """What gives the content of each section, by its name in the template; None where there is nothing to show.

    That which takes longest comes first.
    """
    return {
        "axes": partial(_axes, evidence),
        "events": partial(_events, evidence),
        "rock": partial(_rock, evidence),
        "convergence": partial(_convergence, evidence),
        "scene": partial(_scene, evidence),
        "balls": partial(_balls, evidence),
        "view": lambda _: section_of_view(evidence, shown_catalogues(evidence)),
        "sizes": partial(_sizes, evidence),
        "spread": lambda gallery: section_of_spread(evidence, gallery.add),
        "budget": lambda _: _budget(evidence),
        "forecasts": lambda _: _forecasts(evidence),
    }


def _forecasts(evidence: Evidence) -> list[str]:
    """What kept forecasts said, beside what was recorded, in sentences."""
    return [] if evidence.forecast_scores is None else json.loads(evidence.forecast_scores.attrs["sentences"])


def _cuts(evidence: Evidence) -> list[views.View]:
    """Cut planes through the fullest layers of what the dated steps mine; if nothing is dated, of all that is mined."""
    grid, rows = evidence.grid, evidence.excavations
    wanted = [index for index, row in enumerate(rows) if row.dated] or [
        index for index, row in enumerate(rows) if not row.planned
    ]
    centre, volume = views.piece_centres(grid)
    return views.cuts(grid, centre, volume * np.isin(grid["piece_excavation"].values, wanted))


def _scene(evidence: Evidence, gallery: Gallery) -> dict:
    cuts, rows = _cuts(evidence), evidence.excavations
    return {
        "levels": gallery.add("grid_levels", scene_figure.grid_levels(evidence.grid, cuts)),
        "share": gallery.add("excavated_share", scene_figure.excavated_share(evidence.grid, cuts, evidence.planned))
        if evidence.grid.sizes["piece"]
        else None,
        "table": scene_figure.level_table(evidence.grid),
        "above_cap": above_cap(evidence),
        "far_field": far_field(evidence.grid),
        "excavations": rows,
        "steps": by_step(rows) if len(rows) > MAX_ROWS_UNFOLDED else [],
    }


def _convergence(evidence: Evidence, gallery: Gallery) -> dict | None:
    if not evidence.stages:
        return None
    figure = gallery.add("convergence", convergence_figure.convergence(evidence.stages))
    failures = [int(stage["convergence_new_failures"].values.sum()) for stage in evidence.stages]
    beside = evidence.grid_convergence
    return {
        "figure": figure,
        "table": list(zip([stage.attrs for stage in evidence.stages], failures, strict=True)),
        "cells": [] if beside is None else cell_rows(beside),
        "sizes": [] if beside is None else [f"{cell:g}" for cell in beside["cell"].values],
        "floor": np.nan if beside is None else float(beside.attrs["floor"]),
    }


def _rock(evidence: Evidence, gallery: Gallery) -> dict | None:
    if evidence.state is None:
        return None
    grid, state, cuts, planned = evidence.grid, evidence.state, _cuts(evidence), evidence.planned
    sections = [view for view in cuts if view.vertical == views.UP] or cuts
    shown = {"failed": None, "table": energy_text.totals(evidence), "energy": energy_text.section(evidence)}
    if (state["failed"].values >= 0).any():
        last = max(int(step["step_index"]) for step in evidence.steps)
        names, dated = ["" for _ in range(last + 1)], [False] * (last + 1)
        for step in evidence.steps:
            names[int(step["step_index"])], dated[int(step["step_index"])] = step["step"], bool(int(step["dated"]))
        shown["failed"] = gallery.add("failed_rock", rock_figure.failed_rock(grid, state, cuts, names, dated, planned))
    shown["strength"] = gallery.add("strength_factor", rock_figure.strength_factor(grid, state, sections, planned))
    shown["displacement"] = gallery.add("displacement", rock_figure.displacement(grid, state, sections, planned))
    return shown


def _events(evidence: Evidence, gallery: Gallery) -> dict | None:
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
        "rows": match.location_rows(evidence) if located else [],
        "text": as_sentence(evidence.comparison.attrs.get("location_text", "")) if compared else "",
        "crowd": any(events_figure.is_crowd(catalog) for catalog in shown.values()),
        "beside": len(shown) > 1,
        "in_time": _in_time(evidence, gallery),
        "face": section_of_face(evidence, gallery.add),
    }


def _in_time(evidence: Evidence, gallery: Gallery) -> dict | None:
    """The record in time; None without one, or without a cut."""
    if evidence.comparison is None or not np.isfinite(evidence.comparison["cut"]):
        return None
    figure = record_figure.in_time(
        evidence.record, evidence.resolved, evidence.dated, evidence.record_label, float(evidence.comparison["cut"])
    )
    return None if figure is None else gallery.add("record_in_time", figure)


def _sizes(evidence: Evidence, gallery: Gallery) -> dict | None:
    shown = shown_catalogues(evidence)
    if not shown:
        return None
    catalogs = [_size_fit(evidence, label, catalog) for label, catalog in shown.items()]
    rows = closeness_rows(evidence, catalogs[0].cut) if MODEL_LABEL in shown else []
    return {
        "figure": gallery.add("potency_frequency", sizes_figure.potency_frequency(catalogs)),
        "by_cut": gallery.add("b_against_cut", sizes_figure.b_against_cut(catalogs)),
        "rows": match.size_rows(evidence),
        "fits": catalogs,
        "closeness": rows,
        "intervals": intervals_contain(evidence, rows),
        "unlike": unlike(evidence),
        "scales": (1.0, B_MAGNITUDE_PER_B_POTENCY),
        "texts": [
            as_sentence(evidence.comparison.attrs[name])
            for name in ("sums_text", "size_text")
            if evidence.comparison is not None
        ],
    }


def _size_fit(evidence: Evidence, label: str, catalog) -> sizes_figure.Sizes:
    """b of one catalogue: from the comparison, or above the model's own floor if it stands alone."""
    values = log_potency(catalog["potency"].values)
    modelled, comparison = label == MODEL_LABEL, evidence.comparison
    colour = style.MODELLED if modelled else style.RECORDED
    if comparison is not None:
        here = comparison.sel(catalogue="model" if modelled else "record")
        by_cut = np.stack([comparison["cut_log_potency"], here["b_by_cut"], here["b_by_cut_error"]])
        b, a, interval = float(here["b"]), float(here["a"]), tuple(here["b_interval"].values)
        law, cut = comparison.attrs["law_model" if modelled else "law_record"], float(comparison["cut"])
        if law == TRUNCATED:  # its line through the same number of events at the cut
            a += (float(here["b_truncated"]) - b) * cut
            b, interval = float(here["b_truncated"]), tuple(here["b_truncated_interval"].values)
        elif law == NONE:
            b = a = np.nan
        return sizes_figure.Sizes(label, colour, values, b, interval, a, cut, by_cut)
    floor = float(evidence.catalog.attrs["potency_floor"]) if modelled else np.nan
    known = values[np.isfinite(values)]
    cut = np.log10(floor) if floor > 0 else known.min(initial=np.inf)
    one = fit(known, float(cut), 0.0, False, ComparisonSettings())
    value = one.quoted
    b, a, interval = (np.nan,) * 2 + ((np.nan, np.nan),)
    if value is not None:  # its line goes through the number of events at the cut
        b, a, interval = value.b, one.plain.a + (value.b - one.plain.b) * float(cut), (value.lower, value.upper)
    table = [(each.cut, each.b, each.error) for each in b_by_cut(known, cut_grid(known))]
    return sizes_figure.Sizes(
        label, colour, values, b, interval, a, float(cut), np.array(table, float).reshape(-1, 3).T
    )


def _axes(evidence: Evidence, gallery: Gallery) -> dict | None:
    shown = shown_catalogues(evidence)
    chosen = compared_events(evidence, shown)
    kept = {label: catalog.isel(event=chosen[label]) for label, catalog in shown.items()}
    nets = [net for net in (_net(evidence, *item) for item in kept.items()) if net is not None]
    if not nets:
        return None
    compared = evidence.comparison is not None and int(evidence.comparison.attrs.get("axes_present", 0))
    typed = {label: catalog for label, catalog in kept.items() if np.isfinite(catalog["dc"].values).any()}
    colours = {label: style.MODELLED if label == MODEL_LABEL else style.RECORDED for label in typed}
    return {
        "figure": gallery.add("stereonets", stereonets.stereonets(nets, insitu_axes(evidence))),
        "types": gallery.add("source_types", source_types.source_types(typed, colours)) if typed else None,
        "iso_share": iso_share(evidence),
        "selection": selection(chosen),
        "kagan": gallery.add("kagan_angles", stereonets.kagan_angles(evidence.comparison)) if compared else None,
        "rows": match.axis_rows(evidence) if compared else [],
        "text": "" if evidence.comparison is None else as_sentence(evidence.comparison.attrs.get("axes_text", "")),
    }


def _net(evidence: Evidence, label: str, catalog) -> stereonets.Axes | None:
    """Axes of one catalogue with their means; None if it has none."""
    modelled, comparison = label == MODEL_LABEL, evidence.comparison
    vectors = np.stack([catalog[f"{name}_axis"].values for name in "pbt"])
    known = np.isfinite(vectors).all(axis=2).any(axis=0)
    if not known.any():
        return None
    vectors = vectors[:, known]
    if comparison is not None and int(comparison.attrs.get("axes_present", 0)):
        here = comparison.sel(catalogue="model" if modelled else "record")
        names = ("mean_trend", "mean_plunge", "mean_cone", "axis_shape", "pole_trend", "pole_plunge")
        common = [here[name].values for name in names]
    else:
        found = [describe_axes(one, np.arange(len(one)), blocks_known=False) for one in vectors]
        mean, pole = (trend_plunge(np.array(part)) for part in zip(*((f.mean, f.pole) for f in found), strict=True))
        common = [*mean, np.full(3, np.nan), np.array([one.shape for one in found]), *pole]
    look = (style.MODELLED, "Blues") if modelled else (style.RECORDED, "Oranges")
    return stereonets.Axes(label, *look, vectors, *common)


def _balls(evidence: Evidence, gallery: Gallery) -> dict | None:
    if evidence.catalog is None:
        return None
    largest = text.largest_events(evidence.resolved, LARGEST_EVENTS_DRAWN)
    if not len(largest):
        return None
    chosen = evidence.resolved.isel(event=largest)
    rows = text.ball_rows(chosen)
    titles = [
        f"{row['rank']}: log P {row['log_potency']}, Mw {row['mw']}\n{row['location']} m\n{row['step']}" for row in rows
    ]
    axes_of = np.stack([chosen["p_axis"].values, chosen["t_axis"].values], axis=1)
    tensors = chosen["moment_tensor"].values
    return {
        "figure": gallery.add("beach_balls", beachballs.beach_balls(tensors, titles, axes_of, style.MODELLED)),
        "rows": rows,
    }


def _budget(evidence: Evidence) -> dict | None:
    components, rows, budget = text.budget_rows(evidence)
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
