"""Thickness of a solid, and the cells that an opening of that thickness needs across it.

The thickness at a point of the surface is the length of the line along the surface's normal that lies inside. That of
the solid is such that a quarter of its surface, by area, is thinner: of a drive its width or its height, of a stope the
distance between its nearest walls. Neither the place nor the direction of a solid on the grid changes it. Where the
solid reaches the top of the domain it has no wall: a pit is as thick as it is wide, however shallow its benches.
"""

from typing import NamedTuple

import numpy as np

from common.cell_sizes import MIN_SHARE_REACHED, largest_cell
from mpm_core.geometry.inside import contains
from mpm_core.geometry.solids import Outside, Solid

CELLS_ACROSS_OPENING = 3  # Across fewer, too little rock fails around an opening (study openings).
CELLS_ACROSS_SLOT = 2  # As CELLS_ACROSS_OPENING for an opening that is thin in one direction only.
MIN_SLOT_RATIO = 0.75  # Volume over that of a slab of the same thickness and surface: 3/4 if three times as wide.
MAX_CELLS_MEASURED = 6  # A thicker solid is as thick as that.
QUANTILE = 0.25
POINTS = 256  # of the surface at which the thickness is measured
STEPS_PER_CELL = 8  # Of a line, before its end is bisected. A gap that is thinner may be missed.
HALVINGS = 10
TOP_ROUND_OFF = 1e-9  # Of elevations, as a share of the solid's size.
GOLDEN = np.array([0.7548776662466927, 0.5698402909980532])  # Steps of a sequence that fills a square (Roberts 2018).


class Across(NamedTuple):
    """Cells across an opening (at most MAX_CELLS_MEASURED), and how many it needs."""

    cells: float
    needed: int

    def is_narrow(self, needed: int = 0) -> bool:
        """True if there are fewer cells across than the opening needs, or than `needed` of them."""
        return self.cells < max(self.needed, needed) * (1.0 - MIN_SHARE_REACHED)

    def largest_cell(self, cell: float, needed: int = 0) -> float:
        """Largest cell, m, with which the opening is not narrow, rounded down to two digits; cell: of those counted.
        There are more than 0 of these."""
        return largest_cell(self.cells * cell, max(self.needed, needed))


def cells_across(solid: Solid | Outside, cell: float, top: float = np.inf) -> Across:
    """Cells of a size (m) across an opening; 0 where its surface encloses nothing. A body under load (Outside) is none,
    and needs none. top: elevation, m, at which the rock ends above."""
    if isinstance(solid, Outside):
        return Across(float(MAX_CELLS_MEASURED), 0)
    thickness, area = thickness_of(solid, MAX_CELLS_MEASURED * cell, MAX_CELLS_MEASURED * STEPS_PER_CELL, top)
    is_wide = thickness >= CELLS_ACROSS_OPENING * cell  # the volume of an open solid takes long
    is_slot = not is_wide and 2.0 * solid.volume > MIN_SLOT_RATIO * area * thickness
    return Across(thickness / cell, CELLS_ACROSS_SLOT if is_slot else CELLS_ACROSS_OPENING)


def thickness_of(solid: Solid, most: float, steps: int, top: float = np.inf) -> tuple[float, float]:
    """Thickness of a solid, m, at most `most`, in whose steps lines are followed; and the area of its surface, m2 (m in
    2-D). Both are 0 for a surface without area. top: elevation, m, at which the rock ends: what the surface has there
    is no wall, and lines go on."""
    center = solid.bounds.mean(axis=0)
    corners = solid.corners(center)
    edges = corners[:, 1:] - corners[:, :1]
    normal = np.cross(edges[:, 0], edges[:, 1]) if solid.dimension == 3 else edges[:, 0, ::-1] * [1.0, -1.0]
    size = np.linalg.norm(normal, axis=1)
    top -= TOP_ROUND_OFF * float(np.ptp(solid.bounds, axis=0).max())
    size[(corners[:, :, -1] + center[-1] >= top).all(axis=1)] = 0.0
    ends = np.cumsum(size)
    if not ends[-1] > 0.0:
        return 0.0, 0.0
    facet = np.searchsorted(ends, (np.arange(POINTS) + 0.5) / POINTS * ends[-1])
    place = np.arange(1, POINTS + 1)[:, None] * GOLDEN[: solid.dimension - 1] % 1.0
    place = np.where(place.sum(axis=1, keepdims=True) > 1.0, 1.0 - place, place)
    start = center + corners[facet, 0] + np.einsum("pe,ped->pd", place, edges[facet])
    along = np.concatenate([normal[facet], -normal[facet]]) / np.tile(size[facet], 2)[:, None]
    ways = _lengths_inside(solid, np.tile(start, (2, 1)), along, most, steps, top)
    lengths = np.minimum(ways.reshape(2, POINTS).sum(axis=0), most)
    area = float(size.sum()) * (0.5 if solid.dimension == 3 else 1.0)
    return float(np.quantile(lengths, QUANTILE)), area


def _lengths_inside(
    solid: Solid, start: np.ndarray, along: np.ndarray, most: float, steps: int, top: float
) -> np.ndarray:
    """Length (k,) m of lines from points (k, d) of the surface in directions (k, d) to where they leave the solid; all
    above `top` is within."""

    def within_or_above(points: np.ndarray) -> np.ndarray:
        within = contains(solid, points)
        within[points[:, -1] >= top] = True
        return within

    marks = most * np.arange(1, steps + 1) / steps
    longest = np.linalg.norm(np.ptp(solid.bounds, axis=0))  # a mark beyond the first that is farther lies outside
    marks = marks[: np.searchsorted(marks, longest, side="right") + 1]
    left = np.ones((len(start), len(marks)), bool)
    left[:, 0] = ~within_or_above(start + marks[0] * along)
    within = np.flatnonzero(~left[:, 0])  # the others look outward
    places = start[within, None] + marks[1:, None] * along[within, None]
    left[within, 1:] = ~within_or_above(places.reshape(-1, solid.dimension)).reshape(places.shape[:2])
    first = np.where(left.any(axis=1), left.argmax(axis=1), len(marks))
    low, high = first * (most / steps), np.minimum(first + 1, steps) * (most / steps)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        within = within_or_above(start + middle[:, None] * along)
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    return low
