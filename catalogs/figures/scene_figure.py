"""The scene: cells coloured by level, and the share of each cell that an excavation takes."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from catalogs.figures import panels, style, views


def grid_levels(grid: xr.Dataset, cut_views: list[views.View]) -> Figure:
    """Plan and sections through the whole domain, cells coloured by level."""
    lower, upper = views.domain(grid)
    figure, array, _ = panels.panels(cut_views, lower, upper)
    level, size = grid["cell_level"].values, grid["cell_size"].values
    colours = style.level_colours(int(grid.attrs["levels"]))
    for axes, view in zip(array, cut_views, strict=True):
        cells = views.cut_cells(grid, view)
        coarse = views.edges_help(axes, float(size[cells].min()))
        views.draw_squares(
            axes, grid["cell_origin"].values[cells][:, view.axes], size[cells], facecolors=colours(level[cells]),
            **({"edgecolors": "white", "linewidths": 0.3} if coarse else {}),
        )  # fmt: skip
        views.draw_excavations(axes, grid, view, fill=False, colour="k")
        views.mark_cuts(axes, view, cut_views)
    handles = [
        Patch(color=colours(index), label=f"level {index}: {float(grid.attrs['coarse_cell']) / 2**index:g} m")
        for index in range(int(grid.attrs["levels"]))
    ]
    panels.key(figure, handles)
    return figure


def excavated_share(grid: xr.Dataset, cut_views: list[views.View], planned: list[int]) -> Figure:
    """The same cuts near the excavations: the share of each cell inside an excavation, planned ones dashed."""
    lower, upper = views.frame_limits(grid, [])
    figure, array, bar = panels.panels(cut_views, lower, upper, bar=True)
    drawn = None
    for axes, view in zip(array, cut_views, strict=True):
        cells = views.cut_cells(grid, view)
        corner, size = grid["cell_origin"].values[cells][:, view.axes], grid["cell_size"].values[cells]
        if views.edges_help(axes, float(size.min())):
            views.draw_squares(
                axes, corner, size, facecolors="none", edgecolors="#e4e4e4", linewidths=0.3, antialiaseds=True
            )
        corner, size, share = views.silhouette(grid, view)
        drawn = views.draw_squares(axes, corner, size, array=share, cmap="cividis_r", clim=(0, 1))
        views.draw_excavations(axes, grid, view, planned, fill=False)
        views.mark_cuts(axes, view, cut_views)
    figure.colorbar(drawn, cax=bar, label="share excavated (1)")
    return figure


def level_table(grid: xr.Dataset) -> list[dict]:
    """Cells per level: level, edge (m), number, share of the cells and share of the domain's volume."""
    level, size = grid["cell_level"].values.astype(int), grid["cell_size"].values.astype(float)
    volume = size ** int(grid.attrs["dimension"])
    rows = []
    for index in np.unique(level):
        here = level == index
        rows.append(
            {
                "level": int(index),
                "edge": float(size[here][0]),
                "cells": int(here.sum()),
                "cell_share": float(here.mean()),
                "volume_share": float(volume[here].sum() / volume.sum()),
            }
        )
    return rows
