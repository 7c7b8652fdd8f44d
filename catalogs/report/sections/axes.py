"""Orientation of events: P, B, T axes on lower-hemisphere equal-area nets (paper Fig. 21), Kagan angles, source types.

The template is "axes.html.j2".
"""

from dataclasses import dataclass

import mplstereonet  # which also registers the projection
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from catalogs.figures import style
from catalogs.report.evidence import MODEL_LABEL, Evidence, compared_events, selection, shown_catalogues
from catalogs.report.gallery import Gallery
from catalogs.report.text import DASH, as_sentence, between, comparison_row, fixed, number, with_unit
from catalogs.sources.mechanisms import (
    AXIS_NAMES,
    CLUSTER,
    GIRDLE,
    MAX_CONE,
    UNIFORM,
    describe_axes,
    direction,
    trend_plunge,
)
from common.quantities import parse_quantity
from common.source_tensors import principal_axes, shear_iso_share
from common.voigt import tensor_from_voigt

MAX_ROCKS_NAMED = 4  # Rocks that the sentence names.
CONTOUR_LEVELS = (2, 4, 6, 8, 12, 16, 24)  # Multiples of a uniform density.
MIN_AXES_CONTOURED = 8  # The density of fewer axes shows its own smoothing.
CELL, NET, BAR = 3.3, 2.6, 1.0  # inches: a panel, the net in it, the colour bar
MAX_AXES_DRAWN = 600  # Axes drawn as dots in one net; contours show the density of all.
INSITU_LABELS = {"P": "σ₁ in situ", "B": "σ₂ in situ", "T": "σ₃ in situ"}
MAX_EVENTS_DRAWN = 2000  # Events of one catalogue that are drawn.


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


def section(evidence: Evidence, gallery: Gallery) -> dict | None:
    """Content of the section on axes: figures of nets, source types and Kagan angles (the last two may be None),
    isotropic share, widest cone, selection of events, rows and text of the comparison. None without axes."""
    shown = shown_catalogues(evidence)
    chosen = compared_events(evidence, shown)
    kept = {label: catalog.isel(event=chosen[label]) for label, catalog in shown.items()}
    nets = [net for net in (_axes_of(evidence, *item) for item in kept.items()) if net is not None]
    if not nets:
        return None
    compared = evidence.comparison is not None and int(evidence.comparison.attrs.get("axes_present", 0))
    typed = {label: catalog for label, catalog in kept.items() if np.isfinite(catalog["dc"].values).any()}
    colours = {label: style.MODELLED if label == MODEL_LABEL else style.RECORDED for label in typed}
    return {
        "figure": gallery.add("stereonets", stereonets(nets, insitu_axes(evidence))),
        "types": gallery.add("source_types", source_types(typed, colours)) if typed else None,
        "iso_share": iso_share(evidence),
        "widest_cone": MAX_CONE,
        "selection": selection(chosen),
        "kagan": gallery.add("kagan_angles", kagan_angles(evidence.comparison)) if compared else None,
        "rows": axis_rows(evidence) if compared else [],
        "text": "" if evidence.comparison is None else as_sentence(evidence.comparison.attrs.get("axes_text", "")),
    }


def _axes_of(evidence: Evidence, label: str, catalog) -> Axes | None:
    """Axes of one catalogue with their means; None if it has none."""
    modelled, comparison = label == MODEL_LABEL, evidence.comparison
    vectors = np.stack([catalog[f"{name}_axis"].values for name in "pbt"])
    known = np.isfinite(vectors).all(axis=2).any(axis=0)
    if not known.any():
        return None
    vectors = vectors[:, known]
    if comparison is not None and int(comparison.attrs.get("axes_present", 0)):
        here = comparison.sel(catalogue="model" if modelled else "record")
        names = ("mean_trend", "mean_plunge", "mean_cone", "axis_shape", "pole_trend", "pole_plunge")
        common = [here[name].values for name in names]
    else:
        found = [describe_axes(one, np.arange(len(one)), blocks_known=False) for one in vectors]
        mean, pole = (trend_plunge(np.array(part)) for part in zip(*((f.mean, f.pole) for f in found), strict=True))
        common = [*mean, np.full(3, np.nan), np.array([one.shape for one in found]), *pole]
    look = (style.MODELLED, "Blues") if modelled else (style.RECORDED, "Oranges")
    return Axes(label, *look, vectors, *common)


def axis_rows(evidence: Evidence) -> list[dict]:
    """Axes: mean axes of both or what axes form instead, the angle between them with 95 % interval, Kagan angles."""
    comparison = evidence.comparison
    rows = []
    for axis in comparison["axis_name"].values:
        here = comparison.sel(axis_name=axis)
        chance = float(here["mean_angle_p_value"])
        interval = between(here["mean_angle_interval"].values)
        rows.append(
            comparison_row(
                f"mean {axis} axis (trend/plunge), angle between"
                + (f" (p = {number(chance, 2)} if one)" if np.isfinite(chance) else ""),
                *_means(here),
                with_unit(number(here["mean_angle"]), "°"),
                interval,
            )
        )
        summed = _directions(here, "summed")
        rows.append(
            comparison_row(
                f"{axis} axis of the summed tensor", *summed, with_unit(number(here["summed_angle"]), "°"), ""
            )
        )
    rows.append(
        comparison_row(
            "Kagan angle of the summed tensors", "", "", with_unit(number(comparison["summed_kagan"]), "°"), ""
        )
    )
    for pair, name in (("model_record", "all pairs"), ("nearest", "each modelled and its nearest recorded")):
        here = comparison.sel(kagan_pair=pair)
        interval = between(here["kagan_median_interval"].values)
        rows.append(
            comparison_row(
                f"median Kagan angle, {name}", "", "", with_unit(number(here["kagan_median"]), "°"), interval
            )
        )
    return rows


