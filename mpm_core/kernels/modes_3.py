"""Modes (modes.py) at a place of a cell with 2^3 corners (3-D).

Kernels made for a dimension take this module as a whole: numba keeps a kernel on disk under what its closure holds, and
a module goes by its name where a compiled function would be another one in every process.
"""

from numba import njit


@njit(inline="always", error_model="numpy")
def sample(values, row, x, y, z):
    """Value and derivatives along x, y, z at a place of the field with modal sums values[row] (8,)."""
    at_0 = values[row, 0] + z * values[row, 4]
    at_1 = values[row, 1] + z * values[row, 5]
    at_2 = values[row, 2] + z * values[row, 6]
    at_3 = values[row, 3] + z * values[row, 7]
    along_x = at_1 + y * at_3
    along_z = values[row, 4] + y * values[row, 6] + x * (values[row, 5] + y * values[row, 7])
    return at_0 + y * at_2 + x * along_x, along_x, at_2 + x * at_3, along_z


@njit(inline="always", error_model="numpy")
def value(values, row, x, y, z):
    """8 times the value at a place of the field with values[row] (8,) at the corners.

    Not by modes: a node that the particles hardly touch may have an acceleration that drowns those of the others.
    """
    lower_low = (1.0 - x) * values[row, 0] + (1.0 + x) * values[row, 1]
    lower_high = (1.0 - x) * values[row, 2] + (1.0 + x) * values[row, 3]
    upper_low = (1.0 - x) * values[row, 4] + (1.0 + x) * values[row, 5]
    upper_high = (1.0 - x) * values[row, 6] + (1.0 + x) * values[row, 7]
    lower = (1.0 - y) * lower_low + (1.0 + y) * lower_high
    upper = (1.0 - y) * upper_low + (1.0 + y) * upper_high
    return (1.0 - z) * lower + (1.0 + z) * upper


@njit(inline="always", error_model="numpy")
def add_value(values, row, x, y, z, value):
    """The transpose of value: add a value to the corners, 8 times its shares by the shape functions, in place.

    Not by modes: their sum at a corner far from the place would be round-off of the size of the value.
    """
    lower_low = value * (1.0 - z) * (1.0 - y)
    lower_high = value * (1.0 - z) * (1.0 + y)
    upper_low = value * (1.0 + z) * (1.0 - y)
    upper_high = value * (1.0 + z) * (1.0 + y)
    values[row, 0] += lower_low * (1.0 - x)
    values[row, 1] += lower_low * (1.0 + x)
    values[row, 2] += lower_high * (1.0 - x)
    values[row, 3] += lower_high * (1.0 + x)
    values[row, 4] += upper_low * (1.0 - x)
    values[row, 5] += upper_low * (1.0 + x)
    values[row, 6] += upper_high * (1.0 - x)
    values[row, 7] += upper_high * (1.0 + x)


@njit(inline="always", error_model="numpy")
def add_slopes(values, row, x, y, z, along_x, along_y, along_z):
    """The transpose of sample for derivatives: added to the modal sums values[row] (8,)."""
    across_z = along_x * y + along_y * x
    values[row, 1] += along_x
    values[row, 2] += along_y
    values[row, 3] += across_z
    values[row, 4] += along_z
    values[row, 5] += along_x * z + along_z * x
    values[row, 6] += along_y * z + along_z * y
    values[row, 7] += across_z * z + along_z * (x * y)
