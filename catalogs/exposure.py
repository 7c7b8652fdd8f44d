"""How long a catalogue was recorded, and rates and sums per day of it, with days on which nothing happened.

The time both catalogues share is that of the dated steps during which was recorded. A record does not say when it was
switched on: where its first event comes later than chance allows, it begins with that event's day; so at its end.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalogs.settings import DatedStep

DAY = np.timedelta64(86400 * 10**9, "ns")
SILENCE = np.log(100.0)  # mean waiting times: a longer silence has a chance of 1 % if days with events are random
LEAST_DAYS = 4  # with events, for an interval
TAILS = (0.025, 0.975)


def recorded_period(time: NDArray) -> tuple[np.datetime64, np.datetime64]:
    """First and last instant (UTC, ns) of recording, from the times of all events of a file, NaT ignored.

    Whole days from the first to the last event, and on either side as much silence as chance may leave. Of fewer than
    two days with events the silence is without bounds: all of time.
    """
    time = np.asarray(time, "datetime64[ns]")
    days = np.unique(time[~np.isnat(time)].astype("datetime64[D]"))
    if len(days) < 2:
        return np.datetime64("1678-01-01", "ns"), np.datetime64("2261-12-31", "ns")
    wait = int(np.ceil(SILENCE * (days[-1] - days[0]).astype(int) / (len(days) - 1)))
    return (days[0] - wait).astype("datetime64[ns]"), (days[-1] + 1 + wait).astype("datetime64[ns]")


@dataclass(frozen=True)
class Exposure:
    """The parts of the dated steps, in order, during which both catalogues are known: starts and ends (step,), ns."""

    start: NDArray
    end: NDArray

    @classmethod
    def of(cls, steps: tuple[DatedStep, ...], common: tuple[str, str] | None) -> "Exposure":
        """The dated steps, cut to the common period (ISO text) if it is known."""
        start, end = (np.array([getattr(one, key) for one in steps], "datetime64[ns]") for key in ("start", "end"))
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

    def sums(self, time: NDArray, values: NDArray, block_days: float) -> NDArray:
        """Sum of values (event,) over each block of `block_days` days (block,), those without events included."""
        time = np.asarray(time, "datetime64[ns]")
        length = np.timedelta64(round(block_days * 86400e9), "ns")
        parts = zip(self.start, self.end, strict=True)
        if not len(self.start):
            known = time[~np.isnat(time)]
            parts = [(known.min(), known.max() + np.timedelta64(1, "ns"))] if known.size else []
        found = [np.empty(0)]
        for start, end in parts:
            count = int(np.ceil((end - start) / length))
            inside = (time >= start) & (time < end)
            found.append(np.bincount((time[inside] - start) // length, values[inside], minlength=count))
        return np.concatenate(found)


def total_interval(sums: NDArray, resamplings: int, generator: np.random.Generator) -> NDArray:
    """95 % interval (2,) of the sum expected over blocks like these (block,); NaN with too few of them.

    Blocks, empty ones too, are drawn with replacement, and the logarithm of the sum is divided by its own standard
    error in every draw (bootstrap-t: Efron and Tibshirani 1993, 12.5): sums of few or large events are so skew that
    quantiles of the drawn sums themselves would hold too little.
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
    low, high = np.quantile(centred[np.isfinite(centred)], TAILS)
    return sums.sum() * np.exp(-own * np.array([high, low]))
