"""Cells that an opening needs across it, and the size of cells that are small enough."""

import math

CELLS_ACROSS_FILL = 4  # Of an opening that stood open: else walls have nodes of their own, which fill does not join.
MIN_SHARE_REACHED = 0.0125  # A thickness that is this share short of a number of cells counts as the number.


def largest_cell(thickness: float, cells: float) -> float:
    """Largest edge, m, of which so many cells count as fitting into a thickness, m, rounded down to two digits.

    The thickness is above 0.

    >>> largest_cell(4.8, 4)
    1.2
    """
    largest = thickness / cells * (1.0 + MIN_SHARE_REACHED / 2.0)
    digits = 1 - math.floor(math.log10(largest))
    return round(math.floor(largest * 10.0**digits) / 10.0**digits, max(digits, 0))
