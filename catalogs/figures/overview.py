"""One picture of a scene before anything is solved: cells, solids by step with their names, record, domain."""

import json
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from numpy.typing import NDArray

from catalogs.figures import style, views
from catalogs.figures.first_page_figure import plane_of, section_of
from catalogs.figures.names import bodies_named, write_names
from catalogs.figures.silhouettes import PLAN, SECTIONS, Plane, Silhouettes, draw, drawing_order
from catalogs.figures.step_key import draw_steps
from catalogs.settings import MinedStep
from common.datasets import atomic_path

MARGIN_SHARE = 0.12  # Margin around the openings, as a share of the longest side of what is shown.
MIN_MARGIN_CELLS = 3.0  # Finest cells that the margin is wide at least.
BODY_COLOUR = "#b5651d"
BLOCK_COLOURS = ("#d73027", "#7b3294", "#e6ab02", "#666666", "#1b7837")  # of materials of a block model
OTHERS = "other rock of blocks"
PICTURE_DOTS_PER_INCH = 200
NAME_SIZE = 6.0  # Points.
MAX_CANDIDATES = 120  # Openings that may be named.
MAX_BESIDE = 10  # Names in a panel that stand beside their openings.
WIDTH, TALLEST = 11.0, 12.0  # Inches.
LEFT, RIGHT, TOP, BOTTOM, KEY = 0.85, 0.15, 0.5, 0.55, 0.4  # Inches around a panel, and below all of them.
SIDE = 3.1  # Inches: width of the column with the domain and the key.
INSET = 1.9  # Inches: longest side of the picture of the domain.
NOTE_LETTERS = 52  # In a line of the notes.


@dataclass(frozen=True)
class _Panel:
    """A plane, the place of its cut along its normal, m, and lower and upper corner (2,) of what it shows, m."""

    plane: Plane
    at: float
    low: NDArray
    high: NDArray

    @property
    def origin(self) -> NDArray:
        """Place (2,), m, from which the axes count."""
        return np.array([0.0 if self.plane.along_axis else self.low[0], 0.0])


def write_overview(
    grid: xr.Dataset, steps: Sequence[MinedStep], record: xr.Dataset | None, path: Path, notes: Sequence[str] = ()
) -> None:
    """Write the picture as PNG; arguments as for `overview`."""
    with style.applied():
        figure = overview(grid, steps, record, notes)
        with atomic_path(path) as temporary:
            figure.savefig(temporary, format="png", dpi=PICTURE_DOTS_PER_INCH, metadata={"Software": None})


def overview(
    grid: xr.Dataset, steps: Sequence[MinedStep], record: xr.Dataset | None, notes: Sequence[str] = ()
) -> Figure:
    """Sections along and across the openings, and a plan: cells cut through them, all solids and events as seen along
    the same direction. The domain is beside them.

    steps: in order, or their values; what none of them mines is planned. notes: sentences beside the picture.
    """
    steps = [MinedStep.of(step) for step in steps]
    names = json.loads(grid.attrs["excavation_names"])
    number = {name: index for index, name in enumerate(names)}
    mined = [[number[name] for name in step.excavations] for step in steps]
    planned = sorted(set(range(len(names))) - {index for indices in mined for index in indices})
    dated = [step.dated for step in steps]
    step_colours = [tuple(colour) for colour in style.step_colours(dated)]
    colours = {index: colour for own, colour in zip(mined, step_colours, strict=True) for index in own}
    colours |= {index: (1.0, 1.0, 1.0, 0.0) for index in planned}
    order = [*planned, *drawing_order(grid, [index for own in mined for index in own])]
    focus = [index for own, flag in zip(mined, dated, strict=True) if flag for index in own] or list(colours)
    shown = _panels(grid, focus)
    figure, array, side = _figure(shown)
    level = ListedColormap(colormaps["Greys"](np.linspace(0.03, 0.4, int(grid.attrs["levels"]))))  # steps are coloured
    places = np.empty((0, 3)) if record is None else record["location"].values
    candidates = {index: names[index] for index in _by_importance(grid, mined, planned)[:MAX_CANDIDATES]}
    silhouettes, written = Silhouettes(grid), set()
    for axes, panel in zip(array, shown, strict=True):
        _dress(axes, panel)
        draw_cells(axes, grid, panel.plane, panel.at, level, panel.origin)
        _mark_cuts(axes, panel, shown)
        curves = {index: [c - panel.origin for c in silhouettes.curves(panel.plane, index)] for index in order}
        draw(axes, [(curves[index], colours[index]) for index in order], zorder=3)
        events = panel.plane.project(places) - panel.origin
        axes.plot(
            *events.T, ".", color=style.RECORDED, markersize=2.5, markeredgewidth=0, alpha=0.5, zorder=5,
            rasterized=True, scalex=False, scaley=False,
        )  # fmt: skip
        written |= set(write_names(axes, bodies_named(candidates, order, curves), NAME_SIZE, most_beside=MAX_BESIDE))
    notes = list(notes)
    if len(written) < len(names):
        count = f"{len(written)} of {len(names)} openings are named"
        notes.insert(0, f"{count}, first those of the last step, then the largest.")
    below = _draw_domain(figure, side, grid, shown, places, level)
    _draw_key(figure, (side[0], below), grid, level, bool(planned), record, notes)
    if steps:
        width = min(WIDTH - 1.2, 0.95 * len(steps))
        draw_steps(figure, [step.name for step in steps], step_colours, LEFT, 0.22, width)
    return figure


