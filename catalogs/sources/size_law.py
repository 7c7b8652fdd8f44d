"""Do sizes follow a power law, one that ends at the largest event, or none? Tested before any b is quoted.

The largest distance between the distribution found and the one fitted is compared with what catalogues of the fitted
law give when they are fitted again (Lilliefors 1969; the parametric bootstrap of Clauset, Shalizi and Newman 2009): as
the parameters come from the same sizes, the tables of Kolmogorov and Smirnov would let nearly every law pass. That
distance is insensitive to the few events that an upper end removes, so an unbounded law must also explain how small the
largest event is.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalogs.sources.completeness import truncated_beta
from catalogs.sources.sizes import MIN_EVENTS_FOR_B, above

POWER, TRUNCATED, NONE, FEW = "power law", "truncated power law", "no power law", "too few events"
SIGNIFICANCE_LEVEL = 0.05  # A law with a smaller p-value is rejected.
UNROUNDED_BIN_WIDTH = 0.02  # Bins of log10 potency in which sizes that are not rounded are compared.


@dataclass(frozen=True)
class Law:
    """Law of sizes above a cut: its name, and for either law the probability of as bad a fit if that law held."""

    name: str
    power_p_value: float
    truncated_p_value: float


def find_law(x: NDArray, cut: float, bin_width: float, resamplings: int, generator: np.random.Generator) -> Law:
    """The first of power law and truncated power law that sizes from `cut` on do not reject at SIGNIFICANCE_LEVEL.

    x: log10 P; cut: of rounded sizes (bin_width > 0) the lower edge of a bin. The p-value of the power law is twice the
    smaller (Bonferroni) of that of the distance and of the largest event; that of the truncated law, whose bound is
    the largest event, is of the distance of all other events.

    Sizes of a power law, and the same without the largest thirty:

    >>> x = -2 - np.log10(1 - (np.arange(100) + 0.5) / 100)
    >>> find_law(x, cut=-2, bin_width=0, resamplings=199, generator=np.random.default_rng(1)).name
    'power law'
    >>> find_law(x[:70], cut=-2, bin_width=0, resamplings=199, generator=np.random.default_rng(1)).name
    'truncated power law'
    """
    x = above(x, cut)
    width = bin_width or UNROUNDED_BIN_WIDTH
    number = np.floor((x - cut) / width + 1e-9).astype(int)
    if len(number) < MIN_EVENTS_FOR_B or number.max() == 0:
        return Law(FEW, np.nan, np.nan)
    count, excess = len(number), float(number.mean())
    beta = np.log1p(1 / excess) / width
    bins = max(number.max(), int(np.log(1e3 * count) / (beta * width))) + 2  # beyond: a thousandth of an event
    share = -np.diff(np.append(np.exp(-beta * width * np.arange(bins)), 0.0))
    counts = np.bincount(number, minlength=bins)
    drawn = generator.multinomial(count, share, size=resamplings)
    with np.errstate(divide="ignore"):  # all in the lowest bin: of infinite rate
        rate = np.log1p(1 / (drawn @ np.arange(bins) / count)) / width
    p_value = _chance(
        _distance(counts[None], np.array([beta]), width, bins + 1), _distance(drawn, rate, width, bins + 1)
    )
    smaller = (-np.expm1(-beta * width * (number.max() + 1))) ** count
    power = min(1.0, 2 * min(p_value, smaller))

    last = int(number.max())
    others = np.bincount(number, minlength=last + 1)
    others[last] -= 1
    bounded = truncated_beta(np.array([others @ np.arange(last + 1) / (count - 1)]), np.array([last + 1]), width)[0]
    weight = np.exp(-bounded[0] * width * np.arange(last + 1))
    drawn = generator.multinomial(count - 1, weight / weight.sum(), size=resamplings)
    rate = truncated_beta(drawn @ np.arange(last + 1) / (count - 1), np.full(resamplings, last + 1), width)[0]
    truncated = _chance(_distance(others[None], bounded, width, last + 1), _distance(drawn, rate, width, last + 1))
    name = POWER if power >= SIGNIFICANCE_LEVEL else TRUNCATED if truncated >= SIGNIFICANCE_LEVEL else NONE
    return Law(name, power, truncated)


def _distance(counts: NDArray, beta: NDArray, width: float, bins: int) -> NDArray:
    """Largest distance (catalogue,) between the counts' distribution and that of the law over `bins` bins."""
    upper = np.arange(1, counts.shape[1] + 1)
    rate = np.where(np.abs(beta) < 1e-9, 1e-9, beta)[:, None] * width
    expected = np.expm1(-rate * upper) / np.expm1(-rate * bins)
    return np.abs(np.cumsum(counts, axis=1) / counts.sum(axis=1, keepdims=True) - expected).max(axis=1)


def _chance(found: NDArray, drawn: NDArray) -> float:
    return float((1 + np.sum(drawn >= found[0] - 1e-12)) / (len(drawn) + 1))
