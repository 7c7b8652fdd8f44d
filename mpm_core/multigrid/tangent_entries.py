"""What flow takes off the stiffness of one level, in the layout of its operator."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mpm_core.kernels.tangent_rows import TAKE_TANGENTS_OFF
from mpm_core.multigrid.siblings import Siblings
from mpm_core.simd.lanes import LANES


@dataclass(frozen=True)
class Tangents:
    """What flow takes off the stiffness of one level, eight entries at a time: see kernels.tangent_rows."""

    dimension: int
    batch_start: np.ndarray
    places: np.ndarray
    slopes: np.ndarray
    matrices: np.ndarray

    def take_off(self, values: np.ndarray, forces: np.ndarray) -> None:
        """Take their part out of elastic forces at displacement `values`, copies filled in; flat arrays."""
        TAKE_TANGENTS_OFF[self.dimension](
            self.batch_start, self.places, self.slopes, self.matrices, values, forces
        )  # fmt: skip

    def in_double_precision(self) -> "Tangents":
        """The same in float64."""
        slopes, matrices = self.slopes.astype(np.float64), self.matrices.astype(np.float64)
        return Tangents(self.dimension, self.batch_start, self.places, slopes, matrices)


def pack(
    siblings: Siblings, cells: np.ndarray, slopes: np.ndarray, matrices: np.ndarray, precision=np.float32
) -> Tangents:
    """Tangents of entries in any order: cells (k,), slopes (k, 2^d, d) of the modes, matrices (k, 36)."""
    corners = slopes.shape[1]
    block = np.searchsorted(siblings.batch_start, siblings.cell_place[cells] // (corners * LANES), side="right") - 1
    order = np.argsort(block, kind="stable")
    block = block[order]
    counts = np.bincount(block, minlength=len(siblings.batch_start) - 1)
    batches = -(-counts // LANES)
    batch_start = np.append(0, np.cumsum(batches))
    rank = np.arange(len(block)) - np.append(0, np.cumsum(counts))[block]
    batch, lane = batch_start[block] + rank // LANES, rank % LANES
    places = np.empty((batch_start[-1], corners, LANES), np.int32)
    places[:] = np.repeat(siblings.row_start[:-1], batches)[:, None, None]  # rows that hold nothing
    places[batch, :, lane] = siblings.corner_rows(cells[order])
    packed = []
    for values in (slopes.reshape(len(slopes), slopes.shape[1] * slopes.shape[2]), matrices):
        lanes = np.zeros((batch_start[-1], values.shape[1], LANES), precision)
        _place(batch, lane, order, values, lanes)
        packed.append(lanes.reshape(-1))
    return Tangents(3 if corners == 8 else 2, batch_start, places.reshape(-1), *packed)


@njit(cache=True)
def _place(batch, lane, order, values, lanes):
    """Values (k, n) of entries in this order to their batches (k,) and lanes (k,): lanes (batch, n, LANES), written."""
    for i in range(len(order)):
        for j in range(values.shape[1]):
            lanes[batch[i], j, lane[i]] = values[order[i], j]
