"""Failed rock on the rows of the elastic operator: what its flow takes off elastic forces, and off the V-cycle.

In the V-cycle the consistent tangent of rock as it flows now takes the place of elastic stiffness, on all levels.
Where much rock flows the elastic V-cycle is far too stiff, and Anderson acceleration needs hundreds of cycles. On the
finest level each particle takes off its own tangent (kernels.flow_rows), on a coarser one each cell the mean of its
parts', as far as its centre feels it. They are not symmetric unless flow is associated. Their symmetric parts would
have negative eigenvalues and need more iterations. STIFFNESS_SHARE_KEPT keeps rock that lost all stiffness from being
torn.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numba import parallel_chunksize

from mpm_core.kernels.flow_rows import make_add_flow_forces, make_measure_tangents, total_stresses
from mpm_core.model.model import Model
from mpm_core.model.state import State
from mpm_core.multigrid.cell_entries import pack
from mpm_core.multigrid.level import Level
from mpm_core.multigrid.siblings import Siblings
from mpm_core.simd.lanes import LANES

STIFFNESS_SHARE_KEPT = 0.01  # The V-cycle keeps this share of the stiffness that flow takes off.


class FlowForces:
    """Forces by which failed rock differs from elastic rock of the same displacement.

    By failed particle (k,), in order of the operator's blocks: see kernels.flow_rows.
    """

    def __init__(self, model: Model, siblings: Siblings, volume: np.ndarray):
        """volume (particle,) m3."""
        self.model, self.siblings, self.volume = model, siblings, volume
        self.particles = self.block = self.order = np.empty(0, np.int64)
        self.corner_rows = np.empty((0, 1 << model.dimension), np.int32)
        self.slope, self.table_row = np.empty(0), np.empty(0, np.int64)

    def add_particles(self, particles: np.ndarray) -> None:
        """Rock that has failed besides: indices, ascending. The order of entries is that of all taken in at once."""
        tables, siblings, corners = self.model.particles, self.siblings, 1 << self.model.dimension
        cell = tables.cell[particles]
        batch = siblings.cell_place[cell] // (corners * LANES)
        block = np.searchsorted(siblings.batch_start, batch, side="right") - 1
        group = np.searchsorted(tables.group_start, particles, side="right") - 1
        more = {
            "order": block * tables.count + particles,
            "particles": particles,
            "block": block,
            "corner_rows": siblings.corner_rows(cell),
            "slope": 2.0 / corners / self.model.grid.cell_size[cell],
            "table_row": tables.group_table[group] + particles - tables.group_start[group],
        }
        ascending = np.argsort(more["order"])
        places = np.searchsorted(self.order, more["order"][ascending])
        for name, values in more.items():
            setattr(self, name, np.insert(getattr(self, name), places, values[ascending], axis=0))
        self.block_start = np.searchsorted(self.block, np.arange(len(siblings.batch_start)))
        self.carried, self.trial_stress = np.empty((2, len(self.particles), 6))

    def begin(self, state: State, undo_flow: Callable[[], None]) -> None:
        """Displacements count from this state; undo_flow: makes its stress that of rock that has not flowed."""
        total_stresses(self.particles, state.stress, self.model.insitu, self.carried)
        undo_flow()
        total_stresses(self.particles, state.stress, self.model.insitu, self.trial_stress)

    def add(self, values: np.ndarray, forces: np.ndarray) -> None:
        """Add to `forces` what falls short of elastic ones at displacement `values`, copies filled in; flat arrays."""
        model = self.model
        with parallel_chunksize(1):  # failed rock is in few of the blocks
            make_add_flow_forces(model.law, model.dimension)(
                self.block_start,
                self.particles,
                self.corner_rows,
                self.slope,
                self.table_row,
                model.slopes,
                values,
                self.volume,
                model.particles.material,
                model.elastic_constants,
                model.residual_rows,
                self.carried,
                self.trial_stress,
                forces,
            )


def measure_tangents(model: Model, flow: FlowForces, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rock that flows at displacement `values` (a flat array, copies filled in): cells (k,), slopes, matrices."""
    count = len(flow.particles)
    matrices, yields = np.empty((count, 36), np.float32), np.empty(count, bool)
    make_measure_tangents(model.law, model.dimension)(
        flow.particles, flow.corner_rows, flow.slope, flow.table_row, model.slopes, values, flow.volume,
        model.particles.material, model.elastic_constants, model.residual_rows, flow.trial_stress, matrices, yields,
    )  # fmt: skip
    if not yields.all():
        matrices = matrices[yields]
    matrices *= np.float32(1.0 - STIFFNESS_SHARE_KEPT)
    return model.particles.cell[flow.particles[yields]], model.slopes[flow.table_row[yields]], matrices


def sum_by_cell(cells: np.ndarray, matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums of matrices (k, 36) over equal cells (k,): cells, ascending, and their sums."""
    order = np.argsort(cells, kind="stable")
    cells = cells[order]
    start = np.flatnonzero(np.append(True, cells[1:] != cells[:-1])) if len(cells) else np.empty(0, np.int64)
    return cells[start], np.add.reduceat(matrices[order], start, axis=0) if len(cells) else matrices


def set_tangents(levels: list[Level], model: Model, flow: FlowForces, values: np.ndarray) -> None:
    """Take the tangents at displacement `values` over on all levels, finest first."""
    corners = 1 << model.dimension
    cells, slopes, matrices = measure_tangents(model, flow, values)
    levels[0].operator.tangents = pack(levels[0].siblings, cells, slopes, matrices, levels[0].operator.precision)
    for fine, coarse in pairwise(levels):
        assert fine.coarse_of_cell is not None  # only the coarsest level has none
        assert fine.kept is not None
        cells, matrices = sum_by_cell(fine.coarse_of_cell[cells], matrices)
        matrices *= fine.kept[cells, None]
        centre = np.zeros((len(cells), corners, model.dimension))
        centre[:, 1 << np.arange(model.dimension), np.arange(model.dimension)] = 1.0
        coarse.operator.tangents = pack(coarse.siblings, cells, centre, matrices, coarse.operator.precision)


def drop_tangents(levels: list[Level]) -> None:
    """Make the levels elastic again."""
    for level in levels:
        level.operator.tangents = None
