"""A state on its grid as a VTK file, for ParaView and its kin."""

import os

import meshio
import numpy as np
import xarray as xr

from mpm_core.datasets import embed
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.scene import PLANES
from pipeline.datasets import atomic_path

CELL_FIELDS = ("stress", "strength_factor", "plastic_strain")


def write_vtu(grid: MultiLevelGrid, state: xr.Dataset, path: str | os.PathLike) -> None:
    """Write cells with the mean of their rock's fields and the step of its failure, and nodal displacement, as VTU."""
    cells = len(grid.cell_level)
    cell, volume = state.cell.values, state.volume.values
    total = np.bincount(cell, volume, minlength=cells)
    plane = None if state.attrs["plane"] == "none" else state.attrs["plane"]
    full = grid.cell_size**grid.dimension * state.attrs["thickness"]
    data = {"level": grid.cell_level.astype(np.int32), "solid_fraction": total / full}
    rock = (state.excavation.values < 0) & (volume > 0.0)
    data["failed"] = np.full(cells, -1, np.int32)
    np.maximum.at(data["failed"], cell[rock], state.failed.values[rock])
    weight = np.where(rock, volume, 0.0)
    rock_volume = np.bincount(cell, weight, minlength=cells)
    for name in CELL_FIELDS:
        values = state[name].values.reshape(len(cell), -1)
        means = [np.bincount(cell, weight * column, minlength=cells) for column in values.T]
        data[name] = np.stack(means, axis=1) / np.where(rock_volume > 0.0, rock_volume, 1.0)[:, None]
    points = embed(grid.node_position, PLANES[plane])
    kind = "hexahedron" if grid.dimension == 3 else "quad"
    mesh = meshio.Mesh(
        points,
        [(kind, grid.cell_nodes)],
        point_data={"displacement": state.node_displacement.values},
        cell_data={name: [values] for name, values in data.items()},
    )
    with atomic_path(path) as temporary:
        mesh.write(temporary, file_format="vtu")
