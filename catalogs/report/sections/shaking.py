"""Peak ground velocity at openings, the events that make it, and the demand on support.

The template is "shaking.html.j2".
"""

import json
from itertools import pairwise

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from numpy.typing import NDArray

from catalogs.figures import style
from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.text import between, fixed, number, percent, typeset, whole

MAX_ROWS = 20  # Openings in the table: those with the largest velocities.
MAX_CURVES = 5  # Openings in the figure.
MAX_DEMANDS = 24  # Rows of demands: the largest.
CURVE_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#4d4d4d")
SHARE_COLOURS = "Blues"
NO_CLASS = "none: the demand is above all"
MIN_SHARE_SHOWN = 0.005  # of all exceedances, in a class of the figure


def section(evidence: Evidence, gallery: Gallery) -> dict:
    """Content of the section; empty where no ground motion is asked for.

    Rows give each opening in the step in which its velocity is largest, at the chance in the middle of those asked for.
    """
    shaking = evidence.shaking
    if shaking is None:
        return {}
    chances, chosen = shaking["chance"].values, len(shaking["chance"]) // 2
    worst = worst_steps(shaking, chosen)
    rows = [_row(shaking, opening, step, chosen) for opening, step in worst[:MAX_ROWS]]
    content = {
        "headline": _headline(shaking, worst, chosen),
        "runs": _runs(shaking),
        "ratio": _ratio(shaking),
        "relation": typeset(str(shaking.attrs["relation_text"]).replace(" - ", " − ")),
        "source": str(shaking.attrs["source"]),
        "fit": typeset(str(shaking.attrs["fit_text"])),
        "chances": [per_cent(chance) for chance in chances],
        "chosen": per_cent(chances[chosen]),
        "rows": rows,
        "lacks": ", which its fit states" if shaking.attrs["fit_text"] else "",
        "left_out": f" The table has {MAX_ROWS} of {len(worst)} openings." if len(worst) > MAX_ROWS else "",
        "displacement": number(1e3 * float(shaking.attrs["displacement"])),
        "depth_source": str(shaking.attrs["depth_source"]),
        "support": json.loads(shaking.attrs["support"]),
        "demands": _demands(shaking, chosen),
        "figure": None,
    }
    shaken = [one for one in worst if shaking["velocity"].values[one[1], one[0], chosen] > 0.0]
    if shaken:
        content["figure"] = gallery.add("shaking", draw(shaking, shaken, chosen))
        first = _name(shaking, *shaken[0])
        content["caption"] = (
            "Left: chance that a velocity is exceeded in the step, for the openings with the largest velocities, each "
            "in the step with most of it; dotted: the chances asked for. Right: what makes the velocity of "
            f"{first} that is exceeded with a chance of {per_cent(chances[chosen])}: share of the exceedances by "
            "size and distance of the events, in per cent."
        )
    return content


def brief(evidence: Evidence) -> str:
    """Sentence on the opening that is shaken most, and on the largest demand beside the stated support; empty where no
    ground motion is asked for."""
    shaking = evidence.shaking
    if shaking is None:
        return ""
    chosen = len(shaking["chance"]) // 2
    worst = worst_steps(shaking, chosen)
    text, demands = _headline(shaking, worst, chosen), _demands(shaking, chosen)
    if not demands:
        return text
    first = demands[0]
    text += (
        f" Largest demand on support: {first['opening']}, {first['side']}, {first['demand']} kJ/m² in {first['step']}"
    )
    if not first["carried_by"]:
        return f"{text}."
    no_class = first["carried_by"] == NO_CLASS
    return f"{text}, {'above every stated capacity' if no_class else 'below the capacity of ' + first['carried_by']}."


def per_cent(chance: float) -> str:
    """A chance as the user gave it, in per cent."""
    return f"{100 * chance:g} %"


