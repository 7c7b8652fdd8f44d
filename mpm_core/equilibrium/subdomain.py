"""A subdomain of the mine: the cells around rock that has just failed, held still at their border.

A failure of one cell of a million is felt a few cells away. Where it spreads from there is found in the subdomain
alone; the whole mine reaches equilibrium afterwards, with the subdomain's border free again. What then fails, fails in
the next subdomain. So the subdomain determines only in which order rock fails, not where the mine is in equilibrium:
that is always checked on the whole. Rock so near the border that its failure would feel it waits for the whole.

The border is so far away that it may be held still. What a failed patch of half-width a changes decays as
(a / distance)^d in d dimensions. A border at distance R from its middle, held still, carries (a / R)^d of it: the
nearer the border, the less rock fails.
"""

import logging
from dataclasses import dataclass, replace

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for

from mpm_core.equilibrium.brittle import Brittle
from mpm_core.equilibrium.front import Front
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.kernels.block_scatter import build_scatter
from mpm_core.kernels.nodal_operations import mark_nodes
from mpm_core.model.model import Model
from mpm_core.model.occupancy import Changes
from mpm_core.model.particles import Particles
from mpm_core.model.state import State, copy_from_subdomain, copy_to_subdomain

CUBE_HALVINGS = {2: 2, 3: 1}
"""By dimension, a subdomain consists of cubes whose edge is a finest cell's, doubled this many times, and of larger
cells that hold such cubes. Failed cells in cubes that touch, if only at corners, are one patch."""
MAX_BORDER_SHARE = 0.02  # A border held still may carry this share, (a / R)^d, of what a patch changes.
# Distances from failed rock to the border, in finest cells. The subdomain has the largest that leaves it small enough.
REACH_CELLS = (40, 24, 16, 10, 6, 4)
MAX_SURROUNDINGS_SHARE = 0.25  # Largest share of the grid's cells in the subdomain around failed rock.
MAX_SURROUNDINGS_CELLS = 300_000  # Largest number of cells in the subdomain around failed rock.


