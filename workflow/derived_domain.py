"""Values that follow from a mine file: the domain around its openings, the largest cell, the number of levels."""

import functools
import itertools
import logging
import math
import os
from collections.abc import Iterator, Sequence

import numpy as np

from common.errors import InputError
from mpm_core.geometry.shapes.shape import Opening, Shape
from mpm_core.geometry.solid_files import Picked, read_solid
from mpm_core.grid.domain import base_cells
from mpm_core.scene.far_field import MAX_LIMITED_BOUNDARY_ERROR, STRENGTH, FarField, bounds, derive_domain
from mpm_core.scene.scene import FACES, PLANES
from mpm_core.scene.scene_solids import exchanged_hint, picked, prisms_of
from mpm_core.settings import (
    DEFAULT_COARSE_CELL,
    DEFAULT_LEVELS,
    MAX_LEVELS,
    Boundary,
    GridSettings,
    ShapeSettings,
    SolidSettings,
)
from workflow.accuracy import PRESETS
from workflow.mine import Mine
from workflow.shapes import check_form
from workflow.virgin_rock import Rocks, overstress

MAX_CHECKED_DISTANCE = 1e5  # m from the openings: virgin rock further away is not checked
LAYERS = 200  # distances from the openings, up to MAX_CHECKED_DISTANCE, at which the rock is looked up
MAX_COARSE_CELLS = 10**9  # the finer ones come on top
# Where an empty stretch takes this share of the length of all openings along an axis, what lies beyond it is named.
MIN_EMPTY_SHARE = 0.5
SAME = 1e-9  # share by which sizes differ that are the same


def complete(mine: Mine) -> None:
    """Complete domain and grid of a mine file. Raises InputError, one line, for what contradicts."""
    domain, finest = mine.settings.domain, mine.settings.grid.finest_cell
    coarse, levels = _sizes(mine.settings.grid)
    missing = [key for key in ("lower", "upper") if getattr(domain, key) is None]
    if len(missing) == 1:
        raise InputError(f"domain.{missing[0]}: missing key; give both corners, or none and grid.finest_cell")
    if missing and finest is None:
        raise InputError(
            "domain: missing key: give lower and upper, or grid.finest_cell, from which the domain follows"
        )
    if missing:
        coarse, levels = _derive(mine, finest, levels)
    elif finest is None and coarse is None:
        most = levels or DEFAULT_LEVELS
        finest = DEFAULT_COARSE_CELL / 2 ** (most - 1)
        coarse, levels = _divide(mine, finest, [most] if levels else range(most, 0, -1))
    elif coarse is None:
        coarse, levels = _divide(mine, finest, range(_levels(mine)[1], 0, -1))
    # the finest follow from these from now on
    mine.change("grid", finest_cell=None, coarse_cell=coarse, levels=levels or DEFAULT_LEVELS)
    if mine.settings.domain.boundary is None:
        mine.change("domain", boundary="fixed")


def _sizes(grid: GridSettings) -> tuple[float | None, int | None]:
    """Size of the largest cells, m, and number of levels, as they are given or follow from the size of the finest.

    Raises InputError for those that contradict each other.
    """
    finest, coarse, levels = grid.finest_cell, grid.coarse_cell, grid.levels
    if finest is None:
        return coarse, levels
    if coarse is not None:
        doubled = round(np.log2(coarse / finest))
        if not 0 <= doubled < MAX_LEVELS or abs(coarse - finest * 2**doubled) > SAME * coarse:
            raise InputError(
                f"grid.finest_cell: {finest:.15g} m doubled up to {MAX_LEVELS - 1} times does not make "
                f"grid.coarse_cell, {coarse:.15g} m; leave one of the two out"
            )
        if levels not in (None, doubled + 1):
            raise InputError(
                f"grid.finest_cell: {finest:.15g} m, but grid.coarse_cell {coarse:.15g} m and grid.levels "
                f"{levels} make {coarse / 2 ** (levels - 1):.15g} m; leave one of the three out"
            )
        return coarse, doubled + 1
    return (None, None) if levels is None else (finest * 2 ** (levels - 1), levels)


