"""Grid and state to and from the dataset contract: always three coordinates and six stress components.

One table, FIELDS, names, measures and documents every field that a dataset of this package holds.
"""

import json
from collections.abc import Sequence

import numpy as np
import xarray as xr

from common.errors import InputError
from common.fields import Field
from common.voigt import NAMES
from mpm_core.constitutive.laws import plane_normals
from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.geometry.meshes import join
from mpm_core.geometry.solids import Outside, Solid
from mpm_core.grid.distorted_cells import DistortedCells, distorted_cells
from mpm_core.grid.edge_nodes import EdgeNodes
from mpm_core.grid.edge_points import EdgePoints
from mpm_core.grid.mesh import CORNER_OFFSETS, MultiLevelGrid
from mpm_core.kernels.nodal_operations import interpolate
from mpm_core.model.model import Model
from mpm_core.model.occupancy import FinestPieces, Unsupported
from mpm_core.model.state import ARRAYS, PARTICLES, TENSORS, State
from mpm_core.scene.scene import PLANES, Scene

CELLS = ("cell",)
STORED = {array.field.name: array.field for array in ARRAYS.values() if array.stored}
"""what the files have of a state, as declared there"""
CONVENTIONS = {
    "Conventions": "CF-1.11 UGRID-1.0",
    "stress_sign": "tension positive",
    "voigt": f"{' '.join(NAMES)}, tensor shear",
}


def _table(*entries: Field | str) -> dict[str, Field]:
    """Fields by name, in the order of the files; a name: of a state's, of which those that are not named come last."""
    table: dict[str, Field] = {}
    for entry in entries:
        table |= {entry: STORED[entry]} if isinstance(entry, str) else {entry.name: entry}
    return table | {name: entry for name, entry in STORED.items() if name not in table}


