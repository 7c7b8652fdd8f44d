"""Errors of an estimate from blocks: the jackknife, and Student's t with the effective number of blocks.

Blocks are independent of each other, what is in them is not. The estimate without one block, less the estimate, is
squared and summed (CR3: MacKinnon and White 1985), which holds for blocks of unequal sizes, where a bootstrap of so few
blocks scatters too little. Blocks of shares h_j are worth 1 / sum h_j^2 equal ones (Kish 1965).
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from catalogs.sources.significance import POWER, POWER_DEVIATIONS, TEST_LEVEL

INTERVAL_95 = (0.025, 0.975)  # quantiles of a 95 % interval


@dataclass(frozen=True)
class Scatter:
    """Covariance (3, 3) of an estimate with three components, and the degrees of freedom that it is known with."""

    covariance: NDArray
    freedom: float

    @classmethod
    def of(cls, without: NDArray, estimate: NDArray, freedom: float) -> "Scatter":
        """Scatter of an estimate (3,) from its values without each block (block, 3)."""
        off = without - estimate
        return cls(off.T @ off, freedom)

    def __add__(self, other: "Scatter") -> "Scatter":
        """Scatter of the difference of two independent estimates; degrees of freedom after Welch and Satterthwaite."""
        own, others = np.trace(self.covariance), np.trace(other.covariance)
        both = own**2 / self.freedom + others**2 / other.freedom
        return Scatter(self.covariance + other.covariance, (own + others) ** 2 / both if both > 0 else self.freedom)

    def times(self, factor: float) -> "Scatter":
        """Scatter with a variance that is larger by a factor and known as well."""
        return Scatter(factor * self.covariance, self.freedom)

    def noticed(self, lengths: NDArray) -> float:
        """Length of a true difference that a test at TEST_LEVEL notices with the chance POWER, wherever it points.

        lengths (draw,): errors of the estimate, `lengths`, of which the test takes its limit. The limit varies with the
        scatter found, as chi-square does, and so does this scatter itself: its median stands for the true one.
        """
        spread = scipy.stats.chi2.ppf([0.5, POWER], self.freedom) / self.freedom
        error = np.sqrt(max(np.linalg.eigvalsh(self.covariance)[-1], 0.0))
        limit = np.quantile(lengths, 1.0 - TEST_LEVEL)
        return float((limit * np.sqrt(spread[1]) + POWER_DEVIATIONS * error) / np.sqrt(spread[0]))

    def interval(self, estimate: NDArray, share: float = 0.95) -> NDArray:
        """Interval (3, 2) of each component."""
        half = scipy.stats.t.ppf(0.5 + share / 2, self.freedom) * np.sqrt(np.diag(self.covariance))
        return np.stack([estimate - half, estimate + half], axis=-1)

    def lengths(self, draws: int, generator: np.random.Generator) -> NDArray:
        """Errors of the estimate (draw,): lengths of vectors of Student's t with this covariance."""
        values, vectors = np.linalg.eigh(self.covariance)
        vector = generator.normal(size=(draws, 3)) * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
        return np.linalg.norm(vector, axis=1) * np.sqrt(self.freedom / generator.chisquare(self.freedom, draws))


def effective_blocks(sizes: NDArray) -> float:
    """Effective number of blocks, (sum s)^2 / sum s^2 of their sizes s (block,) (Kish 1965); 0 if all are empty."""
    sizes = np.asarray(sizes, float)
    return float(sizes.sum() ** 2 / np.sum(sizes**2)) if sizes.any() else 0.0
