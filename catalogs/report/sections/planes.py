"""Planes that the mine file chooses (report.sections): failed rock, strength factor, and the events near each plane.

The template is "planes.html.j2".
"""

import json

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from catalogs.figures import panels, style, views
from catalogs.figures.planes import FILLED, ROCK, VOID, look_up
from catalogs.report.evidence import Evidence, shown_catalogues
from catalogs.report.gallery import Gallery
from catalogs.report.sections.rock import FAILED, MAX_STRENGTH_FACTOR_SHOWN, TOO_COARSE
from catalogs.report.text import fixed, number
from catalogs.settings import SectionPlane
from catalogs.sources.section_planes import Plane, along_excavation
from catalogs.sources.sizes import log_potency

MARGIN = 0.2  # Of what is shown around the excavations, as a share of their extent.
POINTS_ALONG = 500  # Of a picture's longer side.
CELLS_WITHIN = 5.0  # Finest cells within which events are drawn, if the mine file does not say.
MAX_HEIGHT = 8.0  # inches
COMPASS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")
COLOURS = (style.MODELLED, style.RECORDED)


def section(evidence: Evidence, gallery: Gallery) -> list[dict] | None:
    """A picture and sentences for each plane; None where the mine file chooses none, or no stage has been computed."""
    if not evidence.sections or evidence.state is None:
        return None
    return [_shown(evidence, gallery, one) for one in evidence.sections]


def _shown(evidence: Evidence, gallery: Gallery, chosen: SectionPlane) -> dict:
    names = json.loads(evidence.grid.attrs["excavation_names"])
    if chosen.excavation is None:
        plane = Plane.of(chosen.point, chosen.strike, chosen.dip)
    else:
        found = along_excavation(evidence.grid, names.index(chosen.excavation))
        if found is None:
            return {"name": chosen.name, "none": f"{chosen.excavation} is the first to mine no rock: it has no plane."}
        plane = found
    lower, upper = views.frame_limits(evidence.grid, [], margin=MARGIN)
    outline = plane.outline(lower, upper)
    if not len(outline):
        apart = number(plane.misses(lower, upper), 2)
        return {"name": chosen.name, "none": f"The plane passes the surroundings of the excavations at {apart} m."}
    within = CELLS_WITHIN * float(evidence.grid.attrs["fine_cell"]) if chosen.within is None else chosen.within
    near = {label: _near(events, plane, within) for label, events in shown_catalogues(evidence).items()}
    figure = draw(evidence.grid, evidence.state, evidence.planned, plane, outline, near)
    return {
        "name": chosen.name,
        "picture": gallery.add(f"section_{chosen.name}", figure),
        "about": about(plane, within, {label: len(place) for label, (place, _) in near.items()}),
    }


def about(plane: Plane, within: float, counts: dict[str, int]) -> str:
    """Sentences on where the plane is and which events it shows; counts: events by label of the catalogue."""
    x, y, z = (fixed(value, 1) for value in plane.point)
    text = f"The plane passes through ({x}, {y}, {z}) m. Its strike is {plane.strike:.0f}° and its dip {plane.dip:.0f}°"
    text += " (to the right of the strike)." if 0.0 < plane.dip < 90.0 else "."
    drawn = " and ".join(f"{count} {label[0].lower()}{label[1:]}" for label, count in counts.items())
    return f"{text} Drawn are {drawn} events within {number(within, 3)} m of it." if counts else text


def direction(azimuth: float) -> str:
    """Name of the direction nearest to an azimuth, degrees.

    >>> [direction(azimuth) for azimuth in (0.0, 44.0, 271.0, 350.0)]
    ['N', 'NE', 'W', 'N']
    """
    return COMPASS[round(azimuth / 45.0) % 8]


