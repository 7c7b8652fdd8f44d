"""Closed lines in plan: one must not cross itself; of several, which are outlines, which holes in them. Plain arrays.

All lines are cut where they meet. On either side of the middle of each piece, the winding numbers of all lines are
computed. A line that does not cross itself has 0 and one other number, 1 or -1, everywhere. Of two lines, one
lies within the other, or they lie next to each other, or places within both, within the first alone and within the
second alone are all found: then they overlap.
"""

from dataclasses import dataclass, field

import numpy as np

from common.errors import InputError

# Distance from a piece at which its side is probed, as a share of the size of all lines. Thinner parts are not seen.
PROBE_DISTANCE_SHARE = 1e-6
MAX_BOX_DIRECTIONS = 60  # edges of a line along which a box around it is laid
MAX_PAIRS_AT_ONCE = 1 << 22  # Pairs of edges, or of a point and an edge, that are compared at once.


@dataclass(frozen=True)
class Outline:
    """A closed line (point, 3) m and the closed lines within it that bound its holes."""

    line: np.ndarray
    holes: list[np.ndarray] = field(default_factory=list)


def check_simple(line: np.ndarray) -> None:
    """Raise InputError for a closed line (point, 2) m that crosses itself. One that touches itself is no matter."""
    if is_convex(line):
        return
    middle, along = _pieces([line])
    _refuse_crossing(line, _probes(middle, along))


def is_convex(line: np.ndarray) -> bool:
    """True if a closed line (point, 2) m turns one way all along, and once around: as nearly all that are drawn."""
    edge = np.roll(line, -1, axis=0) - line
    after = np.roll(edge, -1, axis=0)
    turn = np.arctan2(edge[:, 0] * after[:, 1] - edge[:, 1] * after[:, 0], np.sum(edge * after, axis=1))
    return bool((np.sign(turn) == np.sign(turn[0])).all() and turn[0] != 0.0 and abs(turn.sum()) < 3.0 * np.pi)


