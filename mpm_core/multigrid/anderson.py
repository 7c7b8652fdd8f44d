"""Anderson acceleration (Walker and Ni 2011): the next step from the residuals of the last few.

Of the latest displacements, the combination is taken whose residual would be the smallest if the residual were linear
in between; the preconditioner then sees only what is left. For a linear problem that is restarted GMRES with the
preconditioner on the right (Saad 2003, section 9.3.2). Differences are kept in single precision.
"""

import numpy as np
from numba import njit, prange

from mpm_core.kernels.operator_rows import product

SMALLEST = 1e-7  # share of the largest: combinations of differences that are smaller than their rounding are left out


@njit(parallel=True, error_model="numpy", cache=True)
def _keep_difference(after, before, kept):
    """kept (element,) float32 = after - before, written."""
    for i in prange(len(kept)):
        kept[i] = after[i] - before[i]


@njit(parallel=True, error_model="numpy", cache=True)
def _subtract_combination(kept, weights, values):
    """values (element,) -= sum of weights (k,) times kept (k, element), in place."""
    for i in prange(len(values)):
        total = 0.0
        for k in range(len(weights)):
            total += weights[k] * kept[k, i]
        values[i] -= total


class Anderson:
    """Differences of the last `depth` steps and of their residuals, flat arrays of `size` elements."""

    def __init__(self, size: int, depth: int):
        self.steps = np.zeros((depth, size), np.float32)
        self.changes = np.zeros((depth, size), np.float32)
        self.before = np.empty(size)
        self.gram = np.zeros((depth, depth))
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self.count = 0

    def note(self, residual: np.ndarray, step: np.ndarray) -> None:
        """Take in the residual (element,) that a step has led to; the first residual since `forget` has no step."""
        if self.count > 0:
            depth = len(self.steps)
            place = (self.count - 1) % depth
            self.steps[place] = step
            _keep_difference(residual, self.before, self.changes[place])
            for other in range(min(self.count, depth)):
                value = product(self.changes[place], self.changes[other])
                self.gram[place, other] = self.gram[other, place] = value
        self.before[:] = residual
        self.count += 1

    def reduce(self, residual: np.ndarray, step: np.ndarray) -> None:
        """Replace residual and step (element,) by those of the best combination: what is left, and the way there."""
        step[:] = 0.0
        known = min(self.count - 1, len(self.steps))
        if known <= 0:
            return
        size = np.sqrt(np.diag(self.gram)[:known])
        size = np.where(size > 0.0, size, 1.0)
        shares = np.array([product(self.changes[k], residual) for k in range(known)]) / size
        gram = self.gram[:known, :known] / size[:, None] / size
        weights = np.linalg.lstsq(gram, shares, rcond=SMALLEST)[0] / size
        _subtract_combination(self.changes[:known], weights, residual)
        _subtract_combination(self.steps[:known], weights, step)
