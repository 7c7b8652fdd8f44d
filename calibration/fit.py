"""From trials and record to a posterior: surrogate, correction for the cells, likelihood, predictions by step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.cells import CellCorrection
from calibration.likelihood import MAX_IMPLAUSIBILITY, Likelihood
from calibration.posterior import Posterior, find_posterior, weighted_quantiles
from calibration.surrogate import Surrogate
from calibration.trials import NUMBER, PLACES, POTENCY, Outputs, Recorded

SHARES = np.array([0.05, 0.5, 0.95])  # Of the intervals that the report states.


@dataclass(frozen=True)
class Rows:
    """What was run: points (row, quantity) in the unit cube, outputs (row, output), and the trial of each row.

    A trial has more than one row where events were extracted from its rock with several settings.
    """

    points: NDArray
    outputs: Outputs
    trials: NDArray


@dataclass(frozen=True)
class Fit:
    """A calibration: the surrogate of the outputs, the likelihood of the record, and the posterior."""

    surrogate: Surrogate
    likelihood: Likelihood
    posterior: Posterior

    @property
    def recorded(self) -> Recorded:
        """What the record says."""
        return self.likelihood.recorded

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.recorded.number)

    @property
    def fits(self) -> bool:
        """Whether some point within the ranges is plausible."""
        return self.posterior.implausibility <= MAX_IMPLAUSIBILITY

    def expected(self, points: NDArray) -> tuple[NDArray, NDArray]:
        """As `expected`."""
        return expected(self.surrogate, self.likelihood.correction, points)

    def log_likelihood(self, points: NDArray) -> NDArray:
        """Of the record, (point,)."""
        return self.likelihood(*self.expected(points))

    @property
    def best_log_likelihood(self) -> float:
        """Largest of all points of the posterior."""
        return float(self.log_likelihood(self.posterior.points).max())

    def predicted(self, draws: int, seed: int) -> NDArray:
        """ln potency and ln number of runs at points of the posterior (draw, output), all errors but the record's."""
        generator = np.random.default_rng(seed)
        mean, deviation = self.expected(self.posterior.draws(draws, seed))
        drawn = mean + deviation * generator.standard_normal(mean.shape)
        made = []
        for term in (POTENCY, NUMBER):
            error = self.likelihood.discrepancy(term)
            common = error.common * generator.standard_normal((draws, 1))
            own = error.own * generator.standard_normal((draws, self.steps))
            made.append(drawn[:, self.likelihood.columns[term]] + common + own)
        return np.concatenate(made, axis=1)

    def intervals(self, draws: int = 4000, seed: int = 0) -> NDArray:
        """Potency (m3) and number of each step at SHARES of the posterior's predictions, (share, output)."""
        drawn = self.predicted(draws, seed)
        return np.exp(weighted_quantiles(drawn, np.full(draws, 1.0 / draws), SHARES))


def expected(surrogate: Surrogate, correction: CellCorrection, points: NDArray) -> tuple[NDArray, NDArray]:
    """Mean and standard deviation (point, output) of what a run makes there, corrected for the cells.

    Chance and what the surrogate does not know are included, errors of cells and model are not.
    """
    mean, deviation = surrogate.predict(points)
    return mean + correction.shift, np.sqrt(deviation**2 + surrogate.noise**2)


def calibrate(
    rows: Rows,
    correction: CellCorrection,
    recorded: Recorded,
    terms: Sequence[str],
    model_error: float,
    seed: int,
) -> Fit:
    """Calibrate to a record; terms: those of it that count."""
    surrogate = Surrogate(rows.points, rows.outputs.all, rows.trials, seed)
    columns = rows.outputs.columns
    gain_error = None
    if PLACES in columns:
        missed = (surrogate.outputs - surrogate.left_out()[0])[:, columns[PLACES]]
        gain_error = np.sqrt(np.mean(missed**2, axis=0))
    likelihood = Likelihood(recorded, terms, columns, correction, model_error, gain_error)

    def evaluate(points: NDArray) -> tuple[NDArray, NDArray]:
        known = expected(surrogate, correction, points)
        return likelihood(*known), likelihood.implausibility(*known)

    return Fit(surrogate, likelihood, find_posterior(evaluate, rows.points.shape[1], seed))
