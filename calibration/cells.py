"""What the cells of trials change, from trials that were run on finer cells, too."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calibration.trials import NUMBER, POTENCY, Outputs

MIN_PAIRS = 2  # Pairs of runs on two sizes of cells that a scatter needs.


@dataclass(frozen=True)
class Discrepancy:
    """How far the model itself is from the rock: standard deviations of an output of a step.

    common: of an error that all steps share, such as that of the cells; own: of one that each step has for itself.
    """

    common: float = 0.0
    own: float = 0.0

    def covariance(self, steps: int) -> NDArray:
        """(step, step)."""
        return np.full((steps, steps), self.common**2) + self.own**2 * np.eye(steps)

    def with_own(self, other: float) -> "Discrepancy":
        """The same with a further error that each step has for itself."""
        return Discrepancy(self.common, float(np.hypot(self.own, other)))


@dataclass(frozen=True)
class CellCorrection:
    """shift (output,): what finer cells add to the outputs of trials; errors: how well it is known, by term."""

    shift: NDArray
    errors: dict[str, Discrepancy] = field(default_factory=dict)

    @classmethod
    def none(cls, trials: Outputs) -> "CellCorrection":
        """Trials on the cells of the mine."""
        return cls(np.zeros(trials.all.shape[1]))

    @classmethod
    def of(cls, trials: Outputs, finer: Outputs, pairs: int) -> "CellCorrection":
        """From the same trials on both cells: mean differences, and how the differences scatter.

        The scatter of a run's mean over its steps is an error that all steps share, the rest is each step's own. pairs:
        number of trials, each of as many rows: rows of one rock are one pair.
        """
        shifts, errors = [], {}
        for term, coarse in trials.by_term.items():
            difference = (finer.by_term[term] - coarse).reshape(pairs, -1, coarse.shape[1]).mean(axis=1)
            mean = difference.mean(axis=0)
            off = difference - mean
            widened = np.sqrt(1.0 + 1.0 / pairs)  # the mean itself is known from these pairs only
            common = off.mean(axis=1).std(ddof=1) * widened if pairs >= MIN_PAIRS else 0.0
            own = np.sqrt(np.mean((off - off.mean(axis=1, keepdims=True)) ** 2) * pairs / max(pairs - 1, 1)) * widened
            shifts.append(mean)
            errors[term] = Discrepancy(float(common), float(own))
        return cls(np.concatenate(shifts), errors)

    def during(self, share: NDArray, trials: Outputs) -> "CellCorrection":
        """The same, and potency and number for the share of each step (step,) that is recorded only."""
        shift = self.shift.copy()
        for term in (POTENCY, NUMBER):
            shift[trials.columns[term]] += np.log(share)
        return CellCorrection(shift, self.errors)
