"""Recorded and modelled events of the dated steps in the same section and plan, one column for each catalogue."""

from collections.abc import Sequence
from dataclasses import replace

import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from baselines.models import BesideRecord
from baselines.scores import Counted
from catalogs.figures import panels, style, views
from catalogs.sizes import log_potency

SMALLEST, LARGEST = 2.5, 11.0  # Points: diameters of the smallest and largest event shown.


def draw_events(found: BesideRecord, grid: xr.Dataset, planned: Sequence[int]) -> Figure:
    """Events that are compared, one run of each model; colour by step, size by log P.

    grid: grid.nc of the mine, whose excavations lie underneath; planned: indices of those that are not mined.
    """
    label = "Recorded (twin)" if found.is_twin else "Recorded"
    shown = {label: found.recorded} | {model.label: model.first for model in found.models}
    lower, upper = views.frame_limits(grid, [events.place for events in shown.values()], margin=0.05)
    planes = [(view, name) for view in (views.LOOKING_NORTH, views.PLAN) for name in shown]
    named = [replace(view, name=f"{name}\n{view.name.lower()}") for view, name in planes]
    figure, array, _ = panels.panels(named, lower, upper, len(shown), tallest=13.0)
    colours = style.step_colours([True] * len(found.steps))
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

    keys = [mark(7.0, step, colour) for step, colour in style.thinned(list(zip(found.steps, colours, strict=True)))]
    values = [low + share * (high - low) for share in (0.0, 0.5, 1.0)]
    keys += [mark(diameter(value), f"log P {value:.1f}".replace("-", "−"), "#bbbbbb") for value in values]
    panels.key(figure, keys)
    return figure
