"""The picture of the first page: a plan and one section with the openings of each step and the largest events.

The section is the vertical one that shows openings best.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from catalogs.figures import style, views
from catalogs.figures.names import WHITE_RIM, bodies_named, write_names
from catalogs.figures.silhouettes import PLAN, SECTIONS, Plane, Silhouettes, draw, drawing_order, pieces
from catalogs.figures.step_key import BLOCK_HEIGHT, MAX_BLOCK_WIDTH, draw_steps

# A section to the north-east or north-west must show the openings so many times as long as one along an axis does.
MIN_DIAGONAL_GAIN = 1.1
MARGIN = 0.12  # Of the longest side of what is shown, on each side of it.
REACH = 1.0  # Events are in the picture up to this many longest sides of the openings away from them.
MIN_RANGE = 0.5  # Mw; on the scale of diameters the smallest and largest event differ by this at least.
NAME_SIZE = 8.0  # Points: letters of openings' names.


def section_of(grid: xr.Dataset, focus: Sequence[int]) -> Plane:
    """The section that shows these excavations longest: that in whose horizontal direction they spread most.

    Spread: standard deviation of the mined volume. Of directions that show them about as long, one along an axis.
    """
    centre, volume = pieces(grid, focus)
    if not volume.sum() > 0:
        return SECTIONS[0]
    spread = []
    for section in SECTIONS:
        along = section.project(centre)[:, 0]
        variance = np.average((along - np.average(along, weights=volume)) ** 2, weights=volume)
        spread.append(np.sqrt(variance) / (1.0 if section.along_axis else MIN_DIAGONAL_GAIN))
    return SECTIONS[int(np.argmax(np.round(spread, 6)))]  # of equal ones the first, whatever the round-off


def frame(grid: xr.Dataset, focus: Sequence[int], places: Sequence[NDArray]) -> tuple[NDArray, NDArray]:
    """Box, m, around these excavations and those of the places (place, 3) that are within REACH of them, with a margin;
    inside the domain."""
    lower, upper = views.domain(grid)
    box = box_of(grid, focus)
    if box is None:
        return lower, upper
    low, high = box
    near = [place[within_reach(place, low, high)] for place in places]
    low, high = np.concatenate([*near, [low]]).min(axis=0), np.concatenate([*near, [high]]).max(axis=0)
    around = MARGIN * float((high - low).max())
    return np.maximum(low - around, lower), np.minimum(high + around, upper)


def box_of(grid: xr.Dataset, excavations: Sequence[int]) -> tuple[NDArray, NDArray] | None:
    """Lower and upper corner, m, of the box around these excavations' cells; None where they have none."""
    corners = corners_of(grid, excavations)
    return (corners.min(axis=0), corners.max(axis=0)) if len(corners) else None


def corners_of(grid: xr.Dataset, excavations: Sequence[int]) -> NDArray:
    """Lower and upper corners (corner, 3), m, of these excavations' cells."""
    own = np.isin(grid["piece_excavation"].values, list(excavations))
    return views.piece_corners(grid)[np.tile(own, 2)]


def within_reach(place: NDArray, low: NDArray, high: NDArray) -> NDArray:
    """True (event,) for places (event, 3) m whose coordinates exceed the box by at most REACH times its longest side.

    low, high (3,): corners of the box, m. The axis along which a mine in a plane has no length does not count.
    """
    reach, long = REACH * float((high - low).max()), high > low
    return np.all(((place >= low - reach) & (place <= high + reach))[:, long], axis=1)


def plane_of(grid: xr.Dataset) -> Plane:
    """The plane that a mine in a plane is computed in."""
    return PLAN if grid.attrs.get("plane") == "xy" else SECTIONS[0]


WIDTH, HEIGHT = 7.6, 4.9  # Inches that the picture has at most.
LEFT, RIGHT, TOP, BOTTOM, KEY = 0.68, 0.12, 0.26, 0.42, 0.62  # Inches around a panel, and below all of them.
STEPS_ABOVE = 0.2  # Inches from the lower edge of the picture to the blocks of the steps.
SMALLEST, LARGEST = 5.0, 15.0  # Points: diameters of the smallest and largest event drawn.


@dataclass(frozen=True)
class Mined:
    """Excavations (indices) that are drawn alike: those of a step, in its colour; others are no step's."""

    name: str
    colour: tuple
    excavations: Sequence[int]
    is_step: bool = True


