"""Figures of the plans: openings by step with the largest events, and potency in the course of time."""

import json
from collections.abc import Sequence
from dataclasses import replace

import matplotlib as mpl
import matplotlib.dates
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from catalogs.exposure import window
from catalogs.figures import panels, style, views
from plans.layout import ANY
from plans.plan_summary import PlanSummary

COLOURS = (style.MODELLED, style.RECORDED, style.BOTH, "#cc79a7", "#e69f00", "#56b4e9")  # Okabe and Ito (2008)
DASHES = ("-", "--", "-.", ":")  # so that lines which lie on each other can be told apart
LARGEST_SHOWN = 60  # Events of each plan that are drawn.
SMALLEST, LARGEST = 3.0, 12.0  # Points: diameters of the smallest and largest event shown.
MAX_COLUMNS = 3


def step_order(plans: Sequence[PlanSummary]) -> list[str]:
    """Names of the steps of all plans, in order of time."""
    start = {step: plan.dates(step)[0] for plan in plans for step in plan.steps}
    return sorted(start, key=lambda step: start[step])


def draw_plans(plans: Sequence[PlanSummary], grid: xr.Dataset) -> Figure:
    """Openings of each plan in the colour of the step that mines them, with its largest events, in plan.

    Size by log P, colour by step; the plan's own run. grid: grid.nc of the mine, which has the openings of all plans.
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
        views.draw_excavations(axes, grid, view, [number for number, name in enumerate(names) if name not in mined])
        for one in plan.steps:
            chosen = [names.index(name) for name in mined if mined[name] == one]
            corner, edge, share = views.silhouette(grid, view, chosen)
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
                   markeredgecolor="k", markeredgewidth=0.3, label=f"log P {value:.1f}".replace("-", "−"))
        )  # fmt: skip
    panels.key(figure, keys)
    return figure


def _largest(plan: PlanSummary) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The largest events of a plan's own run, the largest first: location, log10 P, index of the step."""
    place, size, step = plan.own_events()
    order = np.argsort(-size, kind="stable")[:LARGEST_SHOWN]
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
