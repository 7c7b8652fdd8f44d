"""Likelihood of exponential size excesses: on a continuous scale or in bins, under a bound or without.

y >= 0 is the excess of log10 potency over the cut, its density exp(-beta y - A(beta)) with beta = b ln 10; of binned
sizes y stands for a bin's centre, counted from the lowest one.
"""

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for

from catalogs.distributions import chi_square_quantile

MAX_EXPONENT = 600.0  # Largest |beta times range| that is searched, so that exp() stays finite.


class Exponential:
    """Likelihood of an exponential excess y over [0, range], or over bins: density exp(-beta y - A(beta))."""

    def __init__(self, bin_width: float, span: float):
        self.width = bin_width
        self.span = span if bin_width == 0 else bin_width * (np.round(span / bin_width) + 1)  # bins, both ends included

    def log_normaliser(self, beta: float) -> float:
        """A(beta): log of the integral (or sum over bin centres) of exp(-beta y)."""
        whole = _log_integral(beta, self.span)
        return whole if self.width == 0 else whole - _log_integral(beta, self.width)

    def mean(self, beta: float) -> float:
        """Mean excess, -A'(beta)."""
        whole = _mean(beta, self.span)
        return whole if self.width == 0 else whole - _mean(beta, self.width)

    def variance(self, beta: float) -> float:
        """Variance of the excess, A''(beta): the Fisher information of one event."""
        whole = _variance(beta, self.span)
        return whole if self.width == 0 else whole - _variance(beta, self.width)

    def solve(self, excess: float) -> float:
        """beta at which the mean excess is the observed one: the maximum of the likelihood."""
        if np.isinf(self.span):
            return 1 / excess if self.width == 0 else np.log1p(self.width / excess) / self.width
        steepest = MAX_EXPONENT / self.span
        return scipy.optimize.brentq(lambda beta: self.mean(beta) - excess, -steepest, steepest, xtol=1e-12 * steepest)

    def interval(self, beta: float, excess: float, count: int, confidence: float) -> tuple[float, float]:
        """Where twice the drop of the log-likelihood from its maximum equals the chi-square quantile."""
        best = beta * excess + self.log_normaliser(beta)
        allowed = chi_square_quantile(confidence, 1) / (2 * count)
        step = 2 / np.sqrt(count * self.variance(beta))

        def drop(other):
            return other * excess + self.log_normaliser(other) - best - allowed

        ends = []
        for sign in (-1, 1):
            far = beta + sign * step
            if np.isinf(self.span):
                far = max(far, beta * 1e-3)
            while drop(far) < 0:
                far = far * 0.5 if np.isinf(self.span) and sign < 0 else far + sign * step
            ends.append(scipy.optimize.brentq(drop, *sorted((far, beta)), xtol=1e-12 * abs(step)))
        return ends[0], ends[1]


class FilledLastBin(Exponential):
    """Likelihood of `count` binned excesses given that the largest of them lies in the last bin.

    With t the chance of the last bin for one event, that condition has the chance 1 - (1 - t)^count, by which the
    likelihood is divided. d log t / d beta = -g.
    """

    def __init__(self, bin_width: float, span: float, count: int):
        super().__init__(bin_width, span)
        self.count = count

    def _last_bin(self, beta: float) -> tuple[float, float, float]:
        """t, 1 - (1 - t)^count and g, each without cancellation however steep or flat the law."""
        below = self.span - self.width
        t = np.exp(-beta * below + _log_integral(beta, self.width) - _log_integral(beta, self.span))
        t = min(float(t), 1.0 - 1e-15)
        return t, -np.expm1(self.count * np.log1p(-t)), below + _mean(beta, self.width) - _mean(beta, self.span)

    def log_normaliser(self, beta: float) -> float:
        return super().log_normaliser(beta) + np.log(self._last_bin(beta)[1]) / self.count

    def mean(self, beta: float) -> float:
        t, filled, g = self._last_bin(beta)
        return super().mean(beta) + (1.0 - t) ** (self.count - 1) * t / filled * g

    def variance(self, beta: float) -> float:
        t, filled, g = self._last_bin(beta)
        k = (1.0 - t) ** (self.count - 1) * t / filled
        climb = (self.count - 1) * t / (1.0 - t) - 1.0 + self.count * k  # of log k with beta, over g
        return (1.0 - k) * super().variance(beta) - k * g**2 * climb


def _log_integral(beta: float, span: float) -> float:
    """log of the integral of exp(-beta y) over [0, span]."""
    if np.isinf(span):
        return -np.log(beta)
    u = beta * span
    if abs(u) < 1e-6:
        return np.log(span) - u / 2
    return np.log(-np.expm1(-u) / beta) if u > 0 else np.log(np.expm1(-u) / -beta)


def _mean(beta: float, span: float) -> float:
    """Mean of y under that density: 1/beta - span / (exp(beta span) - 1)."""
    if np.isinf(span):
        return 1 / beta
    u = beta * span
    if abs(u) < 1e-4:
        return span * (0.5 - u / 12)
    return 1 / beta - span / np.expm1(u)


def _variance(beta: float, span: float) -> float:
    """Variance of y under that density."""
    if np.isinf(span):
        return 1 / beta**2
    u = beta * span
    if abs(u) < 1e-2:
        return span**2 * (1 / 12 - u**2 / 240)
    return 1 / beta**2 - span**2 / (4 * np.sinh(np.clip(u / 2, -300, 300)) ** 2)
