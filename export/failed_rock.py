"""Failed rock of a state as a closed surface in the mine's frame, and as points."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from export.closed_surface import Surface, closed_surface
from export.failed_boxes import failed_boxes, is_failed
from mpm_core.files.state_datasets import read_edge_nodes, read_grid
from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.distorted_cells import corner_offsets, distorted_cells
from mpm_core.scene.scene import PLANES


def failed_surface(state: xr.Dataset, first: xr.Dataset, excavations: list[dict]) -> Surface:
    """Closed surface of the rock that has failed up to the end of a state and is not mined: vertices in m, east, north
    and up.

    It is made of the cells' parts that the failed particles stand for, so it has steps of the size of cells, or of a
    quarter of it where walls or the failed rock divide a cell. A state in a plane is extruded over its thickness, half
    of it to each side. state: dataset of a step; first: of grid.nc; excavations: see failed_boxes.rock_samples.
    """
    boxes = failed_boxes(state, first, excavations)
    plane = state.attrs["plane"]
    axes = PLANES[None if plane == "none" else plane]
    surface = closed_surface(boxes, axes)
    grid = read_grid(state)[0]
    vertices = np.empty((len(surface.vertices), 3))
    own = surface.vertices[:, list(axes)] / boxes.per_cell
    vertices[:, list(axes)] = grid.origin + shifted(own, grid, first) * grid.fine_cell
    for missing in {0, 1, 2} - {*axes}:
        vertices[:, missing] = (surface.vertices[:, missing] - 0.5) * float(state.attrs["thickness"])
    return Surface(vertices, surface.triangles)


def shifted(points: NDArray, grid, first: xr.Dataset) -> NDArray:
    """Points (point, d), fine units, moved with the nodes of cells that are distorted (grid/distorted_cells.py)."""
    edge_nodes = read_edge_nodes(first)
    distorted = distorted_cells(grid, edge_nodes.place, edge_nodes.shift)
    if not len(distorted.cell) or not len(points):
        return points
    place = np.clip(np.floor(points), 0, grid.shape - 1).astype(np.int32)
    row = distorted.rows(holding_cells(grid, place))
    bent = np.flatnonzero(row >= 0)
    local = (points[bent] - place[bent])[:, None, :]
    shape = np.prod(np.where(corner_offsets(grid.dimension) == 1, local, 1.0 - local), axis=2)
    moved = points.astype(float)
    moved[bent] = place[bent] + np.einsum("kc,kcj->kj", shape, distorted.corners[row[bent]])
    return moved


def failed_volume(state: xr.Dataset) -> float:
    """Volume of the failed rock of a state, m3."""
    return float(state["volume"].values[is_failed(state)].sum())
