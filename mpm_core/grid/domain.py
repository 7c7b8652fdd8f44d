"""The box that is modelled, and the coarsest cells that tile it."""

from dataclasses import dataclass

import numpy as np

from common.errors import InputError

# Relative round-off of a coordinate: from text to SI, and in a difference of two.
COORDINATE_ROUND_OFF = 4 * np.finfo(np.float64).eps


@dataclass(frozen=True)
class Domain:
    """The box that is modelled: lower corner (d,) m, base cells (d,), edge of a base cell m, number of levels."""

    lower: np.ndarray
    base_shape: np.ndarray
    coarse_cell: float
    levels: int

    @property
    def upper(self) -> np.ndarray:
        """Upper corner (d,) m."""
        return self.lower + self.base_shape * self.coarse_cell

    def cell(self, level: int) -> float:
        """Edge of a cell of a level, m."""
        return self.coarse_cell / 2**level


def base_cells(lower, upper, coarse_cell: float, name: str = "grid.coarse_cell") -> np.ndarray:
    """Number of base cells of edge coarse_cell m that tile the box from lower to upper (d,) m along each axis: (d,)
    int64.

    Raises InputError if they do not, but for the round-off of the coordinates: what is left would be no part of a cell.
    name: what a message calls coarse_cell.
    """
    lower, upper = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
    side = upper - lower
    count = np.rint(side / coarse_cell)
    round_off = COORDINATE_ROUND_OFF * np.maximum(np.maximum(np.abs(lower), np.abs(upper)), side)
    for axis in np.flatnonzero((count < 1) | (np.abs(side - count * coarse_cell) > round_off)):
        tiled = max(int(count[axis]), 1)
        raise InputError(
            f"domain.upper[{axis}]: the side of {side[axis]:.15g} m is not a whole multiple of {name}, "
            f"{coarse_cell:.15g} m, of which {tiled} {'make' if tiled > 1 else 'makes'} {tiled * coarse_cell:.15g} m; "
            "change one of the two"
        )
    return count.astype(np.int64)


def marks_memory(base_shape, levels: int) -> int:
    """Bytes at once for marking splits: one flag for each possible cell but those of the finest level, and two copies
    of the largest level while it is dilated."""
    cells = [int(np.prod([int(side) << level for side in base_shape], dtype=object)) for level in range(levels - 1)]
    return sum(cells) + 2 * max(cells, default=0)
