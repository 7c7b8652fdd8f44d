"""The full material point cycle: particles carry mass, momentum and stress through the grid (paper Eqs 1 to 6).

One pass over the cells takes each particle through a whole step: nodal velocity and acceleration to its place, velocity
and stress (5, 6), then from its new place mass, momentum and force back to the corners of its cell (1, 2). Between two
passes the free nodes add up their slots, hanging children included (blocks.py), and move (3, 4). The grid itself keeps
nothing. A particle that leaves its cell in a pass hands nothing back; once it is relocated the pass is made anew with a
time step of zero, so that what a node receives is always summed in the order of the particles.

Fields on a cell are handled by their modes, as in resting.py. "Stress" is the change since virgin for rock, the full
stress for fill. Volumes stay those of the unstrained rock (small strain).
"""

import numpy as np
from numba import njit, prange

from mpm_core.constitutive.strength import strength_of
from mpm_core.grid.adjacency import NO_CELL, cell_at
from mpm_core.kernels.resting import flow_at_residual


@njit(inline="always", error_model="numpy")
def _to_modes(values, modes, dimension, lanes):
    """Corner values to sums by mode (Walsh-Hadamard): values (2^d, lanes), in place."""
    for k in range(dimension):
        for corner in range(modes):
            if not (corner >> k) & 1:
                for j in range(lanes):
                    low = values[corner, j]
                    high = values[corner | (1 << k), j]
                    values[corner, j] = low + high
                    values[corner | (1 << k), j] = high - low


@njit(inline="always", error_model="numpy")
def _to_corners(values, modes, dimension, lanes):
    """The transpose of _to_modes: values (2^d, lanes), in place."""
    for k in range(dimension):
        for corner in range(modes):
            if not (corner >> k) & 1:
                for j in range(lanes):
                    even = values[corner, j]
                    odd = values[corner | (1 << k), j]
                    values[corner, j] = even - odd
                    values[corner | (1 << k), j] = even + odd


