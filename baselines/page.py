"""The page of the baselines: which model places events best, all measures in one table, steps, and a figure."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from baselines.alert_report import (
    alert_rows,
    alert_sentences,
    draw_molchan,
    drive_rows,
    no_skill_text,
    write_alerts,
)
from baselines.alerts import ALERT_SHARES
from baselines.catalogues import split_runs
from baselines.csep import rigidity, write_csep
from baselines.drives import DriveMetres
from baselines.map_scores import SIGNIFICANCE, MapScores, adjusted, verdict_of
from baselines.measures import read_measures
from baselines.models import NUMBER, POTENCY, SIZES, Counted, Model, ModelComparison, compare_with_record
from baselines.month_report import (
    factor,
    map_rows,
    nuisance_rows,
    p_text,
    rate_rows,
    sentences,
    times,
    too_few_clusters,
    write_months,
    write_rates,
)
from baselines.months import Months, compare_with_months
from baselines.number_report import (
    draw_numbers,
    is_scored,
    law_rows,
    number_columns,
    number_sentences,
    rule_names,
    score_rows,
)
from baselines.number_report import step_rows as number_rows
from baselines.settings import BaselineReportSlice, FlawSlice
from catalogs.compare.locations import UNIFORM_SHARE
from catalogs.compare.spread import read_members
from catalogs.figures import panels, style, views
from catalogs.report.text import DASH, between, fixed, hundredths, number, percent, whole, with_unit
from catalogs.sources.sizes import log_potency
from common.datasets import atomic_path, read_dataset
from common.event_table import read_events
from common.pages import page_templates
from common.source_tensors import moment_magnitude

TEMPLATES = Path(__file__).parent / "templates"
INPUT = "input, not scored"
NO_AXES = "no axes"
SMALLEST, LARGEST = 2.5, 11.0  # Points: diameters of the smallest and largest event shown.


def verdict(models: Sequence[Model], scores: MapScores) -> list[str]:
    """Say whether the first model, the pipeline's own, places recorded events better than each of the others.

    The tests of all others together keep their level. With too few independent clusters there is no verdict.
    """
    own, *others = models
    mean, interval = scores.mean(), scores.interval()
    ends = f"95 % interval {between(interval[0], factor)}; " if scores.has_intervals else ""
    gain = (
        f"Under {own.name} the place of a recorded event is on average {times(mean[0])} as probable as under a uniform "
        f"rate ({ends}information gain {fixed(mean[0], 2)} nats)."
    )
    if not scores.has_intervals:
        return [too_few_clusters(scores), gain]
    if not others:
        return [gain]
    leads = [scores.lead(own.label, other.label) for other in others]
    raised = adjusted([lead.p_value for lead in leads])
    places = "better than", "worse than", "neither better nor worse than"
    named: dict[str, list[str]] = {text: [] for text in places}
    for other, lead, p_value in zip(others, leads, raised, strict=True):
        certain = p_value < SIGNIFICANCE
        named[places[2] if not certain else places[0] if lead.value > 0.0 else places[1]].append(other.name)
    said = ", and ".join(f"{text} {' and '.join(names)}" for text, names in named.items() if names)
    known = ", as far as this record can tell" if named[places[2]] else ""
    lines = [
        f"{own.name[0].upper()}{own.name[1:]} places recorded events {said}{known}.",
        gain,
    ]
    if not np.nanmax(mean) > 0.0:
        lines.insert(1, "No model places them better than a uniform rate.")
    for other, lead, p_value in zip(others, leads, raised, strict=True):
        lines.append(
            f"It is {times(lead.value)} as probable as under {other.name} (95 % interval "
            f"{between(lead.interval, factor)}), which is {verdict_of(p_value)} (T test, {p_text(p_value)})."
        )
    return lines


def _valued(value, interval, unit: str = "", form=number) -> str:
    """A number, its unit, and its interval if it has one."""
    text, ends = with_unit(form(float(value)), unit), between(np.asarray(interval), form)
    return text if DASH in (text, ends) else f"{text} ({ends})"


def measure_rows(models: Sequence[Model], scores: MapScores) -> list[dict]:
    """One row for each measure of the whole time, one text for each model."""

    def ratio(model: Model, name: str, kind: str) -> str:
        if kind in model.inputs:
            return INPUT
        return _valued(model.comparison[f"{name}_ratio"], model.comparison[f"{name}_ratio_interval"])

    def distance(model: Model, name: str) -> str:
        return _valued(model.comparison[name], model.comparison[f"{name}_interval"], " m")

    def nearest(model: Model, pair: str) -> str:
        comparison = model.comparison.sel(pair=pair)
        return _valued(comparison["nearest_distance"], comparison["nearest_distance_interval"], " m")

    def axis(model: Model, name: str) -> str:
        comparison = model.comparison.sel(axis_name=name)
        return _valued(comparison["mean_angle"], comparison["mean_angle_interval"], "°") if model.has_axes else NO_AXES

    def kagan(model: Model) -> str:
        return with_unit(number(model.comparison["summed_kagan"]), "°") if model.has_axes else NO_AXES

    def test(model: Model, name: str, kind: str = "") -> str:
        return INPUT if kind in model.inputs else number(model.comparison[f"{name}_p_value"], 2)

    gain, interval = scores.mean(), scores.interval()
    rows = {
        "information gain, nats per recorded event": [
            _valued(gain[row], interval[row], form=hundredths) for row in range(len(models))
        ],
        "number of events, modelled over recorded": [ratio(model, "event", NUMBER) for model in models],
        "summed potency, modelled over recorded": [ratio(model, "potency", POTENCY) for model in models],
        "energy distance of the places (0: alike)": [distance(model, "energy_distance") for model in models],
        "distance between the centroids": [distance(model, "centroid_distance") for model in models],
        "from a modelled event to the nearest recorded, median": [nearest(one, "model_to_record") for one in models],
        "from a recorded event to the nearest modelled, median": [nearest(one, "record_to_model") for one in models],
        **{f"angle between the mean {name} axes": [axis(model, name) for model in models] for name in ("P", "B", "T")},
        "Kagan angle between the summed tensors": [kagan(model) for model in models],
        "N test of the number, p-value": [test(model, "event_ratio", NUMBER) for model in models],
        "M test of the sizes (b), p-value": [test(model, "b_difference", SIZES) for model in models],
        "S test of the places, p-value": [test(model, "energy") for model in models],
    }
    return [{"name": name, "cells": cells} for name, cells in rows.items()]


def step_rows(models: Sequence[Model], recorded: Counted, scores: MapScores, steps: Sequence[str]) -> list[dict]:
    """One row for each step: recorded number and potency, and those and the gain of each model."""
    sums = [model.counted.by_step(len(steps)) for model in models]
    count, potency = recorded.by_step(len(steps))
    rows = []
    for index, step in enumerate(steps):
        gain, interval = scores.mean(index), scores.interval(index)
        rows.append(
            {
                "step": step,
                "number": whole(count[index]),
                "potency": number(potency[index]),
                "numbers": [number(one[0][index]) for one in sums],
                "potencies": [
                    INPUT if POTENCY in model.inputs else number(one[1][index])
                    for model, one in zip(models, sums, strict=True)
                ],
                "gains": [_valued(gain[row], interval[row], form=hundredths) for row in range(len(models))],
            }
        )
    return rows


def write_table(path: Path, comparison: ModelComparison) -> None:
    """Write gain, number and potency of each step and of all steps as CSV, atomically."""
    recorded, scores, steps, rows = comparison.recorded, comparison.scores, comparison.steps, []
    count, potency = recorded.by_step(len(steps))
    for row, model in enumerate(comparison.models):
        sums = model.counted.by_step(len(steps))
        for index, step in [*enumerate(steps), (None, "all")]:
            pick = slice(None) if index is None else index
            interval = scores.interval(index)[row]
            rows.append(
                {
                    "model": model.label,
                    "step": step,
                    "recorded events": int(np.sum(count[pick])),
                    "recorded potency, m3": np.sum(potency[pick]),
                    "events": np.sum(sums[0][pick]),
                    "potency, m3": np.sum(sums[1][pick]),
                    "gain, nats per event": scores.mean(index)[row],
                    "gain, lower": interval[0],
                    "gain, upper": interval[1],
                }
            )
    with atomic_path(path) as temporary:
        pd.DataFrame(rows).to_csv(temporary, index=False, float_format="%.6g")


def _box_text(box: np.ndarray) -> str:
    """Sides of a box in plan."""
    (low_x, low_y), (high_x, high_y) = box
    return f"x {low_x:g} to {high_x:g} m, y {low_y:g} to {high_y:g} m".replace("-", "−")


def _flaw_values(model: Model, flaws: FlawSlice, attributes: Mapping) -> dict[str, str]:
    """Values of the page's paragraph on flaws; attributes: of their catalogue."""
    return {
        "radii": f"{flaws.radii[0]:g} to {flaws.radii[1]:g} m",
        "exponent": f"{flaws.exponent:g}",
        "b": fixed(flaws.exponent / 3.0, 2),
        "density": number(attributes["flaws_per_m3"], 2),
        "crack_density": number(attributes["crack_density"], 2),
        "mean": number(len(model.counted.place) / model.counted.runs),
    }


