"""The velocity that is exceeded at an opening with a chance in a step, and the events that make it.

The modelled events of a step are taken as the rate, places and sizes of a process whose events are independent, or
cluster. Of K runs (the mine's own and the members of its ensemble) each event counts 1 / K. With N events expected and
p_i the chance that event i exceeds v (shaking.relations), the expected number of exceedances and the chance of one at
least are

  Lambda(v) = sum_i p_i(v) / K,       chance = 1 - (1 + (D - 1) Lambda / N)^(-N / (D - 1)).

D is the variance over mean of the number of events: between the runs, or that of the record if it is larger. For D = 1
the chance is 1 - exp(-Lambda); more clustering makes it smaller, as exceedances then come together. Each event counts
at its own distance from the part of the opening that is nearest to it: it is the chance that v is exceeded anywhere at
the opening.

The interval is of the expected number Lambda, as of any sum of sizes in this project (catalogs.compare.exposure:
gamma limits of equal mean and variance, with one event more in the upper one, Fay and Feuer 1997). Velocities of a
small chance hang on the few largest and nearest events, which a step may lack by chance. So the event more is as large
as the largest of all steps and runs, and as near to the opening as the nearest. The interval holds chance in the
numbers, sizes and places of events and between runs. It does not hold larger events than the model has.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from catalogs.sources.jackknife import INTERVAL_95
from shaking.relations import exceedance

LOG_VELOCITIES = np.linspace(-5.0, 2.0, 141)  # log10 m/s: of curves, and where the search for a velocity begins
BISECTIONS = 15  # of a span of LOG_VELOCITIES, to 2e-6 of log10 v
BLOCK_SIZE = 1 << 22  # Chances that are computed at a time.


@dataclass(frozen=True)
class Shaking:
    """Events that may shake an opening in a step, of all runs.

    log_median, deviation (event,): of log10 of the velocity, m/s; runs: K of the module docstring; expected: N;
    dispersion: D of the process; run_dispersion: that of the number between runs; log_largest: log10 m/s; strongest:
    median and deviation of the event that the upper end of intervals has more, None for the largest of these.
    """

    log_median: NDArray
    deviation: NDArray
    runs: int
    expected: float
    dispersion: float = 1.0
    run_dispersion: float = 1.0
    log_largest: float = np.inf
    strongest: tuple[float, float] | None = None

    def weights(self, log_velocity: ArrayLike) -> NDArray:
        """Share (..., event) of the expected number of exceedances that each event is, at velocities (...,)."""
        at = np.asarray(log_velocity, float)[..., None]
        return exceedance(at, self.log_median, self.deviation, self.log_largest) / self.runs

    def rates(self, log_velocity: NDArray) -> NDArray:
        """Expected number of exceedances (velocity, 3): itself, lower and upper end of its interval."""
        rows = max(1, BLOCK_SIZE // max(len(self.log_median), 1))
        found = [self._rates(log_velocity[start : start + rows]) for start in range(0, len(log_velocity), rows)]
        return np.concatenate([np.empty((0, 3)), *found])

    def _rates(self, log_velocity: NDArray) -> NDArray:
        weight = self.weights(log_velocity)
        total, squares, largest = weight.sum(axis=-1), np.square(weight).sum(axis=-1), weight.max(axis=-1, initial=0.0)
        if self.strongest is not None:
            median, deviation = map(np.array, self.strongest)
            further = exceedance(log_velocity, median, deviation, self.log_largest) / self.runs
            largest = np.maximum(largest, further)
        interval = expected_interval(total, squares, largest, self.run_dispersion)
        return np.column_stack([total, interval])

    def chance(self, rate: ArrayLike) -> NDArray:
        """Chance of one exceedance at least, from the expected number."""
        rate, excess = np.asarray(rate, float), max(self.dispersion - 1.0, 1e-9)
        if not self.expected > 0.0:
            return np.where(rate > 0.0, -np.expm1(-rate), 0.0)
        return -np.expm1(-self.expected / excess * np.log1p(excess * rate / self.expected))

    def rate_of(self, chance: ArrayLike) -> NDArray:
        """Expected number of exceedances of which one at least comes with a chance: the inverse of `chance`."""
        decay, excess = -np.log1p(-np.asarray(chance, float)), max(self.dispersion - 1.0, 1e-9)
        if not self.expected > 0.0:
            return decay
        with np.errstate(over="ignore"):  # a chance that so few events cannot have
            return self.expected / excess * np.expm1(excess * decay / self.expected)

    def velocity(self, chances: NDArray) -> NDArray:
        """Velocities (chance, 3), m/s, that are exceeded with these chances: itself, lower and upper end.

        0 where there are too few events for the chance. NaN for the upper end where no event says how strong one is.
        """
        if not len(self.log_median) and self.strongest is None:
            return np.tile([0.0, 0.0, np.nan], (len(chances), 1))
        rates, target = self.rates(LOG_VELOCITIES), np.repeat(self.rate_of(chances), 3)
        column = np.tile(np.arange(3), len(chances))
        # The first velocity whose rate is below the target ends the span that holds the answer.
        after = np.count_nonzero(rates[:, column] >= target, axis=0)
        low, high = (LOG_VELOCITIES[np.clip(after - back, 0, len(LOG_VELOCITIES) - 1)] for back in (1, 0))
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            is_exceeded = self._rates(middle)[np.arange(len(middle)), column] >= target
            low, high = np.where(is_exceeded, middle, low), np.where(is_exceeded, high, middle)
        return np.where(after > 0, 10.0**low, 0.0).reshape(-1, 3)


def expected_interval(total: NDArray, squares: NDArray, largest: NDArray, dispersion: float) -> NDArray:
    """95 % interval (..., 2) of what is expected of sums of sizes, by catalogs.compare.exposure.total_interval.

    total, squares, largest (...,): sum, sum of squares and largest of the sizes of each sum; dispersion: variance over
    mean of their number.
    """
    upper_total, upper_variance = total + dispersion * largest, dispersion * squares + (dispersion * largest) ** 2
    ends = [
        _gamma_quantile(total, dispersion * squares, INTERVAL_95[0]),
        _gamma_quantile(upper_total, upper_variance, INTERVAL_95[1]),
    ]
    return np.stack(ends, axis=-1)


def _gamma_quantile(mean: NDArray, variance: NDArray, quantile: float) -> NDArray:
    """Quantile of a gamma distribution of this mean and variance; 0 where the mean is 0."""
    positive = (mean > 0.0) & (variance > 0.0)
    mean, variance = np.where(positive, mean, 1.0), np.where(positive, variance, 1.0)
    return np.where(positive, variance / mean * scipy.special.gammaincinv(mean**2 / variance, quantile), 0.0)


def disaggregate(weight: NDArray, first: NDArray, second: NDArray, edges: tuple[NDArray, NDArray]) -> NDArray:
    """Shares (first class, second class) of weights (event,), by two values of each event and the edges of classes.

    Values beyond the edges count in the outer classes. Zeros where no weight is.
    """
    places = [
        np.clip(np.searchsorted(ends, values, side="right") - 1, 0, len(ends) - 2)
        for ends, values in zip(edges, (first, second), strict=True)
    ]
    shares = np.zeros([len(ends) - 1 for ends in edges])
    np.add.at(shares, tuple(places), weight)
    total = shares.sum()
    return shares / total if total > 0.0 else shares
