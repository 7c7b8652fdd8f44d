"""The multivariate Student t distribution, by which logarithms of sums and readings of instruments are judged."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainc, gammaincc, gammaln

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


def widened_density(squares: NDArray, half_log_det: NDArray, values: int) -> NDArray:
    """Log-density (point,) as of student_density, where all scales below 1 count as 1.

    A Student t is the mean of normal densities over the scale of their covariance, an inverse gamma distribution. Of
    many values it follows their scatter: where that is small it also makes the errors small that all values share, of
    which the scatter tells nothing.
    """
    freedom = DEGREES_OF_FREEDOM
    of_one = gammaincc(freedom / 2, (freedom - 2.0) / 2)  # probability of scales below 1
    normal = np.log(of_one) - half_log_det - values / 2 * np.log(2.0 * np.pi) - squares / 2
    with np.errstate(divide="ignore"):  # scales above 1 may have no probability in floats
        larger = np.log(gammainc((freedom + values) / 2, (freedom - 2.0 + squares) / 2))
    return np.logaddexp(normal, student_density(squares, half_log_det, values) + larger)
