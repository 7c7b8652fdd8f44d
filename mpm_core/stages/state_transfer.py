"""A state transferred to a grid whose cells are those of the old one, or parts of them.

The displacement of a split cell is trilinear between its corners. Its parts take it from there, and as the
rock in it is intact their stress and hourglass forces are those of elastic rock that has moved so since virgin. A
uniform strain goes over unchanged; of any other the parts feel more than the one point of the cell did, and are no
longer in equilibrium. Cells that are not split keep what they have, to the bit.
"""

from dataclasses import replace

import numpy as np
from numba import njit, prange

from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.distorted_cells import corner_offsets
from mpm_core.kernels.modes import hourglass_shares
from mpm_core.kernels.nodal_operations import spread_to_hanging
from mpm_core.model.model import Model
from mpm_core.model.occupancy import Unsupported
from mpm_core.model.particles import bending_stiffness
from mpm_core.model.state import ARRAYS, Extent, State

NO_SOURCE = -1  # Particle without a source among the old ones.


def transfer(old: Model, state: State, new: Model) -> State:
    """The state of a model as that of another of the same scene, whose cells are the old ones or parts of them.

    Arrays of particles that only failed rock changes (Extent) are copied by their declaration. Every other array needs
    a line here, or it is that of virgin rock, as the velocity is (tests/mechanics/test_state.py).
    """
    origin = holding_cells(old.grid, new.grid.cell_index)
    result = new.virgin_state()
    source, as_before = _sources(old, new, origin)
    found = np.flatnonzero(source >= 0)
    result.failed[found] = state.failed[source[found]]
    failed = np.flatnonzero(result.failed >= 0)
    for name, array in ARRAYS.items():
        if array.dims[0] == "particle" and array.start is not None and array.changes is not Extent.ALL:
            getattr(result, name)[failed] = getattr(state, name).take(source[failed], axis=0)
    _take_rows(source, state.stress, result.stress)
    kept = np.where(new.grid.cell_level == old.grid.cell_level[origin], origin, NO_SOURCE)
    _take_rows(kept, *(values.reshape(len(values), -1) for values in (state.hourglass_force, result.hourglass_force)))
    result.displacement[:] = transfer_nodes(old, state.displacement, new, origin)
    result.energy[:] = state.energy
    recomputed = np.flatnonzero((source >= 0) & ~as_before & (result.failed < 0) & new.particles.is_rock)
    result.stress[recomputed] = elastic_stress(new, result.displacement, recomputed)
    changed = np.unique(new.particles.cell[(source >= 0) & ~as_before])
    result.hourglass_force[changed] = elastic_hourglass(new, result.displacement, changed)
    return result


def transfer_nodes(old: Model, values: np.ndarray, new: Model, origin: np.ndarray | None = None) -> np.ndarray:
    """Nodal values (node, component) of the old grid at the nodes of the new one, trilinear between corners.

    origin (new cell,): the old cell that holds each.
    """
    origin = holding_cells(old.grid, new.grid.cell_index) if origin is None else origin
    result = np.empty((len(new.grid.node_index), values.shape[1]))
    grids = (old.grid.cell_index, new.grid.cell_index, old.grid.cell_level, new.grid.cell_level)
    _interpolate_corners(old.cell_nodes, new.cell_nodes, origin, *grids, old.grid.levels, values, result)
    shifted = np.flatnonzero(np.logical_or.reduce(new.node_shift.T))  # rows are short: by column
    if len(shifted):
        _transfer_shifted(old, values, new, shifted, result)
    spread_to_hanging(new.hanging, new.grid.node_parents, result)
    return result


