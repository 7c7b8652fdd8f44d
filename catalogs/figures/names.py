"""Names of bodies in a panel: within a body where they fit, else beside it with a line to it; none hides another."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.path import Path
from numpy.typing import NDArray

from catalogs.figures import style

WHITE_RIM = [patheffects.withStroke(linewidth=2.2, foreground="white")]
DISTANCES = (5.0, 12.0, 22.0, 36.0, 56.0, 84.0)  # Points between a body and its name.
DIRECTIONS = np.stack([np.cos(angle := np.arange(16) * np.pi / 8), np.sin(angle)], axis=1)
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
GAP = 1.5  # Points around a name that stay free at least.
PLACES_WITHIN = 13  # Places along each side of a body's box that are tried for a name within it.
MAX_ENDS = 12  # Places in a body at which the line to its name may end.
# A name moves so many points farther away rather than onto another event, or wholly onto bodies.
HIDES_POINT, HIDES_BODIES = 12.0, 25.0
DOT = 4.0  # Points from the middle of a dot to its rim.
RASTER = 3.0  # Points; the bodies are known to this when names are placed.


@dataclass(frozen=True)
class Named:
    """A body and its name. curves: closed, (point, 2) in the units of the axes; covers: of bodies drawn over it."""

    name: str
    curves: Sequence[NDArray]
    covers: Sequence[NDArray] = ()


def bodies_named(
    names: Mapping[int, str], order: Sequence[int], curves: Mapping[int, Sequence[NDArray]]
) -> list[Named]:
    """Bodies with these names, the most important first. order: in which bodies are drawn, later ones over earlier
    ones; curves: of each body."""
    place = {index: number for number, index in enumerate(order)}
    drawn = [curve for index in order for curve in curves[index]]
    first = np.cumsum([0, *(len(curves[index]) for index in order)])
    low, high = (np.array([of(curve, axis=0) for curve in drawn]).reshape(-1, 2) for of in (np.min, np.max))
    bodies = []
    for index, name in names.items():
        if index not in place or not curves[index]:
            continue
        start, end = first[place[index] : place[index] + 2]
        meets = low[end:] <= high[start:end].max(axis=0)
        meets &= high[end:] >= low[start:end].min(axis=0)
        covers = [drawn[number] for number in end + np.flatnonzero(meets.all(axis=1))]
        bodies.append(Named(name, curves[index], covers))
    return bodies


def write_names(
    axes: Axes,
    named: Sequence[Named],
    size: float,
    avoid: Sequence[NDArray] = (),
    points: NDArray | None = None,
    most_beside: int = 1000,
    if_covered: bool = False,
) -> list[str]:
    """Write names of bodies, those that come first have the choice; return the names that had room.

    The position and the limits of the axes have to be final. size: of the letters, points; avoid: boxes ((left,
    bottom), (right, top)), pixels, that no name covers; points (point, 2): places, in units of the axes, better left
    uncovered; most_beside: so many names at most stand beside their bodies; if_covered: also name bodies of which
    nothing is seen.
    """
    to_pixels, back = axes.transData.transform, axes.transData.inverted().transform
    covers = {id(curve): curve for one in named for curve in one.covers}  # bodies share them
    paths = {key: Path(to_pixels(curve)) for key, curve in covers.items()}
    shown = [
        _Body(one.name, [to_pixels(curve) for curve in one.curves], [paths[id(curve)] for curve in one.covers])
        for one in named
    ]
    dots = to_pixels(points) if points is not None and len(points) else np.zeros((0, 2))
    panel = _Panel(axes.get_window_extent().get_points(), avoid, dots, axes.figure.dpi / 72, shown)
    written = []
    for one in shown:
        extent = style.text_extent(axes.get_figure(root=True), one.name, size) + 2 * GAP * panel.pixels
        places = one.places(panel.box)
        seen = places[one.is_uncovered(places)]
        if not len(seen) and not if_covered:
            continue
        ends = next((some for some in (seen, places) if len(some)), one.middle[None])
        place, turned = panel.within(one, extent, seen)
        if place is None and most_beside > 0:
            place, end = panel.beside(extent, ends)
            if place is not None:
                most_beside -= 1
                start = np.clip(end, place - extent / 2, place + extent / 2)
                panel.lines.append(start + np.linspace(0, 1, 20)[:, None] * (end - start))
                axes.plot(
                    *back(np.array([start, end])).T, color="k", linewidth=0.6, marker="o", markevery=[1],
                    markersize=2.2, zorder=9, scalex=False, scaley=False, path_effects=WHITE_RIM,
                )  # fmt: skip
        if place is None:
            continue
        half = (extent[::-1] if turned else extent) / 2
        panel.taken.append(np.array([place - half, place + half]))
        written.append(one.name)
        x, y = back(place)
        axes.text(
            x, y, one.name, fontsize=size, ha="center", va="center", zorder=10, path_effects=WHITE_RIM,
            parse_math=False, rotation=90 if turned else 0,
        )  # fmt: skip
    return written


@dataclass(frozen=True)
class _Body:
    """A body in pixels."""

    name: str
    curves: list[NDArray]
    covers: list[Path]

    @cached_property
    def box(self) -> NDArray:
        """Lower and upper corner (2, 2)."""
        points = np.concatenate(self.curves)
        return np.array([points.min(axis=0), points.max(axis=0)])

    @cached_property
    def largest(self) -> NDArray:
        """The curve (point, 2) with the largest box."""
        return max(self.curves, key=lambda curve: float(np.prod(np.ptp(curve, axis=0))))

    @cached_property
    def middle(self) -> NDArray:
        """A point (2,) of the body, its middle where that lies in it."""
        return _middle(self.largest)

    def places(self, panel: NDArray) -> NDArray:
        """Points (point, 2) of the body that lie in a box (2, 2), from its middle outwards."""
        low, high = np.clip(self.box, *panel)
        share = (np.arange(PLACES_WITHIN) + 0.5)[:, None] / PLACES_WITHIN
        columns, rows = (low + share * (high - low)).T
        places = np.concatenate([self.middle[None], np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)])
        kept = Path(self.largest).contains_points(places)
        kept &= ((places >= panel[0]) & (places <= panel[1])).all(axis=1)
        places = places[kept]
        return places[np.argsort(np.linalg.norm(places - self.middle, axis=1), kind="stable")]

    def holds(self, places: NDArray, extent: NDArray) -> NDArray:
        """True (place,) where a name of this extent (2,) is wholly within the body and on no other one."""
        corners = (places[:, None, :] + extent / 2 * CORNERS).reshape(-1, 2)
        inside = Path(self.largest).contains_points(corners) & self.is_uncovered(corners)
        return inside.reshape(-1, 4).all(axis=1)

    def is_uncovered(self, places: NDArray) -> NDArray:
        """True (place,) for places (place, 2) that no other body covers."""
        covered = np.zeros(len(places), bool)
        for cover in self.covers:
            covered |= cover.contains_points(places)
        return ~covered


class _Panel:
    """A panel in pixels: what is taken there.

    box (2, 2): its corners; taken: boxes that nothing may cover; dots (dot, 2): places better left uncovered; pixels:
    of a point.
    """

    def __init__(self, box: NDArray, taken: Sequence[NDArray], dots: NDArray, pixels: float, bodies: Sequence[_Body]):
        self.box, self.taken, self.dots, self.pixels = box, list(taken), dots, pixels
        self.lines: list[NDArray] = []
        """Points (point, 2) of the lines from names to bodies."""
        # Number of places of a raster, left of and below each corner of it, that are in a body.
        step = RASTER * pixels
        columns, rows = (np.arange(low + step / 2, high, step) for low, high in box.T)
        held = np.zeros((len(columns), len(rows)), bool)
        for body in bodies:
            (left, right), (low, high) = (
                np.searchsorted(axis, body.box[:, number]) for number, axis in enumerate((columns, rows))
            )
            inner = np.stack(np.meshgrid(columns[left:right], rows[low:high], indexing="ij"), axis=-1)
            if inner.size:
                inside = Path(body.largest).contains_points(inner.reshape(-1, 2))
                held[left:right, low:high] |= inside.reshape(inner.shape[:2])
        self.held = np.zeros((len(columns) + 1, len(rows) + 1))
        self.held[1:, 1:] = held.cumsum(axis=0).cumsum(axis=1)

    def within(self, body: _Body, extent: NDArray, seen: NDArray) -> tuple[NDArray | None, bool]:
        """Middle (2,) of a name of this extent (2,) at one of the places `seen` in its body, on as few dots as can be,
        and whether it is turned upright; None without room."""
        for turned, size in ((False, extent), (True, extent[::-1])):
            free = [place for place in seen[body.holds(seen, size)] if self._is_free(place, size)]
            if free:
                return min(free, key=lambda place: self._hidden(place, size)), turned
        return None, False

    def beside(self, extent: NDArray, ends: NDArray) -> tuple[NDArray | None, NDArray | None]:
        """Middle (2,) of a name of this extent (2,) beside its body, and that of the `ends` (end, 2) that a line to it
        has; None without room."""
        best, least = (None, None), np.inf
        ends = ends[np.unique(np.linspace(0, len(ends) - 1, MAX_ENDS).astype(int))]
        for distance in DISTANCES:
            if distance >= least:
                break
            for end, direction in itertools.product(ends, DIRECTIONS):
                place = end + direction * distance * self.pixels + np.clip(1.5 * direction, -1, 1) * extent / 2
                if not self._is_free(place, extent):
                    continue
                cost = distance + HIDES_POINT * self._hidden(place, extent) + HIDES_BODIES * self._held(place, extent)
                if cost < least and not self._is_crossed(np.clip(end, place - extent / 2, place + extent / 2), end):
                    best, least = (place, end), cost
        return best

    def _is_free(self, place: NDArray, extent: NDArray) -> bool:
        low, high = place - extent / 2, place + extent / 2
        if not ((low >= self.box[0]).all() and (high <= self.box[1]).all()):
            return False
        if any((low < box[1]).all() and (high > box[0]).all() for box in self.taken):
            return False
        return not any(((line > low) & (line < high)).all(axis=1).any() for line in self.lines)

    def _is_crossed(self, start: NDArray, end: NDArray) -> bool:
        """True if a line from a name to its body passes under another name."""
        line = start + np.linspace(0, 1, 20)[:, None] * (end - start)
        return any(((line > box[0]) & (line < box[1])).all(axis=1).any() for box in self.taken)

    def _hidden(self, place: NDArray, extent: NDArray) -> int:
        """Number of dots that a name touches."""
        return int((np.abs(self.dots - place) < extent / 2 + DOT * self.pixels).all(axis=1).sum())

    def _held(self, place: NDArray, extent: NDArray) -> float:
        """Share of a name that is on bodies."""
        step = RASTER * self.pixels
        corners = (np.array([place - extent / 2, place + extent / 2]) - self.box[0]) / step
        (left, low), (right, high) = np.clip(np.rint(corners).astype(int), 0, np.array(self.held.shape) - 1)
        area = max((right - left) * (high - low), 1)
        held = self.held
        return float(held[right, high] - held[left, high] - held[right, low] + held[left, low]) / area


def _middle(curve: NDArray) -> NDArray:
    """The centroid (2,) of a closed curve (point, 2), or its corner nearest to it where that is outside."""
    centre = curve.mean(axis=0)
    x, y = (curve - centre).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    if abs(cross.sum()) > 1e-9 * max(float(np.prod(np.ptp(curve, axis=0))), 1e-9):
        centre = centre + np.stack([(x + np.roll(x, -1)) @ cross, (y + np.roll(y, -1)) @ cross]) / (3 * cross.sum())
    if Path(curve).contains_point(centre):
        return centre
    return curve[np.argmin(((curve - centre) ** 2).sum(axis=1))]
