"""Readings of instruments as a term of the likelihood: what they are worth, and which of them work.

An instrument that was zeroed tells changes alone. Its readings become contrasts, which are free of its zero: n readings
of one place make n - 1 of them, and a constant added to all readings changes none. Other instruments keep their values.

The readings of one instrument share errors: half of the variance that the cells leave is common to all of them, and
the model's change there has a factor whose deviation is `model_error` (local stiffness and stress, the instrument's own
factor). A reading's own error is the stated one, or integrated out if none is stated.

Each instrument is in one of three states, and its density is the mean over them, so that a broken one loses its say:
it works; it has a wrong factor, unit, sign or zero; or it says nothing of the rock (a mixture for outliers, Box and
Tiao 1968). In each state the density is a multivariate Student t
whose scale does not fall below 1 (student.py). Instruments are independent of each other.

What runs give at all readings is reduced to few scores by a singular value decomposition in units of the errors, and
the surrogate predicts scores (Higdon et al. 2008, doi:10.1198/016214507000000888).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.linalg import block_diag, helmert, solve_triangular
from scipy.special import logsumexp
from scipy.stats import chi2, norm

from calibration.student import widened_density
from common.errors import InputError

STATED_AS_95 = 1.96  # A modelled error is half of a 95 % interval.
COMMON_SHARE = 0.5  # Of the variance that the cells leave in the readings of an instrument, which all of them share.
WORKS, SCALED, SILENT = range(3)  # States of an instrument.
STATE_SHARES = np.array([0.9, 0.05, 0.05])  # Prior probability of each.
SCALED_FACTOR = 1.0  # Standard deviation of the factor of an instrument that is scaled, about 1.
SILENT_ERROR = 3.0  # Error of a reading that says nothing, over the r.m.s. of what runs give there.
UNKNOWN_ERRORS = np.geomspace(0.01, 1.0, 7)  # Errors that are as probable, over the same, where none is stated.
ASSUMED_ERROR = 0.1  # Of these, in whose unit scores are made.
MAX_VALUES = 4_000_000  # Of an array by point, contrast and score.
MIN_SCORE = 0.3  # R.m.s. of a score over the runs, in errors of a reading, from which on it is predicted.


@dataclass(frozen=True)
class Instrument:
    """An instrument with its readings, MPa or mm.

    step (reading,) and distance (reading,), m: when and where along a line; contrasts (contrast, reading): orthonormal
    rows that make contrasts of readings, value (contrast,) those of the readings; error: of a reading, NaN if not
    stated; cells (contrast, contrast): covariance of what cells and scores leave; zero (contrast, place): 1 where a
    value has the unknown zero of its place; a run with the scores s gives centre (contrast,) + basis (contrast, score)
    s; size: r.m.s. of what runs give.
    """

    name: str
    unit: str
    step: tuple[str, ...]
    distance: NDArray
    contrasts: NDArray
    value: NDArray
    error: float
    cells: NDArray
    zero: NDArray
    centre: NDArray
    basis: NDArray
    size: float

    @property
    def errors(self) -> NDArray:
        """Errors of a reading that are as probable: the stated one, or UNKNOWN_ERRORS of the size."""
        return np.array([self.error]) if np.isfinite(self.error) else self.size * UNKNOWN_ERRORS

    def expected(self, scores: NDArray) -> NDArray:
        """What runs with these scores (point, score) give, (point, contrast)."""
        return self.centre + scores @ self.basis.T

    @cached_property
    def factors(self) -> dict[tuple[int, int], NDArray]:
        """Cholesky factors of the covariance that is the same at all points, by state and number of the error."""
        found, unit = {}, np.eye(len(self.value))
        for number, error in enumerate(self.errors):
            works = self.cells + error**2 * unit
            found[WORKS, number] = np.linalg.cholesky(works)
            found[SCALED, number] = np.linalg.cholesky(works + self.size**2 * self.zero @ self.zero.T)
            found[SILENT, number] = np.linalg.cholesky(works + (SILENT_ERROR * self.size) ** 2 * unit)
        return found

    def rest(self, scores: NDArray, variance: NDArray, gain: float) -> NDArray:
        """Factor (point, contrast, column) of the rest of the covariance: open scores, and the factor of the model."""
        columns = self.basis * np.sqrt(variance)[:, None, :]
        return np.concatenate([columns, gain * self.expected(scores)[:, :, None]], axis=2)

    def made(
        self, scores: NDArray, variance: NDArray, gain: float, error: int, generator: np.random.Generator
    ) -> NDArray:
        """Readings (point, contrast) that the instrument makes where it works, with all errors; error: its number."""
        factor, rest = self.factors[WORKS, error], self.rest(scores, variance, gain)
        noise = generator.standard_normal((len(scores), len(factor))) @ factor.T
        by_rest = np.einsum("ncr,nr->nc", rest, generator.standard_normal((len(scores), rest.shape[2])))
        return self.expected(scores) + noise + by_rest

    def squares(self, scores: NDArray, variance: NDArray, gain: float, of: tuple[int, int]) -> tuple[NDArray, NDArray]:
        """Squared distance (point,) of the readings from the expected ones, and half the log of the determinant.

        of: state and number of the error. By the matrix determinant and inversion lemmas: the covariance is one that is
        the same at all points, and few columns.
        """
        parts = -(-scores.shape[0] * self.basis.size // MAX_VALUES)  # an extensometer may have a thousand readings
        every = np.array_split(np.arange(len(scores)), parts)
        found = [self._squares(scores[at], variance[at], gain, self.factors[of]) for at in every]
        squares, half_log_det = (np.concatenate(one) for one in zip(*found, strict=True))
        return squares, half_log_det

    def _squares(self, scores: NDArray, variance: NDArray, gain: float, factor: NDArray) -> tuple[NDArray, NDArray]:
        """Results of `squares` at some of the points."""
        basis = solve_triangular(factor, self.basis, lower=True)
        expected = solve_triangular(factor, self.expected(scores).T, lower=True).T
        off = solve_triangular(factor, self.value, lower=True) - expected
        columns = np.concatenate([basis * np.sqrt(variance)[:, None, :], gain * expected[:, :, None]], axis=2)
        inner = np.eye(columns.shape[2]) + columns.transpose(0, 2, 1) @ columns
        along = columns.transpose(0, 2, 1) @ off[:, :, None]
        saved = (along * np.linalg.solve(inner, along)).sum(axis=(1, 2))
        half_log_det = np.log(np.diag(factor)).sum() + 0.5 * np.linalg.slogdet(inner)[1]
        return np.maximum((off**2).sum(axis=1) - saved, 0.0), half_log_det

    def covariance(self, scores: NDArray, variance: NDArray, gain: float, error: int) -> NDArray:
        """Covariance (point, contrast, contrast) of readings of a working instrument."""
        factor, rest = self.factors[WORKS, error], self.rest(scores, variance, gain)
        return factor @ factor.T + np.einsum("ncr,ndr->ncd", rest, rest)

    def centred(self, contrast: NDArray) -> NDArray:
        """Readings (..., reading) with these contrasts (..., contrast); where a zero is unknown, relative to the mean
        of its place."""
        return contrast @ self.contrasts


@dataclass(frozen=True)
class InstrumentTerm:
    """The instruments that count, the model's error at them, and the names of those without a reading that counts."""

    instruments: tuple[Instrument, ...]
    model_error: float
    unused: tuple[str, ...] = ()

    def by_error(self, number: int, scores: NDArray, variance: NDArray) -> NDArray:
        """Log-density (point, error, state) of the readings of an instrument, times the prior of error and state."""
        one = self.instruments[number]
        found = np.empty((len(scores), len(one.errors), len(STATE_SHARES)))
        for error in range(len(one.errors)):
            for state, share in enumerate(STATE_SHARES):
                squares, half_log_det = one.squares(scores, variance, self._gain(state), (state, error))
                density = widened_density(squares, half_log_det, len(one.value))
                found[:, error, state] = density + np.log(share / len(one.errors))
        return found

    def _gain(self, state: int) -> float:
        return float(np.hypot(self.model_error, SCALED_FACTOR)) if state == SCALED else self.model_error

    def __call__(self, scores: NDArray, variance: NDArray) -> NDArray:
        """Log-density (point, instrument) of the readings; scores (point, score) expected, and their variance."""
        every = [logsumexp(self.by_error(n, scores, variance), axis=(1, 2)) for n in range(len(self.instruments))]
        return np.stack(every, axis=1)

    def distances(self, scores: NDArray, variance: NDArray) -> NDArray:
        """Distance (point, instrument) of the readings from the expected ones of a working instrument, in standard
        deviations: that of a normal value as improbable as their sum of squares."""
        found = np.empty((len(scores), len(self.instruments)))
        for number, one in enumerate(self.instruments):
            likeliest = np.zeros(len(scores), int)
            if len(one.errors) > 1:
                likeliest = self.by_error(number, scores, variance)[:, :, WORKS].argmax(axis=1)
            for error in np.unique(likeliest):
                at = likeliest == error
                squares, _ = one.squares(scores[at], variance[at], self.model_error, (WORKS, int(error)))
                found[at, number] = -norm.ppf(0.5 * np.maximum(chi2.sf(squares, len(one.value)), 1e-300))
        return found

    def working(self, scores: NDArray, variance: NDArray, weights: NDArray) -> NDArray:
        """Probability (instrument,) that each works, over points of these weights (point,), to which it contributes."""
        found = []
        for number in range(len(self.instruments)):
            by_state = logsumexp(self.by_error(number, scores, variance), axis=1)
            found.append(weights @ np.exp(by_state[:, WORKS] - logsumexp(by_state, axis=1)))
        return np.array(found)

    def likeliest_errors(self, scores: NDArray, variance: NDArray, weights: NDArray) -> list[int]:
        """Number of the likeliest error of a reading of each instrument, over points of these weights (point,)."""
        found = []
        for number in range(len(self.instruments)):
            works = self.by_error(number, scores, variance)[:, :, WORKS]
            found.append(int(logsumexp(works, axis=0, b=weights[:, None]).argmax()))
        return found

    def made(
        self, scores: NDArray, variance: NDArray, errors: Sequence[int], generator: np.random.Generator
    ) -> "InstrumentTerm":
        """Instruments that work, with readings made at the scores (score,): all errors are drawn."""
        made = []
        for one, error in zip(self.instruments, errors, strict=True):
            covariance = one.covariance(scores[None], variance[None], self.model_error, error)[0]
            value = generator.multivariate_normal(one.expected(scores[None])[0], covariance, method="cholesky")
            made.append(replace(one, value=value))
        return replace(self, instruments=tuple(made))


