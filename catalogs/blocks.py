"""Blocks of events that belong together (days, steps, clusters): what is resampled, as events are not independent."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pipeline.errors import InputError

BLOCK_KINDS = ("day", "step", "cluster", "event")


def block_labels(
    kind: str,
    time: NDArray,
    location: NDArray,
    step: NDArray | None = None,
    days: float = 1.0,
    radius: float = 20.0,
) -> NDArray:
    """Block number (event,) of each event, 0, 1, ... in order of appearance in time.

    kind: day: windows of `days` days, counted from midnight of the first event's day; step: the mining step's name;
    cluster: events of one window linked by gaps of at most `radius` m (single linkage); event: each its own, right only
    for independent events. Events without a time form one window. Raises InputError for an unknown kind.
    """
    if kind not in BLOCK_KINDS:
        raise InputError(f"comparison.blocks: {kind!r} is not one of {', '.join(BLOCK_KINDS)}")
    count = len(location)
    if kind == "event" or count == 0:
        return np.arange(count)
    if kind == "step":
        return np.unique(np.asarray(step, str), return_inverse=True)[1]
    time = np.asarray(time, "datetime64[ns]")
    known = ~np.isnat(time)
    window = np.full(count, -1, np.int64)
    if known.any():
        first = time[known].min().astype("datetime64[D]").astype("datetime64[ns]")
        elapsed = (time[known] - first).astype(np.int64)
        window[known] = elapsed // round(days * 86400e9)
    if kind == "day":
        return np.unique(window, return_inverse=True)[1]
    labels, used = np.empty(count, np.int64), 0
    for value in np.unique(window):
        inside = np.flatnonzero(window == value)
        labels[inside] = used + _linked(np.asarray(location, float)[inside], radius)
        used = labels[inside].max() + 1
    return labels


def _linked(location: NDArray, radius: float) -> NDArray:
    """Number of the group, linked by gaps up to `radius`, of each point."""
    pairs = cKDTree(location).query_pairs(radius, output_type="ndarray")
    size = len(location)
    graph = coo_matrix((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(size, size))
    return connected_components(graph, directed=False)[1]
