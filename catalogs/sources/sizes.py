"""b of sizes, N(>= P) = 10^a P^-b in log10 potency, and how two of them differ; its tests: catalogs.sources.size_law.

x is log10 of the scalar potency in m3 throughout. b of magnitudes is 1.5 times b of log potency, as Mw = 2/3 log M0.
Above a cut c the excess x - c is exponential with rate beta = b ln 10, cut off at an upper bound if there is one; the
estimates are maximum likelihood of exactly that, on a continuous scale or on one of bins. The density of an excess y is
exp(-beta y - A(beta)); of binned sizes y stands for a bin's centre, counted from the lowest one.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

MAX_EXPONENT = 600.0  # exp() of a larger number is taken as infinite.
SIZE_PRECISION = 1e-6  # Mean sizes (log10 P) that differ by less are one: arithmetic makes as much of one number.


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
        if self.width == 0:
            return _mean(beta, self.span)
        if abs(beta * self.width) < 1:
            return _mean(beta, self.span) - _mean(beta, self.width)
        return _tail(beta, self.width) - _tail(beta, self.span)

    def variance(self, beta: float) -> float:
        """Variance of the excess, A''(beta): the Fisher information of one event."""
        if self.width == 0:
            return _variance(beta, self.span)
        if abs(beta * self.width) < 1:
            return _variance(beta, self.span) - _variance(beta, self.width)
        return _spread(beta, self.width) - _spread(beta, self.span)

    def solve(self, excess: float) -> float:
        """beta at which the mean excess is the observed one: the maximum of the likelihood."""
        if np.isinf(self.span):
            return 1 / excess if self.width == 0 else np.log1p(self.width / excess) / self.width

        def surplus(beta):
            return self.mean(beta) - excess

        flattest, steepest = -1 / self.span, 1 / self.span
        while surplus(steepest) > 0:  # the mean falls with beta, from one end of its range to the other
            steepest *= 2
        while surplus(flattest) < 0:
            flattest *= 2
        return scipy.optimize.brentq(surplus, flattest, steepest, xtol=1e-12 / self.span, rtol=1e-12)

    def holds(self, excess: float) -> bool:
        """True if the likelihood of this mean excess has a maximum: it lies within the range of means."""
        least, most = self.means
        return least + SIZE_PRECISION < excess < most - SIZE_PRECISION

    @property
    def means(self) -> tuple[float, float]:
        """Ends of the range of mean excesses: those of the steepest and of the flattest law."""
        return 0.0, self.span - self.width

    def interval(self, beta: float, excess: float, count: int, confidence: float) -> tuple[float, float]:
        """Confidence interval (lower, upper) of beta by the likelihood ratio.

        At its ends twice the drop of the log-likelihood from its maximum equals the chi-square quantile. beta: at the
        maximum; excess: mean excess of sizes over the cut; count: number of events; confidence: 0 to 1.
        """
        best = beta * excess + self.log_normaliser(beta)
        allowed = scipy.stats.chi2.ppf(confidence, 1) / (2 * count)
        step = 2 / np.sqrt(count * self.variance(beta))

        def drop(other):
            return other * excess + self.log_normaliser(other) - best - allowed

        ends = []
        for sign in (-1, 1):
            far = beta + sign * step
            if np.isinf(self.span):
                far = max(far, beta * 1e-3)
            while drop(far) < 0:
                far = far * 0.5 if np.isinf(self.span) and sign < 0 else beta + 2 * (far - beta)
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

    @property
    def means(self) -> tuple[float, float]:
        """Ends of the range of mean excesses; the least has all events but the largest in the lowest bin."""
        most = super().means[1]
        return most / self.count, most

    def _last_bin(self, beta: float) -> tuple[float, float, float, float]:
        """t, log(1 - (1 - t)^count), t / (1 - (1 - t)^count) and g, each without cancellation however steep the law."""
        below = self.span - self.width
        log_t = -beta * below + _log_integral(beta, self.width) - _log_integral(beta, self.span)
        t = min(float(np.exp(log_t)), 1.0 - 1e-15)
        g = below - super().mean(beta)
        if t * self.count < 1e-12:
            return t, log_t + np.log(self.count), 1.0 / self.count, g
        filled = -np.expm1(self.count * np.log1p(-t))
        return t, float(np.log(filled)), t / filled, g

    def log_normaliser(self, beta: float) -> float:
        return super().log_normaliser(beta) + self._last_bin(beta)[1] / self.count

    def mean(self, beta: float) -> float:
        t, _, share, g = self._last_bin(beta)
        return super().mean(beta) + (1.0 - t) ** (self.count - 1) * share * g

    def variance(self, beta: float) -> float:
        t, _, share, g = self._last_bin(beta)
        k = (1.0 - t) ** (self.count - 1) * share
        climb = (self.count - 1) * t / (1.0 - t) - 1.0 + self.count * k  # of log k with beta, over g
        return (1.0 - k) * super().variance(beta) - k * g**2 * climb


def _log_integral(beta: float, span: float) -> float:
    """log of the integral of exp(-beta y) over [0, span]."""
    if np.isinf(span):
        return -np.log(beta)
    u = beta * span
    if abs(u) < 1e-6:
        return np.log(span) - u / 2
    return max(-u, 0.0) + np.log(-np.expm1(-abs(u)) / abs(beta))


def _mean(beta: float, span: float) -> float:
    """Mean of y under that density: 1/beta - span / (exp(beta span) - 1)."""
    if np.isinf(span):
        return 1 / beta
    u = beta * span
    if abs(u) < 1e-4:
        return span * (0.5 - u / 12)
    return 1 / beta - _tail(beta, span)


def _variance(beta: float, span: float) -> float:
    """Variance of y under that density."""
    if np.isinf(span):
        return 1 / beta**2
    u = beta * span
    if abs(u) < 1e-2:
        return span**2 * (1 / 12 - u**2 / 240)
    return 1 / beta**2 - _spread(beta, span)


def _tail(beta: float, span: float) -> float:
    """span / (exp(beta span) - 1), what ends at `span` take from the mean 1/beta; 0 without an end."""
    u = beta * span
    return 0.0 if u > MAX_EXPONENT else span / np.expm1(u)


def _spread(beta: float, span: float) -> float:
    """(span / (2 sinh(beta span / 2)))^2, what an end at `span` takes from the variance 1/beta^2; 0 without an end."""
    u = abs(beta * span)
    return 0.0 if u > MAX_EXPONENT else span**2 / (4 * np.sinh(u / 2) ** 2)


B_MAGNITUDE_PER_B_POTENCY = 1.5
LN10 = np.log(10.0)
CONFIDENCE = 0.95
MIN_EVENTS_FOR_B = 10  # Events that an estimate of b needs.


@dataclass(frozen=True)
class BValue:
    """A b-value, its standard error and confidence interval, from how many events above which cut."""

    b: float
    error: float
    lower: float
    upper: float
    events: int
    cut: float
    bound: float = np.inf

    @property
    def magnitude(self) -> float:
        """The b-value of moment magnitudes."""
        return B_MAGNITUDE_PER_B_POTENCY * self.b

    @property
    def a(self) -> float:
        """a in log10 N(>= P) = a - b log10 P, the line through the number of events above the cut."""
        return np.log10(self.events) + self.b * self.cut if self.events else np.nan


def log_potency(potency: ArrayLike) -> NDArray:
    """log10 of potency in m3; NaN where it is not positive."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.asarray(potency) > 0, np.log10(potency), np.nan)


