"""The scene: cells by level, the share of each cell that an excavation takes, and the excavations.

The template is "scene.html.j2".
"""

import json

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from catalogs.figures import panels, style, views
from catalogs.report import sections
from catalogs.report.evidence import Evidence, ExcavationRow
from catalogs.report.gallery import Gallery
from catalogs.report.text import whole

MAX_KINDS_LISTED = 12
MIN_SHARED = 1e-6  # Share of a solid that others mine; less is round-off.


def section(evidence: Evidence, gallery: Gallery) -> dict:
    """Content of the section on the scene: figures of grid levels and excavated share (None without excavations), table
    of levels, sentences on the cap of cells and on the far field, rows of excavations, and rows by step if there are
    many; shared: whether excavations share rock, or mine fill again."""
    cuts, rows = cut_planes(evidence), evidence.excavations
    return {
        "levels": gallery.add("grid_levels", grid_levels(evidence.grid, cuts)),
        "share": gallery.add("excavated_share", excavated_share(evidence.grid, cuts, evidence.planned))
        if evidence.grid.sizes["piece"]
        else None,
        "table": level_table(evidence.grid),
        "above_cap": above_cap(evidence),
        "far_field": far_field(evidence.grid),
        "blocks": block_model(evidence.grid),
        "excavations": rows,
        "shared": any(row.fill_mined > 0.0 or row.drawn - row.mined > MIN_SHARED * row.drawn for row in rows),
        "steps": by_step(rows) if len(rows) > sections.MAX_ROWS_UNFOLDED else [],
    }


def cut_planes(evidence: Evidence) -> list[views.View]:
    """Cut planes through the fullest layers of what the dated steps mine; if nothing is dated, of all that is mined."""
    grid, rows = evidence.grid, evidence.excavations
    wanted = [index for index, row in enumerate(rows) if row.dated] or [
        index for index, row in enumerate(rows) if not row.planned
    ]
    centre, volume = views.piece_centres(grid)
    return views.cuts(grid, centre, volume * np.isin(grid["piece_excavation"].values, wanted))


def by_step(excavations: list[ExcavationRow]) -> list[dict]:
    """One row per step, in the order in which excavations name them: how many, their volumes m3, what misses most.

    worst: the excavation whose volume the grid misses most, error: by which share of the solid's, NaN if none is known;
    planned: whether no step of the run mines them.
    """
    rows: dict[str, list[ExcavationRow]] = {}
    for excavation in excavations:
        rows.setdefault(excavation.step, []).append(excavation)
    return [_row(step, members) for step, members in rows.items()]


def _row(step: str, members: list[ExcavationRow]) -> dict:
    solid, drawn = (np.array([getattr(one, name) for one in members]) for name in ("solid", "drawn"))
    error = np.full(len(members), np.nan)
    np.divide(drawn - solid, solid, out=error, where=solid > 0)
    worst = int(np.nanargmax(np.abs(error))) if np.isfinite(error).any() else 0
    return {
        "step": step,
        "planned": members[0].planned,
        "count": len(members),
        "mined": sum(one.mined for one in members),
        "fill_mined": sum(one.fill_mined for one in members),
        "unheld": sum(one.unheld > 0 for one in members),
        "solid": float(solid.sum()),
        "drawn": float(drawn.sum()),
        "worst": members[worst].name,
        "error": float(error[worst]),
    }


def far_field(grid: xr.Dataset) -> str:
    """Sentences on a domain that follows from its openings: distance of its boundary and error of the stress at walls;
    empty where the domain was given."""
    if "far_field_error" not in grid.attrs:
        return ""
    distance, error = float(grid.attrs["far_field_distance"]), float(grid.attrs["far_field_error"])
    short = {
        "memory": " A larger one would take too much memory on these cells.",
        "strength": " It ends there because virgin rock beyond it is above its strength.",
        "": "",
    }[grid.attrs["far_field_limited"]]
    return (
        f"The domain follows from the openings: its boundary is {distance:.0f} m from the nearest of them. In elastic "
        f"rock it changes the stress at a wall by at most {error:.2g} % of the largest (closed-form estimate).{short}"
    )


def block_model(grid: xr.Dataset) -> str:
    """Sentences on rock from a block model: how many blocks, and the share of the domain that each kind of rock has;
    empty without one."""
    if "block_model" not in grid.attrs:
        return ""
    found = json.loads(grid.attrs["block_model"])
    shares = sorted(found["shares"].items(), key=lambda one: -one[1])
    text = ", ".join(f"{name} {100 * share:.3g} %" for name, share in shares[:MAX_KINDS_LISTED])
    more = len(shares) - MAX_KINDS_LISTED
    text += f" and {more} more" if more > 0 else ""
    beyond = 1.0 - sum(found["shares"].values())
    outside = f" The blocks leave {100 * beyond:.3g} % of the domain free; that is host." if beyond > MIN_SHARED else ""
    return (
        f"The rock is from a block model of {whole(found['blocks'])} blocks. A cell takes the rock of the block that "
        f"its middle lies in. Shares of the domain's volume: {text}.{outside}"
    )


def above_cap(evidence: Evidence) -> str:
    """A sentence where there are more cells than grid.max_cells; else, and on a static grid, empty."""
    grid = evidence.config.get("grid", {})
    if not evidence.stages or grid.get("refinement") != "adaptive":
        return ""
    last = evidence.stages[-1].attrs
    if last["cells"] <= grid["max_cells"]:
        return ""
    return (
        f"The last step has {whole(last['cells'])} cells, more than grid.max_cells ({whole(grid['max_cells'])}). Cells "
        "of openings are refined in any case. Rock that comes near its strength then stays in coarse cells."
    )


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
    """Cuts near the excavations: the share of each cell inside an excavation, planned ones dashed."""
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