def write_page(
    page: Path,
    mine: str,
    comparison: ModelComparison,
    attributes: Mapping,
    grid: xr.Dataset,
    planned: Sequence[str],
    flaws: FlawSlice,
    months: Months,
    has_csep: bool = False,
    complete_above: float | None = None,
) -> None:
    """Write the page, which needs nothing else, and its figures in the same folder, atomically.

    attributes: of the catalogue of flaws; grid: grid.nc of the mine; planned: excavations that are not mined; months:
    maps and rates of the record itself; has_csep: forecasts for pyCSEP are written;
    complete_above: potency from which recorded events count there, m3, None for the cut of the comparison.
    """
    models, recorded, scores = comparison.models, comparison.recorded, comparison.scores
    names = json.loads(grid.attrs["excavation_names"])
    by_label = {model.label: model for model in models}
    with style.applied():
        figure = draw_events(comparison, grid, [index for index, name in enumerate(names) if name in planned])
        picture = style.save(figure, page.parent / "events.svg")
        molchan = style.save(draw_molchan(months), page.parent / "alerts.svg")
        by_step = style.save(draw_numbers(months), page.parent / "numbers.svg")
    text = (
        page_templates(TEMPLATES)
        .get_template("baselines.html.j2")
        .render(
            mine=mine,
            is_twin=comparison.is_twin,
            verdict=verdict(models, scores),
            labels=[model.label for model in models],
            measures=measure_rows(models, scores),
            steps=step_rows(models, recorded, scores, comparison.steps),
            picture=picture,
            months={
                "sentences": sentences(months),
                "complete_above": complete_above and fixed(float(np.log10(complete_above)), 2),
                "has_face": months.maps.face is not None,
                "steps": months.steps,
                "maps": map_rows(months),
                "choices": [name for name, _ in months.nuisances],
                "nuisances": nuisance_rows(months),
                "rates": rate_rows(months),
                "box": _box_text(months.maps.box),
                "deviation": number(float(np.median(months.maps.deviation))),
                "clusters": months.scores.clusters,
                "has_intervals": months.scores.has_intervals,
                "events": int(months.scores.common.sum()),
            },
            numbers={
                "sentences": number_sentences(months),
                "is_scored": is_scored(months),
                "scores": score_rows(months),
                "laws": law_rows(months),
                "steps": number_rows(months),
                "rules": rule_names(months),
                "events": int(months.numbers.common.sum()),
                "picture": by_step,
            },
            alerts={
                "sentences": alert_sentences(months),
                "shares": [f"{100 * share:g} %" for share in ALERT_SHARES],
                "rows": alert_rows(months),
                "no_skill": no_skill_text(months.alerts),
                "drive_rows": drive_rows(months),
                "drive_no_skill": no_skill_text(months.drive_alerts) if months.drive_alerts else "",
                "picture": molchan,
                "has_files": has_csep,
            },
            uniform=percent(UNIFORM_SHARE),
            cut=fixed(float(models[0].comparison["cut"]), 2),
            recorded=len(recorded.place),
            clusters=scores.clusters,
            runs=[model.counted.runs for model in models],
            events=[whole(len(model.counted.place)) for model in models],
            left_out=comparison.left_out,
            flaws=_flaw_values(by_label["Seeded flaws"], flaws, attributes) if "Seeded flaws" in by_label else None,
            rocks=[
                {
                    "name": name,
                    "friction": f"{one.friction_angle:g}°",
                    "cohesion": f"{one.cohesion / 1e6:g} MPa",
                }
                for name, one in flaws.strength.items()
            ],
        )
    )
    with atomic_path(page) as temporary:
        temporary.write_text(text, encoding="utf-8")


