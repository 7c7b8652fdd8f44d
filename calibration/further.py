"""Where further trials teach most: points of a batch, chosen one after the other."""

import numpy as np
from numpy.typing import NDArray

from calibration.fit import Fit
from calibration.trials import NUMBER, POTENCY, SIZES

CANDIDATES = 400  # Points of the posterior among which a trial is chosen.
JUDGES = 400  # Points of the posterior over which the prediction's variance is averaged.


def further_points(fit: Fit, count: int, seed: int) -> NDArray:
    """Points (trial, quantity) of the posterior that lower the variance of the record's prediction most.

    A trial at x lowers the variance of an output at z by c(z, x)^2 / (c(x, x) + noise), with the covariance c of the
    Gaussian process (Cohn 1996). Outputs are weighted by one over the variance that the likelihood has for other
    reasons: what is uncertain anyhow need not be predicted better. After each choice the covariance is that with the
    chosen trial, so that trials of a batch keep apart.
    """
    places = fit.posterior.draws(CANDIDATES + JUDGES, seed)
    columns, weights = _weights(fit)
    covariances = [fit.surrogate.covariance(places, column) for column in columns]
    noise = fit.surrogate.noise[columns] ** 2
    chosen = []
    for _ in range(count):
        gains = np.zeros(CANDIDATES)
        for one, noise_of_one, weight in zip(covariances, noise, weights, strict=True):
            to_judges = one[:CANDIDATES, CANDIDATES:]
            gains += weight * (to_judges**2).mean(axis=1) / (np.diag(one)[:CANDIDATES] + noise_of_one)
        best = int(gains.argmax())
        chosen.append(places[best])
        covariances = [
            one - np.outer(one[:, best], one[best]) / (one[best, best] + noise_of_one)
            for one, noise_of_one in zip(covariances, noise, strict=True)
        ]
    return np.array(chosen)


def _weights(fit: Fit) -> tuple[list[int], NDArray]:
    """Outputs with a recorded value, and one over the variance that record, cells, model and chance give it."""
    likelihood, recorded = fit.likelihood, fit.recorded
    number = np.maximum(recorded.number, 1.0)
    variances = {
        POTENCY: np.diag(recorded.covariance),
        NUMBER: recorded.clustering / number,
        SIZES: np.array([recorded.excess_error**2]),
    }
    columns: list[int] = []
    found = []
    for term in [term for term in variances if term in likelihood.terms] or [POTENCY]:
        part, error = likelihood.columns[term], likelihood.discrepancy(term)
        columns += range(part.start, part.stop)
        found.append(variances[term] + error.common**2 + error.own**2 + fit.surrogate.noise[part] ** 2)
    return columns, 1.0 / np.concatenate(found)
