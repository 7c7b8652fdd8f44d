"""From trials and record to a posterior, and its test on trials as records whose values are known.

A calibration is a surrogate of the trials' outputs, corrected for the cells, the likelihood of the record and the
posterior that follows.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.likelihood import MAX_IMPLAUSIBILITY, Likelihood
from calibration.posterior import POINTS, Posterior, find_posterior, weighted_quantiles
from calibration.surrogate import Surrogate
from calibration.trials import NUMBER, PLACES, POTENCY, SIZES, CellCorrection, Outputs, RecordedOutputs

SHARES = np.array([0.05, 0.5, 0.95])  # Of the intervals that the report states.
SELF_TEST_POINTS = 2**11  # Sobol points of the self-test: fewer than of the record's fit, as each trial has its own.


@dataclass(frozen=True)
class Rows:
    """Runs of all trials: points (row, quantity) in the unit cube, outputs (row, output), and the trial of each row.

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
    def recorded(self) -> RecordedOutputs:
        """The record that is calibrated to."""
        return self.likelihood.recorded

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.recorded.number)

    @property
    def fits(self) -> bool:
        """True if some point within the ranges is plausible."""
        return self.posterior.implausibility <= MAX_IMPLAUSIBILITY

    def expected(self, points: NDArray) -> tuple[NDArray, NDArray]:
        """Mean and standard deviation (point, output) of a run at these points; see `expected`."""
        return expected(self.surrogate, self.likelihood.correction, points)

    def log_likelihood(self, points: NDArray) -> NDArray:
        """Log-likelihood of the record at each point, (point,)."""
        return self.likelihood(*self.expected(points))

    @property
    def best_log_likelihood(self) -> float:
        """Largest log-likelihood of all points of the posterior."""
        return float(self.log_likelihood(self.posterior.points).max())

    def predicted(self, draws: int, seed: int) -> NDArray:
        """ln potency and ln number of runs at points of the posterior (draw, output), all errors but the record's."""
        generator = np.random.default_rng(seed)
        mean, deviation = self.expected(self.posterior.draws(draws, seed))
        drawn = mean + deviation * generator.standard_normal(mean.shape)
        parts = []
        for term in (POTENCY, NUMBER):
            error = self.likelihood.discrepancy(term)
            common = error.common * generator.standard_normal((draws, 1))
            own = error.own * generator.standard_normal((draws, self.steps))
            parts.append(drawn[:, self.likelihood.columns[term]] + common + own)
        return np.concatenate(parts, axis=1)

    def intervals(self, draws: int = 4000, seed: int = 0) -> NDArray:
        """Potency (m3) and number of each step at SHARES of the posterior's predictions, (share, output)."""
        drawn = self.predicted(draws, seed)
        return np.exp(weighted_quantiles(drawn, np.full(draws, 1.0 / draws), SHARES))


def expected(surrogate: Surrogate, correction: CellCorrection, points: NDArray) -> tuple[NDArray, NDArray]:
    """Mean and standard deviation (point, output) of a run's outputs at these points, corrected for the cells.

    Chance and the uncertainty of the surrogate are included, errors of cells and model are not.
    """
    mean, deviation = surrogate.predict(points)
    return mean + correction.shift, np.sqrt(deviation**2 + surrogate.noise**2)


def fit_likelihood(
    surrogate: Surrogate, likelihood: Likelihood, quantities: int, seed: int, points: int = POINTS
) -> Fit:
    """The fit of a surrogate and a likelihood: their posterior, from so many Sobol points a round."""

    def evaluate(at: NDArray) -> tuple[NDArray, NDArray]:
        outputs = expected(surrogate, likelihood.correction, at)
        return likelihood(*outputs), likelihood.implausibility(*outputs)

    return Fit(surrogate, likelihood, find_posterior(evaluate, quantities, seed, points))