def above(x: NDArray, cut: float, bin_width: float = 0.0) -> NDArray:
    """The values at or above `cut`; of binned ones (multiples of bin_width apart) those in its bin or higher."""
    x = np.asarray(x, float)
    return x[x >= cut - 0.5 * bin_width]


def estimate_b(
    x: NDArray,
    cut: float,
    bin_width: float = 0.0,
    bound: float | str | None = None,
    confidence: float = CONFIDENCE,
) -> BValue:
    """b of the values x at or above `cut` by maximum likelihood; all NaN with fewer than MIN_EVENTS_FOR_B.

    bin_width: 0 for continuous sizes (Aki 1965, times (n - 1) / n, which removes its bias: Ogata and Yamashina 1986);
    else x are bin centres and `cut` the lowest of them, and the estimate is that of the geometric distribution (Tinti
    and Mulargia 1987), of which Utsu's half-bin correction is the first term. bound: largest size possible (Page
    1968); "largest" conditions on the largest event, whose size is the bound: on a continuous scale it is then left
    out, among bins, where others may share its bin, the likelihood is that of n events of which one at least fills the
    last bin. None: no bound.
    Interval: exact (chi-square) for continuous, unbounded sizes, else where the likelihood ratio is below its
    chi-square quantile. error: from the Fisher information. b may be negative under a bound.

    A hundred quantiles of the law with b = 1 above 10^-2 m3:

    >>> x = -2 - np.log10(1 - (np.arange(100) + 0.5) / 100)
    >>> found = estimate_b(x, cut=-2)
    >>> print(f"b = {found.b:.2f}, 95 % interval {found.lower:.2f} to {found.upper:.2f}; Mw: {found.magnitude:.2f}")
    b = 0.99, 95 % interval 0.82 to 1.21; Mw: 1.49
    """
    values = np.sort(above(x, cut, bin_width))
    filled = bound == "largest" and bin_width > 0  # the last bin holds one event at least
    if bound == "largest" and values.size:
        bound, values = float(values[-1]), values if filled else values[:-1]
    elif bound == "largest":
        bound = None
    elif bound is not None:
        values = values[values <= float(bound) + 0.5 * bin_width]
    count, limit = values.size, np.inf if bound is None else float(bound)
    excess = float(np.mean(values - cut)) if count else 0.0
    likelihood = FilledLastBin(bin_width, limit - cut, count) if filled else Exponential(bin_width, limit - cut)
    if count < MIN_EVENTS_FOR_B or not likelihood.holds(excess):
        return BValue(np.nan, np.nan, np.nan, np.nan, count, cut, limit)
    beta = likelihood.solve(excess)
    error = 1 / np.sqrt(count * likelihood.variance(beta))
    if bin_width == 0 and np.isinf(limit):
        tails = [(1 - confidence) / 2, (1 + confidence) / 2]
        lower, upper = scipy.stats.chi2.ppf(tails, 2 * count) / (2 * count * excess)
    else:
        lower, upper = likelihood.interval(beta, excess, count, confidence)
    if np.isinf(limit):
        beta, error = beta * (count - 1) / count, error * (count - 1) / count
    return BValue(beta / LN10, error / LN10, lower / LN10, upper / LN10, count, cut, limit)


