"""The largest possible event of a period: upper end of the law of sizes, with an interval.

Sizes x = log10 P above a cut follow the exponential law that ends at M (Page 1968):
F(x) = (1 - exp(-beta (x - cut))) / (1 - exp(-beta (M - cut))).

Estimate: the largest size seen plus the mean by which it falls short of M, for n events (Kijko and Sellevoll 1989,
Bull. Seismol. Soc. Am. 79, 645; Kijko 2004, Pure Appl. Geophys. 161, 1655). Interval: exact for a known beta
(Holschneider, Zoeller and Hainzl 2011, Bull. Seismol. Soc. Am. 101, 1649): M is refused where the largest of n events
would be as small as that seen with less than the chance `1 - confidence`. Often no M is refused, however large. Then
the catalogue does not bound the largest possible event, and the interval has no upper end. As beta is estimated, the
law's upper end is the larger one over the interval of beta; so the interval holds the truth a little more often than
stated.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # imports its parts as they are used
from numpy.typing import NDArray

from catalogs.sources.sizes import CONFIDENCE, LN10, estimate_b

MAX_ABOVE = 3.0  # log10 m3 above the largest event within which the estimate is sought.


@dataclass(frozen=True)
class LargestPossible:
    """Largest possible log10 potency: estimate (infinite where it is not bounded), the largest seen, which is the lower
    end of the interval, and its upper end (infinite where there is none); number of events above the cut."""

    estimate: float
    seen: float
    upper: float
    count: int


def mean_shortfall(end: float, cut: float, beta: float, count: int) -> float:
    """Mean of M - (largest of `count` events) for the law that ends at M = end: integral of F^count from cut to M."""
    points = np.linspace(cut, end, 2001)
    with np.errstate(divide="ignore"):
        share = np.expm1(-beta * (points - cut)) / np.expm1(-beta * (end - cut))
    return float(np.trapezoid(share**count, points))


def upper_end(seen: float, cut: float, beta: float, count: int, confidence: float) -> float:
    """Largest M that is not refused; infinite where none is."""
    threshold = (1.0 - confidence) ** (1.0 / count)
    share = -np.expm1(-beta * (seen - cut)) / threshold  # 1 - exp(-beta (M - cut)) at the end of the interval
    return cut - np.log1p(-share) / beta if share < 1.0 else np.inf


def largest_possible(
    sizes: NDArray, cut: float, bin_width: float = 0.0, confidence: float = CONFIDENCE
) -> LargestPossible:
    """The largest possible event of sizes (event,), log10 m3, from `cut` on; NaN with too few events for b.

    bin_width: of sizes that are rounded; the largest may then be half a bin larger.
    """
    values = np.asarray(sizes, float)
    values = values[np.isfinite(values) & (values >= cut - 0.5 * bin_width - 1e-9)]
    found = estimate_b(values, cut, bin_width)
    if not np.isfinite(found.b) or not len(values):
        return LargestPossible(np.nan, np.nan, np.nan, len(values))
    start = cut - 0.5 * bin_width
    seen, count = float(values.max()) + 0.5 * bin_width, len(values)
    bounded = estimate_b(values, cut, bin_width, bound="largest")  # of the law that ends, as the mean size asks for
    beta = LN10 * (bounded.b if np.isfinite(bounded.b) else found.b)
    slopes = [beta, *(LN10 * end for end in (bounded.lower, bounded.upper) if np.isfinite(end))]
    upper = max(upper_end(seen, start, max(slope, 1e-6), count, confidence) for slope in slopes)

    def gap(end: float) -> float:
        return end - mean_shortfall(end, start, max(beta, 1e-6), count) - seen

    far = seen + MAX_ABOVE
    estimate = float(scipy.optimize.brentq(gap, seen, far)) if gap(far) > 0.0 else np.inf
    return LargestPossible(estimate, seen, upper, count)
