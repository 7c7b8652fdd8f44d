"""Shapes of sources: isotropic share against double-couple share, and what is left, the CLVD."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from catalogs.figures import style

MAX_EVENTS_DRAWN = 2000  # Events of one catalogue that are drawn.


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
            f"by potency: ISO {100 * weight @ iso[known]:.0f} %, DC {100 * weight @ dc[known]:.0f} %"
            if len(known)
            else ""
        )
        axes.set_title(f"{label}\n{mean}".replace("-", "−"))
        axes.set(
            xlim=(-1.05, 1.05), ylim=(-0.05, 1.05), xlabel="ISO share (1): closing, opening", ylabel="DC share (1)"
        )
    return figure
