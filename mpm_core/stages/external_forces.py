"""The external forces on a model: mined rock, weight, pressure, lost tractions, loads, a strained boundary.

Pressure acts on the walls of excavations from inside: traction -p n on rock with the outward normal n. An open
excavation counts as full of a weightless fluid: its stress is -p I, where that of a void is zero. By the divergence
theorem the integral of B^T (p I) over the open volume is the force of the pressure on the walls; and rock mined where
the virgin stress is -p I moves nothing.

Pressure acts in all that is open within the excavation's solid, whichever excavation opened it, until the excavation
is filled. Where open solids overlap, the highest pressure acts; it also acts in what went with them without being part
of any solid, remainders of cells and unsupported rock of their cells.
"""

from collections.abc import Iterator

import numpy as np

from common.errors import InputError
from common.voigt import tensor_from_voigt, voigt_from_tensor
from mpm_core.equilibrium.convergence import MIN_UNBALANCED_SHARE, norm
from mpm_core.geometry.inside import contains
from mpm_core.geometry.shapes import build_shape
from mpm_core.kernels.nodal_operations import collect_to_parents, particle_loads
from mpm_core.model.model import Model
from mpm_core.model.occupancy import ALL_SAMPLES
from mpm_core.model.particles import part_means, shapes_of
from mpm_core.scene.scene import FACES, Load, Scene, virgin_body_force, virgin_stress


def external_force(model: Model, step: int) -> np.ndarray:
    """Forces of all that was mined, filled and loaded up to `step`, relative to virgin: (node, d) N, on free nodes.

    Void: r lacks B^T sigma0 - N^T b over the mined volume (equilibrium.md), less the pressure on its walls
    (wall_pressure). Fill weighs its own density; free faces lose their virgin traction, as do traction and roller
    faces where rock is mined; loads are shared by volume. Nodes without rock or fill have none: what is integrated
    there adds up to nothing, but for the quadrature of the virgin stress.
    Raises InputError for a load whose rock is mined, and where forces drive what nothing holds.
    """
    model = model.at(step)
    particles, scene = model.particles, model.scene
    axes = list(scene.axes)
    volume = model.material_volumes(step)
    rock = particles.is_rock
    missing = np.where(rock, particles.full_volume - volume, 0.0)
    body_force = virgin_body_force(scene)
    gravity = np.zeros(model.dimension)
    if 2 in axes:
        gravity[axes.index(2)] = body_force[axes.index(2)] / scene.materials["host"].density
    density = np.array([material.density for material in scene.materials.values()])
    weight = np.where(rock, 0.0, density[model.material] * volume)
    force = np.zeros((particles.count, model.dimension))
    acting = np.flatnonzero(weight != 0.0)
    force[acting] = weight[acting, None] * gravity
    for load in scene.loads:
        if load.since <= step:
            force += load_force(model, load, np.where(rock, volume, 0.0))
            acting = np.flatnonzero(force.any(axis=1))
    nodal = np.zeros((len(model.grid.node_index), model.dimension))
    row = particles.row[acting]
    shapes = particles.modes[row], particles.slopes[row]
    _spread(model, particles.cell[acting], shapes, np.zeros((len(acting), 6)), force[acting], nodal)
    mined = np.flatnonzero(missing)  # a small part of the mine
    shapes, virgin = _of_missing_rock(model, mined, step)
    stress_volume = virgin * missing[mined, None]
    inside, cell_pressure = wall_pressure(model, step, mined)
    if len(inside):
        stress_volume[:, :3] += (inside * missing[mined])[:, None]
    _spread(model, particles.cell[mined], shapes, stress_volume, -missing[mined, None] * body_force, nodal)
    mined_share = 1.0 - model.rock_share(step)
    _add_severed(model, nodal, body_force, cell_pressure, mined_share)
    _add_lost_traction(model, nodal, mined_share, cell_pressure)
    collect_to_parents(model.grid.node_parents, nodal)
    attached = model.attached_nodes(volume)
    nodal[~attached] = 0.0
    nodal[model.held] = 0.0
    _require_balance(model, attached, nodal, step)
    return nodal


