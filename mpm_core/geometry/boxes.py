"""Which points a box holds, and which box holds points: axis by axis, which numpy does far faster than row by row."""

import numpy as np


def in_box(points: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Whether each point (point, dimension) lies between the corners (dimension,) of a box, sides included: (point,)
    bool."""
    inside = np.ones(len(points), bool)
    for along, first, last in zip(points.T, lower, upper, strict=True):
        inside &= along >= first
        inside &= along <= last
    return inside


def box_around(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (dimension,) of the box around points (point, dimension), at least one."""
    return np.array([along.min() for along in points.T]), np.array([along.max() for along in points.T])
