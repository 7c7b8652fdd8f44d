"""Sizes that follow a power law with an upper end, of which neither the slope nor the end is known.

x is log10 of potency in m3. Above a cut c the excess x - c is exponential with the rate beta = b ln 10, and ends at
M - c. Of n sizes above the cut the likelihood is

  L(beta, M) = (beta / (1 - exp(-beta (M - c))))^n exp(-beta sum(x - c)),   M at least the largest of them.

The posterior is that of a uniform prior of beta, and of M up to a cap that physics sets. Of sizes that are rounded to
bins of a width w, 2 sinh(beta w / 2) stands in place of beta, and M lies above the last bin.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.size_law import POWER
from catalogs.sources.sizes import LN10

B_RANGE = (0.05, 3.0)  # of log potency; b of magnitude is 1.5 times as large
MAX_DRAWN = 1000  # Events whose sizes are drawn one by one.
POINTS = 200  # of the grid, along each of beta and M
DRAWS = 4000  # of `largest_interval`
ROOM = 1.0  # log10 m3 above the largest event seen, within which the law of `largest_interval` may end.


@dataclass(frozen=True)
class TruncatedLaw:
    """Draws of the law: rate beta (draw,) and upper end M (draw,), log10 m3, above a cut."""

    cut: float
    rate: NDArray
    bound: NDArray

    def share_above(self, size: ArrayLike) -> NDArray:
        """Share of the events that are as large as a size (...,), log10 m3, or larger: (..., draw).

        NaN for a size below the cut: the law says nothing of how many events there are."""
        size = np.asarray(size, float)[..., None]
        excess = size - self.cut
        whole = -np.expm1(-self.rate * (self.bound - self.cut))
        above = np.exp(-self.rate * excess) - np.exp(-self.rate * (self.bound - self.cut))
        return np.where(excess < 0.0, np.nan, np.where(size < self.bound, above / whole, 0.0))

    def _size(self, share: NDArray, draw: NDArray) -> NDArray:
        """Sizes (n,) of draws (n,), log10 m3, at these shares of all sizes below them."""
        rate = self.rate[draw]
        return self.cut - np.log1p(share * np.expm1(-rate * (self.bound[draw] - self.cut))) / rate

    def sizes(self, number: NDArray, generator: np.random.Generator) -> tuple[NDArray, NDArray]:
        """Summed potency (m3) and largest size (log10 m3; -inf without an event) of so many events (draw,) each.

        Of more than MAX_DRAWN events so many are drawn; the sum is scaled by their number, and the largest of the
        others is drawn by itself.
        """
        drawn = np.minimum(number, MAX_DRAWN).astype(int)
        draw = np.repeat(np.arange(len(number)), drawn)
        size = self._size(generator.random(len(draw)), draw)
        largest = np.full(len(number), -np.inf)
        np.maximum.at(largest, draw, size)
        more = np.flatnonzero(number > drawn)
        others = self._size(generator.random(len(more)) ** (1.0 / (number - drawn)[more]), more)
        largest[more] = np.maximum(largest[more], others)
        return np.bincount(draw, 10.0**size, minlength=len(number)) * number / np.maximum(drawn, 1), largest


def draw_law(
    x: NDArray,
    cut: float,
    cap: float,
    draws: int,
    generator: np.random.Generator,
    width: float = 0.0,
    weight: float = 1.0,
) -> TruncatedLaw:
    """Draws of the posterior given the sizes x (event,) above the cut; module docstring.

    cut: of rounded sizes (width > 0) the lower edge of a bin; cap: largest upper end, log10 m3, not used where it is
    below the largest size; weight: how many independent sizes each counts as, since runs share events.
    """
    excess = np.asarray(x, float) - cut
    last = float(excess.max()) + 0.5 * width
    b, step = np.linspace(*B_RANGE, POINTS, retstep=True)
    rate = b * LN10
    end, length = np.linspace(max(last, 1e-6), max(cap - cut, last, 2e-6), POINTS, retstep=True)
    single = np.log(rate) if not width else np.log(2.0 * np.sinh(0.5 * rate * width))
    normaliser = np.log(-np.expm1(-rate[:, None] * end))
    log_likelihood = weight * (len(excess) * (single[:, None] - normaliser) - rate[:, None] * excess.sum())
    weights = np.exp(log_likelihood - log_likelihood.max()).ravel()
    index = generator.choice(POINTS * POINTS, draws, p=weights / weights.sum())
    row, column = np.divmod(index, POINTS)
    apart = generator.uniform(-0.5, 0.5, size=(2, draws))  # spread over the cells of the grid
    drawn = np.clip(rate[row] + apart[0] * step * LN10, rate[0], rate[-1])
    return TruncatedLaw(cut, drawn, cut + np.clip(end[column] + apart[1] * length, end[0], end[-1]))


def largest_interval(
    x: NDArray, cut: float, law: str, dispersion_index: float, generator: np.random.Generator
) -> NDArray:
    """95 % interval (2,), log10 m3, of the largest event of another catalogue like this one.

    x (event,): sizes from the cut on, log10 m3, not rounded to bins; law: POWER or TRUNCATED of `size_law`, which they
    follow; dispersion_index: variance of their number over its mean. Slope, number and upper end are uncertain. Few
    sizes do not tell a law that ends from one that does not: where the latter stands, the interval is the hull of both.
    """
    expected = dispersion_index * generator.standard_gamma(len(x) / dispersion_index + 0.5, DRAWS)
    if dispersion_index > 1.0:
        expected = (dispersion_index - 1.0) * generator.standard_gamma(expected / (dispersion_index - 1.0))
    number = np.maximum(generator.poisson(expected), 1)  # without an event there is no largest one
    laws = [draw_law(x, cut, float(x.max()) + ROOM, DRAWS, generator)]
    if law == POWER:
        rate = generator.standard_gamma(len(x), DRAWS) / float(np.sum(x - cut))
        laws.append(TruncatedLaw(cut, rate, np.full(DRAWS, np.inf)))
    ends = [np.quantile(one.sizes(number, generator)[1], INTERVAL_95) for one in laws]
    return np.array([min(low for low, _ in ends), max(high for _, high in ends)])
