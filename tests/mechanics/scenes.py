"""Small scenes for the mechanics: grids from analytic shapes, no solids read, no winding numbers."""

import numpy as np

from mpm_core.equilibrium.convergence import History
from mpm_core.equilibrium.explicit_scheme import ExplicitScheme
from mpm_core.files.state_datasets import grid_dataset
from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid import MultiLevelGrid, build_grid
from mpm_core.grid.edge_nodes import EdgeNodes
from mpm_core.grid.edge_points import EdgePoints
from mpm_core.model.model import Model, build_model
from mpm_core.model.occupancy import FinestPieces, Pieces
from mpm_core.model.particles import point_table
from mpm_core.scene.scene import FACES, Scene, parse_scene
from mpm_core.stages.external_forces import external_force

HOST = {"model": "elastic", "youngs_modulus": 57e9, "poisson_ratio": 0.25, "density": 2850.0}
FILL = {"model": "elastic", "youngs_modulus": 1e9, "poisson_ratio": 0.25, "density": 1750.0}
COULOMB = HOST | {  # Table 2 of the paper, with the cut-offs of the demo
    "model": "coulomb",
    "friction_angle": {"intact": 30.0, "residual": 20.0},
    "dilation_angle": {"intact": 10.0, "residual": 10.0},
    "cohesion": {"intact": 2e6, "residual": 1e6},
    "tension_cutoff": {"intact": 1e6, "residual": 0.0},
}
TABLE_2 = {  # Pa and Pa/m, Voigt order xx, yy, zz, yz, xz, xy
    "constant": [0.0, -4.67e6, -0.33e6, -1.25e6, 0.0, 0.0],
    "gradient": [-0.0249e6, -0.0363e6, -0.0278e6, -0.0027e6, 0.0027e6, -0.0007e6],
}
SOLVER = {
    "scheme": "explicit",
    "tolerance": 1e-5,
    "cascade_tolerance": 3e-3,
    "increments": 4,
    "max_iterations": 40000,
    "max_generations": 300,
    "weakest_first": 0.0,
    "collapse": "error",
    "damping": 0.8,
    "density_scaling": True,
    "move": False,
}


def strength_margin(row, virgin, present) -> float:
    """What intact rock at rest may stand above strength by, Pa: 1e-5 of strength and stresses (6,); slow twin."""

    def size(stress):
        return np.sqrt(np.dot(stress, np.array([1, 1, 1, 2, 2, 2]) * stress))

    return 1e-5 * (row[2] + size(np.asarray(virgin)) + size(np.asarray(present)))


def uniform(*stress) -> dict:
    """In-situ stress without gradient: xx, yy, zz, yz, xz, xy, Pa (missing ones 0)."""
    return {"constant": [*stress, *[0.0] * (6 - len(stress))], "gradient": [0.0] * 6}


def excavation(mined: int = 0, fill: str | None = None, filled: int | None = None, name: str = "void") -> dict:
    """An excavation of the scene's slice; a fill is placed when the void is mined unless `filled` says otherwise."""
    return {"name": name, "mined": mined, "fill": fill, "filled": (mined if filled is None else filled) if fill else -1}


def make_scene(
    plane: str | None = None,
    *,
    host: dict = HOST,
    stress: dict | None = None,
    excavations=(),
    steps: int = 1,
    boundary="fixed",
    solver: dict | None = None,
    **changes,
) -> Scene:
    """A Scene through parse_scene, as a stage would get it. `boundary`: one word, or a dict by face."""
    if isinstance(boundary, str):
        boundary = dict.fromkeys(FACES, boundary)
    values = {
        "name": "test",
        "plane": plane,
        "thickness": 1.0,
        "particles_per_cell": 1,
        "cut_cells": "mean",
        "boundary": dict.fromkeys(FACES, "fixed") | boundary,
        "surface": 1000.0,
        "insitu_stress": stress or uniform(),
        "materials": {"host": host, "fill": FILL},
        "rock_bodies": [],
        "excavations": list(excavations),
        "loads": [],
        "steps": [{"name": f"step_{i}", "start": "", "end": ""} for i in range(steps)],
        "solver": SOLVER | (solver or {}),
    }
    return parse_scene(values | changes)


def ball(center, radius):
    """Points within a radius: sphere in 3-D, disc in 2-D."""
    return lambda x: ((x - np.asarray(center)) ** 2).sum(axis=-1) <= radius**2


def box(lower, upper):
    """Points of a box."""
    return lambda x: ((x >= np.asarray(lower)) & (x <= np.asarray(upper))).all(axis=-1)


