"""The posterior: Sobol points of the prior, weighted by their likelihood, and drawn again where it is narrow."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp
from scipy.stats import chi2, norm, qmc

POINTS = 2**13  # Sobol points of a round.
MIN_EFFECTIVE_POINTS = 400.0  # Points whose weights are worth fewer equal ones are drawn again, closer.
MAX_ROUNDS = 15
PRIOR_SHARE = 0.1  # Of the points of a round, drawn from the prior: no part of it is left out, no weight is unbounded.
FREEDOM = 4.0  # Degrees of freedom of the Student t distribution of all others.
STARTS = np.linspace(0.0, 1.0, 501)  # Of the intervals among which the shortest is looked for.
MIN_VARIANCE = 1e-8  # Of a quantity over its range: where one point has all the weight.


def sobol_points(count: int, quantities: int, seed: int) -> NDArray:
    """A scrambled Sobol sequence (point, quantity) in [0, 1), the cube in which the prior is uniform.

    The first points are those of any shorter sequence.
    """
    powers = int(np.ceil(np.log2(max(count, 2))))
    return qmc.Sobol(quantities, scramble=True, rng=np.random.default_rng(seed)).random_base2(powers)[:count]


@dataclass(frozen=True)
class Posterior:
    """Points (point, quantity) in the unit cube of the prior, with the logarithms of their weights (point,), but for a
    constant.

    implausibility: the smallest of all points, of the prior's whole cube; log_evidence: logarithm of the mean of the
    likelihood over the prior. effective: how many equal weights these are worth (Kish).
    """

    points: NDArray
    log_weights: NDArray
    implausibility: float
    log_evidence: float = np.nan

    @cached_property
    def weights(self) -> NDArray:
        """Weights (point,) that sum to one."""
        return normalized(self.log_weights)

    @property
    def effective(self) -> float:
        """Number of equal weights that these are worth: the square of their sum over the sum of their squares."""
        return float(1.0 / np.sum(self.weights**2))

    def quantiles(self, shares: NDArray, values: NDArray | None = None) -> NDArray:
        """Quantiles (share, column) of the points, or of other values (point, column) of theirs."""
        return weighted_quantiles(self.points if values is None else values, self.weights, shares)

    def intervals(self, share: float, values: NDArray | None = None) -> NDArray:
        """Lower end, median and upper end (3, column) of the shortest intervals with a share of the posterior.

        values (point, column): others than the points themselves. Intervals of points may touch the ends of the range.
        """
        ends = None if values is not None else (0.0, 1.0)
        values = self.points if values is None else values
        lower, upper = shortest_intervals(values, self.weights, share, ends)
        return np.stack([lower, weighted_quantiles(values, self.weights, np.array([0.5]))[0], upper])

    def draws(self, count: int, seed: int) -> NDArray:
        """Points (draw, quantity) drawn at random by their weights."""
        return self.points[self.draws_of(count, seed)]

    def draws_of(self, count: int, seed: int) -> NDArray:
        """Numbers (draw,) of points drawn at random by their weights."""
        return np.random.default_rng(seed).choice(len(self.points), count, p=self.weights)

    def width_left(self, share: float = 0.9) -> NDArray:
        """Width of the interval with this share over that of the prior, (quantity,)."""
        low, _, high = self.intervals(share)
        return (high - low) / share


def find_posterior(
    evaluate: Callable[[NDArray], tuple[NDArray, NDArray]], quantities: int, seed: int, points: int = POINTS
) -> Posterior:
    """Sample the prior and weight by likelihood; draw again near what counts until enough points count.

    evaluate: points (point, quantity) to log-likelihood (point,) and implausibility (point,). The first round draws
    from the prior. Each further one draws a share from the prior, all others from a Student t distribution with the
    mean and the covariance of the round before (population Monte Carlo, Cappe et al. 2004); a weight is the likelihood
    over the density that its point was drawn from.
    """
    drawn, log_density = sobol_points(points, quantities, seed), np.zeros(points)
    least, best = np.inf, Posterior(drawn, np.full(points, np.nan), np.inf)
    for round_number in range(1, MAX_ROUNDS + 1):
        inside, count = ((drawn >= 0.0) & (drawn <= 1.0)).all(axis=1), len(drawn)
        drawn, log_density = drawn[inside], log_density[inside]
        log_likelihood, implausible = evaluate(drawn)
        least = min(least, float(implausible.min()))
        log_weights = log_likelihood - log_density
        posterior = Posterior(drawn, log_weights, least, float(logsumexp(log_weights) - np.log(count)))
        if not best.effective > posterior.effective:  # also in the first round
            best = posterior
        if best.effective >= MIN_EFFECTIVE_POINTS:
            break
        mean = posterior.weights @ drawn
        covariance = (posterior.weights[:, None] * (drawn - mean)).T @ (drawn - mean)
        covariance = 2.0 * covariance + MIN_VARIANCE * np.eye(quantities)
        drawn, log_density = _draw(mean, covariance, points, seed + round_number)
    return replace(best, implausibility=least)


def normalized(log_weights: NDArray) -> NDArray:
    """Weights (point,) that sum to one, of logarithms that may be far below those of the smallest float."""
    weights = np.exp(log_weights - log_weights.max())
    return weights / weights.sum()


def _draw(mean: NDArray, covariance: NDArray, points: int, seed: int) -> tuple[NDArray, NDArray]:
    """Points (point, quantity) of prior and Student t distribution together, and the log-density of each."""
    quantities = len(mean)
    uniform = np.clip(sobol_points(points, quantities + 2, seed), 1e-12, 1.0 - 1e-12)
    of_prior, stretch = uniform[:, -2] < PRIOR_SHARE, np.sqrt(FREEDOM / chi2.ppf(uniform[:, -1], FREEDOM))
    factor = np.linalg.cholesky(covariance)
    near = mean + stretch[:, None] * (norm.ppf(uniform[:, :quantities]) @ factor.T)
    drawn = np.where(of_prior[:, None], uniform[:, :quantities], near)
    distance = (np.linalg.solve(factor, (drawn - mean).T) ** 2).sum(axis=0)
    log_t = gammaln((FREEDOM + quantities) / 2) - gammaln(FREEDOM / 2) - quantities / 2 * np.log(FREEDOM * np.pi)
    log_t = log_t - np.log(np.diag(factor)).sum() - (FREEDOM + quantities) / 2 * np.log1p(distance / FREEDOM)
    inside = ((drawn >= 0.0) & (drawn <= 1.0)).all(axis=1)
    with np.errstate(divide="ignore"):
        log_prior = np.log(PRIOR_SHARE * inside)
    return drawn, np.logaddexp(log_prior, np.log(1.0 - PRIOR_SHARE) + log_t)


def weighted_quantiles(values: NDArray, weights: NDArray, shares: NDArray) -> NDArray:
    """Quantiles (share, column) of values (point, column) with weights (point,), by linear interpolation."""
    quantiles = np.empty((len(shares), values.shape[1]))
    for column, value in enumerate(values.T):
        order = np.argsort(value)
        cumulative = np.cumsum(weights[order])
        quantiles[:, column] = np.interp(shares, cumulative - 0.5 * weights[order], value[order])
    return quantiles


def shortest_intervals(
    values: NDArray, weights: NDArray, share: float, ends: tuple[float, float] | None = None
) -> NDArray:
    """Shortest intervals (2, column) with a share of values (point, column) of these weights (point,).

    Of a density with one peak they are those of highest density (Chen and Shao 1999). Where it does not fall towards an
    end of what is possible, the interval reaches that end, which equal tails never do. ends: least and largest value
    possible, those of each column if not given.
    """
    found = np.empty((2, values.shape[1]))
    starts = (1.0 - share) * STARTS
    for column, value in enumerate(values.T):
        order = np.argsort(value)
        low, high = ends or (value[order[0]], value[order[-1]])
        below = np.concatenate([[0.0], np.cumsum(weights[order]) - 0.5 * weights[order], [1.0]])
        at = np.concatenate([[low], value[order], [high]])
        lower, upper = np.interp(starts, below, at), np.interp(starts + share, below, at)
        best = np.argmin(upper - lower)
        found[:, column] = lower[best], upper[best]
    return found
