"""Failed rock on the rows of the elastic operator: what its flow takes off the elastic forces."""

import numpy as np

from mpm_core.kernels.flow_rows import add_flow_forces
from mpm_core.kernels.lanes import LANES
from mpm_core.model import Model, State
from mpm_core.multigrid.families import Families
from mpm_core.multigrid.level import Operator


class FlowForces:
    """Forces by which failed rock differs from elastic rock of the same displacement.

    particles (k,): failed particles, by block of the operator's rows.
    """

    def __init__(self, model: Model, families: Families, particles: np.ndarray, volume: np.ndarray):
        """particles: indices, any order; volume (particle,) m3."""
        tables, corners = model.particles, 1 << model.dimension
        slot = families.cell_place[tables.cell[particles]] // LANES
        order = np.argsort(slot, kind="stable")
        self.model, self.volume, self.particles = model, volume, particles[order]
        cell, slot = tables.cell[self.particles], slot[order]
        self.block_start = np.searchsorted(slot // corners, families.batch_start)
        self.corner_rows = families.corner_rows(cell)
        self.slope = 2.0 / corners / model.grid.cell_size[cell]
        group = np.searchsorted(tables.group_start, self.particles, side="right") - 1
        self.table_row = tables.group_table[group] + self.particles - tables.group_start[group]
        self.trial_stress = np.empty((len(self.particles), 6))

    def begin(self, state: State) -> None:
        """Displacements count from this state, whose stress is that of rock that has not flowed."""
        self.trial_stress[:] = state.stress[self.particles] + self.model.insitu[self.particles]

    def add(self, operator: Operator, values: np.ndarray, forces: np.ndarray) -> None:
        """Add to `forces` what is not carried at displacement `values` (its copies filled in), both flat arrays."""
        model = self.model
        add_flow_forces(
            self.block_start,
            self.particles,
            self.corner_rows,
            self.slope,
            self.table_row,
            model.mode_values,
            operator.width,
            values,
            self.volume,
            model.particles.material,
            model.elastic_constants,
            model.residual_rows,
            self.trial_stress,
            forces,
        )