def box_around(line: np.ndarray) -> tuple[np.ndarray, float]:
    """Sides (2,) m of the smallest box along an edge of a closed line (point, 2) m, and the line's area m2."""
    local = line - line[0]
    (x, y), (x_next, y_next) = local.T, np.roll(local, -1, axis=0).T
    area = 0.5 * abs(float(np.sum(x * y_next - x_next * y)))
    edges = np.roll(local, -1, axis=0) - local
    edges = edges[np.hypot(*edges.T) > 0][:: len(edges) // MAX_BOX_DIRECTIONS + 1]
    along = edges / np.hypot(*edges.T)[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    widths = np.stack([np.ptp(local @ along.T, axis=0), np.ptp(local @ across.T, axis=0)], axis=1)
    return widths[np.argmin(widths.prod(axis=1))], area


def nest(lines: list[np.ndarray], height: float | None = None) -> list[Outline]:
    """Outlines and their holes of closed lines (point, 3) m: a line within an outline is a hole, one within that an
    outline again. The same line drawn twice counts once. height, m: of the prisms that stand on the lines; those that
    stand wholly above one another have nothing to do with each other. Without it all are seen in plan.

    Raises InputError for a line that crosses itself, for two that overlap without one lying within the other, and for
    one within several of which only some stand above one another.
    """
    plan = [line[:, :2] for line in lines]
    places = _probes(*_pieces(plan))
    winding = [_refuse_crossing(line, places) for line in plan]
    within = np.array([number != 0 for number in winding])
    bottom, top = [line[:, 2].min() for line in lines], [line[:, 2].max() for line in lines]
    kept: list[int] = []
    inside = np.zeros((len(lines), len(lines)), bool)  # the first within the second
    for one in range(len(lines)):
        repeated = False
        for other in kept:
            if height and max(bottom[one], bottom[other]) >= min(top[one], top[other]) + height:
                continue
            both = within[one] & within[other]
            alone, other_alone = within[one] & ~within[other], ~within[one] & within[other]
            if both.any() and alone.any() and other_alone.any():
                x, y = places[np.flatnonzero(both)[0]]
                raise InputError(
                    f"two closed polylines overlap near {x:.2f}, {y:.2f} m: draw them as one, or as excavations of "
                    "their own on different layers"
                )
            repeated |= both.any() and not alone.any() and not other_alone.any()
            inside[one, other] = both.any() and not alone.any()
            inside[other, one] = both.any() and not other_alone.any()
        if not repeated:
            kept.append(one)
    inside = inside[np.ix_(kept, kept)]
    depth = inside.sum(axis=1)
    outlines = {place: Outline(lines[kept[place]]) for place in np.flatnonzero(depth % 2 == 0)}
    for one in range(len(kept)):
        others = np.flatnonzero(inside[one])
        around = [place for place in others if depth[place] == depth[one] - 1]
        apart = not (inside | inside.T | np.eye(len(kept), dtype=bool))[np.ix_(others, others)].all()
        if apart or len(around) != min(depth[one], 1):  # by their levels: a is within b, b within c, and a above c
            x, y = lines[kept[one]][0, :2]
            raise InputError(
                f"the closed polyline at {x:.2f}, {y:.2f} m lies within others that stand above one another: draw "
                "those of each level on a layer of their own"
            )
        if depth[one] % 2 == 1:
            outlines[around[0]].holes.append(lines[kept[one]])
    return list(outlines.values())


def _refuse_crossing(line: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Winding number (place,) of a line. Raises InputError where it is neither 0 nor the one number of the others."""
    number = line_winding(line, places)
    values = np.unique(number[number != 0])
    if len(values) > 1 or (np.abs(values) > 1).any():
        rarest = min(values, key=lambda value: (np.abs(value) == 1, np.count_nonzero(number == value)))
        x, y = places[np.flatnonzero(number == rarest)[0]]
        raise InputError(f"crosses itself near {x:.2f}, {y:.2f} m: put its points in order around it")
    return number


def _pieces(lines: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Middles and directions, unit length, (piece, 2) of the edges of lines, cut where they meet any edge."""
    start = np.concatenate(lines)
    end = np.concatenate([np.roll(line, -1, axis=0) for line in lines])
    origin = start.mean(axis=0)
    start, end = start - origin, end - origin
    edge = end - start
    length = np.hypot(*edge.T)
    start, end, edge, length = (values[length > 0] for values in (start, end, edge, length))
    lower, upper = np.minimum(start, end), np.maximum(start, end)
    slack = PROBE_DISTANCE_SHARE * np.ptp(start, axis=0).max(initial=0.0)
    rows, shares = [np.arange(len(edge))], [np.ones(len(edge))]
    step = max(MAX_PAIRS_AT_ONCE // max(len(edge), 1), 1)
    for first in range(0, len(edge), step):
        some = slice(first, first + step)
        near = lower[some, None, 0] <= upper[:, 0] + slack
        for axis in range(2):
            near &= lower[some, None, axis] <= upper[:, axis] + slack
            near &= upper[some, None, axis] >= lower[:, axis] - slack
        one, other = np.nonzero(near)
        one += first
        to = start[other] - start[one]
        across = _cross(edge[one], edge[other])
        with np.errstate(divide="ignore", invalid="ignore"):
            share, share_of_other = _cross(to, edge[other]) / across, _cross(to, edge[one]) / across
        met = np.abs(across) > PROBE_DISTANCE_SHARE * length[one] * length[other]
        met &= (share_of_other >= -PROBE_DISTANCE_SHARE) & (share_of_other <= 1 + PROBE_DISTANCE_SHARE)
        # of edges along each other: where the other one starts
        beside = np.abs(_cross(to, edge[one])) <= slack * length[one]
        share = np.where(met, share, (to * edge[one]).sum(axis=1) / length[one] ** 2)
        cut = (met | beside) & (share > 0) & (share < 1)
        rows.append(one[cut])
        shares.append(share[cut])
    row, share = np.concatenate(rows), np.concatenate(shares)
    order = np.lexsort((share, row))
    row, share = row[order], share[order]
    before = np.where(np.append(True, row[1:] != row[:-1]), 0.0, np.append(0.0, share[:-1]))
    keep = share - before > 4 * PROBE_DISTANCE_SHARE
    row, middle = row[keep], (0.5 * (share + before))[keep]
    return origin + start[row] + middle[:, None] * edge[row], edge[row] / length[row, None]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _probes(middle: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Places (place, 2) m on both sides of pieces."""
    beside = (
        PROBE_DISTANCE_SHARE * np.ptp(middle, axis=0).max(initial=0.0) * np.stack([-along[:, 1], along[:, 0]], axis=1)
    )
    return np.concatenate([middle + beside, middle - beside])


def line_winding(line: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Winding number (place,) int of a closed line (point, 2) around places (place, 2): crossings of a ray along +x."""
    number = np.zeros(len(places), np.int64)
    (x, y), (x_next, y_next) = line.T, np.roll(line, -1, axis=0).T
    step = max(MAX_PAIRS_AT_ONCE // len(line), 1)
    for first in range(0, len(places), step):
        px, py = places[first : first + step].T
        below, below_next = y <= py[:, None], y_next <= py[:, None]
        place, edge = np.nonzero(below != below_next)
        side = (x_next - x)[edge] * (py[place] - y[edge]) - (px[place] - x[edge]) * (y_next - y)[edge]
        passed = np.where(below[place, edge], side > 0, -1 * (side < 0))
        number[first : first + step] = np.bincount(place, passed, minlength=len(px)).astype(np.int64)
    return number
