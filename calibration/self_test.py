"""Each trial in turn as the record: do the stated intervals hold the values that made it?"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.cells import CellCorrection
from calibration.fit import SHARES, Fit, Rows, expected
from calibration.likelihood import Likelihood
from calibration.posterior import Posterior, find_posterior
from calibration.trials import NUMBER, PLACES, POTENCY, SIZES, Outputs, Recorded

POINTS = 2**11  # Sobol points of a posterior: fewer than of the mine's own, as there is one for each trial.


@dataclass(frozen=True)
class SelfTest:
    """held (trial, quantity) bool: whether the 90 % interval holds the trial's value; width (trial, quantity): of the
    interval over that of the prior; posteriors: one for each trial tested."""

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

    Its potency, number and sizes are disturbed as those of a record are: by the record's covariance, by its clustering,
    and by the model's error. Trials and made-up record have the same cells, so that nothing is corrected for them.
    gains: of a row, the information gain of all rows (row, step) at its events; needed where places count.
    """
    generator = np.random.default_rng(seed)
    held, widths, posteriors = [], [], []
    for trial in trials:
        row = int(np.flatnonzero(rows.trials == trial)[0])
        by_term = dict(rows.outputs.by_term)
        if gains and PLACES in by_term:
            by_term[PLACES] = gains(row)
        made = Outputs(by_term)
        others = rows.trials != trial
        surrogate = fit.surrogate.of(rows.points[others], made.all[others], rows.trials[others])
        record = _disturbed(made.chosen(slice(row, row + 1)), fit, generator)
        likelihood = replace(fit.likelihood, recorded=record, correction=CellCorrection.none(made))

        def evaluate(points: NDArray, surrogate=surrogate, likelihood: Likelihood = likelihood):
            known = expected(surrogate, likelihood.correction, points)
            return likelihood(*known), likelihood.implausibility(*known)

        posterior = find_posterior(evaluate, rows.points.shape[1], seed + int(trial), POINTS)
        low, _, high = posterior.quantiles(SHARES)
        held.append((low <= rows.points[row]) & (rows.points[row] <= high))
        widths.append(posterior.width_left())
        posteriors.append(posterior)
    return SelfTest(np.array(held), np.array(widths), tuple(posteriors))


def _disturbed(made: Outputs, fit: Fit, generator: np.random.Generator) -> Recorded:
    """One run's outputs as a record that is as uncertain as the mine's own."""
    recorded, error = fit.recorded, fit.likelihood.model_error
    log_potency, log_number = made.by_term[POTENCY][0], made.by_term[NUMBER][0]
    log_potency = log_potency + error * generator.standard_normal(log_potency.shape)
    log_potency = log_potency + generator.multivariate_normal(np.zeros(len(log_potency)), recorded.covariance)
    log_number = log_number + error * generator.standard_normal(log_number.shape)
    number = _clustered(np.exp(log_number), recorded.clustering, generator)
    sizes = made.by_term[SIZES][0, 0] if SIZES in made.by_term else recorded.log_excess
    sizes = sizes + np.hypot(error, recorded.excess_error) * generator.standard_normal()
    return replace(recorded, log_potency=log_potency, number=number, log_excess=float(sizes))


def _clustered(expected_number: NDArray, clustering: float, generator: np.random.Generator) -> NDArray:
    """Numbers (step,) with these means, whose variance is `clustering` times as large."""
    excess = clustering - 1.0
    if excess < 1e-3:
        return generator.poisson(expected_number)
    return generator.negative_binomial(expected_number / excess, 1.0 / (1.0 + excess))
