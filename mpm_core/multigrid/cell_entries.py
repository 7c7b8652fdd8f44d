"""Terms of single cells besides the elastic stiffness of cubes, in the layout of the operator of one level.

Eight entries lie side by side.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from mpm_core.kernels.flow_rows import SUBTRACT_TANGENTS
from mpm_core.kernels.modes import hourglass_shares
from mpm_core.kernels.operator_cells import ADD_PATTERNS
from mpm_core.multigrid.siblings import Siblings
from mpm_core.simd.lanes import LANES


@dataclass(frozen=True)
class Places:
    """The places of entries (k,): in `lane` of `batch`, both (k,), in the order `order`.

    batch_start (block + 1,): first batch of each block of the operator that has entries; rows (batch * 2^d * LANES,)
    int32 of the corners.
    """

    order: np.ndarray
    batch: np.ndarray
    lane: np.ndarray
    batch_start: np.ndarray
    rows: np.ndarray

    def of(self, values: np.ndarray, precision) -> np.ndarray:
        """Values (k, n) of the entries where these lie, (batch * n * LANES,); 0 between them."""
        lanes = np.zeros((self.batch_start[-1], values.shape[1], LANES), precision)
        _place(self.batch, self.lane, self.order, values, lanes)
        return lanes.reshape(-1)


def places_of(siblings: Siblings, cells: np.ndarray) -> Places:
    """Places of entries of cells (k,), in any order, as often as they stand there."""
    rows_of = siblings.corner_rows(cells)
    corners = rows_of.shape[1]
    block = np.searchsorted(siblings.batch_start, siblings.cell_place[cells] // (corners * LANES), side="right") - 1
    order = np.argsort(block, kind="stable")
    block = block[order]
    counts = np.bincount(block, minlength=len(siblings.batch_start) - 1)
    batches = -(-counts // LANES)
    batch_start = np.append(0, np.cumsum(batches))
    rank = np.arange(len(block)) - np.append(0, np.cumsum(counts))[block]
    batch, lane = batch_start[block] + rank // LANES, rank % LANES
    rows = np.empty((batch_start[-1], corners, LANES), np.int32)
    rows[:] = np.repeat(siblings.row_start[:-1], batches)[:, None, None]  # rows that hold nothing
    rows[batch, :, lane] = rows_of[order]
    # Threads share the blocks evenly, and entries lie in few of them.
    return Places(order, batch, lane, np.unique(batch_start), rows.reshape(-1))


@dataclass(frozen=True)
class Tangents:
    """The stiffness of one level that flow takes off: see kernels.flow_rows."""

    dimension: int
    places: Places
    slopes: np.ndarray
    matrices: np.ndarray

    def take_off(self, values: np.ndarray, forces: np.ndarray) -> None:
        """Take their part out of elastic forces at displacement `values`, copies filled in; flat arrays."""
        SUBTRACT_TANGENTS[self.dimension](
            self.places.batch_start, self.places.rows, self.slopes, self.matrices, values, forces
        )  # fmt: skip

    def in_precision(self, precision) -> "Tangents":
        """A copy in another precision, or the same."""
        return replace(self, slopes=self.slopes.astype(precision), matrices=self.matrices.astype(precision))


def pack(
    siblings: Siblings, cells: np.ndarray, slopes: np.ndarray, matrices: np.ndarray, precision=np.float32
) -> Tangents:
    """Tangents of entries in any order: cells (k,), slopes (k, 2^d, d) of the modes, matrices (k, 36)."""
    places = places_of(siblings, cells)
    flat = slopes.reshape(len(slopes), slopes.shape[1] * slopes.shape[2])
    return Tangents(slopes.shape[2], places, places.of(flat, precision), places.of(matrices, precision))


@dataclass(frozen=True)
class Patterns:
    """Hourglass patterns of distorted cells and their stiffness: see kernels.operator_cells. shares (k, d): of each
    pattern's stiffness along each axis."""

    dimension: int
    places: Places
    patterns: np.ndarray
    shares: np.ndarray
    stiffness: np.ndarray

    @classmethod
    def of(cls, siblings: Siblings, cells: np.ndarray, patterns: np.ndarray, precision) -> "Patterns":
        """Patterns (cell, mode, 2^d) of cells (cell,); without stiffness yet."""
        count, corners = patterns.shape[1:]
        dimension = corners.bit_length() - 1
        places = places_of(siblings, np.repeat(cells, count))
        shares = np.tile(hourglass_shares(dimension), (len(cells), 1))
        none = places.of(np.zeros_like(shares), precision)
        return cls(dimension, places, places.of(patterns.reshape(-1, corners), precision), shares, none)

    def set_stiffness(self, stiffness: np.ndarray) -> None:
        """Take over g (cell,) of the cells."""
        places = self.places
        each = np.repeat(stiffness, len(self.shares) // len(stiffness))[:, None] * self.shares
        lanes = self.stiffness.reshape(-1, self.dimension, LANES)
        lanes[places.batch, :, places.lane] = each[places.order]

    def add(self, values: np.ndarray, forces: np.ndarray) -> None:
        """Add their part to elastic forces at displacement `values`, copies filled in; flat arrays."""
        ADD_PATTERNS[self.dimension](
            self.places.batch_start, self.places.rows, self.patterns, self.stiffness, values, forces
        )  # fmt: skip

    def in_precision(self, precision) -> "Patterns":
        """A copy in another precision, or the same."""
        return replace(self, patterns=self.patterns.astype(precision), stiffness=self.stiffness.astype(precision))


@njit(cache=True)
def _place(batch, lane, order, values, lanes):
    """Values (k, n) of entries in this order to their batches (k,) and lanes (k,): lanes (batch, n, LANES), written."""
    for i in range(len(order)):
        for j in range(values.shape[1]):
            lanes[batch[i], j, lane[i]] = values[order[i], j]