def make_cycle(dimension: int):
    """The kernel for 2 (plane strain) or 3 dimensions; its arguments are described in it."""
    modes = 1 << dimension
    lanes = dimension + 1  # a vector and the mass; four lanes fill a processor's vector register in 3-D

    @njit(parallel=True, error_model="numpy", cache=True)
    def cycle(
        block_start,
        slot_start,
        cell_nodes,
        cell_slots,
        cell_size,
        cell_start,
        cell_particles,
        time_step,
        node_velocity,
        node_acceleration,
        mass,
        volume,
        material,
        elastic_constants,
        residual_rows,
        failed,
        insitu,
        xi,
        velocity,
        stress,
        later_strain,
        dissipated,
        slot_values,
        leavers,
    ):
        """Take all particles through `time_step` s and hand mass, momentum and force to the blocks' slots.

        block_start, slot_start, cell_slots: see blocks.Scatter; cell_nodes, cell_slots (cell, 2^d) in bit order;
        cell_size (cell,) m; cell_start (cell + 1,), cell_particles (particle,): particles of each cell, ascending;
        node_velocity, node_acceleration (node, d) m/s, m/s2; mass (particle,) kg, density scaled or not; volume,
        material, failed (particle,); elastic_constants (material, 2) lambda and mu, Pa; residual_rows (material,
        column); insitu (particle, 6) Pa. In place: xi (particle, d) place in the cell, -1 to 1; velocity (particle, d)
        m/s; stress, later_strain (particle, 6); dissipated (particle,) J/m3; slot_values (slot, 2 d + 1): momentum,
        mass, force -B^T sigma V; leavers (block,) how many particles left their cells. Particles without volume rest.
        """
        for block in prange(len(block_start) - 1):
            speed = np.zeros((modes, lanes))
            change = np.zeros((modes, lanes))
            momentum = np.empty((modes, lanes))
            force = np.empty((modes, lanes))
            product = np.empty(modes)
            gradient = np.empty((dimension, lanes))
            here = np.empty(lanes)
            gain = np.empty(lanes)
            traction = np.zeros((dimension, lanes))
            left = 0
            for slot in range(slot_start[block], slot_start[block + 1]):
                for j in range(2 * dimension + 1):
                    slot_values[slot, j] = 0.0

            for cell in range(block_start[block], block_start[block + 1]):
                first = cell_start[cell]
                last = cell_start[cell + 1]
                if first == last:
                    continue
                for corner in range(modes):
                    node = cell_nodes[cell, corner]
                    for j in range(dimension):
                        speed[corner, j] = node_velocity[node, j]
                        change[corner, j] = node_acceleration[node, j]
                    for j in range(lanes):
                        momentum[corner, j] = 0.0
                        force[corner, j] = 0.0
                _to_modes(speed, modes, dimension, lanes)
                _to_modes(change, modes, dimension, lanes)
                slope = 2.0 / cell_size[cell] / modes  # from modal sums to a gradient, and from stress to modal forces
                step = slope * time_step
                share = time_step / modes

                for place in range(first, last):
                    particle = cell_particles[place]
                    if volume[particle] == 0.0:
                        continue
                    lame = elastic_constants[material[particle], 0]
                    shear = elastic_constants[material[particle], 1]
                    if time_step > 0.0:
                        product[0] = 1.0
                        for k in range(dimension):
                            for m in range(1 << k):
                                product[m | (1 << k)] = product[m] * xi[particle, k]
                        for j in range(lanes):
                            here[j] = 0.0
                            gain[j] = 0.0
                        for m in range(modes):
                            for j in range(lanes):
                                here[j] += product[m] * speed[m, j]
                                gain[j] += product[m] * change[m, j]
                        for k in range(dimension):
                            for j in range(lanes):
                                gradient[k, j] = 0.0
                            for m in range(modes):
                                if (m >> k) & 1:
                                    for j in range(lanes):
                                        gradient[k, j] += product[m ^ (1 << k)] * speed[m, j]
                        outside = False
                        for k in range(dimension):
                            moved = xi[particle, k] + step * here[k]
                            xi[particle, k] = moved
                            outside |= moved < -1.0 or moved >= 1.0
                            velocity[particle, k] += share * gain[k]
                        double = 2.0 * shear * step
                        if dimension == 3:
                            volumetric = lame * step * (gradient[0, 0] + gradient[1, 1] + gradient[2, 2])
                            stress[particle, 0] += volumetric + double * gradient[0, 0]
                            stress[particle, 1] += volumetric + double * gradient[1, 1]
                            stress[particle, 2] += volumetric + double * gradient[2, 2]
                            stress[particle, 3] += 0.5 * double * (gradient[1, 2] + gradient[2, 1])
                            stress[particle, 4] += 0.5 * double * (gradient[0, 2] + gradient[2, 0])
                            stress[particle, 5] += 0.5 * double * (gradient[0, 1] + gradient[1, 0])
                        else:
                            volumetric = lame * step * (gradient[0, 0] + gradient[1, 1])
                            stress[particle, 0] += volumetric + double * gradient[0, 0]
                            stress[particle, 1] += volumetric + double * gradient[1, 1]
                            stress[particle, 2] += volumetric
                            stress[particle, 5] += 0.5 * double * (gradient[0, 1] + gradient[1, 0])
                        if failed[particle]:
                            flow_at_residual(
                                particle,
                                lame,
                                shear,
                                strength_of(residual_rows, material[particle]),
                                insitu,
                                stress,
                                later_strain,
                                dissipated,
                            )
                        if outside:
                            left += 1
                            continue

                    product[0] = 1.0
                    for k in range(dimension):
                        for m in range(1 << k):
                            product[m | (1 << k)] = product[m] * xi[particle, k]
                    for j in range(dimension):
                        here[j] = mass[particle] * velocity[particle, j]
                    here[dimension] = mass[particle]
                    for m in range(modes):
                        for j in range(lanes):
                            momentum[m, j] += product[m] * here[j]
                    weight = volume[particle] * slope
                    traction[0, 0] = stress[particle, 0] * weight
                    traction[0, 1] = stress[particle, 5] * weight
                    traction[1, 0] = stress[particle, 5] * weight
                    traction[1, 1] = stress[particle, 1] * weight
                    if dimension == 3:
                        traction[0, 2] = stress[particle, 4] * weight
                        traction[1, 2] = stress[particle, 3] * weight
                        traction[2, 0] = stress[particle, 4] * weight
                        traction[2, 1] = stress[particle, 3] * weight
                        traction[2, 2] = stress[particle, 2] * weight
                    for m in range(1, modes):
                        for k in range(dimension):
                            if (m >> k) & 1:
                                for j in range(lanes):
                                    force[m, j] += product[m ^ (1 << k)] * traction[k, j]

                _to_corners(momentum, modes, dimension, lanes)
                _to_corners(force, modes, dimension, lanes)
                for corner in range(modes):
                    slot = cell_slots[cell, corner]
                    for j in range(lanes):
                        slot_values[slot, j] += momentum[corner, j] / modes
                    for j in range(dimension):
                        slot_values[slot, lanes + j] -= force[corner, j]
            leavers[block] = left

    return cycle


