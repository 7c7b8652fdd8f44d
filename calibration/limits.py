"""Signs that the truth lies where no trial can reach: beyond the end of a range, or with another law of sizes.

Either sign is a test. Its p-value is the share of records, made with values within the ranges, that show as much.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear
from scipy.stats import norm

from calibration.fit import Fit
from calibration.recorded import as_of, slope
from calibration.trials import SIZES, Discrepancy

MAX_BEYOND_CHANCE = 0.05  # p-value up to which the record is said to point beyond a range.
MAX_B_CHANCE = 0.025  # p-value up to which the record is said to have another b than the model.
DIFFERENCE = 0.1  # Share of a range over which slopes of the outputs are taken.
DRAWS = 400  # Records that are made for a p-value, and points of the posterior.


@dataclass(frozen=True)
class BeyondRange:
    """Test of whether values beyond the ranges fit the record better than all within.

    improvement: standard deviations by which they fit better, by outputs that are linear about the nearest point
    within; p_value: share of records of values within the ranges with as large an improvement; ends: number of each
    quantity whose value lies on an end of its range, and -1 (lower end) or 1 (upper end).
    """

    improvement: float
    p_value: float
    ends: dict[int, int]

    @property
    def is_told(self) -> bool:
        """True if chance alone hardly shows as much."""
        return self.p_value <= MAX_BEYOND_CHANCE


def beyond_range(fit: Fit, seed: int) -> BeyondRange:
    """Test of whether the record points beyond the ranges.

    Outputs are linear about the best point within the ranges. There, the sum of squared differences from the record has
    a minimum within the ranges and one without regard to them; the improvement is the root of what the first exceeds
    the second by. Records for the p-value are drawn at points of the posterior.
    """
    best = fit.posterior.points[np.argmax(fit.log_likelihood(fit.posterior.points))]
    ahead, behind = (
        np.clip(best + DIFFERENCE * np.eye(len(best)), 0, 1),
        np.clip(best - DIFFERENCE * np.eye(len(best)), 0, 1),
    )
    at = np.concatenate([best[None], ahead, behind])
    mean, deviation = fit.expected(at)
    found = fit.likelihood.differences(mean, deviation)
    if not found.off.shape[1]:  # places alone
        return BeyondRange(0.0, 1.0, {})
    quantities = len(best)
    widths = np.diag(ahead - behind)
    slopes = (found.off[1 + quantities :] - found.off[1 : 1 + quantities]).T / widths  # recorded less expected
    factor = np.linalg.cholesky(found.covariance[0])
    effects, off = np.linalg.solve(factor, slopes), np.linalg.solve(factor, found.off[0])
    improvement, ends = _improvement(effects, off, best)

    generator = np.random.default_rng(seed)
    made = fit.posterior.draws(DRAWS, seed)
    noise = generator.standard_normal((DRAWS, len(off)))
    by_chance = [
        _improvement(effects, effects @ (point - best) + chance, best)[0]
        for point, chance in zip(made, noise, strict=True)
    ]
    return BeyondRange(improvement, float(np.mean(np.array(by_chance) >= improvement)), ends)


def _improvement(effects: NDArray, off: NDArray, start: NDArray) -> tuple[float, dict[int, int]]:
    """Root of the sum of squares that leaving the unit cube saves, and the quantities that an end holds back.

    effects (value, quantity), off (value,): of values with a standard deviation of one; start (quantity,): point at
    which `off` is taken.
    """
    free = np.linalg.lstsq(effects, off, rcond=None)[0]
    if ((start + free >= 0.0) & (start + free <= 1.0)).all():
        return 0.0, {}
    held = lsq_linear(effects, off, (-start - 1e-9, 1.0 - start + 1e-9), method="bvls")  # the quickest for few values
    saved = 2.0 * held.cost - float(np.sum((off - effects @ free) ** 2))
    ends = {number: int(side) for number, side in enumerate(held.active_mask) if side}
    return float(np.sqrt(max(saved, 0.0))), ends


@dataclass(frozen=True)
class SizeLaw:
    """Slope b of log10 potency of the record, the model's interval (90 %) for such a record, and their p-value."""

    recorded: float
    modelled: tuple[float, float]
    p_value: float

    @property
    def is_told(self) -> bool:
        """True if chance alone hardly shows such a difference."""
        return self.p_value <= MAX_B_CHANCE


def compare_b(fit: Fit, seed: int) -> SizeLaw:
    """Test of whether the calibrated model has the record's b, whether or not sizes count.

    b is that of a power law with the mean size above the cut; of no event there is no test. The prediction contains the
    uncertainty of the posterior and of the cells, and chance: that of a run or that of a mean of as many events as
    recorded, whichever is larger. Errors of plan and stress change numbers and potency, and hardly the law of sizes.
    """
    likelihood, number = fit.likelihood, int(fit.recorded.number.sum())
    if not number:
        return SizeLaw(np.nan, (np.nan, np.nan), 1.0)
    mean, deviation = fit.expected(fit.posterior.draws(DRAWS, seed))
    column = likelihood.columns[SIZES].start
    cells = likelihood.correction.errors.get(SIZES, Discrepancy()).covariance(1)[0, 0]
    chance = max(likelihood.chance[column] ** 2, fit.recorded.size_covariance[-1, -1])
    variance = deviation[:, column] ** 2 + chance + cells
    modelled = likelihood.modelled_count(mean)
    fewer = np.minimum(modelled, number)
    expected = as_of(mean[:, column], modelled, fewer)
    off = as_of(fit.recorded.log_excess, number, fewer) - expected
    p_value = 2.0 * min(float(norm.cdf(off / np.sqrt(variance)).mean()), float(norm.sf(off / np.sqrt(variance)).mean()))
    drawn = expected + np.sqrt(variance) * np.random.default_rng(seed).standard_normal(len(mean))
    low, high = np.quantile(slope(drawn, fewer), [0.05, 0.95], method="nearest")
    return SizeLaw(float(slope(fit.recorded.log_excess, number)), (float(low), float(high)), min(p_value, 1.0))