def first_page(
    grid: xr.Dataset,
    openings: Sequence[Mined],
    focus: Sequence[int],
    nearby: Sequence[int],
    largest: Mapping[str, tuple[str, xr.Dataset]],
    named: Mapping[int, str] | None = None,
) -> Figure:
    """Plan and section at one scale, north up and east to the right, side by side or one above the other: as larger.

    openings: in the order of mining; focus: excavations (indices) that the picture is about; nearby: planned ones,
    which the picture shows, too, as far as they are near; largest: by label, colour and events of a catalogue: those of
    the first one are full, those of the second hollow; named: names of excavations that the picture names, the most
    important first.
    """
    planes = [PLAN, section_of(grid, focus)] if int(grid.attrs["dimension"]) == 3 else [plane_of(grid)]
    places = [events["location"].values for _, events in largest.values()]
    lower, upper = frame(grid, focus, [corners_of(grid, nearby), *places])
    corners = np.stack(np.meshgrid(*zip(lower, upper, strict=True), indexing="ij"), axis=-1).reshape(-1, 3)
    boxes = [(plane.project(corners).min(axis=0), plane.project(corners).max(axis=0)) for plane in planes]
    figure, array = _panels([high - low for low, high in boxes])
    diameter = _diameters([events["mw"].values for _, events in largest.values()])
    silhouettes = Silhouettes(grid)
    colours = {index: one.colour for one in openings for index in one.excavations}
    below = set(nearby)
    order = [*nearby, *drawing_order(grid, [index for index in colours if index not in below])]
    for axes, plane, (low, high) in zip(array, planes, boxes, strict=True):
        origin = np.array([0.0 if plane.along_axis else low[0], 0.0])
        _dress(axes, plane, low - origin, high - origin)
        curves = {index: [curve - origin for curve in silhouettes.curves(plane, index)] for index in order}
        draw(axes, [(curves[index], colours[index]) for index in order if index in colours])
        placed = [plane.project(place) - origin for place in places]
        for number, (colour, events) in enumerate(largest.values()):
            look = _look(colour, hollow=number > 0)
            axes.scatter(*placed[number].T, s=diameter(events["mw"].values) ** 2, zorder=5 + number, **look)
        avoid = [_draw_scale_bar(axes), *([_draw_north(axes)] if plane is PLAN else [])]
        bodies = bodies_named(named or {}, order, curves)
        write_names(axes, bodies, NAME_SIZE, avoid, np.concatenate([np.zeros((0, 2)), *placed]), if_covered=True)
    _key(figure, openings, largest, diameter)
    return figure


def _panels(sizes: list[NDArray]) -> tuple[Figure, list[Axes]]:
    """Panels of these sizes (2,), m, at one scale, side by side or one above the other, whichever is larger."""
    sides = np.maximum(np.array(sizes), 1e-3)
    count, (widest, tallest), (wide, tall) = len(sides), sides.max(axis=0), sides.sum(axis=0)
    across = min((WIDTH - count * (LEFT + RIGHT)) / wide, (HEIGHT - TOP - BOTTOM - KEY) / tallest)
    down = min((WIDTH - LEFT - RIGHT) / widest, (HEIGHT - count * (TOP + BOTTOM) - KEY) / tall)
    inches = sides * max(across, down)
    beside = across >= down
    columns, rows = (count, 1) if beside else (1, count)
    used = inches.sum(axis=0) if not beside else np.array([inches[:, 0].sum(), inches[:, 1].max()])
    if not beside:
        used[0] = inches[:, 0].max()
    height = used[1] + rows * (TOP + BOTTOM) + KEY
    figure = style.new_figure(WIDTH, height, layout=None)
    left, top = (WIDTH - used[0] - columns * (LEFT + RIGHT)) / 2 + LEFT, height - TOP
    array = []
    for width, tall in inches:
        array.append(figure.add_axes([left / WIDTH, (top - tall) / height, width / WIDTH, tall / height]))
        left, top = (left + width + LEFT + RIGHT, top) if beside else (left, top - tall - TOP - BOTTOM)
    return figure, array


def _dress(axes: Axes, plane: Plane, low: NDArray, high: NDArray) -> None:
    """Title, names of the axes, limits, and as many marks as have room."""
    axes.set_title(plane.name, fontsize=9.5, y=style.TITLE_PLACE)
    axes.set_xlabel(plane.labels[0], labelpad=1, fontsize=8.5)
    axes.set_ylabel(plane.labels[1], labelpad=1, fontsize=8.5)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.tick_params(labelsize=7.5, length=2.5, pad=2)
    axes.ticklabel_format(style="plain", useOffset=False)
    box, paper = axes.get_position(), axes.figure
    for name, inches in (("x", box.width * paper.get_figwidth()), ("y", box.height * paper.get_figheight())):
        axes.locator_params(axis=name, nbins=int(np.clip(inches / 0.7, 1, 5)))


def _diameters(magnitudes: list[NDArray]) -> Callable[[NDArray], NDArray]:
    """Diameters, points, by Mw: linear between the smallest and the largest event drawn."""
    known = np.concatenate([np.zeros(0), *magnitudes])
    known = known[np.isfinite(known)]
    high = float(known.max()) if len(known) else 0.0
    low = min(float(known.min()) if len(known) else 0.0, high - MIN_RANGE)

    def diameter(magnitude: NDArray) -> NDArray:
        share = np.clip((np.nan_to_num(magnitude, nan=low) - low) / (high - low), 0.0, 1.0)
        return SMALLEST + (LARGEST - SMALLEST) * share

    return diameter