CYCLE = {2: make_cycle(2), 3: make_cycle(3)}


@njit(parallel=True, error_model="numpy", cache=True)
def move_nodes(
    free_nodes,
    sum_start,
    sum_slots,
    sum_weights,
    slot_values,
    external_force,
    least_mass,
    held,
    damping,
    time_step,
    mass,
    velocity,
    acceleration,
    displacement,
    unbalanced,
):
    """Nodes without parents take what their slots and those of their hanging children hold, and move (Eqs 1 to 4).

    a = (f - c |f| sgn v) / m and v = (m v) / m + a dt, with v before the step in the damping. free_nodes, sum_start,
    sum_slots, sum_weights: see blocks.Scatter; slot_values (slot, 2 d + 1) from `CYCLE`; external_force, held
    (node, d); least_mass (node,) kg: the inertia of a node is at least that (its velocity is not touched by it).
    In place: mass (node,) kg; velocity, acceleration, unbalanced (node, d), the force before damping, zero where held
    or where there is no mass; displacement (node, d) m, the sum of v dt.
    """
    dimension = velocity.shape[1]
    for i in prange(len(free_nodes)):
        node = free_nodes[i]
        total = 0.0
        for s in range(sum_start[i], sum_start[i + 1]):
            total += sum_weights[s] * slot_values[sum_slots[s], dimension]
        mass[node] = total
        for j in range(dimension):
            if held[node, j] or total == 0.0:
                unbalanced[node, j] = 0.0
                velocity[node, j] = 0.0
                acceleration[node, j] = 0.0
                continue
            momentum = 0.0
            force = external_force[node, j]
            for s in range(sum_start[i], sum_start[i + 1]):
                momentum += sum_weights[s] * slot_values[sum_slots[s], j]
                force += sum_weights[s] * slot_values[sum_slots[s], dimension + 1 + j]
            unbalanced[node, j] = force
            v = momentum / total
            if v > 0.0:
                force -= damping * abs(force)
            elif v < 0.0:
                force += damping * abs(force)
            a = force / max(total, least_mass[node])
            acceleration[node, j] = a
            velocity[node, j] = v + time_step * a
            displacement[node, j] += time_step * velocity[node, j]


@njit(error_model="numpy", cache=True)
def relocate(cell_index, cell_width, code, halvings, base_shape, first, count, volume, cell, xi):
    """Give particles that left their cells the leaves they are in now: (how many changed, how many left the domain).

    cell_index (cell, d), cell_width (cell,) fine units; code to count: see adjacency.leaf_lookup; volume (particle,).
    In place: cell (particle,), xi (particle, d). A particle outside the domain keeps both.
    """
    dimension = xi.shape[1]
    place = np.empty(dimension, np.int32)
    exact = np.empty(dimension)
    changed = 0
    lost = 0
    for particle in range(len(cell)):
        outside = False
        for k in range(dimension):
            outside |= not (-1.0 <= xi[particle, k] < 1.0)
        if not outside or volume[particle] == 0.0:
            continue
        old = cell[particle]
        for k in range(dimension):
            exact[k] = cell_index[old, k] + 0.5 * (xi[particle, k] + 1.0) * cell_width[old]
            # far outside is outside: no overflow, and a place that is not a number ends there too
            near = -1.0 <= exact[k] < 2.0e9
            place[k] = np.int32(np.floor(exact[k])) if near else np.int32(-1)
        new = cell_at(place, code, halvings, base_shape, first, count)
        if new == NO_CELL:
            lost += 1
            continue
        for k in range(dimension):
            xi[particle, k] = 2.0 * (exact[k] - cell_index[new, k]) / cell_width[new] - 1.0
        changed += new != old
        cell[particle] = new
    return changed, lost


@njit(cache=True)
def sort_by_cell(cell, cells):
    """Particles of each cell in ascending order: (cell_start (cell + 1,) int64, cell_particles (particle,) int32)."""
    start = np.zeros(cells + 1, np.int64)
    for particle in range(len(cell)):
        start[cell[particle] + 1] += 1
    for c in range(cells):
        start[c + 1] += start[c]
    end = start[:-1].copy()
    particles = np.empty(len(cell), np.int32)
    for particle in range(len(cell)):
        particles[end[cell[particle]]] = particle
        end[cell[particle]] += 1
    return start, particles