def largest_cell_name(mine: Mine) -> str:
    """Text for messages on the keys that set the largest cell: grid.coarse_cell, or finest_cell and levels."""
    if "coarse_cell" in mine.written_cells:
        return "grid.coarse_cell"
    return f"grid.finest_cell times 2^{mine.settings.grid.levels - 1} (grid.levels)"


def _levels(mine: Mine) -> tuple[int, int]:
    """Fewest and most levels of cells that leave the preset of accuracy a level to remove or to add."""
    more = PRESETS[mine.settings.accuracy].levels
    return 1 + max(-more, 0), MAX_LEVELS - max(more, 0)


def _divide(mine: Mine, finest: float, choices: Sequence[int]) -> tuple[float, int]:
    """Size of the largest cells, m, and the first of these numbers of levels, from finest m on, with which they tile a
    domain that is given. Raises InputError if there is none."""
    lower, upper = (np.array(corner) for corner in (mine.settings.domain.lower, mine.settings.domain.upper))
    if not len(lower) == len(upper) == mine.dimension or (upper <= lower).any():
        return finest, 1  # said by the checks that follow
    for levels in choices:
        coarse = finest * 2 ** (levels - 1)
        try:
            base_cells(lower, upper, coarse)
        except InputError:
            continue
        return coarse, levels
    sides = ", ".join(f"{side:.15g} m" for side in upper - lower)
    problem = f"the sides of the domain ({sides}) are no whole multiples of {coarse:.15g} m"
    if "finest_cell" in mine.written_cells:
        raise InputError(f"grid.finest_cell: {problem}; change one, or leave domain.lower and domain.upper out")
    is_given = "levels" in mine.written_cells
    which = f"the largest of {levels} sizes of cell (grid.levels)" if is_given else "a size of cell"
    raise InputError(
        f"grid.finest_cell: missing key: {problem}, {which} where none is given; give one that divides them"
    )


def _derive(mine: Mine, finest: float, levels: int | None) -> tuple[float, int]:
    """Derive the domain from all that is mined or loaded; size of the largest cells, m, and number of levels."""
    settings = mine.settings
    named = list(_openings(mine))
    openings = [opening for _, opening in named]
    if not openings:
        raise InputError("domain.lower: missing key; without excavations and loads the domain follows from nothing")
    given = settings.domain.boundary is not None
    faces = mine.boundary()
    mined = PLANES[mine.plane]
    held = [face for face in FACES if "xyz".index(face[0]) in mined and (face, faces[face]) != ("z_upper", "free")]
    conditions = [faces[face] for face in held]
    rocks = mine.written_rocks()
    box = bounds(openings)
    sound = _sound(mine, box, finest) if 2 in mined else ((-np.inf, ""), (np.inf, ""))
    found = derive_domain(
        openings,
        finest,
        [settings.materials[name].poisson_ratio for name in rocks if name in settings.materials],
        conditions if given else ["fixed"],
        levels=(levels, levels) if levels else _levels(mine),
        ground=settings.frame.surface if 2 in mined else None,
        sound=(sound[0][0], sound[1][0]),
    )
    if math.prod((found.upper - found.lower) / found.coarse_cell) > MAX_COARSE_CELLS and (apart := _apart(named)):
        raise InputError(apart)
    if found.limited == STRENGTH and found.error > MAX_LIMITED_BOUNDARY_ERROR:
        raise InputError(_no_room(mine, found, box[:, -1], sound))
    top, surface = float(found.upper[-1]), settings.frame.surface
    at_surface = 2 in mined and top == surface
    if at_surface and given and faces["z_upper"] not in ("free", "traction"):
        raise InputError(
            f"domain.boundary: the domain that is derived ends at frame.surface, {surface:g} m, where z_upper is "
            f"{faces['z_upper']}; say {{z_upper: free, others: fixed}}, or give domain.lower and domain.upper"
        )
    if 2 in mined and given and not at_surface and faces["z_upper"] == "free":
        raise InputError(
            f"domain.boundary: z_upper is free, but the domain that is derived ends at {top:g} m, under frame.surface, "
            f"{surface:g} m: its rock would lose the stress from above; leave that out, or give domain.lower and upper"
        )
    if at_surface and not given:
        mine.change("domain", boundary=Boundary(z_upper="free", others="fixed"))
    mine.change("domain", lower=tuple(found.lower.tolist()), upper=tuple(found.upper.tolist()))
    mine.far_field = found
    return found.coarse_cell, found.levels


