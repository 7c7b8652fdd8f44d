"""The order of a symmetric tensor's six components: xx, yy, zz, yz, xz, xy, with tensor (not engineering) shear."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

COMPONENTS = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "yz": (1, 2), "xz": (0, 2), "xy": (0, 1)}
NAMES = tuple(COMPONENTS)
ROW, COLUMN = np.array(list(COMPONENTS.values())).T
VOIGT_INDEX = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])  # Index among the six components of each of the nine.


def tensor_from_voigt(voigt: ArrayLike) -> NDArray:
    """Symmetric tensors (..., 3, 3) of six components (..., 6) with tensor shear."""
    return np.asarray(voigt)[..., VOIGT_INDEX]


def voigt_from_tensor(tensor: NDArray) -> NDArray:
    """Six components (..., 6) of symmetric tensors (..., 3, 3)."""
    return np.asarray(tensor)[..., ROW, COLUMN]
