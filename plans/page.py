"""The page of the plans with its figures, and the table in the same folder."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import matplotlib.dates
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from catalogs.compare.exposure import window
from catalogs.figures import panels, style, views
from catalogs.report.text import fixed, typeset
from catalogs.sources.openings import NEVER, Mining
from common.datasets import atomic_path, read_dataset
from common.errors import InputError
from common.opening_table import read_opening_runs
from common.pages import page_templates
from plans.comparisons import Comparisons
from plans.layout import ANY, PlanSummary, read_outcome
from plans.loading_rows import LOADING_VARIABLES, loading_rows
from plans.opening_depths import depth_section
from plans.overview import overview
from plans.sentences import collapsed, interval_contents, law_texts, missing, step_range, verdict
from plans.settings import PlansReportSlice
from plans.shaking_rows import SHAKING_VARIABLES, shaking_rows
from plans.tables import (
    exposed_rows,
    forecast_rows,
    matrix,
    measured_text,
    opening_rows,
    plan_rows,
    step_rows,
    write_table,
)

TEMPLATES = Path(__file__).parent / "templates"
COLOURS = (style.MODELLED, style.RECORDED, style.BOTH, "#cc79a7", "#e69f00", "#56b4e9")  # Okabe and Ito (2008)
DASHES = ("-", "--", "-.", ":")  # so that overlapping lines can be distinguished
MAX_EVENTS_SHOWN = 60  # Events of each plan that are drawn.
SMALLEST, LARGEST = 3.0, 12.0  # Points: diameters of the smallest and largest event shown.
MAX_COLUMNS = 3


def report_stage(
    given: Mapping,
    *,
    grid: Path,
    outcomes: Sequence[Path],
    output: Path,
    table: Path,
    shaking: Sequence[Path] = (),
    loading: Sequence[Path] = (),
    openings: Sequence[Path] = (),
) -> None:
    """Write the page of all plans (`output`) and the table.

    given: the stage's slice (PlansReportSlice); outcomes: outcome.nc of each plan, that which others are compared with
    first; shaking, loading, openings: shaking.nc, loading.nc and opening_runs.nc of each plan, in the same order, or
    none.
    """
    plans = [read_outcome(path) for path in outcomes]
    felt = [read_dataset(path, SHAKING_VARIABLES) for path in shaking]
    loaded = [read_dataset(path, LOADING_VARIABLES) for path in loading]
    around = [read_opening_runs(path) for path in openings]
    settings = PlansReportSlice.of(given, "plans")
    write_report(plans, read_dataset(grid), settings, output, table, felt, loaded, around)


def write_report(
    outcomes: Sequence[xr.Dataset],
    grid: xr.Dataset,
    settings: PlansReportSlice,
    page: Path,
    table: Path,
    shaking: Sequence[xr.Dataset] = (),
    loading: Sequence[xr.Dataset] = (),
    openings: Sequence[xr.Dataset] = (),
) -> None:
    """Write the page, which needs nothing else, its figures in the same folder, and the table, atomically.

    outcomes: of all plans (plans.layout), that which others are compared with first; shaking, loading: of each of them
    (shaking.layout, common.loading_table), or none; openings: opening_runs.nc of each of them (common.opening_table) or
    none. Raises InputError for one of another mine, or of other classes.
    """
    every = [PlanSummary(one) for one in outcomes]
    for plan in every:
        if plan.outcome.attrs["mine"] != settings.mine:
            raise InputError(f"plans: {plan.name} is of mine {plan.outcome.attrs['mine']}, not of {settings.mine}")
        classes = list(plan.outcome["size"].values), [float(one) for one in plan.outcome["distance"].values]
        if classes != (list(settings.hazard.sizes), list(settings.hazard.distances)):
            raise InputError(f"plans: {plan.name} was made with other classes of size or distance; run it again")
    plans = [plan for plan in every if not plan.collapsed]
    felt = [one for one, plan in zip(shaking, every, strict=bool(shaking)) if not plan.collapsed]
    loaded = [one for one, plan in zip(loading, every, strict=bool(loading)) if not plan.collapsed]
    around = [one for one, plan in zip(openings, every, strict=bool(openings)) if not plan.collapsed]
    if not plans:
        raise InputError(
            f"plans: rock finds no equilibrium in any plan ({every[0].name}: in step {every[0].collapsed}), so there "
            "is nothing to compare; see docs/how-to/loose-rock.md"
        )
    hazard, comparisons = settings.hazard, Comparisons(plans)
    with style.applied():
        figures = {"map": draw_plans(plans, grid), "course": draw_course(plans)}
        pictures = {name: style.save(figure, page.parent / f"{name}.svg") for name, figure in figures.items()}
    ratios = {str(plan.outcome.attrs["ratio_text"]) for plan in plans} - {""}
    text = (
        page_templates(TEMPLATES)
        .get_template("plans.html.j2")
        .render(
            mine=settings.mine,
            first=plans[0].name,
            labels=[plan.name for plan in plans],
            overview=overview(comparisons, hazard, settings.titles or {}),
            collapsed=collapsed(every),
            verdict=verdict(comparisons, hazard),
            missing=missing(comparisons, hazard),
            contained=interval_contents(comparisons),
            plans=plan_rows(comparisons),
            steps=step_rows(comparisons, hazard),
            openings=opening_rows(comparisons),
            sizes=[(name, typeset(f"{value:g}")) for name, value in hazard.sizes.items()],
            distances=[f"{distance:g}" for distance in hazard.distances],
            matrices=[
                {"plan": plan.name, "steps": step_range(plan.counted), "rows": matrix(plan, hazard, comparisons)}
                for plan in plans
            ],
            exposed=exposed_rows(plans, hazard),
            likelihoods=sorted((hazard.likelihoods or {}).items(), key=lambda one: one[1]),
            forecasts=forecast_rows(plans),
            shaking=shaking_rows(plans, felt),
            loading=loading_rows(plans, loaded),
            depths=depth_section(plans, around),
            measured=measured_text(plans),
            laws=law_texts(plans),
            ratios=sorted(ratios),
            members=[plan.members for plan in plans],
            pictures=pictures,
        )
    )
    write_table(table, plans, hazard)
    with atomic_path(page) as temporary:
        temporary.write_text(f"{text.rstrip()}\n", encoding="utf-8")


def step_order(plans: Sequence[PlanSummary]) -> list[str]:
    """Names of the steps of all plans, in order of time."""
    start = {step: plan.dates(step)[0] for plan in plans for step in plan.steps}
    return sorted(start, key=lambda step: start[step])


def _first_mined(grid: xr.Dataset, plan: PlanSummary) -> xr.Dataset:
    """The grid with each part of a cell in the excavation that the plan mines first there."""
    names, steps = json.loads(grid.attrs["excavation_names"]), list(plan.steps)
    mined = np.full(len(names), len(steps))
    for opening in plan.openings:
        if opening in names:
            step = plan.mined_in(opening)
            mined[names.index(opening)] = steps.index(step) if step in steps else -1
    return Mining.of(grid, mined, np.full(len(names), NEVER)).first_mined(grid)


def draw_plans(plans: Sequence[PlanSummary], grid: xr.Dataset) -> Figure:
    """Openings of each plan in the colour of the step that mines them, with its largest events, in plan.

    Size by magnitude, colour by step; of the plan's own run. grid: grid.nc of the mine, whose openings are drawn.
    """
    steps, names = step_order(plans), json.loads(grid.attrs["excavation_names"])
    colours = dict(zip(steps, style.step_colours([True] * len(steps)), strict=True))
    events = [_largest(plan) for plan in plans]
    lower, upper = views.frame_limits(grid, [place for place, _, _ in events], margin=0.03)
    named = [replace(views.PLAN, name=plan.name) for plan in plans]
    figure, array, _ = panels.panels(named, lower, upper, min(len(plans), MAX_COLUMNS), tallest=11.0)
    known = np.concatenate([size for _, size, _ in events])
    low, high = (known.min(), known.max()) if len(known) else (0.0, 1.0)

    def diameter(size):
        return SMALLEST + (LARGEST - SMALLEST) * (size - low) / max(high - low, 1e-9)

    for axes, plan, view, (place, size, step) in zip(array, plans, named, events, strict=True):
        mined = {name: plan.mined_in(name) for name in plan.openings}
        as_mined = _first_mined(grid, plan)
        views.draw_excavations(axes, as_mined, view, [number for number, name in enumerate(names) if name not in mined])
        for one in plan.steps:
            excavations = [names.index(name) for name in mined if mined[name] == one and name in names]
            corner, edge, share = views.silhouette(as_mined, view, excavations)
            drawn = share >= views.MIN_EXCAVATED_SHARE_DRAWN
            if drawn.any():
                pale = mpl.colors.to_rgba(colours[one], 0.35)
                views.draw_squares(axes, corner[drawn], edge[drawn], facecolors=pale, zorder=1.0)
        across, up = place[:, view.axes].T
        axes.scatter(
            across, up, s=diameter(size) ** 2, c=[colours[plan.steps[number]] for number in step],
            alpha=0.85, edgecolors="black", linewidths=0.3, zorder=5,
        )  # fmt: skip
    keys: list = [Patch(facecolor=colour, label=step) for step, colour in style.thinned(list(colours.items()))]
    for value in (low, high) if len(known) else ():
        keys.append(
            Line2D([], [], linestyle="none", marker="o", markersize=diameter(value), color="#bbbbbb",
                   markeredgecolor="k", markeredgewidth=0.3, label=f"Mw {fixed(plans[0].magnitude(value), 1)}")
        )  # fmt: skip
    panels.key(figure, keys)
    return figure


def _largest(plan: PlanSummary) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The largest events of a plan's own run, the largest first: location, log10 P, index of the step."""
    place, size, step = plan.own_events()
    order = np.argsort(-size, kind="stable")[:MAX_EVENTS_SHOWN]
    return place[order], size[order], step[order]


