"""A profile swept along a polyline: drives, declines, crosscuts.

The path is the centre line of the floor, as surveyed. The profile stands perpendicular to the path with its floor
level across: it never rolls. A bend is mitred: both stretches end in the plane that halves it. There the two meet in
one ring of corners if the path bends in plan or in section alone. If it does both, a level profile cannot follow
without a twist: unless the rings nearly agree, each stretch is a body of its own, and they abut. Where a bend is too
sharp for a mitre, or a stretch too short for its bends, each ends squarely and a little beyond the corner: they
overlap, which changes nothing inside (the winding number there is 2).
"""

import itertools
from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from common.setting_types import AsTuple, Point, Size
from mpm_core.geometry.shapes.shape import Opening, Shape, ShapeError, around

ARCH_SEGMENTS = 24  # of the semicircular roof
MAX_INCLINATION = np.radians(85)  # In steeper drives the heading that keeps the profile level is hardly defined.
# Rings that differ by less than this share of the width become one, the end of the stretch before.
MIN_RING_DISTANCE = 1e-3
MAX_PIECES = 16  # boxes that cover a stretch
MAX_MITRE_ANGLE = np.radians(120)  # The tip of a mitre at this angle is two half widths out.


class Tunnel(Shape):
    """A tunnel by the middle of its floor."""

    POINT_KEYS = ("path",)
    PLAN_SIZES = ("width",)

    path: Annotated[tuple[Point, ...], Field(min_length=2), AsTuple]
    """points along the middle of its floor"""
    width: Size
    """its width"""
    height: Size
    """its height"""
    profile: Literal["rectangular", "arched"] = "rectangular"
    """its cross-section; `arched` has vertical walls and a semicircular roof"""

    def check(self, dimension: int) -> None:
        """Raise ShapeError for a tunnel without length, a stretch too steep for a floor, and an arch too low."""
        super().check(dimension)
        path = self._distinct_points()
        if len(path) < 2:
            raise ShapeError("the same point as where it starts", "path")
        along, _ = _stretches(path)
        steep = np.flatnonzero(np.abs(along[:, 2]) > np.sin(MAX_INCLINATION))
        if len(steep):
            raise ShapeError(
                f"stretch {steep[0] + 1} is too steep for a level floor; use cylinder, box or prism for a shaft", "path"
            )
        if self.profile == "arched" and self.height < self.width / 2:
            raise ShapeError(
                f"an arched profile needs at least half its width, {self.width / 2:g} m, not {self.height:g} m",
                "height",
            )

    def _distinct_points(self) -> np.ndarray:
        """Its path (point, 3) m, no two neighbours alike."""
        path = np.array(self.path, float)
        return path[np.append(True, (np.diff(path, axis=0) != 0).any(axis=1))]

    def extent(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """A box around it with room to spare."""
        return around(np.array(self.path, float), max(self.width, self.height))

    def openings(self, dimension: int) -> Iterator[Opening]:
        """Its stretches."""
        for start, end in itertools.pairwise(self._distinct_points()):
            yield self._opening(start, end)

    def _opening(self, start: np.ndarray, end: np.ndarray) -> Opening:
        """A straight stretch; what it lacks in length its neighbours have."""
        width, height = self.width, self.height
        length = float(np.linalg.norm(end - start))
        count = int(np.clip(length / max(width, height), 1, MAX_PIECES))
        points = start + np.linspace(0, 1, count + 1)[:, None] * (end - start)
        low, high = np.minimum(points[:-1], points[1:]), np.maximum(points[:-1], points[1:])
        # across its run in plan; the floor of a tunnel lies under it
        run = np.abs((end - start)[:2])
        across = 0.5 * width * (run[::-1] / np.linalg.norm(run) if run.any() else np.ones(2))
        parts = np.stack([low - np.append(across, 0.0), high + np.append(across, height)], axis=1)
        sides = np.array([max(length, width, height), width, height])
        return Opening(parts[:, 0].min(axis=0), parts[:, 1].max(axis=0), sides, length * width * height, parts)

    def surface(self, dimension: int) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (v, 3) m and triangles (f, 3), outward, of the profile swept along the path."""
        path, width = self._distinct_points(), self.width
        along, length = _stretches(path)
        outline = _outline(width, self.height, self.profile)
        local = path - path[0]
        across = np.cross(along, [0.0, 0.0, 1.0])
        across /= np.linalg.norm(across, axis=1)[:, None]
        above = np.cross(across, along)
        # the profile's corners from the path, per stretch (stretch, corner, xyz)
        profiles = outline[:, 0, None] * across[:, None, :] + outline[:, 1, None] * above[:, None, :]

        mitred = _mitred(along, length, profiles)
        rings, vertices, facets, count = [], [], [], 0
        for stretch in range(len(along)):
            rings.append(local[stretch] + _end(stretch, -1, mitred, along, profiles, width))
            rings.append(local[stretch + 1] + _end(stretch, 1, mitred, along, profiles, width))
            if stretch < len(along) - 1 and mitred[stretch]:
                ahead = local[stretch + 1] + _end(stretch + 1, -1, mitred, along, profiles, width)
                if np.abs(ahead - rings[-1]).max() < MIN_RING_DISTANCE * width:
                    rings.pop()  # the next stretch's start is this one's end
                    continue
            vertices.append(np.concatenate(rings))
            facets.append(_skin(len(outline), len(rings)) + count)
            count += len(vertices[-1])
            rings = []
        return np.concatenate(vertices) + path[0], np.concatenate(facets)


def _stretches(path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions (stretch, 3) and lengths (stretch,) m between the points (point, 3) m."""
    along = np.diff(path - path[0], axis=0)
    length = np.linalg.norm(along, axis=1)
    return along / length[:, None], length


def _outline(width: float, height: float, profile: str) -> np.ndarray:
    """Corners (corner, 2) m of the profile, across and above the floor's centre, counter-clockwise, convex."""
    half = width / 2
    floor = np.array([[-half, 0.0], [half, 0.0]])
    if profile == "rectangular":
        return np.concatenate([floor, [[half, height], [-half, height]]])
    step = np.pi / ARCH_SEGMENTS
    angle = step * np.arange(ARCH_SEGMENTS + 1)
    # The springing stays on the walls; the points between move out by `grow` until the roof's area is that of the
    # half circle: sin(step) ((n - 2) grow^2 + 2 grow) = pi.
    n = ARCH_SEGMENTS - 2
    grow = (np.sqrt(1 + n * np.pi / np.sin(step)) - 1) / n
    radius = half * np.where((angle > 0) & (np.arange(ARCH_SEGMENTS + 1) < ARCH_SEGMENTS), grow, 1.0)
    roof = np.column_stack([radius * np.cos(angle), height - half + radius * np.sin(angle)])
    roof[[0, -1]] = [[half, height - half], [-half, height - half]]
    return np.concatenate([floor, roof]) if height > half else roof


def _end(
    stretch: int, side: int, mitred: np.ndarray, along: np.ndarray, profiles: np.ndarray, width: float
) -> np.ndarray:
    """Corners (corner, 3) of a stretch's start (side -1) or end (side 1), from the path's point there."""
    joint = stretch if side > 0 else stretch - 1
    if not 0 <= joint < len(mitred):
        return profiles[stretch]
    if mitred[joint]:
        return _mitre(stretch, joint, along, profiles)
    beyond = width / 2
    if along[joint] @ along[joint + 1] > 0:  # as far as a mitre's tip; at a sharper turn as far as a square one's
        beyond = (side * _mitre(stretch, joint, along, profiles) @ along[stretch]).max()
    return profiles[stretch] + side * beyond * along[stretch]


def _mitre(stretch: int, joint: int, along: np.ndarray, profiles: np.ndarray) -> np.ndarray:
    """Corners (corner, 3) from the path's point: the stretch's profile moved along it to the plane halving the bend."""
    normal = along[joint] + along[joint + 1]
    return profiles[stretch] - np.outer(profiles[stretch] @ normal / (along[stretch] @ normal), along[stretch])


def _mitred(along: np.ndarray, length: np.ndarray, profiles: np.ndarray) -> np.ndarray:
    """(point - 2,) bool: True where an inner point gets a mitre: not too sharp, and the cuts of one stretch do not
    cross."""
    mitred = np.arccos(np.clip((along[:-1] * along[1:]).sum(axis=1), -1.0, 1.0)) <= MAX_MITRE_ANGLE
    for stretch in range(len(along)):
        # how far each corner's edge begins after the stretch's start and ends before its end
        begins = ends = np.zeros(profiles.shape[1])
        if stretch > 0 and mitred[stretch - 1]:
            begins = _mitre(stretch, stretch - 1, along, profiles) @ along[stretch]
        if stretch < len(mitred) and mitred[stretch]:
            ends = -_mitre(stretch, stretch, along, profiles) @ along[stretch]
        if (begins + ends >= length[stretch]).any():
            mitred[max(stretch - 1, 0) : stretch + 1] = False
    return mitred


def _skin(corners: int, rings: int) -> np.ndarray:
    """Triangles of the closed surface over convex rings, counter-clockwise looking back along the path."""
    here = np.arange(corners)
    ahead = np.roll(here, -1)
    strip = np.concatenate(
        [np.column_stack([here, ahead, ahead + corners]), np.column_stack([here, ahead + corners, here + corners])]
    )
    fan = np.column_stack([np.zeros(corners - 2, dtype=np.int64), here[1:-1], here[2:]])
    strips = [strip + ring * corners for ring in range(rings - 1)]
    return np.concatenate([fan[:, ::-1], *strips, fan + (rings - 1) * corners])
