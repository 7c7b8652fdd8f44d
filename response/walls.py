"""Points on the walls of excavations: where, which way the rock lies, and which side of the opening they belong to."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from common.opening_table import ROOF_FROM, SIDES
from response.centre_lines import CentreLine, centre_lines
from response.rock import axes_of
from response.settings import MinedOpening

STEEPEST_WALL = np.sin(
    np.radians(90.0 - ROOF_FROM)
)  # A wall's normal rises or falls less than this; others are roof and floor.
FACE = np.cos(np.radians(45.0))  # A face's normal lies along the drive by more than this.
POINTS_PER_CELL = 2.0  # Along an edge of a finest cell.
MIN_ROOF = 0.1  # Sine of the angle between a drive and the vertical below which it is a shaft.
NEVER = -1  # No step.


@dataclass(frozen=True)
class Walls:
    """Points of walls.

    place (point, xyz) m; normal (point, xyz): unit vector out of the opening, into the rock; area (point,) m2 that the
    point stands for; excavation (point,): its index; side (point,): index into SIDES; up (point, xyz): unit vector
    towards the roof, perpendicular to the drive's axis, 0 in a shaft; chainage (point,): m along the centre line of a
    drive, NaN where an excavation is none.
    """

    place: NDArray
    normal: NDArray
    area: NDArray
    excavation: NDArray
    side: NDArray
    up: NDArray
    chainage: NDArray

    def at(self, chosen: NDArray) -> "Walls":
        """Some of the points."""
        return Walls(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def __len__(self) -> int:
        return len(self.area)


def mined_walls(
    grid: xr.Dataset, excavations: Sequence[MinedOpening], steps: list[str]
) -> tuple[list[str], NDArray, NDArray, Walls]:
    """Names of the excavations of grid.nc in its order, index of the step that mines and that fills each
    (excavation,), NEVER where none of `steps` does, and points on the walls of those that are mined."""
    names = json.loads(grid.attrs["excavation_names"])
    entries = {entry.name: entry for entry in excavations}
    place = {name: number for number, name in enumerate(steps)}
    mined = np.array([place.get(entries[name].mined, NEVER) for name in names])
    filled = np.array([place.get(entries[name].filled, NEVER) for name in names])
    paths = [None if (path := entries[name].path) is None else np.array(path) for name in names]
    walls = sample_walls(grid, centre_lines(grid, paths))
    return names, mined, filled, walls.at(np.flatnonzero(mined[walls.excavation] != NEVER))


def sample_walls(grid: xr.Dataset, lines: list[CentreLine | None]) -> Walls:
    """Points on the surfaces of all excavations of grid.nc, POINTS_PER_CELL along a finest cell.

    lines: centre line of each excavation that is a drive. In plane strain a point stands for a strip of the thickness.
    Facets without area are left out, and what lies outside of the domain.
    """
    position, facets = grid["solid_position"].values, grid["solid_facets"].values.astype(np.int64)
    owner, spacing = grid["solid_excavation"].values.astype(np.int64), grid.attrs["fine_cell"] / POINTS_PER_CELL
    if grid.attrs["plane"] == "none":
        corners = position[facets]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size, depth = 0.5 * np.linalg.norm(across, axis=1), 1.0
    else:
        corners = position[facets[:, :2]]
        along = corners[:, 1] - corners[:, 0]
        across = np.cross(along, np.cross(*np.eye(3)[axes_of(grid)]))
        size, depth = np.linalg.norm(along, axis=1), float(grid.attrs["thickness"])
    axes = axes_of(grid)
    lower, upper = (np.asarray(grid.attrs[f"domain_{end}"])[axes] for end in ("lower", "upper"))
    low, high = corners[:, :, axes].min(axis=1), corners[:, :, axes].max(axis=1)
    kept = np.flatnonzero((size > 0.0) & (high >= lower).all(axis=1) & (low <= upper).all(axis=1))
    normal = across[kept] / np.linalg.norm(across[kept], axis=1)[:, None]
    place, area, facet = _spread(corners[kept], size[kept], spacing)
    place, normal, area, owner = _merged(place, normal[facet], depth * area, owner[kept][facet], spacing)
    inside = ((place[:, axes] >= lower) & (place[:, axes] <= upper)).all(axis=1)
    place, normal, area, owner = place[inside], normal[inside], area[inside], owner[inside]
    up, along, chainage = _frame(place, owner, lines)
    rise = np.einsum("pi,pi->p", normal, up)
    side = np.full(len(place), SIDES.index("walls"))
    side[rise > STEEPEST_WALL] = SIDES.index("roof")
    side[rise < -STEEPEST_WALL] = SIDES.index("floor")
    side[np.abs(np.einsum("pi,pi->p", normal, along)) > FACE] = SIDES.index("face")
    return Walls(place, normal, area, owner, side, up, chainage)


def _spread(corners: NDArray, size: NDArray, spacing: float) -> tuple[NDArray, NDArray, NDArray]:
    """Points (point, xyz) that stand for facets (facet, corner, xyz), the size of each, and its facet (point,).

    size (facet,): area of triangles, length of segments, above 0. A triangle is cut across its longest edge into strips
    at most `spacing` m wide, and each strip into parts at most as long, so that slivers have no more points than their
    length needs.
    """
    if corners.shape[1] == 2:
        count = np.ceil(size / spacing).astype(np.int64)
        facet, number = _numbered(count)
        along = (number + 0.5) / count[facet]
        own = corners[facet]
        return own[:, 0] + along[:, None] * (own[:, 1] - own[:, 0]), (size / count)[facet], facet
    edges = np.roll(corners, -1, axis=1) - corners
    length = np.linalg.norm(edges, axis=2)
    first, row = length.argmax(axis=1), np.arange(len(corners))
    start, longest, length = corners[row, first], edges[row, first], length[row, first]
    apex = corners[row, (first + 2) % 3] - start
    foot = np.clip(np.einsum("fi,fi->f", apex, longest) / length**2, 0.0, 1.0)  # of the apex, along the longest edge
    across = apex - foot[:, None] * longest
    strips = np.ceil(length / spacing).astype(np.int64)
    facet, number = _numbered(strips)
    low, high = number / strips[facet], (number + 1) / strips[facet]
    share = _area_before(high, foot[facet]) - _area_before(low, foot[facet])
    middle = 0.5 * (low + high)
    width = np.minimum(
        middle / np.maximum(foot[facet], middle), (1.0 - middle) / np.maximum(1.0 - foot[facet], 1.0 - middle)
    )
    parts = np.maximum(np.ceil(width * np.linalg.norm(across[facet], axis=1) / spacing), 1).astype(np.int64)
    strip, number = _numbered(parts)
    facet, height = facet[strip], width[strip] * (number + 0.5) / parts[strip]
    place = start[facet] + middle[strip, None] * longest[facet] + height[:, None] * across[facet]
    return place, size[facet] * share[strip] / parts[strip], facet


def _numbered(count: NDArray) -> tuple[NDArray, NDArray]:
    """Index of the owner and number, from 0, of each of `count` (n,) parts."""
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)


def _area_before(along: NDArray, foot: NDArray) -> NDArray:
    """Share of a triangle's area before a place along its longest edge, 0 to 1; foot: that of its apex."""
    rising = along**2 / np.where(foot > 0.0, foot, 1.0)
    falling = 1.0 - (1.0 - along) ** 2 / np.where(foot < 1.0, 1.0 - foot, 1.0)
    return np.where(along <= foot, rising, falling)


