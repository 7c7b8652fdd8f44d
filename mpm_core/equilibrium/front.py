"""The front of failing rock: the faces between sound rock and rock that has failed or is gone.

Stress is largest at the front, but a cell knows that at its centre, and the front moves on by whole cells. Judged at
their centres, cells hold the front too early. In closed form (round tunnel, spherical cavity) a flat front ends where
theory has it, on average over places of the wall in its cell, if cells are judged at

    alpha = (1 - D_residual / D_peak) / 2

of a cell from the centre towards the face: half the share of its differential stress D that rock loses as it fails, at
the confinement at the front. Where the front has steps, the cell at a step has its centre on the front already, and
alpha is 0. REACH is between both (docs/explanation/failure-and-increments.md, The front).
"""

from dataclasses import dataclass

import numpy as np

from mpm_core.grid.adjacency import cells_across
from mpm_core.kernels.failure import NO_ROCK, NOT_FINEST, stress_to_face
from mpm_core.model.model import Model
from mpm_core.model.state import State

# Rock that loses all its differential stress is judged at this share of the way to the face: 1 suits a flat front, 0 a
# front of steps.
REACH = 0.5


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

    def stress_to_face(self, model: Model, state: State, particles: np.ndarray) -> np.ndarray:
        """Change of stress (k, 6) Pa from particles (k,) to the face at the front; 0 away from it."""
        change = np.empty((len(particles), 6))
        own = model.particles
        stress_to_face(
            particles, own.cell, self.across, self.rock, self.part, own.position, model.grid.fine_cell,
            state.failed, model.material, state.stress, model.insitu, change,
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
