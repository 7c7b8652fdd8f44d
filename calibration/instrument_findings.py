"""What instruments add to a calibration: intervals with and without them, and those that contradict the other data."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.fit import INTERVAL_SHARE, Fit
from calibration.instruments import WORKS, Instrument
from calibration.posterior import normalized
from calibration.settings import INSTRUMENTS

MAX_P_VALUE = 0.05  # Of the test of all instruments: each has this over their number.
CATALOGUE, ALONE, BOTH = "catalogue alone", "instruments alone", "both"  # Names of fits.
MIN_ODDS = 5.0  # From which on other values are said: of right data fewer than one pair in twenty has so large odds.
MAX_LOG_ODDS = 700.0
DRAWS = 2000  # Sets of readings that are made for a p-value.
FACTORS = (0.77, 1.3)  # Readings over the model, within which no other factor is named.


@dataclass(frozen=True)
class Finding:
    """An instrument of a calibration.

    readings: number of those that count; misfit, expected_misfit: r.m.s. difference from the posterior's mean and what
    all errors let expect, in its unit; factor: readings over the model, by least squares; working: probability that it
    works; p_rest, p_catalogue: share of sets of readings, made from the posterior of all other data and from that of
    the catalogue, that are as far from it; NaN without a catalogue.
    """

    name: str
    unit: str
    readings: int
    misfit: float
    expected_misfit: float
    factor: float
    working: float
    p_rest: float
    p_catalogue: float


@dataclass(frozen=True)
class InstrumentFindings:
    """Findings of all instruments, names of those without a reading that counts, and widths left (quantity,) by the
    catalogue alone, by the instruments alone and by both, by name; with intervals (3, quantity).

    other_values: how many times as probable catalogue and readings are if each has values of its own, as if both have
    the same ones; NaN without both.
    """

    instruments: tuple[Finding, ...]
    unused: tuple[str, ...]
    widths: dict[str, NDArray]
    intervals: dict[str, NDArray]
    other_values: float

    @property
    def level(self) -> float:
        """Largest p-value with which an instrument is said to contradict."""
        return max(MAX_P_VALUE / len(self.instruments), 1.5 / DRAWS)

    def says_other_values(self) -> bool:
        """True if the page says that catalogue and readings want other values."""
        return self.other_values >= MIN_ODDS

    def contradicts_rest(self) -> list[Finding]:
        """Instruments that contradict all other data."""
        return [one for one in self.instruments if one.p_rest <= self.level]


def by_terms(fit: Fit, seed: int) -> dict[str, Fit]:
    """The fit by the catalogue alone, by the instruments alone and by both; itself alone where no catalogue counts."""
    of_catalogue = tuple(one for one in fit.likelihood.terms if one != INSTRUMENTS)
    if not of_catalogue:
        return {INSTRUMENTS: fit}
    return {
        CATALOGUE: fit.with_terms(of_catalogue, seed),
        ALONE: fit.with_terms((INSTRUMENTS,), seed),
        BOTH: fit,
    }


def find(fit: Fit, fits: dict[str, Fit], seed: int) -> InstrumentFindings:
    """What the instruments of a fit add to the others, which are those of `by_terms`."""
    term = fit.likelihood.instruments
    assert term is not None
    weights, (scores, variance) = fit.posterior.weights, fit.instrument_scores()
    density = term(scores, variance)
    errors, working = term.likeliest_errors(scores, variance, weights), term.working(scores, variance, weights)
    catalogue = fits.get(CATALOGUE)
    findings = []
    for number, (one, error) in enumerate(zip(term.instruments, errors, strict=True)):
        generator = np.random.default_rng([seed, number])
        rest = normalized(fit.posterior.log_weights - density[:, number])
        known = one, error, term.model_error, generator
        of_rest, of_record = p_value(*known, scores, variance, rest), np.nan
        if catalogue is not None:
            of_record = p_value(*known, *catalogue.instrument_scores(), catalogue.posterior.weights)
        findings.append(
            _finding(one, error, fit, (scores, variance, weights, rest), working[number], of_rest, of_record)
        )
    return InstrumentFindings(
        tuple(findings),
        term.unused,
        {name: other.posterior.width_left(INTERVAL_SHARE) for name, other in fits.items()},
        {name: other.posterior.intervals(INTERVAL_SHARE) for name, other in fits.items()},
        other_values_odds(fits),
    )


def other_values_odds(fits: dict[str, Fit]) -> float:
    """How many times as probable catalogue and readings are if each has values of its own, as if both have the same
    ones; NaN without both.

    It is the ratio of the evidences (Bayes factor): that of one alone times that of the other, over that of both.
    """
    if BOTH not in fits:
        return np.nan
    alone, catalogue, both = (fits[name].posterior.log_evidence for name in (ALONE, CATALOGUE, BOTH))
    return float(np.exp(min(alone + catalogue - both, MAX_LOG_ODDS)))


def _finding(
    one: Instrument, error: int, fit: Fit, points: Sequence[NDArray], working: float, p_rest: float, p_catalogue: float
) -> Finding:
    """points: scores, their variance, weights of the posterior, and weights without the instrument's own readings."""
    scores, variance, weights, rest = points
    off = one.centred(one.value - weights @ one.expected(scores))
    middle, open_by = (rest @ scores)[None], (rest @ variance)[None]
    expected = one.expected(middle)[0]
    covariance = one.covariance(middle, open_by, fit.likelihood.model_error, error)[0]
    against = np.linalg.solve(one.factors[WORKS, error] @ one.factors[WORKS, error].T, expected)
    return Finding(
        one.name,
        one.unit,
        len(one.step),
        float(np.sqrt(np.mean(off**2))),
        float(np.sqrt(np.trace(covariance) / len(one.step))),
        float(against @ one.value / max(against @ expected, 1e-300)),
        float(working),
        p_rest,
        p_catalogue,
    )


