"""Parts of a solid of equal volume, cut by upright planes across the direction in which it is mined.

A cut is closed by triangles from a point in its plane to each edge of the cut. They are a surface of the right winding
number whatever the outline of the cut is: where it is not convex, they overlap in pairs that cancel each other.
"""

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for

from common.errors import InputError
from mpm_core.geometry.solids import Solid, unique_rows

LEVEL_ERROR = 1e-14  # Of the place of a plane, as a share of the solid's length.
MARGIN = 1e-6  # Beyond the solid, as a share of its length.
MIN_PART_VOLUME = 1e-9  # Of a part, over the volume of the cube around the solid.


def part_of(solid: Solid, number: int, count: int, bearing: float) -> Solid:
    """Part `number` (from 1) of `count` parts of a solid in the order in which they are mined.

    bearing: direction of advance, degrees clockwise from y, seen from above. The planes are such that each part has the
    same share of the sum over the facets (Solid.signed_volume). Raises InputError for a solid that has no such parts.
    """
    angle = np.radians(bearing)
    direction = np.array([np.sin(angle), np.cos(angle), 0.0])
    origin = solid.bounds.mean(axis=0)
    mesh = solid.vertices - origin, solid.facets.astype(np.int64)
    whole = solid.signed_volume
    if abs(whole) < MIN_PART_VOLUME * np.ptp(solid.bounds, axis=0).max() ** 3:
        raise InputError(f"{solid.name}: its surface adds up to no volume, so that it has no parts: export it closed")
    if number < count:
        mesh = _cut(*mesh, direction, _level(*mesh, direction, number / count * whole), keeps_below=True)
    if number > 1:
        full = solid.vertices - origin, solid.facets.astype(np.int64)
        mesh = _cut(*mesh, direction, _level(*full, direction, (number - 1) / count * whole), keeps_below=False)
    used, facets = np.unique(mesh[1], return_inverse=True)
    vertices, place = unique_rows(mesh[0][used])
    return Solid(solid.name, vertices + origin, place[facets.reshape(-1, 3)])


def _level(vertices: np.ndarray, facets: np.ndarray, direction: np.ndarray, volume: float) -> float:
    """Distance along `direction` (3,) of the plane below which a mesh has `volume`, m3, of its sign."""
    heights = (vertices @ direction)[facets]

    def missing(level: float) -> float:
        below = _cut(vertices, facets, direction, level, keeps_below=True, is_closed=False)
        # Tetrahedra to a point in the plane: what closes the cut adds nothing.
        return float(np.linalg.det((below[0] - level * direction)[below[1]]).sum()) / 6.0 - volume

    # Just beyond the solid, as corners in the plane count as above it.
    bounds = np.array([heights.min(), heights.max()]) + np.ptp(heights) * np.array([-MARGIN, MARGIN])
    return float(scipy.optimize.brentq(missing, *bounds, xtol=LEVEL_ERROR * np.ptp(bounds), rtol=LEVEL_ERROR))


def _cut(
    vertices: np.ndarray,
    facets: np.ndarray,
    direction: np.ndarray,
    level: float,
    keeps_below: bool,
    is_closed: bool = True,
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) and triangles (f, 3) on one side of the plane x . direction = level, which lies above.

    is_closed: whether the cut is closed. Both sides have the same vertices in the plane.
    """
    height = vertices @ direction - level
    kept = (height < 0.0) == keeps_below
    count = kept[facets].sum(axis=1)
    one, two = (_from_lone_corner(facets[count == number], kept, number == 1) for number in (1, 2))
    crossings = np.concatenate([one[:, [0, 1]], one[:, [0, 2]], two[:, [0, 1]], two[:, [0, 2]]])
    key, place = np.unique(crossings.min(axis=1) * len(vertices) + crossings.max(axis=1), return_inverse=True)
    edges = np.column_stack(np.divmod(key, len(vertices)))
    first, last = vertices[edges[:, 0]], vertices[edges[:, 1]]
    share = (height[edges[:, 0]] / (height[edges[:, 0]] - height[edges[:, 1]]))[:, None]
    places = np.where(share == 1.0, last, first + share * (last - first))
    place = place.reshape(-1) + len(vertices)
    after_one, before_one, after_two, before_two = np.split(place, np.cumsum([len(one), len(one), len(two)]))
    made = [
        facets[count == 3],
        np.column_stack([one[:, 0], after_one, before_one]),
        np.column_stack([after_two, two[:, 1], two[:, 2]]),
        np.column_stack([after_two, two[:, 2], before_two]),
    ]
    vertices = np.concatenate([vertices, places])
    if is_closed:
        # The edges of the cut, the other way round than the triangles above pass them.
        rim = np.concatenate([np.column_stack([before_one, after_one]), np.column_stack([after_two, before_two])])
        vertices, cap = _cap(vertices, rim)
        made.append(cap)
    return vertices, np.concatenate(made)


def _from_lone_corner(facets: np.ndarray, kept: np.ndarray, is_kept: bool) -> np.ndarray:
    """Triangles (f, 3) that begin with their only corner that is kept, or is not."""
    first = (kept[facets] == is_kept).argmax(axis=1)
    return np.take_along_axis(facets, (first[:, None] + np.arange(3)) % 3, axis=1)


def _cap(vertices: np.ndarray, rim: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The vertices (v, 3) with a middle for each outline that edges (e, 2) have, and the triangles to it."""
    if not len(rim):
        return vertices, np.zeros((0, 3), dtype=np.int64)
    used, ends = np.unique(rim, return_inverse=True)
    ends = ends.reshape(-1, 2)
    _, same = unique_rows(vertices[used])
    links = scipy.sparse.coo_matrix((np.ones(len(ends)), same[ends].T), shape=(len(used), len(used)))
    _, outline = scipy.sparse.csgraph.connected_components(links, directed=False)
    _, outline = np.unique(outline[same[ends[:, 0]]], return_inverse=True)
    count = np.bincount(outline)
    middle = np.stack([np.bincount(outline, weights=vertices[rim[:, 0], axis]) for axis in range(3)], axis=1)
    apex = len(vertices) + outline
    return np.concatenate([vertices, middle / count[:, None]]), np.column_stack([apex, rim])
