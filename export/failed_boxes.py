"""Failed rock of a state as boxes of a lattice: whole cells, and in partly failed or partly mined cells parts of them.

A cell holds particles on a regular grid, or one particle that stands for all that the cell has of its material. What a
cell has is known by its 64 samples (mpm_core/model/occupancy.py). The unit of the lattice is the largest length of
which sub-cells of samples and of particles in finest cells are multiples.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from common.errors import InputError
from mpm_core.files.state_datasets import read_grid, read_pieces, read_unsupported
from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.model.occupancy import ALL_SAMPLES, Pieces, changes_of
from mpm_core.scene.scene import Excavation

ROCK = -1  # Excavation of a particle of rock.
CELLS_AT_ONCE = 1 << 14  # Partly failed cells that are divided at once.


class Boxes(NamedTuple):
    """Cubes (2-D: squares) that do not overlap: lower corner (box, d) and edge (box,) int64, units of the lattice.

    per_cell: units along the edge of a finest cell. widths: all edges that a box may have, ascending; each divides the
    next one, and a box lies on a multiple of its edge.
    """

    lower: NDArray
    width: NDArray
    per_cell: int
    widths: tuple[int, ...]

    def volume(self, grid: MultiLevelGrid) -> float:
        """Volume of all boxes in undistorted cells, m3 (2-D: m2)."""
        return float(np.sum((self.width * grid.fine_cell / self.per_cell) ** grid.dimension))


def is_failed(state: xr.Dataset) -> NDArray:
    """Particles (particle,) bool of rock that has failed up to the end of a state and is not mined."""
    return (state["excavation"].values == ROCK) & (state["volume"].values > 0.0) & (state["failed"].values >= 0)


def rock_samples(state: xr.Dataset, first: xr.Dataset, excavations: list[dict], grid: MultiLevelGrid) -> NDArray:
    """Samples of each cell that are rock at the end of a state, (cell,) uint64.

    first: dataset of grid.nc; excavations: settings of the scene up to this state, from its attribute `scene`.
    """
    finest = read_pieces(first)
    cell = holding_cells(grid, finest.place)
    kept = grid.cell_level[cell] == grid.levels - 1
    pieces = Pieces(cell[kept], finest.excavation[kept], finest.samples[kept])
    when = tuple(Excavation(one["name"], one["mined"], one["fill"], one["filled"]) for one in excavations)
    changes = changes_of(pieces, when, read_unsupported(state))
    return changes.rock_samples(len(grid.cell_level), int(state.attrs["step_index"]))


def first_particles(spacing: NDArray, cell_size: NDArray, dimension: int) -> NDArray:
    """First rock particle of each cell, and at the end their number: (cell + 1,) int64.

    spacing (particle,) m of the rock particles, cell after cell; a cell has (size / spacing)^d of them. Particles that
    move keep this order.
    """
    start = np.zeros(len(cell_size) + 1, np.int64)
    if len(spacing) == len(cell_size):
        return np.arange(len(cell_size) + 1)
    at = 0
    for cell, size in enumerate(cell_size.tolist()):
        if at >= len(spacing):
            break
        at += round(size / spacing[at]) ** dimension
        start[cell + 1] = at
    if at != len(spacing):
        raise InputError("a state whose particles are not those of its cells; run the pipeline from the grid")
    return start


def failed_boxes(state: xr.Dataset, first: xr.Dataset, excavations: list[dict]) -> Boxes:
    """The failed rock of a state, see `is_failed`. Arguments: see `rock_samples`."""
    grid = read_grid(state)[0]
    rock = state["excavation"].values == ROCK
    failed, volume = is_failed(state)[rock], state["volume"].values[rock]
    start = first_particles(state["spacing"].values[rock], grid.cell_size, grid.dimension)
    count = np.diff(start)
    samples = rock_samples(state, first, excavations, grid)
    failed_here = np.add.reduceat(failed, start[:-1], dtype=np.int64)
    whole = (failed_here == count) & (samples == ALL_SAMPLES)
    partly = np.flatnonzero((failed_here > 0) & ~whole)

    along = round(SAMPLES_PER_CELL ** (1 / grid.dimension))
    edges = np.rint(count[partly] ** (1 / grid.dimension)).astype(np.int64)
    per_cell = math.lcm(along, *np.unique(edges).tolist())
    widths = chain_of_widths(per_cell, grid.levels)
    lower, width = (
        [grid.cell_index[whole].astype(np.int64) * per_cell],
        [grid.cell_width[whole].astype(np.int64) * per_cell],
    )
    for per_edge in np.unique(edges):
        of_edge = partly[edges == per_edge]
        for at in range(0, len(of_edge), CELLS_AT_ONCE):
            cells = of_edge[at : at + CELLS_AT_ONCE]
            particles = start[cells][:, None] + np.arange(per_edge**grid.dimension)
            full = cell_volumes(grid, cells) * float(state.attrs["thickness"])
            share = np.where(failed[particles], volume[particles], 0.0).sum(axis=1) / full
            held = held_units(samples[cells], failed[particles], share, per_cell, grid.dimension)
            origin = grid.cell_index[cells].astype(np.int64) * per_cell
            for own, of_cell, size in merged(held, widths[: widths.index(per_cell) + 1]):
                scale = grid.cell_width[cells][of_cell].astype(np.int64)
                for level in np.unique(scale):  # of a coarse cell with 27 particles a third, which is no edge of a box
                    here = scale == level
                    edge = max(one for one in widths if (size * level) % one == 0)
                    lower.append(divided(origin[of_cell[here]] + own[here] * level, size * level, edge))
                    width.append(np.full(len(lower[-1]), edge))
    return Boxes(np.concatenate(lower), np.concatenate(width), per_cell, widths)


def divided(lower: NDArray, width: int, edge: int) -> NDArray:
    """Lower corners (k, d) of the boxes of an edge into which boxes (n, d) of a width are divided."""
    dimension = lower.shape[1]
    steps = np.stack(np.meshgrid(*[np.arange(width // edge) * edge] * dimension, indexing="ij"), axis=-1)
    return (lower[:, None] + steps.reshape(-1, dimension)).reshape(-1, dimension)


def cell_volumes(grid: MultiLevelGrid, cells: NDArray) -> NDArray:
    """Volume of some cells (k,) as cubes, m3 (2-D: m2)."""
    return grid.cell_size[cells] ** grid.dimension


def chain_of_widths(per_cell: int, levels: int) -> tuple[int, ...]:
    """Edges of boxes from the lattice's unit to the coarsest cell, each a multiple of the one before.

    >>> chain_of_widths(12, 2)
    (1, 2, 4, 12, 24)
    """
    widths, left = [1], per_cell
    for factor in (2, 3, 5, 7):
        while left % factor == 0:
            widths.append(widths[-1] * factor)
            left //= factor
    return (*widths, *(per_cell << level for level in range(1, levels)))


def held_units(samples: NDArray, failed: NDArray, share: NDArray, per_cell: int, dimension: int) -> NDArray:
    """Units of the lattice that failed rock has of some cells, (cell, per_cell, ..., per_cell) bool, axes x, y, z.

    samples (cell,) uint64: rock of each cell; failed (cell, particle) bool; share (cell,): volume of the failed
    particles over that of the cell as a cube. Where several particles share what a cell has left, each has the same
    share of all samples, wherever these are. There, units of other particles are taken, or some left, so that the
    volume is that of the particles.
    """
    units = np.arange(per_cell)
    along, edge = round(SAMPLES_PER_CELL ** (1 / dimension)), round(failed.shape[1] ** (1 / dimension))
    bits = ((samples[:, None] >> np.arange(SAMPLES_PER_CELL, dtype=np.uint64)) & np.uint64(1)).astype(bool)
    rock = bits[:, _numbers(units * along // per_cell, along, dimension)]
    own = failed[:, _numbers(units * edge // per_cell, edge, dimension)]
    held = rock & own
    shared = np.flatnonzero((samples != ALL_SAMPLES) & (edge > 1) & (edge < along))
    if len(shared):
        wanted = np.rint(share[shared] * per_cell**dimension).astype(np.int64)
        rank = (2 * ~rock[shared] + ~own[shared]).reshape(len(shared), -1)
        order = np.argsort(rank, axis=1, kind="stable")
        place = np.argsort(order, axis=1, kind="stable")
        held[shared] = (place < wanted[:, None]).reshape(held[shared].shape)
    return held


def _numbers(place: NDArray, edge: int, dimension: int) -> NDArray:
    """Number, x fastest, of the sub-cell of `edge` along each axis that holds each unit; place (unit,): its row."""
    number = np.zeros((len(place),) * dimension, np.int64)
    for axis in range(dimension):
        number += (place * edge**axis).reshape([-1 if other == axis else 1 for other in range(dimension)])
    return number


def merged(held: NDArray, widths: tuple[int, ...]) -> Iterator[tuple[NDArray, NDArray, int]]:
    """Yield units that are held (cell, n, ..., n) bool as boxes: lower corners (k, d), cell (k,) and the boxes' edge.

    widths: edges from the unit to the whole cell. Boxes of one edge that fill one of the next edge are merged.
    """
    dimension = held.ndim - 1
    for width, wider in zip(widths, (*widths[1:], 0), strict=True):
        parents: NDArray = held
        if wider:
            factor = wider // width
            shape = [len(held)]
            for size in held.shape[1:]:
                shape += [size // factor, factor]
            parents = np.asarray(held.reshape(shape).all(axis=tuple(range(2, 2 * dimension + 1, 2))))
            inside = parents
            for axis in range(1, dimension + 1):
                inside = np.repeat(inside, factor, axis=axis)
            held = held & ~inside
        cell, *place = np.nonzero(held)
        yield np.stack(place, axis=1) * width, cell, width
        held = parents
