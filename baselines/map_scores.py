"""Gains of maps at recorded events, their means with intervals, and the paired T test of two maps.

The T test of forecasts (Rhoades et al. 2011) takes the gain of each recorded event for independent of the others.
Events trigger events, so the variance here is that of clusters: the differences between the mean without a cluster and
the mean are squared and summed (catalogs.sources.jackknife). Each run of a model is a map of its own, so that a model
of one run and one of ten have the same chance to gain, and the runs add the variance of their mean.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t

from catalogs.compare.blocks import MIN_BLOCKS
from catalogs.sources.jackknife import INTERVAL_95, effective_blocks

# Effective number of clusters that an interval needs: gains are skewed, and fewer clusters hold too little of them.
MIN_CLUSTERS = 4.0
SIGNIFICANCE = 0.05  # Chance of a difference between equal models that a verdict may have, all of its tests together.
TINY = np.finfo(float).tiny
CEILING = "ceiling"  # Label of the map of the step's own events: days predict each other.


@dataclass(frozen=True)
class Variance:
    """Variance of an estimate, and the degrees of freedom that it is known with; NaN where it is not known."""

    value: float
    freedom: float

    def __add__(self, other: "Variance") -> "Variance":
        """Variance of the sum of two independent estimates; degrees of freedom after Welch and Satterthwaite."""
        total = self.value + other.value
        freedom = total**2 / max(self.value**2 / self.freedom + other.value**2 / other.freedom, TINY)
        return Variance(total, max(freedom, 1.0))


@dataclass(frozen=True)
class Estimate:
    """A mean gain, or the difference of two, nats per event, with its 95 % interval (2,) and the p-value of 0.

    Interval and p-value are NaN where there are too few independent clusters.
    """

    value: float
    interval: NDArray
    p_value: float

    @classmethod
    def of(cls, value: float, variance: Variance) -> "Estimate":
        """Student's t of an estimate."""
        error = np.sqrt(variance.value)
        half = t.ppf(INTERVAL_95[1], variance.freedom) * error
        p_value = 2.0 * t.sf(abs(value) / max(error, TINY), variance.freedom) if np.isfinite(error) else np.nan
        return cls(float(value), np.array([value - half, value + half]), float(p_value))


def coarser_clusters(cluster: NDArray, time: NDArray) -> NDArray:
    """Clusters (event,), or the days of the events, time (event,) datetime64, if these are worth fewer blocks.

    A record that is one burst, or two, is too short to tell its events from independent ones by the times between them.
    """
    day = np.unique(time.astype("datetime64[D]"), return_inverse=True)[1].reshape(-1)
    return min((cluster, day), key=lambda labels: effective_blocks(np.unique(labels, return_counts=True)[1]))


def cluster_variance(values: NDArray, cluster: NDArray) -> Variance:
    """Variance of the mean of values (event,) whose clusters (event,) are independent.

    With the differences d between the mean without a cluster and the mean it is sum d^2, known with
    (sum d^2)^2 / sum d^4 degrees of freedom, at most those of the effective number of clusters: gains are skewed and
    clusters few, and their number alone makes intervals that are too narrow. NaN with fewer than MIN_CLUSTERS, or where
    one has most of the events.
    """
    count = np.unique(cluster, return_inverse=True, return_counts=True)
    labels, sizes = count[1].reshape(-1), count[2]
    worth = effective_blocks(sizes)
    if worth < MIN_CLUSTERS:
        return Variance(np.nan, np.nan)
    sums = np.bincount(labels, values)
    squared = ((sums.sum() - sums) / (len(values) - sizes) - values.mean()) ** 2
    total = float(squared.sum())
    freedom = min(total**2 / max(float(np.sum(squared**2)), TINY), worth - 1.0)
    return Variance(total, max(freedom, 1.0))


def run_variance(means: NDArray, *others: NDArray) -> Variance:
    """Variance of the mean over runs of their mean gains, means (run,).

    A model with fewer than MIN_BLOCKS runs is taken to scatter as the first of `others` that has them: if two models
    are equal, their runs do. 0 where none has them: then the runs are taken as they are.
    """
    known = next((one for one in (means, *others) if len(one) >= MIN_BLOCKS), None)
    if known is None:
        return Variance(0.0, 1.0)
    return Variance(float(known.var(ddof=1)) / len(means), len(known) - 1.0)