def _means(comparison: xr.Dataset) -> tuple[str, str]:
    """Mean axis of the model and of the record with its cone; of axes without a mean what they form."""
    texts = []
    for which in ("model", "record"):
        here = comparison.sel(catalogue=which)
        shape, cone = str(here["axis_shape"].values), float(here["mean_cone"])
        if shape == GIRDLE:
            texts.append(f"girdle, pole {direction(float(here['pole_trend']), float(here['pole_plunge']))}")
        elif shape == UNIFORM:
            texts.append(UNIFORM)
        elif shape == CLUSTER:
            mean = direction(float(here["mean_trend"]), float(here["mean_plunge"]))
            texts.append(mean + (f" ± {number(cone, 2)}°" if np.isfinite(cone) else ""))
        else:
            texts.append(DASH)
    model, record = texts
    return model, record


def _directions(comparison: xr.Dataset, kind: str) -> tuple[str, str]:
    """Trend/plunge of the model's and the record's axis of one kind.

    kind: what the variables' names begin with.
    """
    trends, plunges = (comparison[f"{kind}_{name}"] for name in ("trend", "plunge"))
    model, record = (
        direction(float(trends.sel(catalogue=which)), float(plunges.sel(catalogue=which)))
        if np.isfinite(trends.sel(catalogue=which))
        else DASH
        for which in ("model", "record")
    )
    return model, record


def iso_share(evidence: Evidence) -> str:
    """The isotropic share that follows from the rocks' dilation angles, in sentences; empty if no rock has one."""
    materials = evidence.config.get("materials", {})
    rocks = []
    for name in sorted(materials, key=lambda name: name != "host"):
        if "dilation_angle" in materials[name]:
            angle = _of_the_drop(materials[name])
            span = dict.fromkeys(number(100.0 * share, 2) for share in shear_iso_share(angle))
            rocks.append(f"{' to '.join(span)} % in a cell of {name} ({angle:g}°)")
        if materials[name].get("planes"):  # slip along a plane is flow on a face
            angle = _of_the_drop(materials[name]["planes"])
            share = number(100.0 * shear_iso_share(angle)[0], 2)
            rocks.append(f"{share} % in slip on the planes of {name} ({angle:g}°)")
    if not rocks:
        return ""
    shares = ", ".join(rocks[:MAX_ROCKS_NAMED])
    return (
        f"The ISO share of rock that fails in shear follows from its dilation angle, an input: {shares}. "
        "In an event of cells whose mechanisms differ it is somewhat larger, and where rock tears it is a third. "
        "If the ISO share is near the record's, this reflects the chosen angle and is no evidence for the model. The "
        "tensor does not include openings that close in an event, the implosive part of many sources in mines (McGarr "
        "1992)."
    )


def _of_the_drop(strength: dict) -> float:
    """Dilation angle, degrees, with which rock or planes drop to their residual strength: that part is seismic."""
    return parse_quantity(strength["dilation_angle"]["residual"], "deg")


def insitu_axes(evidence: Evidence) -> np.ndarray | None:
    """Most, middle and least compressive axis (3, xyz) of the virgin stress at the events' mean elevation, by potency.

    None where the configuration is not known or no event is there.
    """
    stress, events = evidence.insitu, evidence.resolved
    if stress is None or events is None or not events.sizes["event"]:
        return None
    depth = stress.surface - np.average(events["location"].values[:, 2], weights=events["potency"].values)
    return principal_axes(tensor_from_voigt(np.array(stress.constant) + depth * np.array(stress.gradient)))


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
    """Draw one net and return what a colour bar needs, None if nothing is contoured."""
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
    """Mark the mean of the axes on one net: a star and its cone, the great circle of a girdle, or a word.

    axes: net to draw on; column: 0, 1, 2 for P, B, T.
    """
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


def source_types(catalogs: dict[str, xr.Dataset], colours: dict[str, str]) -> Figure:
    """One panel per catalogue (keys: labels) that has tensors: ISO (signed) against DC, size of a dot by potency.

    Shares of the potency tensor (Vavrycuk 2015): |ISO| + |CLVD| + DC = 1, so dots lie within a triangle, and the
    distance to its sides is the CLVD share.
    """
    figure = style.new_figure(width=4.0 * len(catalogs), height=3.1)
    for axes, (label, catalog) in zip(
        figure.subplots(1, len(catalogs), squeeze=False)[0], catalogs.items(), strict=True
    ):
        iso, dc, potency = (catalog[name].values for name in ("iso", "dc", "potency"))
        known = np.flatnonzero(np.isfinite(iso) & np.isfinite(dc) & (potency > 0))
        order = known[np.argsort(-potency[known], kind="stable")][:MAX_EVENTS_DRAWN]
        scale = potency[order].max() if len(order) else 1.0
        axes.plot([-1, 0, 1, -1], [0, 1, 0, 0], color=style.OUTLINE, linewidth=0.8)
        axes.scatter(
            iso[order], dc[order], s=4 + 120 * (potency[order] / scale) ** (2 / 3), color=colours[label], alpha=0.45,
            edgecolors="black", linewidths=0.25, rasterized=len(order) > 300,
        )  # fmt: skip
        weight = potency[known] / potency[known].sum() if len(known) else potency[known]
        mean = (
            f"by potency: ISO {fixed(100 * weight @ iso[known], 0)} %, DC {fixed(100 * weight @ dc[known], 0)} %"
            if len(known)
            else ""
        )
        axes.set_title(f"{label}\n{mean}")
        axes.set(
            xlim=(-1.05, 1.05), ylim=(-0.05, 1.05), xlabel="ISO share (1): closing, opening", ylabel="DC share (1)"
        )
    return figure
