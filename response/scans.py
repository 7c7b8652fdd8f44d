"""Overbreak of scanned voids by wall, beside the rock that the model has failed there.

Its columns are declared in common/scan_table.py.
"""

import logging
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import norm

from common.fields import Field
from common.opening_table import SIDES
from common.scan_table import ALL, FIELDS, POINT_FIELDS
from mpm_core.geometry.inside import CROSSED, INSIDE, classify_cells, popcount, sample_mask
from mpm_core.geometry.solids import Solid
from response.opening_table import DEPTH_SHARE, nearest_wall, weighted_quantile
from response.rock import Rock, Voids, is_computed
from response.scan_rays import AT_WALL, entry_behind, reach_of_void
from response.scan_settings import PlacedScan, ScanSlice
from response.scanned_surface import read_scan
from response.wall_means import LEVEL, mean_and_interval
from response.wall_rays import STEP, fallen_depth, first_rock, look_behind, standing
from response.walls import Walls, mined_walls

PARTS_OF_CELL = 2  # Cells of the lattice of volumes along a finest cell; each has 64 points.
MAX_LATTICE = 1_000_000  # Cells of that lattice; of a larger one they are larger.
MIN_ALIGNED = 0.1  # Length of the mean of four-fold directions below which walls look to all sides alike.
MAX_SHIFTED = 0.5  # Of the r.m.s. distance from the design that is left after a shift which explains the scan.


@dataclass(frozen=True)
class ScannedWalls:
    """Walls with rock behind them that a scan belongs to, and what it and the model show there.

    scanned (point,) m: overbreak, negative underbreak, NaN where the scan shows no wall; through (point,) bool: the
    overbreak meets another opening; depth, fallen (point,) m: modelled; over, under, failed, gone (point,) m3: scanned
    void beyond the design, design that is no void, modelled failed rock, and fallen rock, to which the point is
    nearest.
    """

    walls: Walls
    scanned: NDArray
    through: NDArray
    depth: NDArray
    fallen: NDArray
    over: NDArray
    under: NDArray
    failed: NDArray
    gone: NDArray


def compare_scans(settings: ScanSlice, grid: xr.Dataset, states: Iterable[xr.Dataset]) -> xr.Dataset:
    """The table of scanned voids. states: of settings.compared, in order."""
    steps = [step.name for step in settings.steps]
    names, mined, _, walls = mined_walls(grid, settings.excavations, steps)
    rows: list[tuple] = []
    points: list[list[NDArray]] = []
    for step, state in zip(settings.compared, states, strict=True):
        if not is_computed(state):
            break  # nor are those after it
        is_mined = (mined >= 0) & (mined <= steps.index(step))
        rock = Rock(state, Voids.of(grid, is_mined))
        here = walls.at(np.flatnonzero(is_mined[walls.excavation]))
        here = here.at(np.flatnonzero(standing(rock, here)))
        modelled = _modelled(rock, here)
        for scan in [one for one in settings.scans if one.step == step]:
            own_excavations = [names.index(name) for name in scan.excavations]
            found = _compare(scan, grid, rock, here, modelled, own_excavations, is_mined)
            own = list(_rows(scan, found, rock.edge))
            points.append(_points(found, own, len(rows)))
            rows += own
    logging.info("scans: %d rows of %d scans", len(rows), len(settings.scans))
    columns = zip(*rows, strict=True) if rows else [() for _ in FIELDS]
    every = [np.concatenate(column) for column in zip(*points, strict=True)]
    every = every or [np.empty((0, 3)) if "xyz" in field.dims else np.empty(0) for field in POINT_FIELDS]
    return xr.Dataset(_variables(FIELDS, columns) | _variables(POINT_FIELDS, every))


def _variables(fields: Sequence[Field], columns: Iterable) -> dict[str, tuple]:
    """Variables of a dataset: declared columns with their values."""
    named = zip(fields, columns, strict=True)
    return {field.name: (field.dims, np.array(column, field.dtype), field.attributes) for field, column in named}


def design_solids(grid: xr.Dataset, excavations: Iterable[int]) -> list[Solid]:
    """Solids of excavations of grid.nc, by their indices."""
    owner, facets = grid["solid_excavation"].values, grid["solid_facets"].values
    return [Solid(str(one), grid["solid_position"].values, facets[owner == one]) for one in excavations]


def _modelled(rock: Rock, walls: Walls) -> dict[str, NDArray]:
    """What the model shows at all walls with rock behind them: depth, fallen, failed and gone of ScannedWalls."""
    if not len(walls):
        return dict.fromkeys(("depth", "fallen", "failed", "gone"), np.empty(0))
    tree = cKDTree(walls.place)
    failed_place, failed, _ = rock.failed_volume
    fallen_place, fallen = rock.fallen_volume
    gone = np.bincount(nearest_wall(tree, fallen_place), fallen, minlength=len(walls))
    return {
        "depth": look_behind(rock, walls, tree).depth,
        "fallen": fallen_depth(rock, walls),
        "failed": np.bincount(nearest_wall(tree, failed_place), failed, minlength=len(walls)) + gone,
        "gone": gone,
    }


