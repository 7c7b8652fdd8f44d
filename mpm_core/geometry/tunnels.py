"""A profile swept along a polyline: drives, declines, crosscuts.

The path is the centre line of the floor, as surveyed. The profile stands perpendicular to the path with its floor
level across: it never rolls. A bend is mitred: both stretches end in the plane that halves it. Where a bend is too
sharp for that, or a stretch too short for its bends, each stretch ends squarely and a little beyond the corner; they
overlap, which changes nothing inside (the winding number there is 2).
"""

from collections.abc import Callable

import numpy as np

ARCH_SEGMENTS = 24  # of the semicircular roof
STEEPEST = np.radians(85)  # beyond it the heading that keeps the profile level is hardly defined
SHARPEST_MITRE = np.radians(120)  # a mitre's tip reaches 2 half widths out there


def sweep_tunnel(
    path: np.ndarray, width: float, height: float, profile: str, fail: Callable[[str, str], Exception]
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) m and triangles (f, 3), outward, of a tunnel along path (point, 3) m, no two neighbours alike.

    profile: `rectangular`, or `arched`: vertical walls, semicircular roof, height at the crown, at least width / 2.
    `fail(key, problem)` makes the exception to raise for an unknown profile, a low arch or a steep stretch.
    """
    outline = _outline(width, height, profile, fail)
    local = path - path[0]
    along = np.diff(local, axis=0)
    length = np.linalg.norm(along, axis=1)
    along /= length[:, None]
    steep = np.flatnonzero(np.abs(along[:, 2]) > np.sin(STEEPEST))
    if len(steep):
        raise fail(
            "path", f"stretch {steep[0] + 1} is too steep for a level floor; use cylinder, box or prism for a shaft"
        )
    across = np.cross(along, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across, axis=1)[:, None]
    above = np.cross(across, along)
    # the profile's corners from the path, per stretch (stretch, corner, xyz)
    profiles = outline[:, 0, None] * across[:, None, :] + outline[:, 1, None] * above[:, None, :]

    mitred = _mitred(outline, along, length, profiles)
    pieces, first = [], 0
    for joint in range(1, len(path)):
        if joint < len(path) - 1 and mitred[joint - 1]:
            continue
        pieces.append((first, joint))
        first = joint
    vertices, facets, count = [], [], 0
    for first, last in pieces:
        rings = [_square_end(local[first], along, profiles, first, -1.0, width)]
        rings += [local[j] + _mitre(j - 1, along, profiles) for j in range(first + 1, last)]
        rings.append(_square_end(local[last], along, profiles, last - 1, 1.0, width))
        vertices.append(np.concatenate(rings))
        facets.append(_skin(len(outline), len(rings)) + count)
        count += len(vertices[-1])
    return np.concatenate(vertices) + path[0], np.concatenate(facets)


def _outline(width: float, height: float, profile: str, fail: Callable[[str, str], Exception]) -> np.ndarray:
    """Corners (corner, 2) m of the profile, across and above the floor's centre, counter-clockwise, convex."""
    half = width / 2
    floor = np.array([[-half, 0.0], [half, 0.0]])
    if profile == "rectangular":
        return np.concatenate([floor, [[half, height], [-half, height]]])
    if profile != "arched":
        raise fail("profile", f"{profile!r} is not one of rectangular, arched")
    if height < half:
        raise fail("height", f"an arched profile needs at least half its width, {half:g} m, not {height:g} m")
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


def _mitre(joint: int, along: np.ndarray, profiles: np.ndarray) -> np.ndarray:
    """Corners (corner, 3) from the path's point, in the plane that halves the bend between stretches joint, joint + 1.

    Both profiles are moved along their own stretch to that plane. They meet there if the path bends in plan or in
    section; if in both, they differ by the little that a level profile must twist, and the mean is taken.
    """
    normal = along[joint] + along[joint + 1]
    moved = [profiles[j] - np.outer(profiles[j] @ normal / (along[j] @ normal), along[j]) for j in (joint, joint + 1)]
    return (moved[0] + moved[1]) / 2


def _mitred(outline: np.ndarray, along: np.ndarray, length: np.ndarray, profiles: np.ndarray) -> np.ndarray:
    """Whether each inner point (point - 2,) gets a mitre: not too sharp, and the cuts of one stretch do not cross."""
    cosine = np.clip((along[:-1] * along[1:]).sum(axis=1), -1.0, 1.0)
    mitred = np.arccos(cosine) <= SHARPEST_MITRE
    for stretch in range(len(along)):
        # how far each corner's edge is cut back at the start, or reaches in at the end, of this stretch
        start, end = np.zeros(len(outline)), np.zeros(len(outline))
        if stretch > 0 and mitred[stretch - 1]:
            start = _mitre(stretch - 1, along, profiles) @ along[stretch]
        if stretch < len(along) - 1 and mitred[stretch]:
            end = _mitre(stretch, along, profiles) @ along[stretch]
        if (start - end >= length[stretch]).any():
            if stretch > 0:
                mitred[stretch - 1] = False
            if stretch < len(mitred):
                mitred[stretch] = False
    return mitred


def _square_end(
    point: np.ndarray, along: np.ndarray, profiles: np.ndarray, stretch: int, side: float, width: float
) -> np.ndarray:
    """Corners (corner, 3) of a square end at `point`; at a bend, moved beyond it to close the notch outside the bend.

    side: -1 at the stretch's start, 1 at its end.
    """
    neighbour = stretch + int(side)
    beyond = 0.0
    if 0 <= neighbour < len(along):
        beyond = width / 2
        if along[stretch] @ along[neighbour] > 0:  # as far as a mitre's tip; at a sharper turn as far as a square one's
            beyond = (side * _mitre(min(stretch, neighbour), along, profiles) @ along[stretch]).max()
    return point + profiles[stretch] + side * beyond * along[stretch]


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
