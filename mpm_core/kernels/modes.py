"""Fields on a cell by their modes: the 2^d products of local coordinates x, y, z in -1..1 (Walsh-Hadamard transform).

Mode m is the product of those coordinates whose bit k is set in m. A field costs its transform once per cell; at any
place in it, value and derivatives are then a few multiplications. `values` (row, 2^d) holds one field per row;
derivatives are along the local coordinates. The transform is not normalised: divide by 2^d once.
"""

from numba import njit


@njit(inline="always", error_model="numpy")
def to_modes(values, row, dimension):
    """Corner values to sums by mode (Walsh-Hadamard): values[row] (2^d,), in place."""
    for k in range(dimension):
        for corner in range(1 << dimension):
            if not (corner >> k) & 1:
                low = values[row, corner]
                high = values[row, corner | (1 << k)]
                values[row, corner] = low + high
                values[row, corner | (1 << k)] = high - low


@njit(inline="always", error_model="numpy")
def to_corners(values, row, dimension):
    """The transpose of to_modes: values[row] (2^d,), in place."""
    for k in range(dimension):
        for corner in range(1 << dimension):
            if not (corner >> k) & 1:
                even = values[row, corner]
                odd = values[row, corner | (1 << k)]
                values[row, corner] = even - odd
                values[row, corner | (1 << k)] = even + odd