def calibrate(
    rows: Rows,
    correction: CellCorrection,
    recorded: RecordedOutputs,
    terms: Sequence[str],
    model_error: float,
    seed: int,
) -> Fit:
    """Calibrate the quantities of these rows to a record, of which the given terms count."""
    surrogate = Surrogate(rows.points, rows.outputs.all, rows.trials, seed)
    columns = rows.outputs.columns
    gain_error = None
    if PLACES in columns:
        missed = (surrogate.outputs - surrogate.left_out()[0])[:, columns[PLACES]]
        gain_error = np.sqrt(np.mean(missed**2, axis=0))
    likelihood = Likelihood(recorded, terms, columns, correction, model_error, gain_error)
    return fit_likelihood(surrogate, likelihood, rows.points.shape[1], seed)


@dataclass(frozen=True)
class SelfTest:
    """Result of the self-test.

    held (trial, quantity) bool: the 90 % interval holds the trial's value; width (trial, quantity): that of the
    interval over that of the prior; posteriors: one for each trial tested.
    """

    held: NDArray
    width: NDArray
    posteriors: tuple[Posterior, ...]

    @property
    def coverage(self) -> float:
        """Share of all intervals that hold their value."""
        return float(self.held.mean())


def calibrate_to_trials(
    fit: Fit, rows: Rows, trials: NDArray, seed: int, gains: Callable[[int], NDArray] | None = None
) -> SelfTest:
    """Calibrate to the first row of each of these trials, on a surrogate without it.

    Its potency, number and sizes are disturbed as those of a record are: by the record's covariance, by the dispersion
    of its number, and by the model's error. Trials and made-up record have the same cells, so that nothing is corrected
    for them. gains: for a row, the information gain of all rows (row, step) at its events; needed where places count.
    """
    generator = np.random.default_rng(seed)
    held, widths, posteriors = [], [], []
    for trial in trials:
        row = int(np.flatnonzero(rows.trials == trial)[0])
        by_term = dict(rows.outputs.by_term)
        if gains and PLACES in by_term:
            by_term[PLACES] = gains(row)
        trial_outputs = Outputs(by_term)
        others = rows.trials != trial
        surrogate = fit.surrogate.of(rows.points[others], trial_outputs.all[others], rows.trials[others])
        record = _disturbed(trial_outputs.of_runs(slice(row, row + 1)), fit, generator)
        likelihood = replace(fit.likelihood, recorded=record, correction=CellCorrection.none(trial_outputs))

        tested = fit_likelihood(surrogate, likelihood, rows.points.shape[1], seed + int(trial), SELF_TEST_POINTS)
        posterior = tested.posterior
        low, _, high = posterior.quantiles(SHARES)
        held.append((low <= rows.points[row]) & (rows.points[row] <= high))
        widths.append(posterior.width_left())
        posteriors.append(posterior)
    return SelfTest(np.array(held), np.array(widths), tuple(posteriors))


def _disturbed(run: Outputs, fit: Fit, generator: np.random.Generator) -> RecordedOutputs:
    """A record made of one run's outputs, as uncertain as the mine's own record."""
    recorded, error = fit.recorded, fit.likelihood.model_error
    log_potency, log_number = run.by_term[POTENCY][0], run.by_term[NUMBER][0]
    log_potency = log_potency + error * generator.standard_normal(log_potency.shape)
    log_potency = log_potency + generator.multivariate_normal(np.zeros(len(log_potency)), recorded.covariance)
    log_number = log_number + error * generator.standard_normal(log_number.shape)
    number = _dispersed_number(np.exp(log_number), recorded.dispersion_index, generator)
    sizes = run.by_term[SIZES][0, 0] if SIZES in run.by_term else recorded.log_excess
    sizes = sizes + np.hypot(error, recorded.excess_error) * generator.standard_normal()
    return replace(recorded, log_potency=log_potency, number=number, log_excess=float(sizes))


def _dispersed_number(expected_number: NDArray, dispersion_index: float, generator: np.random.Generator) -> NDArray:
    """Numbers (step,) with these means, whose variance is `dispersion_index` times as large."""
    excess = dispersion_index - 1.0
    if excess < 1e-3:
        return generator.poisson(expected_number)
    return generator.negative_binomial(expected_number / excess, 1.0 / (1.0 + excess))
