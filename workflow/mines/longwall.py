"""Slices of a longwall between its dated faces: the steps of a period, and the caved ground that each of them leaves.

A face is known at some dates. Between two of them it is taken to advance evenly.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

from common.errors import InputError

WEEK = pd.Timedelta(days=7)
HISTORY = "history"


@dataclass(frozen=True)
class Panel:
    """A panel by its dated faces: date (face,) s since 1970, ascending; tailgate, headgate (face, 2) m, ends of the
    face."""

    name: str
    date: np.ndarray
    tailgate: np.ndarray
    headgate: np.ndarray

    def face(self, date: float) -> tuple[np.ndarray, np.ndarray]:
        """Tailgate and headgate end (2,) m of the face at a date, s since 1970; the first or last one beyond these."""
        ends = (self.tailgate, self.headgate)
        tailgate, headgate = (np.array([np.interp(date, self.date, part) for part in end.T]) for end in ends)
        return tailgate, headgate

    def advance(self, dates: np.ndarray) -> np.ndarray:
        """Advance (k,) m of the middle of the face since the first face, at dates (k,), s since 1970."""
        middle = 0.5 * (self.tailgate + self.headgate)
        length = np.linalg.norm(np.diff(middle, axis=0), axis=1)
        return np.interp(dates, self.date, np.concatenate([[0.0], np.cumsum(length)]))


class Slice(NamedTuple):
    """A part of the period, which is a step of its name."""

    name: str
    start: pd.Timestamp
    end: pd.Timestamp


class Advance(NamedTuple):
    """Part of a panel mined between two dates: its name, the step that mines it, and its outline in plan (4, 2) m."""

    name: str
    step: str
    polygon: np.ndarray


def seconds(date: pd.Timestamp) -> float:
    """A date in seconds since 1970."""
    return (date - pd.Timestamp(0)).total_seconds()


def slices_of(
    panels: Sequence[Panel], start: pd.Timestamp, end: pd.Timestamp, by: Literal["month", "week"] | float
) -> list[Slice]:
    """The slices of a period, in order and without gaps: calendar months, weeks from its start on, or equal advances of
    about `by` metres. Raises InputError for a period that no faces are dated in, or in which none moves."""
    first = pd.Timestamp(min(panel.date[0] for panel in panels), unit="s")
    last = pd.Timestamp(max(panel.date[-1] for panel in panels), unit="s")
    if start >= end:
        raise InputError(f"excavations_from.end: {end:%Y-%m-%d} is not after start {start:%Y-%m-%d}")
    for key, date in (("start", start), ("end", end)):
        if not first <= date <= last:
            raise InputError(
                f"excavations_from.{key}: {date:%Y-%m-%d}, but faces are dated from {first:%Y-%m-%d} to {last:%Y-%m-%d}"
            )
    dates = np.unique(np.concatenate([*(panel.date for panel in panels), [seconds(start), seconds(end)]]))
    dates = dates[(dates >= seconds(start)) & (dates <= seconds(end))]
    advance = np.sum([panel.advance(dates) for panel in panels], axis=0)
    length = advance[-1] - advance[0]
    if not length > 0.0:
        raise InputError(f"excavations_from: no face moves from start {start:%Y-%m-%d} to end {end:%Y-%m-%d}")
    if by == "month":
        inner = list(pd.date_range(start.normalize(), end, freq="MS", inclusive="neither"))
        names = [f"{date:%Y-%m}" for date in [start, *inner]]
    elif by == "week":
        inner = list(pd.date_range(start + WEEK, end, freq=WEEK, inclusive="left"))
        names = [f"{date:%Y-%m-%d}" for date in [start, *inner]]
    else:
        distance = np.linspace(0.0, length, max(round(length / by), 1) + 1)[:-1]
        inner = [
            pd.Timestamp(date, unit="s").round("min") for date in np.interp(distance[1:], advance - advance[0], dates)
        ]
        names = [f"{metres:04.0f}_m" for metres in distance]
    return [Slice(*row) for row in zip(names, [start, *inner], [*inner, end], strict=True)]


def advances(panels: Sequence[Panel], slices: Sequence[Slice]) -> Iterator[Advance]:
    """Parts of panels mined up to the end of the last slice, panel by panel, cut at dated faces and at slices' ends.

    Parts mined before the first slice belong to the step `history`.
    """
    cuts = np.array([seconds(date) for date in (slices[0].start, *(part.end for part in slices))])
    for panel in panels:
        inner = cuts[(cuts > panel.date[0]) & (cuts < panel.date[-1])]
        dates = np.unique(np.concatenate([panel.date, inner]))
        dates = dates[dates <= cuts[-1]]
        for begin, end in itertools.pairwise(dates):
            (tailgate, headgate), (next_tailgate, next_headgate) = panel.face(begin), panel.face(end)
            place = int(np.searchsorted(cuts, begin, side="right")) - 1
            date = pd.Timestamp(begin, unit="s")
            yield Advance(
                f"panel_{panel.name}_{date:%Y-%m-%d}" + (f"_{date:%H%M}" if date != date.normalize() else ""),
                HISTORY if place < 0 else slices[place].name,
                np.array([tailgate, next_tailgate, next_headgate, headgate]),
            )
