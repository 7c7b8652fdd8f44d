"""Each trial in turn as the record: do the stated intervals hold the values that made it?"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.fit import SHARES, CellCorrection, expected, log_likelihood
from calibration.likelihood import Recorded
from calibration.posterior import find_posterior
from calibration.surrogate import Surrogate

POINTS = 2**11  # Sobol points of a posterior: fewer than of the mine's own, as there is one for each trial.


@dataclass(frozen=True)
class SelfTest:
    """held (trial, quantity) bool: whether the 90 % interval holds the trial's value; width (trial, quantity): of the
    interval over that of the prior."""

    held: NDArray
    width: NDArray

    @property
    def coverage(self) -> float:
        """Share of all intervals that hold their value."""
        return float(self.held.mean())


def calibrate_to_trials(
    surrogate: Surrogate, replicates: int, recorded: Recorded, terms: tuple[str, ...], model_error: float, seed: int
) -> SelfTest:
    """Calibrate to each trial of the design, on a surrogate without it.

    Its potency and number are disturbed as those of a record are: by the record's covariance, by its clustering, and by
    the model's error. Trials and made-up record have the same cells, so that nothing is corrected for them.
    """
    generator = np.random.default_rng(seed)
    steps = len(recorded.number)
    correction = CellCorrection.none(steps)
    held, widths = [], []
    for trial in range(replicates, len(surrogate.points)):
        others = surrogate.without(trial)
        made = surrogate.outputs[trial] + model_error * generator.standard_normal(2 * steps)
        log_potency = made[:steps] + generator.multivariate_normal(np.zeros(steps), recorded.covariance)
        number = _clustered(np.exp(made[steps:]), recorded.clustering, generator)
        record = Recorded(log_potency, recorded.covariance, number, recorded.clustering)

        def evaluate(points: NDArray, others=others, record=record) -> tuple[NDArray, NDArray]:
            mean, deviation = expected(others, correction, points)
            found = log_likelihood(mean, deviation, correction, record, terms, model_error)
            return found, np.zeros(len(points))

        posterior = find_posterior(evaluate, surrogate.points.shape[1], seed + trial, POINTS)
        low, _, high = posterior.quantiles(SHARES)
        held.append((low <= surrogate.points[trial]) & (surrogate.points[trial] <= high))
        widths.append(posterior.width_left())
    return SelfTest(np.array(held), np.array(widths))


def _clustered(expected_number: NDArray, clustering: float, generator: np.random.Generator) -> NDArray:
    """Numbers (step,) with these means, whose variance is `clustering` times as large."""
    excess = clustering - 1.0
    if excess < 1e-3:
        return generator.poisson(expected_number)
    return generator.negative_binomial(expected_number / excess, 1.0 / (1.0 + excess))