def _panels(grid: xr.Dataset, focus: Sequence[int]) -> list[_Panel]:
    """The section along the excavations of `focus`, that across them, and the plan; in 2-D the one plane."""
    planes = [plane_of(grid)]
    if int(grid.attrs["dimension"]) == 3:
        along = section_of(grid, focus)
        across = next(one for one in SECTIONS if abs(np.dot(one.right, along.right)) < 1e-9)
        planes = [along, across, PLAN]
    corners, (centre, volume) = views.piece_corners(grid), views.piece_centres(grid)
    bounds = np.array(views.domain(grid))
    if not len(corners):
        corners = bounds
    boxes = [(plane.project(corners).min(axis=0), plane.project(corners).max(axis=0)) for plane in planes]
    longest = max(float((high - low).max()) for low, high in boxes)
    margin = max(MARGIN_SHARE * longest, MIN_MARGIN_CELLS * float(grid.attrs["fine_cell"]))
    everywhere = np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(-1, 3)
    panels = []
    for plane, (low, high) in zip(planes, boxes, strict=True):
        ends = plane.project(everywhere)
        low, high = np.maximum(low - margin, ends.min(axis=0)), np.minimum(high + margin, ends.max(axis=0))
        panels.append(_Panel(plane, _fullest(centre @ plane.normal, volume, float(grid.attrs["fine_cell"])), low, high))
    return panels


def _fullest(along: NDArray, volume: NDArray, edge: float) -> float:
    """Place, m, of the layer of finest cells that holds most of the openings; of those nearly as full the one nearest
    to their middle. along, volume (piece,): place of each piece, m, and its volume."""
    if not len(along):
        return 0.0
    layer = np.rint((along - along.min()) / edge).astype(int)
    content = np.bincount(layer, volume)
    full = np.flatnonzero(content >= 0.95 * content.max())
    best = full[np.argmin(np.abs(full - np.average(layer, weights=volume)))]
    return float(along.min() + best * edge)


def _figure(panels: Sequence[_Panel]) -> tuple[Figure, list[Axes], tuple[float, float]]:
    """Figure with panels at one scale, two in a row, and the upper left corner, inches, of the paper for the key."""
    sizes = np.array([panel.high - panel.low for panel in panels])
    first, last = sizes[[0, -1], 0].max(), sizes[1, 0] if len(panels) > 1 else 0.0
    second = len(panels) > 1
    across = WIDTH - (LEFT + RIGHT) * 2
    wide = min(across / (first + last), (across - SIDE) / first)
    rows = sizes[[0, -1], 1] if second else sizes[:1, 1]
    if second:
        rows[0] = max(sizes[0, 1], sizes[1, 1])
    scale = min(wide, (TALLEST - len(rows) * (TOP + BOTTOM) - KEY) / rows.sum())
    least = INSET + 2.2  # for the domain and the key
    heights = scale * rows
    heights[-1] = max(heights[-1], least)
    height = heights.sum() + len(rows) * (TOP + BOTTOM) + KEY
    figure = style.new_figure(WIDTH, height, layout=None)
    tops = [height - TOP - sum(heights[:row]) - row * (TOP + BOTTOM) for row in range(len(rows))]
    right = 2 * LEFT + RIGHT + scale * first
    corners = [(LEFT, tops[0]), (right, tops[0]), (LEFT, tops[-1])] if second else [(LEFT, tops[0])]
    array = []
    for (left, top), size in zip(corners, scale * sizes, strict=True):
        array.append(figure.add_axes([left / WIDTH, (top - size[1]) / height, size[0] / WIDTH, size[1] / height]))
    return figure, array, (right, tops[-1])


