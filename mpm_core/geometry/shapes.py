"""Solids from a few numbers: box, tunnel, cylinder, sphere, prism; in 2-D box, circle, polygon.

Curved surfaces are cut into enough facets that the plain inscribed ones would lose less than 0.1 % of the volume, and
moved outward until the volume is exact. trimesh and ezdxf are imported where a shape needs them: see solid_files.py.
"""

from collections.abc import Callable

import numpy as np

from common.errors import InputError
from mpm_core.geometry.solids import Solid
from mpm_core.geometry.tunnels import sweep_tunnel

CIRCLE_SEGMENTS = 96  # inscribed, the polygon lacks 0.07 % of the circle
SPHERE_SUBDIVISIONS = 5  # 20480 triangles; inscribed, they lack 0.054 % of the ball
COLLINEAR = 1e-9  # twice the area of a corner over its squared size below which the corner is none


class _Reader:
    """Takes keys of one excavation's specification, checks them, and names excavation and key when they are wrong."""

    def __init__(self, specification: dict, dimension: int):
        self.specification, self.dimension = specification, dimension
        self.name = specification.get("name", "excavation")

    def fail(self, key: str, problem: str) -> InputError:
        return InputError(f"{self.name}: {key}: {problem}")

    def array(self, key: str, shape: tuple[int | None, ...], what: str) -> np.ndarray:
        """The value as finite float64 of `shape` (None: any length)."""
        if key not in self.specification:
            raise self.fail(key, f"missing; shape {self.specification.get('shape')} needs {what}")
        try:
            value = np.array(self.specification[key], dtype=np.float64)
        except (TypeError, ValueError):
            raise self.fail(key, f"expected {what}, not {self.specification[key]!r}") from None
        fits = value.ndim == len(shape) and all(b in (None, a) for a, b in zip(value.shape, shape, strict=True))
        if not fits or not np.isfinite(value).all():
            raise self.fail(key, f"expected {what}, not {self.specification[key]!r}")
        return value

    def point(self, key: str) -> np.ndarray:
        return self.array(key, (self.dimension,), f"a point of {self.dimension} coordinates in m")

    def points(self, key: str, coordinates: int, at_least: int) -> np.ndarray:
        """Points (point, coordinates), repeated neighbours dropped; at least so many must be left."""
        value = self.array(key, (None, coordinates), f"a list of points of {coordinates} coordinates in m")
        value = value[np.append(True, (np.diff(value, axis=0) != 0).any(axis=1))]
        if len(value) < at_least:
            raise self.fail(key, f"needs at least {at_least} different points, has {len(value)}")
        return value

    def length(self, key: str) -> float:
        value = float(self.array(key, (), "a length in m"))
        if value <= 0:
            raise self.fail(key, f"must be positive, not {value:g} m")
        return value


def build_shape(specification: dict, dimension: int) -> Solid:
    """Solid of one excavation or rock body from its shape's numbers (SI).

    specification: `name`, `shape`, and the shape's own keys (m); keys of other meaning are ignored. dimension 3 or 2.
    Raises InputError naming the excavation and the key.

    3-D  box       lower, upper: corners
         tunnel    path: points on the centre line of the FLOOR; width, height; profile: rectangular (default) | arched
         cylinder  start, end: centres of the end faces; radius
         sphere    center; radius
         prism     polygon: list of [x, y]; lower, upper: elevations; or base, top: one elevation per polygon point;
              holes: a list of such polygons within it, with elevations of their own (of files alone)
    2-D  box       lower, upper: corners
         circle    (or sphere, cylinder) center; radius
         polygon   points: list of points in the plane
    """
    reader = _Reader(specification, dimension)
    shapes = SHAPES[dimension]
    if specification.get("shape") not in shapes:
        raise reader.fail(
            "shape", f"{specification.get('shape')!r} is not one of the {dimension}-D shapes {', '.join(shapes)}"
        )
    vertices, facets = shapes[specification["shape"]](reader)
    solid = Solid(reader.name, vertices, facets)
    if solid.volume == 0:
        raise reader.fail(specification["shape"], "encloses no volume: check its coordinates")
    return solid if solid.signed_volume > 0 else Solid(solid.name, solid.vertices, solid.facets[:, ::-1])


