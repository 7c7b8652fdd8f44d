"""A profile swept along a polyline: drives, declines, crosscuts.

The path is the centre line of the floor, as surveyed. The profile stands perpendicular to the path with its floor
level across: it never rolls. A bend is mitred: both stretches end in the plane that halves it. There the two meet in
one ring of corners if the path bends in plan or in section alone. If it does both, a level profile cannot follow
without a twist: unless the rings nearly agree, each stretch is a body of its own, and they abut. Where a bend is too
sharp for a mitre, or a stretch too short for its bends, each ends squarely and a little beyond the corner: they
overlap, which changes nothing inside (the winding number there is 2).
"""

from collections.abc import Callable

import numpy as np

ARCH_SEGMENTS = 24  # of the semicircular roof
STEEPEST = np.radians(85)  # beyond it the heading that keeps the profile level is hardly defined
SAME_RING = 1e-3  # of the width: rings that differ by less become one, the end of the stretch before
SHARPEST_MITRE = np.radians(120)  # a mitre's tip reaches 2 half widths out there


def sweep_tunnel(
    path: np.ndarray, width: float, height: float, profile: str, fail: Callable[[str, str], Exception]
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) m and triangles (f, 3), outward, of a tunnel along path (point, 3) m, no two neighbours alike.

    profile: `rectangular`, or `arched`: vertical walls, semicircular roof, height at the crown, at least width / 2.
    `fail(key, problem)` makes the exception to raise for an unknown profile, a low arch or a steep stretch.
    """
    along, length = stretches(path, fail)
    outline = _outline(width, height, profile, fail)
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
            if np.abs(ahead - rings[-1]).max() < SAME_RING * width:
                rings.pop()  # the next stretch's start is this one's end
                continue
        vertices.append(np.concatenate(rings))
        facets.append(_skin(len(outline), len(rings)) + count)
        count += len(vertices[-1])
        rings = []
    return np.concatenate(vertices) + path[0], np.concatenate(facets)


def stretches(path: np.ndarray, fail: Callable[[str, str], Exception]) -> tuple[np.ndarray, np.ndarray]:
    """Directions (stretch, 3) and lengths (stretch,) m between the points (point, 3) m; raises for a steep one."""
    along = np.diff(path - path[0], axis=0)
    length = np.linalg.norm(along, axis=1)
    along /= length[:, None]
    steep = np.flatnonzero(np.abs(along[:, 2]) > np.sin(STEEPEST))
    if len(steep):
        raise fail(
            "path", f"stretch {steep[0] + 1} is too steep for a level floor; use cylinder, box or prism for a shaft"
        )
    return along, length


def check_arch(width: float, height: float, profile: str, fail: Callable[[str, str], Exception]) -> None:
    """Raise for an arch that is lower than half its width."""
    if profile == "arched" and height < width / 2:
        raise fail("height", f"an arched profile needs at least half its width, {width / 2:g} m, not {height:g} m")


def _outline(width: float, height: float, profile: str, fail: Callable[[str, str], Exception]) -> np.ndarray:
    """Corners (corner, 2) m of the profile, across and above the floor's centre, counter-clockwise, convex."""
    half = width / 2
    floor = np.array([[-half, 0.0], [half, 0.0]])
    if profile == "rectangular":
        return np.concatenate([floor, [[half, height], [-half, height]]])
    if profile != "arched":
        raise fail("profile", f"{profile!r} is not one of rectangular, arched")
    check_arch(width, height, profile, fail)
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
    """Whether each inner point (point - 2,) gets a mitre: not too sharp, and the cuts of one stretch do not cross."""
    mitred = np.arccos(np.clip((along[:-1] * along[1:]).sum(axis=1), -1.0, 1.0)) <= SHARPEST_MITRE
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
