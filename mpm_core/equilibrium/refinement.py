"""Which cells are too coarse for what happens in them: where rock stands near its strength, and beside rock that fails.

Rock in coarse cells is elastic by definition, so one can be split at any time: its displacement is known everywhere in
it, and stress follows from that. Rock is near its strength if it would break were its stress changed by mining more
than it is, by the share NEAR: what a coarse cell averages over, and what the next failures beside it will add, is in
proportion to that change. Virgin rock is never near, however close to its strength it stands.
"""

from dataclasses import dataclass

import numpy as np

from mpm_core.equilibrium.brittle import Brittle
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.grid.splitting import around, code_of, families, family_codes, middles
from mpm_core.kernels.failure import make_overstress_of
from mpm_core.model.model import Model
from mpm_core.model.state import State

NEAR = 0.25
WORTH = 0.02  # of all cells: so many new ones are split at once; fewer wait until no other rock fails any more. A split
# sets up the whole grid anew
PATIENCE = 1e-3  # of the rock that has failed in the step: while no more asks for a split of the whole mine, and a look
# at a tighter tolerance follows, it waits: one split then serves all that asks until there
BESIDE = 1  # rings of split cells of the last level but one that rock has around it when it fails
RINGS = 2  # of them that are split at once around what asks for it: so a crack does not ask again with every cell


@dataclass(frozen=True)
class Refinement:
    """What is split so far: codes (k,) of cells of the last level but one, ascending, and how many there are along each
    axis (d,); present (base cells along each axis) bool: what the grid has; halvings from these to those cells."""

    codes: np.ndarray
    shape: np.ndarray
    present: np.ndarray
    halvings: int

    @classmethod
    def of(cls, grid: MultiLevelGrid) -> "Refinement":
        """Of a grid."""
        return cls(family_codes(grid), grid.shape >> 1, grid.present, max(grid.levels - 2, 0))

    def asked(
        self, model: Model, state: State, brittle: Brittle, fresh: np.ndarray, cells: int, patience: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Cells (k, d) of the last level but one, in units of their own, around which finest cells are missing; and
        those of fresh particles (k,) that fail before any is split.

        fresh: particles that stand above strength, of a part of the mine or of the whole; cells: of the whole;
        patience: finest cells of rock that may wait without a split. Rock at the edge of the fine cells waits for a
        split, and all rock where that is worth it now.
        """
        if model.grid.levels == 1:  # a draft of two sizes of cell: all cells are finest, and no split ends the asking
            return np.empty((0, model.dimension), np.int64), fresh
        near = brittle.coarse[near_strength(model, state, brittle.coarse)]
        places = families(model.grid, model.particles.cell[fresh])
        exposed = self._exposed(places) if len(fresh) else np.zeros(0, bool)
        cell = model.particles.cell[near]
        waiting = np.count_nonzero(exposed) + np.sum(model.grid.cell_width[cell].astype(float) ** model.dimension)
        if waiting <= patience:  # also where nothing asks
            return places[:0], fresh[~exposed]
        asking = np.concatenate([middles(model.grid, cell), places[exposed]])
        missing = self._missing(around(np.unique(asking, axis=0), RINGS, self.shape))
        at_once = len(missing) << len(self.shape) > WORTH * cells
        return asking, fresh[:0] if at_once else fresh[~exposed]

    def _missing(self, places: np.ndarray) -> np.ndarray:
        """Those of the places (k, d) that are not split, of a district its own."""
        if not self.present.all():
            places = places[self.present[tuple((places >> self.halvings).T)]]
        if not len(self.codes) or not len(places):
            return places
        code = code_of(places, self.shape)
        return places[self.codes[np.minimum(np.searchsorted(self.codes, code), len(self.codes) - 1)] != code]

    def _exposed(self, places: np.ndarray) -> np.ndarray:
        """(k,) bool: whether a cell within BESIDE rings of a place (k, d) is not split."""
        missing = self._missing(around(np.unique(places, axis=0), BESIDE, self.shape))
        if not len(missing):
            return np.zeros(len(places), bool)
        return np.isin(code_of(places, self.shape), code_of(around(missing, BESIDE, self.shape), self.shape))


def near_strength(model: Model, state: State, candidates: np.ndarray) -> np.ndarray:
    """(k,) bool: whether candidates (particle indices), intact ones, would break under 1 + NEAR times their change of
    stress since virgin."""
    excess = np.zeros(len(candidates))
    if len(candidates):
        changed = (1.0 + NEAR) * state.stress[candidates]
        make_overstress_of(model.law)(
            np.arange(len(candidates)), changed, model.insitu[candidates], model.particles.material[candidates],
            model.intact_rows, excess,
        )  # fmt: skip
    return excess > 0.0
