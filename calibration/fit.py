"""From trials and record to a posterior, and its test on trials as records whose values are known.

A calibration is a surrogate of the trials' outputs, corrected for the cells, the likelihood of the record and the
posterior that follows.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.instruments import InstrumentTerm
from calibration.likelihood import MAX_IMPLAUSIBILITY, Likelihood
from calibration.posterior import POINTS, Posterior, find_posterior, weighted_quantiles
from calibration.recorded import RecordedOutputs, as_of, clustered_numbers
from calibration.surrogate import Surrogate
from calibration.trials import NUMBER, PLACES, POTENCY, SIZES, CellCorrection, Outputs

INTERVAL_SHARE = 0.9  # Of the posterior, in the intervals of quantities that the report states.
SHARES = np.array([0.05, 0.5, 0.95])  # Of the intervals of predictions.
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
        """Mean and standard deviation (point, output) of what is expected at these points; see `expected`."""
        return expected(self.surrogate, self.likelihood.correction, points)

    def log_likelihood(self, points: NDArray) -> NDArray:
        """Log-likelihood of the record at each point, (point,)."""
        return self.likelihood(*self.expected(points))

    def instrument_scores(self) -> tuple[NDArray, NDArray]:
        """Scores of the instruments at the points of the posterior, and their variance; see `Likelihood.scores`."""
        return self.likelihood.scores(*self.expected(self.posterior.points))

    def with_terms(self, terms: Sequence[str], seed: int) -> "Fit":
        """The fit of the same trials by other terms."""
        likelihood = replace(self.likelihood, terms=terms)
        return fit_likelihood(self.surrogate, likelihood, self.posterior.points.shape[1], seed)

    @property
    def best_log_likelihood(self) -> float:
        """Largest log-likelihood of all points of the posterior."""
        return float(self.log_likelihood(self.posterior.points).max())

    def predicted(self, draws: int, seed: int) -> NDArray:
        """ln potency and ln number of runs at points of the posterior (draw, output), all errors but the record's."""
        generator = np.random.default_rng(seed)
        mean, deviation = self.expected(self.posterior.draws(draws, seed))
        deviation = np.hypot(deviation, self.likelihood.chance)
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
    """Mean and standard deviation (point, output) of the expected outputs at these points, corrected for the cells.

    The uncertainty of the surrogate is included, chance and errors of cells and model are not. The deviation is raised
    where the trials that predict each other miss by more than they state.
    """
    mean, deviation = surrogate.predict(points)
    return mean + correction.shift, deviation * surrogate.miss


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
    surrogate: Surrogate | None = None,
    points: int = POINTS,
    instruments: InstrumentTerm | None = None,
) -> Fit:
    """Calibrate the quantities of these rows to a record and to readings, of which the given terms count.

    surrogate: one of these rows, if there is one. points: Sobol points of a round.
    """
    surrogate = surrogate or Surrogate(rows.points, rows.outputs.all, rows.trials, seed)
    columns = rows.outputs.columns
    missed = surrogate.outputs - surrogate.left_out()[0]
    gain_error = np.sqrt(np.mean(missed[:, columns[PLACES]] ** 2, axis=0)) if PLACES in columns else None
    shared = shared_error(missed[:, columns[POTENCY]], missed[:, columns[NUMBER]])
    chance = surrogate.noise * surrogate.miss
    likelihood = Likelihood(recorded, terms, columns, correction, model_error, chance, gain_error, shared, instruments)
    return fit_likelihood(surrogate, likelihood, rows.points.shape[1], seed, points)


