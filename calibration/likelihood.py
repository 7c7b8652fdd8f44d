"""Probability of the record for given quantities: a sum of terms, each of which can be left out.

Each term takes what the surrogate expects of the model at many points and what is recorded, by step, and returns
log-likelihoods (point,). Numbers are judged by a negative binomial distribution, as recorded events come in clusters.
Potency and sizes are judged together by a Student t distribution of their logarithms: sums of heavy-tailed sizes have
outliers. Where the number counts, too, potency counts as that of the mean event: clusters change potency and number
alike, and would count twice. Places are judged by the smoothed density of the modelled ones. Readings of instruments
have a module of their own, `instruments`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import chi2, nbinom, norm

from calibration.instruments import InstrumentTerm
from calibration.recorded import RecordedOutputs, as_of
from calibration.settings import INSTRUMENTS
from calibration.student import student_density
from calibration.trials import MEAN_POTENCY, NUMBER, PLACES, POTENCY, SIZES, CellCorrection, Discrepancy

NODES, NODE_WEIGHTS = np.polynomial.hermite_e.hermegauss(9)  # Of the mean over what the surrogate does not know.
MAX_IMPLAUSIBILITY = 3.0  # Above it no trial within the ranges fits the record (three-sigma rule, Pukelsheim 1994).


@dataclass(frozen=True)
class Differences:
    """Recorded less expected values, off (point, value), and the covariance (point, value, value) of each."""

    off: NDArray
    covariance: NDArray

    def beside(self, other: "Differences") -> "Differences":
        """These and other differences, which are independent of them."""
        count = self.off.shape[1]
        size = count + other.off.shape[1]
        covariance = np.zeros((len(self.off), size, size))
        covariance[:, :count, :count], covariance[:, count:, count:] = self.covariance, other.covariance
        return Differences(np.concatenate([self.off, other.off], axis=1), covariance)


@dataclass(frozen=True)
class Likelihood:
    """Likelihood of a record: terms that count, columns of the outputs by term, correction for the cells, model error.

    model_error: standard deviation of ln potency, ln number and ln mean size of each step, without that of the cells.
    chance (output,): standard deviation of a run of the model about what is expected. It and the chance of the record
    are two estimates of how far one course of events lies from its expectation: the larger counts.
    gain_error (step,): r.m.s. error, nats, with which the information gain at recorded places is predicted.
    shared: correlation of what the surrogate and chance leave open of ln potency and of ln number.
    instruments: their readings, if they count.
    """

    recorded: RecordedOutputs
    terms: Sequence[str]
    columns: dict[str, slice]
    correction: CellCorrection
    model_error: float
    chance: NDArray
    gain_error: NDArray | None = None
    shared: float = 0.0
    instruments: InstrumentTerm | None = None

    def scores(self, mean: NDArray, deviation: NDArray) -> tuple[NDArray, NDArray]:
        """Expected scores (point, score) of the instruments, and the variance that surrogate, chance and cells leave.

        mean, deviation: as of `__call__`.
        """
        part = self.columns[INSTRUMENTS]
        by_cells = 0.0 if self.correction.scatter is None else self.correction.scatter**2
        return mean[:, part], deviation[:, part] ** 2 + self.chance[part] ** 2 + by_cells

    def discrepancy(self, term: str) -> Discrepancy:
        """Error of the cells and of the model in the outputs of a term."""
        return self.correction.errors.get(term, Discrepancy()).with_own(self.model_error)

    def __call__(self, mean: NDArray, deviation: NDArray) -> NDArray:
        """Sum of the terms that count, (point,).

        mean, deviation (point, output): what is expected, and what the surrogate leaves open.
        """
        total = np.zeros(len(mean))
        if NUMBER in self.terms:
            part = self.columns[NUMBER]
            found = self.recorded.number, self.dispersion_index
            total += number_term(mean[:, part], deviation[:, part], *found, self.discrepancy(NUMBER))
        if PLACES in self.terms:
            total += mean[:, self.columns[PLACES]] @ self.place_weights()
        if (sizes := self.size_differences(mean, deviation)).off.shape[1]:
            total += student_term(sizes)
        if self.instruments is not None and INSTRUMENTS in self.terms:
            total += self.instruments(*self.scores(mean, deviation)).sum(axis=1)
        return total

    @property
    def dispersion_index(self) -> NDArray:
        """Variance over mean (step,) of the recorded number, by its clusters or by the runs of the model."""
        of_runs = self.chance[self.columns[NUMBER]] ** 2 * np.maximum(self.recorded.number, 0.5)
        return np.maximum(self.recorded.dispersion_index, of_runs)

    def modelled_count(self, mean: NDArray) -> NDArray:
        """Events above the cut (point,) of a run, of whole steps: those whose sizes its mean size is of.

        mean: as of `__call__`. A step without events counts as half of one.
        """
        share = 1.0 if self.correction.share is None else self.correction.share
        return (np.exp(mean[:, self.columns[NUMBER]]) / share).sum(axis=1)

    def place_weights(self) -> NDArray:
        """Independent events (step,) that the mean information gain of a step counts for.

        That is the recorded number over its dispersion index, and at most one over the error of the gain: the error of
        the prediction then changes the log-likelihood by one at most.
        """
        independent = self.recorded.number / self.recorded.dispersion_index
        if self.gain_error is None:
            return independent
        return np.minimum(independent, 1.0 / np.maximum(self.gain_error, 1e-12))

    def size_differences(self, mean: NDArray, deviation: NDArray) -> Differences:
        """Differences of ln potency by step, of the mean event where the number counts, and of ln mean size.

        Given the number, a step without events has no mean event.
        """
        recorded, terms = self.recorded, self.terms
        steps = len(recorded.number)
        given_number = NUMBER in terms
        off, variance, by_chance, covariance = [], [], [], np.zeros((0, 0))
        columns = np.arange(0)
        if POTENCY in terms:
            columns = np.flatnonzero(recorded.number > 0) if given_number else np.arange(steps)
            potency, open_by, run = self._of_term(POTENCY, columns, mean, deviation)
            value = recorded.log_potency[columns]
            if given_number:
                number, open_number, run_number = self._of_term(NUMBER, columns, mean, deviation)
                off.append(value - recorded.log_number[columns] - (potency - number))
                variance.append(self._of_mean_event(open_by, open_number))
                by_chance.append(self._of_mean_event(run, run_number))
                covariance = self.discrepancy(MEAN_POTENCY).covariance(len(columns))
            else:
                off.append(value - potency)
                variance.append(open_by**2)
                by_chance.append(np.maximum(run**2 - recorded.number_variance[columns], 0.0))
                covariance = self.discrepancy(POTENCY).covariance(len(columns))
                covariance = covariance + np.diag(recorded.number_variance[columns])
        if SIZES in terms:
            size, open_by, run = self._of_term(SIZES, np.arange(1), mean, deviation)
            modelled, number = self.modelled_count(mean)[:, None], recorded.number.sum()
            fewer = np.minimum(modelled, number)
            off.append(as_of(recorded.log_excess, number, fewer) - as_of(size, modelled, fewer))
            variance.append(open_by**2)
            by_chance.append(run**2)
            columns = np.append(columns, steps)
            covariance = np.pad(covariance, (0, 1))
            covariance[-1, -1] = self.discrepancy(SIZES).covariance(1)[0, 0]
        if not off:
            return Differences(np.zeros((len(mean), 0)), np.zeros((len(mean), 0, 0)))
        of_sizes = recorded.size_covariance[np.ix_(columns, columns)]
        more = np.maximum(np.concatenate(by_chance) - np.diag(of_sizes), 0.0)
        own = np.concatenate(variance, axis=1) + more
        return Differences(np.concatenate(off, axis=1), own[:, :, None] * np.eye(len(columns)) + covariance + of_sizes)

    def _of_term(
        self, term: str, steps: NDArray, mean: NDArray, deviation: NDArray
    ) -> tuple[NDArray, NDArray, NDArray]:
        """Mean and deviation (point, step) of a term in some steps, and chance (step,) of a run."""
        part = self.columns[term]
        return mean[:, part][:, steps], deviation[:, part][:, steps], self.chance[part][steps]

    def _of_mean_event(self, potency: NDArray, number: NDArray) -> NDArray:
        """Variance of ln mean potency, from standard deviations of ln potency and ln number."""
        return potency**2 + number**2 - 2.0 * self.shared * potency * number

    def differences(self, mean: NDArray, deviation: NDArray) -> Differences:
        """Differences of all values of the terms that count. Places have no expected value.

        Of the instruments, those that work at the first point.
        """
        found = self.catalogue_differences(mean, deviation)
        if self.instruments is None or INSTRUMENTS not in self.terms:
            return found
        scores, variance = self.scores(mean, deviation)
        first = scores[:1], variance[:1], np.ones(1)
        errors, working = self.instruments.likeliest_errors(*first), self.instruments.working(*first)
        for one, error, probability in zip(self.instruments.instruments, errors, working, strict=True):
            if probability > 0.5:
                covariance = one.covariance(scores, variance, self.model_error, error)
                found = found.beside(Differences(one.value - one.expected(scores), covariance))
        return found

    def catalogue_differences(self, mean: NDArray, deviation: NDArray) -> Differences:
        """Differences of the values of the record that count."""
        sizes = self.size_differences(mean, deviation)
        if NUMBER not in self.terms:
            return sizes
        part, recorded = self.columns[NUMBER], self.recorded
        steps = len(recorded.number)
        by_clusters = self.dispersion_index / np.maximum(recorded.number, 0.5)
        covariance = np.diag(by_clusters) + self.discrepancy(NUMBER).covariance(steps)
        own = deviation[:, part, None] ** 2 * np.eye(steps)
        return sizes.beside(Differences(recorded.log_number - mean[:, part], own + covariance))

    def implausibility(self, mean: NDArray, deviation: NDArray) -> NDArray:
        """Distance of the recorded values from the expected ones, (point,), in standard deviations.

        The larger of two distances: that of the value that is furthest off, and that of all together. The latter is
        the distance of a normal value that is as improbable as their sum of squares. Of the instruments, that of the
        one in the middle: some may be broken.
        """
        of_record = self._of_record(mean, deviation)
        if self.instruments is None or INSTRUMENTS not in self.terms:
            return of_record
        return np.maximum(of_record, np.median(self.instruments.distances(*self.scores(mean, deviation)), axis=1))

    def _of_record(self, mean: NDArray, deviation: NDArray) -> NDArray:
        found = self.catalogue_differences(mean, deviation)
        count = found.off.shape[1]
        if not count:
            return np.zeros(len(mean))
        largest = (np.abs(found.off) / np.sqrt(np.einsum("nii->ni", found.covariance))).max(axis=1)
        squares = np.einsum("ni,ni->n", found.off, np.linalg.solve(found.covariance, found.off[:, :, None])[:, :, 0])
        together = -norm.ppf(0.5 * np.maximum(chi2.sf(squares, count), 1e-300))
        return np.maximum(largest, together)


def student_term(found: Differences) -> NDArray:
    """Log-density (point,) of differences (point, value) with this covariance: multivariate Student t."""
    factor = np.linalg.cholesky(found.covariance)
    residual = np.linalg.solve(factor, found.off[:, :, None])[:, :, 0]
    half_log_det = np.log(np.einsum("nii->ni", factor)).sum(axis=1)
    return student_density((residual**2).sum(axis=1), half_log_det, found.off.shape[1])


def number_term(
    mean: NDArray, deviation: NDArray, number: NDArray, dispersion_index: NDArray, discrepancy: Discrepancy
) -> NDArray:
    """Log-probability (point,) of recorded numbers (step,): negative binomial about the expected ones.

    mean, deviation (point, step): those of ln number. Errors are integrated out: the common part of the discrepancy
    over all steps at once, the rest for each step by itself. dispersion_index (step,): variance over mean of a number.
    """
    own = np.sqrt(deviation**2 + discrepancy.own**2)
    nodes, weights = (NODES, NODE_WEIGHTS) if discrepancy.common > 0.0 else (np.zeros(1), np.ones(1))
    by_common = []
    for common, weight in zip(nodes, weights, strict=True):
        expected = np.exp(mean[:, :, None] + discrepancy.common * common + own[:, :, None] * NODES)
        probability = _log_probability(number[:, None], expected, dispersion_index[:, None])
        of_step = logsumexp(probability, axis=2, b=NODE_WEIGHTS / NODE_WEIGHTS.sum())
        by_common.append(of_step.sum(axis=1) + np.log(weight / weights.sum()))
    return np.asarray(logsumexp(by_common, axis=0))


def _log_probability(number: NDArray, expected: NDArray, dispersion_index: NDArray) -> NDArray:
    """Log-probability of a count with this variance-to-mean ratio (negative binomial).

    At a ratio of 1 it is that of a ratio of 1.001, which is nearly a Poisson number's.
    """
    excess = np.maximum(dispersion_index - 1.0, 1e-3)
    return nbinom.logpmf(number, expected / excess, 1.0 / (1.0 + excess))
