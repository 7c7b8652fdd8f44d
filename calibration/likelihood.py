"""Probability of the record for given quantities: a sum of terms, each of which can be left out.

Each term takes what the surrogate expects of the model at many points and what is recorded, by step, and returns
log-likelihoods (point,). Potency is judged by its logarithm, with a Student t distribution: sums of heavy-tailed sizes
have outliers. Numbers are judged by a negative binomial distribution, as recorded events come in clusters. Places are
judged by the smoothed density of the modelled ones, sizes by their mean logarithm.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp
from scipy.stats import chi2, nbinom, norm

from calibration.trials import NUMBER, PLACES, POTENCY, SIZES, CellCorrection, Discrepancy, RecordedOutputs

DEGREES_OF_FREEDOM = 5.0  # Of the Student t distribution of potency and sizes.
NODES, NODE_WEIGHTS = np.polynomial.hermite_e.hermegauss(9)  # Of the mean over what the surrogate does not know.
MAX_IMPLAUSIBILITY = 3.0  # Above it no trial within the ranges fits the record (three-sigma rule, Pukelsheim 1994).


@dataclass(frozen=True)
class Likelihood:
    """Likelihood of a record: terms that count, columns of the outputs by term, correction for the cells, model error.

    model_error: standard deviation of ln potency, ln number and ln mean size of each step, without that of the cells.
    gain_error (step,): r.m.s. error, nats, with which the information gain at recorded places is predicted.
    """

    recorded: RecordedOutputs
    terms: Sequence[str]
    columns: dict[str, slice]
    correction: CellCorrection
    model_error: float
    gain_error: NDArray | None = None

    def discrepancy(self, term: str) -> Discrepancy:
        """Error of the cells and of the model in the outputs of a term."""
        return self.correction.errors.get(term, Discrepancy()).with_own(self.model_error)

    def __call__(self, mean: NDArray, deviation: NDArray) -> NDArray:
        """Sum of the terms that count, (point,).

        mean, deviation (point, output): what is expected of one run, and what its surrogate and chance leave open.
        """
        total = np.zeros(len(mean))
        recorded = self.recorded
        for term in self.terms:
            part, discrepancy = self.columns[term], self.discrepancy(term)
            known = mean[:, part], deviation[:, part]
            if term == POTENCY:
                total += student_term(*known, recorded.log_potency, recorded.covariance, discrepancy)
            elif term == NUMBER:
                total += number_term(*known, recorded.number, recorded.dispersion_index, discrepancy)
            elif term == PLACES:
                total += mean[:, part] @ self.place_weights()
            elif term == SIZES:
                error = np.array([[recorded.excess_error**2]])
                total += student_term(*known, np.array([recorded.log_excess]), error, discrepancy)
        return total

    def place_weights(self) -> NDArray:
        """Independent events (step,) that the mean information gain of a step counts for.

        That is the recorded number over its dispersion index, and at most one over the error of the gain: the error of
        the prediction then changes the log-likelihood by one at most.
        """
        independent = self.recorded.number / self.recorded.dispersion_index
        if self.gain_error is None:
            return independent
        return np.minimum(independent, 1.0 / np.maximum(self.gain_error, 1e-12))

    def implausibility(self, mean: NDArray, deviation: NDArray) -> NDArray:
        """Distance of the recorded ln potency, ln number and ln mean size from the expected ones, (point,), in standard
        deviations, of the terms that count. Places have no expected value.

        The larger of two distances: that of the value that is furthest off, and that of all together. The latter is
        the distance of a normal value that is as improbable as their sum of squares.
        """
        recorded = self.recorded
        number = np.maximum(recorded.number, 0.5)
        values = {
            POTENCY: (recorded.log_potency, np.diag(recorded.covariance)),
            NUMBER: (np.log(number), recorded.dispersion_index / number),
            SIZES: (np.array([recorded.log_excess]), np.array([recorded.excess_error**2])),
        }
        largest, squares, count = np.zeros(len(mean)), np.zeros(len(mean)), 0
        for term in self.terms:
            if term in values:
                value, variance = values[term]
                part, discrepancy = self.columns[term], self.discrepancy(term)
                off = value - mean[:, part]
                steps = off.shape[1]
                covariance = (variance + deviation[:, part] ** 2)[:, :, None] * np.eye(steps) + discrepancy.covariance(
                    steps
                )
                distance = np.abs(off) / np.sqrt(np.einsum("nii->ni", covariance))
                largest = np.maximum(largest, distance.max(axis=1))
                squares += np.einsum("ni,ni->n", off, np.linalg.solve(covariance, off[:, :, None])[:, :, 0])
                count += steps
        if not count:
            return largest
        together = -norm.ppf(0.5 * np.maximum(chi2.sf(squares, count), 1e-300))
        return np.maximum(largest, together)


def student_term(
    mean: NDArray, deviation: NDArray, value: NDArray, covariance: NDArray, discrepancy: Discrepancy
) -> NDArray:
    """Log-density (point,) of recorded values (step,) with this covariance: multivariate Student t.

    mean, deviation (point, step): what is expected of one run, and what its surrogate and chance leave open.
    """
    steps, freedom = mean.shape[1], DEGREES_OF_FREEDOM
    scale = deviation[:, :, None] ** 2 * np.eye(steps) + covariance + discrepancy.covariance(steps)
    shape = scale * (freedom - 2.0) / freedom  # `scale` is the variance, that of the t distribution is larger
    factor = np.linalg.cholesky(shape)
    residual = np.linalg.solve(factor, (value - mean)[:, :, None])[:, :, 0]
    half_log_det = np.log(np.einsum("nii->ni", factor)).sum(axis=1)
    constant = gammaln((freedom + steps) / 2) - gammaln(freedom / 2) - steps / 2 * np.log(freedom * np.pi)
    return constant - half_log_det - (freedom + steps) / 2 * np.log1p((residual**2).sum(axis=1) / freedom)


def number_term(
    mean: NDArray, deviation: NDArray, number: NDArray, dispersion_index: float, discrepancy: Discrepancy
) -> NDArray:
    """Log-probability (point,) of recorded numbers (step,): negative binomial about the expected ones.

    mean, deviation (point, step): those of ln number. Errors are integrated out: the common part of the discrepancy
    over all steps at once, the rest for each step by itself. dispersion_index: variance over mean of a number.
    """
    own = np.sqrt(deviation**2 + discrepancy.own**2)
    by_common = []
    for common, weight in zip(NODES, NODE_WEIGHTS, strict=True):
        expected = np.exp(mean[:, :, None] + discrepancy.common * common + own[:, :, None] * NODES)
        probability = _log_probability(number[:, None], expected, dispersion_index)
        of_step = logsumexp(probability, axis=2, b=NODE_WEIGHTS / NODE_WEIGHTS.sum())
        by_common.append(of_step.sum(axis=1) + np.log(weight / NODE_WEIGHTS.sum()))
    return np.asarray(logsumexp(by_common, axis=0))


def _log_probability(number: NDArray, expected: NDArray, dispersion_index: float) -> NDArray:
    """Log-probability of a count with this variance-to-mean ratio (negative binomial).

    At a ratio of 1 it is that of a ratio of 1.001, which is nearly a Poisson number's.
    """
    excess = max(dispersion_index - 1.0, 1e-3)
    return nbinom.logpmf(number, expected / excess, 1.0 / (1.0 + excess))