def grid_around(shapes, base_shape, levels: int, coarse: float, origin=None, rings: int = 1) -> MultiLevelGrid:
    """Grid of base cells of edge `coarse`, refined where a 5 x 5 (x 5) lattice over a cell meets a shape."""
    dimension = len(base_shape)
    origin = np.zeros(dimension) if origin is None else np.asarray(origin, float)
    lattice = 0.5 + 0.5 * point_table(5, dimension) * 5 / 4  # corners and edges included

    def classify(level, index):
        edge = coarse / 2**level
        points = origin + (index[:, None, :] + lattice) * edge
        return np.any([shape(points).any(axis=1) for shape in shapes], axis=0) if shapes else np.zeros(len(index), bool)

    return build_grid(origin, coarse, np.array(base_shape), levels, classify, rings)


def pieces_of(grid: MultiLevelGrid, shapes) -> Pieces:
    """Share of every finest cell in each shape, by 64 samples at sub-cell centres, bits with the first axis fastest."""
    table = point_table(round(SAMPLES_PER_CELL ** (1 / grid.dimension)), grid.dimension)
    finest = np.flatnonzero(grid.cell_level == grid.levels - 1)
    points = grid.cell_center[finest][:, None, :] + 0.5 * grid.fine_cell * table
    bit = np.uint64(1) << np.arange(SAMPLES_PER_CELL, dtype=np.uint64)
    cells, numbers, samples = [], [], []
    for number, shape in enumerate(shapes):
        bits = (shape(points) * bit).sum(axis=1, dtype=np.uint64)
        keep = np.bitwise_count(bits) >= 2
        cells.append(finest[keep])
        numbers.append(np.full(keep.sum(), number))
        samples.append(bits[keep])
    if not shapes:
        return Pieces(np.empty(0, np.int32), np.empty(0, np.int16), np.empty(0, np.uint64))
    return Pieces(
        np.concatenate(cells).astype(np.int32), np.concatenate(numbers).astype(np.int16), np.concatenate(samples)
    )


def host_everywhere(grid: MultiLevelGrid) -> np.ndarray:
    """No rock bodies."""
    return np.full(len(grid.cell_level), -1, np.int16)


def make_model(scene: Scene, grid: MultiLevelGrid, shapes=(), body=None) -> Model:
    """Model of a scene whose excavations are these shapes, in order."""
    return build_model(scene, grid, host_everywhere(grid) if body is None else body, pieces_of(grid, shapes))


def make_dataset(scene: Scene, grid: MultiLevelGrid, shapes=(), body=None):
    """The grid's dataset, as a stage reads it."""
    body = host_everywhere(grid) if body is None else body
    pieces = pieces_of(grid, shapes)
    places = FinestPieces(grid.cell_index[pieces.cell], pieces.excavation.astype(np.int16), pieces.samples)
    volume = np.bitwise_count(places.samples) / SAMPLES_PER_CELL * grid.fine_cell**grid.dimension * scene.thickness
    edges = EdgeNodes.none(grid.dimension), EdgePoints.none(grid.dimension)
    return grid_dataset(grid, body, places, volume, *edges, scene.plane, {"mine": scene.mine})


def solve(model: Model, tolerance: float = 1e-6, step: int = 0) -> tuple[ExplicitScheme, History]:
    """Elastic equilibrium from the virgin state under the forces of `step`."""
    scheme = ExplicitScheme(model, model.virgin_state(), model.volumes(step))
    force = external_force(model, step)
    history = History(tolerance)
    scheme.reach_equilibrium(force, tolerance, float(np.linalg.norm(force)), history)
    return scheme, history


def random_grid(random: np.random.Generator, dimension: int, levels: int = 3) -> MultiLevelGrid:
    """A grid of a few base cells, refined where two random points are; hanging nodes on all sides."""
    base = random.integers(2, 4, dimension)
    base[0] = 3  # coarse cells remain at least at one end
    places = random.random((2, dimension)) * base
    places[1, 0] = places[0, 0]

    def classify(level, index):
        return np.any([(np.floor(place * 2**level) == index).all(axis=1) for place in places], axis=0)

    return build_grid(np.zeros(dimension), 8.0, base, levels, classify, 0)


def constrain(grid: MultiLevelGrid, values: np.ndarray) -> np.ndarray:
    """C u: hanging nodes take the mean of their parents; slow twin."""
    values = values.copy()
    for node in np.flatnonzero(grid.is_hanging):
        parents = grid.node_parents[node]
        values[node] = values[parents[parents >= 0]].mean(axis=0)
    return values