def _transfer_shifted(old: Model, values: np.ndarray, new: Model, nodes: np.ndarray, result: np.ndarray) -> None:
    """Values of the old grid where nodes (k,) of the new one that are moved lie: result (node, component), there.

    One that was moved there before has its value; where the old grid has a cube, that is trilinear between its corners.
    """
    place = new.grid.node_index[nodes] + new.node_shift[nodes]
    first, around = np.full(len(new.grid.node_index), len(new.cell_nodes), np.int64), new.particles.distorted.cell
    np.minimum.at(first, new.cell_nodes[around], around[:, None])  # all cells of a moved node are distorted
    same = holding_cells(old.grid, new.grid.cell_index[first[nodes]])
    was = np.zeros(len(nodes), bool)
    corners = old.cell_nodes[same]
    there = (old.grid.node_index[corners] == new.grid.node_index[nodes][:, None]).all(axis=2)
    held = there.any(axis=1)
    corner = corners[np.arange(len(nodes)), there.argmax(axis=1)]
    was[held] = old.node_shift[corner[held]].any(axis=1)
    moved = np.flatnonzero(~was)
    cell = holding_cells(old.grid, np.floor(place[moved]).astype(np.int32))
    moved, cell = moved[cell >= 0], cell[cell >= 0]
    within = (place[moved] - old.grid.cell_index[cell]) / old.grid.cell_width[cell][:, None]
    bits = corner_offsets(old.grid.dimension)
    shape = np.prod(np.where(bits == 1, within[:, None, :], 1.0 - within[:, None, :]), axis=2)
    result[nodes[moved]] = np.einsum("kc,kcj->kj", shape, values[old.cell_nodes[cell]])


def transfer_forces(old: Model, forces: np.ndarray, new: Model) -> np.ndarray:
    """Nodal forces (node, d) N of the old grid, which stay at their nodes; new nodes have none."""
    origin = holding_cells(old.grid, new.grid.cell_index)
    place = new.grid.cell_index - old.grid.cell_index[origin]
    result = np.zeros((len(new.grid.node_index), forces.shape[1]))
    _take_corners(
        old.cell_nodes, new.cell_nodes, origin, place, old.grid.cell_width[origin], new.grid.cell_width, forces, result
    )
    return result


def renumber_nodes(old: Model, state: State, new: Model) -> None:
    """Nodal arrays of a state of a model as those of another on the same cells, whose phantom nodes are others.

    A node moves as that of its rock did, where it has rock: fill and void have none of their own.
    """
    if new.grid is old.grid:
        return
    cells = len(new.cell_nodes)
    rock, solid = (samples(cells, new.step) != 0 for samples in (new.changes.rock_samples, new.changes.solid_samples))
    for name, array in ARRAYS.items():
        if array.dims[0] == "node":
            values = getattr(state, name)
            parted = np.empty((len(new.grid.node_index), values.shape[1]))
            for chosen in (~solid, solid & ~rock, rock):
                parted[new.cell_nodes[chosen]] = values[old.cell_nodes[chosen]]
            setattr(state, name, parted)


def renumber_forces(old: Model, forces: np.ndarray, new: Model) -> np.ndarray:
    """Nodal forces (node, d) N of a model at the nodes of another on the same cells: of those that stand where one was,
    the first has its force."""
    if new.grid is old.grid:
        return forces
    first, same = np.full(len(forces), len(new.grid.node_index)), old.cell_nodes == new.cell_nodes
    first[old.cell_nodes[same]] = old.cell_nodes[same]
    np.minimum.at(first, old.cell_nodes[~same], new.cell_nodes[~same])  # few of them: it takes long
    result = np.zeros((len(new.grid.node_index), forces.shape[1]))
    np.add.at(result, first, forces)
    return result


def transfer_unsupported(old: Model, new_index: np.ndarray) -> Unsupported:
    """Rock and fill that have lost their support, in cells with these lower corners (cell, d), fine units, in Morton
    order."""
    unsupported = old.unsupported
    if not len(unsupported.cell):
        return unsupported
    origin = holding_cells(old.grid, new_index)  # ascending, as both grids are in Morton order
    first, end = np.searchsorted(origin, unsupported.cell), np.searchsorted(origin, unsupported.cell, side="right")
    part = np.repeat(np.arange(len(first)), end - first)
    cell = np.arange(len(part)) - np.repeat(np.cumsum(end - first) - (end - first), end - first) + first[part]
    return replace(unsupported.of(part), cell=cell.astype(np.int32))