def _compare(
    scan: PlacedScan,
    grid: xr.Dataset,
    rock: Rock,
    walls: Walls,
    modelled: dict[str, NDArray],
    excavations: list[int],
    is_mined: NDArray,
) -> ScannedWalls:
    """What a scan and the model show at the walls of its excavations.

    walls: all with rock behind them; modelled: see _modelled; excavations: indices; is_mined (excavation,) bool.
    """
    design = design_solids(grid, excavations)
    solid = read_scan(scan, design, f"observations.scans.{scan.name}")
    chosen = np.flatnonzero(np.isin(walls.excavation, excavations))
    own, count = walls.at(chosen), len(chosen)
    if not count:  # other openings have taken all rock around
        logging.warning("%s: no wall of its excavations has rock behind it", scan.name)
        return ScannedWalls(own, *(np.empty(0) for _ in range(8)))
    stations = None if scan.stations is None else np.array(scan.stations)
    scanned = reach_of_void(solid, own.place, own.normal, stations)
    whole = Solid(scan.name, grid["solid_position"].values, np.concatenate([one.facets for one in design]))
    beyond = np.flatnonzero(scanned < 0.0)
    scanned[beyond[scanned[beyond] < entry_behind(whole, own.place[beyond], own.normal[beyond]) + AT_WALL]] = np.nan
    opened = _first_opening(rock, own, scanned)
    through = np.isfinite(opened)
    scanned[through] = opened[through]
    _tell_shift(scan, own, scanned)
    others = design_solids(grid, [one for one in np.flatnonzero(is_mined).tolist() if one not in excavations])
    (over_place, over), (under_place, under) = _differences(solid, design, others, rock)
    tree = cKDTree(own.place)
    return ScannedWalls(
        own,
        scanned,
        through,
        over=np.bincount(nearest_wall(tree, over_place), over, minlength=count),
        under=np.bincount(nearest_wall(tree, under_place), under, minlength=count),
        **{name: values[chosen] for name, values in modelled.items()},
    )


def _first_opening(rock: Rock, walls: Walls, reach: NDArray) -> NDArray:
    """Distance (point,) m from walls at which another opening begins, or their own again, by STEP; NaN where there is
    none within `reach` (point,) m."""
    found, step = np.full(len(walls), np.nan), STEP * rock.edge
    begin = np.nan_to_num(first_rock(rock, walls))
    going, number = np.flatnonzero(np.nan_to_num(reach) > begin), 0
    while len(going):
        away = begin[going] + (number + 0.5) * step
        going, away = going[away < reach[going]], away[away < reach[going]]
        opened = rock.voids.hold(rock.in_cells(walls.place[going] + away[:, None] * walls.normal[going]))
        found[going[opened]] = away[opened] - 0.5 * step
        going, number = going[~opened], number + 1
    return found


def _tell_shift(scan: PlacedScan, walls: Walls, scanned: NDArray) -> None:
    """Warn of a scan that fits the design much better in another place."""
    seen = np.flatnonzero(np.isfinite(scanned))
    normal, root = walls.normal[seen], np.sqrt(walls.area[seen])
    shift = np.linalg.lstsq(root[:, None] * normal, root * scanned[seen], rcond=1e-3)[0]
    before, after = (
        np.sqrt(np.average(distance**2, weights=walls.area[seen])) if len(seen) else 0.0
        for distance in (scanned[seen], scanned[seen] - normal @ shift)
    )
    east, north, up = (round(float(part), 2) + 0.0 for part in shift)
    if np.linalg.norm(shift) > 2.0 * scan.error and after < MAX_SHIFTED * before:
        logging.warning(
            "%s lies (%.2f, %.2f, %.2f) m from the design, root mean square %.2f m, without this shift %.2f m: check "
            "its coordinates", scan.name, east, north, up, before, after,
        )  # fmt: skip


def _differences(
    solid: Solid, design: Sequence[Solid], others: Sequence[Solid], rock: Rock
) -> tuple[tuple[NDArray, NDArray], tuple[NDArray, NDArray]]:
    """Scanned void beyond the design and all other openings, and design that is no scanned void: places (k, xyz) m of
    the parts in the cells of a lattice, and their volumes (k,) m3."""
    boxes = np.array([one.bounds for one in (solid, *design)])
    upper_end = rock.lower + rock.grid.shape * rock.edge
    lower = np.clip(boxes[:, 0].min(axis=0), rock.lower, upper_end)
    upper = np.clip(boxes[:, 1].max(axis=0), rock.lower, upper_end)
    cell = max(rock.edge / PARTS_OF_CELL, float((np.prod(upper - lower) / MAX_LATTICE) ** (1 / 3)))
    shape = np.maximum(np.ceil((upper - lower) / cell), 1).astype(int)
    index = np.indices(shape).reshape(3, -1).T.astype(np.int32)

    def held_by(solids: Iterable[Solid]) -> NDArray:
        """Parts of the cells that solids hold."""
        mask = np.zeros(len(index), np.uint64)
        for one in solids:
            if (one.bounds[0] < upper).all() and (one.bounds[1] > lower).all():
                kind = classify_cells(one, lower, cell, index)
                mask[kind == INSIDE] = ~np.uint64(0)
                crossed = np.flatnonzero(kind == CROSSED)
                mask[crossed] |= sample_mask(one, lower, cell, index[crossed])
        return mask

    void, own = held_by([solid]), held_by(design)
    found = []
    for part in (void & ~own & ~held_by(others), own & ~void):
        some = np.flatnonzero(part)
        found.append((lower + (index[some] + 0.5) * cell, popcount(part[some]) / 64.0 * cell**3))
    return found[0], found[1]


