"""Eqs (1) to (6), corrected (departures.md), as slow loops over particles and corners in world coordinates."""

from dataclasses import dataclass

import numpy as np

from mpm_core.constitutive.elastic import strain_from_stress, stress_increment
from mpm_core.constitutive.laws.coulomb import return_to_surface
from mpm_core.grid import MultiLevelGrid
from mpm_core.grid.mesh import CORNER_OFFSETS

VOIGT = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])


@dataclass
class SlowParticles:
    """position, velocity (particle, d); stress, insitu, plastic (particle, 6); the rest (particle,)."""

    position: np.ndarray
    velocity: np.ndarray
    stress: np.ndarray
    insitu: np.ndarray
    plastic: np.ndarray
    mass: np.ndarray
    volume: np.ndarray
    failed: np.ndarray


def cell_of(grid: MultiLevelGrid, position: np.ndarray) -> int:
    """The one cell that holds a place, by looking at all of them."""
    lower = grid.cell_origin
    (found,) = np.flatnonzero(((lower <= position) & (position < lower + grid.cell_size[:, None])).all(axis=1))
    return int(found)


def shape_functions(grid: MultiLevelGrid, position: np.ndarray):
    """Nodes of the cell at a place, the shape function of each and its gradient (corner, d), 1/m."""
    cell = cell_of(grid, position)
    size = grid.cell_size[cell]
    local = (position - grid.cell_origin[cell]) / size
    corners = CORNER_OFFSETS[grid.dimension]
    factor = np.where(corners == 1, local, 1.0 - local)
    slope = np.where(corners == 1, 1.0, -1.0) / size
    gradient = np.stack(
        [slope[:, k] * np.delete(factor, k, axis=1).prod(axis=1) for k in range(grid.dimension)], axis=1
    )
    return grid.vtk_nodes[cell], factor.prod(axis=1), gradient


def slow_step(
    grid: MultiLevelGrid,
    particles: SlowParticles,
    external: np.ndarray,
    held: np.ndarray,
    damping: float,
    time_step: float,
    lame: float,
    shear: float,
    residual_row: np.ndarray,
    density_scaling: bool = True,
) -> tuple[np.ndarray, np.ndarray]:
    """One step of the particles, in place; returns nodal mass and the nodal velocity before the step."""
    dimension, nodes = grid.dimension, len(grid.node_index)
    mass, momentum, force = np.zeros(nodes), np.zeros((nodes, dimension)), external.copy()
    nearby = np.zeros(nodes)
    here = [shape_functions(grid, position) for position in particles.position]
    for p, (node, shape, gradient) in enumerate(here):
        tensor = particles.stress[p][VOIGT][:dimension, :dimension]
        for i, n in enumerate(node):
            nearby[n] = max(nearby[n], particles.mass[p])
            mass[n] += shape[i] * particles.mass[p]
            momentum[n] += shape[i] * particles.mass[p] * particles.velocity[p]
            force[n] -= tensor @ gradient[i] * particles.volume[p]
    for child in np.flatnonzero(grid.is_hanging):
        parents = [parent for parent in grid.node_parents[child] if parent >= 0]
        nearby[parents] = np.maximum(nearby[parents], nearby[child])
        for quantity in (mass, momentum, force):
            for parent in parents:
                quantity[parent] += quantity[child] / len(parents)
            quantity[child] = 0.0

    before, velocity, acceleration = (np.zeros((nodes, dimension)) for _ in range(3))
    for n in np.flatnonzero(~grid.is_hanging & (mass > 0.0)):
        for j in np.flatnonzero(~held[n]):
            before[n, j] = momentum[n, j] / mass[n]
            damped = force[n, j] - damping * abs(force[n, j]) * np.sign(before[n, j])
            acceleration[n, j] = damped / mass[n]
            velocity[n, j] = before[n, j] + time_step * damped / max(mass[n], nearby[n])
    for child in np.flatnonzero(grid.is_hanging):
        parents = [parent for parent in grid.node_parents[child] if parent >= 0]
        velocity[child] = velocity[parents].mean(axis=0)
        acceleration[child] = acceleration[parents].mean(axis=0)

    for p, (node, shape, gradient) in enumerate(here):
        size = grid.cell_size[cell_of(grid, particles.position[p])]
        particles.position[p] += time_step * shape @ velocity[node]
        if density_scaling:
            particles.mass[p] *= (size / grid.cell_size[cell_of(grid, particles.position[p])]) ** 2
        particles.velocity[p] += time_step * shape @ acceleration[node]
        rate = np.zeros((3, 3))
        rate[:dimension, :dimension] = velocity[node].T @ gradient
        strain = 0.5 * time_step * (rate + rate.T)
        components = [strain[ij] for ij in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))]
        particles.stress[p] += stress_increment(lame, shear, *components)
        if particles.failed[p]:
            trial = particles.stress[p] + particles.insitu[p]
            returned = np.array(return_to_surface(*trial, lame, shear, residual_row)[:6])
            particles.plastic[p] += strain_from_stress(lame, shear, *(trial - returned))
            particles.stress[p] = returned - particles.insitu[p]
    return mass, before