def _sources(old: Model, new: Model, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The old particle (particle,) that each new one continues, the nearest of its cell and material, or NO_SOURCE; and
    whether it is the same (particle,) bool: of a cell with the same points."""
    groups = [model.particles.group_start for model in (old, new)]
    counts = [np.diff(start) for start in groups]
    cells = len(old.cell_nodes)
    keys = []
    for model, start, of_cell in ((old, groups[0], np.arange(cells)), (new, groups[1], origin)):
        owner, cell = (column[start[:-1]] for column in (model.particles.excavation, model.particles.cell))
        keys.append((owner.astype(np.int64) + 1) * cells + of_cell[cell])
    order = np.argsort(keys[0])
    group = order[np.minimum(np.searchsorted(keys[0], keys[1], sorter=order), len(order) - 1)]
    there = keys[0][group] == keys[1]
    new_cell = new.particles.cell[groups[1][:-1]]
    whole = new.grid.cell_level[new_cell] == old.grid.cell_level[origin[new_cell]]
    bent = new.particles.distorted.rows(new_cell) >= 0
    whole &= bent == (old.particles.distorted.rows(origin[new_cell]) >= 0)
    same = there & whole & (counts[0][group] == counts[1])
    source = np.full(new.particles.count, NO_SOURCE, np.int64)
    of_particle = np.repeat(np.arange(len(group)), counts[1])
    within = np.arange(new.particles.count) - groups[1][of_particle]
    as_before = same[of_particle]
    source[as_before] = (groups[0][group[of_particle]] + within)[as_before]
    rest = np.flatnonzero(there[of_particle] & ~as_before)
    _nearest(rest, group[of_particle[rest]], groups[0], old.particles.position, new.particles.position, source)
    return source, as_before


@njit(parallel=True, cache=True)
def _take_rows(source, values, result):
    """Copy rows `source` (k,) of values (n, m) to result (k, m), except rows whose source is NO_SOURCE."""
    for i in prange(len(source)):
        if source[i] != NO_SOURCE:
            for j in range(values.shape[1]):
                result[i, j] = values[source[i], j]


@njit(cache=True)
def _nearest(particles, group, group_start, old_position, position, source):
    """The particle of each one's old group (k,) that is nearest to it, the first of equal ones: source, written."""
    for i in range(len(particles)):
        least = np.inf
        for candidate in range(group_start[group[i]], group_start[group[i] + 1]):
            distance = 0.0
            for axis in range(position.shape[1]):
                distance += (position[particles[i], axis] - old_position[candidate, axis]) ** 2
            if distance < least:
                least = distance
                source[particles[i]] = candidate


@njit(error_model="numpy", cache=True)
def _take_corners(old_nodes, new_nodes, origin, place, old_width, width, values, result):
    """Values of old nodes at the corners of new cells that are the same nodes: place (cell, d) of each one's lower
    corner in its old cell, and edges (cell,) of both, fine units. result (node, component), written there."""
    for cell in range(len(origin)):
        for corner in range(new_nodes.shape[1]):
            same, there = 0, True
            for axis in range(place.shape[1]):
                at = place[cell, axis] + width[cell] * ((corner >> axis) & 1)
                there &= at == 0 or at == old_width[cell]
                same |= (at > 0) << axis
            if there:
                for j in range(values.shape[1]):
                    result[new_nodes[cell, corner], j] = values[old_nodes[origin[cell], same], j]


@njit(error_model="numpy", cache=True)
def _interpolate_corners(
    old_nodes, new_nodes, origin, old_index, new_index, old_level, new_level, levels, values, result
):
    """Values at the corners of new cells, parts of the old ones `origin` (new cell,): result (node, component),
    written; corners of cells that stay take theirs as they are.

    old_index, new_index (cell, d): lower corners, fine units; old_level, new_level (cell,), of so many levels.
    """
    corners, dimension = old_nodes.shape[1], old_index.shape[1]
    place = np.empty(dimension)
    for stays in range(2):
        for cell in range(len(origin)):
            before = origin[cell]
            if (new_level[cell] == old_level[before]) != (stays == 1):
                continue
            share = 1.0 / (1 << (new_level[cell] - old_level[before]))
            for axis in range(dimension):
                steps = new_index[cell, axis] - old_index[before, axis]
                place[axis] = steps / (1 << (levels - 1 - old_level[before]))
            for corner in range(corners):
                node = new_nodes[cell, corner]
                if stays:
                    for j in range(values.shape[1]):
                        result[node, j] = values[old_nodes[before, corner], j]
                    continue
                for j in range(values.shape[1]):
                    result[node, j] = 0.0
                for other in range(corners):
                    weight = 1.0
                    for axis in range(dimension):
                        at = place[axis] + share * ((corner >> axis) & 1)
                        weight *= at if (other >> axis) & 1 else 1.0 - at
                    for j in range(values.shape[1]):
                        result[node, j] += weight * values[old_nodes[before, other], j]


def _modal_sums(model: Model, displacement: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Sums (cell, mode, d) of the displacement at the corners of cells (k,), with the signs of each mode (modes.py)."""
    sums = displacement[model.cell_nodes[cells]]
    for axis in range(model.dimension):
        for corner in range(1 << model.dimension):
            if not corner >> axis & 1:
                low, high = sums[:, corner].copy(), sums[:, corner | 1 << axis].copy()
                sums[:, corner], sums[:, corner | 1 << axis] = low + high, high - low
    return sums


def elastic_stress(model: Model, displacement: np.ndarray, particles: np.ndarray) -> np.ndarray:
    """Stress (k, 6) Pa of intact particles (k,) whose nodes have moved by displacement (node, d) since virgin."""
    cells, place = np.unique(model.particles.cell[particles], return_inverse=True)
    sums = _modal_sums(model, displacement, cells)[place]
    gradient = np.einsum("kmj,kma->kja", sums, model.slopes[model.particles.row[particles]])
    size = model.grid.cell_size[model.particles.cell[particles]]
    gradient *= (2.0 / size / (1 << model.dimension))[:, None, None]
    lame, shear = model.elastic_constants[model.particles.material[particles]].T
    strain = np.zeros((len(particles), 3, 3))
    strain[:, : model.dimension, : model.dimension] = 0.5 * (gradient + gradient.transpose(0, 2, 1))
    stress = 2.0 * shear[:, None] * strain[:, (0, 1, 2, 1, 0, 0), (0, 1, 2, 2, 2, 1)]
    stress[:, :3] += (lame * np.trace(strain, axis1=1, axis2=2))[:, None]
    return stress


def elastic_hourglass(model: Model, displacement: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Hourglass forces (k, mode, d) N of cells (k,) of intact rock alone, full, that has moved so since virgin; zero
    where a cell holds more than one particle."""
    corners = 1 << model.dimension
    modes = [mode for mode in range(corners) if mode & (mode - 1)]
    own = model.particles.group_start[cells]  # groups of rock are in the order of cells
    alone = (np.diff(model.particles.group_start)[cells] == 1) & (
        np.diff(model.particles.cell_groups_start)[cells] == 1
    )
    lame, shear = model.elastic_constants[model.particles.material[own]].T
    size = model.grid.cell_size[cells]
    stiffness = model.bending_share[own] * bending_stiffness(lame, shear) * size ** (model.dimension - 2)
    sums = _modal_sums(model, displacement, cells)
    amplitude, row = sums[:, modes], model.particles.distorted.rows(cells)
    bent = np.flatnonzero(row >= 0)
    amplitude[bent] = np.einsum("kmn,knj->kmj", model.hourglass_patterns[row[bent]], sums[bent])
    shares = hourglass_shares(model.dimension)
    return amplitude * shares * np.where(alone, stiffness / corners, 0.0)[:, None, None]
