"""The size of a domain whose boundary changes no wall stress by more than MAX_BOUNDARY_ERROR.

Far from it an opening is a dipole. A boundary at distance R answers the dipole's displacement by a field that is smooth
inside, at the opening a uniform stress of opposite sign or the same: the opening sees a share 1 - k (a / R)^d of the
far stress (d = 2 in plane strain, 3 in space), and every stress of its wall, which is linear in that, is wrong by the
share k (a / R)^d of the largest. k comes from the opening and the boundary as concentric circles or spheres, once for
an all-round far stress and once for a deviator (:func:`coefficients`); a square or cubic boundary is further away
everywhere but in six points. Openings other than that have the radius a of the round one that disturbs as much or more
(:func:`effective_volume`). docs/explanation/distance-of-the-boundary.md derives all of it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mpm_core.geometry.shapes.shape import Opening
from mpm_core.grid.domain import marks_memory
from mpm_core.settings import MAX_LEVELS

MAX_BOUNDARY_ERROR = 0.005  # Largest change of wall stress by the boundary, as a share of the largest wall stress.
# As MAX_BOUNDARY_ERROR, where the domain ends since virgin rock bears its own stress no further. More is refused.
MAX_LIMITED_BOUNDARY_ERROR = 0.05
MIN_BASE_CELLS = 4  # Base cells along the shortest side, where levels are free.
MAX_MARKS_BYTES = 2e9  # The domain ends where marking splits (domain.marks_memory) takes this much memory.
RASTER_CELLS = 64  # Cells across the largest face of the openings' box, on which the covered part of it is counted.
MEMORY, STRENGTH = "memory", "strength"
MAX_ELEVATION = 1e9  # Elevations (m) beyond this bound nothing.
# Whole base cells make use of at least this share of the height in which rock bears its stress.
MIN_FILLED_SHARE = 0.9
CELL_ROUND_OFF = 1e-6  # Round-off of coordinates, as a share of a cell, makes no further cell.


@dataclass(frozen=True)
class FarField:
    """A derived domain: corners (d,) m, its largest cell m, number of levels, and what is expected of it."""

    lower: np.ndarray
    upper: np.ndarray
    coarse_cell: float
    levels: int
    distance: float
    """m from the openings' box to the nearest face that is no ground surface"""
    error: float
    """expected share of the largest wall stress by which the boundary moves wall stress"""
    radius: float
    """m, of the round opening that disturbs as much as all of them"""
    limited: str
    """MEMORY: the domain ends where the split marks of its grid take MAX_MARKS_BYTES; STRENGTH: above or below it
    virgin rock does not bear its stress; else empty"""


def coefficients(dimension: int, poisson_ratio: float, condition: str) -> tuple[float, float]:
    """k of an all-round and of a deviatoric far stress: the wall's stress is wrong by -k (a / R)^d of itself.

    condition: of the boundary at R: fixed, roller (no motion across it, free along it), or traction (virgin traction
    kept; `free` counts as that). To first order in (a / R)^d.
    """
    nu = poisson_ratio
    kind = "traction" if condition == "free" else condition
    if dimension == 2:
        # phi = c / z + e z^3, psi = g z (Muskhelishvili); c = S a^2 of the hole in a deviator S
        kappa = 3 - 4 * nu
        deviatoric = {
            "fixed": kappa + 3 / kappa,
            "roller": 2 + 6 * (kappa - 1) / (kappa + 3),
            "traction": -4.0,
        }[kind]
        return (-1.0 if kind == "traction" else 1 / (1 - 2 * nu)), deviatoric
    isotropic = -1.0 if kind == "traction" else (1 + nu) / (2 * (1 - 2 * nu))
    return isotropic, _deviator_of_sphere(nu, kind)


def _deviator_of_sphere(nu: float, condition: str) -> float:
    """k of a spherical cavity under a deviator d: u = F d.x + H x (n.d.n), of which a dipole has powers r^-3.

    What answers it inside R: a uniform strain and the cubic c r^2 d.x + x (x.d.x), which is zero at the centre.
    """
    out = 2 * (1 - 2 * nu), 3.0, -3
    cubic = -(7 - 4 * nu) / (7 - 10 * nu), 1.0, 2
    uniform = 1.0, 0.0, 0

    def at_boundary(f: float, h: float, power: int) -> tuple[float, float]:
        """The two terms that are zero by the condition, of a field F = f r^power, H = h r^power, at r = 1."""
        along = f + 0.5 * power * f + h  # traction / (2 mu), along d.n; the rest along n
        across = 0.5 * power * f + power * h + nu / (1 - 2 * nu) * (power * f + (3 + power) * h)
        return {"fixed": (f, h), "roller": (f + h, along), "traction": (along, across)}[condition]

    matrix = np.array([at_boundary(*uniform), at_boundary(*cubic)]).T
    strain = np.linalg.solve(matrix, -np.array(at_boundary(*out)))[0]
    # the dipole is P (a / r)^3 of e*, P = 1 / (6 (1 - nu)); e* = far strain / (1 - beta) (Eshelby)
    return float(-strain * 2.5 / (7 - 5 * nu))


