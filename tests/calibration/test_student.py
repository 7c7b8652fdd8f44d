"""Densities of values that share errors: Student t of all scales, and of scales of 1 and more."""

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import invgamma, multivariate_t

from calibration.student import DEGREES_OF_FREEDOM, student_density, widened_density


def test_the_density_is_scipys():
    share, value = (DEGREES_OF_FREEDOM - 2.0) / DEGREES_OF_FREEDOM, np.array([0.3, -2.0, 1.0])
    wanted = multivariate_t(np.zeros(3), share * np.eye(3), DEGREES_OF_FREEDOM).logpdf(value)
    assert student_density(np.array([value @ value]), np.zeros(1), 3) == pytest.approx(wanted)


@pytest.mark.parametrize("values", [1, 23, 1000])
def test_few_squares_do_not_make_the_errors_small(values):
    """Values that scatter less than they should count as with a scale of 1: squares count as of a normal density, half
    of them in the logarithm. Many more squares count as little as in a Student t."""
    squares = np.array([0.0, 1e-3])
    change = -np.diff(widened_density(squares, np.zeros(2), values))[0] / 1e-3
    assert change == pytest.approx(0.5, rel=0.25)
    free = -np.diff(student_density(squares, np.zeros(2), values))[0] / 1e-3
    assert free > (1.5 if values == 1 else 5.0) * change
    far = 1e3 * values + np.array([0.0, 1.0])
    both = [np.diff(density(far, np.zeros(2), values))[0] for density in (widened_density, student_density)]
    assert both[0] == pytest.approx(both[1], rel=1e-6)


@pytest.mark.parametrize("values", [1, 4, 300])
def test_densities_are_means_over_scales(values):
    """Against quadrature over the logarithm of the scale; with scales below 1 counted as 1, and without."""
    freedom = DEGREES_OF_FREEDOM
    scales, log_scale = invgamma(freedom / 2, scale=(freedom - 2.0) / 2), np.linspace(-6.0, 25.0, 200_001)
    weight = scales.pdf(np.exp(log_scale)) * np.exp(log_scale) * (log_scale[1] - log_scale[0])
    for squares in values * np.array([1e-3, 0.5, 1.0, 3.0, 1e3]):
        for density, used in (
            (student_density, log_scale),
            (widened_density, np.maximum(log_scale, 0.0)),
        ):
            logs = -0.5 * values * (np.log(2.0 * np.pi) + used) - 0.5 * squares / np.exp(used) - 0.7
            wanted = logsumexp(logs, b=weight)
            assert float(density(np.array([squares]), np.array([0.7]), values)[0]) == pytest.approx(wanted, rel=1e-5)
