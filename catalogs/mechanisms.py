"""Axes and mechanisms of seismic sources: principal axes, their means and cones, Kagan angles, source shares.

Axes have no sense: a unit vector and its opposite are the same axis. They are given pointing down (z <= 0), as a
lower-hemisphere stereonet shows them. x east, y north, z up; trend clockwise from north, plunge below the horizontal.
"""

import numpy as np
from numpy.typing import NDArray

AXIS_NAMES = ("P", "B", "T")
RANDOM_FRAMES = 4096  # pairs that sample the Kagan angle of uniformly random frames


def principal_axes(tensor: NDArray) -> tuple[NDArray, NDArray]:
    """Principal values (..., 3) ascending and axes (..., 3, 3), rows P, B, T, of symmetric tensors (..., 3, 3).

    Opening positive: P belongs to the smallest value, T to the largest (errata 5). Axes point down.
    """
    values, vectors = np.linalg.eigh(np.asarray(tensor, float))
    return values, point_down(np.swapaxes(vectors, -1, -2))


def point_down(axes: NDArray) -> NDArray:
    """The same axes (..., 3) with z <= 0; a horizontal one points north, or east if it runs east-west."""
    axes = np.asarray(axes, float)
    x, y, z = axes[..., 0], axes[..., 1], axes[..., 2]
    flip = (z > 0) | ((z == 0) & ((y < 0) | ((y == 0) & (x < 0))))
    return np.where(flip[..., None], -axes, axes) + 0.0  # + 0.0: no negative zeros


def trend_plunge(axes: NDArray) -> tuple[NDArray, NDArray]:
    """Trend (0 to 360) and plunge (0 to 90), degrees, of axes (..., 3)."""
    down = point_down(axes)
    trend = np.degrees(np.arctan2(down[..., 0], down[..., 1])) % 360.0
    plunge = np.degrees(np.arctan2(-down[..., 2], np.hypot(down[..., 0], down[..., 1])))
    return trend, plunge


def axis_from_trend_plunge(trend: NDArray, plunge: NDArray) -> NDArray:
    """Unit vectors (..., 3) pointing down from trend and plunge in degrees."""
    trend, plunge = np.radians(trend), np.radians(plunge)
    return np.stack([np.sin(trend) * np.cos(plunge), np.cos(trend) * np.cos(plunge), -np.sin(plunge)], axis=-1)


def angle_between_axes(first: NDArray, second: NDArray) -> NDArray:
    """Angle, 0 to 90 degrees, between axes (..., 3)."""
    along = np.abs(np.sum(first * second, axis=-1))
    across = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.degrees(np.arctan2(across, along))


def mean_axis(axes: NDArray, weights: NDArray | None = None) -> tuple[NDArray, NDArray]:
    """Mean (..., 3) of axes (..., event, 3): largest eigenvector of the orientation matrix, and its eigenvalue (...).

    The orientation matrix is the weighted mean of a a^T (Scheidegger 1965; Woodcock 1977): the maximum likelihood
    mean of a Bingham or Watson distribution. Its largest eigenvalue is 1 for parallel axes, 1/3 for uniform ones.
    """
    axes = np.asarray(axes, float)
    weights = np.ones(axes.shape[-2]) if weights is None else np.asarray(weights, float)
    outer = axes[..., :, None] * axes[..., None, :]
    matrix = np.einsum("...e,...eij->...ij", weights, outer) / weights.sum(axis=-1)[..., None, None]
    values, vectors = np.linalg.eigh(matrix)
    return point_down(vectors[..., 2]), values[..., 2]


def source_shares(tensor: NDArray) -> NDArray:
    """Isotropic, CLVD and double-couple share (..., 3) of tensors (..., 3, 3) (Vavrycuk 2015); |shares| sum to 1.

    ISO = tr / 3, CLVD = 2/3 (m1 + m3 - 2 m2), DC = 1/2 (m1 - m3 - |m1 + m3 - 2 m2|), over the sum of absolutes.
    """
    values = np.linalg.eigvalsh(np.asarray(tensor, float))
    smallest, middle, largest = values[..., 0], values[..., 1], values[..., 2]
    skew = largest + smallest - 2 * middle
    parts = np.stack([values.mean(axis=-1), 2 / 3 * skew, (largest - smallest - np.abs(skew)) / 2], axis=-1)
    total = np.abs(parts).sum(axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.where(total > 0, parts / total, np.nan)


def frames(axes: NDArray) -> NDArray:
    """Right-handed orthonormal frames (..., 3, 3), rows P, B, T, from axes (..., 3, 3) that may be left-handed."""
    axes = np.array(axes, float)
    handed = np.linalg.det(axes)
    axes[..., 1, :] *= np.where(handed < 0, -1.0, 1.0)[..., None]
    return axes


# The rotations that turn a double couple into itself: none, or half a turn about one of its axes.
HALF_TURNS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)


def kagan_angle(first: NDArray, second: NDArray) -> NDArray:
    """Least rotation, 0 to 120 degrees, that turns one double couple into another (Kagan 1991).

    first, second (..., 3, 3): rows P, B, T, unit vectors of either sense; leading dimensions broadcast. For sources
    that are not double couples it is the angle between their principal frames.
    """
    first, second = frames(first), frames(second)
    cosines = np.einsum("...ai,...ai->...a", first, second)
    traces = np.einsum("...a,ha->...h", cosines, HALF_TURNS)
    trace, best = traces.max(axis=-1), traces.argmax(axis=-1)
    # |R - 1| = 2 sqrt(2) sin(angle / 2) keeps small angles accurate where arccos of the trace would not
    turned = first * HALF_TURNS[best][..., :, None]
    sine = np.linalg.norm(turned - second, axis=(-2, -1)) / (2 * np.sqrt(2))
    cosine = np.sqrt(np.maximum(1 + trace, 0)) / 2
    return np.degrees(2 * np.arctan2(sine, cosine))


def random_frames(count: int, generator: np.random.Generator) -> NDArray:
    """Uniformly random frames (count, 3, 3) from unit quaternions."""
    quaternion = generator.normal(size=(count, 4))
    w, x, y, z = (quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)).T
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=-1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1),
        ],
        axis=-2,
    )
