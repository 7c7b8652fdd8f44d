"""Places and times of modelled and recorded events in the same plans and sections (paper Fig. 19)."""

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from matplotlib import colormaps, dates
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from catalogs.figures import panels, style, views
from catalogs.sources.sizes import log_potency

SMALLEST, LARGEST = 2.0, 15.0  # points: diameters of the smallest and largest event shown
UNDATED_COLOUR = "#9a9a9a"
NOT_COMPARED_COLOUR = "#8c8c8c"  # Rim of an event that is not compared.
MAX_EVENTS_DRAWN_SINGLY = 2000  # More events would hide the workings and each other: their number per square is drawn.
BINS_ALONG_VIEW = 60  # Squares along the longer side of a view.


@dataclass(frozen=True)
class Scale:
    """Ranges that size and colour show in both catalogues: log10 potency (m3), time (days since 1970)."""

    log_potency: tuple[float, float]
    days: tuple[float, float]

    def diameter(self, log_potency: np.ndarray) -> np.ndarray:
        """Diameters in points, linear in log10 potency."""
        low, high = self.log_potency
        return SMALLEST + (LARGEST - SMALLEST) * np.clip((log_potency - low) / (high - low), 0, 1)

    @property
    def key_sizes(self) -> np.ndarray:
        """Round values of log10 potency for a key of sizes."""
        low, high = self.log_potency
        step = next((step for step in (1.0, 0.5, 0.2) if high - low >= 2 * step), 0.1)
        return np.arange(np.ceil(low / step), np.floor(high / step) + 0.5) * step


def common_scale(catalogs: list[xr.Dataset]) -> Scale:
    """Ranges that hold all events of all catalogues."""
    potency = np.concatenate([log_potency(catalog["potency"].values) for catalog in catalogs])
    days = np.concatenate([days_since_1970(catalog) for catalog in catalogs])
    return Scale(_range(potency, 1.0), _range(days, 1.0))


def _range(values: np.ndarray, least: float) -> tuple[float, float]:
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, least)
    return (low, high) if high > low else (low - least / 2, low + least / 2)


def days_since_1970(catalog: xr.Dataset) -> np.ndarray:
    """Event times as days, matplotlib's own unit; NaN where there is none."""
    time = catalog["time"].values.astype("datetime64[ns]")
    return np.where(np.isnat(time), np.nan, dates.date2num(np.where(np.isnat(time), np.datetime64(0, "ns"), time)))


def event_limits(grid: xr.Dataset, catalogs: list[xr.Dataset]) -> tuple[np.ndarray, np.ndarray]:
    """Box around the excavations and the events, inside the domain (m)."""
    return views.frame_limits(grid, [catalog["location"].values for catalog in catalogs], margin=0.05)


def locations(
    grid: xr.Dataset, catalogs: dict[str, xr.Dataset], compared: dict[str, np.ndarray], planned: list[int]
) -> Figure:
    """Plans and sections, one column per catalogue (keys: labels), same limits; size by log P, colour by time.

    compared: of each catalogue, which events (event,) bool its numbers are of; the others are hollow. Excavations lie
    underneath as silhouettes. One catalogue alone fills the width with its views. Of a catalogue of more than
    MAX_EVENTS_DRAWN_SINGLY events the number of compared ones per square is shown instead.
    """
    lower, upper = event_limits(grid, list(catalogs.values()))
    scale = common_scale(list(catalogs.values()))
    projections = views.projections(grid)
    planes = [(view, label) for view in projections for label in catalogs]
    named = [replace(view, name=f"{label}\n{view.name.lower()}") for view, label in planes]
    beside = len(catalogs) if len(catalogs) > 1 else None
    figure, array, bar = panels.panels(named, lower, upper, beside, bar=True, tallest=13.0)
    for axes, (view, label) in zip(array, planes, strict=True):
        views.draw_excavations(axes, grid, view, planned, fill=not is_crowd(catalogs[label]))
        if is_crowd(catalogs[label]):
            draw_density(figure, axes, catalogs[label].isel(event=compared[label]), view, lower, upper)
        else:
            draw_events(axes, catalogs[label], compared[label], view, scale)
    single = [label for label, catalog in catalogs.items() if not is_crowd(catalog)]
    if single:
        _keys(figure, bar, scale, hollow=not all(compared[label].all() for label in single))
    else:
        bar.set_axis_off()
    return figure


def is_crowd(catalog: xr.Dataset) -> bool:
    """True if a catalogue has more events than are drawn singly, so that their density is drawn instead."""
    return catalog.sizes["event"] > MAX_EVENTS_DRAWN_SINGLY


