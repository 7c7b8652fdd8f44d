"""How probable the record is for given quantities: terms of which each can be left out.

Each term takes what the surrogate expects of the model at many points and what is recorded, by step, and returns
log-likelihoods (point,). Potency is judged by its logarithm, with a Student t distribution: sums of heavy-tailed sizes
have outliers. Numbers are judged by a negative binomial distribution, as recorded events come in clusters.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp
from scipy.stats import nbinom

DEGREES_OF_FREEDOM = 5.0  # Of the Student t distribution of potency.
NODES, NODE_WEIGHTS = np.polynomial.hermite_e.hermegauss(9)  # Of the mean over what the surrogate does not know.
MAX_IMPLAUSIBILITY = 3.0  # Above it no trial within the ranges fits the record (three-sigma rule, Pukelsheim 1994).


@dataclass(frozen=True)
class Recorded:
    """What the record says of each step, in the steps' order.

    log_potency (step,) ln m3, covariance (step, step) of it; number (step,) of events above the common cut; clustering:
    variance over mean of that number.
    """

    log_potency: NDArray
    covariance: NDArray
    number: NDArray
    clustering: float = 1.0


@dataclass(frozen=True)
class Discrepancy:
    """How far the model itself is from the rock: standard deviations of ln potency and of ln number.

    common: of an error that all steps share, such as that of the cells; own: of one that each step has for itself.
    """

    common: float = 0.0
    own: float = 0.0

    def covariance(self, steps: int) -> NDArray:
        """(step, step)."""
        return np.full((steps, steps), self.common**2) + self.own**2 * np.eye(steps)


def potency_term(mean: NDArray, deviation: NDArray, recorded: Recorded, discrepancy: Discrepancy) -> NDArray:
    """Log-density of the recorded ln potency: multivariate Student t.

    mean, deviation (point, step): what is expected of one run, and what its surrogate and chance leave open.
    """
    scale = _covariance(deviation, recorded, discrepancy)
    steps, freedom = mean.shape[1], DEGREES_OF_FREEDOM
    shape = scale * (freedom - 2.0) / freedom  # `scale` is the variance, that of the t distribution is larger
    factor = np.linalg.cholesky(shape)
    residual = np.linalg.solve(factor, (recorded.log_potency - mean)[:, :, None])[:, :, 0]
    half_log_det = np.log(np.einsum("nii->ni", factor)).sum(axis=1)
    constant = gammaln((freedom + steps) / 2) - gammaln(freedom / 2) - steps / 2 * np.log(freedom * np.pi)
    return constant - half_log_det - (freedom + steps) / 2 * np.log1p((residual**2).sum(axis=1) / freedom)


def number_term(mean: NDArray, deviation: NDArray, recorded: Recorded, discrepancy: Discrepancy) -> NDArray:
    """Log-probability of the recorded numbers: negative binomial about the expected ones.

    mean, deviation (point, step) of ln number. What is not known is integrated out: the common part of the discrepancy
    over all steps at once, the rest for each step by itself.
    """
    own = np.sqrt(deviation**2 + discrepancy.own**2)
    by_common = []
    for common, weight in zip(NODES, NODE_WEIGHTS, strict=True):
        expected = np.exp(mean[:, :, None] + discrepancy.common * common + own[:, :, None] * NODES)
        probability = _log_probability(recorded.number[:, None], expected, recorded.clustering)
        of_step = logsumexp(probability, axis=2, b=NODE_WEIGHTS / NODE_WEIGHTS.sum())
        by_common.append(of_step.sum(axis=1) + np.log(weight / NODE_WEIGHTS.sum()))
    return np.asarray(logsumexp(by_common, axis=0))


def _log_probability(number: NDArray, expected: NDArray, clustering: float) -> NDArray:
    """Of a number with this variance over its mean; Poisson where they are equal (to a thousandth)."""
    excess = max(clustering - 1.0, 1e-3)
    return nbinom.logpmf(number, expected / excess, 1.0 / (1.0 + excess))


def implausibility(mean: NDArray, deviation: NDArray, recorded: Recorded, discrepancy: Discrepancy) -> NDArray:
    """Largest distance of a step's ln potency from what is expected of it, in standard deviations, (point,)."""
    variance = np.einsum("nii->ni", _covariance(deviation, recorded, discrepancy))
    return np.abs((recorded.log_potency - mean) / np.sqrt(variance)).max(axis=1)


def _covariance(deviation: NDArray, recorded: Recorded, discrepancy: Discrepancy) -> NDArray:
    """Of recorded less expected ln potency, (point, step, step)."""
    steps = deviation.shape[1]
    return deviation[:, :, None] ** 2 * np.eye(steps) + recorded.covariance + discrepancy.covariance(steps)
