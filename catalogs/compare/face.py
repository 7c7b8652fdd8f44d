"""A face that moves, and places relative to it.

Between two dated positions of a panel both ends of the face move evenly. Places are taken in plan: *ahead* is the
distance from the line of the face in the direction in which it advances, negative behind it, and *across* that from the
middle of the face, positive toward its second end. A face that is one point advances along its centre line, and across
is positive to the left.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalogs.records.times import parse_time
from catalogs.settings import FacePosition, by_panel

FACE_AXES = ("ahead", "across")


@dataclass(frozen=True)
class Frame:
    """Position of the face at several times: ends (time, 2, xy) m, which coincide if the face is a point, and the unit
    vectors (time, xy) of the directions ahead of and across it. NaN where there is no face."""

    ends: NDArray
    ahead: NDArray
    across: NDArray

    @property
    def middle(self) -> NDArray:
        """Middle of the face (time, xy), m."""
        return self.ends.mean(axis=1)

    def coordinates(self, places: NDArray) -> NDArray:
        """Ahead and across (time, 2), m, of a place at each time, places (time, xy or xyz)."""
        offset = places[:, :2] - self.middle
        return np.stack([np.sum(offset * axis, axis=1) for axis in (self.ahead, self.across)], axis=1)

    def places(self, coordinates: NDArray) -> NDArray:
        """Places in plan (time, xy), m, of ahead and across (time, 2): the inverse of `coordinates`."""
        return self.middle + coordinates[:, :1] * self.ahead + coordinates[:, 1:] * self.across


@dataclass(frozen=True)
class _Panel:
    """One panel: times (position,) ns; ends (position, 2, xy); direction (position - 1, xy) of each advance."""

    time: NDArray
    ends: NDArray
    direction: NDArray

    @classmethod
    def of(cls, positions: Sequence[FacePosition]) -> "_Panel":
        """Panel of positions in order of time, at least two of which differ."""
        time = np.array([parse_time(one.date, "face") for one in positions]).astype("datetime64[ns]")
        ends = np.array([one.ends if one.is_line else (one.ends, one.ends) for one in positions], float)
        moved = np.diff(ends.mean(axis=1), axis=0)
        length = np.linalg.norm(moved, axis=1)
        # where it stands it looks to where it went before, at first to where it goes
        moves = np.flatnonzero(length > 0.0)
        last = moves[np.maximum(np.searchsorted(moves, np.arange(len(length)), side="right") - 1, 0)]
        return cls(time, ends, moved[last] / length[last, None])

    def frame(self, time: NDArray) -> Frame:
        """Position of the face at times (time,) ns within the panel's span, interpolated between its positions."""
        part = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2)
        share = (time - self.time[part]) / (self.time[part + 1] - self.time[part])
        ends = self.ends[part] + share[:, None, None] * (self.ends[part + 1] - self.ends[part])
        direction, line = self.direction[part], ends[:, 1] - ends[:, 0]
        length = np.linalg.norm(line, axis=1, keepdims=True)
        if not length.all():
            return Frame(ends, direction, np.stack([-direction[:, 1], direction[:, 0]], axis=1))
        across = line / length
        normal = np.stack([across[:, 1], -across[:, 0]], axis=1)
        forward = np.sum(normal * direction, axis=1, keepdims=True)
        return Frame(ends, np.where(forward < 0.0, -normal, normal), across)

    def metres(self, start: np.datetime64, end: np.datetime64) -> float:
        """Way of its middle between two times, m."""
        length = np.linalg.norm(np.diff(self.ends.mean(axis=1), axis=0), axis=1)
        overlap = np.minimum(self.time[1:], end) - np.maximum(self.time[:-1], start)
        share = np.maximum(overlap / np.diff(self.time), 0.0)
        return float(np.sum(share * length))


@dataclass(frozen=True)
class Face:
    """The face of a mine. Where the dates of two panels overlap, it is that of the panel that began later."""

    panels: tuple[_Panel, ...]

    @classmethod
    def of(cls, positions: Sequence[FacePosition]) -> "Face":
        """Face of positions that `catalogs.settings` has checked."""
        panels = [_Panel.of(one) for one in by_panel(tuple(positions)).values()]
        return cls(tuple(sorted(panels, key=lambda panel: panel.time[0])))

    def at(self, time: NDArray) -> Frame:
        """Position of the face at times (time,) datetime64; NaN at times outside of every panel's span."""
        time = np.asarray(time, "datetime64[ns]")
        found = Frame(*(np.full((len(time), *shape), np.nan) for shape in ((2, 2), (2,), (2,))))
        for panel in self.panels:
            inside = (time >= panel.time[0]) & (time <= panel.time[-1])
            own = panel.frame(time[inside])
            found.ends[inside], found.ahead[inside], found.across[inside] = own.ends, own.ahead, own.across
        return found

    def metres(self, start: np.datetime64, end: np.datetime64) -> float:
        """Way of the middle of all faces between two times, m."""
        return sum(panel.metres(start, end) for panel in self.panels)
