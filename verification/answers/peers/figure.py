"""Figure of the peers: holes as in the plastic studies, then the roof and the slope."""

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from catalogs.figures import style
from common.source_tensors import scalar_potency
from common.voigt import tensor_from_voigt
from verification.answers.peers.printed import lowering
from verification.answers.peers.slope import Slope, limits, rests
from verification.cavities.figure import draw_blocks
from verification.cavities.runs import Run
from verification.plots import plot_cells, plot_series
from verification.results import Results, Variant

LAST_ROW_HEIGHT = 3.6  # Height of the row of roof and slope, inches.
SHEAR_COLOUR_LIMITS = 1e-3, 1e-1  # Plastic shear that the colours of the slope span.
MIN_DRAWN_SHEAR = 1e-12  # Stands for no plastic shear on the logarithmic scale.
SPIRAL_MARGIN = 4.0  # Ground shown around the spiral, m.
AXIS_TOP = 1e7  # End of the axis of iterations: the legend covers no point.


def draw(results: Results, runs: list[Run]) -> Figure:
    """Blocks of holes, and a row of roof and slope."""
    settings = results.settings
    roofs, slopes = results.present(settings["roof"]), results.present(settings["slope"]["factors"])
    panels = len(roofs) + 2 * bool(slopes)
    figure, last = draw_blocks([(run.name, [run]) for run in runs], LAST_ROW_HEIGHT if panels else 0.0)
    if panels:
        axes = list(last.subplots(1, panels, squeeze=False)[0])
        for name in roofs:
            roof(axes.pop(0), results[name], settings["roof"][name])
        if slopes:
            band(last, axes.pop(0), results, slopes)
            work(axes.pop(0), results, slopes)
    return figure


def band(part, axes, results: Results, names: list[str]) -> None:
    """Plastic shear at the largest factor with an equilibrium, and the critical log spiral."""
    settings, (stands, _) = results.settings["slope"], limits(results)
    name = next((one for one in names if settings["factors"][one] == stands), names[0])
    variant = results[name]
    state, grid = variant.last, variant.grid
    there = state.volume.values > 0.0
    cell = state.cell.values[there]
    shear = scalar_potency(tensor_from_voigt(state.plastic_strain.values[there]))
    drawn = plot_cells(
        axes,
        grid.cell_origin.values[cell][:, [0, 2]],
        grid.cell_size.values[cell],
        np.maximum(shear, MIN_DRAWN_SHEAR),
        norm="log",
        clim=SHEAR_COLOUR_LIMITS,
        cmap=colormaps["viridis_r"].with_extremes(under=style.FILL),
    )
    part.colorbar(drawn, ax=axes, label="plastic shear", orientation="horizontal", shrink=0.8, extend="both")
    toe = np.array(variant.values["excavations"][0]["points"][1])
    spiral = Slope(**settings["rock"]).spiral().points() + toe
    axes.plot(*spiral.T, color=style.RECORDED, linestyle="--")
    low, high = spiral.min(axis=0) - SPIRAL_MARGIN, spiral.max(axis=0) + SPIRAL_MARGIN
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x (m)", ylabel="z (m)")
    axes.set_title(f"slope at {settings['factors'][name]:g} (dashed: log spiral)")


def roof(axes, variant: Variant, printed: float) -> None:
    """Subsidence of surface and roof along the panel."""
    panel, top = variant.values["excavations"][0]["upper"], variant.values["domain"]["upper"]
    lines = {}
    for name, height, reach in (("surface", top[1], top[0]), ("roof", panel[1], panel[0])):
        x = np.linspace(0.0, reach, 200)
        lines[name] = x, lowering(variant, height, x)
    axes.axhline(printed, color=style.OUTLINE, linestyle="--", label="printed for the roof")
    axes.invert_yaxis()
    labels = {"title": "MOOSE's panel", "xlabel": "from the middle of the panel (m)", "ylabel": "came down (m)"}
    plot_series(axes, lines, marks="-", **labels)


def work(axes, results: Results, names: list[str]) -> None:
    """Iterations by factor with and without an equilibrium, Newton steps of the peer, and the limits as lines."""
    settings, series = results.settings["slope"], {}
    for at_rest, label in ((True, "ours, comes to rest"), (False, "ours, finds no rest")):
        some = [name for name in names if rests(results[name]) == at_rest]
        iterations = [results[name].last.attrs["iterations"] for name in some]
        series[label] = [settings["factors"][name] for name in some], iterations
    series["their Newton steps"] = [*settings["newton"]], [*settings["newton"].values()]
    axes.axvline(settings["limit"], color=style.RECORDED, linewidth=0.8, label="their limit")
    bound = Slope(**settings["rock"]).limit()
    axes.axvline(bound, color=style.OUTLINE, linestyle="--", linewidth=0.8, label="log spiral")
    labels = {"title": "iterations to rest", "xlabel": "factor of strength", "ylabel": "iterations"}
    colours = style.MODELLED, style.MODELLED, style.RECORDED
    plot_series(axes, series, marks=("o", "x", "."), colours=colours, legend="upper left", yscale="log", **labels)
    axes.set_ylim(top=AXIS_TOP)
