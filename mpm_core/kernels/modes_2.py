"""Modes (modes.py) at a place of a cell with 2^2 corners (plane strain).

Kernels made for a dimension take this module as a whole: numba keeps a kernel on disk under what its closure holds, and
a module goes by its name where a compiled function would be another one in every process.
"""

from numba import njit


@njit(inline="always", error_model="numpy")
def sample(values, row, x, y, z):
    """Value and derivatives along x, y, z at a place of the field with modal sums values[row] (4,)."""
    low = values[row, 0] + y * values[row, 2]
    along_x = values[row, 1] + y * values[row, 3]
    return low + x * along_x, along_x, values[row, 2] + x * values[row, 3], 0.0


@njit(inline="always", error_model="numpy")
def value(values, row, x, y, z):
    """4 times the value at a place of the field with values[row] (4,) at the corners."""
    low = (1.0 - x) * values[row, 0] + (1.0 + x) * values[row, 1]
    high = (1.0 - x) * values[row, 2] + (1.0 + x) * values[row, 3]
    return (1.0 - y) * low + (1.0 + y) * high


@njit(inline="always", error_model="numpy")
def add_value(values, row, x, y, z, value):
    """The transpose of value: add a value to the corners, 4 times its shares by the shape functions, in place."""
    low = value * (1.0 - y)
    high = value * (1.0 + y)
    values[row, 0] += low * (1.0 - x)
    values[row, 1] += low * (1.0 + x)
    values[row, 2] += high * (1.0 - x)
    values[row, 3] += high * (1.0 + x)


@njit(inline="always", error_model="numpy")
def add_slopes(values, row, x, y, z, along_x, along_y, along_z):
    """The transpose of sample for derivatives: added to the modal sums values[row] (4,)."""
    values[row, 1] += along_x
    values[row, 2] += along_y
    values[row, 3] += along_x * y + along_y * x
