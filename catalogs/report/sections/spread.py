"""The spread of an ensemble: how far one run differs from another.

The template is "spread.html.j2".
"""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.compare.spread import SPREAD_BIN_WIDTH
from catalogs.figures import style
from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.text import DASH, fixed, number, percent, plural, typeset, whole, with_unit
from catalogs.settings import ALL_STEPS
from catalogs.sources.sizes import counts, log_potency

ONE_RUN = (
    "One run is one realisation: brittle failure localises, so equally valid choices of loading change the potency and "
    "the number of events."
)
QUANTITY_ROWS = {  # quantity, its name, what its values are divided by, how they are written
    "potency": ("potency of all events (m³)", 1.0, number),
    "failed_volume": ("volume of rock that failed (m³)", 1.0, number),
    "events": ("events (of enough particles)", 1.0, number),
    "b": ("b of potency", 1.0, lambda value: fixed(value, 2)),
    "energy_released": ("energy released (MJ)", 1e6, number),
    "energy_dissipated": ("energy dissipated by failure (MJ)", 1e6, number),
}
MEMBER_COLOUR = "#8cb8d9"  # A light form of style.MODELLED.
# Half the width over which the members' points lie side by side, relative to the distance of two steps.
MEMBERS_HALF_WIDTH = 0.25
MAX_NAMED_STEPS = 12  # below the panel of the steps


def section(evidence: Evidence, gallery: Gallery) -> dict:
    """Content of the section on spread: figure, headline, rows, number of members, variability of strength and cut of
    sizes. Without an ensemble a sentence that says so (one_run), and no rows."""
    runs, record = evidence.spread, evidence.record
    if runs is None:
        return {"one_run": ONE_RUN, "rows": []}
    beside = None if record is None else (evidence.record_label, log_potency(record["potency"].values))
    return {
        "figure": gallery.add("spread", draw_runs(runs, beside)),
        "headline": headline(evidence),
        "rows": spread_rows(evidence),
        "members": int(runs.attrs["members"]),
        "collapsed": int(runs.attrs["collapsed_members"]),
        "variability": percent(runs.attrs["variability"]),
        "cut": typeset(str(runs.attrs["cut_text"])),
    }


def spread_rows(evidence: Evidence) -> list[dict]:
    """Rows of text, one for each quantity over all dated steps: value of the mine's own run; mean, standard deviation,
    its share of the mean, least and largest value of the ensemble."""
    runs, rows = evidence.spread.sel(period=ALL_STEPS), []
    for quantity, (name, unit, form) in QUANTITY_ROWS.items():
        own = float(runs[quantity].values[0]) / unit
        mean, deviation, least, largest = runs[f"{quantity}_statistics"].values / unit
        written = whole if quantity == "events" else form
        own_text, least_text, largest_text = (
            written(value) if np.isfinite(value) else DASH for value in (own, least, largest)
        )
        if quantity == "b":
            own_text = with_unit(own_text, f" ± {fixed(float(runs['b_error'].values[0]), 2)}")
        rows.append(
            {
                "name": name,
                "own": own_text,
                "mean": form(mean),
                "deviation": form(deviation),
                "share": percent(deviation / mean) if mean > 0 else DASH,
                "least": least_text,
                "largest": largest_text,
            }
        )
    return rows


def headline(evidence: Evidence) -> str:
    """The spread in one sentence."""
    runs = evidence.spread.sel(period=ALL_STEPS)
    _, _, least, largest = runs["potency_statistics"].values
    _, _, fewest, most = runs["events_statistics"].values
    members = plural(int(evidence.spread.attrs["members"]), "member")
    return (
        f"In {members} of the ensemble all events release {number(least)} to {number(largest)} m³ (here "
        f"{number(runs['potency'].values[0])}), and {whole(fewest)} to {whole(most)} events are of enough particles "
        f"(here {whole(runs['events'].values[0])})."
    )


def draw_runs(runs: xr.Dataset, record: tuple[str, np.ndarray] | None) -> Figure:
    """Events at least so large in each run, and potency per step. record: its label and log10 P (event,), or None."""
    figure = style.new_figure(width=style.PAGE_WIDTH, height=4.0)
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    _sizes(left, runs, record)
    _potency(right, runs)
    return figure


def _sizes(axes: Axes, runs: xr.Dataset, record: tuple[str, np.ndarray] | None) -> None:
    edges, cumulative = runs["size_bin_lower"].values, runs["cumulative"].values
    axes.set_title("All dated steps")
    axes.set_xlabel("log P (P in m³)")
    axes.set_ylabel("events at least so large")
    if not len(edges):
        axes.text(0.5, 0.5, "no events", transform=axes.transAxes, ha="center", color=style.OUTLINE)
        return

    def line(at: np.ndarray, count: np.ndarray, **look) -> None:
        axes.plot(at, np.where(count > 0, count, np.nan), drawstyle="steps-pre", **look)

    for member, count in enumerate(cumulative[1:]):
        line(edges, count, color=MEMBER_COLOUR, linewidth=0.8, label=None if member else "members")
    line(edges, cumulative[0], color=style.MODELLED, linewidth=2.0, label="this catalogue")
    if record is not None:
        label, values = record
        known = values[np.isfinite(values)]
        line(edges, counts(known, edges, SPREAD_BIN_WIDTH)[1], color=style.RECORDED, linewidth=1.4, label=label)
    if np.isfinite(cut := float(runs.attrs["cut"])):
        axes.axvline(cut, color="k", linewidth=0.9, linestyle="--", label=f"cut {cut:.2f}".replace("-", "−"))
    axes.set_yscale("log")
    axes.set_ylim(0.7, None)
    axes.legend(loc="upper right")


def _potency(axes: Axes, runs: xr.Dataset) -> None:
    steps = [str(name) for name in runs["period"].values if name != ALL_STEPS]
    potency = runs["potency"].sel(period=steps).values
    place = np.arange(len(steps))
    aside = np.linspace(-MEMBERS_HALF_WIDTH, MEMBERS_HALF_WIDTH, len(potency) - 1) if len(potency) > 2 else np.zeros(1)
    for member, values in enumerate(potency[1:]):
        axes.plot(
            place + aside[member], values, "o", color=MEMBER_COLOUR, markersize=5.5, markeredgecolor="white",
            markeredgewidth=0.5, label=None if member else "members",
        )  # fmt: skip
    axes.hlines(
        potency[0],
        place - MEMBERS_HALF_WIDTH,
        place + MEMBERS_HALF_WIDTH,
        color=style.MODELLED,
        linewidth=2.0,
        label="this catalogue",
    )
    every = -(-len(steps) // MAX_NAMED_STEPS)
    axes.set_xticks(place[::every], steps[::every], rotation=0 if len(steps) < 5 else 60)
    axes.set_xlim(-0.6, len(steps) - 0.4)
    axes.set_ylim(0.0, 1.25 * max(potency.max(), 1e-30))
    axes.set_title("By step")
    axes.set_ylabel("potency of all events (m³)")
    axes.legend(loc="upper right", ncols=2)