FIELDS = _table(
    # cells: of grid.nc, of which the first step starts, and of each state
    Field("cell_origin", ("cell", "xyz"), np.float64, "m", "lower corner of each cell"),
    Field("cell_size", CELLS, np.float64, "m", "edge of each cell"),
    Field("cell_level", CELLS, np.int8, "1", "level, 0 coarsest"),
    Field("cell_nodes", ("cell", "corner"), np.int32, "1", "nodes at the corners, VTK hexahedron or quad order"),
    Field("cell_body", CELLS, np.int16, "1", "index of the rock body, -1 host"),
    Field(
        "node_position",
        ("node", "xyz"),
        np.float64,
        "m",
        "place of each node",
    ),
    Field("node_parents", ("node", "parent"), np.int32, "1", "a hanging node moves with the mean of these, -1 none"),
    Field("piece_origin", ("piece", "xyz"), np.float64, "m", "lower corner of a finest cell, partly in an excavation"),
    Field("piece_excavation", ("piece",), np.int16, "1", "index of that excavation"),
    Field(
        "piece_samples",
        ("piece",),
        np.uint64,
        "1",
        "64 points of the cell, one bit each, those of the part: two parts of a cell have the same or none in common",
    ),
    Field("piece_fraction", ("piece",), np.float64, "1", "share of these points that are of the part"),
    Field("piece_volume", ("piece",), np.float64, "m3", "volume of the part, in the cell as moved nodes distort it"),
    Field("solid_position", ("solid_vertex", "xyz"), np.float64, "m", "vertices of the solids of excavations"),
    Field(
        "solid_facets",
        ("solid_facet", "facet_corner"),
        np.int32,
        "1",
        "vertices of each triangle (in a plane: segment) around an excavation; none of one that is `outside` a solid",
    ),
    Field("solid_excavation", ("solid_facet",), np.int16, "1", "index of that excavation"),
    Field("edge_node_place", ("edge_node", "xyz"), np.float64, "m", "place of each node that is moved onto an edge"),
    Field("edge_node_shift", ("edge_node", "xyz"), np.float64, "m", "how far it is moved"),
    Field("edge_point_place", ("edge_point", "xyz"), np.float64, "m", "points along the sharp edges of excavations"),
    Field("edge_point_angle", ("edge_point",), np.float64, "rad", "angle that rock fills around the edge"),
    Field("edge_point_excavation", ("edge_point",), np.int16, "1", "index of the excavation whose edge it is"),
    Field("edge_point_shares_nodes", ("edge_point",), np.int8, "1", "1 where nodes carry the motion of both its walls"),
    # elastic.nc and steps/<step>.nc
    "position",
    "cell",
    Field("spacing", PARTICLES, np.float64, "m", "distance to its neighbours in the same cell, or the cell's edge"),
    Field("volume", PARTICLES, np.float64, "m3", "volume of the particle's own material; 0 once mined"),
    Field("material", PARTICLES, np.int16, "1", "index into the attribute material_names"),
    Field("excavation", PARTICLES, np.int16, "1", "excavation whose fill this is, -1 rock"),
    Field("displacement", ("particle", "xyz"), np.float64, "m", "displacement since virgin"),
    "stress",
    "failed",
    "failure_order",
    "seismic_strain",
    "overshoot_strain",
    "later_strain",
    Field("plastic_strain_step", TENSORS, np.float64, "1", "plastic strain of this step: the three above together"),
    "plastic_strain",
    Field("strength_factor", PARTICLES, np.float64, "1", "strength over stress, at most 10; 10 where nothing can fail"),
    Field("excess_shear_stress", PARTICLES, np.float64, "Pa", "largest shear stress above strength over all planes"),
    "node_displacement",
    "node_velocity",
    "hourglass_force",
    Field("loose_cell", ("loose",), np.int32, "1", "cell of each part that has come loose so far, and fallen"),
    Field("loose_samples", ("loose",), np.uint64, "1", "64 points of the cell, one bit each: loose or not"),
    Field("loose_step", ("loose",), np.int32, "1", "index of the step in which it came loose"),
    Field("loose_piece", ("loose",), np.int32, "1", "piece among those of that step"),
    Field("loose_fall", ("loose",), np.int32, "1", "fall of that step, 1 first; 0 of what no opening left a support"),
    Field("convergence_increment", ("iteration",), np.int32, "1", "increment of the ramp, 1 first"),
    Field("convergence_generation", ("iteration",), np.int32, "1", "generation of failure within the increment"),
    Field("convergence_iteration", ("iteration",), np.int32, "1", "iteration of the stage at this check"),
    Field("convergence_unbalanced_ratio", ("iteration",), np.float64, "1", "unbalanced force over load, 2-norms"),
    Field("convergence_max_ratio", ("iteration",), np.float64, "1", "largest unbalanced force over the same"),
    Field("convergence_cells", ("iteration",), np.int32, "1", "cells relaxed: all, or a part of the mine alone"),
    Field("convergence_load", ("iteration",), np.float64, "1", "share of the step's load at the end of the increment"),
    Field("convergence_new_failures", ("iteration",), np.int32, "1", "particles that failed after this check"),
)


def variable(name: str, values: np.ndarray) -> xr.Variable:
    """A variable of the table with its attributes. Raises InputError if a number in it is not finite."""
    field = FIELDS[name]
    values = np.ascontiguousarray(values, dtype=field.dtype)
    if field.dtype == np.float64 and not np.isfinite(values).all():
        raise InputError(
            f"{name}: not a number at {int((~np.isfinite(values)).sum())} places; the state is not written"
        )
    return xr.Variable(field.dims, values, {"units": field.unit, "long_name": field.meaning})


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


def _cells(
    grid: MultiLevelGrid, distorted: DistortedCells, body: np.ndarray, axes: tuple[int, ...]
) -> dict[str, np.ndarray]:
    """Variables of cells and nodes, by name."""
    return {
        "cell_origin": embed(grid.cell_origin, axes),
        "cell_size": grid.cell_size,
        "cell_level": grid.cell_level,
        "cell_nodes": grid.vtk_nodes,
        "cell_body": body,
        "node_position": embed(distorted.node_positions(grid), axes),
        "node_parents": grid.node_parents,
    }


def _of_domain(grid: MultiLevelGrid, axes: tuple[int, ...]) -> dict:
    """Attributes of a dataset with cells."""
    return {
        "dimension": grid.dimension,
        "domain_lower": embed(grid.origin, axes),
        "domain_upper": embed(grid.origin + grid.shape * grid.fine_cell, axes),
        "coarse_cell": grid.fine_cell * 2 ** (grid.levels - 1),
        "fine_cell": grid.fine_cell,
        "levels": grid.levels,
        "phantom_nodes": grid.phantoms,
    }


