"""Rock that comes loose: failed rock that moves down and finds no rest, and the intact rock that only it holds.

Loose rock has no equilibrium. Where a scheme finds none, the rock that has moved down farthest since the last
equilibrium of the mine is taken out there, as if excavated (stages/step_cells.py), and the step goes on from that
equilibrium. Time steps show it: what nothing holds gathers speed, all other rock comes to rest.

Rock that moves to the side or up without rest has no weight that drives it out of the way. That is no fall.
"""

from typing import Protocol

import numpy as np

from mpm_core.equilibrium.convergence import NoEquilibrium
from mpm_core.model.model import Model
from mpm_core.model.state import State

# Failed rock that has moved down by more than this since the last equilibrium, m, and still gathers speed, is loose.
MIN_FALL = 0.05
# Between two looks, the largest motion of rock that gathers speed grows by at least this factor.
MIN_GROWTH = 1.25
MOVES_ALONG = 0.5  # Loose rock has moved down by more than this share of the largest motion down.
DOWNWARD = 0.5  # Motion is downward if its downward part is more than this share of it.
MAX_FALLS = 20  # More falls in one step are caving.


class MovedBody(Protocol):
    """The attributes of a body (body.Body) by which loose rock is found."""

    model: Model
    state: State
    volume: np.ndarray
    attached: np.ndarray
    flowing: np.ndarray
    rest: np.ndarray


class FallWatch:
    """Looks for rock that falls in a relaxation that does not end."""

    def __init__(self, body: MovedBody):
        self.body, self.largest = body, np.inf  # a first look alone tells nothing of speed

    def look(self, ratio: float) -> None:
        """Raise NoEquilibrium, with the loose particles, if failed rock falls; ratio: the unbalanced force left."""
        largest, before = largest_of_failed(self.body, downward_motion(self.body)), self.largest
        self.largest = largest
        if largest > max(MIN_FALL, MIN_GROWTH * before):
            raise NoEquilibrium(
                f"rock fell {largest:.3g} m and went on (unbalanced ratio {ratio:.2g})", loose_rock(self.body)
            )


def downward_motion(body: MovedBody) -> np.ndarray:
    """Motion down (node,) m since the last equilibrium of the mine; 0 where that is not mainly down, or nothing is."""
    scene, axes = body.model.scene, body.model.scene.axes
    if 2 not in axes or scene.insitu.weightless or scene.solver.move or scene.solver.collapse != "fall":
        return np.zeros(len(body.attached))
    moved = body.state.displacement - body.rest
    down = -moved[:, axes.index(2)]
    return np.where(body.attached & (down > DOWNWARD * np.sqrt(np.sum(moved**2, axis=1))), down, 0.0)


def largest_of_failed(body: MovedBody, motion: np.ndarray) -> float:
    """Largest motion (node,) m at the corners of cells of failed rock."""
    cells = body.model.particles.cell[body.flowing]
    return float(motion[body.model.cell_nodes[cells]].max(initial=0.0))


def loose_rock(body: MovedBody) -> np.ndarray:
    """Loose rock (k,), particle indices: failed rock at a corner of whose cell the motion down is more than MOVES_ALONG
    of the largest, and intact rock all of whose corners move so. None if no failed rock has moved so far."""
    model, motion = body.model, downward_motion(body)
    limit = MOVES_ALONG * largest_of_failed(body, motion)
    if limit < MOVES_ALONG * MIN_FALL:
        return np.empty(0, np.int64)
    corners = motion[model.cell_nodes]
    some, all_of = (corners.max(axis=1) > limit), (corners.min(axis=1) > limit)
    cell = model.particles.cell
    rock = model.can_fail() & (body.volume > 0.0)
    return np.flatnonzero(rock & np.where(body.state.failed >= 0, some[cell], all_of[cell]))