def draw_events(comparison: ModelComparison, grid: xr.Dataset, planned: Sequence[int]) -> Figure:
    """Draw recorded and modelled events of the dated steps in the same section and plan, one column for each catalogue.

    Modelled events are those of one run of each model; colour by step, size by log P.
    grid: grid.nc of the mine, whose excavations lie underneath; planned: indices of those that are not mined.
    """
    label = "Recorded (twin)" if comparison.is_twin else "Recorded"
    shown = {label: comparison.recorded} | {model.label: model.first for model in comparison.models}
    lower, upper = views.frame_limits(grid, [events.place for events in shown.values()], margin=0.05)
    planes = [(view, name) for view in (views.LOOKING_NORTH, views.PLAN) for name in shown]
    named = [replace(view, name=f"{name}\n{view.name.lower()}") for view, name in planes]
    figure, array, _ = panels.panels(named, lower, upper, len(shown), tallest=13.0)
    colours = style.step_colours([True] * len(comparison.steps))
    sizes = [log_potency(events.potency) for events in shown.values() if len(events.potency)]
    low, high = min(size.min() for size in sizes), max(size.max() for size in sizes)

    def diameter(size):
        return SMALLEST + (LARGEST - SMALLEST) * (size - low) / max(high - low, 1e-9)

    def draw(axes, events: Counted, view: views.View) -> None:
        wide = diameter(log_potency(events.potency))
        order = (-wide).argsort(kind="stable")  # large ones first, so that small ones stay visible
        axes.scatter(
            *events.place[order][:, view.axes].T, s=wide[order] ** 2, c=[colours[step] for step in events.step[order]],
            alpha=0.8, edgecolors="black", linewidths=0.25, zorder=3, rasterized=len(order) > 300,
        )  # fmt: skip

    for axes, (view, name) in zip(array, planes, strict=True):
        views.draw_excavations(axes, grid, view, planned)
        draw(axes, shown[name], view)

    def mark(width: float, name: str, colour) -> Line2D:
        return Line2D(
            [], [], linestyle="none", marker="o", markersize=width, label=name, color=colour, markeredgecolor="k",
            markeredgewidth=0.25,
        )  # fmt: skip

    keys = [
        mark(7.0, step, colour) for step, colour in style.thinned(list(zip(comparison.steps, colours, strict=True)))
    ]
    values = [low + share * (high - low) for share in (0.0, 0.5, 1.0)]
    keys += [mark(diameter(value), f"log P {value:.1f}".replace("-", "−"), "#bbbbbb") for value in values]
    panels.key(figure, keys)
    return figure


