"""Axes of many seismic sources: their means and cones, and the Kagan angles between them.

Axes have no sense: a unit vector and its opposite are the same axis. They are given pointing down, as
pipeline.source_tensors.point_down says. x east, y north, z up; trend clockwise from north, plunge below the horizontal.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import chi2, f

from pipeline.source_tensors import HORIZONTAL, point_down

AXIS_NAMES = ("P", "B", "T")
KAGAN_PAIRS = ("model_record", "nearest", "record_record", "uniform")
MOST_PAIRS = 20000  # sampled of all pairs of two catalogues
KAGAN_LIMIT = 120.0
KAGAN_BIN = 10.0  # degrees
TAILS = (0.025, 0.975)


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


def nodal_planes(p_axis: NDArray, t_axis: NDArray) -> NDArray:
    """Strike, dip and rake (..., 2, 3), degrees, of the two nodal planes of double couples with these axes (..., 3).

    Slip along a plane opens along T = (n + s) / sqrt 2 and closes along P = (n - s) / sqrt 2, with n the plane's normal
    and s the slip of the side that n points to; the other plane has them exchanged (Aki and Richards 2002, section
    4.2). Strike 0 to 360, the plane dips to its right; dip 0 to 90; rake of the hanging wall, -180 to 180. A level
    plane has no strike: it is north.
    """
    sums, differences = (np.asarray(t_axis) + sign * np.asarray(p_axis) for sign in (1.0, -1.0))
    normal = np.stack([sums, differences], axis=-2) / np.sqrt(2.0)
    slip = normal[..., ::-1, :]
    upward = np.where(normal[..., 2:] < 0.0, -1.0, 1.0)  # the hanging wall lies above
    normal, slip = upward * normal, upward * slip
    level = np.hypot(normal[..., 0], normal[..., 1])
    towards = np.where(level > HORIZONTAL, np.arctan2(normal[..., 0], normal[..., 1]), np.pi / 2.0)  # dips to there
    dip = np.arctan2(level, normal[..., 2])
    east, north = np.sin(towards), np.cos(towards)
    along = np.stack([-north, east, np.zeros_like(east)], axis=-1)  # the strike: its dip is to the right
    updip = np.stack([-np.cos(dip) * east, -np.cos(dip) * north, np.sin(dip)], axis=-1)
    rake = np.arctan2(np.sum(slip * updip, axis=-1), np.sum(slip * along, axis=-1))
    return np.degrees(np.stack([(towards - np.pi / 2.0) % (2.0 * np.pi), dip, rake], axis=-1))


def angle_between_axes(first: NDArray, second: NDArray) -> NDArray:
    """Angle, 0 to 90 degrees, between axes (..., 3)."""
    along = np.abs(np.sum(first * second, axis=-1))
    across = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.degrees(np.arctan2(across, along))


def mean_axis(axes: NDArray, weights: NDArray | None = None) -> tuple[NDArray, NDArray]:
    """Mean (..., 3) of axes (..., event, 3): largest eigenvector of the orientation matrix, and its eigenvalue (...).

    The orientation matrix is the weighted mean of a a^T (Scheidegger 1965; Woodcock 1977): the maximum likelihood
    mean of a Bingham or Watson distribution. Its largest eigenvalue is 1 for parallel axes, 1/3 for uniform ones.
    Axes that are NaN (pipeline.source_tensors.clear_axes) do not count; NaN where none does.
    """
    axes = np.asarray(axes, float)
    clear = np.isfinite(axes).all(axis=-1)
    axes = np.where(clear[..., None], axes, 0.0)
    weights = clear * (1.0 if weights is None else np.asarray(weights, float))
    total = weights.sum(axis=-1)
    matrix = (
        np.einsum("...e,...ei,...ej->...ij", weights, axes, axes) / np.where(total > 0, total, 1.0)[..., None, None]
    )
    values, vectors = np.linalg.eigh(matrix)
    known = total > 0
    return np.where(known[..., None], point_down(vectors[..., 2]), np.nan), np.where(known, values[..., 2], np.nan)


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


@dataclass(frozen=True)
class AxesSample:
    """Axes of one catalogue: rows P, B, T (event, 3, 3), NaN where unclear; where (event, 3) m, and blocks (event,)."""

    axes: NDArray
    location: NDArray
    blocks: NDArray

    def weights(self, resamplings: int, generator: np.random.Generator) -> NDArray:
        """How often each event is drawn (resampling, event) when blocks are drawn with replacement."""
        labels = np.unique(self.blocks, return_inverse=True)[1].reshape(-1)
        count = int(labels.max()) + 1
        return generator.multinomial(count, np.full(count, 1 / count), size=resamplings)[:, labels].astype(float)

    def clear_share(self, size: NDArray) -> NDArray:
        """Share (3,) of the summed size (event,) whose P, B and T axes are clear."""
        clear = np.isfinite(self.axes).all(axis=-1)
        return size @ clear / size.sum()


def compare_axes(model: AxesSample, record: AxesSample, seed: int = 0, resamplings: int = 499) -> dict[str, NDArray]:
    """Mean axes, their cones and angles, and Kagan angles of two catalogues, as named in catalogs.comparison.

    Cones and intervals (95 %) resample blocks with replacement. Resampled angles are larger than the angle itself and
    never 0: the interval of the angle is what a test of each angle leaves, `_angle_test`. Of all pairs of events at
    most MOST_PAIRS are drawn for the Kagan angles; record_record leaves out an event with itself.
    """
    generator = np.random.default_rng(seed)
    sides = (model, record)
    weights = [side.weights(resamplings, generator) for side in sides]
    means, strengths, cones, drawn = [], [], [], []
    for side, weight in zip(sides, weights, strict=True):
        found = [mean_axis(side.axes[:, row]) for row in range(3)]
        again = np.stack([mean_axis(side.axes[:, row], weight)[0] for row in range(3)], axis=1)
        means.append(np.array([axis for axis, _ in found]))
        strengths.append([strength for _, strength in found])
        cones.append(_quantile(angle_between_axes(again, means[-1]), 0.95))
        drawn.append(again)
    means = np.array(means)
    angle = angle_between_axes(means[0], means[1])
    reach, p_value = _angle_test(means, drawn, [len(np.unique(side.blocks)) for side in sides], angle)
    trend, plunge = trend_plunge(means)
    result = {
        "mean_axis": means,
        "mean_trend": trend,
        "mean_plunge": plunge,
        "mean_cone": np.array(cones),
        "mean_strength": np.array(strengths),
        "mean_angle": angle,
        "mean_angle_interval": np.stack([np.maximum(angle - reach, 0.0), np.minimum(angle + reach, 90.0)], axis=-1),
        "mean_angle_p_value": p_value,
    }
    return result | _kagan_distributions(sides, weights, generator)


def _angle_test(means: NDArray, drawn: list[NDArray], blocks: list[int], angle: NDArray) -> tuple[NDArray, NDArray]:
    """How far, degrees (3,), the mean axes' angle may be off in 95 of 100 cases, and p (3,) of the angle if it is 0.

    means (2, 3, 3); drawn: of each catalogue (resampling, 3, 3). How much both means move in a resampling, less each
    other, is taken for the error of their difference; the angle cannot be off by more than that. Few blocks scatter
    less than what they are drawn from: the distance of two components grows as Hotelling's T2 of so many does over its
    limit, chi-square.
    """
    moved = []
    for mean, again in zip(means, drawn, strict=True):
        same = np.where(np.sum(again * mean, axis=-1, keepdims=True) < 0, -1.0, 1.0)
        moved.append(same * again - mean)
    # axes: turn the second to the side of the first
    moved[1] = moved[1] * np.where(np.sum(means[0] * means[1], axis=-1) < 0, -1.0, 1.0)[:, None]
    fewest = max(min(blocks), 4)
    few = np.sqrt(2 * (fewest - 1) / (fewest - 2) * f.ppf(0.95, 2, fewest - 2) / chi2.ppf(0.95, 2))
    chord = few * np.linalg.norm(moved[0] - moved[1], axis=-1)
    off = np.degrees(2 * np.arcsin(np.minimum(chord / 2, 1.0)))
    p_value = (1 + np.sum(off >= angle, axis=0)) / (len(off) + 1)
    return _quantile(off, 0.95), np.where(np.isfinite(angle), p_value, np.nan)


def _quantile(values: NDArray, share: float) -> NDArray:
    """Quantile over the first dimension of what is finite; NaN where nothing is."""
    found = np.isfinite(values).any(axis=0)
    return np.where(found, np.nanquantile(np.where(found, values, 0.0), share, axis=0), np.nan)


def _kagan_distributions(
    sides: tuple[AxesSample, AxesSample], weights: list[NDArray], generator: np.random.Generator
) -> dict[str, NDArray]:
    """Kagan angles of the pairs KAGAN_PAIRS, of sources with three clear axes: share per bin, median, its interval."""
    full = [np.flatnonzero(np.isfinite(side.axes).all(axis=(1, 2))) for side in sides]
    model, record = (
        AxesSample(side.axes[own], side.location[own], side.blocks[own]) for side, own in zip(sides, full, strict=True)
    )
    weights = [weight[:, own] for weight, own in zip(weights, full, strict=True)]
    modelled, recorded = _pairs(len(model.axes), len(record.axes), generator)
    one, other = _pairs(len(record.axes), len(record.axes), generator)
    one, other = one[one != other], other[one != other]
    beside = np.arange(len(model.axes) if len(record.axes) else 0)
    nearest = cKDTree(record.location).query(model.location[beside])[1] if len(beside) else beside
    # of each kind of pair: its angles, and how often each pair is drawn when the events are drawn (model's, record's)
    angles = [
        (kagan_angle(model.axes[modelled], record.axes[recorded]), lambda m, r: m[modelled] * r[recorded]),
        (kagan_angle(model.axes[beside], record.axes[nearest]), lambda m, r: m[beside]),
        (kagan_angle(record.axes[one], record.axes[other]), lambda m, r: r[one] * r[other]),
        (kagan_angle(random_frames(MOST_PAIRS, generator), np.eye(3)), None),
    ]
    lower = np.arange(0.0, KAGAN_LIMIT, KAGAN_BIN)
    shares, medians, intervals = [], [], []
    for angle, weigh in angles:
        inside = np.minimum(angle, KAGAN_LIMIT * (1 - 1e-12))
        count = np.histogram(inside, bins=np.append(lower, KAGAN_LIMIT))[0]
        shares.append(count / len(angle) if len(angle) else np.full(len(lower), np.nan))
        medians.append(np.median(angle) if len(angle) else np.nan)
        intervals.append(_median_interval(angle, weigh, weights))
    return {
        "kagan_lower": lower,
        "kagan_share": np.array(shares),
        "kagan_median": np.array(medians),
        "kagan_median_interval": np.array(intervals),
    }


def _pairs(first: int, second: int, generator: np.random.Generator) -> tuple[NDArray, NDArray]:
    """Indices of all pairs, or of MOST_PAIRS of them."""
    if first * second <= MOST_PAIRS:
        return tuple(index.ravel() for index in np.indices((first, second)))
    return generator.integers(first, size=MOST_PAIRS), generator.integers(second, size=MOST_PAIRS)


def _median_interval(angle: NDArray, weigh, weights: list[NDArray]) -> NDArray:
    """Interval (2,) of the median when blocks are resampled."""
    if weigh is None or len(angle) == 0:
        return np.full(2, np.nan)
    order = np.argsort(angle, kind="stable")
    medians = []
    for drawn in zip(*weights, strict=True):
        below = np.cumsum(weigh(*drawn)[order])
        if below[-1] > 0:
            medians.append(angle[order[np.searchsorted(below, below[-1] / 2)]])
    return np.quantile(medians, TAILS) if medians else np.full(2, np.nan)