def _mesh(dimension: int) -> xr.Variable:
    """UGRID's variable that says which others are the mesh."""
    topology = "face" if dimension == 2 else "volume"
    attributes = {
        "cf_role": "mesh_topology",
        "topology_dimension": dimension,
        "node_coordinates": "node_position",
        f"{topology}_node_connectivity": "cell_nodes",
    }
    return xr.Variable((), np.int32(0), attributes)


def grid_dataset(
    grid: MultiLevelGrid,
    body: np.ndarray,
    pieces: FinestPieces,
    volume: np.ndarray,
    edge_nodes: EdgeNodes,
    edge_points: EdgePoints,
    plane: str | None,
    attributes: dict,
    solids: Sequence[Solid | Outside] = (),
) -> xr.Dataset:
    """The dataset of grid.nc. pieces: divided where excavations overlap, with their volumes (piece,) m3; attributes:
    excavation names and volumes, thickness, provenance; solids: of the excavations, whose surfaces pictures show."""
    axes = PLANES[plane]
    distorted = distorted_cells(grid, edge_nodes.place, edge_nodes.shift)
    values = _cells(grid, distorted, body, axes) | {
        "piece_origin": embed(grid.origin + pieces.place * grid.fine_cell, axes),
        "piece_excavation": pieces.excavation,
        "piece_samples": pieces.samples,
        "piece_fraction": np.bitwise_count(pieces.samples) / SAMPLES_PER_CELL,
        "piece_volume": volume,
        "edge_node_place": embed(grid.origin + edge_nodes.place * grid.fine_cell, axes),
        "edge_node_shift": embed(edge_nodes.shift * grid.fine_cell, axes),
        "edge_point_place": embed(grid.origin + edge_points.place * grid.fine_cell, axes),
        "edge_point_angle": edge_points.angle,
        "edge_point_excavation": edge_points.excavation,
        "edge_point_shares_nodes": edge_points.shares_nodes,
        **_surfaces(solids, axes),
    }
    dataset = xr.Dataset({name: variable(name, array) for name, array in values.items()})
    dataset.attrs = CONVENTIONS | {"plane": plane or "none", **_of_domain(grid, axes), **attributes}
    dataset["mesh"] = _mesh(grid.dimension)
    return dataset


def _surfaces(solids: Sequence[Solid | Outside], axes: tuple[int, ...]) -> dict[str, np.ndarray]:
    """Variables of the surfaces of solids, by name: those of all solids, one after the other."""
    nothing = np.empty((0, len(axes))), np.empty((0, len(axes)), np.int32)
    meshes = [(one.vertices, one.facets) if isinstance(one, Solid) else nothing for one in solids]
    vertices, facets = join([nothing, *meshes])
    owner = np.repeat(np.arange(len(meshes)), [len(own) for _, own in meshes])
    return {"solid_position": embed(vertices, axes), "solid_facets": facets, "solid_excavation": owner}


def read_grid(dataset: xr.Dataset) -> tuple[MultiLevelGrid, np.ndarray]:
    """Grid and rock body of each cell, from the dataset of grid.nc or of a state."""
    attributes, axes = dataset.attrs, _axes(dataset)
    origin, fine = read_origin(dataset)
    cell_index, level, vtk_nodes = _index(dataset, "cell_origin"), dataset.cell_level.values, dataset.cell_nodes.values
    width = np.int32(1) << (int(attributes["levels"]) - 1 - level).astype(np.int32)
    node_index = np.empty((dataset.sizes["node"], len(axes)), np.int32)  # not by positions: some nodes are moved
    for corner, offset in enumerate(CORNER_OFFSETS[len(axes)]):
        node_index[vtk_nodes[:, corner]] = cell_index + offset * width[:, None]
    grid = MultiLevelGrid(
        origin=origin,
        fine_cell=fine,
        levels=int(attributes["levels"]),
        shape=np.rint((np.asarray(attributes["domain_upper"])[axes] - origin) / fine).astype(np.int64),
        cell_index=cell_index,
        cell_level=level,
        vtk_nodes=vtk_nodes,
        node_index=node_index,
        node_parents=dataset.node_parents.values,
        phantoms=int(attributes.get("phantom_nodes", 0)),
    )
    return grid, dataset.cell_body.values


