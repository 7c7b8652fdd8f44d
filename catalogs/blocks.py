"""Blocks of recorded events that belong together: the clusters of a record, found from the record itself.

Events trigger events, so the places, axes and numbers of a record scatter as its clusters do, not as its events. An
event may follow from an earlier one that is close to it in time and place. How close is close is measured against
chance: C clusters that begin at any time of a span T put C t / T starts before an event within a time t, and of these
the share u that lies within the distance. The product k = C t u / T (the nearest-neighbour distance of Zaliapin and
Ben-Zion 2013, with shares in place of a fractal dimension) is below k by chance for 1 - exp(-k (1 + ln(C / k))) of the
events: the number of points of a Poisson process under a hyperbola. An event is linked to the earlier one of least k
if that chance is below a level.

A low level splits clusters, whose late events come among the others; a high one joins what is apart. Blocks that are
split hide variance, blocks that are joined only make it less well known. So the level is that at which the mean
location has the largest jackknife variance. A record with no more links at the lowest level than chance makes has no
clusters: its events are blocks.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from catalogs.jackknife import effective_blocks

LEVELS = (0.1, 0.2, 0.3, 0.4)  # chances of a link between events that have nothing to do with each other
PASSES = 2  # at each level: what is one cluster decides how many there are, and so what is chance
CHANCE_ERRORS = 2.0  # standard errors of the number of links that chance makes
MOST_EARLIER = 1000  # events that an event is compared with: the latest
MOST_AMONG = 1000  # events that a share of places is counted among
LEAST_BLOCKS = 3  # that an interval is taken from
ONE_PLACE = 1e-3  # m: distances below are one, or two events of one place would be nearer than chance allows


def cluster_labels(time: NDArray, location: NDArray, step: NDArray, error: float = 0.0) -> NDArray:
    """Cluster (event,) of each event, numbered 0, 1, ...; see the head of this module.

    time (event,) datetime64; location (event, 3) m; step (event,) numbers: the mean is taken within each. error: root
    mean square location error, m, within which distances tell nothing. Events without a time are one cluster.
    """
    time, location = np.asarray(time, "datetime64[ns]"), np.asarray(location, float)
    labels = np.zeros(len(time), np.int64)
    dated = np.flatnonzero(~np.isnat(time))
    dated = dated[np.argsort(time[dated], kind="stable")]
    if len(dated) > 1:
        days = (time[dated] - time[dated[0]]) / np.timedelta64(86400, "s")
        labels[dated] = 1 + _widest(days, location[dated], np.asarray(step)[dated], max(error, ONE_PLACE))
    return np.unique(labels, return_inverse=True)[1].reshape(-1)


def _widest(days: NDArray, location: NDArray, step: NDArray, error: float) -> NDArray:
    """Labels of the level at which the mean location is least well known, of those that leave enough blocks."""
    labels, chosen, largest = np.arange(len(days)), np.arange(len(days)), -1.0
    for level in LEVELS:
        for _ in range(PASSES):
            labels = _linked(days, location, labels, level, error)
        links, count = len(days) - len(np.unique(labels)), len(days)
        if level == LEVELS[0] and links <= level * count + CHANCE_ERRORS * np.sqrt(level * (1 - level) * count):
            break
        if effective_blocks(np.bincount(labels)) < LEAST_BLOCKS:
            break
        variance = _mean_variance(location, labels, step)
        if variance > largest:
            chosen, largest = labels, variance
    return chosen


def _linked(days: NDArray, location: NDArray, labels: NDArray, level: float, error: float) -> NDArray:
    """New labels (event,) from links at a level; `labels` says how many clusters there are, and where.

    days (event,) ascending; location (event, 3) m.
    """
    count = len(days)
    weight = 1.0 / np.bincount(labels)[labels]  # a cluster counts once
    clusters, span = weight.sum(), max(days[-1], 1e-9)
    among = np.linspace(0, count - 1, min(count, MOST_AMONG)).astype(int)
    total = weight[among].sum()
    root = np.arange(count)
    for event in range(1, count):
        first = max(0, event - MOST_EARLIER)
        reach = np.maximum(cdist(location[event : event + 1], location[first:event])[0], error)
        others = np.maximum(cdist(location[event : event + 1], location[among])[0], error)
        order = np.argsort(others, kind="stable")
        within = np.cumsum(weight[among][order])[np.searchsorted(others[order], reach, side="right") - 1]
        product = clusters * (days[event] - days[first:event]) / span * (within / total)
        nearest = int(np.argmin(product))
        least = product[nearest]
        chance = 1.0 - np.exp(-least * (1.0 + max(np.log(clusters / least), 0.0))) if least > 0 else 0.0
        if chance < level:
            root[event] = root[first + nearest]
    return np.unique(root, return_inverse=True)[1].reshape(-1)


def _mean_variance(location: NDArray, labels: NDArray, step: NDArray) -> float:
    """Jackknife variance, m2, of the mean of locations less the mean of their step, all three coordinates together."""
    steps = np.unique(step, return_inverse=True)[1].reshape(-1)
    sizes = np.bincount(steps)
    centre = np.stack([np.bincount(steps, column) for column in location.T], axis=1) / sizes[:, None]
    off = location - centre[steps]
    counts = np.bincount(labels)
    sums = np.stack([np.bincount(labels, column) for column in off.T], axis=1)
    return float(np.sum((sums / (len(location) - counts)[:, None]) ** 2))