def _merged(
    place: NDArray, normal: NDArray, area: NDArray, owner: NDArray, spacing: float
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """One point for all facets of an excavation that lie in the same cube of `spacing` m and look the same way.

    It has their mean place and normal, and the sum of their areas: a surface may have many facets in a cell.
    """
    cube = np.floor(place / spacing).astype(np.int64)
    facing = 2 * np.abs(normal).argmax(axis=1)
    facing += normal[np.arange(len(normal)), facing // 2] > 0.0
    keys = np.column_stack([owner, cube - cube.min(axis=0, initial=0), facing])
    _, group = np.unique(np.ravel_multi_index(keys.T, keys.max(axis=0, initial=0) + 1), return_inverse=True)
    total = np.bincount(group, area)
    places, normals = (
        np.stack([np.bincount(group, area * column) for column in values.T], axis=1) / total[:, None]
        for values in (place, normal)
    )
    first = np.empty(len(total), np.int64)
    first[group[::-1]] = np.arange(len(group))[::-1]
    return places, normals / np.linalg.norm(normals, axis=1)[:, None], total, owner[first]


def _frame(place: NDArray, owner: NDArray, lines: list[CentreLine | None]) -> tuple[NDArray, NDArray, NDArray]:
    """Direction of the roof (point, xyz), axis of the drive (point, xyz), 0 without one, and chainage (point,) m."""
    up, along = np.tile([0.0, 0.0, 1.0], (len(place), 1)), np.zeros((len(place), 3))
    chainage = np.full(len(place), np.nan)
    for index, line in enumerate(lines):
        if line is None or not len(own := np.flatnonzero(owner == index)):
            continue
        chainage[own], along[own] = line.project(place[own])
        across = up[own] - along[own] * along[own][:, 2:]
        length = np.linalg.norm(across, axis=1)
        shaft = length < MIN_ROOF  # A vertical one has walls and faces only.
        across[shaft], length[shaft] = 0.0, 1.0
        up[own] = across / length[:, None]
    return up, along, chainage
