"""How oriented: P, B and T axes on lower-hemisphere equal-area nets (paper Fig. 21), and Kagan angles."""

from dataclasses import dataclass

import mplstereonet  # which also registers the projection
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from catalogs.figures import style
from catalogs.sources.mechanisms import AXIS_NAMES, GIRDLE, MAX_CONE, UNIFORM, direction, trend_plunge

CONTOUR_LEVELS = (2, 4, 6, 8, 12, 16, 24)  # Multiples of a uniform density.
MIN_AXES_CONTOURED = 8  # The density of fewer axes shows its own smoothing.
CELL, NET, BAR = 3.3, 2.6, 1.0  # inches: a panel, the net in it, the colour bar
MAX_AXES_DRAWN = 600  # Axes drawn as dots in one net; contours show the density of all.
INSITU_LABELS = {"P": "σ₁ in situ", "B": "σ₂ in situ", "T": "σ₃ in situ"}


@dataclass(frozen=True)
class Axes:
    """One catalogue's axes: label, colour, map of density; vectors (3: P B T, event, xyz) unit, east north up.

    mean_trend, mean_plunge, mean_cone: (3,) degrees; NaN where there is none. shape (3,): what the axes form
    (catalogs.sources.mechanisms); pole_trend, pole_plunge (3,): of a girdle, degrees, else NaN.
    """

    label: str
    colour: str
    density_map: str
    vectors: np.ndarray
    mean_trend: np.ndarray
    mean_plunge: np.ndarray
    mean_cone: np.ndarray
    shape: np.ndarray
    pole_trend: np.ndarray
    pole_plunge: np.ndarray


def stereonets(catalogs: list[Axes], insitu: np.ndarray | None = None) -> Figure:
    """A row of three nets per catalogue: axes (dots), their density (contours), mean axis (star) and its 95 % cone.

    A net's title says how many axes it shows. Axes of a girdle have its great circle (dashed) instead of a star, axes
    without a preferred direction, or with a cone that is wider than MAX_CONE, neither.

    insitu: (3, xyz), the most, middle and least compressive axis of the stress before mining, a cross on P, B and T.
    Placed by hand: the overlay on which mplstereonet draws azimuths is lost in matplotlib's layouts.
    """
    width, height = 3 * CELL + BAR, (CELL + 0.35) * len(catalogs)
    figure = style.new_figure(width, height, layout=None)
    for row, axes_of in enumerate(catalogs):
        bottom = height - (CELL + 0.35) * (row + 1) + 0.45
        drawn = None
        for column, name in enumerate(AXIS_NAMES):
            place = [(CELL * column + (CELL - NET) / 2) / width, bottom / height, NET / width, NET / height]
            axes = figure.add_axes(place, projection="equal_area_stereonet")
            count = int(np.isfinite(axes_of.vectors[column]).all(axis=-1).sum())
            axes.set_title(f"{axes_of.label}: {count:,} {name}".replace(",", "\u202f"), pad=16)
            drawn = _net(axes, axes_of, column) or drawn
            if insitu is not None:
                _mark_insitu(axes, insitu[column], INSITU_LABELS[name])
        if drawn is not None:
            place = [3 * CELL / width, (bottom + 0.2 * NET) / height, 0.15 / width, 0.6 * NET / height]
            figure.colorbar(drawn, cax=figure.add_axes(place), label="density\n(multiples of uniform)")
    return figure


def _mark_insitu(axes, vector: np.ndarray, label: str) -> None:
    """A cross at a principal axis of the stress before mining."""
    trend, plunge = trend_plunge(vector)
    axes.line(plunge, trend, "x", markersize=9, markeredgecolor="#009e73", markeredgewidth=2.2, label=label, zorder=6)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.05), handletextpad=0.2, ncols=2, columnspacing=0.8)