def instrument_term(
    readings: xr.Dataset, modelled: NDArray, modelled_error: NDArray, model_error: float
) -> tuple[InstrumentTerm, NDArray]:
    """Instruments whose readings count, and the scores (run, score) of the runs.

    readings: the table (common.observation_table.READING_FIELDS); modelled and its error (run, row): what runs give at
    its rows. A reading counts where all runs have rock. Raises InputError where none does.
    """
    names, distance = readings["instrument"].values, readings["distance"].values
    measured, rock = readings["measured"].values, np.isfinite(modelled).all(axis=0)
    found, scaled, unused = [], [], []
    for name in dict.fromkeys(names.tolist()):
        own = np.flatnonzero((names == name) & np.isfinite(measured) & rock)
        is_zeroed = bool(readings["zeroed"].values[names == name][0])
        of_place = np.unique(distance[own], return_inverse=True)[1]  # all that are not a number are one
        places = [own[of_place == one] for one in range(of_place.max(initial=-1) + 1)]
        own = np.concatenate([np.empty(0, int), *places])
        blocks = [helmert(len(rows)) if is_zeroed else np.eye(len(rows)) for rows in places]
        contrasts = block_diag(*blocks) if blocks else np.empty((0, 0))
        if not len(contrasts):
            unused.append(str(name))
            continue
        given = modelled[:, own] @ contrasts.T
        by_cells = np.sqrt(np.mean(np.nan_to_num(modelled_error[:, own]) ** 2, axis=0)) / STATED_AS_95
        shared = COMMON_SHARE * np.outer(by_cells, by_cells) + (1.0 - COMMON_SHARE) * np.diag(by_cells**2)
        value, error = contrasts @ measured[own], float(readings["measured_error"].values[own[0]])
        size = float(np.sqrt(np.mean(given**2))) or float(np.sqrt(np.mean(value**2))) or 1.0
        zero = block_diag(*(np.ones((len(rows), 1)) for rows in places))
        scaled.append(given / (error if np.isfinite(error) else ASSUMED_ERROR * size))
        found.append(
            Instrument(
                str(name),
                str(readings["unit"].values[own[0]]),
                tuple(readings["step"].values[own].tolist()),
                distance[own],
                contrasts,
                value,
                error,
                contrasts @ shared @ contrasts.T,
                contrasts @ zero if not is_zeroed else np.zeros((len(value), 1)),
                given.mean(axis=0),
                np.empty((len(value), 0)),
                size,
            )
        )
    if not found:
        raise InputError(
            "calibration.terms: instruments: no reading counts: an instrument that was zeroed (since) needs readings "
            "in two steps, and any place needs rock; give more readings, or leave instruments out"
        )
    return _with_scores(found, scaled, model_error, tuple(unused))


