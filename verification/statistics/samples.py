"""Simulated catalogues whose statistics are known."""

import numpy as np
from numpy.typing import NDArray

LN10 = np.log(10.0)


def simulated_sizes(
    generator: np.random.Generator, count: int, b: float, span: float = np.inf, bin_width: float = 0.0
) -> NDArray:
    """log10 sizes (count,) above 0 with slope b, cut off at `span`, put on bins: each the lower edge of its bin."""
    x = -np.log1p(-generator.random(count) * -np.expm1(-b * LN10 * span)) / (b * LN10)
    return np.floor(x / bin_width) * bin_width if bin_width else x


def clustered_locations(
    generator: np.random.Generator, clusters: int, sizes: list[int], apart: float = 30.0, spread: float = 10.0
) -> tuple[NDArray, NDArray]:
    """Locations (event, 3) m and cluster (event,) of a new draw of one process.

    Centres are normal with standard deviation `apart` in each coordinate, events around them with `spread`; a cluster
    holds a Poisson number of events, at least one, whose mean is one of `sizes` at random.
    """
    counts = np.maximum(1, generator.poisson(generator.choice(sizes, clusters)))
    labels = np.repeat(np.arange(clusters), counts)
    centre = apart * generator.normal(size=(clusters, 3))
    return centre[labels] + spread * generator.normal(size=(len(labels), 3)), labels