def report_stage(
    given: Mapping,
    *,
    grid: Path,
    catalog: Path,
    members: Sequence[Path],
    flaws: Path,
    excess_shear: Path,
    record: Path,
    comparison: Path,
    earlier: Path,
    output: Path,
    table: Path,
    months: Path,
    rates: Path,
    alerts: Path,
    states: Sequence[Path] = (),
    csep: Path | None = None,
) -> None:
    """Compare all models with the record, and write the page (`output`) and the tables.

    given: the stage's slice (BaselineReportSlice); members: folders with events of the mine's other runs; flaws,
    excess_shear: files of all runs of each baseline; comparison: file of the mine's own comparison with the record;
    earlier: file of the record from an earlier date on, or of the record itself; states: those of the
    mine, of which the last ones are the dated steps; csep: folder of the forecasts for pyCSEP, None for a mine without
    a place on Earth.
    """
    settings = BaselineReportSlice.of(given)
    grid_data, steps = read_dataset(grid), [step.name for step in settings.comparison.steps]
    fine_cell = float(grid_data.attrs["fine_cell"])
    flaw_events = read_events(flaws)
    compared = compare_with_record(
        [read_events(catalog), *read_members(list(members), steps, settings.mine)],
        read_dataset(comparison),
        split_runs(flaw_events),
        split_runs(read_events(excess_shear)),
        read_events(record),
        fine_cell,
        settings.comparison,
    )
    measures = read_measures(states, len(steps)) if states else {}
    drives = DriveMetres.of(grid_data, settings.drives, steps)
    monthly = compare_with_months(compared, read_events(earlier), fine_cell, settings, measures, drives)
    write_table(table, compared)
    write_months(months, monthly)
    write_rates(rates, monthly, number_columns(monthly))
    write_alerts(alerts, monthly)
    if csep is not None and settings.frame is not None:
        first, last = settings.depths
        smallest = settings.complete_above or 10.0 ** float(read_dataset(comparison)["cut"])
        cut = moment_magnitude(np.array(rigidity(read_events(record)) * smallest))
        write_csep(csep, monthly, settings.frame.given(), (first, last), float(cut))
    write_page(
        output, settings.mine, compared, flaw_events.attrs, grid_data, settings.planned, settings.flaws, monthly,
        csep is not None, settings.complete_above,
    )  # fmt: skip