def _with_scores(
    found: list[Instrument], scaled: list[NDArray], model_error: float, unused: tuple[str, ...]
) -> tuple[InstrumentTerm, NDArray]:
    """The term, whose instruments have the basis of the scores, and the scores (run, score).

    scaled: what runs give at each instrument (run, contrast), over the error of a reading.
    """
    every = np.concatenate(scaled, axis=1)
    left, singular, right = np.linalg.svd(every - every.mean(axis=0), full_matrices=False)
    kept = np.flatnonzero(singular > MIN_SCORE * np.sqrt(len(every)))
    kept = kept if len(kept) else np.arange(1)
    others = np.setdiff1d(np.arange(len(singular)), kept)  # part of the error
    rest = (singular[others, None] * right[others] / np.sqrt(len(every))).T
    bounds, instruments = np.cumsum([0, *(len(one.value) for one in found)]), []
    for number, one in enumerate(found):
        unit = one.error if np.isfinite(one.error) else ASSUMED_ERROR * one.size
        own = slice(bounds[number], bounds[number + 1])
        cells = one.cells + unit**2 * rest[own] @ rest[own].T
        instruments.append(replace(one, basis=unit * right[kept, own].T, cells=cells))
    return InstrumentTerm(tuple(instruments), model_error, unused), left[:, kept] * singular[kept]