class Cubes:
    """The cells that lie in, or hold, each cube of a box around a grid; where the domain goes on, the box has a margin.

    lower (d,): the box's first cube; present (cubes along each axis) bool: those of the grid; reaches: see REACH_CELLS;
    levels: for cells of a cube's size and smaller, then for those of each larger size, their indices and (flat) in
    which cube, or which group of 2^d, 4^d, ... cubes, they stand.
    """

    def __init__(self, grid: MultiLevelGrid):
        finest = grid.levels - 1
        self.halvings = min(CUBE_HALVINGS[grid.dimension], finest)
        self.reaches = sorted({cells >> self.halvings for cells in REACH_CELLS}, reverse=True)
        larger = finest - self.halvings
        first, last = grid.cell_index.min(axis=0) >> finest, grid.cell_index.max(axis=0) >> finest
        self.lower = np.maximum(first - 1, 0) << larger
        self.shape = np.minimum((last + 2) << larger, grid.shape >> self.halvings) - self.lower
        self.cells = len(grid.cell_level)
        self.levels = []
        for group in range(larger + 1):
            level = larger - group
            at = np.flatnonzero(grid.cell_level == level if group else grid.cell_level >= level).astype(np.int32)
            place = (grid.cell_index[at] >> self.halvings + group) - (self.lower >> group)
            self.levels.append((at, np.ravel_multi_index(tuple(place.T), self.shape >> group).astype(np.int32)))
        self.present = np.zeros(self.shape >> larger, bool)
        for group, (_, place) in reversed(list(enumerate(self.levels))):
            self.present.reshape(-1)[place] = True
            for axis in range(grid.dimension if group else 0):
                self.present = np.repeat(self.present, 2, axis)

    def around(self, failed: np.ndarray) -> "Surroundings | None":
        """Cells around failed ones (k, d), cell_index of finest cells, each patch with a border far enough for it.

        None where they are too many, or a patch is too wide.
        """
        places, _, patch, reach = self.patches(failed)
        if reach.max() > self.reaches[0]:
            return None
        within = np.zeros(self.shape, np.int8)  # how many of the reaches: the widest first, each holds the next
        for number, least in enumerate(self.reaches, 1):
            for place, most in zip(places, np.maximum(reach, least)[patch], strict=True):
                within[_within(place, most)] = number
        within *= self.present
        of_cells = self._of_cells(within)
        for number in range(1, len(self.reaches) + 1):
            chosen = np.flatnonzero(of_cells >= number)
            if len(chosen) <= min(MAX_SURROUNDINGS_SHARE * self.cells, MAX_SURROUNDINGS_CELLS):
                return Surroundings(self, within >= number, chosen)
        return None

    def patches(self, failed: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Cubes (cube, d) in the box that failed cells, cell_index (k, d), stand in, and the cube of each (k,); the
        patch (cube,) that they belong to, and how many cubes there must be between it and its border (patch,).
        """
        place = (failed >> self.halvings) - self.lower
        flat, cube = np.unique(np.ravel_multi_index(tuple(place.T), self.shape), return_inverse=True)
        places = np.stack(np.unravel_index(flat, self.shape), axis=1)
        occupied = np.zeros(np.ptp(places, axis=0) + 1, bool)
        occupied[tuple((places - places.min(axis=0)).T)] = True
        labels, patches = scipy.ndimage.label(occupied, np.ones((3,) * occupied.ndim))
        patch = labels[tuple((places - places.min(axis=0)).T)] - 1
        every = np.arange(patches)
        widths = [
            scipy.ndimage.maximum(along, patch[cube], every) - scipy.ndimage.minimum(along, patch[cube], every)
            for along in failed.T
        ]
        half = 0.5 * (np.max(widths, axis=0) + 1) / (1 << self.halvings)
        reach = np.ceil(half * (MAX_BORDER_SHARE ** (-1.0 / failed.shape[1]) - 1.0)).astype(int)
        return places, cube, patch, reach

    def _of_cells(self, value: np.ndarray) -> np.ndarray:
        """For each cell (cell,) the largest value, of cubes along each axis, of those that it lies in or holds."""
        result = np.zeros(self.cells, value.dtype)
        for group, (at, place) in enumerate(self.levels):
            for axis in range(value.ndim if group else 0):
                even, odd = (value[(slice(None),) * axis + (slice(first, None, 2),)] for first in range(2))
                value = np.maximum(even, odd)
            result[at] = value.reshape(-1)[place]
        return result


@dataclass(frozen=True)
class Surroundings:
    """Cells (k,), indices, ascending, that lie in cubes, or hold one: near (cubes along each axis of the box) bool."""

    cubes: Cubes
    near: np.ndarray
    cells: np.ndarray

    def reach_beyond(self, places: np.ndarray, cubes: int) -> np.ndarray:
        """(k,) bool: True where they end within so many cubes of places (k, d), fine units, that lie in them."""
        inner = scipy.ndimage.minimum_filter(self.near, 2 * cubes + 1, mode="constant", cval=1)
        return ~inner[tuple(((places >> self.cubes.halvings) - self.cubes.lower).T)]

    def are_wide(self, failed: np.ndarray) -> np.ndarray:
        """(k,) bool: True where a border held still carries at most the share MAX_BORDER_SHARE of what each one's patch
        changes.

        failed (k, d): cell_index of finest cells, all of them in these.
        """
        if not len(failed):
            return np.empty(0, bool)
        places, cube, patch, reach = self.cubes.patches(failed)
        wide = np.ones(len(reach), bool)
        for place, one in zip(places, patch, strict=True):
            wide[one] &= self.near[_within(place, reach[one])].all()
        return wide[patch[cube]]


def _within(place: np.ndarray, reach: int) -> tuple[slice, ...]:
    """Cubes at most `reach` away from one (d,), corners too."""
    return tuple(slice(max(along - reach, 0), along + reach + 1) for along in place)


@dataclass(frozen=True)
class Subdomain:
    """A subdomain's own model, state (copies), volumes and rock that may fail, and its place in the whole mine.

    cells (cell,), nodes (node,), particles (particle,): indices in the whole, ascending; volume (particle,) m3;
    failed_before (particle,) bool: whether rock had failed before the failures that it is cut out for.
    """

    model: Model
    state: State
    volume: np.ndarray
    brittle: Brittle
    cells: np.ndarray
    nodes: np.ndarray
    particles: np.ndarray
    surroundings: Surroundings
    failed_before: np.ndarray

    def far_from_border(self, fresh: np.ndarray) -> np.ndarray:
        """Particles (k,) among these whose failure, with all since it was cut out, leaves its border far enough."""
        failed = np.flatnonzero((self.state.failed >= 0) & ~self.failed_before)
        cells = self.model.particles.cell[np.concatenate([fresh, failed])]
        return fresh[self.surroundings.are_wide(self.model.grid.cell_index[cells])[: len(fresh)]]

    def write_back(self, state: State) -> None:
        """Write what has changed into the state of the whole mine."""
        copy_from_subdomain(self.state, state, {"particle": self.particles, "node": self.nodes, "cell": self.cells})


def cut_out(
    model: Model, state: State, volume: np.ndarray, brittle: Brittle, around: Surroundings, fresh: np.ndarray
) -> Subdomain:
    """The subdomain of the cells around failures; fresh (k,): those particles."""
    cells = around.cells
    chosen = np.zeros(len(model.cell_nodes), bool)
    chosen[cells] = True
    number = _numbers(cells, len(chosen))
    grid, nodes, cell_nodes, held = _crop_grid(model, chosen, cells)
    particles, indices = _crop_particles(model.particles, chosen, number)
    changes, pieces = model.changes, model.pieces.of(chosen[model.pieces.cell])
    ours = chosen[changes.cell]
    own_model = replace(
        model,
        grid=grid,
        pieces=replace(pieces, cell=number[pieces.cell]),
        changes=Changes(number[changes.cell[ours]], changes.owner[ours], changes.step[ours], changes.samples[ours]),
        particles=particles,
        scatter=build_scatter(cell_nodes, grid.node_parents),
        cell_nodes=cell_nodes,
        body=model.body[cells],
        insitu=model.insitu.take(indices, axis=0),
        held=held,
        plain=grid,
        severed=model.severed[:0],
    )
    known = {  # else computed again for each subdomain
        "hourglass_patterns": model.hourglass_patterns[chosen[model.particles.distorted.cell]],
        "bending_share": model.bending_share[indices],
        "strength_scale": model.strength_scale[indices] if len(model.strength_scale) else model.strength_scale,
    }
    vars(own_model).update(known)
    own = own_model.virgin_state()
    copy_to_subdomain(state, own, {"particle": indices, "node": nodes, "cell": cells})
    failed_before = own.failed >= 0
    failed_before[np.searchsorted(indices, fresh)] = False
    logging.info("in a subdomain of %d cells", len(cells))
    return Subdomain(
        own_model,
        own,
        volume[indices],
        _crop_brittle(brittle, indices, cells, number),
        cells,
        nodes,
        indices,
        around,
        failed_before,
    )


def _numbers(indices: np.ndarray, count: int) -> np.ndarray:
    """The number (count,) int32 of each among indices (n,), -1 of the others."""
    number = np.full(count, -1, np.int32)
    number[indices] = np.arange(len(indices), dtype=np.int32)
    return number


def _crop_grid(model: Model, chosen: np.ndarray, cells: np.ndarray):
    """Grid of the chosen cells; their nodes (node,), cell_nodes (bit order); (node, d) bool: held.

    Nodes of other cells, too, are held, and the parents of hanging ones among them; some of those may lie outside.
    """
    grid = model.grid
    touched, shared = np.zeros((2, len(model.held)), bool)
    mark_nodes(model.cell_nodes, chosen, touched, shared)
    nodes = np.flatnonzero(touched)
    number = _numbers(nodes, len(touched))
    parents = grid.node_parents.take(nodes, axis=0)
    of_shared = parents[shared[nodes]]
    shared[of_shared[of_shared >= 0]] = True
    own = np.where(parents < 0, np.int32(-1), number[parents])
    own[((own < 0) & (parents >= 0)).any(axis=1)] = -1
    cropped = replace(
        grid,
        cell_index=grid.cell_index.take(cells, axis=0),
        cell_level=grid.cell_level[cells],
        vtk_nodes=number[grid.vtk_nodes.take(cells, axis=0)],
        node_index=grid.node_index.take(nodes, axis=0),
        node_parents=own,
        phantoms=0,  # none that could be taken off again
    )
    cell_nodes = number[model.cell_nodes.take(cells, axis=0)]
    return cropped, nodes, cell_nodes, model.held.take(nodes, axis=0) | shared[nodes, None]


def _crop_particles(particles: Particles, chosen: np.ndarray, number: np.ndarray) -> tuple[Particles, np.ndarray]:
    """Particles of the chosen cells (cell,) bool, and their indices in the whole; number (cell,): the subdomain's
    cells."""
    groups = np.flatnonzero(chosen[particles.cell[particles.group_start[:-1]]])
    indices = np.flatnonzero(chosen[particles.cell])
    start = np.append(0, np.cumsum(np.diff(particles.group_start)[groups]))
    cell = number[particles.cell[indices]]
    group_cell = cell[start[:-1]]
    counts = np.bincount(group_cell, minlength=np.count_nonzero(chosen))
    per_particle = ("excavation", "material", "position", "spacing", "full_volume", "sample")
    return Particles(
        cell=cell,
        **{name: getattr(particles, name).take(indices, axis=0) for name in per_particle},
        group_start=start,
        group_table=particles.group_table[groups],
        cell_groups_start=np.append(0, np.cumsum(counts)),
        cell_groups=np.argsort(group_cell, kind="stable").astype(np.int32),
        modes=particles.modes,
        slopes=particles.slopes,
        spreads=particles.spreads,
        shared_rows=particles.shared_rows,
        distorted=particles.distorted.of(chosen, number),
    ), indices


def _crop_brittle(brittle: Brittle, indices: np.ndarray, cells: np.ndarray, number: np.ndarray) -> Brittle:
    """The brittle rock of the particles `indices` and the cells `cells`; number (cell,) of a cell in the subdomain, -1
    outside."""
    place = _numbers(indices, len(brittle.present))
    sound, sliver, coarse = (
        place[kind][place[kind] >= 0].astype(np.int64) for kind in (brittle.sound, brittle.sliver, brittle.coarse)
    )
    first, end = brittle.neighbor_start[cells], brittle.neighbor_start[cells + 1]
    link_start = np.append(0, np.cumsum(end - first))
    links = np.arange(link_start[-1]) + np.repeat(first - link_start[:-1], end - first)
    neighbors = number[brittle.neighbors[links]]
    inside = np.append(0, np.cumsum(neighbors >= 0))
    return Brittle(
        present=brittle.present[indices],
        sound=sound,
        sliver=sliver,
        coarse=coarse,
        neighbor_start=inside[link_start],
        neighbors=neighbors[neighbors >= 0],
        front=_crop_front(brittle.front, place, cells, number),
    )


def _crop_front(front: Front, place: np.ndarray, cells: np.ndarray, number: np.ndarray) -> Front:
    """The front of the cells `cells`; place (particle,), number (cell,): in the subdomain, -1 outside."""
    across, rock = front.across[cells], front.rock[cells]
    return Front(
        np.where(across >= 0, number[across], -1).astype(np.int32),
        np.where(rock >= 0, place[rock], rock).astype(np.int64),
        front.part[cells],
    )