def shared_error(potency: NDArray, number: NDArray) -> float:
    """Correlation of what the other trials miss of ln potency (row, step) and of ln number (row, step)."""
    scale = np.sqrt(np.sum(potency**2) * np.sum(number**2))
    return float(np.clip(np.sum(potency * number) / scale, 0.0, 0.99)) if scale > 0.0 else 0.0


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
    """Calibrate to a record made with the values of each of these trials (of its first row), without that trial.

    The record has what all other trials predict there, with the error of that prediction, clusters of events, the
    chance of their sizes, and the model's error. Readings have what is predicted, with all errors of an instrument that
    works. Trials and made-up record have the same cells, so that nothing is corrected for them. gains: for a row, the
    information gain of all rows (row, step) at its events; needed where places count.
    """
    generator = np.random.default_rng(seed)
    held, widths, posteriors = [], [], []
    if fit.likelihood.instruments is not None:
        errors = fit.likelihood.instruments.likeliest_errors(*fit.instrument_scores(), fit.posterior.weights)
    for trial in trials:
        row = int(np.flatnonzero(rows.trials == trial)[0])
        by_term = dict(rows.outputs.by_term)
        if gains and PLACES in by_term:
            by_term[PLACES] = gains(row)
        trial_outputs = Outputs(by_term)
        others = rows.trials != trial
        surrogate = fit.surrogate.of(rows.points[others], trial_outputs.all[others], rows.trials[others])
        uncorrected = CellCorrection.none(trial_outputs)
        mean, deviation = (part[0] for part in expected(surrogate, uncorrected, rows.points[row : row + 1]))
        record = _made_record(mean, deviation, fit, generator) if fit.steps else fit.recorded
        likelihood = replace(fit.likelihood, recorded=record, correction=uncorrected)
        if likelihood.instruments is not None:
            scores, variance = (part[0] for part in likelihood.scores(mean[None], deviation[None]))
            made = likelihood.instruments.made(scores, variance, errors, generator)
            likelihood = replace(likelihood, instruments=made)
        tested = fit_likelihood(surrogate, likelihood, rows.points.shape[1], seed + int(trial), SELF_TEST_POINTS)
        posterior = tested.posterior
        low, _, high = posterior.intervals(INTERVAL_SHARE)
        held.append((low <= rows.points[row]) & (rows.points[row] <= high))
        widths.append(posterior.width_left(INTERVAL_SHARE))
        posteriors.append(posterior)
    return SelfTest(np.array(held), np.array(widths), tuple(posteriors))


def _made_record(mean: NDArray, deviation: NDArray, fit: Fit, generator: np.random.Generator) -> RecordedOutputs:
    """A record of values at which these outputs (output,) are expected, with their standard deviation.

    Its events come in clusters, which change number and potency alike; the sizes of its events are drawn at random.
    What the record says of its own uncertainty follows from it alone, as that of the mine's record does.
    """
    recorded, likelihood, columns = fit.recorded, fit.likelihood, fit.likelihood.columns
    steps, error = fit.steps, likelihood.model_error
    common, other = generator.standard_normal((2, steps))
    of_number = common
    of_potency = likelihood.shared * common + np.sqrt(1.0 - likelihood.shared**2) * other
    log_number = mean[columns[NUMBER]] + deviation[columns[NUMBER]] * of_number
    mean_potency = mean[columns[POTENCY]] + deviation[columns[POTENCY]] * of_potency - log_number
    mean_potency = mean_potency + error * generator.standard_normal(steps)
    expected_number = np.exp(log_number + error * generator.standard_normal(steps))
    number, dispersion_index = clustered_numbers(expected_number, recorded.dispersion_index, generator)
    # errors of a mean of other numbers of events scale with one over their roots
    counts = np.append(number, number.sum()), np.append(recorded.number, recorded.number.sum())
    scale = np.sqrt(np.maximum(counts[1], 1) / np.maximum(counts[0], 1))
    errors = recorded.size_errors * scale
    drawn = errors[generator.integers(len(errors))]
    made = replace(recorded, number=number, dispersion_index=dispersion_index, size_errors=errors)
    log_excess = recorded.log_excess
    if SIZES in columns:
        modelled = np.exp(mean[columns[NUMBER]]).sum()
        sizes = as_of(mean[columns[SIZES]][0], modelled, number.sum())
        sizes = sizes + np.hypot(deviation[columns[SIZES]][0], error) * generator.standard_normal()
        log_excess = float(sizes + drawn[-1])
    return replace(made, log_potency=made.log_number + mean_potency + drawn[:-1], log_excess=log_excess)
