"""Operations at the nodes: gather forces, advance motion with local damping, spread loads (paper, Eqs 1, 3 and 4)."""

import numpy as np
from numba import njit, prange

from mpm_core.kernels.modes import to_corners


@njit(parallel=True, error_model="numpy", cache=True)
def advance_nodes(
    free_nodes,
    sum_start,
    sum_slots,
    sum_weights,
    slot_force,
    external_force,
    mass,
    moves,
    damping,
    time_step,
    velocity,
    displacement,
    unbalanced,
):
    """One step of the free nodes: f = C^T f_slots + f_external, local damping -c |f| sgn(v), symplectic Euler.

    free_nodes, sum_start, sum_slots, sum_weights: see block_scatter.Scatter; slot_force (slot, d) N; external_force
    (node, d) N; mass (node,) kg; moves (node, d) bool: neither held nor without rock. In place: velocity, displacement
    (node, d). A time step of zero is a look, for which no mass is needed: nothing moves, and unbalanced (node, d) takes
    the force before damping, zero where nothing moves.
    """
    for i in prange(len(free_nodes)):
        node = free_nodes[i]
        for j in range(velocity.shape[1]):
            if not moves[node, j]:
                velocity[node, j] = 0.0
                if time_step == 0.0:
                    unbalanced[node, j] = 0.0
                continue
            force = external_force[node, j]
            for s in range(sum_start[i], sum_start[i + 1]):
                force += sum_weights[s] * slot_force[sum_slots[s], j]
            if time_step == 0.0:
                unbalanced[node, j] = force
                continue
            v = velocity[node, j]
            if v > 0.0:
                force -= damping * abs(force)
            elif v < 0.0:
                force += damping * abs(force)
            v += time_step * force / mass[node]
            velocity[node, j] = v
            displacement[node, j] += time_step * v


