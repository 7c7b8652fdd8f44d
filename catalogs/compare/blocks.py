"""Blocks of recorded events that belong together: the clusters of a record, found from the record itself.

Events trigger events, so the places, axes and numbers of a record scatter as its clusters do, not as its events. An
event may follow from an earlier one that is close to it in time and place. How close is close is measured against
chance. What a step mines sets how often clusters begin in it, and where, and that is no chance: within each step they
begin at one rate. S is the number of clusters that begin between two events at these rates, and u the share of those
of the later event's step that lie within the distance. The product k = S u (the nearest-neighbour distance of Zaliapin
and Ben-Zion 2013, with shares in place of a fractal dimension) is below k by chance for 1 - exp(-k (1 + ln(C / k))) of
the events, with C clusters in all: the number of points of a Poisson process under a hyperbola. An event is linked to
the earlier one of least k, of equal k to the closest, if that chance is below a level. Where times are rounded, S is
that of the longest time that the rounding allows; otherwise events of one hour, or of one day, would seem simultaneous.

A low level splits clusters, whose late events lie among other events; a high one joins separate clusters. Split blocks
hide variance, and joined blocks only make it less well known. So the level is that at which the mean location has the
largest jackknife variance, of those that leave MIN_BLOCKS. A record with no more links at the lowest level than chance
makes has no clusters: each of its events is a block. If the lowest level leaves fewer than MIN_BLOCKS, its blocks are
the clusters.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from catalogs.sources.jackknife import effective_blocks

LINK_CHANCES = (0.1, 0.2, 0.3, 0.4)  # Chances of a link between events that are independent.
PASSES_PER_LEVEL = 2  # Passes at each chance: clusters decide how many there are, and so what chance makes.
MIN_EXCESS_ERRORS = 2.0  # Standard errors by which links must exceed those that chance makes.
MAX_EARLIER_EVENTS = 1000  # Earlier events that an event is compared with: the latest.
MAX_REFERENCE_EVENTS = 1000  # Events that a share of places is counted among.
MIN_BLOCKS = 3  # Blocks that an interval needs.
ROUNDING_UNITS = (86400.0, 3600.0, 600.0, 60.0, 1.0)  # s, to which times may be rounded
MIN_SHARE_ROUNDED = 0.2  # A time is rounded to a unit if this share of the others differs from it by whole units.
MIN_TIME_APART = 1e-3  # s, to which other times are known
MIN_SPAN = 1e-9  # days; events of one time have no rate
# m; smaller distances count as this, or two events of one place would be nearer than chance allows
MIN_DISTANCE_APART = 1e-3


@dataclass(frozen=True)
class Periods:
    """Periods of time in which clusters begin at one rate: the steps, in the order of events.

    number (event,) of the period of each event; first (period + 1,): index of its first event; edge (period + 1,): day
    on which it begins.
    """

    number: NDArray
    first: NDArray
    edge: NDArray

    @classmethod
    def of(cls, days: NDArray, step: NDArray) -> "Periods":
        """Periods of events, days (event,) ascending. They change halfway between the events of two steps."""
        change = np.flatnonzero(np.diff(step)) + 1
        number = np.searchsorted(change, np.arange(len(days)), side="right")
        edge = np.concatenate([days[:1], 0.5 * (days[change - 1] + days[change]), days[-1:]])
        return cls(number, np.concatenate([[0], change, [len(days)]]), edge)

    def reference(self, event: int) -> NDArray:
        """Events of the period of an event, at most MAX_REFERENCE_EVENTS: where clusters begin in it."""
        first, end = self.first[self.number[event] :][:2]
        return np.linspace(first, end - 1, min(end - first, MAX_REFERENCE_EVENTS)).astype(int)

    def starts(self, days: NDArray, weight: NDArray) -> tuple[NDArray, NDArray]:
        """Clusters that begin in a day (event,), and that have begun before each event (event,), at the rate of each
        period; weight (event,): share of a cluster that an event is."""
        rate = np.add.reduceat(weight, self.first[:-1]) / np.maximum(np.diff(self.edge), MIN_SPAN)
        begun = np.concatenate([[0.0], np.cumsum(rate * np.diff(self.edge))])
        return rate[self.number], begun[self.number] + rate[self.number] * (days - self.edge[self.number])


def cluster_labels(time: NDArray, location: NDArray, step: NDArray, error: float = 0.0) -> NDArray:
    """Cluster (event,) of each event, numbered 0, 1, ...; see the head of this module.

    time (event,) datetime64; location (event, 3) m; step (event,) numbers: rate and mean are those within each. error:
    root mean square location error, m, within which distances tell nothing. Events without a time are one cluster.
    Which events are of one cluster does not depend on their order.
    """
    time, location = np.asarray(time, "datetime64[ns]"), np.asarray(location, float)
    labels = np.zeros(len(time), np.int64)
    dated = np.flatnonzero(~np.isnat(time))
    dated = dated[np.lexsort((*location[dated].T, time[dated]))]  # by time, of one time by place
    if len(dated) > 1:
        days = (time[dated] - time[dated[0]]) / np.timedelta64(86400, "s")
        error = max(error, MIN_DISTANCE_APART)
        labels[dated] = 1 + _widest(days, rounded_to(time[dated]), location[dated], np.asarray(step)[dated], error)
    return np.unique(labels, return_inverse=True)[1].reshape(-1)


def rounded_to(time: NDArray) -> NDArray:
    """Units (event,), days, to which times (event,) datetime64 are rounded.

    The unit of a time is the largest of ROUNDING_UNITS within which it falls on the same instant (of the day, of the
    hour, ...) as MIN_SHARE_ROUNDED of the other times; else MIN_TIME_APART.

    Any instant counts, not only the whole unit: a local midnight is none in UTC, and two with daylight saving.
    """
    time = np.asarray(time, "datetime64[ns]").astype(np.int64)
    same = _repeats(time)  # events of one time are no sign that times are rounded
    found = np.full(len(time), MIN_TIME_APART)
    for unit in reversed(ROUNDING_UNITS):
        agreeing = _repeats(time % int(unit * 1e9)) - same
        found[(agreeing > 0) & (agreeing >= MIN_SHARE_ROUNDED * (len(time) - same))] = unit
    return found / 86400.0


def _repeats(values: NDArray) -> NDArray:
    """Number of occurrences (event,) of each value (event,) among all values."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    return counts[inverse.reshape(-1)]


