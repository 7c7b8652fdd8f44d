"""Distributions of statistics, as scipy.stats has them: importing that takes as long as all else that a stage does.

`scipy.special` itself is imported when one of these is first called.
"""

import scipy
from numpy.typing import ArrayLike, NDArray


def normal_quantile(share: ArrayLike):
    """Value that a share of a standard normal variable's values is below."""
    return scipy.special.ndtri(share)


def normal_tail(value: NDArray | float):
    """Chance of more than a value of a standard normal variable."""
    return scipy.special.ndtr(-value)


def t_quantile(share: ArrayLike, freedom: ArrayLike):
    """Value that a share of the values of Student's t is below."""
    return scipy.special.stdtrit(freedom, share)


def chi_square_quantile(share: ArrayLike, freedom: NDArray | float):
    """Value that a share of the values of chi-square is below."""
    return 2 * scipy.special.gammaincinv(freedom / 2, share)


def chi_square_tail(value: ArrayLike, freedom: ArrayLike):
    """Chance of more than a value, 0 or above, of chi-square."""
    return scipy.special.chdtrc(freedom, value)


def f_quantile(share: ArrayLike, freedom: ArrayLike, of_divisor: ArrayLike):
    """Value that a share of the values of F is below."""
    return scipy.special.fdtri(freedom, of_divisor, share)


def f_share(value: ArrayLike, freedom: ArrayLike, of_divisor: ArrayLike):
    """Chance of less than a value, 0 or above, of F."""
    return scipy.special.fdtr(freedom, of_divisor, value)


def f_tail(value: ArrayLike, freedom: ArrayLike, of_divisor: ArrayLike):
    """Chance of more than a value, 0 or above, of F."""
    return scipy.special.fdtrc(freedom, of_divisor, value)
