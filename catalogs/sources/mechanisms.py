"""Axes of many seismic sources: their mean and whether it exists, angles between means, and Kagan angles.

Axes have no sense: a unit vector and its opposite are the same axis. They are given pointing down, as
common.source_tensors.point_down says. x east, y north, z up; trend clockwise from north, plunge below the horizontal.

The orientation matrix is the mean of a a^T (Scheidegger 1965); its eigenvalues S1 >= S2 >= S3 add up to 1. Woodcock's
(1977) K = ln(S1 / S2) / ln(S2 / S3) is above 1 for a cluster about the eigenvector of S1, below 1 for a girdle about
that of S3, its pole. A tight cluster that is longer than wide has a K below 1, too, but it has a good mean. Therefore a
girdle must also be more of a girdle than of a point, 2 (S2 - S3) > S1 - S2 (Vollmer 1990). Uniform axes have S = 1/3
three times.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from catalogs.sources.jackknife import INTERVAL_95, Scatter, effective_blocks
from common.fields import TEXT
from common.source_tensors import MAX_HORIZONTAL_COMPONENT, point_down

CLUSTER, GIRDLE, UNIFORM = "cluster", "girdle", "no preferred direction"
MAX_CHANCE_OF_PATTERN = 0.05  # Axes with a pattern that is more likely by chance count as uniform.
MAX_PARALLEL_VARIANCE = 1e-12  # Variance of the orientation matrix of parallel axes, whose unit vectors are rounded.
MAX_CONE = 45.0  # degrees; a wider 95 % cone shows that there is no mean


@dataclass(frozen=True)
class AxesSample:
    """Axes of one catalogue: rows P, B, T (event, 3, 3), NaN where unclear; where (event, 3) m, and blocks (event,).

    blocks: None for a model that ran once, whose scatter is not known.
    """

    axes: NDArray
    location: NDArray
    blocks: NDArray | None

    @property
    def labels(self) -> NDArray:
        """Blocks (event,) numbered 0, 1, ...; without blocks each event is one."""
        blocks = np.arange(len(self.axes)) if self.blocks is None else self.blocks
        return np.unique(blocks, return_inverse=True)[1].reshape(-1)

    def weights(self, resamplings: int, generator: np.random.Generator) -> NDArray:
        """Random weights (resampling, event) of blocks (Bayesian bootstrap, Rubin 1981)."""
        labels = self.labels
        return generator.standard_exponential((resamplings, int(labels.max()) + 1))[:, labels]

    def clear_share(self, size: NDArray) -> NDArray:
        """Share (3,) of the summed size (event,) whose P, B and T axes are clear."""
        clear = np.isfinite(self.axes).all(axis=-1)
        return size @ clear / size.sum()


@dataclass(frozen=True)
class MeanAxis:
    """Mean (3,) of one kind of axes, NaN where they have none, and how sure it is.

    values (3,): eigenvalues, largest first; shape: CLUSTER, GIRDLE, UNIFORM, or empty without axes; pole (3,): of a
    girdle, else NaN; scatter: of the mean, None without blocks or without a mean.
    """

    mean: NDArray
    values: NDArray
    shape: str
    pole: NDArray
    scatter: Scatter | None

    @property
    def woodcock(self) -> float:
        """Woodcock's K; infinite for parallel axes, 0 for ones in a plane that are spread evenly."""
        first, second, third = np.maximum(self.values, 1e-12)
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.log(first / second) / np.log(second / third))


