"""The front of failing rock: the faces between sound rock and rock that has failed or is gone.

A cell knows the stress at its centre. Rock breaks where stress is largest, at the front, and the front moves on by
whole cells. Judged at its centre, a cell resists until the front could stand well within it: the zone of failed rock
ends short of its limit by a share of a cell, however small the cells. Judged at the face it goes too far, since every
step of the front is a whole cell. So a cell at the front is judged, and drops, by the stress REACH of a cell from its
centre towards the front, on the straight line through its neighbour behind. Judging alone is not enough: the drop from
the lower stress of the centre would be too small.
"""

from dataclasses import dataclass

import numpy as np

from mpm_core.grid.adjacency import cells_across
from mpm_core.kernels.failure import NO_ROCK, NOT_FINEST, stress_to_front
from mpm_core.model.model import Model
from mpm_core.model.state import State

REACH = 0.2  # cells


@dataclass(frozen=True)
class Front:
    """Cells whose rock is judged, and their neighbours.

    across (cell, 2 d) int32: see grid.adjacency.cells_across; rock (cell,) int64: the particle of its rock, NO_ROCK
    where less than half of it is rock, NOT_FINEST where it is larger than a finest cell or has several particles; part
    (cell,): share of the cell that its rock is.
    """

    across: np.ndarray
    rock: np.ndarray
    part: np.ndarray

    def stress_change(self, model: Model, state: State, particles: np.ndarray) -> np.ndarray:
        """Change of stress (k, 6) Pa from particles (k,) towards the front; 0 away from it."""
        change = np.empty((len(particles), 6))
        own = model.particles
        stress_to_front(
            particles, own.cell, self.across, self.rock, self.part, own.position, model.grid.fine_cell, REACH,
            state.failed, own.material, state.stress, model.insitu, change,
        )  # fmt: skip
        return change


def front_of(model: Model, step: int) -> Front:
    """The cells of a model once `step` is mined."""
    cells, own = len(model.cell_nodes), model.particles
    part = model.rock_share(step)
    first = own.group_start[:cells].astype(np.int64)  # the first groups are those of rock, one for each cell
    finest = model.grid.cell_level == model.grid.levels - 1
    lone = np.diff(own.group_start)[:cells] == 1
    rock = np.where(finest & lone, np.where(part >= 0.5, first, NO_ROCK), NOT_FINEST)
    return Front(cells_across(model.grid, np.flatnonzero(finest)), rock, part)