def p_value(
    one: Instrument,
    error: int,
    model_error: float,
    generator: np.random.Generator,
    scores: NDArray,
    variance: NDArray,
    weights: NDArray,
) -> float:
    """Share of sets of readings of a working instrument, made at points of these weights (point,), that are as far off.

    scores, variance (point, score): as of InstrumentTerm. The distance is that from the mean of all sets by their
    covariance (Mahalanobis); its distribution is that of the sets themselves, so that no shape of the posterior is
    assumed.
    """
    drawn = generator.choice(len(weights), DRAWS, p=weights)
    at, open_by = scores[drawn], variance[drawn]
    expected, rest, factor = one.expected(at), one.rest(at, open_by, model_error), one.factors[WORKS, error]
    made = one.made(at, open_by, model_error, error, generator)
    mean = expected.mean(axis=0)
    covariance = factor @ factor.T + np.einsum("ncr,ndr->cd", rest, rest) / DRAWS
    covariance = covariance + np.atleast_2d(np.cov(expected.T))
    off = np.concatenate([one.value[None], made]) - mean
    squares = np.einsum("nc,nc->n", off, np.linalg.solve(covariance, off.T).T)
    return float((1 + np.count_nonzero(squares[1:] >= squares[0])) / (1 + DRAWS))


def sentences(found: InstrumentFindings) -> list[str]:
    """Instruments that contradict other data, in sentences: warnings of the page."""
    lines = []
    count, level = len(found.instruments), found.level
    broken = found.contradicts_rest()
    others = [*["the catalogue"] * (BOTH in found.widths), *["the other instruments"] * (count > 1)]
    rest = " and ".join(others) or "all values within the ranges"
    for one in broken:
        lines.append(
            f"Instrument {one.name} contradicts {rest} (p ≤ {level:.2g}); it works with a probability of "
            f"{100 * one.working:.0f} %.{_factor(one)} It hardly counts in the intervals. Look at the instrument, its "
            "units and its zero, and take it out if it is broken."
        )
    if found.says_other_values():
        lines.append(
            f"The catalogue and the instruments want other values: they are {found.other_values:.2g} times as probable "
            "if each has values of its own, as if both have the same ones. Both cannot be right with this model; look "
            "at the plan, the stress and the completeness of the record before you trust intervals of both together."
        )
    if 2 * len(broken) > count > 1:
        lines.append(
            f"{len(broken)} of {count} instruments contradict the rest. So many are seldom broken: look for what the "
            "model lacks. The intervals mean little."
        )
    return lines


def _factor(one: Finding) -> str:
    """A sentence on the factor of readings over the model, if it is another than 1 by more than FACTORS."""
    if FACTORS[0] <= one.factor <= FACTORS[1]:
        return ""
    return f" Its readings are {one.factor:.2g} times what the model gives there."