def _net(axes, axes_of: Axes, column: int):
    """One net; gives what a colour bar needs, None if nothing is contoured."""
    axes.grid(False)
    axes.set_azimuth_ticks([])
    for x, y, name in ((0.5, 1.02, "N"), (1.02, 0.5, "E"), (0.5, -0.02, "S"), (-0.02, 0.5, "W")):
        side = {"va": "bottom" if y > 1 else "top" if y < 0 else "center"}
        side["ha"] = "left" if x > 1 else "right" if x < 0 else "center"
        axes.text(x, y, name, transform=axes.transAxes, fontsize=8.5, **side)
    vectors = axes_of.vectors[column]
    vectors = vectors[np.isfinite(vectors).all(axis=-1)]
    if not len(vectors):
        axes.text(0.5, 0.5, "no axes", transform=axes.transAxes, ha="center", color=style.OUTLINE)
        return None
    trend, plunge = trend_plunge(vectors)
    drawn = None
    if len(vectors) >= MIN_AXES_CONTOURED:
        drawn = axes.density_contourf(
            plunge, trend, measurement="lines", cmap=axes_of.density_map, levels=CONTOUR_LEVELS, extend="max", alpha=0.8
        )
    every = -(-len(vectors) // MAX_AXES_DRAWN)
    points = mplstereonet.line(plunge[::every], trend[::every])  # axes.line() makes an artist of each
    axes.plot(*points, ".", markersize=2.5, color="k", alpha=0.4, rasterized=True)
    _mark_mean(axes, axes_of, column)
    return drawn


def _mark_mean(axes, axes_of: Axes, column: int) -> None:
    """What the axes of one net have in common: a star and its cone, a girdle's great circle, or a word."""
    trend, plunge, cone = (part[column] for part in (axes_of.mean_trend, axes_of.mean_plunge, axes_of.mean_cone))
    pole = axes_of.pole_trend[column], axes_of.pole_plunge[column]
    if axes_of.shape[column] == GIRDLE:
        label = f"girdle, pole {direction(*pole)}"
        axes.plane(pole[0] + 90.0, 90.0 - pole[1], "--", color="k", linewidth=1.3, label=label)
    elif axes_of.shape[column] == UNIFORM or cone > MAX_CONE:
        label = UNIFORM if axes_of.shape[column] == UNIFORM else f"no mean axis (± {cone:.0f}°)"
        axes.plot([], [], " ", label=label)
    elif np.isfinite([trend, plunge]).all():
        known = np.isfinite(cone) and cone > 0
        axes.line(
            plunge, trend, "*", markersize=13, markerfacecolor="white", markeredgecolor="k", markeredgewidth=1.2,
            label=f"mean {direction(trend, plunge)}" + (f" ± {cone:.0f}°" if known else ""),
        )  # fmt: skip
        if known:
            axes.cone(plunge, trend, cone, facecolor="none", edgecolor="k", linewidth=1.3)
    else:
        return
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.05), handletextpad=0.2)


def kagan_angles(comparison: xr.Dataset) -> Figure:
    """Shares of Kagan angles per bin: between the catalogues, within the record, and of random frames."""
    figure = style.new_figure(width=0.9 * style.PAGE_WIDTH, height=3.2)
    axes = figure.subplots()
    lower, width = comparison["kagan_lower"].values, float(comparison.attrs["kagan_bin_width"])
    edges = np.append(lower, lower[-1] + width)
    looks = {
        "uniform": ("random orientations", {"color": "#8c8c8c", "linestyle": ":"}),
        "record_record": ("recorded with recorded", {"color": style.RECORDED}),
        "nearest": ("modelled with the nearest recorded", {"color": style.BOTH}),
        "model_record": ("modelled with recorded", {"color": style.MODELLED, "linewidth": 2.0}),
    }
    for name, (label, look) in looks.items():
        share = comparison["kagan_share"].sel(kagan_pair=name).values
        if np.isfinite(share).all():
            median = float(comparison["kagan_median"].sel(kagan_pair=name))
            axes.stairs(100 * share, edges, label=f"{label}, median {median:.0f}°", **look)
    axes.set_xlim(0, edges[-1])
    axes.set_ylim(0, None)
    axes.set_xlabel("Kagan angle (degrees)")
    axes.set_ylabel(f"share of pairs per {width:g}° (%)")
    figure.legend(loc="outside right upper")
    return figure