def draw_density(figure: Figure, axes: Axes, catalog: xr.Dataset, view: views.View, lower, upper) -> None:
    """Events per square of a projection, on a logarithmic scale, with a colour bar inside the panel."""
    place = catalog["location"].values[:, view.axes]
    low, extent = lower[view.axes], (upper - lower)[view.axes]
    side = extent.max() / BINS_ALONG_VIEW
    edges = [low[axis] + side * np.arange(np.ceil(extent[axis] / side) + 1) for axis in (0, 1)]
    count = np.histogram2d(*place.T, bins=edges)[0].T
    drawn = axes.pcolormesh(
        *edges, np.where(count > 0, count, np.nan), norm=LogNorm(1, max(count.max(), 2)), cmap="cividis_r",
        rasterized=True, zorder=1,
    )  # fmt: skip
    panel = axes.get_position()
    wide, tall = panel.width * figure.get_figwidth(), panel.height * figure.get_figheight()  # inches
    axes.add_patch(Rectangle((0, 0), 1.45 / wide, 0.48 / tall, transform=axes.transAxes, color="white", zorder=4))
    inset = axes.inset_axes([0.1 / wide, 0.2 / tall, 1.2 / wide, 0.07 / tall], zorder=5)
    figure.colorbar(drawn, cax=inset, orientation="horizontal")
    inset.set_title(f"events per {side:.2g} m square", fontsize=7.5, fontweight="normal", loc="left", pad=2)
    inset.tick_params(labelsize=7)


def draw_events(axes: Axes, catalog: xr.Dataset, compared: np.ndarray, view: views.View, scale: Scale) -> None:
    """Circles at the events' projections, large ones first so that small ones stay visible; undated ones grey.

    Those not compared (event,) lie underneath, hollow.
    """
    size, days = log_potency(catalog["potency"].values), days_since_1970(catalog)
    diameter = scale.diameter(np.nan_to_num(size, nan=scale.log_potency[0]))
    place = catalog["location"].values[:, view.axes]
    rasterized = len(place) > 300
    axes.scatter(
        *place[~compared].T, s=diameter[~compared] ** 2, c="none", edgecolors=NOT_COMPARED_COLOUR, linewidths=0.4,
        zorder=2, rasterized=rasterized,
    )  # fmt: skip
    order = np.flatnonzero(compared)[np.argsort(-diameter[compared], kind="stable")]
    colour = colormaps["viridis"](Normalize(*scale.days)(days[order]))
    colour[np.isnan(days[order])] = (*[int(UNDATED_COLOUR[at : at + 2], 16) / 255 for at in (1, 3, 5)], 1.0)
    axes.scatter(
        *place[order].T, s=diameter[order] ** 2, c=colour, alpha=0.8, edgecolors="black", linewidths=0.25, zorder=3,
        rasterized=rasterized,
    )  # fmt: skip


def _keys(figure: Figure, bar: Axes, scale: Scale, hollow: bool) -> None:
    """Colour bar of time and a key of sizes; hollow: whether some events are not compared."""
    locator = dates.AutoDateLocator(minticks=3, maxticks=8)
    first, last = (dates.num2date(day) for day in scale.days)
    shared = [form for form in ("%Y", "%b %Y", "%d %b %Y") if first.strftime(form) == last.strftime(form)]
    when = first.strftime(shared[-1]) if shared else f"{first.year} to {last.year}"  # what the marks leave out
    figure.colorbar(
        ScalarMappable(Normalize(*scale.days), "viridis"), cax=bar, ticks=locator,
        format=dates.ConciseDateFormatter(locator, show_offset=False),
    )  # fmt: skip
    bar.set_title(when, fontsize=8.5, fontweight="normal", loc="left")

    def circle(diameter: float, label: str, **look) -> Line2D:
        return Line2D([], [], linestyle="none", marker="o", markersize=diameter, label=label, **look)

    handles = [
        circle(
            float(scale.diameter(value)), f"log P {value:.4g}".replace("-", "−"), color="#bbbbbb",
            markeredgecolor="k", markeredgewidth=0.3,
        )
        for value in scale.key_sizes
    ]  # fmt: skip
    if hollow:
        handles.append(circle(4.0, "not compared", markerfacecolor="none", markeredgecolor=NOT_COMPARED_COLOUR))
    panels.key(figure, handles)


def nearness(comparison: xr.Dataset) -> Figure:
    """Figure of how near modelled and recorded events lie: Ripley's cross-K over the K within each, by distance (m)."""
    figure = style.new_figure(width=0.6 * style.PAGE_WIDTH, height=3.2)
    axes = figure.subplots()
    distance, ratio = comparison["distance"].values, comparison["cross_ratio"].values
    low, high = comparison["cross_ratio_interval"].values.T
    axes.axhline(1.0, color="k", linewidth=0.8, linestyle="--", label="as near as to their own kind")
    if np.isfinite(low).any():
        axes.fill_between(distance, low, high, color=style.BOTH, alpha=0.25, linewidth=0, label="95 % interval")
    axes.plot(distance, ratio, color=style.BOTH, marker="o", markersize=4, label="modelled with recorded")
    axes.set_xlim(0, None)
    axes.set_ylim(0, None)
    axes.set_xlabel("distance between events (m)")
    axes.set_ylabel("cross-K ratio (1)")
    axes.legend()
    return figure
