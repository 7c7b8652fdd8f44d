"""The grid of a mine's coordinates on the map: turned, mirrored, shifted or scaled, in feet or metres.

Inside the program x is east, y north (of the map) and z up, in metres. A mine's files may have other coordinates:

    map = map_origin + scale R A (grid - grid_origin)

in plan, with A (2, 2) from `axes` (the directions of x and y in the grid) to the grid's own east and north, and R the
turn by `angle`. Elevations are shifted, and change their sign where z runs down. Scale does not change them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from common.errors import InputError
from common.setting_types import AsTuple, Point, Settings, Size, Unit, real_number, refusal
from common.voigt import tensor_from_voigt, voigt_from_tensor

METRES_PER_UNIT = {"m": 1.0, "ft": 0.3048, "us_ft": 1200 / 3937}
DIRECTIONS = {"east": (1, 0), "north": (0, 1), "west": (-1, 0), "south": (0, -1)}
EAST_NORTH: tuple[str, ...] = ("east", "north")
MIN_SCALE, MAX_SCALE = 0.99, 1.01  # A projection and the height of a mine change lengths by less than this.
DECIMALS = 7  # Of places on the map, m: round-off of a turn must not decide on which side of a cell a wall lies.
# Degrees within which a fitted angle is a multiple of 90 degrees; of a scale, within which it is 1.
MAX_ROUND_OFF = 1e-9

DOWN = "down"

Direction = Literal["east", "north", "west", "south", "up", "down"]
Axes = Annotated[tuple[Direction, ...], Field(min_length=2, max_length=3), AsTuple]


class CommonPoint(Settings):
    """A point by its coordinates in the grid and on the map: two in plan, or three with the elevation."""

    grid: Point
    """Coordinates of the point in the mine's grid."""
    map: Point
    """Coordinates of the point on the map, in the order and directions of frame.crs where its axes run west or south;
    else east, north and elevation."""

    @model_validator(mode="after")
    def _alike(self) -> Self:
        if len(self.grid) != len(self.map):
            raise refusal(f"{len(self.map)} coordinates, but {len(self.grid)} in the grid; give as many", "map")
        return self


