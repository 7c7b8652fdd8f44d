"""How large: potency-frequency plots (paper Fig. 20) and how the b value depends on the cut."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.compare.size_measures import SIZE_BIN_WIDTH
from catalogs.figures import style
from catalogs.sources.sizes import counts, cut_grid


@dataclass(frozen=True)
class Sizes:
    """One catalogue's sizes: label and colour; log_potency (event,) of m3; the fit log10 N = a - b log P above cut.

    b_interval: (lower, upper), 95 %. by_cut: (3, n) rows cut, b, error of b; NaN where too few events remain.
    """

    label: str
    colour: str
    log_potency: np.ndarray
    b: float
    b_interval: tuple[float, float]
    a: float
    cut: float
    by_cut: np.ndarray


def potency_frequency(catalogs: list[Sizes]) -> Figure:
    """Per catalogue: events per bin (bars), those at least so large (circles), fitted line, cut (dashed)."""
    figure = style.new_figure(width=style.PAGE_WIDTH * (1 if len(catalogs) > 1 else 0.6), height=4.0)
    array = figure.subplots(1, len(catalogs), squeeze=False, sharex=True, sharey=True).ravel()
    for axes, sizes in zip(array, catalogs, strict=True):
        _panel(axes, sizes)
    array[0].set_ylim(0.7, None)  # of all panels, once all are drawn: what is set stays, however many events follow
    array[0].set_ylabel("number of events")
    return figure


def _panel(axes: Axes, sizes: Sizes) -> None:
    values = np.sort(sizes.log_potency[np.isfinite(sizes.log_potency)])
    axes.set_title(sizes.label)
    axes.set_xlabel("log P (P in m³)")
    axes.set_yscale("log")
    if not len(values):
        axes.text(0.5, 0.5, "no events", transform=axes.transAxes, ha="center", color=style.OUTLINE)
        return
    edges = cut_grid(values, SIZE_BIN_WIDTH)
    count, cumulative = counts(values, edges, SIZE_BIN_WIDTH)
    axes.bar(
        edges, count, SIZE_BIN_WIDTH, align="edge", color=sizes.colour, alpha=0.35, edgecolor="white", linewidth=0.5,
        label="per bin",
    )  # fmt: skip
    axes.plot(
        edges, cumulative, "o", markersize=4.5, markerfacecolor="white", markeredgecolor=sizes.colour,
        markeredgewidth=1.2, label="at least so large",
    )  # fmt: skip
    if np.isfinite(sizes.cut):
        axes.axvline(sizes.cut, color="k", linewidth=0.9, linestyle="--", label=f"cut {_number(sizes.cut)}")
    if np.isfinite(sizes.b):
        span = np.array([sizes.cut, max(values[-1], sizes.cut + SIZE_BIN_WIDTH)])
        low, high = sizes.b_interval
        text = f"b = {sizes.b:.2f} ({low:.2f} to {high:.2f})"
        axes.plot(span, 10 ** (sizes.a - sizes.b * span), color="k", linewidth=1.6, label=text)
    axes.legend(loc="upper right")


def b_against_cut(catalogs: list[Sizes]) -> Figure:
    """b with its error against the cut from which it is counted: a stable b shows as a level stretch."""
    figure = style.new_figure(width=0.6 * style.PAGE_WIDTH, height=3.2)
    axes = figure.subplots()
    for sizes in catalogs:
        cut, b, error = sizes.by_cut
        known = np.isfinite(b)
        axes.fill_between(
            cut[known], (b - error)[known], (b + error)[known], color=sizes.colour, alpha=0.2, linewidth=0
        )
        axes.plot(cut[known], b[known], color=sizes.colour, marker="o", markersize=3, label=f"{sizes.label}, ± error")
    cuts = {sizes.cut for sizes in catalogs if np.isfinite(sizes.cut)}
    for number, cut in enumerate(sorted(cuts)):
        axes.axvline(cut, color="k", linewidth=0.9, linestyle="--", label=None if number else "cut used")
    axes.set_ylim(0, None)
    axes.set_xlabel("cut, log P (P in m³)")
    axes.set_ylabel("b of potency (1)")
    axes.legend()
    return figure


def _number(value: float) -> str:
    return f"{value:.2f}".replace("-", "−")