def worst_coefficient(dimension: int, poisson_ratios: Sequence[float], conditions: Sequence[str]) -> float:
    """The largest size of any k of these rocks and conditions."""
    pairs = [coefficients(dimension, nu, condition) for nu in poisson_ratios for condition in set(conditions)]
    return max(abs(k) for pair in pairs for k in pair)


def own_volume(opening: Opening) -> float:
    """Volume, m^d, of a compact opening that disturbs as much as this one or more.

    A flat one closes as a crack does, which disturbs as if it were as thick as wide: the volume grows by the ratio of
    the middle to the least of its sides (in 2-D of the larger to the smaller).
    """
    sides = np.sort(opening.sides)
    return min(opening.volume * sides[1] / sides[0], _enclosing_volume(sides))


def _enclosing_volume(sides: np.ndarray) -> float:
    """Volume, m^d, of a compact opening that disturbs as much as a box that is mined whole, or more."""
    sides = np.sort(sides)
    return float(sides[-1] * sides[-2] ** 2 if len(sides) == 3 else sides[-1] ** 2)


def effective_volume(openings: Sequence[Opening]) -> float:
    """Volume, m^d, of a compact opening that disturbs as much as all of these or more.

    Each by itself, more where they are close: by 1 / (1 - c), c the part of the largest face of their box that
    they cover, as of cracks in one plane; never more than the whole of that box mined, since a larger opening disturbs
    more.
    """
    alone = sum(own_volume(opening) for opening in openings)
    if len(openings) == 1:
        return alone
    whole = _enclosing_volume(np.ptp(bounds(openings), axis=0))
    rest = 1.0 - covered(openings)
    return min(whole, alone / rest) if rest > 0.0 else whole


def bounds(openings: Sequence[Opening]) -> np.ndarray:
    """Lower and upper corner (2, d) m of the box of all openings."""
    return np.array([np.min([one.lower for one in openings], axis=0), np.max([one.upper for one in openings], axis=0)])


def covered(openings: Sequence[Opening]) -> float:
    """Part of the largest face of the openings' box (in 2-D of its longest side) that their parts cover, at most 1."""
    lower, upper = bounds(openings)
    axes = np.delete(np.arange(len(lower)), np.argmin(upper - lower))
    scale = RASTER_CELLS / (upper - lower)[axes]
    mask = np.zeros((RASTER_CELLS,) * len(axes))
    for low, high in np.concatenate([one.parts for one in openings]):
        first, last = (low[axes] - lower[axes]) * scale, (high[axes] - lower[axes]) * scale
        window, shares = [], []
        for a, b in zip(np.clip(first, 0, RASTER_CELLS), np.clip(last, 0, RASTER_CELLS), strict=True):
            cells = np.arange(int(a), min(int(b) + 1, RASTER_CELLS))
            window.append(slice(int(a), min(int(b) + 1, RASTER_CELLS)))
            shares.append(np.clip(np.minimum(cells + 1, b) - np.maximum(cells, a), 0, 1))
        part = shares[0] if len(axes) == 1 else shares[0][:, None] * shares[1]
        mask[tuple(window)] += part
    return float(np.minimum(mask, 1.0).mean())


@dataclass(frozen=True)
class Reach:
    """Error of wall stress by the distance R of the boundary: the least of k (a / R)^power, a term (k, a, power)."""

    terms: tuple[tuple[float, float, int], ...]

    def error(self, distance: float) -> float:
        """Share of the largest wall stress."""
        return min(k * (a / distance) ** power for k, a, power in self.terms)

    def distance(self, error: float) -> float:
        """R, m, at which that share is left."""
        return min(a * (k / error) ** (1 / power) for k, a, power in self.terms)


