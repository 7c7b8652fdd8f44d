"""How far a scanned void reaches beyond the walls of the design, along their normals."""

from collections.abc import Iterator

import igl
import numpy as np
from numpy.typing import NDArray

from mpm_core.geometry.solids import Solid
from mpm_core.geometry.winding import winding_number_of

NUDGE = 1e-5  # m by which rays are moved aside, so that they do not run along edges of facets.
NOT_ALONG = np.array([0.3, 0.5, 0.7])  # Added to a direction with its axes exchanged: never along the direction.
LINES_AT_ONCE = 20_000  # Their hits are lists, which take a kilobyte for each line.
AT_WALL = 1e-3  # m within which a scan and the design are the same.
MIN_SIGHT = np.sin(np.radians(5.0))  # A surface that lies along a line of sight within this angle closes a shadow.


def reach_of_void(solid: Solid, place: NDArray, normal: NDArray, stations: NDArray | None = None) -> NDArray:
    """Distance (point,) m from points of a design to the wall of a scanned void along their normals.

    place, normal (point, xyz), normals into the rock. Positive: the void reaches beyond the design. NaN where no wall
    of the void is met, and where it lies along the lines of sight of all stations (k, xyz).

    A point in the void (winding number above 1/2) counts the surfaces that it leaves and enters on its way into the
    rock until it has left the void. A point in rock goes the other way, until it has entered it.
    """
    center = solid.bounds.mean(axis=0)
    corners = solid.corners(center)
    if solid.signed_volume < 0.0:
        corners = corners[:, ::-1]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(facing, axis=1)
    facing = facing / np.where(length > 0.0, length, 1.0)[:, None]
    shown = _shown(corners.mean(axis=1) + center, facing, stations)
    winding_number = winding_number_of(corners)
    before, beyond = (
        np.round(np.abs(winding_number(place - center + aside * normal))).astype(int) for aside in (-AT_WALL, AT_WALL)
    )  # a point on the surface itself is on neither side of it
    reach = np.full(len(place), np.nan)
    for number, (distance, facet) in enumerate(_hits(corners, place - center, normal)):
        inside, start = (before[number], -AT_WALL) if before[number] > 0 else (beyond[number], AT_WALL)
        outwards = inside > 0
        along = distance if outwards else -distance
        adds = np.where((facing[facet] @ normal[number] > 0.0) == outwards, -1, 1)  # to the winding number on the way
        order = np.argsort(along)
        order = order[along[order] > start]
        last = np.append(np.diff(along[order]) > AT_WALL, True)[: len(order)]  # surfaces at one place count together
        around = inside + np.cumsum(adds[order])
        changed = np.flatnonzero(last & (around <= 0 if outwards else around != 0))[:1]
        found = order[changed]
        if len(found) and (outwards or around[changed[0]] > 0) and shown[facet[found[0]]]:
            reach[number] = distance[found[0]]
    return np.where(np.abs(reach) < AT_WALL, 0.0, reach)


def entry_behind(solid: Solid, place: NDArray, normal: NDArray) -> NDArray:
    """Distance (point,) m, negative, from points on the walls of a design to its opposite wall, against their normals;
    minus infinity where there is none."""
    center = solid.bounds.mean(axis=0)
    found = np.full(len(place), -np.inf)
    for number, (distance, _) in enumerate(_hits(solid.corners(center), place - center, normal)):
        behind = distance[distance < -AT_WALL]
        if len(behind):
            found[number] = behind.max()
    return found


def _hits(corners: NDArray, place: NDArray, direction: NDArray) -> Iterator[tuple[NDArray, NDArray]]:
    """Of each line through a point, along a unit vector: distances (k,) m from the point to the facets that it meets,
    and these facets (k,). A line that meets two facets in their common edge meets one of them."""
    vertices = np.ascontiguousarray(corners.reshape(-1, 3))
    facets = np.arange(len(vertices), dtype=np.int64).reshape(-1, 3)
    aside = np.cross(direction, np.roll(direction, 1, axis=1) + NOT_ALONG)
    aside *= NUDGE / np.maximum(np.linalg.norm(aside, axis=1), NUDGE)[:, None]
    before = 1.01 * float(np.linalg.norm(np.ptp(np.concatenate([vertices, place]), axis=0)))
    tree = igl.AABB()
    tree.init(vertices, facets)
    start = place + aside - before * direction
    for first in range(0, len(place), LINES_AT_ONCE):
        some = slice(first, first + LINES_AT_ONCE)
        ends = (np.ascontiguousarray(part[some]) for part in (start, direction))
        for hits in tree.intersect_ray(vertices, facets, *ends):
            yield np.array([hit[1] for hit in hits], float) - before, np.array([hit[0] for hit in hits], np.int64)


def _shown(middle: NDArray, facing: NDArray, stations: NDArray | None) -> NDArray:
    """True (facet,) for facets with these middles and unit normals (facet, xyz) that do not lie along the line of sight
    of every station (k, xyz)."""
    if stations is None:
        return np.ones(len(middle), bool)
    sight = middle[:, None] - stations[None]
    along = np.einsum("fki,fi->fk", sight, facing) / np.linalg.norm(sight, axis=2)
    return (along > MIN_SIGHT).any(axis=1)
