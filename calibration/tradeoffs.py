"""Limits of what a record tells: quantities that it cannot tell apart, and what would narrow them.

Correlations and strengths of the posterior; measurements of a quantity, and further trials, that would teach most.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.fit import INTERVAL_SHARE, Fit
from calibration.posterior import shortest_intervals
from calibration.settings import INSTRUMENTS, STRENGTH, CalibratedQuantity, friction_key, strength_under
from calibration.trials import NUMBER, POTENCY, SIZES
from common.quantities import parse_quantity

CONFINEMENTS = np.linspace(0.0, 40.0, 81)  # MPa, at which a strength is looked for that the record tells.
MEASURED_TO = 0.1  # Standard error of a further measurement, as a share of its range.
MIN_NARROWING = 0.75  # A measurement that leaves a larger share of the width is not mentioned.
PRIOR_POINTS = 4096  # Points of the prior that its own spread of a strength is taken from.
CANDIDATES = 400  # Points of the posterior among which a trial is chosen.
JUDGES = 400  # Points of the posterior over which the prediction's variance is averaged.


@dataclass(frozen=True)
class KnownStrength:
    """A strength of Coulomb rock that the record tells better than cohesion and friction: MPa, 90 % interval.

    pair: numbers of the cohesion and of the friction angle among the quantities; width: of the interval over that of
    the prior.
    """

    pair: tuple[int, int]
    material: str
    state: str
    confinement: float
    low: float
    high: float
    width: float


@dataclass(frozen=True)
class TellingObservation:
    """A measurement that would narrow another quantity, with its width over that of the prior before and after."""

    measured: CalibratedQuantity
    narrowed: CalibratedQuantity
    before: float
    after: float


def correlation(fit: Fit) -> NDArray:
    """Correlation of the quantities (quantity, quantity) in the posterior."""
    covariance = _covariance(fit)
    deviation = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    return covariance / np.outer(deviation, deviation)


def _covariance(fit: Fit) -> NDArray:
    return np.atleast_2d(np.cov(fit.posterior.points.T, aweights=fit.posterior.weights))


def best_known_strengths(fit: Fit, quantities: Sequence[CalibratedQuantity]) -> list[KnownStrength]:
    """Strengths known best, one for each pair of a cohesion and a friction angle of the same rock: at the confinement
    at which the posterior of the strength is narrowest compared with its prior."""
    keys = [quantity.key for quantity in quantities]
    known: list[KnownStrength] = []
    for number, quantity in enumerate(quantities):
        match, angle = STRENGTH.fullmatch(quantity.key), friction_key(quantity.key)
        if match is None or quantity.confinement is not None or angle not in keys:
            continue
        pair = (number, keys.index(angle))
        prior = np.random.default_rng(0).uniform(size=(PRIOR_POINTS, len(quantities)))
        before = _intervals(prior, np.full(PRIOR_POINTS, 1.0 / PRIOR_POINTS), quantities, pair)
        after = _intervals(fit.posterior.points, fit.posterior.weights, quantities, pair)
        width = (after[1] - after[0]) / (before[1] - before[0])
        best = int(width.argmin())
        known.append(
            KnownStrength(
                pair,
                match["material"],
                match["state"],
                float(CONFINEMENTS[best]),
                *after[:, best],
                float(width[best]),
            )
        )
    return known


def _intervals(
    points: NDArray, weights: NDArray, quantities: Sequence[CalibratedQuantity], pair: tuple[int, int]
) -> NDArray:
    """Lower and upper end (2, confinement) of the interval of the strength, MPa, at CONFINEMENTS."""
    return shortest_intervals(strengths(points, quantities, pair), weights, INTERVAL_SHARE)


def strengths(points: NDArray, quantities: Sequence[CalibratedQuantity], pair: tuple[int, int]) -> NDArray:
    """Strength (point, confinement), MPa, at CONFINEMENTS, of points in the unit cube; pair: as of KnownStrength."""
    cohesion, friction = (
        np.array([quantities[one].value(share) for share in points[:, one]])
        * parse_quantity(f"1 {quantities[one].unit}", unit)
        for one, unit in zip(pair, ("Pa", "deg"), strict=True)
    )
    alone = np.array([strength_under(1.0, 0.0, angle) for angle in friction])
    bond = np.array([strength_under(0.0, value, angle) for value, angle in zip(cohesion, friction, strict=True)]) / 1e6
    return bond[:, None] + alone[:, None] * CONFINEMENTS


def telling_observations(fit: Fit, quantities: Sequence[CalibratedQuantity]) -> list[TellingObservation]:
    """Measurements of one quantity that would narrow another one, by the covariance of the posterior.

    A measurement of x with the variance e lowers that of z by c(x, z)^2 / (c(x, x) + e). For each quantity that can be
    narrowed so, the best one.
    """
    covariance, left = _covariance(fit), fit.posterior.width_left()
    variance = np.diag(covariance)
    observations: list[TellingObservation] = []
    for narrowed in range(len(quantities)):
        lowered = covariance[narrowed] ** 2 / (variance + MEASURED_TO**2)
        lowered[narrowed] = 0.0
        best = int(lowered.argmax())
        share = float(np.sqrt(max(0.0, 1.0 - lowered[best] / max(variance[narrowed], 1e-300))))
        if share < MIN_NARROWING:
            before = float(left[narrowed])
            observations.append(TellingObservation(quantities[best], quantities[narrowed], before, before * share))
    return observations


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
    points = []
    for _ in range(count):
        gains = np.zeros(CANDIDATES)
        for one, noise_of_one, weight in zip(covariances, noise, weights, strict=True):
            to_judges = one[:CANDIDATES, CANDIDATES:]
            gains += weight * (to_judges**2).mean(axis=1) / (np.diag(one)[:CANDIDATES] + noise_of_one)
        best = int(gains.argmax())
        points.append(places[best])
        covariances = [
            one - np.outer(one[:, best], one[best]) / (one[best, best] + noise_of_one)
            for one, noise_of_one in zip(covariances, noise, strict=True)
        ]
    return np.array(points)


def _weights(fit: Fit) -> tuple[list[int], NDArray]:
    """Outputs with a recorded value, and one over the variance that record, cells, model and chance give it."""
    likelihood, recorded = fit.likelihood, fit.recorded
    variances = {
        POTENCY: np.diag(recorded.potency_covariance),
        NUMBER: recorded.number_variance,
        SIZES: recorded.size_covariance[-1:, -1],
    }
    columns: list[int] = []
    variance = []
    counted = [term for term in variances if term in likelihood.terms]
    if fit.steps and not counted and likelihood.instruments is None:  # places alone
        counted = [POTENCY]
    for term in counted:
        part, error = likelihood.columns[term], likelihood.discrepancy(term)
        columns += range(part.start, part.stop)
        variance.append(variances[term] + error.common**2 + error.own**2 + fit.surrogate.noise[part] ** 2)
    if likelihood.instruments is not None:
        part = likelihood.columns[INSTRUMENTS]
        columns += range(part.start, part.stop)
        variance.append(1.0 / _information(fit) + fit.surrogate.noise[part] ** 2)
    return columns, 1.0 / np.concatenate(variance)


def _information(fit: Fit) -> NDArray:
    """One over the variance (score,) with which the readings of working instruments would tell each score alone."""
    term = fit.likelihood.instruments
    assert term is not None
    scores, variance = fit.instrument_scores()
    errors = term.likeliest_errors(scores, variance, fit.posterior.weights)
    total = np.full(scores.shape[1], 1e-12)
    for one, error in zip(term.instruments, errors, strict=True):
        middle = (fit.posterior.weights @ scores)[None]
        covariance = one.covariance(middle, np.zeros_like(middle), term.model_error, error)[0]
        total += np.einsum("cs,cs->s", one.basis, np.linalg.solve(covariance, one.basis))
    return total
