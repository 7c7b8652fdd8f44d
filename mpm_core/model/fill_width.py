"""The share of its width over which fill takes the closure of its walls.

Fill that shares a cell with stiffer rock bears nothing (Model.volumes): the cells next to it take the closure of the
full width, and would act as stiffer fill. With the stiffness of fill times their share of the width, their stress is
that of fill over the full width, and so is the energy of all of it.
"""

import numpy as np

from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.grid.splitting import code_of
from mpm_core.model.occupancy import NO_SAMPLES, Changes
from mpm_core.model.particles import Particles

# Tangent of the angle between walls and faces of cells at which fill needs no factor. Nodes on the far side of a cell
# with little rock in it move with that less and less, the more obliquely a wall cuts its cells: plane strain, turned by
# 15, 30 and 45 degrees.
MAX_SLOPE = 0.47
SHARES = 64  # Shares of a width are multiples of 1 / SHARES: each has rows of its own in a model's tables.


def fill_shares(
    particles: Particles, changes: Changes, grid: MultiLevelGrid, placed: np.ndarray, shear: np.ndarray
) -> np.ndarray:
    """Share (particle,) of the width of fill that takes the closure; 1 for rock.

    placed (excavation,): steps in which fill is placed; shear (material,) modulus, Pa. Fill that comes or goes later
    changes nothing.
    """
    share, cells = np.ones(particles.count), len(grid.cell_level)
    fill = np.flatnonzero(~particles.is_rock)
    of_rock = shear[particles.material[particles.group_start[:cells]]]  # the first groups are those of rock
    stiff = np.zeros(cells, bool)
    stiff[particles.cell[fill]] = shear[particles.material[fill]] >= of_rock[particles.cell[fill]]
    step_of = placed[particles.excavation[fill]]
    for step in np.unique(step_of):
        rock, solid = changes.rock_samples(cells, step), changes.solid_samples(cells, step)
        filled = np.bitwise_count(solid & ~rock) / SAMPLES_PER_CELL
        own, cell = fill[step_of == step], np.flatnonzero(filled)
        new = np.isin(cell, particles.cell[own])
        if not new.any():  # It fell as it was placed.
            continue
        of_cell = np.ones(cells)
        bears = ((rock == NO_SAMPLES) | stiff)[cell]
        of_cell[cell[new]] = width_shares(grid.cell_index[cell], filled[cell], bears, new)
        share[own] = np.maximum(np.rint(SHARES * of_cell[particles.cell[own]]), 1.0) / SHARES
    return share


def width_shares(place: np.ndarray, fill: np.ndarray, bears: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Factor (k,) on the stiffness of fill in the chosen cells: the share of its width that lies in cells which bear
    stress; 1 if there are none, or if its walls lie obliquely by MAX_SLOPE or more.

    place (cell, d) in the lattice, each once; fill (cell,) share of each that is fill, above 0; bears, chosen (cell,)
    bool. The width is along the axis on which it is smallest, as far as cells with fill are next to each other.
    """
    own = place[chosen]
    width, share = np.full(len(own), np.inf), np.ones(len(own))
    near = (place >= own.min(axis=0) - 1) & (place <= own.max(axis=0) + 1)
    for axis in range(place.shape[1]):
        beside = np.flatnonzero(np.delete(near, axis, axis=1).all(axis=1))  # runs of the chosen, and next to them
        run = _runs(place[beside], axis)
        total, bearing = np.bincount(run, fill[beside]), np.bincount(run, np.where(bears, fill, 0.0)[beside])
        slope = _slopes(place[beside], axis, run, fill[beside], bears[beside])
        factor = 1.0 - (1.0 - bearing / total) * np.maximum(0.0, 1.0 - slope / MAX_SLOPE)
        of_chosen = run[chosen[beside]]
        narrower = (total[of_chosen] < width - 1e-9) & (bearing[of_chosen] > 0.0)
        width[narrower], share[narrower] = total[of_chosen][narrower], factor[of_chosen][narrower]
    return share


def _runs(place: np.ndarray, axis: int) -> np.ndarray:
    """Number (cell,) of the run of cells next to each other along an axis that each of these cells (cell, d) is in."""
    others = np.delete(place, axis, axis=1)
    order = np.lexsort((place[:, axis], *others.T))
    apart = (np.diff(others[order], axis=0) != 0).any(axis=1) | (np.diff(place[order, axis]) != 1)
    run = np.empty(len(place), np.int64)
    run[order] = np.cumsum(np.append(0, apart)[: len(place)])
    return run


def _slopes(place: np.ndarray, axis: int, run: np.ndarray, fill: np.ndarray, bears: np.ndarray) -> np.ndarray:
    """Mean slope (run,) of the walls at both ends of runs along an axis, against faces of cells: how far they lie from
    the ends of the runs beside them. 0 for a run that has none beside it."""
    count = run.max(initial=-1) + 1
    along = place[:, axis]
    first, last = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(first, run[bears], along[bears])
    np.maximum.at(last, run[bears], along[bears])
    ends = np.stack([first, last], axis=1)
    ends[:, 0] -= np.bincount(run, np.where(along < first[run], fill, 0.0), minlength=count)
    ends[:, 1] += np.bincount(run, np.where(along > last[run], fill, 0.0), minlength=count)
    lower = place.min(axis=0, initial=0) - 1
    shape = place.max(axis=0, initial=0) + 2 - lower
    code, chosen = code_of(place - lower, shape), np.flatnonzero(bears)
    order = np.argsort(code)
    square = np.zeros(count)
    for other in range(place.shape[1]):
        if other == axis:
            continue
        step = np.eye(place.shape[1], dtype=np.int64)[other]
        beside = code_of(place[chosen] + step - lower, shape)
        found = order[np.minimum(np.searchsorted(code[order], beside), len(code) - 1)]
        pair = (code[found] == beside) & bears[found]
        one, two = run[chosen[pair]], run[found[pair]]
        apart = np.abs(ends[one] - ends[two]).mean(axis=1)
        both = np.concatenate([one, two])
        pairs = np.bincount(both, minlength=count)
        square += (np.bincount(both, np.tile(apart, 2), minlength=count) / np.maximum(pairs, 1)) ** 2
    return np.sqrt(square)