def _dress(axes: Axes, panel: _Panel) -> None:
    """Title, names of the axes with units, limits, and as many marks as have room."""
    plane, axis = panel.plane, int(np.argmax(np.abs(panel.plane.normal)))
    at = f"cells at {views.COORDINATE_NAMES[axis]} = {panel.at * np.sign(panel.plane.normal[axis]) + 0.0:.10g} m"
    axes.set_title(f"{plane.name}\n" + (at if plane.along_axis else "cells on the plan's dotted line"))
    axes.set_xlabel(plane.labels[0])
    axes.set_ylabel(plane.labels[1])
    axes.set_xlim(*(np.array([panel.low[0], panel.high[0]]) - panel.origin[0]))
    axes.set_ylim(panel.low[1], panel.high[1])
    axes.ticklabel_format(style="plain", useOffset=False)
    box, paper = axes.get_position(), axes.figure
    for name, inches in (("x", box.width * paper.get_figwidth()), ("y", box.height * paper.get_figheight())):
        axes.locator_params(axis=name, nbins=int(np.clip(inches / 0.75, 1, 7)))


def cut_rectangles(grid: xr.Dataset, plane: Plane, at: float) -> tuple[NDArray, NDArray, NDArray]:
    """Rectangles that a plane cuts out of the cells: index of the cell (n,), lower corners (n, 2), sizes (n, 2), m.

    at: place of the plane along its normal, m. In 2-D all cells.
    """
    origin, size = grid["cell_origin"].values, grid["cell_size"].values
    axes = views.axes_of(grid)
    if len(axes) == 2:
        return np.arange(len(size)), origin[:, axes], np.stack([size, size], axis=1)
    foot, low, high = at * plane.normal, np.full((len(size), 2), -np.inf), np.full((len(size), 2), np.inf)
    kept = np.ones(len(size), bool)
    for axis in range(3):
        # Points of the plane are foot + s right + t up; of right and up one at most has a part along an axis.
        for own, direction in enumerate((plane.right, plane.up)):
            if abs(direction[axis]) > 1e-9:
                ends = np.stack([origin[:, axis], origin[:, axis] + size]) - foot[axis]
                ends = np.sort(ends / direction[axis], axis=0)
                low[:, own], high[:, own] = np.maximum(low[:, own], ends[0]), np.minimum(high[:, own], ends[1])
        if max(abs(plane.right[axis]), abs(plane.up[axis])) <= 1e-9:
            kept &= (origin[:, axis] <= foot[axis]) & (foot[axis] < origin[:, axis] + size)
    chosen = np.flatnonzero(kept & (high > low).all(axis=1))
    return chosen, low[chosen], (high - low)[chosen]


def draw_cells(axes: Axes, grid: xr.Dataset, plane: Plane, at: float, level: ListedColormap, origin: NDArray) -> None:
    """Cells that a plane cuts, by level, those of rock bodies shaded. origin (2,): m, from which the axes count."""
    cells, lower, size = cut_rectangles(grid, plane, at)
    corners = (lower - origin)[:, None, :] + size[:, None, :] * np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    helps = len(cells) and views.edges_help(axes, float(grid["cell_size"].values[cells].min()))
    edges = {"edgecolors": "white", "linewidths": 0.3} if helps else {"edgecolors": "none", "linewidths": 0}
    colours = level(grid["cell_level"].values[cells])
    look = {"rasterized": True, "antialiaseds": False}
    axes.add_collection(PolyCollection(corners, facecolors=colours, zorder=0.1, **edges, **look), autolim=False)
    for colour, bodies in rock_colours(grid).values():
        rock = np.isin(grid["cell_body"].values[cells], bodies)
        shade = PolyCollection(corners[rock], facecolors=colour, edgecolors="none", alpha=0.35, zorder=0.2, **look)
        axes.add_collection(shade, autolim=False)


def rock_colours(grid: xr.Dataset) -> dict[str, tuple[str, list[int]]]:
    """Rock that differs from the host's, by its label in the key: colour, and the numbers of its rock bodies.

    Rock bodies have one colour, and each material of a block model another one, that of most cells first.
    """
    body = grid["cell_body"].values
    solids = (
        len(json.loads(grid.attrs.get("rock_body_names", "[]"))) if "block_materials" in grid.attrs else body.max() + 1
    )
    found: dict[str, tuple[str, list[int]]] = {}
    if ((body >= 0) & (body < solids)).any():
        found["rock bodies"] = BODY_COLOUR, list(range(solids))
    by_name: dict[str, list[int]] = {}
    for number, name in enumerate(json.loads(grid.attrs.get("block_materials", "[]"))):
        by_name.setdefault(name, []).append(solids + number)
    count = {name: np.count_nonzero(np.isin(body, numbers)) for name, numbers in by_name.items() if name != "host"}
    names = [name for name in sorted(count, key=lambda name: -count[name]) if count[name]]
    for colour, name in zip(BLOCK_COLOURS, names, strict=False):
        found[f"blocks: {name}"] = colour, by_name[name]
    if rest := names[len(BLOCK_COLOURS) :]:
        found[OTHERS] = "#000000", [number for name in rest for number in by_name[name]]
    return found


