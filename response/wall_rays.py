"""Along the normals of walls: how deep rock has failed, what lies behind it, and how far opposite walls have closed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from common.opening_table import SIDES
from response.rock import FAILED, INTACT, MINED, OUTSIDE, Rock
from response.walls import Walls

STEP = 0.25  # Finest cells between points of a ray: the edge of a cell's sub-cells in three dimensions.
MAX_GAP = 1.0  # Finest cells of intact rock behind which failed rock no longer belongs to the wall.
MAX_TO_ROCK = 0.75  # Finest cells from a wall within which the rock behind it begins.
MAX_INTO_ROCK = 1.5  # Finest cells within which the cell is looked for whose nodes move a wall.


def first_rock(rock: Rock, walls: Walls) -> NDArray:
    """Distance (point,) m from walls at which rock begins, by STEP; NaN where another opening has taken it, or the
    domain ends. A grid with whole cells begins up to MAX_TO_ROCK beyond the wall of a solid."""
    found = np.full(len(walls), np.nan)
    for number in range(round(MAX_TO_ROCK / STEP)):
        missing = np.flatnonzero(np.isnan(found))
        away = (number + 0.5) * STEP * rock.edge
        what, _ = rock.what(walls.place[missing] + away * walls.normal[missing])
        found[missing[(what == INTACT) | (what == FAILED)]] = number * STEP * rock.edge
    return found


def standing(rock: Rock, walls: Walls) -> NDArray:
    """True (point,) for walls with rock behind them."""
    return np.isfinite(first_rock(rock, walls))


@dataclass(frozen=True)
class Behind:
    """What lies behind points of walls. depth (point,) m of failed rock; through (point,) bool: it meets another
    opening, or failed rock that is nearer to one; particle (point,): the first intact one behind it, -1 for none."""

    depth: NDArray
    through: NDArray
    particle: NDArray


def look_behind(rock: Rock, walls: Walls, tree: cKDTree) -> Behind:
    """Follow the normal of each wall into the rock, by STEP, until intact rock is MAX_GAP deep.

    tree: of the places of the walls. Failed rock within MAX_GAP of the wall, or of failed rock nearer to it, belongs to
    the depth of failure: it ends where the last of it ends, or where another excavation is nearer. A cell fails as a
    whole, so a single depth is known to half a cell.
    """
    count = len(walls)
    depth, through, particle = np.zeros(count), np.zeros(count, bool), np.full(count, -1)
    begin = np.nan_to_num(first_rock(rock, walls))
    step, going, number = STEP * rock.edge, np.arange(count), 0
    while len(going):
        away = begin[going] + (number + 0.5) * step
        place = walls.place[going] + away[:, None] * walls.normal[going]
        what, here = rock.what(place)
        failed, intact = what == FAILED, what == INTACT
        found = np.flatnonzero(failed)
        other = np.zeros(len(going), bool)
        other[found] = walls.excavation[tree.query(place[found])[1]] != walls.excavation[going[found]]
        depth[going[failed & ~other]] = (number + 1) * step
        particle[going[failed]] = -1
        first = intact & (particle[going] < 0)
        particle[going[first]] = here[first]
        opened = what == MINED
        through[going[opened | other]] = depth[going[opened | other]] > 0.0
        ended = opened | other | (what == OUTSIDE)
        ended |= intact & ((number + 1) * step - depth[going] > MAX_GAP * rock.edge)
        going, number = going[~ended], number + 1
    return Behind(depth, through & (particle < 0), particle)


def fallen_depth(rock: Rock, walls: Walls) -> NDArray:
    """Depth (point,) m to which rock behind walls has come loose and fallen, along their normals, by STEP: up to the
    last of it within MAX_TO_ROCK of the wall, or of fallen rock nearer to it."""
    depth, step = np.zeros(len(walls)), STEP * rock.edge
    going, number = np.arange(len(walls)) if rock.fallen_samples.any() else np.empty(0, np.int64), 0
    while len(going):
        fallen = rock.has_fallen(walls.place[going] + (number + 0.5) * step * walls.normal[going])
        number += 1
        depth[going[fallen]] = number * step
        going = going[number * step - depth[going] < MAX_TO_ROCK * rock.edge]
    return depth


def wall_displacement(rock: Rock, walls: Walls) -> NDArray:
    """Displacement (point, xyz) m of walls since virgin rock: that of the nearest cell with rock behind them, whose
    shape functions are continued to the wall. NaN where there is none within MAX_INTO_ROCK."""
    moved, step = np.full((len(walls), 3), np.nan), STEP * rock.edge
    for number in range(round(MAX_INTO_ROCK / STEP) + 1):
        missing = np.flatnonzero(np.isnan(moved[:, 0]))
        if not len(missing):
            break
        inside = walls.place[missing] + (number + 0.1) * step * walls.normal[missing]
        moved[missing] = rock.displacement(walls.place[missing], inside)
    return moved


@dataclass(frozen=True)
class Chords:
    """Pairs of opposite walls: index of a wall (chord,), of the wall that faces it (chord,), and the unit vector
    (chord, xyz) from the first to the second."""

    wall: NDArray
    opposite: NDArray
    direction: NDArray


def find_chords(rock: Rock, walls: Walls, reach: float) -> Chords:
    """From roof to floor, along `up`, and from wall to wall, level and across the drive: the walls that face each other
    across the void. reach: m, beyond which no opposite wall is looked for.

    A wall is paired with the nearest point of a wall of its own excavation, within a finest cell of the place where its
    chord leaves the void.
    """
    roof, wall = SIDES.index("roof"), SIDES.index("walls")
    direction = -walls.normal.copy()
    direction[walls.side == roof] = -walls.up[walls.side == roof]
    level = walls.side == wall
    rise = np.einsum("pi,pi->p", direction, walls.up)
    direction[level] -= (rise[:, None] * walls.up)[level]
    length = np.linalg.norm(direction, axis=1)
    chosen = np.flatnonzero((level | (walls.side == roof)) & (length > 0.0))
    direction = direction[chosen] / length[chosen, None]
    step, going, number = STEP * rock.edge, np.arange(len(chosen)), 1
    end = np.full(len(chosen), np.nan)
    while len(going) and number * step < reach:
        away = (number + 0.5) * step
        place = walls.place[chosen[going]] + away * direction[going]
        inside = rock.voids.hold(rock.in_cells(place))
        end[going[~inside]] = number * step
        going, number = going[inside], number + 1
    found = np.flatnonzero(np.isfinite(end))
    target = walls.place[chosen[found]] + end[found, None] * direction[found]
    tree = cKDTree(walls.place)
    apart, opposite = tree.query(target, distance_upper_bound=rock.edge)
    opposite = np.where(np.isfinite(apart), opposite, 0)
    facing = np.einsum("pi,pi->p", walls.normal[opposite], direction[found]) > 0.5
    facing &= np.isfinite(apart) & (walls.excavation[opposite] == walls.excavation[chosen[found]])
    return Chords(chosen[found[facing]], opposite[facing], direction[found[facing]])


def closure(chords: Chords, moved: NDArray) -> NDArray:
    """Closure (chord,) m: how much nearer opposite walls have come; moved (point, xyz) m of all walls."""
    return np.einsum("ci,ci->c", moved[chords.wall] - moved[chords.opposite], chords.direction)
