"""How probable recorded places are where a catalogue has its events: those smoothed, and a share anywhere in a box."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import cdist
from scipy.special import logsumexp

UNIFORM_SHARE = 0.05  # Of events that may lie anywhere: without it one recorded event far from all others decides.
MAX_PAIRS = 2_000_000  # Distances held at once.


def box_around(*places: NDArray, margin: float) -> NDArray:
    """Lower and upper corner (2, xyz), m, of a box that holds all places (event, xyz) with a margin, m."""
    every = np.concatenate(places)
    return np.stack([every.min(axis=0) - margin, every.max(axis=0) + margin])


def information_gain(
    places: NDArray, events: NDArray, deviation: ArrayLike, box: NDArray, uniform_share: float = UNIFORM_SHARE
) -> NDArray:
    """ln of the density of events at places over that of uniform events in the box, (place,), nats.

    places, events (n, xyz), m, or (n, xy) in plan; deviation: standard deviation along each axis, m, of one place from
    the event that it belongs to, for all places or (place,); box: lower and upper corner. The events are smoothed by a
    normal distribution, and uniform_share of the density is uniform in the box. Without events the gain is 0.

    >>> box = np.array([[0.0, 0.0, 0.0], [10.0, 10.0, 10.0]])
    >>> there, away = information_gain(np.array([[5.0, 5, 5], [9, 9, 9]]), np.array([[5.0, 5, 5]]), 1.0, box)
    >>> round(float(there), 2), round(float(away), 2)  # ln(0.05 + 0.95 * 1000 / (2 pi)^1.5) and ln(0.05)
    (4.1, -3.0)
    """
    if not len(events):
        return np.zeros(len(places))
    deviation = np.broadcast_to(np.asarray(deviation, float), len(places))
    log_volume = np.log(np.prod(box[1] - box[0]))
    log_peak = log_volume - places.shape[1] * (0.5 * np.log(2.0 * np.pi) + np.log(deviation))
    smoothed = np.empty(len(places))
    size = max(1, MAX_PAIRS // len(events))
    for start in range(0, len(places), size):
        part = slice(start, start + size)
        squared = cdist(places[part], events, "sqeuclidean") / (2.0 * deviation[part, None] ** 2)
        smoothed[part] = logsumexp(-squared, axis=1) - np.log(len(events))
    return np.logaddexp(np.log(uniform_share), np.log1p(-uniform_share) + log_peak + smoothed)
