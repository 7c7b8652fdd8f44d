"""How long a catalogue was recorded, and rates and sums per day of it, with days on which nothing happened.

The time both catalogues share is that of the dated steps during which was recorded (`catalogs.periods`).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, t

from catalogs.records.times import parse_time
from catalogs.settings import DatedStep

DAY = np.timedelta64(86400 * 10**9, "ns")
LEAST_DAYS = 10  # with events, for an interval: fewer have not seen what large events they may have
TAILS = (0.025, 0.975)


@dataclass(frozen=True)
class Exposure:
    """The parts of the dated steps, in order, during which both catalogues are known: starts and ends (step,), ns."""

    start: NDArray
    end: NDArray

    @classmethod
    def of(cls, steps: tuple[DatedStep, ...], common: tuple[str, str] | None) -> "Exposure":
        """The dated steps, cut to the common period (ISO text) if it is known."""
        windows = [window(one.model_dump()) for one in steps]
        start, end = np.array(windows, "datetime64[ns]").reshape(-1, 2).T
        if common:
            first, last = (np.datetime64(text, "ns") for text in common)
            start, end = np.clip(start, first, last), np.clip(end, first, last)
        return cls(start, end)

    @property
    def days(self) -> float:
        """Days of exposure; NaN without dated steps."""
        return float(np.sum((self.end - self.start) / DAY)) if len(self.start) else np.nan

    def step(self, time: NDArray) -> NDArray:
        """Number of the step of each event (event,); -1 outside of all. Without dated steps 0: all are of one."""
        time = np.asarray(time, "datetime64[ns]")
        if not len(self.start):
            return np.zeros(len(time), np.int64)
        inside = (time[:, None] >= self.start) & (time[:, None] < self.end)
        return np.where(inside.any(axis=1), np.argmax(inside, axis=1), -1)

    def sums(self, time: NDArray, values: NDArray) -> NDArray:
        """Sum of values (event,) over each day of exposure (day,), those without events included."""
        time = np.asarray(time, "datetime64[ns]")
        parts = zip(self.start, self.end, strict=True)
        if not len(self.start):
            known = time[~np.isnat(time)]
            parts = [(known.min(), known.max() + np.timedelta64(1, "ns"))] if known.size else []
        found = [np.empty(0)]
        for start, end in parts:
            count = int(np.ceil((end - start) / DAY))
            inside = (time >= start) & (time < end)
            found.append(np.bincount((time[inside] - start) // DAY, values[inside], minlength=count))
        return np.concatenate(found)


def window(step: Mapping[str, str]) -> tuple[np.datetime64, np.datetime64]:
    """Start and end of a dated step (UTC, ns), from its ISO texts."""
    return tuple(parse_time(step[key], f"step {key}") for key in ("start", "end"))


def total_interval(sums: NDArray, resamplings: int, generator: np.random.Generator) -> NDArray:
    """95 % interval (2,) of the sum expected over blocks like these (block,); NaN with too few of them.

    Blocks, empty ones too, are drawn with replacement, and the logarithm of the sum is divided by its own standard
    error in every draw (bootstrap-t: Efron and Tibshirani 1993, 12.5): sums of few or large events are so skew that
    quantiles of the drawn sums themselves would hold too little. A few large events stand for a tail that was hardly
    seen; what they say is worth no more than (sum)^2 / sum of squares equal ones (Kish 1965), and the interval is
    stretched as Student's t of so many is over the normal distribution, less one degree each for the sum and the worth.
    """
    count = len(sums)
    if np.count_nonzero(sums) < LEAST_DAYS:
        return np.full(2, np.nan)
    weights = generator.multinomial(count, np.full(count, 1 / count), size=resamplings).astype(float)
    total = weights @ sums
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.sqrt(np.maximum(weights @ sums**2 - total**2 / count, 0.0)) / total
        centred = (np.log(total) - np.log(sums.sum())) / error
    own = np.sqrt(np.sum((sums - sums.mean()) ** 2)) / sums.sum()
    worth = max(sums.sum() ** 2 / np.sum(sums**2), 3.0)
    stretch = t.ppf(TAILS[1], worth - 2) / norm.ppf(TAILS[1])
    low, high = np.quantile(centred[np.isfinite(centred)], TAILS)
    return sums.sum() * np.exp(-stretch * own * np.array([high, low]))
