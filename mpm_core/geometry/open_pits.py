"""Surfaces of open pits, closed at the level of the ground.

A design or a survey of a pit is open at its top. What lies below the level is kept, cut exactly at it. The edges of the
rest that only one triangle has, and that lie in the level, are its rim: a lid in the level, triangulated in plan,
closes it. Each connected piece of the surface has a lid of its own, so that several pits, and pits within one another,
may be in one file; a rim within a rim of the same piece bounds rock that is left. The lid looks upward, and its rim
says which way the piece looks. Edges of a single triangle below the level belong to holes, or to a surface that does
not reach the ground, which is refused.

Survey and design end a little above or below the level, and surveys show ground around the pit. Vertices within a
slack are moved onto the level (`GROUND_SLACK`): such ground then bounds nothing.
"""

from typing import NamedTuple

import igl
import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for

from common.errors import InputError
from mpm_core.geometry.outlines import line_winding
from mpm_core.geometry.shapes.prism import triangulate
from mpm_core.geometry.solids import Edges, edges_of

# Vertices at most this far (m) from the level, and at most this share of the pit's depth, are moved onto it. Surveys
# are better than that, and a bench is many times as high.
GROUND_SLACK, GROUND_SLACK_SHARE = 0.5, 0.01
MIN_VOLUME_SHARE_WARNED = 1e-3  # Of ground that is flattened, as a share of the pit's volume.
MAX_HOLLOW_SHARE = 0.01  # A piece with a smaller share of the volume of all is called a hollow of the ground.
REMEDY = "check frame.surface, units, scale and offset, or extend the surface up to the ground"
UNEVEN = "the model's ground is level"


class Closed(NamedTuple):
    """A surface that was closed, and what is to be said about it."""

    vertices: np.ndarray
    """(v, 3) m"""
    facets: np.ndarray
    """(f, 3) int64"""
    turned: int
    """number of triangles that looked another way than their neighbours"""
    notes: list[str]


def closed_at(vertices: np.ndarray, facets: np.ndarray, level: float) -> Closed:
    """The part of a surface below a level (elevation, m), closed there. vertices (v, 3) m, equal ones merged.

    Raises InputError for a surface that does not reach the level, with the place, and for one that is wholly above it.
    """
    height = vertices[:, 2] - level
    lowest = float(height[facets].min())
    if lowest >= 0.0:
        raise InputError(
            f"lies above the ground, z {level + lowest:.10g} m and more (frame.surface: {level:.10g} m): {REMEDY}"
        )
    slack = min(GROUND_SLACK, GROUND_SLACK_SHARE * -lowest)
    flat = np.where(np.abs(height) <= slack, 0.0, height)
    was_open = bool((edges_of(facets).count % 2).any())
    notes = _above(vertices, facets, height, slack, level) if was_open else []
    uneven = _flattened(vertices, facets, height, flat)
    vertices, facets = _cut(np.column_stack([vertices[:, :2], flat]), facets)
    _refuse_mixed_rims(vertices, facets, level)
    facets, turned = _agreeing(facets)
    count, piece = igl.facet_components(np.ascontiguousarray(facets))
    edges = edges_of(facets)
    rim, of_rim = _rim(vertices, facets, edges, piece)
    if not len(rim):
        raise InputError(
            f"is closed {-float(vertices[facets][:, :, 2].max()):.4g} m below the ground (frame.surface: {level:.10g} "
            f"m), where rock would stay above it: {REMEDY}, or leave closed_at_ground out"
        )
    # Twice the area of each piece's lid, positive where the piece looks outward: its rim then runs the other way round.
    (x, y), (x_next, y_next) = (vertices[rim[:, end], :2].T for end in (0, 1))
    middle = vertices[rim[:, 0], :2].mean(axis=0)
    area = np.bincount(of_rim, (x - middle[0]) * (y_next - middle[1]) - (x_next - middle[0]) * (y - middle[1]), count)
    has_rim = np.bincount(of_rim, minlength=count) > 0
    inward = np.where(has_rim, area < 0.0, area[np.abs(area).argmax()] < 0.0)
    facets = np.where(inward[piece][:, None], facets[:, ::-1], facets)
    rim = np.where(inward[of_rim][:, None], rim[:, ::-1], rim)
    lids = [_lid(vertices[:, :2], rim[of_rim == one]) for one in np.flatnonzero(has_rim)]
    _refuse_low_pieces(vertices, facets, edges, piece, has_rim, rim, level)
    volume = -np.bincount(piece, _columns(vertices, facets, vertices[:, 2]), count)
    notes += _uneven_note(uneven, slack, float(np.abs(volume).sum()))
    notes += _hollows(volume, 0.5 * np.abs(area), has_rim)
    vertices[:, 2] += level
    vertices[np.unique(rim), 2] = level
    return Closed(vertices, np.concatenate([facets, *lids]), turned, notes)