def _look(colour: str, hollow: bool) -> dict:
    """Keyword arguments of `Axes.scatter` for events: filled in a colour, or rings that do not hide filled ones."""
    if hollow:
        return {"facecolors": "none", "edgecolors": colour, "linewidths": 1.6}
    return {"facecolors": colour, "edgecolors": "white", "linewidths": 0.7}


def _draw_scale_bar(axes: Axes) -> NDArray:
    """Draw a bar of a round length, up to a third of the panel, at its lower left; return its box, pixels."""
    (left, right), bottom = axes.get_xlim(), axes.get_ylim()[0]
    inch = (right - left) / (axes.get_position().width * axes.figure.get_figwidth())  # in m
    length, start, height = round_below((right - left) / 3), left + 0.1 * inch, bottom + 0.1 * inch
    axes.plot(
        [start, start + length], [height, height], color="k", linewidth=2.0, solid_capstyle="butt", zorder=8,
        path_effects=WHITE_RIM, scalex=False, scaley=False,
    )  # fmt: skip
    axes.text(
        start + length / 2, height + 0.05 * inch, f"{length:g} m", ha="center", va="bottom", fontsize=8, zorder=8,
        path_effects=WHITE_RIM,
    )  # fmt: skip
    box = [(left, bottom), (start + length + 0.05 * inch, height + 0.25 * inch)]
    return axes.transData.transform(box)


def round_below(length: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is at most this long."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(one for one in (1.0, 2.0, 5.0) if one * power <= length * (1 + 1e-9)))


def _draw_north(axes: Axes) -> NDArray:
    """Draw an arrow to the north in the upper right corner of the plan; return its box, pixels."""
    box, paper = axes.get_position(), axes.figure
    across, down = 0.13 / (box.width * paper.get_figwidth()), 1.0 / (box.height * paper.get_figheight())
    axes.annotate(
        "N", xy=(1.0 - across, 1.0 - 0.06 * down), xytext=(1.0 - across, 1.0 - 0.42 * down), xycoords="axes fraction",
        textcoords="axes fraction", ha="center", va="center", fontsize=9, fontweight="bold", zorder=8,
        arrowprops={"arrowstyle": "-|>", "color": "k", "linewidth": 1.2}, path_effects=WHITE_RIM,
    )  # fmt: skip
    return axes.transAxes.transform([(1.0 - 2 * across, 1.0 - 0.5 * down), (1.0, 1.0)])


def _key(figure: Figure, openings: Sequence[Mined], largest: Mapping[str, tuple], diameter: Callable) -> None:
    """Below the panels: the colours of all steps, of other openings, and whose events are drawn, of which size."""
    handles: list = [
        Patch(facecolor=one.colour, edgecolor=style.OUTLINE, label=one.name)
        for one in openings
        if one.excavations and not one.is_step
    ]
    steps = [one for one in openings if one.is_step]
    if steps:
        width = min(WIDTH - 0.6, MAX_BLOCK_WIDTH * len(steps))
        names, colours = [one.name for one in steps], [one.colour for one in steps]
        draw_steps(figure, names, colours, (WIDTH - width) / 2, STEPS_ABOVE, width)
    for number, (label, (colour, events)) in enumerate(largest.items()):
        if not events.sizes["event"]:
            continue
        look = _look(colour, hollow=number > 0)
        handles.append(
            Line2D(
                [], [], linestyle="none", marker="o", markersize=8, label=label,
                markerfacecolor=look["facecolors"], markeredgecolor=look["edgecolors"],
                markeredgewidth=look["linewidths"],
            )
        )  # fmt: skip
    known = np.concatenate([np.zeros(0), *(events["mw"].values for _, events in largest.values())])
    for value in sorted({round(float(one), 1) for one in (np.nanmin(known), np.nanmax(known))} if known.size else []):
        handles.append(
            Line2D(
                [], [], linestyle="none", marker="o", markersize=float(diameter(np.array(value))),
                label=f"Mw {value:.1f}".replace("-", "−"),
                markerfacecolor="#bbbbbb", markeredgecolor="k", markeredgewidth=0.3,
            )
        )  # fmt: skip
    if handles:
        above = (STEPS_ABOVE + BLOCK_HEIGHT + 0.03) / figure.get_figheight() if steps else 0.0
        figure.legend(
            handles=handles, loc="lower center", bbox_to_anchor=(0.5, above), ncols=len(handles),
            borderaxespad=0.2, fontsize=8, columnspacing=1.4, handletextpad=0.5,
        )  # fmt: skip