def draw_course(plans: Sequence[PlanSummary]) -> Figure:
    """Summed potency of each plan against time: the mean of its runs as a thick line, each run as a thin one.

    A model dates no event within its step, so lines are straight in each.
    """
    figure = style.new_figure(height=3.6)
    axes = figure.subplots()
    for place, plan in enumerate(plans):
        colour, dash = COLOURS[place % len(COLOURS)], DASHES[place % len(DASHES)]
        potency = plan.of_runs("potency", plan.steps, ANY)
        times, rising = [], []
        for number, step in enumerate(plan.steps):
            start, end = window(dict(zip(("start", "end"), plan.dates(step), strict=True)))
            before = potency[:, :number].sum(axis=1)
            times += [start, end]
            rising += [before, before + potency[:, number]]
        lines = np.array(rising)
        if plan.members:
            axes.plot(times, lines, color=colour, linewidth=0.5, alpha=0.6)
        axes.plot(times, lines.mean(axis=1), color=colour, linestyle=dash, linewidth=2.0, label=plan.name)
    axes.set(xlabel="date (UTC)", ylabel="summed potency (m³)")
    axes.set_ylim(bottom=0.0)
    axes.xaxis.set_major_formatter(mpl.dates.ConciseDateFormatter(axes.xaxis.get_major_locator()))
    axes.grid(axis="y", color="#e2e2e2", linewidth=0.6)
    axes.legend(loc="upper left")
    return figure