def describe_axes(axes: NDArray, labels: NDArray, blocks_known: bool) -> MeanAxis:
    """Mean direction, or pattern without a mean, of axes (event, 3), NaN where unclear; labels (event,): their blocks.

    Axes count as uniform unless Bingham's statistic, 15/2 n sum (S_i - 1/3)^2 of chi-square with 5 degrees of
    freedom (Mardia and Jupp 2000, 10.7), says otherwise. n is the effective number of independent axes: their
    number over the design effect: the jackknife's variance of the orientation matrix over that of independent events.
    """
    clear = np.isfinite(axes).all(axis=-1)
    axes, labels = axes[clear], np.unique(labels[clear], return_inverse=True)[1].reshape(-1)
    absent = np.full(3, np.nan)
    if not len(axes):
        return MeanAxis(absent, absent, "", absent, None)
    matrix = axes[:, :, None] * axes[:, None, :]
    values, vectors = np.linalg.eigh(matrix.mean(axis=0))
    values = np.maximum(values[::-1], 0.0)
    counts = np.bincount(labels)
    without, several = None, len(counts) > 1
    if several:
        sums = np.zeros((len(counts), 3, 3))
        np.add.at(sums, labels, matrix)
        without = (matrix.sum(axis=0) - sums) / (len(axes) - counts)[:, None, None]
        variance = np.sum((without - matrix.mean(axis=0)) ** 2)
        alone = (1.0 - np.sum(values**2)) / len(axes)
        worth = len(axes) * min(alone / variance, 1.0) if variance > MAX_PARALLEL_VARIANCE else float(len(axes))
    else:
        worth = 1.0
    strength = 7.5 * worth * np.sum((values - 1.0 / 3.0) ** 2)
    shape = UNIFORM if scipy.stats.chi2.sf(strength, 5) > MAX_CHANCE_OF_PATTERN else CLUSTER
    found = MeanAxis(absent, values, shape, absent, None)
    if shape == UNIFORM:
        return found
    first, second, third = values
    if found.woodcock < 1.0 and 2.0 * (second - third) > first - second:
        return MeanAxis(absent, values, GIRDLE, point_down(vectors[:, 0]), None)
    mean = point_down(vectors[:, 2])
    scatter = None
    if blocks_known and without is not None:
        moved = np.linalg.eigh(without)[1][..., 2]
        moved *= np.where(moved @ mean < 0, -1.0, 1.0)[:, None]  # axes have no sense
        scatter = Scatter.of(moved, mean, max(effective_blocks(counts) - 1.0, 1.0))
    return MeanAxis(mean, values, CLUSTER, absent, scatter)


AXIS_NAMES = ("P", "B", "T")
KAGAN_PAIRS = ("model_record", "nearest", "record_record", "uniform")
MAX_KAGAN_PAIRS = 20000  # Pairs that are sampled of all pairs of two catalogues.
KAGAN_LIMIT = 120.0  # degrees, the largest Kagan angle
KAGAN_BIN = 10.0  # degrees
ANGLE_DRAWS = 9999  # Draws for the quantile of an angle.


def trend_plunge(axes: NDArray) -> tuple[NDArray, NDArray]:
    """Trend (0 to 360) and plunge (0 to 90), degrees, of axes (..., 3)."""
    down = point_down(axes)
    trend = np.degrees(np.arctan2(down[..., 0], down[..., 1])) % 360.0
    plunge = np.degrees(np.arctan2(-down[..., 2], np.hypot(down[..., 0], down[..., 1])))
    return trend, plunge


def direction(trend: float, plunge: float) -> str:
    """Trend/plunge as written on a plan, whole degrees.

    >>> direction(3.2, 45.0)
    '003°/45°'
    """
    return f"{round(trend) % 360:03d}°/{plunge:.0f}°"


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
    towards = np.where(
        level > MAX_HORIZONTAL_COMPONENT, np.arctan2(normal[..., 0], normal[..., 1]), np.pi / 2.0
    )  # dips to there
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


def compare_axes(model: AxesSample, record: AxesSample, seed: int = 0, resamplings: int = 499) -> dict[str, NDArray]:
    """Mean axes, their cones and angles, and Kagan angles of two catalogues, as named in catalogs.compare.layout.

    Cones, intervals of the angle between mean axes and its p-value: the jackknife over blocks (`sources.jackknife`).
    The error of the angle is at most that of the difference of the mean axes. Intervals of Kagan angles weigh blocks at
    random. NaN where they need blocks that a model which ran once has not, or a mean that a girdle has not. Of all
    pairs of events at most MAX_KAGAN_PAIRS are drawn for the Kagan angles; record_record leaves out an event with
    itself.
    """
    generator = np.random.default_rng(seed)
    sides = (model, record)
    described = [
        [describe_axes(side.axes[:, row], side.labels, side.blocks is not None) for row in range(3)] for side in sides
    ]
    draws = max(resamplings, ANGLE_DRAWS)
    means = np.array([[one.mean for one in side] for side in described])
    cones = [[_quantile(_off(one.scatter, draws, generator)) for one in side] for side in described]
    angle = angle_between_axes(means[0], means[1])
    reach, p_value = np.full(3, np.nan), np.full(3, np.nan)
    for row, (own, other) in enumerate(zip(*described, strict=True)):
        if own.scatter is not None and other.scatter is not None:
            off = _off(own.scatter + other.scatter, draws, generator)
            reach[row], p_value[row] = _quantile(off), (1 + np.sum(off >= angle[row])) / (draws + 1)
    trend, plunge = trend_plunge(means)
    pole_trend, pole_plunge = trend_plunge(np.array([[one.pole for one in side] for side in described]))
    values = np.array([[one.values for one in side] for side in described])
    result = {
        "mean_axis": means,
        "mean_trend": trend,
        "mean_plunge": plunge,
        "mean_cone": np.array(cones),
        "axis_eigenvalue": values,
        "axis_k": np.array([[one.woodcock for one in side] for side in described]),
        "axis_shape": np.array([[one.shape for one in side] for side in described], TEXT),
        "pole_trend": pole_trend,
        "pole_plunge": pole_plunge,
        "mean_angle": angle,
        "mean_angle_interval": np.stack([np.maximum(angle - reach, 0.0), np.minimum(angle + reach, 90.0)], axis=-1),
        "mean_angle_p_value": p_value,
    }
    weights = [side.weights(resamplings, generator) for side in sides]
    return result | _kagan_distributions(sides, weights, generator)