@dataclass(frozen=True)
class BDifference:
    """b of the first minus b of the second, its standard error, interval, and the chance of as much if both are one."""

    difference: float
    error: float
    lower: float
    upper: float
    p_value: float


def difference_b(first: BValue, second: BValue) -> BDifference:
    """Difference of two b-values, first minus second, with its error, interval and p-value; NaN if either b is unknown.

    Interval: from the two confidence intervals, which need not be symmetric (Zou and Donner 2008). p-value: two-sided,
    exact (F distribution of the ratio: Utsu 1966) where neither has a bound, else normal.
    """
    difference = first.b - second.b
    error = np.hypot(first.error, second.error)
    lower = difference - np.hypot(first.b - first.lower, second.upper - second.b)
    upper = difference + np.hypot(first.upper - first.b, second.b - second.lower)
    if not np.isfinite(difference):
        return BDifference(np.nan, np.nan, np.nan, np.nan, np.nan)
    if np.isinf(first.bound) and np.isinf(second.bound):
        # the mean excesses, scaled by beta, are chi-square with 2 n degrees of freedom
        unbiased = first.events / (first.events - 1), second.events / (second.events - 1)
        ratio = (second.b * unbiased[1]) / (first.b * unbiased[0])
        tail = scipy.stats.f.cdf(ratio, 2 * first.events, 2 * second.events)
        p_value = 2 * min(tail, 1 - tail)
    else:
        p_value = 2 * scipy.stats.norm.sf(abs(difference) / error)
    return BDifference(difference, float(error), float(lower), float(upper), float(p_value))


def b_by_cut(x: NDArray, cuts: NDArray, bin_width: float = 0.0) -> list[BValue]:
    """b above each of the cuts: flat where the sizes follow the law, climbing where they are incomplete or bend."""
    return [estimate_b(x, float(cut), bin_width) for cut in cuts]


def cut_grid(x: NDArray, width: float = 0.1) -> NDArray:
    """Cuts, multiples of `width`, over the range of the finite values; empty without any."""
    x = np.asarray(x, float)
    x = x[np.isfinite(x)]
    if x.size == 0:
        return np.empty(0)
    first, last = np.floor(x.min() / width + 1e-9), np.floor(x.max() / width + 1e-9)
    return np.arange(int(first), int(last) + 1) * width


def counts(x: NDArray, lower_edges: NDArray, width: float) -> tuple[NDArray, NDArray]:
    """Events per bin [edge, edge + width), and events at or above each edge."""
    x = np.sort(np.asarray(x, float)[np.isfinite(x)])
    edges = np.asarray(lower_edges, float) - 1e-9 * width  # a size on an edge belongs above it despite round-off
    cumulative = x.size - np.searchsorted(x, edges, side="left")
    above_end = x.size - np.searchsorted(x, edges + width, side="left")
    return cumulative - above_end, cumulative
