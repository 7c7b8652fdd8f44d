"""Periods of a schedule, which are the steps of its mine: months, quarters and weeks."""

import bisect
from collections.abc import Sequence
from typing import NamedTuple

import pandas as pd

from workflow.mine_settings import Step

DAY = pd.Timedelta(days=1)
NEXT = {  # From the beginning of one period to that of the next one.
    "month": pd.offsets.MonthBegin(),
    "quarter": pd.offsets.QuarterBegin(startingMonth=1),
    "week": 7 * DAY,
}
BEGINNING = NEXT | {"week": pd.offsets.Week(weekday=0)}  # Weeks begin on Monday where the mine's file begins no period.


class Period(NamedTuple):
    """A period: its name, its first day, and the first day after it."""

    name: str
    start: pd.Timestamp
    end: pd.Timestamp

    def step(self) -> Step:
        """The step of a mine that the period is. Raises InputErrors for a name that no step may have."""
        dates = {key: f"{day:%Y-%m-%d}" for key, day in (("start", self.start), ("end", self.end))}
        return Step.of({"name": self.name, **dates})


def calendar_periods(
    kind: str, days: Sequence[pd.Timestamp], start: pd.Timestamp | None = None, end: pd.Timestamp | None = None
) -> list[Period]:
    """Calendar months, quarters, or weeks, in order and without gaps. The first begins at `start` and the last ends at
    `end`, in whatever part of a month that is; none where the end is not after the start.

    days: days that are mined in. start: None for the beginning of the period of the first day. end: None for the end of
    the period of the last day.
    """
    if start is None and days:
        start = BEGINNING[kind].rollback(min(days))
    last = end - DAY if end is not None else max(days, default=None)
    if start is None or last is None or last < start:
        return []
    starts = [start]
    while (following := starts[-1] + NEXT[kind]) <= last:
        starts.append(following)
    ends = [*starts[1:], following if end is None else end]
    return [Period(_name(kind, *pair), *pair) for pair in zip(starts, ends, strict=True)]


def _name(kind: str, start: pd.Timestamp, _: pd.Timestamp) -> str:
    if kind == "quarter":
        return f"{start:%Y}-Q{start.quarter}"
    return f"{start:%Y-%m}" if kind == "month" else f"{start:%Y-%m-%d}"


def period_of(day: pd.Timestamp, periods: Sequence[Period]) -> Period | None:
    """The period of ordered ones that a day lies in; None for a day outside of all."""
    place = bisect.bisect_right(periods, day, key=lambda period: period.start) - 1
    return periods[place] if place >= 0 and day < periods[place].end else None


def first_after(day: pd.Timestamp, earliest: pd.Timestamp, periods: Sequence[Period]) -> Period | None:
    """The first of ordered periods that begins after a day and no earlier than another day; None if none does."""
    return next((period for period in periods if period.start > day and period.start >= earliest), None)