def _sound(mine: Mine, box: np.ndarray, finest: float) -> tuple[tuple[float, str], tuple[float, str]]:
    """Elevations, m, between which virgin rock above and below the openings bears its stress, each with the rock that
    does not beyond; box (2, d): of all openings, m.

    Raises InputError where it does not at the openings themselves. What a law admits is convex, and stress is linear in
    depth: of one rock there is one such stretch. Layers of rock are found if they are no thinner than a part of their
    distance.
    """
    surface, plan = mine.settings.frame.surface, np.concatenate([box[:, :-1], box[:, :-1].mean(axis=0)[None]])
    columns = np.array(list(itertools.product(*plan.T)))
    heights, rocks = np.minimum(box[:, -1], surface), Rocks.of(mine)

    def at(elevation: float) -> tuple[float, str]:
        points = np.column_stack([columns, np.full(len(columns), elevation)])
        return overstress(mine, set(rocks.at(points).tolist()), elevation)

    for place, elevation in zip(("lower", "upper"), heights, strict=True):
        excess, rock = at(elevation)
        if excess > 0.0:
            raise InputError(
                f"insitu_stress: at elevation {elevation:.6g} m, the {place} end of the excavations, virgin stress is "
                f"{excess / 1e6:.3g} MPa above the intact strength of materials.{rock}: it would fail before anything "
                "is mined; check stress, depth and strength"
            )
    distances = (
        np.geomspace(min(finest, MAX_CHECKED_DISTANCE), MAX_CHECKED_DISTANCE, LAYERS)
        if rocks.bodies
        else [MAX_CHECKED_DISTANCE]
    )

    def end(start: float, way: float) -> tuple[float, str]:
        bears, fails = start, None
        for distance in distances:
            if at(start + way * distance)[0] > 0.0:
                fails = start + way * distance
                break
            bears = start + way * distance
        while fails is not None and abs(fails - bears) > SAME * MAX_CHECKED_DISTANCE:
            middle = 0.5 * (fails + bears)
            bears, fails = (bears, middle) if at(middle)[0] > 0.0 else (middle, fails)
        return bears, "" if fails is None else at(fails)[1]

    return end(heights[0], -1.0), end(heights[1], 1.0)


def _no_room(
    mine: Mine, found: FarField, heights: np.ndarray, sound: tuple[tuple[float, str], tuple[float, str]]
) -> str:
    """Why a derived domain that stays where virgin rock bears its stress is none; heights (2,): of all openings, m;
    sound: see _sound."""
    (lowest, below), (highest, above) = sound
    gap, end, rock = min((heights[0] - lowest, lowest, below), (highest - heights[1], highest, above))
    largest = ", ".join(f"grid.{key}" for key in ("coarse_cell", "levels") if key in mine.written_cells)
    cells = f" in cells up to {found.coarse_cell:g} m ({largest})" if largest else ""
    expected = f"moves wall stress by {100 * found.error:.3g} %" if found.distance > 0 else "does not hold them"
    return (
        f"insitu_stress: virgin stress reaches the intact strength of materials.{rock} at elevation {end:.6g} m, "
        f"{gap:.3g} m from the excavations: a domain that ends before{cells} {expected} "
        f"({100 * MAX_LIMITED_BOUNDARY_ERROR:g} % are allowed); check stress, depth and strength, or give domain.lower "
        "and domain.upper"
    )


