"""Which cell a particle is in, and which particles a cell holds."""

import numpy as np
from numba import njit

from mpm_core.grid.adjacency import NO_CELL, cell_at

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
