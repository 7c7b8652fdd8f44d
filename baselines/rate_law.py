"""The number of events of a period from a measure of what is mined, and from a part that goes on without mining.

The expected number of a period is L u, with

  u = (1 - s) m / m0 + s d / d0

for a measure m (metres, volumes, energies) and the days d of the period. m0 and d0 are means of the periods known so
far and of the one to come, so that s is the share of the events that come without mining. It lies in 0 to 1. Mines
change, so the level L may drift, by a standard deviation of ln L in a month, and periods scatter about it, by a
standard deviation of ln of their expected number. Events come in clusters: their number varies as that of equal groups,
whose size is the dispersion index.

Given share, drift and scatter, L has a gamma distribution with the shape a and the rate b, and a number with the mean
m = a u / b has the variance k m + m^2 ((1 + 1/a) (1 + t^2) - 1), with the dispersion index k and the scatter t. Its
distribution is negative binomial with this variance, exact for independent events without scatter (Harvey and
Fernandes 1989). Drift makes the shape smaller and leaves the mean; a period counts by its share 1 / (k + t^2 m) of its
own variance. The dispersion index is known between bounds: clusters may join what does not belong together, and times
alone miss long sequences. Its prior has the density k^-2. Share, drift, scatter and index lie on a grid, and the
probability of the numbers seen so far, each forecast before it was seen, is the weight of each of them (Dawid 1984).
Nothing else is fitted, so a forecast knows earlier periods only.

A sum of sizes in place of a number is that of equal events (catalogs.compare.exposure).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from catalogs.sources.jackknife import INTERVAL_95

MONTH = 30.0  # days
SHARES = np.linspace(0.0, 1.0, 21)
DEVIATIONS = np.array([0.0, 0.1, 0.2, 0.35, 0.6, 1.0])  # of drift in a month, and of scatter
DRIFTS, SCATTERS = DEVIATIONS[:, None, None] ** 2, DEVIATIONS[:, None] ** 2  # variances of ln, along the grid
INDICES = 5  # dispersion indices between their bounds
SPIKE = 0.5  # Prior probability that there is no drift, and that there is no scatter.
SLAB = 0.5  # Standard deviation of the half-normal prior of either.
PRIOR_EVENTS = 0.5  # Shape of the level before the first period, about the level of which it is.
VAGUE = np.log(1e4)  # Numbers are equally probable on a logarithmic scale before the first one: this many units of it.
MAX_SIZE = 1e8  # Beyond, a negative binomial distribution is a Poisson distribution.
MIN_PROBABILITY = 1e-6  # Of a number that comes about: no forecast excludes one.
MIN_WEIGHT = 1e-7  # Parts of a forecast with less weight are left out.
MIN_PERIODS = 2  # Earlier periods that a forecast needs.
COEFFICIENT_DRAWS = 4000


@dataclass(frozen=True)
class NumberForecast:
    """A number that is forecast: a mixture of negative binomial distributions.

    mean, variance, weight (part,); weights add up to 1; rule: what a rule expects, None for the median of the mixture.
    """

    mean: NDArray
    variance: NDArray
    weight: NDArray
    rule: float | None = None

    @classmethod
    def of(cls, mean: NDArray, variance: NDArray, log_weight: NDArray, rule: float | None = None) -> "NumberForecast":
        """The forecast of parts of any shape; log_weight: up to a constant."""
        weight = np.exp(log_weight - log_weight.max())
        weight /= weight.sum()
        kept = weight > MIN_WEIGHT
        return cls(mean[kept], variance[kept], weight[kept] / weight[kept].sum(), rule)

    @classmethod
    def together(cls, forecasts: Sequence["NumberForecast"], log_weight: NDArray) -> "NumberForecast":
        """The mixture of forecasts by their weights (forecast,)."""
        weight = np.exp(log_weight - log_weight.max())
        parts = [np.concatenate([getattr(one, name) for one in forecasts]) for name in ("mean", "variance")]
        weights = [one.weight * share for one, share in zip(forecasts, weight / weight.sum(), strict=True)]
        return cls(parts[0], parts[1], np.concatenate(weights))

    def probability(self, number: float) -> float:
        """Probability of a number; of a sum in units of equal events, up to a factor."""
        return float(self.weight @ np.exp(log_probability(number, self.mean, self.variance)))

    def score(self, number: float) -> float:
        """ln of the probability of the number that came about, nats; at least that of MIN_PROBABILITY."""
        return float(np.log(max(self.probability(number), MIN_PROBABILITY)))

    def below(self, number: float) -> float:
        """Probability of this number or a smaller one."""
        size = _size(self.mean, self.variance)
        positive = self.mean > 0.0
        cumulative = np.ones(len(self.mean))
        cumulative[positive] = scipy.special.betainc(
            size[positive], number + 1.0, size[positive] / (size[positive] + self.mean[positive])
        )
        return float(self.weight @ cumulative)

    def quantile(self, share: float) -> float:
        """Number that at least this share of the probability does not exceed, a whole one."""
        low, high = -1, 1
        while self.below(float(high)) < share:
            low, high = high, 2 * high
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if self.below(float(middle)) < share else (low, middle)
        return float(high)

    @property
    def median(self) -> float:
        """Median, between whole numbers: where half of the probability is reached if it rises evenly over each."""
        high = self.quantile(0.5)
        before = self.below(high - 1.0) if high > 0.0 else 0.0
        return max(high - 0.5 + (0.5 - before) / (self.below(high) - before), 0.0)

    @property
    def mean_number(self) -> float:
        """Mean of the mixture, above the median where forecasts are skewed."""
        return float(self.weight @ self.mean)

    @property
    def value(self) -> float:
        """The one number that stands for the forecast: that of the rule, or the median."""
        return self.median if self.rule is None else self.rule

    @property
    def interval(self) -> NDArray:
        """95 % interval (2,)."""
        return np.array([self.quantile(share) for share in INTERVAL_95])


def _size(mean: NDArray, variance: NDArray) -> NDArray:
    """Size of a negative binomial distribution with this mean and variance."""
    return np.clip(mean**2 / np.maximum(variance - mean, mean**2 / MAX_SIZE + 1e-300), 1e-12, MAX_SIZE)


def log_probability(number: float, mean: NDArray, variance: NDArray) -> NDArray:
    """ln of the probability of a number of negative binomial distributions; a mean of 0 makes no event."""
    size, mean = _size(mean, variance), np.asarray(mean, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        log = scipy.special.gammaln(number + size) - scipy.special.gammaln(size) - scipy.special.gammaln(number + 1.0)
        log = log + size * np.log(size / (size + mean)) + scipy.special.xlogy(number, mean / (size + mean))
    return np.where(mean > 0.0, log, 0.0 if number == 0.0 else -np.inf)


@dataclass(frozen=True)
class RateLaw:
    """What earlier periods say of a law, on the grid of shares, drifts, scatters and indices (share, drift, scatter,
    index).

    shape, rate: of the level's gamma distribution, rate 0 where it is not known yet; log_weight: of prior and numbers;
    dispersion (index,): dispersion indices; amount, days: means of the measure and of the days that the share is for;
    time: middle of the last period, days.
    """

    shape: NDArray
    rate: NDArray
    log_weight: NDArray
    dispersion: NDArray
    amount: float
    days: float
    time: float

    @classmethod
    def fit(
        cls,
        number: NDArray,
        amount: NDArray,
        days: NDArray,
        time: NDArray,
        dispersion: tuple[float, float],
        ahead: tuple[float, float] | None = None,
    ) -> "RateLaw":
        """The law by the numbers of periods in their order, number, amount, days and time (period,), time: of their
        middles, days; dispersion: bounds of the dispersion index; ahead: measure and days of the period to come, which
        its scale follows."""
        amounts, all_days = (
            np.append(one, () if ahead is None else ahead[place]) for place, one in enumerate((amount, days))
        )
        scale, day_scale = float(amounts.mean()) or 1.0, float(all_days.mean())
        index = dispersion_indices(*dispersion)
        deviation = _deviation_prior()
        prior = _share_prior()[:, None, None, None] * deviation[:, None, None] * deviation[:, None]
        prior = np.log(prior * index_prior(index))
        shape, rate, log_weight = np.zeros(prior.shape), np.zeros(prior.shape), prior
        for period in range(len(number)):
            unit = _unit(amount[period] / scale, days[period] / day_scale)
            gap = max(time[period] - time[period - 1], 0.0) / MONTH if period else 0.0
            shape, rate = _walked(shape, rate, DRIFTS * gap)
            known = rate > 0.0
            mean, variance = _moments(shape, rate, unit, index)
            seen = log_probability(number[period], mean, variance)
            first = np.where(
                unit > 0.0, -np.log((number[period] + 1.0) * VAGUE), 0.0 if number[period] == 0 else -np.inf
            )
            log_weight = log_weight + np.where(known, seen, first)
            weight = 1.0 / (index + SCATTERS * np.where(known, mean, number[period]))
            is_first = ~known & (unit > 0.0)
            shape = np.where(known | is_first, shape + weight * number[period] + PRIOR_EVENTS * is_first, shape)
            rate = rate + weight * unit + np.where(is_first, PRIOR_EVENTS * unit / (number[period] + PRIOR_EVENTS), 0.0)
        return cls(shape, rate, log_weight, index, scale, day_scale, float(time[-1]))

    @property
    def evidence(self) -> float:
        """ln of the probability of all numbers, each forecast before it was seen."""
        return float(scipy.special.logsumexp(self.log_weight))

    def forecast(self, amount: float, days: float, time: float) -> NumberForecast | None:
        """Number of a period with this measure and these days about a time, days; None if no level is known."""
        unit = _unit(amount / self.amount, days / self.days)
        gap = max(time - self.time, 0.0) / MONTH
        shape, rate = _walked(self.shape, self.rate, DRIFTS * gap)
        mean, variance = _moments(shape, rate, unit, self.dispersion)
        usable = ((rate > 0.0) | (unit == 0.0)) & np.isfinite(self.log_weight)
        if not usable.any():
            return None
        return NumberForecast.of(mean[usable], variance[usable], self.log_weight[usable])

    def coefficients(self) -> tuple[NDArray, NDArray]:
        """Events per day without mining, and events per unit of the measure, each (3,): lower end, median and upper end
        of the 95 % interval, at the level of the last period; NaN if no level is known."""
        known = (self.rate > 0.0) & np.isfinite(self.log_weight)
        if not known.any():
            return np.full(3, np.nan), np.full(3, np.nan)
        weight = np.where(known, np.exp(self.log_weight - self.log_weight[known].max()), 0.0)
        generator = np.random.default_rng(0)
        part = generator.choice(weight.size, COEFFICIENT_DRAWS, p=(weight / weight.sum()).ravel())
        level = generator.gamma(self.shape.ravel()[part]) / self.rate.ravel()[part]
        spacing = SHARES[1] - SHARES[0]
        share = SHARES[np.unravel_index(part, weight.shape)[0]] + spacing * generator.uniform(-0.5, 0.5, len(part))
        share = np.clip(share, 0.0, 1.0)
        quantiles = INTERVAL_95[0], 0.5, INTERVAL_95[1]
        return (
            np.quantile(level * share / self.days, quantiles),
            np.quantile(level * (1.0 - share) / self.amount, quantiles),
        )


def _share_prior() -> NDArray:
    """Uniform in 0 to 1: the ends of the grid have half a cell."""
    weight = np.ones(len(SHARES))
    weight[[0, -1]] = 0.5
    return weight / weight.sum()


def _deviation_prior() -> NDArray:
    """0 with the probability SPIKE, else half-normal (George and McCulloch 1993)."""
    slab = np.exp(-0.5 * (DEVIATIONS[1:] / SLAB) ** 2) * np.gradient(DEVIATIONS)[1:]
    return np.append(SPIKE, (1.0 - SPIKE) * slab / slab.sum())


def dispersion_indices(least: float, most: float) -> NDArray:
    """Dispersion indices (index,) between their bounds; one if these are the same."""
    return np.array([most]) if most < 1.01 * least else np.geomspace(least, most, INDICES)


def index_prior(index: NDArray) -> NDArray:
    """Prior probability of dispersion indices (index,), evenly spaced in their logarithm: the density is k^-2."""
    return (1.0 / index) / np.sum(1.0 / index)


def _unit(amount: float, days: float) -> NDArray:
    """u of the law for each share, (share, 1, 1, 1)."""
    return ((1.0 - SHARES) * amount + SHARES * days)[:, None, None, None]


def _walked(shape: NDArray, rate: NDArray, variance: NDArray) -> tuple[NDArray, NDArray]:
    """Shape and rate of a level whose logarithm has this much more variance; its mean stays."""
    smaller = 1.0 / (1.0 + shape * variance)
    return shape * smaller, rate * smaller


def _moments(shape: NDArray, rate: NDArray, unit: NDArray, dispersion: NDArray) -> tuple[NDArray, NDArray]:
    """Mean and variance of the number of a period; 0 where the level is not known."""
    known = rate > 0.0
    mean = np.where(known, shape * unit / np.where(known, rate, 1.0), 0.0)
    level = np.where(known, 1.0 + 1.0 / np.where(known, shape, 1.0), 1.0)
    return mean, dispersion * mean + mean**2 * (level * (1.0 + SCATTERS) - 1.0)


def control_forecasts(
    number: NDArray, stated: NDArray, expected: NDArray, spread: NDArray, dispersion: NDArray
) -> list[NumberForecast | None]:
    """Forecasts of the number of each period (period,) by another rule; None where it expects no number.

    stated: by the rule, NaN where it says none; expected: mean of what may come; spread: variance over the dispersion
    index times the expected number, which the rule's own counts add to; dispersion (period, 2): bounds of the index by
    the periods before.
    The scatter of the rule about what it expects is learnt from its own earlier periods, as that of a law is.
    """
    found: list[NumberForecast | None] = []
    seen = np.zeros((len(DEVIATIONS), INDICES))
    for value, said, mean, factor, bounds in zip(number, stated, expected, spread, dispersion, strict=True):
        if not np.isfinite(mean):
            found.append(None)
            continue
        index = np.geomspace(bounds[0], bounds[1], INDICES)
        means = np.full(seen.shape, mean)
        variance = index * mean * factor + mean**2 * SCATTERS
        log_weight = np.log(_deviation_prior()[:, None] * index_prior(index)) + seen
        found.append(NumberForecast.of(means, variance, log_weight, float(said)))
        if mean > 0.0:
            seen = seen + log_probability(value, means, variance)
    return found