@dataclass(frozen=True)
class MapScores:
    """Gains of maps at recorded events.

    labels: of the maps; gains: of each map (run, event), nats, a row for each of its runs, NaN where it has no forecast
    of the event's step; step and cluster of each event (event,).
    """

    labels: tuple[str, ...]
    gains: tuple[NDArray, ...]
    step: NDArray
    cluster: NDArray

    @property
    def gain(self) -> NDArray:
        """Gain of each map at each event (map, event), the mean of its runs."""
        return np.array([runs.mean(axis=0) for runs in self.gains]).reshape(len(self.labels), len(self.step))

    @property
    def common(self) -> NDArray:
        """Events (event,) bool for which every map has a forecast, of the maps that have any: what all steps together
        are scored by. The ceiling is no forecast."""
        gain = self.gain[[label != CEILING for label in self.labels]]
        known = np.isfinite(gain)
        return known[known.any(axis=1)].all(axis=0) & known.any(axis=0)

    @property
    def clusters(self) -> int:
        """Clusters of the events that all steps together are scored by."""
        return len(np.unique(self.cluster[self.common]))

    @property
    def effective_clusters(self) -> float:
        """How many clusters of one size these clusters are worth (Kish 1965)."""
        return effective_blocks(np.unique(self.cluster[self.common], return_counts=True)[1])

    @property
    def has_intervals(self) -> bool:
        """True if there are enough independent clusters for an interval over all steps."""
        return self.effective_clusters >= MIN_CLUSTERS

    def mean(self, step: int | None = None) -> NDArray:
        """Mean gain of each map (map,), nats per event, of one step or of those that all maps forecast; NaN without.

        That of the ceiling is of those events which have one."""
        gain = self.gain[:, self._own(step)]
        known = np.isfinite(gain) | np.array([[label != CEILING] for label in self.labels])
        count = known.sum(axis=1)
        return np.where(count, np.where(known, gain, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)

    def interval(self, step: int | None = None) -> NDArray:
        """95 % interval of the mean gain (map, 2). It contains the chance of a map's runs if these are MIN_BLOCKS."""
        own, found = self._own(step), []
        if not own.any():
            return np.full((len(self.labels), 2), np.nan)
        for runs in self.gains:
            gain = runs[:, own]
            variance = cluster_variance(gain.mean(axis=0), self.cluster[own]) + run_variance(gain.mean(axis=1))
            found.append(Estimate.of(float(gain.mean()), variance).interval)
        return np.array(found)

    def lead(self, one: str, other: str) -> Estimate:
        """Mean gain of a map less that of another over all steps: the paired T test."""
        own = self.common
        if not own.any():
            return Estimate(np.nan, np.full(2, np.nan), np.nan)
        first, second = (self.gains[self.labels.index(label)][:, own] for label in (one, other))
        difference = first.mean(axis=0) - second.mean(axis=0)
        means = first.mean(axis=1), second.mean(axis=1)
        variance = cluster_variance(difference, self.cluster[own])
        variance += run_variance(means[0], means[1])
        variance += run_variance(means[1], means[0])
        return Estimate.of(float(difference.mean()), variance)

    def _own(self, step: int | None) -> NDArray:
        return self.common if step is None else self.step == step


def adjusted(p_values: Sequence[float]) -> NDArray:
    """p-values (test,) of tests that one verdict rests on, raised so that all together keep their level (Holm 1979).

    >>> print(adjusted([0.01, 0.04, 0.03]))
    [0.03 0.06 0.06]
    """
    values = np.asarray(p_values, float)
    order = np.argsort(values, kind="stable")
    raised = np.maximum.accumulate(values[order] * np.arange(len(values), 0, -1))
    found = np.empty_like(values)
    found[order] = np.minimum(raised, 1.0)
    return found


def verdict_of(p_value: float) -> str:
    """Words that say whether a difference with this adjusted p-value may be chance.

    >>> verdict_of(0.01), verdict_of(0.2)
    ('more than chance explains', 'no more than chance explains')
    """
    return "more than chance explains" if p_value < SIGNIFICANCE else "no more than chance explains"
