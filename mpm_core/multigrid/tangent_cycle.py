"""The V-cycle of rock as it flows now: on all levels the consistent tangent takes the place of elastic stiffness.

Where much rock flows the elastic V-cycle is far too stiff, and Anderson acceleration needs hundreds of cycles. On the
finest level each particle takes off its own tangent (kernels.tangent_rows), on a coarser one each cell the mean of its
parts', as far as its centre feels it. They are not symmetric unless flow is associated. Their symmetric parts would
have negative eigenvalues and need more iterations. STIFFNESS_SHARE_KEPT keeps rock that lost all stiffness from being
torn.
"""

from itertools import pairwise

import numpy as np

from mpm_core.kernels.tangent_rows import make_measure_tangents
from mpm_core.model.model import Model
from mpm_core.multigrid.cell_entries import pack
from mpm_core.multigrid.flow_forces import FlowForces
from mpm_core.multigrid.level import Level

STIFFNESS_SHARE_KEPT = 0.01  # The V-cycle keeps this share of the stiffness that flow takes off.


def measure(model: Model, flow: FlowForces, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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


def merge(cells: np.ndarray, matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums of matrices (k, 36) over equal cells (k,): cells, ascending, and their sums."""
    order = np.argsort(cells, kind="stable")
    cells = cells[order]
    start = np.flatnonzero(np.append(True, cells[1:] != cells[:-1])) if len(cells) else np.empty(0, np.int64)
    return cells[start], np.add.reduceat(matrices[order], start, axis=0) if len(cells) else matrices


def set_tangents(levels: list[Level], model: Model, flow: FlowForces, values: np.ndarray) -> None:
    """Take the tangents at displacement `values` over on all levels, finest first."""
    corners = 1 << model.dimension
    cells, slopes, matrices = measure(model, flow, values)
    levels[0].operator.tangents = pack(levels[0].siblings, cells, slopes, matrices, levels[0].operator.precision)
    for fine, coarse in pairwise(levels):
        assert fine.coarse_of_cell is not None  # only the coarsest level has none
        assert fine.kept is not None
        cells, matrices = merge(fine.coarse_of_cell[cells], matrices)
        matrices *= fine.kept[cells, None]
        centre = np.zeros((len(cells), corners, model.dimension))
        centre[:, 1 << np.arange(model.dimension), np.arange(model.dimension)] = 1.0
        coarse.operator.tangents = pack(coarse.siblings, cells, centre, matrices, coarse.operator.precision)


def drop_tangents(levels: list[Level]) -> None:
    """Make the levels elastic again."""
    for level in levels:
        level.operator.tangents = None