def wall_bearings(walls: Walls) -> NDArray:
    """Bearing (point,) degrees from north, clockwise, that each wall looks to, into the rock: one of four at right
    angles, which fit the walls best; NaN for roof, floor and face.

    The four directions are those of the mean of exp(4 i a) over the area, a the direction of a normal in plan. Walls
    that look to all sides alike are divided to east, north, west and south.
    """
    own = np.flatnonzero(walls.side == SIDES.index("walls"))
    bearing = np.full(len(walls), np.nan)
    if not len(own):
        return bearing
    direction = np.arctan2(walls.normal[own, 0], walls.normal[own, 1])
    mean = np.average(np.exp(4j * direction), weights=walls.area[own])
    first = 0.25 * float(np.angle(mean)) if abs(mean) > MIN_ALIGNED else 0.0
    quarter = np.round((direction - first) / (0.5 * np.pi)).astype(int) % 4
    for one in range(4):
        same = own[quarter == one]
        if len(same):
            east, north = walls.area[same] @ walls.normal[same][:, :2]
            bearing[same] = np.round(np.degrees(np.arctan2(east, north)), 6) % 360.0
    return bearing


def _rows(scan: PlacedScan, found: ScannedWalls, cell: float) -> Iterator[tuple]:
    """Rows of a scan in the order of FIELDS: all its walls, then each side."""
    for side, bearing, own in _sides(found.walls):
        walls, seen = found.walls, own[np.isfinite(found.scanned[own])]
        place, area = walls.place[seen], walls.area[seen]
        over, under = np.maximum(found.scanned[seen], 0.0), np.maximum(-found.scanned[seen], 0.0)
        depth, fallen, volume = found.depth[seen], found.fallen[seen], float(found.over[seen].sum())
        yield (
            scan.name, scan.step, side, bearing, float(walls.area[own].sum()), float(area.sum()),
            _mean(over, area), _quantile(over, area), float(over.max()) if len(seen) else np.nan,
            *((volume, volume / area.sum()) if len(seen) else (np.nan, np.nan)),
            _mean(under, area), float(found.under[seen].sum()) if len(seen) else np.nan,
            _mean(found.through[seen].astype(float), area),
            _mean(depth, area), _quantile(depth, area), _mean(fallen, area),
            float(found.failed[seen].sum()) if len(seen) else np.nan,
            float(found.gone[seen].sum()) if len(seen) else np.nan,
            *_misfit(over - depth, place, area, scan.error), *_misfit(over - fallen, place, area, scan.error), cell,
        )  # fmt: skip


def _sides(walls: Walls) -> Iterator[tuple[str, float, NDArray]]:
    """Name, bearing and points of all walls, then of roof, floor and face, and of walls by their bearings."""
    bearing = wall_bearings(walls)
    yield ALL, np.nan, np.arange(len(walls))
    for number, side in enumerate(SIDES):
        own = np.flatnonzero(walls.side == number)
        if side != "walls" and len(own):
            yield side, np.nan, own
    for one in np.unique(bearing[np.isfinite(bearing)]):
        yield f"wall {round(one) % 360:03d}", float(one), np.flatnonzero(bearing == one)


def _mean(values: NDArray, area: NDArray) -> float:
    """Mean over the area; NaN without any."""
    return float(np.average(values, weights=area)) if len(values) else np.nan


def _quantile(values: NDArray, area: NDArray) -> float:
    """What nine tenths of the area do not exceed; NaN without any."""
    return weighted_quantile(values, area, DEPTH_SHARE) if len(values) else np.nan


def _misfit(values: NDArray, place: NDArray, area: NDArray, error: float) -> tuple[float, float, float]:
    """Mean over the area and its 95 % interval, of the roughness of the wall and of the place of the scan together."""
    mean, low, high = mean_and_interval(values, place, area)
    of_place = float(norm.ppf(0.5 + 0.5 * LEVEL)) * error
    return mean, mean - float(np.hypot(mean - low, of_place)), mean + float(np.hypot(high - mean, of_place))


def _points(found: ScannedWalls, rows: list[tuple], before: int) -> list[NDArray]:
    """Columns of POINT_FIELDS; rows: those of the scan, after so many others."""
    row = np.zeros(len(found.walls), np.int32)
    for number, (_, _, own) in enumerate(_sides(found.walls)):
        row[own] = before + number
    assert len(rows) == number + 1
    return [row, found.walls.place, found.walls.area, found.scanned, found.depth, found.fallen]