@njit(parallel=True, error_model="numpy", cache=True)
def _largest_differences(first, second, largest):
    nodes = -(-len(first) // len(largest))
    for part in prange(len(largest)):
        size = 0.0
        for node in range(part * nodes, min((part + 1) * nodes, len(first))):
            for j in range(first.shape[1]):
                size = max(size, abs(first[node, j] - second[node, j]))
        largest[part] = size


def largest_difference(first: np.ndarray, second: np.ndarray) -> float:
    """Largest difference between any components of two nodal arrays (node, d)."""
    largest = np.zeros(64)
    _largest_differences(first, second, largest)
    return float(largest.max())


@njit(parallel=True, error_model="numpy", cache=True)
def _sizes(values, squares, largest):
    size = (len(values) + len(squares) - 1) // len(squares)
    for part in prange(len(squares)):
        square = 0.0
        most = 0.0
        for i in range(part * size, min((part + 1) * size, len(values))):
            for j in range(values.shape[1]):
                square += values[i, j] ** 2
                most = max(most, abs(values[i, j]))
                if np.isnan(values[i, j]):
                    most = np.nan
        squares[part] = square
        largest[part] = most


def sizes(values: np.ndarray) -> tuple[float, float]:
    """2-norm and largest component of a nodal array (node, d), the same bits with any number of threads."""
    squares, largest = np.empty((2, 64))
    _sizes(values, squares, largest)
    return float(np.sqrt(squares.sum())), float(largest.max())


@njit(error_model="numpy", cache=True)
def mark_nodes(cell_nodes, chosen, touched, shared):
    """Mark nodes (node,) bool in place: those of chosen cells (cell,) bool as touched, those of others as shared."""
    for cell in range(len(chosen)):
        for corner in range(cell_nodes.shape[1]):
            if chosen[cell]:
                touched[cell_nodes[cell, corner]] = True
            else:
                shared[cell_nodes[cell, corner]] = True


@njit(error_model="numpy", cache=True)
def collect_to_parents(node_parents, values):
    """Move what hanging nodes hold to their parents, in equal parts: values (node, component), in place (C^T)."""
    for node in range(len(node_parents)):
        count = 0
        for p in range(node_parents.shape[1]):
            if node_parents[node, p] >= 0:
                count += 1
        if count:
            for p in range(count):
                for j in range(values.shape[1]):
                    values[node_parents[node, p], j] += values[node, j] / count
            for j in range(values.shape[1]):
                values[node, j] = 0.0


@njit(parallel=True, error_model="numpy", cache=True)
def mark_cells(cell_nodes, marked, cells):
    """Mark cells (cell,) bool with a corner among marked nodes (node,) bool: written."""
    for cell in prange(len(cell_nodes)):
        cells[cell] = False
        for corner in range(cell_nodes.shape[1]):
            cells[cell] |= marked[cell_nodes[cell, corner]]


@njit(parallel=True, error_model="numpy", cache=True)
def mark_corners(cell_nodes, cell, volume, marked):
    """Mark nodes (node,) bool in place: the corners of the cells (particle,) of particles with volume."""
    for particle in prange(len(cell)):
        if volume[particle] > 0.0:
            for corner in range(cell_nodes.shape[1]):
                marked[cell_nodes[cell[particle], corner]] = True  # threads may write the same


@njit(parallel=True, error_model="numpy", cache=True)
def spread_to_hanging(hanging, node_parents, values):
    """Hanging nodes take the mean of their parents: values (node, component), in place (u = C u_free)."""
    for i in prange(len(hanging)):
        node = hanging[i]
        for j in range(values.shape[1]):
            total = 0.0
            count = 0
            for p in range(node_parents.shape[1]):
                if node_parents[node, p] >= 0:
                    total += values[node_parents[node, p], j]
                    count += 1
            values[node, j] = total / count


@njit(error_model="numpy", cache=True)
def particle_loads(cell_nodes, cell_size, cell, modes, slopes, stress_volume, force, load):
    """Add B^T (sigma V) + N^T f of every particle to load (node, d); hanging nodes keep their own part.

    cell_nodes (cell, 2^d) in bit order; cell (particle,); modes (particle, 2^d), slopes (particle, 2^d, d) at its
    place; stress_volume (particle, 6) N m, components in the computation's axes; force (particle, d) N.
    """
    corners, dimension = cell_nodes.shape[1], force.shape[1]
    component = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
    work = np.empty((dimension, corners))
    for particle in range(len(cell)):
        c = cell[particle]
        slope = 2.0 / cell_size[c]
        for j in range(dimension):
            for mode in range(corners):
                total = modes[particle, mode] * force[particle, j]
                for k in range(dimension):
                    total += stress_volume[particle, component[j, k]] * slopes[particle, mode, k] * slope
                work[j, mode] = total
            to_corners(work, j, dimension)
            for corner in range(corners):
                load[cell_nodes[c, corner], j] += work[j, corner] / corners


@njit(error_model="numpy", cache=True)
def particle_masses(cell_nodes, cell, row, modes, dimension, mass, nodal):
    """Add N^T m of every particle to nodal (node,); hanging nodes keep their own part.

    row (particle,): of modes (row, 2^d); mass (particle,) kg.
    """
    corners = cell_nodes.shape[1]
    work = np.empty((1, corners))
    for particle in range(len(cell)):
        if mass[particle] == 0.0:
            continue
        for mode in range(corners):
            work[0, mode] = modes[row[particle], mode]
        to_corners(work, 0, dimension)
        for corner in range(corners):
            nodal[cell_nodes[cell[particle], corner]] += work[0, corner] / corners * mass[particle]


@njit(error_model="numpy", cache=True)
def interpolate(cell_nodes, cell, row, modes, nodal, result):
    """Nodal values at particles by the trilinear shape functions (paper, Eq. 5): result (particle, d), in place.

    row (particle,): of modes (row, 2^d).
    """
    corners, dimension = cell_nodes.shape[1], nodal.shape[1]
    work = np.empty((1, corners))
    for particle in range(len(cell)):
        for mode in range(corners):
            work[0, mode] = modes[row[particle], mode]
        to_corners(work, 0, dimension)
        for j in range(dimension):
            total = 0.0
            for corner in range(corners):
                total += work[0, corner] / corners * nodal[cell_nodes[cell[particle], corner], j]
            result[particle, j] = total
