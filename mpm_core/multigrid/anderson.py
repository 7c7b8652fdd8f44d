"""Anderson acceleration (Walker and Ni 2011): the next step from the residuals of the last few.

Of the latest displacements, the combination is taken whose residual r would be the smallest if the residual were linear
in between, measured by r . M r with the preconditioner M: about twice the elastic energy of the displacement that is
still missing. (The 2-norm of r instead takes up to twice the cycles in brittle rings: it counts stiff cells most.) For
a linear symmetric problem that is the iterate of conjugate gradients, restarted. Differences, and M r, are kept in
single precision.
"""

import numpy as np
from numba import njit, prange

from mpm_core.kernels.operator_rows import CHUNK

SMALLEST = 1e-7  # share of the largest: combinations of differences that are smaller than their rounding are left out


@njit(parallel=True, error_model="numpy", cache=True)
def _note(residual, correction, size, step, residual_before, correction_before, change, move):
    """What the last step has changed in the residual, the preconditioned residual, and the way on from there.

    All (element,). residual_before becomes the change of the residual, correction_before what size times correction is
    now; change: of the latter; move: step plus change, both written.
    """
    for i in prange(len(change)):
        residual_before[i] = residual[i] - residual_before[i]
        now = size * correction[i]
        change[i] = now - correction_before[i]
        move[i] = step[i] + change[i]
        correction_before[i] = now


@njit(parallel=True, error_model="numpy", cache=True)
def _products(changes, difference, residual, sums):
    """Sums (chunk, 2, k): of changes (k, element) times the residual's change, and times the residual (element,)."""
    for chunk in prange(len(sums)):
        first, last = chunk * CHUNK, min((chunk + 1) * CHUNK, len(residual))
        for k in range(len(changes)):
            with_difference, with_residual = 0.0, 0.0
            for i in range(first, last):
                with_difference += changes[k, i] * difference[i]
                with_residual += changes[k, i] * residual[i]
            sums[chunk, 0, k], sums[chunk, 1, k] = with_difference, with_residual


@njit(parallel=True, error_model="numpy", cache=True)
def _combine(correction, weights, moves, residual, step, residual_before):
    """step (element,) = correction - sum of weights (k,) times moves (k, element); residual_before = residual."""
    for i in prange(len(step)):
        total = np.float64(correction[i])
        for k in range(len(weights)):
            total -= weights[k] * moves[k, i]
        step[i] = total
        residual_before[i] = residual[i]


class Anderson:
    """The last `depth` steps and what they have changed; flat arrays of `size` elements.

    changes: of the preconditioned residual; moves: steps plus those; gram (depth, depth): products of changes of the
    residual with those of the preconditioned one.
    """

    def __init__(self, size: int, depth: int):
        self.changes = np.zeros((depth, size), np.float32)
        self.moves = np.zeros((depth, size), np.float32)
        self.residual, self.correction = np.zeros(size), np.zeros(size, np.float32)
        self.gram = np.zeros((depth, depth))
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self.count = 0

    def turn(self, residual: np.ndarray, correction: np.ndarray, size: float, step: np.ndarray) -> None:
        """Replace the last step (element,) by the next one; what the first one after `forget` replaces does not matter.

        residual: where the last step has led; correction times size: M residual.
        """
        depth = len(self.moves)
        place, known = (self.count - 1) % depth, min(self.count, depth)
        if self.count:
            _note(
                residual, correction, size, step, self.residual, self.correction, self.changes[place], self.moves[place]
            )  # fmt: skip
        else:
            np.multiply(correction, np.float32(size), out=self.correction)
        sums = np.empty((-(-len(residual) // CHUNK), 2, known))
        _products(self.changes[:known], self.residual, residual, sums)
        with_difference, shares = sums.sum(axis=0)
        if known:
            self.gram[place, :known] = self.gram[:known, place] = with_difference
        _combine(self.correction, self._weights(shares), self.moves[:known], residual, step, self.residual)
        self.count += 1

    def _weights(self, shares: np.ndarray) -> np.ndarray:
        """How much of each of the latest moves to take back, from its products with the residual, both (k,)."""
        known = len(shares)
        if not known:
            return shares
        size = np.sqrt(np.maximum(np.diag(self.gram)[:known], 0.0))
        size = np.where(size > 0.0, size, 1.0)
        gram = self.gram[:known, :known] / size[:, None] / size
        return np.linalg.lstsq(gram, shares / size, rcond=SMALLEST)[0] / size