def _mark_cuts(axes: Axes, panel: _Panel, panels: Sequence[_Panel]) -> None:
    """Thin dotted lines where the planes of the other panels cut this one."""
    for other in panels:
        if other is panel:
            continue
        normal = np.array([np.dot(other.plane.normal, panel.plane.right), np.dot(other.plane.normal, panel.plane.up)])
        x, y = normal * other.at - panel.origin
        axes.axline((x, y), (x - normal[1], y + normal[0]), color="k", linewidth=0.7, linestyle=":", zorder=4)


def _by_importance(grid: xr.Dataset, mined: Sequence[Sequence[int]], planned: Sequence[int]) -> list[int]:
    """Excavations in the order in which they are named: those of the last step, then all by size."""
    volume = np.asarray(json.loads(grid.attrs["excavation_volume"]), float)
    last = set(next((own for own in reversed(mined) if own), planned))
    return sorted(range(len(volume)), key=lambda index: (index not in last, -volume[index]))


def _draw_domain(
    figure: Figure, side: tuple[float, float], grid: xr.Dataset, panels: Sequence[_Panel], places: NDArray, level
) -> float:
    """Draw the domain with its cells, the events and a frame around what the other panels show; return where its labels
    end, inches from below. side: upper left corner, inches."""
    panel = panels[-1]
    corners = np.array(views.domain(grid))
    low, high = panel.plane.project(corners)
    inches = INSET * (high - low) / (high - low).max()
    height, (left, top) = figure.get_figheight(), side
    axes = figure.add_axes([left / WIDTH, (top - inches[1]) / height, inches[0] / WIDTH, inches[1] / height])
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    draw_cells(axes, grid, panel.plane, panel.at, level, np.zeros(2))
    events = panel.plane.project(places)
    axes.plot(
        *events.T, ".", color=style.RECORDED, markersize=1.0, zorder=3, rasterized=True, scalex=False, scaley=False
    )
    axes.add_patch(Rectangle(panel.low, *(panel.high - panel.low), fill=False, edgecolor="k", linewidth=1.0, zorder=4))
    sides = " × ".join(f"{side:.4g}" for side in (corners[1] - corners[0])[views.axes_of(grid)])
    axes.set_title(f"Domain ({panel.plane.name.lower()}), {sides} m;\nthe frame is what is drawn large", fontsize=8.5)
    for spine in axes.spines.values():
        spine.set_visible(True)
    axes.tick_params(labelsize=7, length=2)
    axes.ticklabel_format(style="plain", useOffset=False)
    axes.locator_params(nbins=3)
    axes.set_xlabel(panel.plane.labels[0], fontsize=7.5, labelpad=1)
    axes.set_ylabel(panel.plane.labels[1], fontsize=7.5, labelpad=1)
    return top - inches[1] - 0.45


def _draw_key(
    figure: Figure, corner: tuple[float, float], grid: xr.Dataset, level, has_planned: bool,
    record: xr.Dataset | None, notes: Sequence[str],
) -> None:  # fmt: skip
    """Key below the domain, from its upper left corner, inches, and the notes below it."""
    edge, levels = float(grid.attrs["coarse_cell"]), int(grid.attrs["levels"])
    handles = [
        *(
            Patch(facecolor=level(index), edgecolor="#cccccc", label=f"cells of {edge / 2**index:g} m")
            for index in range(levels)
        ),
        *(Patch(color=colour, alpha=0.35, label=label) for label, (colour, _) in rock_colours(grid).items()),
        *([Patch(facecolor="none", edgecolor=style.OUTLINE, label="planned")] if has_planned else []),
        *([_record_key(record)] if record is not None else []),
    ]
    place = corner[0] / WIDTH, corner[1] / figure.get_figheight()
    key = figure.legend(
        handles=handles, loc="upper left", bbox_to_anchor=place, ncols=1 + len(handles) // 6, borderaxespad=0.0,
        fontsize=8, columnspacing=1.0,
    )  # fmt: skip
    below = key.get_window_extent().y0 / figure.dpi - 0.05
    text = "\n".join(line for one in notes for line in textwrap.wrap(one, NOTE_LETTERS))
    figure.text(place[0], below / figure.get_figheight(), text, va="top", fontsize=8, parse_math=False)


def _record_key(record: xr.Dataset) -> Line2D:
    """Key of the recorded events, with the number of those that lie outside the domain and are not compared."""
    crops = [one for one in json.loads(record.attrs.get("filter", "[]")) if one["filter"] == "domain"]
    outside = sum(crop["before"] - crop["after"] for crop in crops)
    farthest = max((crop["farthest"] for crop in crops if outside), default=0.0)
    label = f"{record.sizes['event']} recorded events"
    label += f"\n{outside} more outside the domain, up to {farthest:,.0f} m away" if outside else ""
    return Line2D([], [], color=style.RECORDED, marker=".", linestyle="none", label=label)