def _off(scatter: Scatter | None, draws: int, generator: np.random.Generator) -> NDArray:
    """Errors (draw,) of a mean axis, degrees; NaN without a scatter."""
    if scatter is None:
        return np.full(1, np.nan)
    return np.degrees(2 * np.arcsin(np.minimum(scatter.lengths(draws, generator), np.sqrt(2)) / 2))


def _quantile(angles: NDArray) -> float:
    return float(np.quantile(angles, 0.95))


def _kagan_distributions(
    sides: tuple[AxesSample, AxesSample], weights: list[NDArray], generator: np.random.Generator
) -> dict[str, NDArray]:
    """Kagan angles of the pairs KAGAN_PAIRS, of sources with three clear axes: share per bin, median, its interval."""
    full = [np.flatnonzero(np.isfinite(side.axes).all(axis=(1, 2))) for side in sides]
    model, record = (
        AxesSample(side.axes[own], side.location[own], side.labels[own]) for side, own in zip(sides, full, strict=True)
    )
    weights = [weight[:, own] for weight, own in zip(weights, full, strict=True)]
    once = sides[0].blocks is None
    modelled, recorded = _pairs(len(model.axes), len(record.axes), generator)
    one, other = _pairs(len(record.axes), len(record.axes), generator)
    one, other = one[one != other], other[one != other]
    beside = np.arange(len(model.axes) if len(record.axes) else 0)
    nearest = scipy.spatial.cKDTree(record.location).query(model.location[beside])[1] if len(beside) else beside
    # of each kind of pair: its angles, and the weight of each pair for weights of the events (model's, record's)
    angles = [
        (
            kagan_angle(model.axes[modelled], record.axes[recorded]),
            None if once else lambda m, r: m[modelled] * r[recorded],
        ),
        (kagan_angle(model.axes[beside], record.axes[nearest]), None if once else lambda m, r: m[beside]),
        (kagan_angle(record.axes[one], record.axes[other]), lambda m, r: r[one] * r[other]),
        (kagan_angle(random_frames(MAX_KAGAN_PAIRS, generator), np.eye(3)), None),
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
    """Indices of all pairs, or of MAX_KAGAN_PAIRS of them."""
    if first * second <= MAX_KAGAN_PAIRS:
        row, column = np.indices((first, second))
        return row.ravel(), column.ravel()
    return generator.integers(first, size=MAX_KAGAN_PAIRS), generator.integers(second, size=MAX_KAGAN_PAIRS)


def _median_interval(angle: NDArray, weigh, weights: list[NDArray]) -> NDArray:
    """Interval (2,) of the median when blocks get weights; NaN without a rule for them."""
    if weigh is None or len(angle) == 0:
        return np.full(2, np.nan)
    order = np.argsort(angle, kind="stable")
    medians = []
    for drawn in zip(*weights, strict=True):
        below = np.cumsum(weigh(*drawn)[order])
        if below[-1] > 0:
            medians.append(angle[order[np.searchsorted(below, below[-1] / 2)]])
    return np.quantile(medians, INTERVAL_95) if medians else np.full(2, np.nan)
