"""Anderson acceleration (Walker and Ni 2011): the next step from the residuals of the last few.

Of the latest displacements, the combination is used whose residual r would be the smallest if the residual were linear
in between, measured by r . M r with the preconditioner M: about twice the elastic energy of the displacement that is
still missing. (The 2-norm of r would count stiff cells most.) On a
linear symmetric problem that is preconditioned MINRES, restarted. Differences, and M r, are kept in single precision.
"""

import numpy as np
from numba import njit, prange

from mpm_core.kernels.operator_rows import ELEMENTS_PER_CHUNK

# Combinations of differences below this share of the largest one are smaller than their round-off and are left out.
MIN_SINGULAR_SHARE = 1e-7
UNKNOWNS_PER_PIECE = 2048  # The sums of so many unknowns stay in the nearest cache.


@njit(parallel=True, error_model="numpy", cache=True)
def _begin(free, residual, correction, size, residual_before, correction_before):
    """Keep residual and size times correction, both (element,), of the unknowns."""
    for i in prange(len(free)):
        residual_before[i] = residual[free[i]]
        correction_before[i] = size * correction[free[i]]


@njit(parallel=True, error_model="numpy", cache=True)
def _note(free, residual, correction, size, step, residual_before, difference, correction_before, change, move):
    """Note the last step's change of the residual, the preconditioned residual, and the way on from there.

    residual, correction, step (element,); by unknown (k,): residual_before and correction_before, which become those of
    now (size times the correction), and, written, difference: change of the residual; change: of the preconditioned
    one; move: step plus that.
    """
    for i in prange(len(free)):
        element = free[i]
        difference[i] = residual[element] - residual_before[i]
        residual_before[i] = residual[element]
        now = size * correction[element]
        change[i] = now - correction_before[i]
        move[i] = step[element] + change[i]
        correction_before[i] = now


@njit(parallel=True, error_model="numpy", cache=True)
def _products(changes, difference, residual, sums):
    """Sums (chunk, 2, m): of changes (m, k) times the residual's change, and times the residual, both (k,).

    Four changes at a time: each sum has to wait for its last addition, so eight of them take as long as two.
    """
    known = len(changes)
    for chunk in prange(len(sums)):
        first, last = chunk * ELEMENTS_PER_CHUNK, min((chunk + 1) * ELEMENTS_PER_CHUNK, len(residual))
        for m in range(0, known - 3, 4):
            a, b, c, d = changes[m], changes[m + 1], changes[m + 2], changes[m + 3]
            a1 = b1 = c1 = d1 = a2 = b2 = c2 = d2 = 0.0
            for i in range(first, last):
                change, value = difference[i], residual[i]
                a1 += a[i] * change
                b1 += b[i] * change
                c1 += c[i] * change
                d1 += d[i] * change
                a2 += a[i] * value
                b2 += b[i] * value
                c2 += c[i] * value
                d2 += d[i] * value
            for entry, pair in enumerate(((a1, a2), (b1, b2), (c1, c2), (d1, d2))):
                sums[chunk, 0, m + entry], sums[chunk, 1, m + entry] = pair
        for m in range(known - known % 4, known):
            with_difference, with_residual = 0.0, 0.0
            for i in range(first, last):
                with_difference += changes[m, i] * difference[i]
                with_residual += changes[m, i] * residual[i]
            sums[chunk, 0, m], sums[chunk, 1, m] = with_difference, with_residual


@njit(parallel=True, error_model="numpy", cache=True)
def _combine(free, correction, weights, moves, step):
    """step (element,) = correction - sum of weights (m,) times moves (m, k), at unknowns.

    By piece of the unknowns, whose sums stay in the cache while one move after the other is taken off them.
    """
    for piece in prange(-(-len(free) // UNKNOWNS_PER_PIECE)):
        first, last = piece * UNKNOWNS_PER_PIECE, min((piece + 1) * UNKNOWNS_PER_PIECE, len(free))
        totals = np.empty(last - first)
        for i in range(len(totals)):
            totals[i] = correction[first + i]
        for m in range(len(weights)):
            weight, move = weights[m], moves[m, first:last]
            for i in range(len(totals)):
                totals[i] -= weight * move[i]
        for i in range(len(totals)):
            step[free[first + i]] = totals[i]


class Anderson:
    """The last `depth` steps and what they have changed, kept of the unknowns alone: half of all elements.

    free (k,) the elements that are unknowns; changes (depth, k): of the preconditioned residual; moves (depth, k):
    steps plus those; gram (depth, depth): products of changes of the residual with those of the preconditioned one.
    """

    def __init__(self, free: np.ndarray, depth: int):
        self.free = free
        self.changes = np.zeros((depth, len(free)), np.float32)
        self.moves = np.zeros((depth, len(free)), np.float32)
        self.residual, self.difference = np.zeros((2, len(free)))
        self.correction = np.zeros(len(free), np.float32)
        self.gram = np.zeros((depth, depth))
        self.reset()

    def reset(self) -> None:
        """Forget all earlier iterations."""
        self.count = 0

    def next_step(
        self, residual: np.ndarray, correction: np.ndarray, size: float, step: np.ndarray, symmetric: bool = True
    ) -> None:
        """Replace the last step by the next one; what the first one after `reset` replaces does not matter.

        All flat arrays (element,). residual: where the last step has led; correction times size: M residual; step: only
        its unknowns are read and written. symmetric: whether M is, always since `reset`; where it is not, r is
        measured by the 2-norm of M r.
        """
        depth = len(self.moves)
        place, known = (self.count - 1) % depth, min(self.count, depth)
        if self.count:
            _note(
                self.free, residual, correction, size, step, self.residual, self.difference, self.correction,
                self.changes[place], self.moves[place],
            )  # fmt: skip
        else:
            _begin(self.free, residual, correction, size, self.residual, self.correction)
        sums = np.empty((-(-len(self.free) // ELEMENTS_PER_CHUNK), 2, known))
        if symmetric:
            _products(self.changes[:known], self.difference, self.residual, sums)
        else:
            _products(self.changes[:known], self.changes[place], self.correction, sums)
        with_difference, shares = sums.sum(axis=0)
        if known:
            self.gram[place, :known] = self.gram[:known, place] = with_difference
        _combine(self.free, self.correction, self._weights(shares), self.moves[:known], step)
        self.count += 1

    def _weights(self, shares: np.ndarray) -> np.ndarray:
        """Share of each of the latest moves to take back, from its products with the residual, both (k,)."""
        known = len(shares)
        if not known:
            return shares
        size = np.sqrt(np.maximum(np.diag(self.gram)[:known], 0.0))
        size = np.where(size > 0.0, size, 1.0)
        gram = self.gram[:known, :known] / size[:, None] / size
        return np.linalg.lstsq(gram, shares / size, rcond=MIN_SINGULAR_SHARE)[0] / size