def _widest(days: NDArray, open_by: NDArray, location: NDArray, step: NDArray, error: float) -> NDArray:
    """Labels of the level with the largest variance of the mean location, of those that leave enough blocks; those of
    the lowest level if none does."""
    labels, chosen, largest = np.arange(len(days)), np.arange(len(days)), -1.0
    periods = Periods.of(days, step)
    around = [_around(location, event, periods.reference(event), error) for event in range(1, len(days))]
    for level in LINK_CHANCES:
        for _ in range(PASSES_PER_LEVEL):
            labels = _linked(days, open_by, around, periods, labels, level)
        links, count = len(days) - len(np.unique(labels)), len(days)
        if level == LINK_CHANCES[0] and links <= level * count + MIN_EXCESS_ERRORS * np.sqrt(
            level * (1 - level) * count
        ):
            break
        if effective_blocks(np.bincount(labels)) < MIN_BLOCKS:
            return labels if level == LINK_CHANCES[0] else chosen
        variance = _mean_variance(location, labels, step)
        if variance > largest:
            chosen, largest = labels, variance
    return chosen


def _around(location: NDArray, event: int, among: NDArray, error: float) -> tuple[NDArray, NDArray, NDArray]:
    """Earlier events by distance from this one; the events `among` by distance, as indices of it; and the last of these
    that lies within the distance of each earlier one, at least the first. Numbers are short: they are kept for all
    events at once."""
    first = max(0, event - MAX_EARLIER_EVENTS)
    distance = cdist(location[event : event + 1], location[first:event])[0]
    nearby = np.argsort(distance, kind="stable")
    others = np.maximum(cdist(location[event : event + 1], location[among])[0], error)
    order = np.argsort(others, kind="stable")
    last = np.searchsorted(others[order], np.maximum(distance[nearby], error), side="right") - 1
    return nearby.astype(np.int16), order.astype(np.int16), np.maximum(last, 0).astype(np.int16)


def _linked(
    days: NDArray, open_by: NDArray, around: list[tuple], periods: Periods, labels: NDArray, level: float
) -> NDArray:
    """New labels (event,) from links at a level; `labels` says how many clusters there are, and where.

    days (event,) ascending; open_by (event,) days that they are rounded to; around: as in `_around`, of all events but
    the first.
    """
    count = len(days)
    weight = 1.0 / np.bincount(labels)[labels]  # a cluster counts once
    clusters = weight.sum()
    rate, begun = periods.starts(days, weight)
    root = np.arange(count)
    for event, (nearby, order, last) in enumerate(around, 1):
        earlier = max(0, event - MAX_EARLIER_EVENTS) + nearby.astype(np.int64)
        within = np.cumsum(weight[periods.reference(event)][order])
        starts = begun[event] - begun[earlier] + rate[event] * np.maximum(open_by[event], open_by[earlier])
        product = starts * (within[last] / within[-1])
        nearest = int(np.argmin(product))  # of the same product the closest
        least = product[nearest]
        chance = 1.0 - np.exp(-least * (1.0 + max(np.log(clusters / least), 0.0)))
        if chance < level:
            root[event] = root[earlier[nearest]]
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
