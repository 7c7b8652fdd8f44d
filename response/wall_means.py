"""The mean of a measure over a wall, and its interval where neighbouring points are alike.

Points of a wall are no independent samples: an overhang of five metres is seen by hundreds of rays. The wall is
divided into blocks. Their means are taken as a Gaussian field (Cressie 1993) with a covariance that falls with the
distance, as exp(-r / l) of rough walls or as (1 + r / l) exp(-r / l) of smoother ones (Matern's class), and of which
the correlation length l and the variance are not known. Each of some lengths, with each of the two forms, gives the
area's mean a Student distribution, whose scale follows from the covariances of the blocks. The interval is that of
their mixture, weighted by the restricted likelihood of each (Diggle and Ribeiro 2007).
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import brentq
from scipy.spatial.distance import cdist
from scipy.stats import t as student

LEVEL = 0.95
HALVINGS = 7  # Of a wall into blocks: at most 128 of them.
POINTS_PER_BLOCK = 4  # Points of a block by which its covariances are found.
MIN_POINTS = 2
LENGTHS = np.geomspace(0.005, 0.5, 10)  # Correlation lengths in question, in sizes of the wall.
SMOOTHNESS = (0.0, 1.0)  # Share of r / l in the covariance: rough and smoother walls.
ROUND_OFF = 1e-6  # Of a variance, so that matrices of smooth fields can be inverted.
SMALLEST = 1e-9  # m; values that differ by less do not differ.


def mean_and_interval(values: NDArray, place: NDArray, weight: NDArray) -> tuple[float, float, float]:
    """Weighted mean of values (n,) m at places (n, xyz) m of a wall, and the ends of its 95 % interval.

    The interval holds the mean of the process that made the wall, of which the wall is one sample. It is NaN with one
    value; without any, so is the mean.
    """
    if len(values) < MIN_POINTS:
        return (float(values[0]) if len(values) else np.nan), np.nan, np.nan
    order = np.lexsort(place.T)  # so that blocks do not depend on the order of the points
    values, place, weight = values[order], place[order], weight[order]
    block = divide(place)
    total = np.bincount(block, weight)
    means = np.bincount(block, weight * values) / total
    mean = float(np.average(values, weights=weight))
    if np.ptp(means) <= SMALLEST:
        return mean, mean, mean
    half = _half_width(means, total / total.sum(), place, block)
    return mean, mean - half, mean + half


def divide(place: NDArray) -> NDArray:
    """Block (n,) of each place (n, xyz): halved HALVINGS times across the longest side, each half with as many points;
    no block has none."""
    block = np.zeros(len(place), np.int64)
    for _ in range(HALVINGS):
        order = np.argsort(block, kind="stable")
        for own in np.split(order, np.flatnonzero(np.diff(block[order])) + 1):
            along = place[own, np.ptp(place[own], axis=0).argmax()]
            upper = own[np.argsort(along, kind="stable")[len(own) // 2 :]]
            block[own] *= 2
            block[upper] += 1
    return np.unique(block, return_inverse=True)[1]


def _half_width(means: NDArray, weight: NDArray, place: NDArray, block: NDArray) -> float:
    """Half of the interval of the weighted mean of blocks' means (block,); weight (block,) sums to 1."""
    count = len(means)
    order = np.argsort(block, kind="stable")
    size = np.bincount(block)
    first, taken = np.cumsum(size) - size, np.minimum(size, POINTS_PER_BLOCK)
    owner = np.repeat(np.arange(count), taken)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(taken) - taken, taken)
    chosen = order[first[owner] + ((number + 0.5) / taken[owner] * size[owner]).astype(np.int64)]
    apart = cdist(place[chosen], place[chosen])
    averaging = np.zeros((count, len(chosen)))
    averaging[owner, np.arange(len(chosen))] = 1.0 / taken[owner]
    likelihood, scale = (np.empty(len(LENGTHS) * len(SMOOTHNESS)) for _ in range(2))
    lengths = LENGTHS * np.linalg.norm(np.ptp(place, axis=0))
    for row, (length, smooth) in enumerate(product(lengths, SMOOTHNESS)):
        covariance = averaging @ ((1.0 + smooth * apart / length) * np.exp(-apart / length)) @ averaging.T
        covariance[np.diag_indices(count)] *= 1.0 + ROUND_OFF
        factor = cho_factor(covariance, lower=True)
        ones = cho_solve(factor, np.ones(count))
        left = means - means @ ones / ones.sum()
        squares = left @ cho_solve(factor, left)
        determinant = 2.0 * np.log(np.diag(factor[0])).sum()
        likelihood[row] = -0.5 * (determinant + np.log(ones.sum()) + (count - 1) * np.log(squares))
        scale[row] = np.sqrt(weight @ covariance @ weight * squares / (count - 1))
    share = np.exp(likelihood - likelihood.max())
    share /= share.sum()

    def beyond(half: float) -> float:
        """Probability within so much of the mean, less LEVEL."""
        return float(share @ (2.0 * student.cdf(half / scale, count - 1) - 1.0)) - LEVEL

    return float(brentq(beyond, 0.0, scale.max() * student.ppf(0.5 + 0.5 * LEVEL, count - 1) * 1.01))