def load_force(model: Model, load: Load, rock_volume: np.ndarray) -> np.ndarray:
    """Forces (particle, d) N of one load, shared by volume among the rock (particle,) inside its shape.

    Raises InputError if its shape holds no particle, no rock any more, or the point that the forces are directed to.
    """
    where, position = f"loads.{load.name}", model.particles.position
    inside = contains(build_shape({"name": where, **load.shape.given()}, model.dimension), position)
    if not inside.any():
        raise InputError(f"{where}: no particle lies inside its shape; enlarge it or move it into the rock")
    share = np.where(inside, rock_volume, 0.0)
    if not share.any():
        raise InputError(f"{where}: the rock inside its shape is mined; move it")
    share /= share.sum() * model.scene.thickness
    if load.toward is None:
        return share[:, None] * np.array(load.force)[list(model.scene.axes)]
    points = np.atleast_2d(load.toward)
    way = points[0] - position
    if len(points) == 2:  # the nearest point of the line through both
        axis = (points[1] - points[0]) / np.sqrt(np.sum((points[1] - points[0]) ** 2))
        way -= np.sum(way * axis, axis=1)[:, None] * axis
    distance = np.sqrt(np.sum(way**2, axis=1))
    if (distance[share > 0.0] == 0.0).any():
        raise InputError(f"{where}.toward: stands on a particle that is loaded, which has no direction to it; move it")
    return (share * load.force / np.where(distance > 0.0, distance, 1.0))[:, None] * way