def _box(reader: _Reader) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = reader.point("lower"), reader.point("upper")
    if (upper <= lower).any():
        raise reader.fail(
            "upper", f"must exceed lower in every coordinate: {upper.tolist()} against {lower.tolist()} m"
        )
    if reader.dimension == 2:
        return _ring(np.array([lower, [upper[0], lower[1]], upper, [lower[0], upper[1]]]))
    import trimesh

    box = trimesh.creation.box(bounds=[[0, 0, 0], [1, 1, 1]])
    return np.where(box.vertices == 0, lower, upper), box.faces  # the corners' own numbers: no round-off


def _tunnel(reader: _Reader) -> tuple[np.ndarray, np.ndarray]:
    path = reader.points("path", 3, at_least=2)
    width, height = reader.length("width"), reader.length("height")
    return sweep_tunnel(path, width, height, reader.specification.get("profile", "rectangular"), reader.fail)


def _cylinder(reader: _Reader) -> tuple[np.ndarray, np.ndarray]:
    import trimesh

    start, end, radius = reader.point("start"), reader.point("end"), reader.length("radius")
    if (start == end).all():
        raise reader.fail("end", "is the same point as start: a cylinder needs a length")
    radius *= _circle_growth()
    cylinder = trimesh.creation.cylinder(radius, segment=[[0, 0, 0], end - start], sections=CIRCLE_SEGMENTS)
    return cylinder.vertices + start, cylinder.faces


def _sphere(reader: _Reader) -> tuple[np.ndarray, np.ndarray]:
    import trimesh

    center, radius = reader.point("center"), reader.length("radius")
    ball = trimesh.creation.icosphere(subdivisions=SPHERE_SUBDIVISIONS)
    radius *= (4 / 3 * np.pi / ball.volume) ** (1 / 3)
    return ball.vertices * radius + center, ball.faces


def _prism(reader: _Reader) -> tuple[np.ndarray, np.ndarray]:
    rings = [_ring_of_prism(reader, reader.specification)]
    rings += [_ring_of_prism(reader, hole) for hole in reader.specification.get("holes", [])]
    rings = [rings[0][:: _turn(rings[0])], *(ring[:: -_turn(ring)] for ring in rings[1:])]  # holes the other way round
    vertices = np.concatenate(rings)
    count = len(vertices)
    bottom = np.arange(count)
    ahead = np.concatenate(
        [np.roll(own, -1) for own in np.split(bottom, np.cumsum([len(ring) for ring in rings])[:-1])]
    )
    walls = [np.column_stack([bottom, ahead, ahead + count]), np.column_stack([bottom, ahead + count, bottom + count])]
    places = np.concatenate([vertices[:, [0, 1, 2]], vertices[:, [0, 1, 3]]])
    plan = [ring[:, :2] for ring in rings]
    for cap in (_triangulate(plan), _fans(plan)):  # fans serve any polygon, even a self-crossing one
        facets = np.concatenate([*walls, cap[:, ::-1], cap + count])
        if Solid(reader.name, places, facets).is_closed:
            break
    return places, facets


def _ring_of_prism(reader: _Reader, specification: dict) -> np.ndarray:
    """Corners (point, 4) m of a prism's outline or hole: x, y, lower and upper elevation; points on a line left out."""
    reader = _Reader({"name": reader.name, "shape": "prism", **specification}, 3)
    polygon = reader.array("polygon", (None, 2), "a list of points [x, y] in m")
    by_point = "base" in specification or "top" in specification
    if by_point:
        what = f"one elevation in m for each of the {len(polygon)} polygon points"
        lower, upper = (reader.array(key, (len(polygon),), what) for key in ("base", "top"))
    else:
        lower, upper = (np.full(len(polygon), reader.array(key, (), "an elevation in m")) for key in ("lower", "upper"))
    if (upper <= lower).any():
        raise reader.fail("top" if by_point else "upper", "must be above the lower elevation at every point")
    keep = (polygon != np.roll(polygon, 1, axis=0)).any(axis=1)
    if not by_point:
        while (straight := keep.copy()).any():
            straight[keep] = _straight(polygon[keep])
            if not straight.any():
                break
            keep[np.flatnonzero(straight)[0]] = False  # one at a time: its neighbours' angles change
    if keep.sum() < 3:
        raise reader.fail("polygon", "needs at least 3 points that are not on one line")
    return np.column_stack([polygon, lower, upper])[keep]


