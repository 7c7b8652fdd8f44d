"""The full material point cycle: particles carry mass, momentum and stress through the grid (paper, Eqs 1 to 6).

One pass over the cells takes each particle through a whole step: nodal velocity and acceleration to its place, velocity
and stress (5, 6), then from its new place mass, momentum and force back to the corners of its cell (1, 2). Between two
passes the free nodes add up their slots, hanging children included (block_scatter.py), and move (3, 4). The grid itself
keeps nothing. A particle that leaves its cell in a pass hands nothing back; once it is relocated the pass is made anew
with a time step of zero, so that what a node receives is always summed in the order of the particles.

Fields on a cell are handled by their modes (modes.py). "Stress" is the change since virgin for rock, the full
stress for fill. Volumes stay those of the unstrained rock (small strain).
"""

import functools

import numpy as np
from numba import njit, prange

from mpm_core.constitutive.general import strength_of
from mpm_core.grid.adjacency import NO_CELL, cell_at
from mpm_core.kernels import modes_2, modes_3
from mpm_core.kernels.modes import to_corners, to_modes
from mpm_core.kernels.stress_update import flow_at_residual

MIN_LOCAL_COORDINATE = -1.0 + 1e-12
"""Least local coordinate of a particle. On a side itself it would give the far nodes no mass, but strain with their
velocity."""


@njit(error_model="numpy", cache=True)
def relocate(cell_index, cell_width, code, halvings, base_shape, first, count, volume, cell, xi):
    """Give particles that left their cells the leaves they are in now: (how many changed, how many left the domain).

    cell_index (cell, d), cell_width (cell,) fine units; code to count: see adjacency.leaf_lookup; volume (particle,).
    In place: cell (particle,), xi (particle, d) from MIN_LOCAL_COORDINATE to below 1. A particle outside the domain
    keeps both.
    """
    dimension = xi.shape[1]
    place = np.empty(dimension, np.int32)
    exact = np.empty(dimension)
    changed = 0
    lost = 0
    for particle in range(len(cell)):
        outside = False
        for k in range(dimension):
            outside |= not (MIN_LOCAL_COORDINATE <= xi[particle, k] < 1.0)
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
            xi[particle, k] = max(2.0 * (exact[k] - cell_index[new, k]) / cell_width[new] - 1.0, MIN_LOCAL_COORDINATE)
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


