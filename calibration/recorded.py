"""Outputs of a record: potency, number and sizes of each step, and what chance alone does to them.

Recorded events come in clusters, and few of them hold most of the potency. The number of a step varies with the
clusters: its variance over its mean is the dispersion index. Given the number, the mean potency of its events varies as
that of so many events drawn from the law of sizes. The summed potency is the product of both. So potency and number of
a step share the chance of the clusters, and are no independent evidence.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from catalogs.compare.comparison import record_clusters
from catalogs.compare.exposure import Exposure, cluster_size
from catalogs.settings import DatedStep
from catalogs.sources.completeness import completeness, rounding
from catalogs.sources.sizes import LN10, log_potency
from common.errors import InputError

SIZE_DRAWS = 1000  # Draws of the sizes of a record.
MIN_MEAN_EXCESS = 0.01  # log10 potency; a b of 43
MIN_COUNT = 1e-6  # Events of a run that has hardly any.
MIN_POOL = 10  # Recorded events from which on they are drawn from, beside those of the model.


@dataclass(frozen=True)
class RecordedOutputs:
    """Outputs of the record, of each step in order.

    log_potency (step,) ln m3; number (step,) of events above the common cut; dispersion_index: variance over mean of
    that number, at least 1; log_excess: `mean_excess` of their sizes above the cut. size_errors (draw, step + 1): what
    chance adds to ln of the mean potency of so many events in each step, and to log_excess.
    """

    log_potency: NDArray
    number: NDArray
    dispersion_index: float = 1.0
    log_excess: float = 0.0
    size_errors: NDArray = field(default_factory=lambda: np.empty((0, 0)))

    @classmethod
    def none(cls) -> "RecordedOutputs":
        """Outputs of no step, where no record counts."""
        return cls(np.empty(0), np.empty(0, int))

    @property
    def log_number(self) -> NDArray:
        """ln of the number (step,), half an event where there is none."""
        return np.log(np.maximum(self.number, 0.5))

    @property
    def number_variance(self) -> NDArray:
        """Variance (step,) of ln number."""
        return self.dispersion_index / np.maximum(self.number, 0.5)

    @property
    def size_covariance(self) -> NDArray:
        """Covariance (step + 1, step + 1) of ln mean potency by step and of log_excess, given the numbers."""
        if not len(self.size_errors):
            return np.zeros((len(self.number) + 1, len(self.number) + 1))
        return self.size_errors.T @ self.size_errors / len(self.size_errors)

    @property
    def potency_covariance(self) -> NDArray:
        """Covariance (step, step) of ln potency: of the mean potency and of the number."""
        return self.size_covariance[:-1, :-1] + np.diag(self.number_variance)


def complete_above(record: xr.Dataset, given: float | None) -> float:
    """log10 potency (m3) from which on the record is complete: as given, m3, else estimated from its sizes.

    Raises InputError where it is not given and cannot be estimated.
    """
    if given is not None:
        return float(np.log10(given))
    sizes = log_potency(record["potency"].values[record["resolved"].values == 1])
    size = completeness(sizes, rounding(sizes))
    if not np.isfinite(size):
        number = int(np.isfinite(sizes).sum())
        raise InputError(
            f"calibration.complete_above: missing; the record ({number} event{'s' * (number != 1)}) does not tell from "
            "which size on it is complete. Give that potency, such as 0.1 m^3: above it the network missed nothing"
        )
    return size


def check_record(record: xr.Dataset, steps: Sequence[DatedStep], exposure: Exposure, terms: Sequence[str]) -> None:
    """Raise InputError where a dated step lacks what the terms need: time of the record, and recorded potency."""
    covered(exposure, steps)
    number = exposure.step(record["time"].values)
    for index, step in enumerate(steps):
        sizes = record["potency"].values[number == index]
        if "potency" in terms and not np.nansum(sizes) > 0.0:
            raise InputError(
                f"record: no potency in step {step.name}; calibrate to steps with recorded events, or leave potency "
                "out of calibration.terms"
            )


def read_record(
    record: xr.Dataset, exposure: Exposure, cut: float, seed: int, modelled_sizes: NDArray | None = None
) -> RecordedOutputs:
    """Outputs of the record in each dated step.

    cut: log10 m3; modelled_sizes (event,): log10 potency of the trials' events above it. Sizes are drawn from the
    recorded ones or from these, whichever vary more: the few events of a record lack the largest of their law. A step
    without recorded potency counts as the cut.
    """
    step, potency = exposure.step(record["time"].values), record["potency"].values
    used = (step >= 0) & (record["resolved"].values == 1)
    clusters = record_clusters(record, used, step)
    size = log_potency(potency)
    counted = used & (size >= cut)
    dispersion_index = exposure.dispersion_index(record["time"].values[used], clusters[used], counted[used])

    steps = len(exposure.start)
    sums = np.array([np.nansum(potency[step == index]) for index in range(steps)])
    number = np.array([np.count_nonzero(counted & (step == index)) for index in range(steps)])
    excess = size[counted] - cut
    generator = np.random.default_rng(seed)
    modelled = np.empty(0) if modelled_sizes is None else modelled_sizes - cut
    pools = [pool for pool, least in ((excess, MIN_POOL), (modelled, 1)) if len(pool) >= least]
    drawn = [size_errors(pool, number, generator) for pool in pools or [excess]]
    errors = max(drawn, key=lambda one: float(one[:, :-1].var(axis=0).mean()))
    return RecordedOutputs(
        np.log(np.maximum(sums, 10.0**cut)),
        number,
        dispersion_index,
        mean_excess(excess),
        errors * np.sqrt(size_dispersion(excess, clusters[counted])),
    )


def size_errors(excess: NDArray, number: NDArray, generator: np.random.Generator) -> NDArray:
    """Deviations (draw, step + 1) of ln mean potency by step and of ln mean excess, by chance of the sizes alone.

    As many events as each step has, one at least, are drawn from these sizes (event,), log10 over the cut.
    """
    if not len(excess):
        return np.ones((1, len(number) + 1))
    counts = np.maximum(number, 1)
    drawn = generator.choice(excess, (SIZE_DRAWS, int(counts.sum())))
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    means = np.add.reduceat(10.0**drawn, starts, axis=1) / counts
    of_all = (drawn.sum(axis=1) + 1.0) / (counts.sum() + 1.0)
    logs = np.log(np.column_stack([means, of_all]))
    return logs - logs.mean(axis=0)


def size_dispersion(excess: NDArray, clusters: NDArray) -> float:
    """Factor, at least 1, by which clusters (event,) raise the variance of the mean size above the cut (event,).

    The variance of the sums of the clusters' deviations over that of independent events.
    """
    off = excess - excess.mean() if len(excess) else excess
    if not np.sum(off**2) > 0.0:
        return 1.0
    sums = np.bincount(np.unique(clusters, return_inverse=True)[1].reshape(-1), off)
    return max(1.0, float(np.sum(sums**2) / np.sum(off**2)))


def mean_excess(excess: NDArray) -> float:
    """ln of the mean of sizes above the cut (event,), log10 potency, with one more event a decade above it.

    Of a power law the mean is 1 / (b ln 10). A run without events has a mean, too.
    """
    return float(np.log((excess.sum() + 1.0) / (len(excess) + 1.0)))


def as_of(log_excess: ArrayLike, count: ArrayLike, other: ArrayLike) -> NDArray:
    """What `mean_excess` is on average of `other` events where it is log_excess of `count` of the same law.

    The one more event counts for more beside few events: of two sizes, those of more events are to be brought to the
    number of the other, since the other way it multiplies errors.
    """
    count, other = np.maximum(count, MIN_COUNT), np.asarray(other, float)
    mean = ((count + 1.0) * np.exp(log_excess) - 1.0) / count
    return np.log((other * np.maximum(mean, MIN_MEAN_EXCESS) + 1.0) / (other + 1.0))


def slope(log_excess: ArrayLike, count: ArrayLike) -> NDArray:
    """b of a power law whose `mean_excess` is log_excess of so many events, without the one more; infinite where the
    rest has no size above the cut."""
    mean = ((np.asarray(count) + 1.0) * np.exp(log_excess) - 1.0) / np.maximum(count, MIN_COUNT)
    return np.where(mean > MIN_MEAN_EXCESS, 1.0 / (LN10 * np.maximum(mean, MIN_MEAN_EXCESS)), np.inf)


def clustered_numbers(
    expected: NDArray, dispersion_index: float, generator: np.random.Generator
) -> tuple[NDArray, float]:
    """Numbers (step,) with these means, drawn cluster by cluster, and the dispersion index that the clusters show.

    Clusters are independent, and their sizes have a logarithmic distribution: the number of events then has a negative
    binomial one, whose variance is `dispersion_index` times its mean (Quenouille 1949).
    """
    share = 1.0 - 1.0 / max(dispersion_index, 1.0 + 1e-9)
    mean_size = -share / ((1.0 - share) * np.log1p(-share))
    clusters = generator.poisson(expected / mean_size)
    sizes = generator.logseries(share, int(clusters.sum()))
    number = np.bincount(np.repeat(np.arange(len(expected)), clusters), sizes, minlength=len(expected)).astype(int)
    return number, cluster_size(np.repeat(np.arange(len(sizes)), sizes))


def covered(exposure: Exposure, steps: Sequence[DatedStep]) -> NDArray:
    """Share of each dated step (step,) during which the record was taken. Raises InputError for a step without any."""
    whole = Exposure.of(tuple(steps), None)
    share = (exposure.end - exposure.start) / (whole.end - whole.start)
    for step, part in zip(steps, share, strict=True):
        if not part > 0.0:
            raise InputError(
                f"record: covers nothing of step {step.name}; calibrate to a mine file whose dated steps are recorded, "
                "or mine this step without dates"
            )
    return np.asarray(share, float)
