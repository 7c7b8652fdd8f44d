"""Planes of weakness: their normal, and the share of a strain or a potency that is no slip along them."""

import numpy as np


def normal_of(material: dict) -> np.ndarray:
    """Upward unit normal (3,) of a material's planes. x east, y north, z up; dip direction clockwise from north."""
    dip, direction = (np.radians(material["planes"][key]) for key in ("dip", "dip_direction"))
    return np.array([np.sin(dip) * np.sin(direction), np.sin(dip) * np.cos(direction), np.cos(dip)])


def share_within(tensor: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Share (2-norm) of tensors (..., 3, 3) that is no slip along planes with normal n.

    It is 0 for n g + g n with g in the planes. The rest deforms the planes within themselves, or opens or closes them.
    """
    across = np.outer(normal, normal)
    within = np.eye(3) - across
    slip = within @ tensor @ across
    rest = tensor - slip - np.swapaxes(slip, -1, -2)
    size = np.linalg.norm(tensor, axis=(-2, -1))
    return np.linalg.norm(rest, axis=(-2, -1)) / np.where(size > 0.0, size, 1.0)
