"""Cells around rock that has just failed, up to a border so far away that it may be held still.

What a failed patch of half-width a changes decays as (a / distance)^d in d dimensions. A border at distance R from its
middle, held still, carries (a / R)^d of it, and less rock fails: potency of 32 tunnels and 12 spheres whose whole ring
fails at once, against the same ones without parts, was -18, -7 and -5 % at R / a of 2, 4 (tunnel) and 2.6 (sphere).
"""

from dataclasses import dataclass

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for

from mpm_core.grid.mesh import MultiLevelGrid

CUBE_HALVINGS = {2: 2, 3: 1}
"""By dimension, a subdomain consists of cubes whose edge is a finest cell's, doubled this many times, and of larger
cells that hold such cubes. Failed cells in cubes that touch, if only at corners, are one patch."""
MAX_BORDER_SHARE = 0.02  # A border held still may carry this share, (a / R)^d, of what a patch changes.
# Distances from failed rock to the border, in finest cells. The subdomain has the largest that leaves it small enough.
REACH_CELLS = (40, 24, 16, 10, 6, 4)
MAX_SURROUNDINGS_SHARE = 0.25  # Largest share of the grid's cells in the subdomain around failed rock.
MAX_SURROUNDINGS_CELLS = 300_000  # Largest number of cells in the subdomain around failed rock.


class Cubes:
    """Which cells lie in, or hold, each cube of a box around a grid; where the domain goes on, the box has a margin.

    lower (d,): the box's first cube; present (cubes along each axis) bool: those of the grid; reaches: see REACH_CELLS;
    levels: for cells of a cube's size and smaller, then for those of each larger size, their indices and (flat) in
    which cube, or which group of 2^d, 4^d, ... cubes, they stand.
    """

    def __init__(self, grid: MultiLevelGrid):
        finest = grid.levels - 1
        self.halvings = min(CUBE_HALVINGS[grid.dimension], finest)
        self.reaches = sorted({cells >> self.halvings for cells in REACH_CELLS}, reverse=True)
        larger = finest - self.halvings
        first, last = grid.cell_index.min(axis=0) >> finest, grid.cell_index.max(axis=0) >> finest
        self.lower = np.maximum(first - 1, 0) << larger
        self.shape = np.minimum((last + 2) << larger, grid.shape >> self.halvings) - self.lower
        self.cells = len(grid.cell_level)
        self.levels = []
        for group in range(larger + 1):
            level = larger - group
            at = np.flatnonzero(grid.cell_level == level if group else grid.cell_level >= level).astype(np.int32)
            place = (grid.cell_index[at] >> self.halvings + group) - (self.lower >> group)
            self.levels.append((at, np.ravel_multi_index(tuple(place.T), self.shape >> group).astype(np.int32)))
        self.present = np.zeros(self.shape >> larger, bool)
        for group, (_, place) in reversed(list(enumerate(self.levels))):
            self.present.reshape(-1)[place] = True
            for axis in range(grid.dimension if group else 0):
                self.present = np.repeat(self.present, 2, axis)

    def around(self, failed: np.ndarray) -> "Surroundings | None":
        """Cells around failed ones (k, d), cell_index of finest cells, each patch with a border far enough for it.

        None where they are too many, or a patch is too wide.
        """
        places, _, patch, reach = self.patches(failed)
        if reach.max() > self.reaches[0]:
            return None
        within = np.zeros(self.shape, np.int8)  # how many of the reaches: the widest first, each holds the next
        for number, least in enumerate(self.reaches, 1):
            for place, most in zip(places, np.maximum(reach, least)[patch], strict=True):
                within[_within(place, most)] = number
        within *= self.present
        of_cells = self._of_cells(within)
        for number in range(1, len(self.reaches) + 1):
            chosen = np.flatnonzero(of_cells >= number)
            if len(chosen) <= min(MAX_SURROUNDINGS_SHARE * self.cells, MAX_SURROUNDINGS_CELLS):
                return Surroundings(self, within >= number, chosen)
        return None

    def patches(self, failed: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Cubes (cube, d) in the box that failed cells, cell_index (k, d), stand in, and the cube of each (k,); the
        patch (cube,) that they belong to, and how many cubes there must be between it and its border (patch,).
        """
        place = (failed >> self.halvings) - self.lower
        flat, cube = np.unique(np.ravel_multi_index(tuple(place.T), self.shape), return_inverse=True)
        places = np.stack(np.unravel_index(flat, self.shape), axis=1)
        occupied = np.zeros(np.ptp(places, axis=0) + 1, bool)
        occupied[tuple((places - places.min(axis=0)).T)] = True
        labels, patches = scipy.ndimage.label(occupied, np.ones((3,) * occupied.ndim))
        patch = labels[tuple((places - places.min(axis=0)).T)] - 1
        every = np.arange(patches)
        widths = [
            scipy.ndimage.maximum(along, patch[cube], every) - scipy.ndimage.minimum(along, patch[cube], every)
            for along in failed.T
        ]
        half = 0.5 * (np.max(widths, axis=0) + 1) / (1 << self.halvings)
        reach = np.ceil(half * (MAX_BORDER_SHARE ** (-1.0 / failed.shape[1]) - 1.0)).astype(int)
        return places, cube, patch, reach

    def _of_cells(self, value: np.ndarray) -> np.ndarray:
        """For each cell (cell,) the largest value, of cubes along each axis, of those that it lies in or holds."""
        result = np.zeros(self.cells, value.dtype)
        for group, (at, place) in enumerate(self.levels):
            for axis in range(value.ndim if group else 0):
                even, odd = (value[(slice(None),) * axis + (slice(first, None, 2),)] for first in range(2))
                value = np.maximum(even, odd)
            result[at] = value.reshape(-1)[place]
        return result


@dataclass(frozen=True)
class Surroundings:
    """Cells (k,), indices, ascending, that lie in cubes, or hold one: near (cubes along each axis of the box) bool."""

    cubes: Cubes
    near: np.ndarray
    cells: np.ndarray

    def reach_beyond(self, places: np.ndarray, cubes: int) -> np.ndarray:
        """(k,) bool: whether they end within so many cubes of places (k, d), fine units, that lie in them."""
        inner = scipy.ndimage.minimum_filter(self.near, 2 * cubes + 1, mode="constant", cval=1)
        return ~inner[tuple(((places >> self.cubes.halvings) - self.cubes.lower).T)]

    def are_wide(self, failed: np.ndarray) -> np.ndarray:
        """(k,) bool: whether a border held still carries at most the share MAX_BORDER_SHARE of what each one's patch
        changes.

        failed (k, d): cell_index of finest cells, all of them in these.
        """
        if not len(failed):
            return np.empty(0, bool)
        places, cube, patch, reach = self.cubes.patches(failed)
        wide = np.ones(len(reach), bool)
        for place, one in zip(places, patch, strict=True):
            wide[one] &= self.near[_within(place, reach[one])].all()
        return wide[patch[cube]]


def _within(place: np.ndarray, reach: int) -> tuple[slice, ...]:
    """Cubes at most `reach` away from one (d,), corners too."""
    return tuple(slice(max(along - reach, 0), along + reach + 1) for along in place)
