"""Grid and state to and from the dataset contract: always three coordinates and six stress components."""

import json

import numpy as np
import xarray as xr

from mpm_core.constitutive.laws import plane_normals
from mpm_core.fields import FIELDS, variable
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.kernels.nodes import interpolate
from mpm_core.model import Model
from mpm_core.occupancy import SAMPLES, Loose, Pieces
from mpm_core.scene import PLANES, Scene
from mpm_core.state import ARRAYS, State
from pipeline.errors import InputError
from pipeline.voigt import NAMES

CONVENTIONS = {
    "Conventions": "CF-1.11 UGRID-1.0",
    "stress_sign": "tension positive",
    "voigt": f"{' '.join(NAMES)}, tensor shear",
}


def embed(values: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    """Vectors (n, d) of the computation's axes as (n, 3) of the mine's frame, 0 out of plane."""
    if values.shape[-1] == 3:
        return values
    result = np.zeros((*values.shape[:-1], 3))
    result[..., list(axes)] = values
    return result


def reorder(tensors: np.ndarray, voigt: list[int]) -> np.ndarray:
    """Components (n, 6) in another order; the array itself where it is the same."""
    return tensors if voigt == sorted(voigt) else tensors[:, voigt]


def _to_file(values: np.ndarray, dims: tuple[str, ...], scene: Scene) -> np.ndarray:
    """An array in the computation's axes as files have it."""
    if dims[-1] == "xyz":
        return embed(values, scene.axes)
    return reorder(values, scene.voigt) if dims[-1] == "voigt" else values


def grid_dataset(
    grid: MultiLevelGrid, body: np.ndarray, pieces: Pieces, plane: str | None, attributes: dict
) -> xr.Dataset:
    """The dataset of grid.nc. attributes: excavation names and volumes, thickness, provenance."""
    axes = PLANES[plane]
    values = {
        "cell_origin": embed(grid.cell_origin, axes),
        "cell_size": grid.cell_size,
        "cell_level": grid.cell_level,
        "cell_nodes": grid.vtk_nodes,
        "cell_body": body,
        "node_position": embed(grid.node_position, axes),
        "node_parents": grid.node_parents,
        "piece_cell": pieces.cell,
        "piece_excavation": pieces.excavation,
        "piece_samples": pieces.samples,
        "piece_fraction": np.bitwise_count(pieces.samples) / SAMPLES,
    }
    dataset = xr.Dataset({name: variable(name, array) for name, array in values.items()})
    dataset.attrs = CONVENTIONS | {
        "dimension": grid.dimension,
        "plane": plane or "none",
        "domain_lower": embed(grid.origin, axes),
        "domain_upper": embed(grid.origin + grid.shape * grid.fine_cell, axes),
        "coarse_cell": grid.fine_cell * 2 ** (grid.levels - 1),
        "fine_cell": grid.fine_cell,
        "levels": grid.levels,
        **attributes,
    }
    topology = "face" if grid.dimension == 2 else "volume"
    dataset["mesh"] = xr.Variable(
        (),
        np.int32(0),
        {
            "cf_role": "mesh_topology",
            "topology_dimension": grid.dimension,
            "node_coordinates": "node_position",
            f"{topology}_node_connectivity": "cell_nodes",
        },
    )
    return dataset


def read_grid(dataset: xr.Dataset) -> tuple[MultiLevelGrid, np.ndarray, Pieces]:
    """Grid, rock body of each cell and pieces, from the dataset of grid.nc."""
    attributes = dataset.attrs
    plane = None if attributes["plane"] == "none" else attributes["plane"]
    axes = list(PLANES[plane])
    origin, fine = np.asarray(attributes["domain_lower"])[axes], float(attributes["fine_cell"])

    def index(positions: xr.DataArray) -> np.ndarray:
        values = positions.values[:, axes]
        values -= origin
        values /= fine
        return np.rint(values, out=values).astype(np.int32)

    grid = MultiLevelGrid(
        origin=origin,
        fine_cell=fine,
        levels=int(attributes["levels"]),
        shape=np.rint((np.asarray(attributes["domain_upper"])[axes] - origin) / fine).astype(np.int64),
        cell_index=index(dataset.cell_origin),
        cell_level=dataset.cell_level.values,
        vtk_nodes=dataset.cell_nodes.values,
        node_index=index(dataset.node_position),
        node_parents=dataset.node_parents.values,
    )
    pieces = Pieces(dataset.piece_cell.values, dataset.piece_excavation.values, dataset.piece_samples.values)
    return grid, dataset.cell_body.values, pieces


def state_dataset(
    model: Model, state: State, volume: np.ndarray, rating: tuple[np.ndarray, np.ndarray], table: dict, attributes: dict
) -> xr.Dataset:
    """The dataset of elastic.nc or steps/<step>.nc.

    rating: strength factor and excess shear stress (particle,); table: convergence columns by name.
    """
    scene, particles = model.scene, model.particles
    displacement = np.zeros((particles.count, model.dimension))
    if scene.solver.move:
        displacement = state.position - particles.position
    else:
        interpolate(model.cell_nodes, particles.cell, particles.xi, state.displacement, displacement)
    step_strain = state.seismic_strain + state.overshoot_strain + state.later_strain
    present = (volume > 0.0)[:, None]
    values = {array.field.name: getattr(state, name) for name, array in ARRAYS.items() if array.stored} | {
        "stress": np.where(present, state.stress + model.insitu, 0.0),
        "plastic_strain": state.plastic_strain + step_strain,
        "plastic_strain_step": step_strain,
        "spacing": particles.spacing,
        "volume": volume * scene.thickness,
        "material": particles.material,
        "excavation": particles.excavation,
        "displacement": displacement,
        "strength_factor": rating[0],
        "excess_shear_stress": rating[1],
        **{f"loose_{name}": column for name, column in vars(model.loose).items()},
        **{f"convergence_{name}": column for name, column in table.items()},
    }
    dataset = xr.Dataset(
        {
            name: variable(name, _to_file(values[name], field.dims, scene))
            for name, field in FIELDS.items()
            if name in values
        }
    )
    host = scene.materials["host"]
    dataset.attrs = CONVENTIONS | {
        "mine": scene.mine,
        "plane": scene.plane or "none",
        "thickness": scene.thickness,
        "material_names": json.dumps(list(scene.materials)),
        "lame_lambda": host.lame_lambda,
        "shear_modulus": host.shear_modulus,
        "tolerance": scene.solver.tolerance,
        "scheme": scene.solver.scheme,
        **attributes,
    }
    if normals := plane_normals(scene.materials):
        dataset.attrs["plane_normals"] = json.dumps(normals)
    return dataset


def read_loose(dataset: xr.Dataset) -> Loose:
    """What has come loose until the end of a stage, from its dataset."""
    return Loose(**{name: dataset[f"loose_{name}"].values for name in vars(Loose.none())})


def read_state(dataset: xr.Dataset, model: Model) -> State:
    """State at the start of a stage from the dataset of the stage before; fill placed since starts without stress.

    Raises InputError if the dataset belongs to another grid.
    """
    particles, voigt = model.particles, model.scene.voigt
    first, *_, last = model.scene.axes
    axes = slice(first, last + 1, (last - first) // (model.dimension - 1))  # a view of gigabytes, no copy
    before = dataset.sizes["particle"]
    # particles that move change their cells, but not the spacing they were seeded with
    seeded = "spacing" if model.scene.solver.move else "cell"
    same = dataset.sizes["node"] == len(model.grid.node_index) and before <= particles.count
    if not same or not np.array_equal(dataset[seeded].values, getattr(particles, seeded)[:before]):
        raise InputError("the state of the step before belongs to another grid; run the pipeline from the grid")
    state = model.virgin_state()
    for name, array in ARRAYS.items():
        if not array.stored or array.of_stage or array.start is None:
            continue
        old, own = dataset[array.field.name].values, getattr(state, name)
        if name == "stress":
            np.subtract(reorder(old, voigt), model.insitu[:before], out=own[:before])
        elif name == "plastic_strain":
            failed = np.flatnonzero(state.failed >= 0)  # elsewhere zeros, that take no memory until they are written
            own[failed] = reorder(old[failed], voigt)
        else:
            own[: len(old)] = old[..., axes] if array.dims[-1] == "xyz" else old
    if model.scene.solver.move:
        state.position = np.concatenate([dataset.position.values[:, axes], state.position[before:]])
        state.cell = np.concatenate([dataset.cell.values, state.cell[before:]])
    return state