def read_origin(dataset: xr.Dataset) -> tuple[np.ndarray, float]:
    """Lower corner of the domain (d,) and edge of a finest cell, m, from the dataset of grid.nc or of a state."""
    return np.asarray(dataset.attrs["domain_lower"])[_axes(dataset)], float(dataset.attrs["fine_cell"])


def read_pieces(dataset: xr.Dataset) -> FinestPieces:
    """The parts of finest cells that excavations remove, from the dataset of grid.nc: one for each excavation and
    cell."""
    places = _index(dataset, "piece_origin")
    return FinestPieces(places, dataset.piece_excavation.values, dataset.piece_samples.values).together()


def read_edge_nodes(dataset: xr.Dataset) -> EdgeNodes:
    """Nodes that lie on edges of excavations, from the dataset of grid.nc."""
    shift = dataset.edge_node_shift.values[:, _axes(dataset)] / read_origin(dataset)[1]
    return EdgeNodes(_index(dataset, "edge_node_place"), shift)


def read_edge_points(dataset: xr.Dataset) -> EdgePoints:
    """Points along edges of excavations, from the dataset of grid.nc."""
    origin, fine = read_origin(dataset)
    place = (dataset.edge_point_place.values[:, _axes(dataset)] - origin) / fine
    shares_nodes = dataset.edge_point_shares_nodes.values.astype(bool)
    return EdgePoints(place, dataset.edge_point_angle.values, dataset.edge_point_excavation.values, shares_nodes)


def _axes(dataset: xr.Dataset) -> list[int]:
    plane = dataset.attrs["plane"]
    return list(PLANES[None if plane == "none" else plane])


def _index(dataset: xr.Dataset, name: str) -> np.ndarray:
    """Places (n, d) int32 in fine units of a variable of places, m."""
    values = dataset[name].values[:, _axes(dataset)]
    origin, fine = read_origin(dataset)
    values -= origin
    values /= fine
    return np.rint(values, out=values).astype(np.int32, order="C")  # taking axes has turned them round


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
        interpolate(model.cell_nodes, particles.cell, particles.row, particles.modes, state.displacement, displacement)
    step_strain = state.seismic_strain + state.overshoot_strain + state.later_strain
    present = (volume > 0.0)[:, None]
    values = {array.field.name: getattr(state, name) for name, array in ARRAYS.items() if array.stored} | {
        "stress": np.where(present, state.stress + model.insitu, 0.0),
        "plastic_strain": state.plastic_strain + step_strain,
        "plastic_strain_step": step_strain,
        "spacing": particles.spacing,
        "volume": volume * scene.thickness,
        "material": model.material,
        "excavation": particles.excavation,
        "displacement": displacement,
        "strength_factor": rating[0],
        "excess_shear_stress": rating[1],
        **{f"loose_{name}": column for name, column in vars(model.unsupported).items()},
        **{f"convergence_{name}": column for name, column in table.items()},
    }
    values = {name: _to_file(array, FIELDS[name].dims, scene) for name, array in values.items()}
    values |= _cells(model.grid, model.particles.distorted, model.body, scene.axes)
    dataset = xr.Dataset({name: variable(name, values[name]) for name in FIELDS if name in values})
    dataset["mesh"] = _mesh(model.dimension)
    rocks, host = scene.materials, scene.materials["host"]
    dataset.attrs = CONVENTIONS | {
        "mine": scene.mine,
        "plane": scene.plane or "none",
        **_of_domain(model.grid, scene.axes),
        "thickness": scene.thickness,
        "material_names": json.dumps(list(scene.materials)),
        "elastic_moduli": json.dumps({name: [rock.lame_lambda, rock.shear_modulus] for name, rock in rocks.items()}),
        "lame_lambda": host.lame_lambda,
        "shear_modulus": host.shear_modulus,
        "tolerance": scene.solver.tolerance,
        "scheme": scene.solver.scheme,
        "parts": scene.solver.parts,
        **attributes,
    }
    if normals := plane_normals(scene.materials):
        dataset.attrs["plane_normals"] = json.dumps(normals)
    return dataset


def read_unsupported(dataset: xr.Dataset) -> Unsupported:
    """Rock and fill that have lost their support until the end of a stage, from its dataset."""
    return Unsupported(**{name: dataset[f"loose_{name}"].values for name in vars(Unsupported.none())})


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
