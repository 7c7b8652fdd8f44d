"""The record in time: sizes, the potency they add up to and the model's, and from which size on it is complete."""

import numpy as np
import xarray as xr
from matplotlib import dates
from matplotlib.figure import Figure

from catalogs.compare.exposure import window
from catalogs.figures import style
from catalogs.figures.events_figure import days_since_1970
from catalogs.sources.completeness import fullest_bin
from catalogs.sources.sizes import log_potency

EVENTS_PER_WINDOW = 100  # Events whose fullest bin is found; more where there would be over MAX_WINDOWS windows.
MAX_WINDOWS = 30
MIN_EVENTS_IN_TIME = 40  # Fewer events have no completeness in time.


def in_time(record: xr.Dataset, model: xr.Dataset, steps: list[dict], label: str, cut: float) -> Figure | None:
    """Sizes against time, cumulative potency of record and model (m3, from the cut on), completeness in time.

    steps: attributes of the dated steps, with start and end; label: of the record; cut: log10 of potency in m3. The
    model's events are ordered within a step, not dated: its potency is drawn at the ends of steps. None without times.
    """
    days, size = days_since_1970(record), log_potency(record["potency"].values)
    known = np.isfinite(days) & np.isfinite(size)
    if not known.any():
        return None
    order = np.flatnonzero(known)[np.argsort(days[known], kind="stable")]
    days, size = days[order], size[order]
    figure = style.new_figure(height=4.6)
    top, bottom = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [3, 2]})
    top.plot(
        days, size, ".", markersize=3.5 if len(days) < 2000 else 1.5, color=style.RECORDED, alpha=0.6, rasterized=True,
        label=label,
    )  # fmt: skip
    if len(days) >= MIN_EVENTS_IN_TIME:
        top.step(*completeness(days, size), where="mid", color="k", linewidth=1.4, label="complete from (fullest bin)")
    top.axhline(cut, color="k", linestyle="--", linewidth=0.8, label=f"cut {cut:.2f}".replace("-", "−"))
    top.set_ylabel("log P")
    top.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    counted = size >= cut
    bottom.step(
        np.append(days[counted], days[-1]), np.append(np.cumsum(10.0 ** size[counted]), np.sum(10.0 ** size[counted])),
        where="post", color=style.RECORDED, label=label,
    )  # fmt: skip
    edges: list = []
    sums: list = []
    own, name = log_potency(model["potency"].values), model["step"].values
    for step in steps:
        start, end = (dates.date2num(moment) for moment in window(step))
        inside = (name == step["step"]) & (own >= cut)
        total = sums[-1] if sums else 0.0
        edges += [start, end]
        sums += [total, total + float(np.sum(10.0 ** own[inside]))]
        for axes in (top, bottom):
            axes.axvline(start, color="#bbbbbb", linewidth=0.7, zorder=0)
    bottom.plot(edges, sums, color=style.MODELLED, marker="o", markersize=4, label="Modelled, by step")
    bottom.set_ylabel("potency from the\ncut on (m³)")
    bottom.set_ylim(0, None)
    bottom.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    locator = dates.AutoDateLocator(minticks=3, maxticks=9)
    bottom.xaxis.set_major_locator(locator)
    bottom.xaxis.set_major_formatter(dates.ConciseDateFormatter(locator))
    return figure


def completeness(days: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middle day and fullest bin (log10 m3) of windows of events in a row, half overlapping; days ascending."""
    width = min(max(EVENTS_PER_WINDOW, len(days) // MAX_WINDOWS), len(days))
    starts = range(0, len(days) - width + 1, max(width // 2, 1))
    found = [fullest_bin(size[start : start + width]) for start in starts]
    return np.array([np.median(days[start : start + width]) for start in starts]), np.array(found)