def _below(points: np.ndarray, level: float) -> str:
    """Message on a rim (point, 3) m, elevations from the map's zero, that does not reach the ground."""
    x, y, z = points[points[:, 2].argmin()]
    return (
        f"does not reach the ground: its rim at {x:.2f}, {y:.2f} m is {level - z:.4g} m below frame.surface, "
        f"{level:.10g} m; {UNEVEN}: {REMEDY}"
    )


def _plan_areas(vertices: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Area of each triangle seen from above, (f,) m2, positive where it looks up."""
    a, b, c = (vertices[facets[:, corner], :2] for corner in range(3))
    b, c = b - a, c - a
    return 0.5 * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])


def _columns(vertices: np.ndarray, facets: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Integral over each triangle's plan area of a value of its vertices, (f,)."""
    return _plan_areas(vertices, facets) * value[facets].mean(axis=1)


def _above(vertices, facets, height, slack, level) -> list[str]:
    """What is to be said of a surface that rises above the level."""
    top = facets.ravel()[height[facets].argmax()]
    if height[top] <= slack:
        return []
    x, y = vertices[top, :2]
    return [
        f"rises up to {height[top]:.4g} m above frame.surface, {level:.10g} m, at {x:.2f}, {y:.2f} m; {UNEVEN}: what "
        "is above is cut off, and rock there has no weight"
    ]


def _flattened(vertices, facets, height, flat) -> tuple[float, float]:
    """Plan area m2 of the ground that is moved onto the level, and the volume m3 between them."""
    moved = (flat != height)[facets].any(axis=1)
    on_level = moved & (flat[facets] == 0.0).all(axis=1)
    area = np.abs(_plan_areas(vertices, facets[on_level])).sum()
    volume = np.abs(_columns(vertices, facets[moved], np.abs(flat - height))).sum()
    return float(area), float(volume)


def _uneven_note(uneven: tuple[float, float], slack: float, volume: float) -> list[str]:
    area, between = uneven
    if between <= MIN_VOLUME_SHARE_WARNED * volume:
        return []
    return [
        f"its ground within {slack:.3g} m of frame.surface is taken as level: {area:.3g} m2, {between:.3g} m3 between "
        "both"
    ]


def _hollows(volume: np.ndarray, area: np.ndarray, has_rim: np.ndarray) -> list[str]:
    """What is to be said of small pieces: volumes m3 and areas m2 of their lids (piece,)."""
    hollow = has_rim & (np.abs(volume) < MAX_HOLLOW_SHARE * np.abs(volume).sum())
    if not hollow.any():
        return []
    return [
        f"{hollow.sum()} hollows of its ground lie below frame.surface, apart from the pit: {area[hollow].sum():.3g} "
        f"m2, {np.abs(volume[hollow]).sum():.3g} m3 that count as mined; cut the surface off at the rim of the pit"
    ]


def _cut(vertices: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What triangles have below z = 0, as triangles, and the vertices that they use. Those in the plane are left out.

    Two triangles with a common edge have one vertex where it meets the plane.
    """
    side = np.sign(vertices[:, 2]).astype(np.int64)[facets]
    below = (side < 0).any(axis=1)
    crossed = below & (side > 0).any(axis=1)
    start, end = facets[crossed], np.roll(facets[crossed], -1, axis=1)
    meets = (side[crossed] * np.roll(side[crossed], -1, axis=1)) < 0
    pairs = np.sort(np.stack([start[meets], end[meets]], axis=1), axis=1)
    keys, number = np.unique(pairs[:, 0] * len(vertices) + pairs[:, 1], return_inverse=True)
    one, other = vertices[keys // len(vertices)], vertices[keys % len(vertices)]
    share = one[:, 2] / (one[:, 2] - other[:, 2])
    new = one + share[:, None] * (other - one)
    new[:, 2] = 0.0
    # corners of what is left, in order: each corner that is not above, then where the edge from it meets the plane
    left = np.full((len(start), 3, 2), -1)
    left[:, :, 0] = np.where(side[crossed] <= 0, start, -1)
    left[:, :, 1][meets] = len(vertices) + number.reshape(-1)
    outline = left.reshape(-1, 6)
    outline = np.take_along_axis(outline, np.argsort(outline < 0, axis=1, kind="stable"), axis=1)
    parts = [facets[below & ~crossed], outline[:, :3], outline[outline[:, 3] >= 0][:, [0, 2, 3]]]
    used, kept = np.unique(np.concatenate(parts), return_inverse=True)
    return np.concatenate([vertices, new])[used], kept.reshape(-1, 3)


def _odd_edges(facets: np.ndarray, edges: Edges) -> np.ndarray:
    """Vertices (edge, 2) of the edges that an odd number of triangles has."""
    _, first = np.unique(edges.of_facet, return_index=True)
    ends = np.stack([facets.ravel(), np.roll(facets, -1, axis=1).ravel()], axis=1)[first]
    return ends[(edges.count % 2 == 1)]


def _refuse_mixed_rims(vertices: np.ndarray, facets: np.ndarray, level: float) -> None:
    """Raise InputError where a rim lies in the plane z = 0 for a part of its length only, or nowhere.

    A hole of a wall that reaches up to the rim cannot be told from a rim that is too low. Other rims below the
    plane are holes where some lie in it (`_refuse_low_pieces`).
    """
    ends = _odd_edges(facets, edges_of(facets))
    if not len(ends):
        return
    graph = scipy.sparse.coo_array((np.ones(len(ends)), ends.T), (len(vertices), len(vertices)))
    count, line = scipy.sparse.csgraph.connected_components(graph, directed=False)
    deep = vertices[:, 2] < 0.0
    in_line = np.unique(ends)
    has_deep = np.bincount(line[in_line], deep[in_line], minlength=count) > 0
    has_rim = np.bincount(line[in_line], ~deep[in_line], minlength=count) > 0
    if has_rim.any():
        chosen = has_deep & has_rim
    else:
        chosen = np.arange(count) == line[in_line[vertices[in_line, 2].argmax()]]
    if chosen.any():
        raise InputError(_below(vertices[in_line[chosen[line[in_line]]]] + [0.0, 0.0, level], level))


def _agreeing(facets: np.ndarray) -> tuple[np.ndarray, int]:
    """The triangles with neighbours that look the same way, and the number that looked another way than most."""
    agreeing, patch = igl.bfs_orient(np.ascontiguousarray(facets, dtype=np.int64))
    turned = np.bincount(patch, (agreeing != facets).any(axis=1))
    size = np.bincount(patch)
    agreeing = np.where((turned > 0.5 * size)[patch][:, None], agreeing[:, ::-1], agreeing)
    return agreeing, int(np.minimum(turned, size - turned).sum())


def _rim(vertices: np.ndarray, facets: np.ndarray, edges: Edges, piece: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges (edge, 2) of the lid, the way round in which it passes them, and the piece (edge,) that each closes."""
    start, end = facets.ravel(), np.roll(facets, -1, axis=1).ravel()
    number = edges.of_facet.ravel()
    in_plane = (vertices[start, 2] == 0.0) & (vertices[end, 2] == 0.0)
    chosen = in_plane & (edges.balance[number] * np.sign(end - start) > 0)
    rows = np.flatnonzero(chosen)
    _, first = np.unique(number[rows], return_index=True)
    rows = rows[first]
    times = np.abs(edges.balance[number[rows]])
    rows = np.repeat(rows, times)
    return np.stack([end[rows], start[rows]], axis=1), np.repeat(piece, 3)[rows]


def _lid(plan: np.ndarray, rim: np.ndarray) -> np.ndarray:
    """Triangles (f, 3) that look up within a rim: directed edges (edge, 2), vertices of plan (v, 2) m.

    What a triangulation leaves out (points on a straight side, a rim that crosses itself) is closed by fans.
    """
    lines = _lines(plan, rim)
    areas = np.array([_area(plan[line]) for line in lines])
    outer = [number for number in np.argsort(np.abs(areas)) if areas[number] > 0.0]
    holes: dict[int, list[np.ndarray]] = {number: [] for number in outer}
    for number in np.flatnonzero(areas < 0.0):
        middle = plan[lines[number][:2]].mean(axis=0)
        around = next((one for one in outer if line_winding(plan[lines[one]], middle[None])[0] != 0), None)
        if around is not None:
            holes[around].append(lines[number])
    found = [np.zeros((0, 3), np.int64)]
    for number in outer:
        rings = [lines[number], *holes[number]]
        found.append(np.concatenate(rings)[triangulate([plan[ring] for ring in rings])])
    lid = np.concatenate(found)
    rest = _rest(rim, lid)
    fans = [np.stack([np.full(len(line) - 2, line[0]), line[1:-1], line[2:]], axis=1) for line in _lines(plan, rest)]
    return np.concatenate([lid, *fans])


def _rest(rim: np.ndarray, lid: np.ndarray) -> np.ndarray:
    """Directed edges (edge, 2) of a rim that the boundary of a lid leaves out, and those it has too many, turned."""
    own = np.stack([lid.ravel(), np.roll(lid, -1, axis=1).ravel()], axis=1)
    ends = np.concatenate([rim, own[:, ::-1]])
    low, high = ends.min(axis=1, initial=2**62), ends.max(axis=1, initial=-1)
    keys, number = np.unique(np.stack([low, high], axis=1), axis=0, return_inverse=True)
    passed = np.bincount(number.reshape(-1), np.sign(ends[:, 1] - ends[:, 0]), minlength=len(keys)).astype(np.int64)
    turned = np.where((passed > 0)[:, None], keys, keys[:, ::-1])
    return np.repeat(turned, np.abs(passed), axis=0)


def _lines(plan: np.ndarray, rim: np.ndarray) -> list[np.ndarray]:
    """Closed lines of vertices that directed edges (edge, 2) make. Where several leave a vertex, a line turns left."""
    order = np.argsort(rim[:, 0], kind="stable")
    rim = rim[order]
    first = np.searchsorted(rim[:, 0], rim[:, 1])
    last = np.searchsorted(rim[:, 0], rim[:, 1], side="right")
    following = first.copy()
    taken = set()
    for edge in np.flatnonzero(last - first > 1).tolist():
        here = plan[rim[edge, 1]] - plan[rim[edge, 0]]
        choices = [one for one in range(first[edge], last[edge]) if one not in taken]
        out = plan[rim[choices, 1]] - plan[rim[edge, 1]]
        turn = np.arctan2(here[0] * out[:, 1] - here[1] * out[:, 0], out @ here)
        following[edge] = choices[int(turn.argmax())]
        taken.add(following[edge])
    lines, seen = [], np.zeros(len(rim), bool)
    nexts: list[int] = following.tolist()
    starts: list[int] = rim[:, 0].tolist()
    for begin in range(len(rim)):
        line: list[int] = []
        edge = begin
        while not seen[edge]:
            seen[edge] = True
            line.append(starts[edge])
            edge = nexts[edge]
        if line:
            lines.append(np.array(line))
    return lines


def _area(line: np.ndarray) -> float:
    """Area m2 within a closed line (point, 2) m, positive where it runs counterclockwise."""
    local = line - line[0]
    (x, y), (x_next, y_next) = local.T, np.roll(local, -1, axis=0).T
    return 0.5 * float(np.sum(x * y_next - x_next * y))


def _refuse_low_pieces(vertices, facets, edges, piece, has_rim, rim, level) -> None:
    """Raise InputError for an open piece without a rim in the plane that lies, in plan, outside of the rims (edge, 2)
    of all others. Within them it belongs to a pit that has cracks."""
    is_open = (edges.count % 2 == 1)[edges.of_facet].any(axis=1) & ~has_rim[piece]
    if not is_open.any():
        return
    points = vertices[facets[is_open]].mean(axis=1)
    number = sum(np.abs(line_winding(vertices[line, :2], points[:, :2])) for line in _lines(vertices[:, :2], rim))
    low = np.setdiff1d(piece[is_open], piece[is_open][number > 0])
    if len(low):
        ends = _odd_edges(facets[piece == low[0]], edges_of(facets[piece == low[0]]))
        raise InputError(_below(vertices[np.unique(ends)] + [0.0, 0.0, level], level))
