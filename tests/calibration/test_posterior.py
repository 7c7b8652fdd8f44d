"""Posterior by weighted Sobol points: known densities, and known truths drawn from the model itself."""

import numpy as np
import pytest
from scipy.stats import norm, truncnorm

from calibration.posterior import (
    MIN_EFFECTIVE_POINTS,
    Posterior,
    find_posterior,
    normalized,
    shortest_intervals,
    sobol_points,
    weighted_quantiles,
)


def normal(mean, factor):
    """Log-density, up to a constant, of a normal distribution with this Cholesky factor, for find_posterior."""

    def evaluate(points):
        distance = np.linalg.solve(factor, (points - mean).T)
        return -0.5 * (distance**2).sum(axis=0), np.sqrt((distance**2).max(axis=0))

    return evaluate


@pytest.mark.parametrize("width", [0.3, 0.03, 0.003])
def test_quantiles_of_a_normal_density_within_the_cube(width):
    """However narrow it is, and where a face of the cube cuts it, quantiles are those of the closed form."""
    mean = np.array([0.4, 0.95])
    found = find_posterior(normal(mean, width * np.eye(2)), 2, seed=1)
    assert found.effective >= MIN_EFFECTIVE_POINTS
    shares = np.array([0.05, 0.5, 0.95])
    for quantity, centre in enumerate(mean):
        exact = truncnorm(-centre / width, (1 - centre) / width, centre, width).ppf(shares)
        np.testing.assert_allclose(found.quantiles(shares)[:, quantity], exact, atol=0.1 * width)


@pytest.mark.parametrize(("mean", "width"), [(0.5, 0.1), (0.03, 0.05), (0.98, 0.2), (1.4, 0.3)])
def test_an_interval_is_that_of_highest_density(mean, width):
    """Of a normal density that the cube cuts: symmetric about a peak within, and up to the end that cuts it."""
    cut = truncnorm(-mean / width, (1 - mean) / width, mean, width)
    found = find_posterior(normal(np.array([mean, 0.5]), width * np.eye(2)), 2, seed=1)
    low, middle, high = found.intervals(0.9)[:, 0]
    exact = {0.5: cut.ppf([0.05, 0.95]), 0.03: [0.0, cut.ppf(0.9)]}.get(mean, [cut.ppf(0.1), 1.0])
    np.testing.assert_allclose([low, high], exact, atol=0.1 * width)
    np.testing.assert_allclose(middle, cut.median(), atol=0.05 * width)


def test_intervals_hold_truths_near_an_end_as_often_as_elsewhere():
    """Normal measurements of truths in the last tenth of a range, and of truths anywhere: 95 % intervals hold them."""
    generator, points = np.random.default_rng(1), sobol_points(2**11, 1, 1)
    for least in (0.0, 0.9):
        truths = generator.uniform(least, 1.0, 1000)
        held, held_by_tails = [], []
        for truth in truths:
            weights = norm.pdf(points[:, 0], truth + 0.15 * generator.standard_normal(), 0.15)
            posterior = Posterior(points, np.log(weights), 0.0)
            low, _, high = posterior.intervals(0.95)[:, 0]
            start, end = posterior.quantiles(np.array([0.025, 0.975]))[:, 0]
            held.append(low <= truth <= high)
            held_by_tails.append(start <= truth <= end)
        assert 0.93 <= np.mean(held) <= 0.98
    assert np.mean(held_by_tails) < 0.92


def test_weights_below_the_smallest_float_are_told_apart():
    """A thousand readings of one instrument span more logarithms than floats have; without them a point may count that
    has no weight with them."""
    posterior = Posterior(np.zeros((3, 1)), np.array([-3000.0, -3001.0, -4600.0]), 0.0)
    np.testing.assert_allclose(posterior.weights, np.array([1.0, np.exp(-1.0), 0.0]) / (1.0 + np.exp(-1.0)))
    without = normalized(posterior.log_weights - np.array([900.0, 900.0, -750.0]))
    np.testing.assert_allclose(without, [0.0, 0.0, 1.0], atol=1e-12)


def test_an_interval_of_values_without_known_ends_lies_within_them():
    """An exponential density is highest at its start: the interval begins at the least value."""
    values = -np.log1p(-sobol_points(2**12, 1, 2))
    low, high = shortest_intervals(values, np.full(len(values), 1.0 / len(values)), 0.9)[:, 0]
    assert low == values.min()
    assert high == pytest.approx(np.log(10.0), rel=0.01)


def test_a_narrow_ridge_across_the_cube_is_found_along_all_of_its_length():
    """Two quantities of which only the sum is known, to 0.2 %: each keeps the width that the cube leaves it."""

    def evaluate(points):
        off = (points.sum(axis=1) - 1.0) / 0.002
        return -0.5 * off**2, np.abs(off)

    found = find_posterior(evaluate, 2, seed=2)
    assert found.effective >= MIN_EFFECTIVE_POINTS
    np.testing.assert_allclose(found.width_left(), 1.0, atol=0.08)
    np.testing.assert_allclose(
        found.quantiles(np.array([0.05, 0.95]), found.points.sum(axis=1)[:, None])[:, 0],
        1.0 + 0.002 * norm.ppf([0.05, 0.95]),
        atol=3e-4,
    )


def test_flat_likelihood_leaves_the_prior():
    """Data that say nothing: weights are equal, and all of the prior's width is left."""
    found = find_posterior(lambda points: (np.zeros(len(points)), np.zeros(len(points))), 3, seed=3)
    np.testing.assert_allclose(found.effective, len(found.points))
    np.testing.assert_allclose(found.width_left(), 1.0, atol=0.01)


def test_two_modes_keep_their_shares():
    """A likelihood with a narrow peak at each of two places, one three times as high: neither is lost."""

    def evaluate(points):
        first, second = (np.exp(-0.5 * ((points[:, 0] - at) / 0.02) ** 2) for at in (0.2, 0.8))
        return np.log(3.0 * first + second + 1e-300), np.zeros(len(points))

    found = find_posterior(evaluate, 2, seed=4)
    share = found.weights[found.points[:, 0] < 0.5].sum()
    assert abs(share - 0.75) < 0.05


def test_weighted_quantiles_are_those_of_repeated_values():
    """Whole weights count as so many equal values."""
    values, repeats = np.array([3.0, 1.0, 2.0, 5.0]), np.array([1, 2, 3, 4])
    repeated = np.repeat(values, repeats)
    found = weighted_quantiles(values[:, None], repeats / repeats.sum(), np.array([0.5]))[0, 0]
    assert np.quantile(repeated, 0.4) <= found <= np.quantile(repeated, 0.7)
