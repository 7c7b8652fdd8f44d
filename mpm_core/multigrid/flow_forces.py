"""Failed rock on the rows of the elastic operator: what its flow takes off the elastic forces."""

from collections.abc import Callable

import numpy as np
from numba import parallel_chunksize

from mpm_core.kernels.flow_rows import make_add_flow_forces, total_stresses
from mpm_core.model.model import Model
from mpm_core.model.state import State
from mpm_core.multigrid.siblings import Siblings
from mpm_core.simd.lanes import LANES


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

    def take_in(self, particles: np.ndarray) -> None:
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

    def begin(self, state: State, take_back_flow: Callable[[], None]) -> None:
        """Displacements count from this state; take_back_flow: makes its stress that of rock that has not flowed."""
        total_stresses(self.particles, state.stress, self.model.insitu, self.carried)
        take_back_flow()
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
