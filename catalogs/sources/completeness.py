"""The size from which a catalogue is complete, and the effect of that choice on b.

x is log10 of potency in m3. Sizes are counted in bins: those they are rounded to, or bins of the search. The number of
events and their mean excess above every cut then follow from the counts alone, and a thousand resampled catalogues are
searched at once.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.sizes import LN10, MIN_EVENTS_FOR_B

# Bins of log10 potency for the search where sizes are not rounded. It is 0.07 of Mw; 0.1 is usual.
SEARCH_BIN_WIDTH = 0.1
B_STABILITY_LAG = 0.3  # b at a cut is compared with b at a cut that is larger by this much of log10 potency.
# Distance of log10 potency from where b stops climbing to the cut, since detection is incomplete there. It is 0.3 of
# Mw.
MARGIN_ABOVE_STABLE_B = 0.4
MIN_EVENTS_ABOVE_CUT = 30  # Events at the larger of the two cuts. Of 150 events two thirds may be left out.
MAX_B_CLIMB = 1.0  # Standard errors by which b may climb over B_STABILITY_LAG.
# Bins of log10 potency that count as rounding. Finer ones make no difference to b.
MIN_ROUNDING_WIDTH, MAX_ROUNDING_WIDTH = 0.02, 1.0


def rounding(x: NDArray) -> float:
    """Width of the bins that sizes are rounded to, log10 P: 0.15 for Mw to one decimal; 0 where they are not.

    Rounded: all lie a whole number of the smallest gap apart, and half as many values as events at most differ.
    """
    x = np.asarray(x, float)
    x = x[np.isfinite(x)]
    values = np.unique(np.round(x, 6))
    if len(values) < 2 or len(values) > len(x) / 2:
        return 0.0
    gaps = np.diff(values)
    gaps = gaps[gaps > 1e-4]  # what arithmetic makes of one number
    if not gaps.size or not MIN_ROUNDING_WIDTH <= gaps.min() <= MAX_ROUNDING_WIDTH:
        return 0.0
    count = np.round((values - values[0]) / gaps.min())
    width = (values[-1] - values[0]) / count[-1]
    even = np.abs((values - values[0]) / width - count).max() < 0.02
    return float(np.round(width, 4)) if even else 0.0


def completeness(x: NDArray, bin_width: float = 0.0) -> float:
    """Size from which the catalogue is complete; NaN if there is none. Of rounded sizes a bin's lower edge.

    The lowest cut at which b does not climb by more than MAX_B_CLIMB standard errors over the next B_STABILITY_LAG (b
    stability: Cao and Gao 2002; the error is that of nested samples, whose variances subtract), MIN_EVENTS_ABOVE_CUT
    events left; and MARGIN_ABOVE_STABLE_B more, as detection that fades leaves a deficit too small for any test
    (Woessner and Wiemer 2005 add 0.2 of Mw). b is that of a law which may end at the largest event: an upper end makes
    the other climb, too.
    """
    x = np.asarray(x, float)
    x = x[np.isfinite(x)]
    if not x.size:
        return np.nan
    counts, edge, width = _counted(x, bin_width)
    cut = _chosen(counts[None], width)[0]
    return float(edge + cut * width) if cut >= 0 else np.nan


def fullest_bin(x: NDArray, bin_width: float = 0.0) -> float:
    """Lower edge of the bin with the most events (maximum curvature, Wiemer and Wyss 2000): smaller events are missing.

    NaN with fewer than MIN_EVENTS_ABOVE_CUT events: among bins of two or three events the fullest is so by chance.
    """
    x = np.asarray(x, float)
    x = x[np.isfinite(x)]
    if x.size < MIN_EVENTS_ABOVE_CUT:
        return np.nan
    counts, edge, width = _counted(x, bin_width)
    return float(edge + np.argmax(counts) * width)


def next_edge(x: NDArray, cut: float, bin_width: float) -> float:
    """The lowest lower edge of a bin, at `cut` or above, of sizes rounded to bins; of others `cut` itself."""
    if not bin_width or not np.isfinite(cut) or not np.isfinite(x).any():
        return cut
    edge = np.nanmin(x) - 0.5 * bin_width
    return float(edge + np.ceil((cut - edge) / bin_width - 1e-6) * bin_width)


def interval(x: NDArray, bin_width: float, bounded: bool, resamplings: int, generator: np.random.Generator) -> NDArray:
    """95 % interval (2,) of b over catalogues resampled event by event, each with a cut of its own choice.

    bounded: b of the law that ends at the largest event (that event left out). NaN if most have no cut.
    """
    x = np.asarray(x, float)
    x = x[np.isfinite(x)]
    if not x.size:
        return np.full(2, np.nan)
    counts, _, width = _counted(x, bin_width)
    drawn = generator.multinomial(len(x), counts / len(x), size=resamplings)
    cuts = _chosen(drawn, width)
    drawn, cuts = drawn[cuts >= 0], cuts[cuts >= 0]
    if len(cuts) < resamplings / 2:
        return np.full(2, np.nan)
    chosen = np.arange(len(cuts)), cuts
    with np.errstate(divide="ignore", invalid="ignore"):
        beta = _bounded(drawn, width)[1][chosen] if bounded else np.log1p(1 / _excess(drawn)[1][chosen]) / width
    return np.quantile(beta[np.isfinite(beta)] / LN10, INTERVAL_95)


@lru_cache(maxsize=512)
def _bounded_law(bins: int, width: float) -> tuple[NDArray, NDArray, NDArray]:
    """Mean and variance of bins 0 to bins - 1, weighted exp(-beta width bin), in bins, against falling beta."""
    rates = np.linspace(60.0, -60.0, 2001) / (bins * width)
    number = np.arange(bins)
    weight = -np.outer(rates, number * width)
    weight = np.exp(weight - weight.max(axis=1, keepdims=True))
    weight /= weight.sum(axis=1, keepdims=True)
    mean = weight @ number
    return mean, weight @ number**2 - mean**2, rates


def truncated_beta(excess: NDArray, bins: NDArray, width: float) -> tuple[NDArray, NDArray]:
    """Rate beta (n,) at which the mean of bins 0 to bins - 1, weighted exp(-beta width bin), is `excess` (n,) bins.

    Then the Fisher information of one event on it. NaN where there is one bin only.
    """
    found, information = np.full((2, len(excess)), np.nan)
    for count in np.unique(bins[bins > 1]):
        mean, variance, rates = _bounded_law(int(count), width)
        here = bins == count
        found[here] = np.interp(excess[here], mean, rates)
        information[here] = np.interp(excess[here], mean, variance) * width**2
    return found, information


def _counted(x: NDArray, bin_width: float) -> tuple[NDArray, float, float]:
    """Events per bin, the lower edge of the first bin, and the width of bins."""
    width = bin_width or SEARCH_BIN_WIDTH
    edge = x.min() - 0.5 * width if bin_width else np.floor(x.min() / width + 1e-9) * width
    return np.bincount(np.floor((x - edge) / width + 1e-9).astype(int)), float(edge), width


def _excess(counts: NDArray) -> tuple[NDArray, NDArray]:
    """Events in each bin or above (catalogue, bin), and their mean distance from that bin, in bins."""
    number = np.arange(counts.shape[1])
    count = np.cumsum(counts[:, ::-1], axis=1)[:, ::-1].astype(float)
    total = np.cumsum((counts * number)[:, ::-1], axis=1)[:, ::-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        return count, total / count - number


def _bounded(counts: NDArray, width: float) -> tuple[NDArray, NDArray, NDArray]:
    """Events, beta and its variance above each cut (catalogue, bin), if sizes end at the largest (Page 1968)."""
    row, bins = np.arange(len(counts)), counts.shape[1]
    last = bins - 1 - np.argmax(counts[:, ::-1] > 0, axis=1)
    counts = counts.copy()
    counts[row, last] -= 1
    count, excess = _excess(counts)
    length = last[:, None] - np.arange(bins) + 1
    beta, information = (one.reshape(counts.shape) for one in truncated_beta(excess.ravel(), length.ravel(), width))
    with np.errstate(divide="ignore", invalid="ignore"):
        return count, beta, 1 / (count * information)


def _chosen(counts: NDArray, width: float) -> NDArray:
    """Number of the bin that is the cut (catalogue,); -1 without one."""
    lag, margin = max(1, round(B_STABILITY_LAG / width)), max(1, round(MARGIN_ABOVE_STABLE_B / width))
    if counts.shape[1] <= lag:
        return np.full(len(counts), -1)
    count, beta, variance = _bounded(counts, width)
    with np.errstate(invalid="ignore"):
        drift = np.sqrt(np.maximum(variance[:, lag:] - variance[:, :-lag], 0.0))
        level = (beta[:, lag:] - beta[:, :-lag] <= MAX_B_CLIMB * drift) & (count[:, lag:] >= MIN_EVENTS_ABOVE_CUT)
    cut = np.minimum(np.argmax(level, axis=1) + margin, counts.shape[1] - 1)
    enough = np.take_along_axis(count, cut[:, None], axis=1)[:, 0] >= MIN_EVENTS_FOR_B
    return np.where(level.any(axis=1) & enough, cut, -1)
