"""The multivariate Student t distribution, by which logarithms of sums and readings of instruments are judged."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

DEGREES_OF_FREEDOM = 5.0  # Sums of heavy-tailed sizes, and readings, have outliers.


def student_density(squares: NDArray, half_log_det: NDArray, values: int) -> NDArray:
    """Log-density (point,) of so many values.

    squares (point,): their squared distance from what is expected, by their covariance; half_log_det (point,): half of
    the logarithm of its determinant.
    """
    freedom = DEGREES_OF_FREEDOM
    share = (freedom - 2.0) / freedom  # the shape of a t distribution is smaller than its covariance
    constant = gammaln((freedom + values) / 2) - gammaln(freedom / 2) - values / 2 * np.log(freedom * np.pi * share)
    return constant - half_log_det - (freedom + values) / 2 * np.log1p(squares / (freedom * share))
