"""Cells that are too coarse for what happens in them: where rock is near its strength, and next to rock that fails.

Rock in coarse cells is elastic by definition, so one can be split at any time: its displacement is known everywhere in
it, and stress follows from that. Rock is near its strength if it would break were its stress changed by mining more
than it is, by the share NEAR_STRENGTH_SHARE: what a coarse cell averages over, and what the next failures next to
it will add, is in proportion to that change. Virgin rock is never near, however close to its strength it is.
"""

from dataclasses import dataclass

import numpy as np

from mpm_core.equilibrium.brittle import Brittle, overstress
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.grid.splitting import around, code_of, families, family_codes, middles
from mpm_core.model.model import Model
from mpm_core.model.state import State

NEAR_STRENGTH_SHARE = 0.25  # Rock is near its strength if it would break under this much more change of its stress.
# Cells are split at once if the new ones are more than this share of all cells. Fewer wait until no other rock fails,
# since a split sets up the whole grid again.
MIN_SPLIT_SHARE = 0.02
# Cells of the whole mine wait for a later split while they are no more than this share of the rock that has failed in
# the step, and failure is checked again at a smaller tolerance.
MAX_WAITING_SHARE = 1e-3
REFINED_RINGS_AROUND_FAILURE = 1  # Rings of refined cells required around a particle before it may fail.
# Rings around a flagged cell that are split with it, so that a crack needs a split less often.
RINGS_SPLIT_AT_ONCE = 2
CANDIDATES_AT_ONCE = 1 << 15  # Stresses of so many particles are copied at once: they stay in the cache.


@dataclass(frozen=True)
class RefinedCells:
    """The cells that are split so far: codes (k,) of cells of the last level but one, ascending, and how many there are
    along each axis (d,); present (base cells along each axis) bool: what the grid has; halvings from these to those
    cells."""

    codes: np.ndarray
    shape: np.ndarray
    present: np.ndarray
    halvings: int

    @classmethod
    def of(cls, grid: MultiLevelGrid) -> "RefinedCells":
        """The refined cells of a grid."""
        return cls(family_codes(grid), grid.shape >> 1, grid.present, max(grid.levels - 2, 0))

    def flagged(
        self, model: Model, state: State, brittle: Brittle, fresh: np.ndarray, cells: int, patience: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Cells (k, d) of the last level but one, in units of their own, around which finest cells are missing; and
        those of fresh particles (k,) that fail before any is split.

        fresh: particles above their strength, of a part of the mine or of the whole; cells: of the whole;
        patience: finest cells of rock that may wait without a split. Rock at the edge of the fine cells waits for a
        split, and all rock where that is worth it now.
        """
        if model.grid.levels == 1:  # a draft of two sizes of cell: all cells are finest, and flags would never end
            return np.empty((0, model.dimension), np.int64), fresh
        near = brittle.coarse[near_strength(model, state, brittle.coarse)]
        places = families(model.grid, model.particles.cell[fresh])
        exposed = self._exposed(places) if len(fresh) else np.zeros(0, bool)
        cell = model.particles.cell[near]
        waiting = np.count_nonzero(exposed) + np.sum(model.grid.cell_width[cell].astype(float) ** model.dimension)
        if waiting <= patience:  # also where nothing is flagged
            return places[:0], fresh[~exposed]
        flagged = np.concatenate([middles(model.grid, cell), places[exposed]])
        missing = self._missing(around(np.unique(flagged, axis=0), RINGS_SPLIT_AT_ONCE, self.shape))
        at_once = len(missing) << len(self.shape) > MIN_SPLIT_SHARE * cells
        return flagged, fresh[:0] if at_once else fresh[~exposed]

    def _missing(self, places: np.ndarray) -> np.ndarray:
        """Places (k, d) among these that are not split; of a subdomain, only its own."""
        if not self.present.all():
            places = places[self.present[tuple((places >> self.halvings).T)]]
        if not len(self.codes) or not len(places):
            return places
        code = code_of(places, self.shape)
        return places[self.codes[np.minimum(np.searchsorted(self.codes, code), len(self.codes) - 1)] != code]

    def _exposed(self, places: np.ndarray) -> np.ndarray:
        """(k,) bool: whether a cell within REFINED_RINGS_AROUND_FAILURE rings of a place (k, d) is not split."""
        missing = self._missing(around(np.unique(places, axis=0), REFINED_RINGS_AROUND_FAILURE, self.shape))
        if not len(missing):
            return np.zeros(len(places), bool)
        return np.isin(
            code_of(places, self.shape), code_of(around(missing, REFINED_RINGS_AROUND_FAILURE, self.shape), self.shape)
        )


def near_strength(model: Model, state: State, candidates: np.ndarray) -> np.ndarray:
    """(k,) bool: whether candidates (particle indices), intact ones, would break under 1 + NEAR_STRENGTH_SHARE times
    their change of stress since virgin."""
    excess = np.empty(len(candidates))
    for first in range(0, len(candidates), CANDIDATES_AT_ONCE):
        some = candidates[first : first + CANDIDATES_AT_ONCE]
        more = NEAR_STRENGTH_SHARE * state.stress.take(some, axis=0)
        excess[first : first + CANDIDATES_AT_ONCE] = overstress(model, state, some, more)
    return excess > 0.0