def _apart(named: Sequence[tuple[str, Opening]]) -> str:
    """Message on the excavations and loads, named by their keys, that lie far from the others, if an empty stretch
    takes most of the length of all; else empty."""
    names, openings = zip(*named, strict=True)
    boxes = np.array([[opening.lower, opening.upper] for opening in openings])
    gap, few = 0.0, np.zeros(len(boxes), bool)
    for axis in range(boxes.shape[-1]):
        order = np.argsort(boxes[:, 0, axis], kind="stable")
        reach = np.maximum.accumulate(boxes[order, 1, axis])
        gaps = boxes[order[1:], 0, axis] - reach[:-1]
        if len(gaps) and gaps.max() > max(gap, MIN_EMPTY_SHARE * (reach[-1] - boxes[:, 0, axis].min())):
            gap = float(gaps.max())
            few = np.zeros(len(boxes), bool)
            few[order[1 + int(gaps.argmax()) :]] = True
    if not few.any():
        return ""
    few = few if 2 * few.sum() <= len(few) else ~few
    own, others = (np.array([boxes[part, 0].min(axis=0), boxes[part, 1].max(axis=0)]) for part in (few, ~few))
    listed = list(dict.fromkeys(name for name, part in zip(names, few, strict=True) if part))
    first, *more = listed
    which = f"it and {len(more)} more lie" if more else "lies"
    places = [", ".join(f"{a:.10g} to {b:.10g} m" for a, b in box.T) for box in (own, others)]
    return (
        f"{first}: {which} {gap:.6g} m from all others ({places[0]}; the others {places[1]}), and the domain would "
        f"hold the rock between: check coordinates, units, scale and offset of both{exchanged_hint(*own, *others)}"
    )


def _openings(mine: Mine) -> Iterator[tuple[str, Opening]]:
    """All excavations, planned ones too, and loads, each with its key; a tunnel stretch by stretch."""
    sections: dict[str, Sequence[ShapeSettings]] = {"excavations": mine.excavations, "loads": mine.settings.loads}
    for section, solids in sections.items():
        for solid in solids:
            where = f"{section}.{solid.name}"
            if section == "excavations" and solid.outside:
                raise InputError(f"{where}.outside: the domain follows from the excavations; give lower and upper")
            shape = check_form(mine, where, solid)
            try:
                found = list(shape.openings(mine.dimension) if shape else _openings_of_file(mine, where, solid))
            except InputError as error:
                text = str(error)
                raise InputError(text if text.startswith(where) else f"{where}: {text}") from error
            lowest = min((float(opening.lower[-1]) for opening in found), default=-np.inf)
            if 2 in PLANES[mine.plane] and lowest >= mine.settings.frame.surface:
                raise InputError(
                    f"{where}: lies above the ground, z {lowest:g} m and more (frame.surface: "
                    f"{mine.settings.frame.surface:g} m); check its coordinates and frame.surface"
                )
            yield from ((where, opening) for opening in found)


def _openings_of_file(mine: Mine, where: str, solid: SolidSettings) -> Iterator[Opening]:
    if solid.shape:
        for prism in _prisms(mine, where, solid):
            yield from prism.openings(mine.dimension)
    else:
        path = mine.path(solid.file)
        stamp = os.stat(path)
        yield _of_file(str(path), solid.name, picked(mine.placed(solid)), stamp.st_mtime_ns, stamp.st_size)


@functools.cache
def _of_file(path: str, name: str, chosen: Picked, stamp: int, size: int) -> Opening:
    """A solid from a file as it is at this time: box, sides along its own axes, volume. Its warnings are the grid's."""
    with quiet():
        solid = read_solid(path, name, chosen)
    lower, upper = solid.bounds
    points = solid.vertices[np.unique(solid.facets)] - solid.bounds.mean(axis=0)
    axes = np.linalg.eigh(np.cov(points.T))[1]
    sides = np.maximum(np.ptp(points @ axes, axis=0), SAME * np.max(upper - lower))
    whole = abs(solid.signed_volume) if solid.is_closed else solid.volume  # an open one's sum lacks what stands open
    volume = min(whole, float(np.prod(upper - lower)))
    return Opening(lower, upper, sides, volume, np.stack([lower, upper])[None])


def _prisms(mine: Mine, where: str, solid: SolidSettings) -> list[Shape]:
    """A prism for each outline of a drawing; holes in them count as mined."""
    with quiet():
        return prisms_of(mine.placed(solid), where)


class quiet:
    """Warnings of reading are given where the grid is made."""

    def __enter__(self):
        self.before = logging.root.manager.disable
        logging.disable(logging.WARNING)

    def __exit__(self, *_):
        logging.disable(self.before)
