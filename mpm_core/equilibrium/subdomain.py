"""A part of the mine on its own: the cells around rock that has just failed, held still at their border.

A failure of one cell of a million is felt a few cells away. Where it spreads from there is found in the part alone; the
whole mine reaches equilibrium afterwards, with the part's border free again. What then fails, fails in the next part.
So the part says only in which order rock fails, not where the mine is in equilibrium: that is always checked on the
whole. Rock so near the border that its failure would feel it waits for the whole.
"""

import logging
from dataclasses import dataclass, replace

import numpy as np

from mpm_core.equilibrium.brittle import Brittle
from mpm_core.equilibrium.surroundings import Surroundings
from mpm_core.kernels.block_scatter import build_scatter
from mpm_core.kernels.nodal_operations import mark_nodes
from mpm_core.model.model import Model
from mpm_core.model.occupancy import Changes
from mpm_core.model.particles import Particles
from mpm_core.model.state import State, copy_from_part, copy_to_part


@dataclass(frozen=True)
class Part:
    """A part's own model, state (copies), volumes and rock that may fail, and where they stand in the whole mine.

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
        """Those of its particles (k,) whose failure, with all since it was cut out, leaves its border far enough."""
        failed = np.flatnonzero((self.state.failed >= 0) & ~self.failed_before)
        cells = self.model.particles.cell[np.concatenate([fresh, failed])]
        return fresh[self.surroundings.are_wide(self.model.grid.cell_index[cells])[: len(fresh)]]

    def give_back(self, state: State) -> None:
        """Write what has changed into the state of the whole mine."""
        copy_from_part(self.state, state, {"particle": self.particles, "node": self.nodes, "cell": self.cells})


def cut_out(
    model: Model, state: State, volume: np.ndarray, brittle: Brittle, around: Surroundings, fresh: np.ndarray
) -> Part:
    """The part that the cells around failures are; fresh (k,): those particles."""
    cells = around.cells
    chosen = np.zeros(len(model.cell_nodes), bool)
    chosen[cells] = True
    number = _numbers(cells, len(chosen))
    grid, nodes, cell_nodes, held = _crop_grid(model, chosen, cells)
    particles, indices = _crop_particles(model.particles, chosen, number)
    changes, pieces = model.changes, model.pieces.of(chosen[model.pieces.cell])
    ours = chosen[changes.cell]
    part = replace(
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
    known = model.hourglass_patterns[chosen[model.particles.distorted.cell]]
    vars(part)["hourglass_patterns"] = known  # else found anew for each part
    own = part.virgin_state()
    copy_to_part(state, own, {"particle": indices, "node": nodes, "cell": cells})
    failed_before = own.failed >= 0
    failed_before[np.searchsorted(indices, fresh)] = False
    logging.info("in a part of %d cells", len(cells))
    return Part(
        part,
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
    part = replace(
        grid,
        cell_index=grid.cell_index.take(cells, axis=0),
        cell_level=grid.cell_level[cells],
        vtk_nodes=number[grid.vtk_nodes.take(cells, axis=0)],
        node_index=grid.node_index.take(nodes, axis=0),
        node_parents=own,
        phantoms=0,  # none that could be taken off again
    )
    cell_nodes = number[model.cell_nodes.take(cells, axis=0)]
    return part, nodes, cell_nodes, model.held.take(nodes, axis=0) | shared[nodes, None]


def _crop_particles(particles: Particles, chosen: np.ndarray, number: np.ndarray) -> tuple[Particles, np.ndarray]:
    """Particles of the chosen cells (cell,) bool, and their indices in the whole; number (cell,): the part's cells."""
    groups = np.flatnonzero(chosen[particles.cell[particles.group_start[:-1]]])
    indices = np.flatnonzero(chosen[particles.cell])
    start = np.append(0, np.cumsum(np.diff(particles.group_start)[groups]))
    cell = number[particles.cell[indices]]
    group_cell = cell[start[:-1]]
    counts = np.bincount(group_cell, minlength=np.count_nonzero(chosen))
    per_particle = ("excavation", "material", "xi", "position", "spacing", "full_volume", "sample")
    return Particles(
        cell=cell,
        **{name: getattr(particles, name).take(indices, axis=0) for name in per_particle},
        group_start=start,
        group_table=particles.group_table[groups],
        cell_groups_start=np.append(0, np.cumsum(counts)),
        cell_groups=np.argsort(group_cell, kind="stable").astype(np.int32),
        modes=particles.modes,
        slopes=particles.slopes,
        shared_rows=particles.shared_rows,
        distorted=particles.distorted.of(chosen, number),
    ), indices


def _crop_brittle(brittle: Brittle, indices: np.ndarray, cells: np.ndarray, number: np.ndarray) -> Brittle:
    """Of the particles `indices` and the cells `cells`; number (cell,) of a cell in the part, -1 outside."""
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
        borne=None if brittle.borne is None else brittle.borne[indices],
    )