def _of_missing_rock(model: Model, chosen: np.ndarray, step: int) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Modes (k, 2^d), slopes (k, 2^d, d) and virgin stress (k, 6) Pa of what is mined of chosen rock particles (k,)
    after a step.

    They are those of the particle itself, but for one that stands for some of its cell's samples: the others are
    mined.
    """
    particles, grid = model.particles, model.grid
    row = particles.row[chosen]
    modes, slopes, virgin = particles.modes[row], particles.slopes[row], model.insitu[chosen]
    own = np.flatnonzero(row >= particles.shared_rows)
    if len(own):
        cell = particles.cell[chosen[own]]
        gone = ~model.changes.rock_samples(len(model.cell_nodes), step)[cell]
        modes[own], slopes[own], place = part_means(gone, cell, particles.distorted, model.dimension)
        virgin[own] = virgin_stress(model.scene, grid.centers(cell) + 0.5 * grid.cell_size[cell][:, None] * place)
    return (modes, slopes), virgin


def _add_severed(
    model: Model, nodal: np.ndarray, body_force: np.ndarray, pressure: np.ndarray, mined_share: np.ndarray
) -> None:
    """Add the virgin forces of whole cells at nodes (node, d) that are severed from them: to these all of the cell
    is gone, mined or not, and full of what presses on their own walls.

    body_force (d,) N/m3; pressure (cell,) Pa or (0,): mean over each cell, of which mined_share (cell,) is mined.
    """
    node, cell, corner = model.severed.T
    if not len(node):
        return
    grid, dimension = model.grid, model.dimension
    tensor = tensor_from_voigt(virgin_stress(model.scene, grid.centers(cell)))[:, :dimension, :dimension]
    if len(pressure):
        there = np.flatnonzero(pressure)
        inside, highest = pressure[there] / mined_share[there], np.zeros(len(nodal))
        of_cell = np.zeros(len(pressure))
        of_cell[there] = inside
        np.maximum.at(highest, model.cell_nodes[there], inside[:, None])
        np.maximum.at(highest, node, of_cell[cell])
        tensor = tensor + highest[node][:, None, None] * np.eye(dimension)
    modes, slopes, _ = part_means(np.full(len(cell), ALL_SAMPLES), cell, model.particles.distorted, dimension)
    shape, gradient = (values[np.arange(len(cell)), corner] for values in shapes_of(modes, slopes))
    size = grid.cell_size[cell]
    volume = size**dimension * model.particles.distorted.volumes(cell)
    force = np.einsum("kj,kji->ki", gradient, tensor) * (2.0 / size * volume)[:, None]
    np.add.at(nodal, node, force - body_force * (shape * volume)[:, None])


def _spread(
    model: Model,
    cell: np.ndarray,
    shapes: tuple[np.ndarray, np.ndarray],
    stress_volume: np.ndarray,
    force: np.ndarray,
    nodal: np.ndarray,
) -> None:
    """Add B^T (sigma V) + N^T f to nodal (node, d) N: cell (k,), shapes: modes (k, 2^d) and slopes (k, 2^d, d), sigma V
    (k, 6) N m, f (k, d) N."""
    modes, slopes = shapes
    particle_loads(model.cell_nodes, model.grid.cell_size, cell, modes, slopes, stress_volume, force, nodal)


def _require_balance(model: Model, attached: np.ndarray, force: np.ndarray, step: int) -> None:
    """Raise InputError if forces (node, d) N drive a rigid motion that the boundary leaves to what is attached to nodes
    (node,) bool, or if there is nothing that they could act on."""
    name = model.scene.steps[step]
    if not attached.any():
        raise InputError(
            f"steps.{name}: nothing is left of the model, all rock is mined; mine less, or fill in this step"
        )
    motions = model.free_motions(attached)
    if motions.count and motions.driven_by(force, model.node_position):
        raise InputError(
            f"domain.boundary: in step {name} nothing keeps the model where it is "
            f"({motions.describe(model.scene.axes)}), and the forces on it (loads, excavations, pressure, lost "
            "traction) do not balance; give more faces fixed or roller, or balance the loads"
        )


def _add_lost_traction(model: Model, nodal: np.ndarray, mined_share: np.ndarray, pressure: np.ndarray) -> None:
    """Subtract the virgin traction from free faces of the domain, and from traction and roller faces where rock is
    mined.

    A roller holds the normal component only: the virgin traction along it goes with the rock that is mined.
    pressure (cell,) Pa or (0,): mean over each cell. What it pushes outwards at such a face is no rock.
    """
    component = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
    grid, scene = model.grid, model.scene
    for axis in range(model.dimension):
        for side, name in enumerate(FACES[2 * scene.axes[axis] :][:2]):
            condition = scene.boundary.get(name)
            if condition not in ("free", "traction", "roller"):
                continue
            edge = grid.cell_index[:, axis] + side * grid.cell_width
            cells = np.flatnonzero(edge == side * grid.shape[axis])
            center = grid.centers(cells)
            center[:, axis] += (side - 0.5) * grid.cell_size[cells]
            traction = virgin_stress(scene, center)[:, component[axis, : model.dimension]] * (2 * side - 1)
            area = grid.cell_size[cells] ** (model.dimension - 1)
            corners = [corner for corner in range(1 << model.dimension) if (corner >> axis) & 1 == side]
            lost = 1.0 if condition == "free" else mined_share[cells]
            share = -traction * (lost * area / len(corners))[:, None]
            if len(pressure):
                share[:, axis] -= (2 * side - 1) * pressure[cells] * area / len(corners)
            for corner in corners:
                np.add.at(nodal, model.cell_nodes[cells, corner], share)


def boundary_strain(scene: Scene, step: int) -> np.ndarray:
    """Strain of the domain's boundary from virgin rock up to `step`, (d, d) in the computation's axes."""
    total = np.sum([entry.strain for entry in scene.strains if entry.since <= step] or [(0.0,) * 6], axis=0)
    return tensor_from_voigt(total)[np.ix_(scene.axes, scene.axes)]


def strain_reaction(model: Model, strain: np.ndarray, step: int) -> np.ndarray:
    """Forces (node, d) N that the held boundary carries if the whole model bears the strain (d, d) elastically.

    What is held moves, what is free does not carry: zero there. Linear in the strain, and the same whatever has failed:
    a measure for unbalanced forces, not a result.
    """
    tensor = np.zeros((3, 3))
    tensor[: model.dimension, : model.dimension] = strain
    nodal = np.zeros((len(model.grid.node_index), model.dimension))
    if tensor.any():
        lame, shear = model.elastic_constants[model.particles.material].T
        stress = 2.0 * shear[:, None] * voigt_from_tensor(tensor)
        stress[:, :3] += (lame * np.trace(tensor))[:, None]
        volume, particles = model.volumes(step), model.particles
        none = np.zeros((particles.count, model.dimension))
        shapes = particles.modes[particles.row], particles.slopes[particles.row]
        _spread(model, particles.cell, shapes, stress * volume[:, None], none, nodal)
        collect_to_parents(model.grid.node_parents, nodal)
        nodal[~model.held] = 0.0
    return nodal


def reference_force(change: float, whole: float, tolerance: float) -> float:
    """Reference of the unbalanced forces of a stage, N: the load size of what it changes, however much has acted
    since virgin rock (whole); that, where nothing changes. Never so little that the tolerance is the whole's round-off.
    """
    return max(change, MIN_UNBALANCED_SHARE * whole / tolerance) if change > MIN_UNBALANCED_SHARE * whole else whole


def load_size(model: Model, force: np.ndarray, strain: np.ndarray, step: int) -> float:
    """Size of a load, the reference of unbalanced forces, N: 2-norm of forces (node, d) at free nodes and, at held
    ones, of what the strain (d, d) of the boundary causes in elastic rock. Rock that has failed carries less of it."""
    return float(np.hypot(norm(force), norm(strain_reaction(model, strain, step))))


def wall_pressure(model: Model, step: int, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pressure once `step` is mined and filled, Pa: mean over the missing rock of chosen particles (k,), and over each
    whole cell, (cell,); both (0,) where there is none."""
    inside = np.array([excavation.pressure_at(step) for excavation in model.scene.excavations])
    if not inside.any():
        return np.zeros(0), np.zeros(0)
    cells = len(model.cell_nodes)
    cell, sample = model.particles.cell[chosen], model.particles.sample[chosen]
    single = np.flatnonzero(sample >= 0)
    bit = np.uint64(1) << sample[single].astype(np.uint64)
    gone = np.bitwise_count(~model.changes.rock_samples(cells, step))
    mean, of_samples = np.zeros(cells), np.zeros(len(single))
    for where, samples, pressure in _open_parts(model, step, inside):
        mean[where] += pressure * (np.bitwise_count(samples) / gone[where])  # exactly the pressure where all is open
        if len(single):
            of_cell = np.zeros(cells, np.uint64)
            of_cell[where] = samples
            of_samples[(of_cell[cell[single]] & bit) != 0] = pressure
    of_particles = mean[cell]
    of_particles[single] = of_samples
    return of_particles, mean * (1.0 - model.rock_share(step))


def _open_parts(model: Model, step: int, inside: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, float]]:
    """Disjoint parts of cells under each pressure: cells (part,), their samples (part,) uint64, the pressure Pa.

    inside (excavation,) Pa: pressure in each excavation.
    """
    pieces, cells = model.pieces, len(model.cell_nodes)
    mined = np.array([0 <= excavation.mined <= step for excavation in model.scene.excavations])
    pieces = pieces.of(mined[pieces.excavation])
    open_now = ~model.changes.solid_samples(cells, step)
    of_solids = np.zeros(cells, np.uint64)
    np.bitwise_or.at(of_solids, pieces.cell, pieces.samples)
    rest = open_now & ~of_solids
    of_piece = inside[pieces.excavation]
    for pressure in np.unique(of_piece[of_piece > 0.0])[::-1]:
        own = pieces.of(of_piece == pressure)
        samples = np.zeros(cells, np.uint64)
        np.bitwise_or.at(samples, own.cell, own.samples)
        where = np.unique(own.cell)
        of_cells = samples[where] & open_now[where] | rest[where]
        open_now[where] &= ~of_cells
        rest[where] = 0
        yield where, of_cells, float(pressure)
