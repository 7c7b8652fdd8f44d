"""A state on its grid, and the solids, as VTK files."""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import xarray as xr

from common.datasets import atomic_path
from common.vtk import TENSOR_ORDER, write_mesh
from mpm_core.files.state_datasets import embed
from mpm_core.geometry.solids import Outside, Solid
from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.distorted_cells import distorted_cells
from mpm_core.grid.edge_nodes import EdgeNodes
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.model.occupancy import FinestPieces
from mpm_core.scene.scene import PLANES

TENSORS_PER_CHUNK = 1 << 18  # Tensors whose principal directions are computed at once.
CELL_FIELDS = {  # of the rock in a cell, by volume: field, its name with its unit
    "stress": "stress_Pa",
    "plastic_strain": "plastic_strain",
    "strength_factor": "strength_factor",
    "excess_shear_stress": "excess_shear_stress_Pa",
}
INDEX = {"excavations": "excavation", "rock_bodies": "rock_body"}  # groups of solids: array of a solid's number


def write_vtu(
    grid: MultiLevelGrid, pieces: FinestPieces, edge_nodes: EdgeNodes, state: xr.Dataset, path: str | os.PathLike
) -> None:
    """Write cells with the mean of their rock's fields and the step of its failure, and nodal displacement, as VTU.

    fraction_of_<material>: share of a cell that this rock or fill has; material: number, in the order of these
    arrays, of the one that has most, -1 where nothing is. Principal stresses count from the most compressive (1: the
    most negative) to the least (3), each with its direction.
    """
    cells = len(grid.cell_level)
    cell, volume = state.cell.values, state.volume.values
    distorted = distorted_cells(grid, edge_nodes.place, edge_nodes.shift)
    full = grid.cell_size**grid.dimension * state.attrs["thickness"] * distorted.volumes(np.arange(cells))
    data = {
        "level": grid.cell_level.astype(np.int32),
        "solid_fraction": np.bincount(cell, volume, minlength=cells) / full,
        "excavation": main_excavation(pieces, grid),
    }
    names = json.loads(state.attrs["material_names"])
    share = np.zeros((len(names), cells))
    np.add.at(share, (state.material.values, cell), volume / full[cell])
    data["material"] = np.where(share.any(axis=0), share.argmax(axis=0), -1).astype(np.int32)
    data |= {f"fraction_of_{name}": row for name, row in zip(names, share.astype(np.float32), strict=True)}
    rock = (state.excavation.values < 0) & (volume > 0.0)
    data["failed_in_step"] = np.full(cells, -1, np.int32)
    np.maximum.at(data["failed_in_step"], cell[rock], state.failed.values[rock])
    weight = np.where(rock, volume, 0.0)
    rock_volume = np.bincount(cell, weight, minlength=cells)
    means = {}
    for field in CELL_FIELDS:
        values = state[field].values.reshape(len(cell), -1)
        sums = np.stack([np.bincount(cell, weight * column, minlength=cells) for column in values.T], axis=1)
        means[field] = sums / np.where(rock_volume > 0.0, rock_volume, 1.0)[:, None]
    data |= {
        name: means[field][:, TENSOR_ORDER] if means[field].shape[1] == 6 else means[field][:, 0]
        for field, name in CELL_FIELDS.items()
    }
    size, direction = principal(means["stress"])
    for number in range(3):
        data[f"principal_stress_{number + 1}_Pa"] = size[:, number]
        data[f"principal_direction_{number + 1}"] = direction[:, number]
    write_mesh(
        path,
        state.node_position.values,
        "hexahedron" if grid.dimension == 3 else "quad",
        grid.vtk_nodes,
        {"displacement_m": state.node_displacement.values},
        data,
    )


def main_excavation(pieces: FinestPieces, grid: MultiLevelGrid) -> np.ndarray:
    """Excavation, mined or planned, that has most of each cell: (cell,) int32, -1 none; the first of equal ones.

    A coarse cell is that of the part in it that is taken most.
    """
    share = np.bitwise_count(pieces.samples)
    order = np.lexsort((-pieces.excavation.astype(np.int32), share))
    found = np.full(len(grid.cell_level), -1, np.int32)
    found[holding_cells(grid, pieces.place)[order]] = pieces.excavation[order]  # the last of a cell stays
    return found


def principal(stress: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal values (n, 3) ascending, and their directions (n, 3, xyz), of tensors (n, 6) xx, yy, zz, yz, xz, xy.

    Directions are unit vectors that do not point up; those of a tensor of zeros are zero.
    """
    size, direction = np.empty((len(stress), 3)), np.empty((len(stress), 3, 3))
    for start in range(0, len(stress), TENSORS_PER_CHUNK):
        part = slice(start, start + TENSORS_PER_CHUNK)
        size[part], vectors = np.linalg.eigh(stress[part][:, [0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(-1, 3, 3))
        direction[part] = vectors.transpose(0, 2, 1)
    direction *= np.where(direction[:, :, 2:] > 0.0, -1.0, 1.0)
    direction[~stress.any(axis=1)] = 0.0
    return size, direction


def write_solids(
    groups: dict[str, list[Solid | Outside]], plane: str | None, mined: Sequence[int], path: str | os.PathLike
) -> None:
    """Write the surfaces of solids as one VTU each, and `path`, a VTM that names them, in groups, for ParaView.

    groups: "excavations", "rock_bodies", in the configuration's order; mined (excavation,): index of the step that
    mines each, -1 a planned one.
    """
    path = Path(path)
    root = ElementTree.Element("VTKFile", type="vtkMultiBlockDataSet", version="1.0")
    blocks = ElementTree.SubElement(root, "vtkMultiBlockDataSet")
    for number, (group, solids) in enumerate(groups.items()):
        if not solids:
            continue
        block = ElementTree.SubElement(blocks, "Block", index=str(number), name=group)
        for index, solid in enumerate(solids):
            solid = solid.solid if isinstance(solid, Outside) else solid
            facets = len(solid.facets)
            data = {INDEX[group]: np.full(facets, index, np.int32)}
            if group == "excavations":
                data["mined_in_step"] = np.full(facets, mined[index], np.int32)
            file = Path(path.stem, group, f"{solid.name}.vtu")
            kind = "triangle" if solid.dimension == 3 else "line"
            write_mesh(path.parent / file, embed(solid.vertices, PLANES[plane]), kind, solid.facets, cell_data=data)
            ElementTree.SubElement(block, "DataSet", index=str(index), name=solid.name, file=file.as_posix())
    ElementTree.indent(root)
    with atomic_path(path) as temporary:
        ElementTree.ElementTree(root).write(temporary, encoding="utf-8", xml_declaration=True)
