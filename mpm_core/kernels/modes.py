"""Fields on a cell by their modes: the 2^d products of local coordinates x, y, z in -1..1 (Walsh-Hadamard transform).

Mode m is the product of those coordinates whose bit k is set in m. A field costs its transform once per cell; at any
place in it, value and derivatives are then a few multiplications. `values` (row, 2^d) holds one field per row;
derivatives are along the local coordinates. The transform is not normalised: divide by 2^d once.
"""

import numpy as np
from numba import njit

TWIST_SHARE = 2.0 / 3.0  # Stiffness against twist over that against bending, see hourglass_share.


@njit(inline="always", error_model="numpy")
def hourglass_share(mode, component):
    """Hourglass stiffness of a component's mode (by its bits) over that of bending.

    A mode without the component's own coordinate twists the cell (3-D). With TWIST_SHARE the energy of a plate is
    D / 2 (k_x^2 + k_y^2 + 2 k_xy^2) in its curvatures, the same in all directions. A plate that is clamped all round
    has this energy, whatever Poisson's ratio is: its k_x k_y - k_xy^2 vanishes on the mean. Twist alone of k_xy, whose
    three modes have one amplitude, would be exact with 2 (1 - nu) / 3.
    """
    return 1.0 if (mode >> component) & 1 else TWIST_SHARE


def hourglass_shares(dimension: int) -> np.ndarray:
    """`hourglass_share` of each higher mode, in the order of their bits, and component: (2^d - 1 - d, d)."""
    higher = [mode for mode in range(1 << dimension) if mode & (mode - 1)]
    return np.array([[hourglass_share(mode, j) for j in range(dimension)] for mode in higher])


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