def worst_steps(shaking: xr.Dataset, chance: int) -> list[tuple[int, int]]:
    """Indices of each opening that is mined and of the step in which its velocity is largest: those with the largest
    velocities first, of equal ones in the order of the mine file."""
    velocity = shaking["velocity"].values[:, :, chance]
    mined = np.flatnonzero((shaking["filled"].values >= 0).any(axis=0))
    of_opening = np.where(np.isnan(velocity), -1.0, velocity)
    pairs = [(int(opening), int(of_opening[:, opening].argmax())) for opening in mined]
    return sorted(pairs, key=lambda pair: -of_opening[pair[1], pair[0]])


def _name(shaking: xr.Dataset, opening: int, step: int) -> str:
    """Opening and step, for a sentence."""
    return f"{shaking['opening'].values[opening]} in {shaking['step'].values[step]}"


def _headline(shaking: xr.Dataset, worst: list[tuple[int, int]], chance: int) -> str:
    """Sentence on the opening that is shaken most."""
    if not worst:
        return "No opening is mined in these steps."
    opening, step = worst[0]
    velocity = shaking["velocity"].values[step, opening, chance]
    asked = per_cent(shaking["chance"].values[chance])
    if not shaking["expected_events"].values.any():
        return "The model has no resolved event in the dated steps, so that no velocity follows from it."
    if not velocity > 0.0:
        return (
            f"No opening has enough modelled events for a velocity that is exceeded with a chance of {asked} in a step."
        )
    return (
        f"Most is felt by {_name(shaking, opening, step)}: with a chance of {asked} a peak ground velocity above "
        f"{number(velocity, 2)} m/s."
    )


def _runs(shaking: xr.Dataset) -> str:
    """What of the runs the chances are from, as the end of a sentence."""
    runs = int(shaking.attrs["runs"])
    clusters = float(shaking.attrs["dispersion"])
    text = f", as the mean of {whole(runs)} runs" if runs > 1 else ""
    return text + (
        f"; events cluster, with a variance of their number {number(clusters, 2)} times its mean"
        if clusters > 1.0
        else ""
    )


def _ratio(shaking: xr.Dataset) -> str:
    """Sentence on how many recorded events there are for each modelled one; empty without a record."""
    ratio = float(shaking.attrs["event_ratio"])
    if not np.isfinite(ratio) or not ratio > 0.0:
        return ""
    return f"The record has {number(1.0 / ratio, 2)} events for each modelled one: the chances are not scaled by that."


def _row(shaking: xr.Dataset, opening: int, step: int, chance: int) -> dict:
    """An opening in a step, as text."""
    at = (step, opening, chance)
    values = {name: shaking[name].values for name in ("velocity", "velocity_interval", "magnitude", "distance")}
    return {
        "opening": str(shaking["opening"].values[opening]),
        "filled": bool(shaking["filled"].values[step, opening] == 1),
        "step": str(shaking["step"].values[step]),
        "days": number(shaking["days"].values[step]),
        "velocities": [number(one, 2) for one in values["velocity"][step, opening]],
        "interval": between(values["velocity_interval"][at], lambda value, **how: number(value, 2, **how)),
        "magnitude": fixed(values["magnitude"][at], 1),
        "distance": number(values["distance"][at], 2),
        "outside": percent(shaking["outside_share"].values[at]),
    }


def _demands(shaking: xr.Dataset, chance: int) -> list[dict]:
    """Demands at the sides of the openings, each in the step in which it is largest, the largest demands first."""
    density, demand = float(shaking.attrs["density"]), shaking["demand"].values[:, :, chance]
    has_support = shaking.attrs["support"] != "[]"
    largest = np.where(np.isnan(demand), -1.0, demand)
    places = [
        (int(largest[:, opening, side].argmax()), int(opening), int(side))
        for opening, side in np.argwhere(largest.max(axis=0, initial=-1.0) >= 0.0)
    ]
    rows = []
    for step, opening, side in sorted(places, key=lambda place: -demand[place])[:MAX_DEMANDS]:
        at = (step, opening, chance, side)
        depth = float(shaking["depth"].values[step, opening, side])
        carried = str(shaking["carried_by"].values[at])
        rows.append(
            {
                "opening": str(shaking["opening"].values[opening]),
                "step": str(shaking["step"].values[step]),
                "side": str(shaking["side"].values[side]),
                "depth": number(depth, 2),
                "mass": number(density * depth),
                "velocity": number(shaking["velocity"].values[step, opening, chance], 2),
                "demand": number(demand[step, opening, side] / 1e3, 2),
                "interval": between(
                    shaking["demand_interval"].values[at] / 1e3, lambda value, **how: number(value, 2, **how)
                ),
                "carried_by": (carried or NO_CLASS) if has_support else "",
            }
        )
    return rows


