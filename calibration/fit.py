"""From trials and record to a posterior: surrogate, correction for the cells, likelihood, predictions by step."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.likelihood import (
    MAX_IMPLAUSIBILITY,
    Discrepancy,
    Recorded,
    implausibility,
    number_term,
    potency_term,
)
from calibration.posterior import Posterior, find_posterior, weighted_quantiles
from calibration.surrogate import Surrogate
from calibration.trials import Outcome

SHARES = np.array([0.05, 0.5, 0.95])  # Of the intervals that the report states.
MIN_PAIRS = 2  # Pairs of runs on two sizes of cells that a scatter needs.


@dataclass(frozen=True)
class CellCorrection:
    """What finer cells change: it is added to ln potency and ln number of trials (step,); with the errors of both."""

    log_potency: NDArray
    log_number: NDArray
    potency_error: Discrepancy
    number_error: Discrepancy

    @classmethod
    def none(cls, steps: int) -> "CellCorrection":
        """Trials on the cells of the mine."""
        return cls(np.zeros(steps), np.zeros(steps), Discrepancy(), Discrepancy())

    @classmethod
    def of(cls, trials: Outcome, finer: Outcome) -> "CellCorrection":
        """From the same trials (run, step) on both cells: mean differences, and how the differences scatter.

        The scatter of a run's mean over its steps is an error that all steps share, the rest is each step's own.
        """
        corrections, errors = [], []
        for coarse, fine in ((trials.log_potency, finer.log_potency), (trials.log_number, finer.log_number)):
            difference = fine - coarse
            pairs = len(difference)
            mean = difference.mean(axis=0)
            off = difference - mean
            widened = np.sqrt(1.0 + 1.0 / pairs)  # the mean itself is known from these pairs only
            common = off.mean(axis=1).std(ddof=1) * widened if pairs >= MIN_PAIRS else 0.0
            own = np.sqrt(np.mean((off - off.mean(axis=1, keepdims=True)) ** 2) * pairs / max(pairs - 1, 1)) * widened
            corrections.append(mean)
            errors.append(Discrepancy(float(common), float(own)))
        return cls(*corrections, *errors)


@dataclass(frozen=True)
class Fit:
    """A calibration: the surrogate of ln potency and ln number (output: steps of both), and the posterior."""

    surrogate: Surrogate
    correction: CellCorrection
    recorded: Recorded
    terms: tuple[str, ...]
    model_error: float
    posterior: Posterior

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.recorded.number)

    @property
    def fits(self) -> bool:
        """Whether some point within the ranges is plausible."""
        return self.posterior.implausibility <= MAX_IMPLAUSIBILITY

    def expected(self, points: NDArray) -> tuple[NDArray, NDArray]:
        """Mean and standard deviation (point, output) of what a run makes there, corrected for the cells; chance and
        what the surrogate does not know included, errors that steps share not."""
        return expected(self.surrogate, self.correction, points)

    def log_likelihood(self, points: NDArray) -> NDArray:
        """Of the record, (point,)."""
        mean, deviation = self.expected(points)
        return log_likelihood(mean, deviation, self.correction, self.recorded, self.terms, self.model_error)

    @property
    def best_log_likelihood(self) -> float:
        """Largest of all points of the posterior."""
        return float(self.log_likelihood(self.posterior.points).max())

    def predicted(self, draws: int, seed: int) -> NDArray:
        """ln potency and ln number of runs at points of the posterior (draw, output), all errors but the record's."""
        generator = np.random.default_rng(seed)
        mean, deviation = self.expected(self.posterior.draws(draws, seed))
        drawn = mean + deviation * generator.standard_normal(mean.shape)
        for error, part in zip(discrepancies(self.correction, self.model_error), (0, 1), strict=True):
            columns = slice(part * self.steps, (part + 1) * self.steps)
            drawn[:, columns] += error.common * generator.standard_normal((draws, 1))
            drawn[:, columns] += error.own * generator.standard_normal((draws, self.steps))
        return drawn

    def intervals(self, draws: int = 4000, seed: int = 0) -> NDArray:
        """Potency (m3) and number of each step at SHARES of the posterior's predictions, (share, output)."""
        drawn = self.predicted(draws, seed)
        return np.exp(weighted_quantiles(drawn, np.full(draws, 1.0 / draws), SHARES))


def expected(surrogate: Surrogate, correction: CellCorrection, points: NDArray) -> tuple[NDArray, NDArray]:
    """As Fit.expected."""
    mean, deviation = surrogate.predict(points)
    shift = np.concatenate([correction.log_potency, correction.log_number])
    return mean + shift, np.sqrt(deviation**2 + surrogate.noise**2)


def discrepancies(correction: CellCorrection, model_error: float) -> tuple[Discrepancy, Discrepancy]:
    """Of ln potency and of ln number: errors of the cells, and each step's own error of the model."""
    errors = (correction.potency_error, correction.number_error)
    potency, number = (Discrepancy(error.common, float(np.hypot(error.own, model_error))) for error in errors)
    return potency, number


def calibrate(
    points: NDArray,
    outcome: Outcome,
    correction: CellCorrection,
    recorded: Recorded,
    terms: tuple[str, ...],
    model_error: float,
    seed: int,
) -> Fit:
    """Calibrate to a record.

    points (trial, quantity) in the unit cube and their outcomes; terms: of `potency` and `number`, those that count.
    """
    surrogate = Surrogate(points, np.concatenate([outcome.log_potency, outcome.log_number], axis=1), seed)
    potency_error, _ = discrepancies(correction, model_error)
    steps = len(recorded.number)

    def evaluate(found: NDArray) -> tuple[NDArray, NDArray]:
        mean, deviation = expected(surrogate, correction, found)
        implausible = implausibility(mean[:, :steps], deviation[:, :steps], recorded, potency_error)
        return log_likelihood(mean, deviation, correction, recorded, terms, model_error), implausible

    posterior = find_posterior(evaluate, points.shape[1], seed)
    return Fit(surrogate, correction, recorded, terms, model_error, posterior)


def log_likelihood(
    mean: NDArray,
    deviation: NDArray,
    correction: CellCorrection,
    recorded: Recorded,
    terms: tuple[str, ...],
    model_error: float,
) -> NDArray:
    """Sum of the terms that count, (point,); mean and deviation as of `expected`."""
    potency_error, number_error = discrepancies(correction, model_error)
    steps = len(recorded.number)
    total = np.zeros(len(mean))
    if "potency" in terms:
        total += potency_term(mean[:, :steps], deviation[:, :steps], recorded, potency_error)
    if "number" in terms:
        total += number_term(mean[:, steps:], deviation[:, steps:], recorded, number_error)
    return total
