"""The time during which a catalogue was recorded, and the expected number and summed potency of events in it.

The time that both catalogues share is the part of the dated steps during which the network recorded
(`catalogs.records.times`).

Events are a compound Poisson process: if they are independent, a sum S of their sizes s has the variance sum(s^2). It
varies like that of S / scale equal events, scale = sum(s^2) / S (Kish 1965), and S / scale is nearly Poisson (Bohm and
Zech 2014). Clusters raise the variance by a factor. All intervals and tests below follow from that, in closed form.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
import xarray as xr
from numpy.typing import NDArray

from catalogs.records.times import parse_time
from catalogs.settings import DatedStep
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.significance import POWER, TEST_LEVEL

DAY = np.timedelta64(86400 * 10**9, "ns")
# Lengths of the windows in which events are counted for their clustering, days. An aftershock may come a week later.
WINDOW_DAYS = (1, 2, 4, 8)
MIN_WINDOWS = 10  # Windows of one length that a variance needs.
# Chance of finding clustering among independent events, whose limits are exact without it.
CLUSTERING_SIGNIFICANCE = 0.05
POWER_POINTS = 24  # Quantiles of each total that power is computed with.
MAX_LOG_RATIO = np.log(1e6)  # Larger ratios count as such that no test notices.
MAX_EQUAL_EVENTS = 1e7  # More equal events make an interval no narrower that matters.


@dataclass(frozen=True)
class Exposure:
    """The parts of the dated steps, in order and apart, during which both catalogues are known: starts and ends
    (step,), ns."""

    start: NDArray
    end: NDArray

    @classmethod
    def of(cls, steps: tuple[DatedStep, ...], common: tuple[str, str] | None) -> "Exposure":
        """The dated steps, cut to the common period (ISO text) if it is known."""
        windows = [window(one.model_dump()) for one in steps]
        start, end = np.array(windows, "datetime64[ns]").reshape(-1, 2).T
        if common:
            first, last = (np.datetime64(text, "ns") for text in common)
            start, end = np.clip(start, first, last), np.clip(end, first, last)
        return cls(start, end)

    @property
    def days(self) -> float:
        """Days of exposure; NaN without dated steps."""
        return float(np.sum((self.end - self.start) / DAY)) if len(self.start) else np.nan

    def step(self, time: NDArray) -> NDArray:
        """Number of the step of each event (event,); -1 outside of all. Without dated steps 0: all are of one."""
        time = np.asarray(time, "datetime64[ns]")
        if not len(self.start):
            return np.zeros(len(time), np.int64)
        last = np.searchsorted(self.start, time, side="right") - 1  # that begins by then
        return np.where((last >= 0) & (time < self.end[last]), last, -1)

    def counts(self, time: NDArray) -> list[NDArray]:
        """Events on each day of each step (day,), those without events included."""
        time = np.asarray(time, "datetime64[ns]")
        if not len(self.start):
            known = time[~np.isnat(time)]
            whole = (known.min(), known.max() + np.timedelta64(1, "ns")) if known.size else ()
            return Exposure(*np.array([whole], "datetime64[ns]").T).counts(time) if whole else []
        step = self.step(time)
        order = np.argsort(step, kind="stable")
        bounds = np.searchsorted(step[order], np.arange(len(self.start) + 1))
        parts = zip(self.start, self.end, np.split(time[order], bounds)[1:], strict=False)
        return [
            np.bincount((own - start) // DAY, minlength=int(np.ceil((end - start) / DAY))) for start, end, own in parts
        ]

    def dispersion_index(self, time: NDArray, clusters: NDArray, counted: NDArray | None = None) -> float:
        """Variance of the number of events over its mean, at least 1, which is that of independent events.

        time, clusters (event,): times, and clusters of `compare.blocks`; counted (event,) bool: the events whose number
        it is, all if not given. The others count as left out at random, by which an index less 1 loses the same share.
        Comparison, rates, calibration and plans all take the index from here. It is the larger of two values, since
        either may miss clustering. That of clusters is `cluster_size` of the events in the exposure. That of times is
        the largest over windows of WINDOW_DAYS days, their numbers about the mean of their own step: what a step mines
        sets its rate, and that is no chance. It is 1 where no length has a variance that independent events hardly have
        (CLUSTERING_SIGNIFICANCE, all lengths together), or MIN_WINDOWS of them.
        """
        inside = self.step(time) >= 0
        found = [1.0, cluster_size(clusters[inside])]
        counts = self.counts(time)
        for length in WINDOW_DAYS:
            windows = [days[: len(days) // length * length].reshape(-1, length).sum(axis=1) for days in counts]
            windows = [numbers for numbers in windows if len(numbers) > 1 and numbers.any()]
            if sum(map(len, windows)) < MIN_WINDOWS:
                continue
            # of independent events chi-square, whatever the rates of the steps
            squares = sum((len(numbers) - 1) * numbers.var(ddof=1) / numbers.mean() for numbers in windows)
            freedom = sum(len(numbers) - 1 for numbers in windows)
            if scipy.stats.chi2.sf(squares, freedom) < CLUSTERING_SIGNIFICANCE / len(WINDOW_DAYS):
                variance = sum(len(numbers) * numbers.var(ddof=1) for numbers in windows)
                found.append(float(variance / sum(numbers.sum() for numbers in windows)))
        share = 1.0 if counted is None else float(counted[inside].sum() / max(inside.sum(), 1))
        return 1.0 + (max(found) - 1.0) * share


def cluster_size(clusters: NDArray) -> float:
    """Variance over mean of the number of events in independent clusters (event,).

    The sum of squares of the clusters' sizes over the number of events; 1 without an event.
    """
    sizes = np.unique(clusters, return_counts=True)[1]
    return float(np.sum(sizes**2) / len(clusters)) if len(clusters) else 1.0


def common_period(record: xr.Dataset) -> tuple[str, str] | None:
    """First and last time, ISO text, that record and model share, as far as the record says it."""
    return json.loads(record.attrs.get("period", "{}")).get("common")


def window(step: Mapping[str, str]) -> tuple[np.datetime64, np.datetime64]:
    """Start and end of a dated step (UTC, ns), from its ISO texts."""
    return parse_time(step["start"], "step start"), parse_time(step["end"], "step end")


def total_interval(sizes: NDArray, dispersion_index: float = 1.0, largest: float | None = None) -> NDArray:
    """95 % interval (2,) of what is expected of a sum of positive sizes (event,), whatever law they follow.

    It holds for sizes up to `largest` (that of the largest event if not given): a power law without an upper end, of b
    below 1, has no mean, and nothing bounds a sum of it. Gamma limits of equal mean and variance, the upper one with
    one event more, of size `largest` (Fay and Feuer 1997); of equal sizes they are the exact Poisson limits (Garwood
    1936). dispersion_index: variance of the number of events over its mean. No event: from 0; NaN if
    `largest` is not given either.
    """
    sizes = np.asarray(sizes, float)
    total, variance = sizes.sum(), dispersion_index * np.sum(sizes**2)
    one = dispersion_index * (sizes.max(initial=0.0) if largest is None else largest)
    if not total + one > 0:
        return np.full(2, np.nan)
    lower = variance / (2 * total) * scipy.stats.chi2.ppf(INTERVAL_95[0], 2 * total**2 / variance) if total else 0.0
    total, variance = total + one, variance + one**2
    return np.array([lower, variance / (2 * total) * scipy.stats.chi2.ppf(INTERVAL_95[1], 2 * total**2 / variance)])


@dataclass(frozen=True)
class Total:
    """Sum of a catalogue, and the size of equal events whose sum would vary as much (its variance over it)."""

    value: float
    scale: float


@dataclass(frozen=True)
class Ratio:
    """Ratio of two totals, its 95 % interval (2,), and the probability of one as far from 1 by chance.

    NaN where the second is 0. The interval is open on the side of one that is 0 (to 0 or infinity), NaN if both are.
    """

    value: float
    interval: NDArray
    p_value: float


def total_ratio(first: Total, second: Total) -> Ratio:
    """The ratio of what is expected of two totals.

    Each counts as a Poisson number of equal events. Half an event is added to either (Jeffreys' prior), so that the
    ratio follows an F distribution: of numbers of events Jeffreys' interval of a binomial share (Brown, Cai and
    DasGupta 2001), which holds the truth as often as it says on average; that of Clopper and Pearson more often.
    """
    if not first.value + second.value > 0:
        return Ratio(np.nan, np.full(2, np.nan), np.nan)
    scales = first.scale, second.scale
    worth = [min(one.value / one.scale, MAX_EQUAL_EVENTS) + 0.5 for one in (first, second)]
    freedom = 2 * worth[0], 2 * worth[1]
    lower, upper = scales[0] * worth[0] / (scales[1] * worth[1]) * scipy.stats.f.ppf(INTERVAL_95, *freedom)
    lower, upper = lower if first.value else 0.0, upper if second.value else np.inf
    return Ratio(
        first.value / second.value if second.value else np.nan,
        np.array([lower, upper]),
        float(_chance(np.array(worth[0]), np.array(worth[1]), *scales)),
    )


def _chance(first: NDArray, second: NDArray, first_scale: float, second_scale: float) -> NDArray:
    """p-value of a ratio of 1 of totals that are worth so many equal events, half an event more each."""
    inverse = second_scale * second / (first_scale * first)
    freedom = 2 * first, 2 * second
    return 2 * np.minimum(scipy.stats.f.cdf(inverse, *freedom), scipy.stats.f.sf(inverse, *freedom))


def noticed_ratio(first: Total, second: Total) -> float:
    """Ratio of expected totals, on the side of the ratio found, that the test of `total_ratio` notices with the chance
    POWER (`sources.significance`), if what is found of the second is what is expected.

    Infinite or 0 where no total is large or small enough; NaN without a second total.
    """
    if not second.value:
        return np.nan
    scales, sign = (first.scale, second.scale), 1.0 if first.value > second.value else -1.0
    shares = (np.arange(POWER_POINTS) + 0.5) / POWER_POINTS

    def worth(total: float, scale: float) -> NDArray:
        """Quantiles of the number of equal events that is found, half an event more."""
        return scipy.stats.gamma.ppf(shares, min(total / scale, MAX_EQUAL_EVENTS) + 0.5)

    def lack(log_ratio: float) -> float:
        """Power that is lacking where the first total is expected to be this much larger."""
        more = worth(second.value * np.exp(log_ratio), scales[0])[:, None]
        return POWER - float(np.mean(_chance(more, worth(second.value, scales[1]), *scales) <= TEST_LEVEL))

    far = sign * MAX_LOG_RATIO
    if lack(far) > 0.0:
        return np.inf if sign > 0.0 else 0.0
    return float(np.exp(scipy.optimize.brentq(lack, *sorted((0.0, far)), xtol=0.01)))