def _near(events: xr.Dataset, plane: Plane, within: float) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (k, 2) in the plane, m, and log10 potency (k,) of the events within a distance of it."""
    place, distance = plane.coordinates(events["location"].values)
    near = np.flatnonzero(np.abs(distance) <= within)
    return place[near], log_potency(events["potency"].values[near])


def draw(
    grid: xr.Dataset,
    state: xr.Dataset,
    planned: list[int],
    plane: Plane,
    outline: np.ndarray,
    near: dict[str, tuple[np.ndarray, np.ndarray]],
) -> Figure:
    """The plane within its outline (k, 2) m: strength factor of intact rock, failed rock, openings, fill and events.

    near: coordinates (k, 2) and log10 potency (k,) of events by label of the catalogue.
    """
    low, high = outline.min(axis=0), outline.max(axis=0)
    extent = np.maximum(high - low, 1e-3)
    width = style.PAGE_WIDTH - panels.LEFT - panels.RIGHT - panels.BAR
    scale = min(width / extent[0], MAX_HEIGHT / extent[1])
    size = scale * extent
    around = [panels.LEFT + panels.RIGHT + panels.BAR, panels.TOP + panels.BOTTOM + panels.KEY]
    page = size + np.array(around)
    figure = style.new_figure(*page, layout=None)
    box = [panels.LEFT / page[0], (panels.KEY + panels.BOTTOM) / page[1], *(size / page)]
    axes = figure.add_axes(box)
    colours = picture(grid, state, planned, plane, low, high)
    axes.imshow(colours, origin="lower", extent=(low[0], high[0], low[1], high[1]), interpolation="nearest", zorder=1)
    sizes = [values for _, values in near.values()]
    known = np.concatenate([values[np.isfinite(values)] for values in sizes] or [np.empty(0)])
    handles = [
        Patch(color=FAILED, label="has failed"),
        Patch(color=TOO_COARSE, label="above strength, too coarse to fail"),
        Patch(facecolor=style.EXCAVATION, edgecolor=style.OUTLINE, label="excavated"),
        Patch(color=style.FILL, label="fill"),
    ]
    for (label, (place, values)), colour in zip(near.items(), COLOURS, strict=False):
        diameter = _diameters(values, known)
        many = len(place) > 300
        for rim, line in (("white", 2.2), (colour, 1.0)):  # a white rim shows them on dark rock
            axes.scatter(
                *place.T, s=diameter**2, facecolors="none", edgecolors=rim, linewidths=line, zorder=3, rasterized=many
            )
        look = {"markerfacecolor": "none", "markeredgecolor": colour}
        handles.append(Line2D([], [], linestyle="none", marker="o", markersize=6, label=label, **look))
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_xlabel(f"along strike (m), {direction(plane.strike + 180.0)} to {direction(plane.strike)}")
    level = "along the plane, up the dip" if plane.dip < 90.0 else "upward"
    upward = f"to {direction(plane.strike - 90.0)}" if plane.dip == 0.0 else level
    axes.set_ylabel(f"{upward} (m)")
    axes.ticklabel_format(style="plain", useOffset=False)
    tall = min(float(size[1]), 3.6)
    bar = [(page[0] - panels.BAR + 0.1) / page[0], 1 - (panels.TOP + tall) / page[1], 0.17 / page[0], tall / page[1]]
    shown = ScalarMappable(Normalize(1, MAX_STRENGTH_FACTOR_SHOWN), "cividis")
    figure.colorbar(shown, cax=figure.add_axes(bar), label="strength factor (1)", extend="both")
    panels.key(figure, handles)
    return figure


def _diameters(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Diameters (event,) in points, linear in log10 potency; the smallest where it is not known."""
    if not len(known):
        return np.full(len(values), 3.0)
    low, high = float(known.min()), float(known.max())
    return 3.0 + 11.0 * np.nan_to_num((values - low) / max(high - low, 1e-9), nan=0.0)


def picture(
    grid: xr.Dataset, state: xr.Dataset, planned: list[int], plane: Plane, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Colours (row, column, rgba) of the plane between corners (2,) in it, lowest row first; transparent outside."""
    extent = high - low
    pixel = max(float(extent.max()) / POINTS_ALONG, 1e-6)
    count = np.maximum(np.ceil(extent / pixel).astype(int), 1)
    along, up = (low[k] + (np.arange(count[k]) + 0.5) * extent[k] / count[k] for k in range(2))
    points = np.stack(np.meshgrid(along, up), axis=-1).reshape(-1, 2)
    kind, particle = look_up(grid, state, planned, plane.places(points))
    colours = np.zeros((len(points), 4))
    rock = np.flatnonzero(kind == ROCK)
    own = particle[rock]
    factor = np.clip(state["strength_factor"].values[own], 0.0, MAX_STRENGTH_FACTOR_SHOWN)
    colours[rock] = colormaps["cividis"](Normalize(1, MAX_STRENGTH_FACTOR_SHOWN)(factor))
    size = grid["cell_size"].values[state["cell"].values[own]]
    failed = state["failed"].values[own] >= 0
    colours[rock[(factor < 1.0) & (size > 1.01 * float(grid.attrs["fine_cell"])) & ~failed]] = (*to_rgb(TOO_COARSE), 1)
    colours[rock[failed]] = (*to_rgb(FAILED), 1)
    colours[kind == VOID] = (*to_rgb(style.EXCAVATION), 1)
    colours[kind == FILLED] = (*to_rgb(style.FILL), 1)
    return colours.reshape(count[1], count[0], 4)