def _turn(ring: np.ndarray) -> int:
    """1 if a ring (point, 2 or more) runs counterclockwise in plan, else -1."""
    local = ring[:, :2] - ring[:, :2].mean(axis=0)
    return 1 if np.linalg.det(local[_ring(local)[1]]).sum() >= 0 else -1


def _straight(polygon: np.ndarray) -> np.ndarray:
    """Whether each corner (point,) lies on the line through its neighbours."""
    before, after = polygon - np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0) - polygon
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.abs(turn) <= COLLINEAR * ((before**2).sum(axis=1) + (after**2).sum(axis=1))


def _triangulate(rings: list[np.ndarray]) -> np.ndarray:
    """Triangles (triangle, 3) of a simple counterclockwise polygon (point, 2) less its holes: rows of all rings."""
    from ezdxf.math.triangulation import mapbox_earcut_2d

    places = np.concatenate(rings)
    local = places - places.mean(axis=0)
    outline, *holes = (part.tolist() for part in np.split(local, np.cumsum([len(ring) for ring in rings])[:-1]))
    row = {tuple(point): number for number, point in enumerate(local.tolist())}
    triangles = [[row[point.x, point.y] for point in triangle] for triangle in mapbox_earcut_2d(outline, holes)]
    triangles = np.array(triangles, dtype=np.int64).reshape(-1, 3)
    wrong = np.linalg.det(np.dstack([local[triangles], np.ones(triangles.shape)])) < 0
    triangles[wrong] = triangles[wrong, ::-1]
    return triangles


def _fans(rings: list[np.ndarray]) -> np.ndarray:
    """Triangles (triangle, 3) of each ring from its first corner to each edge, rows of all rings: where they overlap,
    they cancel in the winding number."""
    first = np.cumsum([0] + [len(ring) for ring in rings])[:-1]
    fans = []
    for start, ring in zip(first, rings, strict=True):
        ahead = start + np.arange(1, len(ring) - 1)
        fans.append(np.column_stack([np.full_like(ahead, start), ahead, ahead + 1]))
    return np.concatenate(fans)


def _circle(reader: _Reader) -> tuple[np.ndarray, np.ndarray]:
    center, radius = reader.point("center"), reader.length("radius")
    angle = 2 * np.pi / CIRCLE_SEGMENTS * np.arange(CIRCLE_SEGMENTS)
    return _ring(center + radius * _circle_growth() * np.column_stack([np.cos(angle), np.sin(angle)]))


def _polygon(reader: _Reader) -> tuple[np.ndarray, np.ndarray]:
    points = reader.points("points", 2, at_least=3)
    return _ring(points[:-1] if (points[0] == points[-1]).all() else points)


def _ring(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and segments of the closed line through points (point, 2)."""
    number = np.arange(len(points))
    return points, np.column_stack([number, np.roll(number, -1)])


def _circle_growth() -> float:
    """Radius of the polygon of CIRCLE_SEGMENTS corners that has the unit circle's area."""
    step = 2 * np.pi / CIRCLE_SEGMENTS
    return np.sqrt(step / np.sin(step))


SHAPES: dict[int, dict[str, Callable]] = {
    3: {"box": _box, "tunnel": _tunnel, "cylinder": _cylinder, "sphere": _sphere, "prism": _prism},
    2: {"box": _box, "circle": _circle, "sphere": _circle, "cylinder": _circle, "polygon": _polygon},
}