def reach_of(openings: Sequence[Opening], poisson_ratios: Sequence[float], conditions: Sequence[str]) -> Reach:
    """The rule for these openings. A long tunnel is no cavern: a hole in plane strain that holds its box bounds it."""
    dimension = len(openings[0].lower)
    volume = effective_volume(openings)
    k = worst_coefficient(dimension, poisson_ratios, conditions)
    if dimension == 2:
        return Reach(((k, math.sqrt(volume / math.pi), 2),))
    # across the longest side of the box; one opening by its own sides
    sides = np.sort(openings[0].sides if len(openings) == 1 else np.ptp(bounds(openings), axis=0))
    flat = worst_coefficient(2, poisson_ratios, conditions)
    return Reach(((k, (3 * volume / (4 * math.pi)) ** (1 / 3), 3), (flat, sides[1] / math.sqrt(math.pi), 2)))


def derive_domain(
    openings: Sequence[Opening],
    finest_cell: float,
    poisson_ratios: Sequence[float],
    conditions: Sequence[str] = ("fixed",),
    levels: tuple[int, int] = (1, MAX_LEVELS),
    ground: float | None = None,
    sound: tuple[float, float] = (-math.inf, math.inf),
) -> FarField:
    """The domain around openings whose boundary moves no wall stress by more than MAX_BOUNDARY_ERROR.

    finest_cell m; conditions: of the faces that are no ground surface; levels: fewest and most of cells; ground:
    elevation m at which the domain ends if it reaches so high (None: it does not matter); sound: elevations m, around
    all openings, between which virgin rock bears its stress and the domain stays, unless its largest cell is larger.
    The boundary is R from the axis of the thinnest opening, so further from that of any other. Corners lie on whole
    finest cells.
    """
    reach = reach_of(openings, poisson_ratios, conditions)
    axis_depth = 0.5 * min(float(np.min(one.sides)) for one in openings)
    needed = max(reach.distance(MAX_BOUNDARY_ERROR) - axis_depth, finest_cell)
    box, ground = bounds(openings), math.inf if ground is None else ground
    low, high = sound[0], min(sound[1], ground)
    distance = needed
    while True:
        lower, shape, used = _tile(box, distance, finest_cell, levels, (low, high), high == ground)
        if marks_memory(shape, used) <= MAX_MARKS_BYTES or distance <= finest_cell:
            break
        distance = 0.97 * distance
    coarse = finest_cell * 2 ** (used - 1)
    upper = lower + shape * coarse
    gaps = np.array([box[0] - lower, upper - box[1]])
    if upper[-1] >= ground - CELL_ROUND_OFF * finest_cell:
        upper[-1] = ground
        gaps[1, -1] = np.inf
    nearest = float(gaps.min())
    error = float(reach.error(nearest + axis_depth)) if nearest > 0 else math.inf
    if lower[-1] < low or upper[-1] > high:  # its largest cell is larger
        nearest, error = min(nearest, 0.0), math.inf
    is_cut = nearest < distance - CELL_ROUND_OFF * finest_cell
    limited = STRENGTH if is_cut else MEMORY if distance < needed else ""
    return FarField(lower, upper, coarse, used, nearest, error, float(reach.terms[0][1]), limited)


def _tile(
    box: np.ndarray,
    distance: float,
    finest: float,
    levels: tuple[int, int],
    heights: tuple[float, float],
    ends_at_ground: bool,
) -> tuple[np.ndarray, np.ndarray, int]:
    """Lower corner m, base cells and levels of the smallest domain that leaves `distance` m around a box, (2, d) m.

    heights: elevations m that it stays between; where it reaches the upper one and ends_at_ground, it ends there.
    """
    low, high = np.clip(heights, -MAX_ELEVATION, MAX_ELEVATION)
    lower, upper = box[0] - distance, box[1] + distance
    lower[-1], upper[-1] = max(lower[-1], low), min(upper[-1], high)
    # one finest cell to spare: the corner moves to a whole one
    sides = (upper - lower) / finest + 1 - CELL_ROUND_OFF
    used = levels[0]
    while used < levels[1] and math.ceil(sides.min() / 2**used) >= MIN_BASE_CELLS:
        used += 1
    room = (high - low) / finest - 1
    while used > levels[0] and math.floor(room / 2 ** (used - 1)) * 2 ** (used - 1) < min(
        MIN_FILLED_SHARE * room, sides[-1]
    ):
        used -= 1
    width = 2 ** (used - 1)
    shape = np.maximum(np.ceil(sides / width), 1).astype(np.int64)
    shape[-1] = max(min(shape[-1], room // width), 1)
    corner = np.rint((0.5 * (lower + upper) / finest) - 0.5 * shape * width) * finest
    height = shape[-1] * width * finest
    if corner[-1] + height > high or upper[-1] == high:
        corner[-1] = high - height if ends_at_ground else math.floor(high / finest) * finest - height
    if corner[-1] < low and height <= high - low:
        corner[-1] = math.ceil(low / finest) * finest
    return corner, shape, used
