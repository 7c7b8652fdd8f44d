"""One picture of a scene before anything is solved: cells, solids by step, record."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from catalogs.figures import panels, style, views
from catalogs.settings import MinedStep
from catalogs.sources.openings import NEVER, Mining
from common.datasets import atomic_path

MARGIN_SHARE = 0.02  # Margin around the domain, as a share of its longest side.
BODY_COLOUR = "#b5651d"
HISTORY_COLOUR = to_rgb(style.OUTLINE)  # The grey of the report's figures is the colour of a cell here.
SOLID_OPACITY = 0.55  # Solids lie behind each other.
PICTURE_DOTS_PER_INCH = 200


def write_overview(grid: xr.Dataset, steps: Sequence[MinedStep], record: xr.Dataset | None, path: Path) -> None:
    """Write the picture as PNG; arguments as for `overview`."""
    with style.applied():
        figure = overview(grid, steps, record)
        with atomic_path(path) as temporary:
            figure.savefig(temporary, format="png", dpi=PICTURE_DOTS_PER_INCH, metadata={"Software": None})


def overview(grid: xr.Dataset, steps: Sequence[MinedStep], record: xr.Dataset | None) -> Figure:
    """Plan and sections: cells cut through the excavations, all solids and events as seen along the same direction.

    steps: in order, or their values; what none of them mines is planned.
    """
    steps = [MinedStep.of(step) for step in steps]
    lower, upper = views.domain(grid)
    place = np.empty((0, 3)) if record is None else record["location"].values
    cuts, side = _cuts(grid), (upper - lower).max() * (upper > lower)
    figure, array, _ = panels.panels(
        cuts, lower - MARGIN_SHARE * side, upper + MARGIN_SHARE * side, columns=min(len(cuts), 2), tallest=13.0
    )
    names = json.loads(grid.attrs["excavation_names"])
    number = {name: index for index, name in enumerate(names)}
    mined = [[number[name] for name in step.excavations] for step in steps]
    planned = sorted(set(range(len(names))) - {number for numbers in mined for number in numbers})
    when = np.full(len(names), len(steps))  # what is planned comes last
    for order, numbers in enumerate(mined):
        when[numbers] = order
    grid = Mining.of(grid, when, np.full(len(names), NEVER)).first_mined(grid)
    dated = [step.dated for step in steps]
    colours = [
        colour if flag else HISTORY_COLOUR for colour, flag in zip(style.step_colours(dated), dated, strict=True)
    ]
    level = ListedColormap(colormaps["Greys"](np.linspace(0.03, 0.4, int(grid.attrs["levels"]))))  # steps are coloured
    for axes, view in zip(array, cuts, strict=True):
        _draw_cells(axes, grid, view, level)
        size = (upper - lower)[view.axes]
        axes.add_patch(Rectangle(lower[view.axes], *size, fill=False, edgecolor="k", linewidth=1.0, zorder=2))
        along = replace(view, at=None)
        for numbers, colour in zip(mined, colours, strict=True):
            _draw_solids(axes, grid, along, numbers, colour)
        _draw_solids(axes, grid, along, planned, None)
        axes.plot(*place[:, view.axes].T, ".", color=style.RECORDED, markersize=2.5, zorder=5, rasterized=True)
        cut = "" if view.at is None else f"\ncells at {views.COORDINATE_NAMES[view.normal]} = {view.at:.10g} m"
        axes.set_title(view.name + cut)
    edge = float(grid.attrs["coarse_cell"])
    handles = [
        *(
            Patch(facecolor=level(index), edgecolor="#cccccc", label=f"cells of {edge / 2**index:g} m")
            for index in range(int(grid.attrs["levels"]))
        ),
        *([Patch(color=BODY_COLOUR, alpha=0.35, label="rock bodies")] if (grid["cell_body"].values >= 0).any() else []),
        *(
            Patch(facecolor=(*colour, SOLID_OPACITY), edgecolor=colour, label=step.name)
            for step, colour in style.thinned(
                [pair for pair in zip(steps, colours, strict=True) if pair[0].excavations]
            )
        ),
        *([Patch(facecolor="none", edgecolor=style.OUTLINE, label="planned")] if planned else []),
        *([_record_key(record)] if record is not None else []),
    ]
    if len(array) == 3:  # below the second, beside the third panel is paper
        right, below = array[1].get_position(), array[2].get_position()
        figure.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(right.x0, below.y1), ncols=1 + len(handles) // 20
        )
    else:
        panels.key(figure, handles, columns=5)
    return figure


def _cuts(grid: xr.Dataset) -> list[views.View]:
    """Cuts through the fullest layers of all excavations."""
    return views.cuts(grid, *views.piece_centres(grid))


def _draw_cells(axes: Axes, grid: xr.Dataset, view: views.View, level) -> None:
    """Cells of a cut by level, those of rock bodies shaded."""
    cells = views.cut_cells(grid, view)
    corner, size = grid["cell_origin"].values[cells][:, view.axes], grid["cell_size"].values[cells]
    edges = {"edgecolors": "white", "linewidths": 0.3} if views.edges_help(axes, float(size.min())) else {}
    views.draw_squares(axes, corner, size, facecolors=level(grid["cell_level"].values[cells]), zorder=0.1, **edges)
    body = grid["cell_body"].values[cells] >= 0
    views.draw_squares(axes, corner[body], size[body], facecolors=BODY_COLOUR, alpha=0.35, zorder=0.2)


def _draw_solids(axes: Axes, grid: xr.Dataset, along: views.View, numbers: list[int], colour) -> None:
    """Silhouettes of the excavations of one step; without a colour, of planned ones, as outlines."""
    lower, size, share = views.silhouette(grid, along, numbers)
    lower, size = lower[share >= views.MIN_EXCAVATED_SHARE_DRAWN], size[share >= views.MIN_EXCAVATED_SHARE_DRAWN]
    if not len(size):
        return
    if colour is not None:
        views.draw_squares(axes, lower, size, facecolors=colour, alpha=SOLID_OPACITY, zorder=3)
    axes.add_collection(
        LineCollection(
            views.outline_segments(lower, size),
            colors=style.OUTLINE if colour is None else [colour],
            linewidths=0.8,
            zorder=4,
        ),
        autolim=False,
    )


def _record_key(record: xr.Dataset) -> Line2D:
    """Key of the recorded events, with the number of those that lie outside the domain and are not compared."""
    crops = [one for one in json.loads(record.attrs.get("filter", "[]")) if one["filter"] == "domain"]
    outside = sum(crop["before"] - crop["after"] for crop in crops)
    farthest = max((crop["farthest"] for crop in crops if outside), default=0.0)
    label = f"{record.sizes['event']} recorded events"
    label += f"\n{outside} more outside the domain, up to {farthest:,.0f} m away" if outside else ""
    return Line2D([], [], color=style.RECORDED, marker=".", linestyle="none", label=label)
