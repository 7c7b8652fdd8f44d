"""Table of openings: what each step has done to each side of each excavation, and along each drive.

Its columns are declared in common/opening_table.py.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from common.opening_table import ALL, FIELDS, SIDES
from response.rock import Rock
from response.wall_rays import closure, find_chords, look_behind, wall_displacement
from response.walls import Walls

DEPTH_SHARE = 0.9  # Of the wall, which does not exceed depth_p90.


@dataclass(frozen=True)
class StepOpenings:
    """Excavations in a step. mined (excavation,): index of the step that mines each, -1 never; filled (excavation,):
    that fills it, -1 never; step: index of this step."""

    names: Sequence[str]
    mined: NDArray
    filled: NDArray
    step: int

    @property
    def is_mined(self) -> NDArray:
        """True (excavation,) for those that have been mined."""
        return (self.mined >= 0) & (self.mined <= self.step)

    @property
    def is_open(self) -> NDArray:
        """True (excavation,) for those that have been mined and not filled."""
        return self.is_mined & ~((self.filled >= 0) & (self.filled <= self.step))


@dataclass(frozen=True)
class Measured:
    """What walls (point,) show of the rock after a step; NaN where they show nothing.

    depth m, through bool, see wall_rays.Behind; inward m: displacement into the opening; closed m: closure with the
    opposite wall; failed, new, fallen m3: volume of the failed rock that is nearest to this wall, of what failed in
    this step, and of rock that has fallen; stress, change MPa: largest compression in the first intact rock, and since
    virgin rock; factor: strength over stress there; modelled, recorded: number of events nearest to this wall.
    """

    depth: NDArray
    through: NDArray
    inward: NDArray
    closed: NDArray
    failed: NDArray
    new: NDArray
    fallen: NDArray
    stress: NDArray
    change: NDArray
    factor: NDArray
    modelled: NDArray
    recorded: NDArray


def measure(
    rock: Rock,
    virgin: NDArray,
    walls: Walls,
    moved_before: NDArray,
    number: int,
    modelled: NDArray,
    recorded: NDArray | None,
) -> Measured:
    """What the walls (point,) that stand after a step show of the rock; at least one.

    virgin (point,) Pa: largest virgin compression at the walls. moved_before (point, xyz) m: displacement of the walls
    before they were mined. number: index of the step. modelled, recorded (k, xyz) m: events of the step; None where
    there is no record of it.
    """
    count, tree = len(walls), cKDTree(walls.place)
    behind = look_behind(rock, walls, tree)
    moved = wall_displacement(rock, walls) - moved_before
    chords = find_chords(rock, walls, float(np.linalg.norm(np.ptp(walls.place, axis=0))) + rock.edge)
    closed = np.full(count, np.nan)
    closed[chords.wall] = closure(chords, moved)
    place, volume, step = rock.failed_volume
    nearest, now = nearest_wall(tree, place), step == number
    fallen_place, fallen_volume = rock.fallen_volume
    stress, factor = np.full(count, np.nan), np.full(count, np.nan)
    intact = np.flatnonzero(behind.particle >= 0)
    principal, factor[intact] = rock.stress_of_cells(behind.particle[intact])
    stress[intact] = -principal[:, 0] / 1e6
    return Measured(
        depth=behind.depth,
        through=behind.through,
        inward=-np.einsum("pi,pi->p", moved, walls.normal),
        closed=closed,
        failed=np.bincount(nearest, volume, minlength=count),
        new=np.bincount(nearest[now], volume[now], minlength=count),
        fallen=np.bincount(nearest_wall(tree, fallen_place), fallen_volume, minlength=count),
        stress=stress,
        change=stress - virgin / 1e6,
        factor=factor,
        modelled=np.bincount(nearest_wall(tree, modelled), minlength=count),
        recorded=np.full(count, np.nan)
        if recorded is None
        else np.bincount(nearest_wall(tree, recorded), minlength=count),
    )


def nearest_wall(tree, points: NDArray) -> NDArray:
    """Index (n,) of the wall nearest to each of some points (n, xyz) m."""
    return tree.query(points)[1] if len(points) else np.empty(0, np.int64)


def rows_of(walls: Walls, found: Measured, openings: StepOpenings, step: str, length: float) -> Iterator[tuple]:
    """Rows of a step in the order of FIELDS: each excavation, its sides, and stretches of `length` m along drives."""
    order = np.argsort(walls.excavation, kind="stable")
    bounds = np.searchsorted(walls.excavation[order], np.arange(len(openings.names) + 1))
    filled = openings.is_mined & ~openings.is_open
    for excavation in np.flatnonzero(openings.is_mined).tolist():
        own = order[bounds[excavation] : bounds[excavation + 1]]
        if not len(own):
            continue
        about, state = (step, openings.names[excavation]), int(filled[excavation])
        for side, chosen in _sides(walls, own):
            yield (*about, side, np.nan, np.nan, state, *_values(walls, found, chosen))
        chainage = walls.chainage[own]
        if np.isnan(chainage).all():
            continue
        last = float(chainage.max())
        stretch = np.clip(np.floor(chainage / length), 0, max(np.ceil(last / length) - 1, 0))
        for part in np.unique(stretch):
            ends = float(part * length), float(min((part + 1) * length, last))
            for side, chosen in _sides(walls, own[stretch == part]):
                yield (*about, side, *ends, state, *_values(walls, found, chosen))


def _sides(walls: Walls, own: NDArray) -> Iterator[tuple[str, NDArray]]:
    """All of these walls (k,), then those of each side that they have."""
    yield ALL, own
    for index, side in enumerate(SIDES):
        chosen = own[walls.side[own] == index]
        if len(chosen):
            yield side, chosen


def _values(walls: Walls, found: Measured, own: NDArray) -> tuple:
    """Columns of a row from wall_area on, of these walls (k,)."""
    area, depth, closed = walls.area[own], found.depth[own], found.closed[own]
    closed, factor = closed[np.isfinite(closed)], found.factor[own]
    return (
        float(area.sum()),
        float(depth.max()),
        weighted_quantile(depth, area, DEPTH_SHARE),
        float(np.average(depth, weights=area)),
        float(np.average(found.through[own], weights=area)),
        float(found.failed[own].sum()),
        float(found.new[own].sum()),
        float(found.fallen[own].sum()),
        float(closed.max()) if len(closed) else np.nan,
        float(np.median(closed)) if len(closed) else np.nan,
        _mean(found.inward[own], area),
        _mean(found.stress[own], area),
        _mean(found.change[own], area),
        float(np.nanmin(factor)) if np.isfinite(factor).any() else np.nan,
        int(found.modelled[own].sum()),
        float(found.recorded[own].sum()),
    )


def _mean(values: NDArray, weights: NDArray) -> float:
    """Weighted mean of the values that are finite; NaN without any."""
    known = np.isfinite(values)
    return float(np.average(values[known], weights=weights[known])) if known.any() else np.nan


def weighted_quantile(values: NDArray, weights: NDArray, share: float) -> float:
    """The least of the values that this share of the weights does not exceed.

    >>> weighted_quantile(np.array([3.0, 1.0, 2.0]), np.array([1.0, 1.0, 8.0]), 0.9)
    2.0
    """
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][min(np.searchsorted(total, share * total[-1]), len(values) - 1)])


def table(rows: list[tuple]) -> xr.Dataset:
    """Dataset of rows, with the units and meanings of FIELDS."""
    columns = list(zip(*rows, strict=True)) if rows else [() for _ in FIELDS]
    return xr.Dataset(
        {
            field.name: (field.dims, np.array(column, field.dtype), field.attributes)
            for field, column in zip(FIELDS, columns, strict=True)
        }
    )