class MineGrid(Settings):
    """Grid of the coordinates in the mine file, its solids, record and face, if it is not that of the map. Its place
    follows from angle and origin, or from points. Bearings (trend, dip direction) always count from the map's north."""

    axes: Axes = None
    """Directions of x and y in the grid, and of z if it runs down: [west, south], [north, east, down]. Default:
    [east, north]; where the axes of frame.crs run west or south, these axes."""
    angle: Annotated[float, Unit("deg", ge=-360, le=360)] = None
    """Angle from the map's north to the grid's north, clockwise seen from above: at 90 deg the grid's north is the
    map's east. Default: 0 deg."""
    origin: CommonPoint = None
    """One point of the grid on the map, in place of points. Default: the origins are the same."""
    points: Annotated[tuple[CommonPoint, ...], Field(min_length=2), AsTuple] = None
    """Two common points or more, in place of angle and origin. The angle, the shift, and the scale if none is given,
    follow by least squares. Two points do not show a mistake: give three or more."""
    scale: real_number(ge=MIN_SCALE, le=MAX_SCALE) = None
    """Distance on the map divided by the distance in the grid, such as the scale factor of a projection. It applies in
    plan. Default: 1, or what the points show."""
    units: Literal["m", "ft", "us_ft"] = "m"
    """Unit of coordinates in solids and in the record where these state none, and of the positions in the mine's grid
    that results give. `ft`: international foot. `us_ft`: US survey foot."""
    max_residual: Size = 0.5
    """Largest distance in plan, and in elevation, by which the fit may miss one of the points."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        given = self.model_fields_set
        plan, vertical = (self.axes or EAST_NORTH)[:2], (self.axes or EAST_NORTH)[2:]
        if {*plan} - {*DIRECTIONS} or {*vertical} & {*DIRECTIONS}:
            raise refusal("give the directions of x and y in plan, then up or down as that of z, if any", "axes")
        if len({axis in ("east", "west") for axis in plan}) < 2:
            raise refusal(f"{' and '.join(plan)} are on one line; give one of east, west and one of north, south",
                          "axes")  # fmt: skip
        if self.points and given & {"angle", "origin"}:
            raise refusal(
                "stands beside points, which give it; leave one of the two out", min(given & {"angle", "origin"})
            )
        if self.points is None and "max_residual" in given:
            raise refusal("of which points? give points, or leave it out", "max_residual")
        if self.points and len({len(point.grid) for point in self.points}) > 1:
            raise refusal("some have elevations and some have none; give them for all or for none", "points")
        for key in ("grid", "map"):
            places = [getattr(point, key)[:2] for point in self.points or ()]
            for number, place in enumerate(places):
                if place in places[:number]:
                    raise refusal(
                        "the same place as an earlier point; give points at different places", "points", number, key
                    )
        return self

    def map(self) -> "GridMap":
        """The transformation of a grid without points (see `fit`). `axes` that are not given are east and north."""
        origins = (self.origin.grid, self.origin.map) if self.origin else ((0.0, 0.0), (0.0, 0.0))
        grid_origin, map_origin = map(_in_space, origins)
        return GridMap(
            axes=self.axes or EAST_NORTH,
            angle=self.angle or 0.0,
            scale=1.0 if self.scale is None else self.scale,
            grid_origin=grid_origin,
            map_origin=map_origin,
            units=self.units,
        )


def _in_space(point: Sequence[float]) -> tuple[float, float, float]:
    x, y, *z = point
    return (x, y, z[0] if z else 0.0)


@dataclass(frozen=True)
class GridMap:
    """Transformation between coordinates of a grid and of the map, both in m. The defaults are the identity."""

    axes: tuple[str, ...] = EAST_NORTH
    angle: float = 0.0
    """degrees, clockwise from the map's north to the grid's north"""
    scale: float = 1.0
    grid_origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    map_origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    units: str = "m"
    """one of METRES_PER_UNIT, in which files have the grid's coordinates"""

    @cached_property
    def turn(self) -> NDArray:
        """Orthogonal matrix (3, 3): columns are the directions of the grid's x, y and z in east, north, up."""
        directions = np.array([DIRECTIONS[axis] for axis in self.axes[:2]], float).T
        quarters, rest = divmod(self.angle, 90.0)
        if rest:
            sine, cosine = np.sin(np.radians(self.angle)), np.cos(np.radians(self.angle))
        else:  # exact
            sine, cosine = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][int(quarters) % 4]
        turn = np.eye(3)
        turn[:2, :2] = np.array([[cosine, sine], [-sine, cosine]]) @ directions
        turn[2, 2] = -1.0 if self.is_downward else 1.0
        return turn

    @property
    def is_downward(self) -> bool:
        """True if z in the grid counts downward."""
        return self.axes[2:] == (DOWN,)

    @property
    def is_mirrored(self) -> bool:
        """True if the grid's x, y and z are a left-handed system."""
        return bool(np.linalg.det(self.turn) < 0.0)

    @property
    def keeps_boxes(self) -> bool:
        """True if a box along the grid's axes is a box along those of the map."""
        return self.angle % 90.0 == 0.0

    def text(self) -> str:
        """Sentences on axes, turn, scale and unit of the grid."""
        down = ", and z down" if self.is_downward else ""
        parts = [f"In the mine's own grid x runs {self.axes[0]} and y {self.axes[1]}{down}."]
        parts += ["It is mirrored in plan."] if self.is_mirrored != self.is_downward else []
        parts += [f"Its north is {self.angle:.6g} degrees clockwise from the map's."] if self.angle else []
        parts += [f"Distances on the map are {self.scale:.6f} of those in it."] if self.scale != 1.0 else []
        parts += [f"Its unit is {self.units}."] if self.units != "m" else []
        return " ".join(parts)

    @property
    def metres_per_unit(self) -> float:
        """Metres of the unit in which files have the grid's coordinates."""
        return METRES_PER_UNIT[self.units]

    def to_map(self, points: ArrayLike) -> NDArray:
        """Coordinates on the map (..., 2 or 3) m, to DECIMALS, of points of the grid (..., 2 or 3) m, without or with
        elevations."""
        points = np.asarray(points, float)
        if self == SAME_AS_MAP:
            return points
        count = points.shape[-1]
        scale = np.array([self.scale, self.scale, 1.0])[:count]
        turn = self.turn[:count, :count]
        return np.round(scale * ((points - self.grid_origin[:count]) @ turn.T) + self.map_origin[:count], DECIMALS)

    def to_grid(self, points: ArrayLike) -> NDArray:
        """Coordinates in the grid (..., 2 or 3) m of points on the map (..., 2 or 3) m."""
        points = np.asarray(points, float)
        count = points.shape[-1]
        scale = np.array([self.scale, self.scale, 1.0])[:count]
        return ((points - self.map_origin[:count]) / scale) @ self.turn[:count, :count] + self.grid_origin[:count]

    def elevation(self, z: float) -> float:
        """Elevation on the map, m, of one in the grid, m."""
        return round((z - self.grid_origin[2]) * float(self.turn[2, 2]) + self.map_origin[2], DECIMALS)

    def box(self, lower: NDArray, upper: NDArray) -> tuple[NDArray, NDArray]:
        """Corners on the map (3,) m of a box of the grid by its corners (3,) m; only if `keeps_boxes`."""
        ends = self.to_map(np.stack([lower, upper]))
        return ends.min(axis=0), ends.max(axis=0)

    def vector(self, components: ArrayLike) -> NDArray:
        """Components (3,) east, north, up of a vector, such as a force, by those along the grid's axes."""
        return self.turn @ np.asarray(components, float)

    def tensor(self, components: ArrayLike) -> NDArray:
        """Six components (6,) along east, north, up of a symmetric tensor by those along the grid's axes (Voigt order,
        tensor shear): T A T^T, which changes the sign of some shears in a mirrored grid."""
        return voigt_from_tensor(self.turn @ tensor_from_voigt(components) @ self.turn.T)