@functools.cache
def make_cycle(law, dimension: int):
    """The kernel for a law and 2 (plane strain) or 3 dimensions; its arguments are described in it."""
    length = law.ROW_LENGTH
    corners = 1 << dimension
    fields = 2 * dimension + 1
    modes = {2: modes_2, 3: modes_3}[dimension]

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

        block_start, slot_start, cell_slots: see block_scatter.Scatter; cell_nodes, cell_slots (cell, 2^d) in bit order;
        cell_size (cell,) m; cell_start (cell + 1,), cell_particles (particle,): particles of each cell, ascending;
        node_velocity, node_acceleration (node, d) m/s, m/s2; mass (particle,) kg, density scaled or not; volume,
        material, failed (particle,); elastic_constants (material, 2) lambda and mu, Pa; residual_rows (material,
        column); insitu (particle, 6) Pa. In place: xi (particle, d) place in the cell, -1 to 1; velocity (particle, d)
        m/s; stress, later_strain (particle, 6); dissipated (particle,) J/m3; slot_values (slot, 2 d + 2): momentum,
        mass, force -B^T sigma V, and the largest mass of a particle nearby; leavers (block,) how many particles left
        their cells. Particles without volume rest.
        """
        for block in prange(len(block_start) - 1):
            motion = np.empty((2 * dimension, corners))  # velocity by modes, acceleration at corners
            sums = np.empty((fields, corners))  # momentum and mass at corners, force by modes
            left = 0
            for slot in range(slot_start[block], slot_start[block + 1]):
                for j in range(fields + 1):
                    slot_values[slot, j] = 0.0

            for cell in range(block_start[block], block_start[block + 1]):
                first = cell_start[cell]
                last = cell_start[cell + 1]
                if first == last:
                    continue
                for corner in range(corners):
                    node = cell_nodes[cell, corner]
                    for j in range(dimension):
                        motion[j, corner] = node_velocity[node, j]
                        motion[dimension + j, corner] = node_acceleration[node, j]
                for j in range(dimension):
                    to_modes(motion, j, dimension)
                for j in range(fields):
                    for corner in range(corners):
                        sums[j, corner] = 0.0
                slope = 2.0 / cell_size[cell] / corners  # from modal sums to a gradient, from stress to modal forces
                step = slope * time_step
                share = time_step / corners
                heaviest = 0.0

                for place in range(first, last):
                    particle = cell_particles[place]
                    if volume[particle] == 0.0:
                        continue
                    x = xi[particle, 0]
                    y = xi[particle, 1]
                    z = xi[particle, 2] if dimension == 3 else 0.0
                    if time_step > 0.0:
                        lame = step * elastic_constants[material[particle], 0]
                        shear = step * elastic_constants[material[particle], 1]
                        vx, xx, xy, xz = modes.sample(motion, 0, x, y, z)
                        vy, yx, yy, yz = modes.sample(motion, 1, x, y, z)
                        velocity[particle, 0] += share * modes.value(motion, dimension, x, y, z)
                        velocity[particle, 1] += share * modes.value(motion, dimension + 1, x, y, z)
                        if dimension == 3:
                            vz, zx, zy, zz = modes.sample(motion, 2, x, y, z)
                            velocity[particle, 2] += share * modes.value(motion, dimension + 2, x, y, z)
                            volumetric = lame * (xx + yy + zz)
                            stress[particle, 0] += volumetric + 2.0 * shear * xx
                            stress[particle, 1] += volumetric + 2.0 * shear * yy
                            stress[particle, 2] += volumetric + 2.0 * shear * zz
                            stress[particle, 3] += shear * (yz + zy)
                            stress[particle, 4] += shear * (xz + zx)
                            stress[particle, 5] += shear * (xy + yx)
                            z += step * vz
                            xi[particle, 2] = z
                        else:
                            volumetric = lame * (xx + yy)
                            stress[particle, 0] += volumetric + 2.0 * shear * xx
                            stress[particle, 1] += volumetric + 2.0 * shear * yy
                            stress[particle, 2] += volumetric
                            stress[particle, 5] += shear * (xy + yx)
                        x += step * vx
                        y += step * vy
                        xi[particle, 0] = x
                        xi[particle, 1] = y
                        if failed[particle]:
                            dissipated[particle] += flow_at_residual(
                                law.return_to_surface,
                                particle,
                                elastic_constants[material[particle], 0],
                                elastic_constants[material[particle], 1],
                                strength_of(residual_rows, material[particle], length),
                                insitu,
                                stress,
                                later_strain,
                            )
                        if min(x, y, z) < MIN_LOCAL_COORDINATE or max(x, y, z) >= 1.0:
                            left += 1
                            continue

                    m = mass[particle]
                    heaviest = max(heaviest, m)
                    weight = volume[particle] * slope
                    xx = stress[particle, 0] * weight
                    yy = stress[particle, 1] * weight
                    xy = stress[particle, 5] * weight
                    modes.add_value(sums, 0, x, y, z, m * velocity[particle, 0])
                    modes.add_value(sums, 1, x, y, z, m * velocity[particle, 1])
                    modes.add_value(sums, dimension, x, y, z, m)
                    if dimension == 3:
                        zz = stress[particle, 2] * weight
                        yz = stress[particle, 3] * weight
                        xz = stress[particle, 4] * weight
                        modes.add_value(sums, 2, x, y, z, m * velocity[particle, 2])
                        modes.add_slopes(sums, dimension + 1, x, y, z, xx, xy, xz)
                        modes.add_slopes(sums, dimension + 2, x, y, z, xy, yy, yz)
                        modes.add_slopes(sums, dimension + 3, x, y, z, xz, yz, zz)
                    else:
                        modes.add_slopes(sums, dimension + 1, x, y, z, xx, xy, 0.0)
                        modes.add_slopes(sums, dimension + 2, x, y, z, xy, yy, 0.0)

                for j in range(dimension + 1, fields):
                    to_corners(sums, j, dimension)
                for corner in range(corners):
                    slot = cell_slots[cell, corner]
                    for j in range(dimension + 1):
                        slot_values[slot, j] += sums[j, corner] / corners
                    for j in range(dimension + 1, fields):
                        slot_values[slot, j] -= sums[j, corner]
                    slot_values[slot, fields] = max(slot_values[slot, fields], heaviest)
            leavers[block] = left

    return cycle


@njit(parallel=True, error_model="numpy", cache=True)
def move_nodes(
    free_nodes,
    sum_start,
    sum_slots,
    sum_weights,
    slot_values,
    external_force,
    held,
    damping,
    time_step,
    mass,
    velocity,
    acceleration,
    displacement,
    unbalanced,
):
    """Nodes without parents take what slots of theirs and of hanging children hold, and move (paper, Eqs 1 to 4).

    a = (f - c |f| sgn v) / m and v = (m v) / m + a dt, with v before the step in the damping. free_nodes, sum_start,
    sum_slots, sum_weights: see block_scatter.Scatter; slot_values (slot, 2 d + 2) from the cycle; external_force, held
    (node, d). What strains, v, takes for m in f / m at least the mass of any particle nearby: a node at the corner of
    one full cell has that, a node that a lone particle hardly touches has not, but the full gradient of its stress.
    The acceleration that particles get is f / m, and conserves momentum.
    In place: mass (node,) kg; velocity, acceleration, unbalanced (node, d), the force before damping, zero where held
    or where there is no mass; displacement (node, d) m, the sum of v dt.
    """
    dimension = velocity.shape[1]
    for i in prange(len(free_nodes)):
        node = free_nodes[i]
        total = 0.0
        heaviest = 0.0
        for s in range(sum_start[i], sum_start[i + 1]):
            total += sum_weights[s] * slot_values[sum_slots[s], dimension]
            heaviest = max(heaviest, slot_values[sum_slots[s], 2 * dimension + 1])
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
            acceleration[node, j] = force / total
            velocity[node, j] = v + time_step * force / max(total, heaviest)
            displacement[node, j] += time_step * velocity[node, j]
