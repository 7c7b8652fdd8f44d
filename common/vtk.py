"""VTK files for ParaView and its kin: units stand in the names of arrays, tensors in VTK's own order."""

import os

import meshio
import numpy as np

from common.datasets import atomic_path

# ParaView calls the six components of an array XX, YY, ZZ, XY, YZ, XZ; datasets hold xx, yy, zz, yz, xz, xy.
TENSOR_ORDER = [0, 1, 2, 5, 3, 4]


def write_mesh(
    path: str | os.PathLike,
    points: np.ndarray,
    kind: str,
    cells: np.ndarray,
    point_data: dict[str, np.ndarray] | None = None,
    cell_data: dict[str, np.ndarray] | None = None,
) -> None:
    """Write a VTU file of one kind of cell (meshio's name for it) atomically.

    points (point, 3) m; cells (cell, corner) rows of points; arrays by name, one row per point or cell.
    """
    of_cells = {name: [values] for name, values in (cell_data or {}).items()}
    mesh = meshio.Mesh(points, [(kind, cells)], point_data=point_data, cell_data=of_cells)
    with atomic_path(path) as temporary:
        # nothing compressed is no block at all, which readers stumble over
        mesh.write(temporary, file_format="vtu", compression="zlib" if len(points) else None)
