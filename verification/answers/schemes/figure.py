"""Figure of the two schemes: convergence to the elastic equilibrium, and results of brittle runs pair by pair."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from catalogs.figures import style
from verification.answers.schemes.runs import Pairs
from verification.results import Variant

LABELS = {
    "potency": "seismic potency (m³)",
    "failed_volume": "failed volume (m³)",
    "events": "events",
    "b": "b of log P",
}
COLOURS = {"explicit": style.RECORDED, "multigrid": style.MODELLED}
LINE_LOOKS = {  # Line of convergence by scheme and whether densities are scaled.
    ("explicit", True): {"color": style.RECORDED, "linewidth": 1.4},
    ("explicit", False): {"color": style.RECORDED, "linewidth": 1.0, "linestyle": "--"},
    ("multigrid", True): {"color": style.MODELLED, "linewidth": 1.4, "marker": "o", "markersize": 4.0},
}
NAMES = {
    ("explicit", True): "explicit, scaled densities",
    ("explicit", False): "explicit, true masses",
    ("multigrid", True): "multigrid",
}
MEAN_OFFSET = 0.16  # Distance of a mean from its runs, as a share of the distance between the schemes.


def draw(elastic: dict[str, dict[str, Variant]], brittle: dict[str, Pairs]) -> Figure:
    """Convergence of each elastic scene in one row, then one row for each brittle scene."""
    figure = style.new_figure(height=2.7 * (bool(elastic) + len(brittle)))
    rows = np.atleast_1d(figure.subfigures(bool(elastic) + len(brittle), 1))
    if elastic:
        panels = rows[0].subplots(1, len(elastic), squeeze=False)[0]
        for axes, (scene, schemes) in zip(panels, elastic.items(), strict=True):
            convergence(axes, scene, schemes)
        rows[0].legend(*panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=len(NAMES))
    for row, (scene, pairs) in zip(rows[len(rows) - len(brittle) :], brittle.items(), strict=True):
        for axes, quantity in zip(row.subplots(1, len(LABELS)), LABELS, strict=True):
            compare(axes, quantity, pairs)
            axes.set_title(f"{scene}, brittle" if quantity == "potency" else "")
    return figure


def convergence(axes: Axes, scene: str, schemes: dict[str, Variant]) -> None:
    """Unbalanced force against iterations."""
    for variant in schemes.values():
        state, solver = variant.elastic, variant.values["solver"]
        way = solver["scheme"], bool(solver["density_scaling"])
        iteration, ratio = state.convergence_iteration.values, state.convergence_unbalanced_ratio.values
        axes.plot(np.maximum(iteration, 1), ratio, label=NAMES[way], **LINE_LOOKS[way])
    axes.axhline(solver["tolerance"], color=style.OUTLINE, linewidth=0.6, linestyle=":")
    axes.set(xscale="log", yscale="log", title=f"{scene}, elastic", xlabel="iterations", ylabel="unbalanced force")


def compare(axes: Axes, quantity: str, pairs: Pairs) -> None:
    """Runs of both variants with lines that join pairs, and beside them mean and standard error."""
    axes.set(xlim=(-0.5, 1.5), ylabel=LABELS[quantity])
    axes.set_xticks([0, 1], [name.replace("_", "\n") for name in pairs.runs])
    if quantity == "b" and not pairs.has_b:
        axes.set_yticks([])
        axes.text(0.5, 0.5, "too few events", transform=axes.transAxes, ha="center", color=style.OUTLINE)
        return
    both = pairs.values(quantity)
    if quantity == "events":
        axes.yaxis.set_major_locator(MaxNLocator(nbins="auto", integer=True))
    axes.plot([0, 1], both, color=style.BEFORE_RECORD, linewidth=0.7, zorder=1)
    for place, side, scheme, values in zip((0, 1), (-1, 1), pairs.runs, both, strict=True):
        look = {"color": COLOURS.get(scheme, style.MODELLED), "zorder": 2}
        axes.plot(np.full(len(values), place), values, "o", markersize=3.5, **look)
        error = values.std(ddof=1) / np.sqrt(len(values))
        axes.errorbar(place + side * MEAN_OFFSET, values.mean(), error, fmt="D", markersize=4.5, capsize=4.0, **look)