SAME_AS_MAP = GridMap()


class Fit(NamedTuple):
    """A grid by common points, and by how much it misses each: in plan and in elevation (point,) m.

    fits_mirrored: whether the mirrored grid would do, too, as where points lie on one line.
    """

    map: GridMap
    residual: NDArray
    elevation_residual: NDArray
    fits_mirrored: bool = False


def fit(grid: MineGrid, points: NDArray, axes: tuple[str, ...]) -> Fit:
    """The transformation that misses the grid's common points least.

    points (point, 2 or 3) m: where they are on the map, east, north and up; axes: directions of the grid's x and y. In
    plan it is the similarity of least squares (Umeyama 1991, IEEE Trans. Pattern Anal. Mach. Intell. 13, 376), with
    complex numbers: b = sum(conj(g) m) / sum(|g|^2) of both sets of points about their means; |b| is the scale, where
    none is given. In elevation it is the mean difference. Raises InputError, naming the key, for a scale that no map
    has and a residual above grid.max_residual.
    """
    found = _fitted(grid, points, axes)
    if problem := _problem(grid, found):
        raise InputError(f"{problem}{_hint(grid, points, axes)}")
    return found._replace(fits_mirrored=not _problem(grid, _fitted(grid, points, axes[1::-1] + axes[2:])))


def _hint(grid: MineGrid, points: NDArray, axes: tuple[str, ...]) -> str:
    """Clause on other axes with which common points fit: mirrored in plan, or with z down; empty if none do."""
    plan, vertical = axes[:2], axes[2:]
    turned = () if vertical == (DOWN,) else (DOWN,)
    for others, what in ((plan[::-1] + vertical, "mirrored"), (plan + turned, "with z the other way"),
                         (plan[::-1] + turned, "mirrored, with z the other way")):  # fmt: skip
        if not _problem(grid, _fitted(grid, points, others)):
            return f"; with axes: [{', '.join(others)}], {what}, they fit"
    return ""


def _problem(grid: MineGrid, found: Fit) -> str:
    """Why a fit is refused; empty if it is not."""
    if not MIN_SCALE <= found.map.scale <= MAX_SCALE:
        return (
            f"frame.grid.points: distances on the map are {found.map.scale:.6g} times those in the grid "
            f"({MIN_SCALE:g} to {MAX_SCALE:g} are possible); check the points, their units and axes"
        )
    for residual, where in ((found.residual, "in plan"), (found.elevation_residual, "in elevation")):
        worst = int(residual.argmax())
        if residual[worst] > grid.max_residual:
            return (
                f"frame.grid.points[{worst}]: is missed by {residual[worst]:.3g} m {where} (max_residual "
                f"{grid.max_residual:g} m); check the coordinates of all points, their units and axes"
            )
    return ""


def _fitted(grid: MineGrid, points: NDArray, axes: tuple[str, ...]) -> Fit:
    own = np.array([point.grid for point in grid.points], float)
    means = own.mean(axis=0), points.mean(axis=0)
    directions = np.array([DIRECTIONS[axis] for axis in axes[:2]], float).T
    local, there = (own - means[0])[:, :2] @ directions.T, (points - means[1])[:, :2]
    local, there = local @ [1, 1j], there @ [1, 1j]
    similarity = np.sum(local.conj() * there) / np.sum(np.abs(local) ** 2)
    angle = float(-np.degrees(np.angle(similarity)))
    if abs(angle - 90.0 * round(angle / 90.0)) < MAX_ROUND_OFF:
        angle = 90.0 * round(angle / 90.0)
    scale = float(np.abs(similarity)) if grid.scale is None else grid.scale
    scale = 1.0 if abs(scale - 1.0) < MAX_ROUND_OFF else scale
    grid_origin, map_origin = (_in_space(mean.tolist()) for mean in means)
    found = GridMap(axes, angle, scale, grid_origin, map_origin, grid.units)
    misses = found.to_map(own) - points
    vertical = np.abs(misses[:, 2]) if misses.shape[1] == 3 else np.zeros(len(points))
    return Fit(found, np.hypot(misses[:, 0], misses[:, 1]), vertical)
