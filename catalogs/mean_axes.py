"""The mean of many axes, its error, and whether it exists: axes may also lie in a girdle, or in any direction.

The orientation matrix is the mean of a a^T (Scheidegger 1965); its eigenvalues S1 >= S2 >= S3 add up to 1. Woodcock's
(1977) K = ln(S1 / S2) / ln(S2 / S3) is above 1 for a cluster about the eigenvector of S1, below 1 for a girdle about
that of S3, its pole. A tight cluster that is longer than wide has a K below 1, too, but it has a good mean. Therefore a
girdle must also be more of a girdle than of a point, 2 (S2 - S3) > S1 - S2 (Vollmer 1990). Uniform axes have S = 1/3
three times.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalogs.distributions import chi_square_tail
from catalogs.jackknife import Scatter, effective_blocks
from common.source_tensors import point_down

CLUSTER, GIRDLE, UNIFORM = "cluster", "girdle", "no preferred direction"
MAX_CHANCE_OF_PATTERN = 0.05  # Axes with a pattern that is more likely by chance count as uniform.
MAX_PARALLEL_VARIANCE = 1e-12  # Variance of the orientation matrix of parallel axes, whose unit vectors are rounded.
MAX_CONE = 45.0  # degrees; a wider 95 % cone shows that there is no mean


@dataclass(frozen=True)
class AxesSample:
    """Axes of one catalogue: rows P, B, T (event, 3, 3), NaN where unclear; where (event, 3) m, and blocks (event,).

    blocks: None for a model that ran once, whose scatter is not known.
    """

    axes: NDArray
    location: NDArray
    blocks: NDArray | None

    @property
    def labels(self) -> NDArray:
        """Blocks (event,) numbered 0, 1, ...; without blocks each event is one."""
        blocks = np.arange(len(self.axes)) if self.blocks is None else self.blocks
        return np.unique(blocks, return_inverse=True)[1].reshape(-1)

    def weights(self, resamplings: int, generator: np.random.Generator) -> NDArray:
        """Random weights (resampling, event) of blocks (Bayesian bootstrap, Rubin 1981)."""
        labels = self.labels
        return generator.standard_exponential((resamplings, int(labels.max()) + 1))[:, labels]

    def clear_share(self, size: NDArray) -> NDArray:
        """Share (3,) of the summed size (event,) whose P, B and T axes are clear."""
        clear = np.isfinite(self.axes).all(axis=-1)
        return size @ clear / size.sum()


@dataclass(frozen=True)
class MeanAxis:
    """Of one kind of axes: their mean (3,), NaN where they have none, and how sure it is.

    values (3,): eigenvalues, largest first; shape: CLUSTER, GIRDLE, UNIFORM, or empty without axes; pole (3,): of a
    girdle, else NaN; scatter: of the mean, None without blocks or without a mean.
    """

    mean: NDArray
    values: NDArray
    shape: str
    pole: NDArray
    scatter: Scatter | None

    @property
    def woodcock(self) -> float:
        """Woodcock's K; infinite for parallel axes, 0 for ones in a plane that are spread evenly."""
        first, second, third = np.maximum(self.values, 1e-12)
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.log(first / second) / np.log(second / third))


def describe_axes(axes: NDArray, labels: NDArray, blocks_known: bool) -> MeanAxis:
    """What axes (event, 3), NaN where unclear, have in common; labels (event,): the block of each, 0, 1, ...

    Axes count as uniform unless Bingham's statistic, 15/2 n sum (S_i - 1/3)^2 of chi-square with 5 degrees of
    freedom (Mardia and Jupp 2000, 10.7), says otherwise. n: how many independent axes the events are worth, their
    number over the design effect: the jackknife's variance of the orientation matrix over that of independent events.
    """
    clear = np.isfinite(axes).all(axis=-1)
    axes, labels = axes[clear], np.unique(labels[clear], return_inverse=True)[1].reshape(-1)
    absent = np.full(3, np.nan)
    if not len(axes):
        return MeanAxis(absent, absent, "", absent, None)
    matrix = axes[:, :, None] * axes[:, None, :]
    values, vectors = np.linalg.eigh(matrix.mean(axis=0))
    values = np.maximum(values[::-1], 0.0)
    counts = np.bincount(labels)
    without, several = None, len(counts) > 1
    if several:
        sums = np.zeros((len(counts), 3, 3))
        np.add.at(sums, labels, matrix)
        without = (matrix.sum(axis=0) - sums) / (len(axes) - counts)[:, None, None]
        variance = np.sum((without - matrix.mean(axis=0)) ** 2)
        alone = (1.0 - np.sum(values**2)) / len(axes)
        worth = len(axes) * min(alone / variance, 1.0) if variance > MAX_PARALLEL_VARIANCE else float(len(axes))
    else:
        worth = 1.0
    strength = 7.5 * worth * np.sum((values - 1.0 / 3.0) ** 2)
    shape = UNIFORM if chi_square_tail(strength, 5) > MAX_CHANCE_OF_PATTERN else CLUSTER
    found = MeanAxis(absent, values, shape, absent, None)
    if shape == UNIFORM:
        return found
    first, second, third = values
    if found.woodcock < 1.0 and 2.0 * (second - third) > first - second:
        return MeanAxis(absent, values, GIRDLE, point_down(vectors[:, 0]), None)
    mean = point_down(vectors[:, 2])
    scatter = None
    if blocks_known and without is not None:
        moved = np.linalg.eigh(without)[1][..., 2]
        moved *= np.where(moved @ mean < 0, -1.0, 1.0)[:, None]  # axes have no sense
        scatter = Scatter.of(moved, mean, max(effective_blocks(counts) - 1.0, 1.0))
    return MeanAxis(mean, values, CLUSTER, absent, scatter)