def draw(shaking: xr.Dataset, worst: list[tuple[int, int]], chance: int) -> Figure:
    """Curves of the openings that are shaken most, and what shakes the first of them."""
    figure = style.new_figure(height=4.0)
    left, right = figure.subplots(1, 2, width_ratios=(1.1, 1.0))
    _curves(left, shaking, worst[:MAX_CURVES])
    opening, step = worst[0]
    share = shaking["share"].values[step, opening, chance]
    _shares(right, share, shaking["magnitude_edge"].values, shaking["distance_edge"].values)
    right.set_title(f"What shakes {_name(shaking, opening, step)} (%)")
    return figure


def _curves(axes: Axes, shaking: xr.Dataset, worst: list[tuple[int, int]]) -> None:
    """Chance in the step against velocity, of openings each in a step (opening, step)."""
    velocity, curves, asked = shaking["velocity_of_curve"].values, shaking["curve"].values, shaking["chance"].values
    lowest, seen = 0.2 * asked.min(), []
    for (opening, step), colour in zip(worst, CURVE_COLOURS, strict=False):
        chance = curves[step, opening]
        axes.plot(velocity, np.where(chance > 0.0, chance, np.nan), color=colour, label=_name(shaking, opening, step))
        seen.append(velocity[(chance > lowest) & (chance < 0.999)])
    for one in asked:
        axes.axhline(one, color=style.OUTLINE, linestyle=":", linewidth=0.9)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(lowest, 1.3)
    shown = np.concatenate(seen)
    if len(shown):
        axes.set_xlim(shown.min() / 1.5, 1.5 * shown.max())
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_title("Velocity and chance")
    axes.set_xlabel("peak ground velocity (m/s)")
    axes.set_ylabel("chance in the step that it is exceeded")
    axes.legend(loc="lower left")


def _shares(axes: Axes, share: NDArray, magnitude: NDArray, distance: NDArray) -> None:
    """Shares (magnitude class, distance class) as a picture with numbers; outer classes without any are left out."""
    rows, columns = (np.flatnonzero(share.sum(axis=axis) >= MIN_SHARE_SHOWN) for axis in (1, 0))
    first, left = int(rows[0]), int(columns[0])
    shown = share[first : rows[-1] + 1, left : columns[-1] + 1]
    axes.imshow(shown, origin="lower", aspect="auto", cmap=SHARE_COLOURS, vmin=0.0, vmax=shown.max())
    for row, column in np.argwhere(shown >= MIN_SHARE_SHOWN):
        colour = "w" if shown[row, column] > 0.6 * shown.max() else "k"
        axes.text(column, row, f"{100 * shown[row, column]:.0f}", ha="center", va="center", color=colour)
    classes = [*(f"{low:g} to {high:g}" for low, high in pairwise(distance[:-1])), f"{distance[-2]:g} or more"]
    axes.set_xticks(range(shown.shape[1]), classes[left : columns[-1] + 1])
    names = [f"{low:g} to {high:g}".replace("-", "−") for low, high in pairwise(magnitude)]
    axes.set_yticks(range(shown.shape[0]), names[first : rows[-1] + 1])
    axes.set_xlabel("distance from the opening (m)")
    axes.set_ylabel("Mw")
