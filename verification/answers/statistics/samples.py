"""Simulated catalogues whose statistics are known."""

import numpy as np
from numpy.typing import NDArray

LN10 = np.log(10.0)


def simulated_sizes(
    generator: np.random.Generator, count: int, b: float, span: float = np.inf, bin_width: float = 0.0
) -> NDArray:
    """log10 sizes (count,) above 0 with slope b that end at `span`. Binned sizes are the lower edges of their bins."""
    x = -np.log1p(-generator.random(count) * -np.expm1(-b * LN10 * span)) / (b * LN10)
    return np.floor(x / bin_width) * bin_width if bin_width else x


def clustered_locations(
    generator: np.random.Generator, clusters: int, sizes: list[int], apart: float = 30.0, spread: float = 10.0
) -> tuple[NDArray, NDArray]:
    """Locations (event, 3) m and cluster (event,) of a new draw of one process.

    Centres are normal with standard deviation `apart` in each coordinate, events around them with `spread`; a cluster
    holds a Poisson number of events, at least one, whose mean is one of `sizes` at random.
    """
    counts = np.maximum(1, generator.poisson(generator.choice(sizes, clusters)))
    labels = np.repeat(np.arange(clusters), counts)
    centre = apart * generator.normal(size=(clusters, 3))
    return centre[labels] + spread * generator.normal(size=(len(labels), 3)), labels


def branching_events(
    generator: np.random.Generator,
    days: float,
    expected: float,
    branching: float,
    spread: float = 30.0,
    kernel: float = 8.0,
    longest: float = 40.0,
) -> tuple[NDArray, NDArray, NDArray]:
    """Times (event,) in days, locations (event, 3) m and cluster (event,) of events that trigger events (ETAS).

    `expected` events in `days`, the process running since twice `longest`. Each triggers a Poisson number, `branching`
    on average, after delays of density 1 / (t + 0.01 day)^1.1 (Omori, Utsu) up to `longest`, normal about its place
    with `kernel` in each coordinate; others come at any time, about 0 with `spread`.
    """
    before = 2.0 * longest
    count = generator.poisson(expected * (1.0 - branching) * (days + before) / days)
    time, place = generator.uniform(-before, days, count), spread * generator.normal(size=(count, 3))
    cluster = np.arange(count)
    found = [(time, place, cluster)]
    first, last = 0.01**-0.1, (longest + 0.01) ** -0.1
    while len(time):
        parent = np.repeat(np.arange(len(time)), generator.poisson(branching, len(time)))
        delay = (first + generator.random(len(parent)) * (last - first)) ** -10.0 - 0.01
        time, cluster = time[parent] + delay, cluster[parent]
        place = place[parent] + kernel * generator.normal(size=(len(parent), 3))
        kept = time < days
        time, place, cluster = time[kept], place[kept], cluster[kept]
        found.append((time, place, cluster))
    time, place, cluster = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.argsort(time, kind="stable")
    order = order[time[order] >= 0]
    return time[order], place[order], cluster[order]


def burst_events(
    generator: np.random.Generator, days: float, bursts: float, each: float, spread: float = 30.0, kernel: float = 8.0
) -> tuple[NDArray, NDArray, NDArray]:
    """Times (event,) in days, locations (event, 3) m and cluster (event,) of events that come in bursts.

    `bursts` on average (Poisson) in `days`, each of `each` events on average (Poisson), with delays of an hour on
    average. Bursts lie about 0 with standard deviation `spread`, m, their events about them with `kernel`, m.
    """
    count = generator.poisson(bursts)
    cluster = np.repeat(np.arange(count), generator.poisson(each, count))
    time = generator.uniform(0.0, days, count)[cluster] + generator.exponential(1.0 / 24.0, len(cluster))
    place = spread * generator.normal(size=(count, 3))[cluster] + kernel * generator.normal(size=(len(cluster), 3))
    order = np.argsort(time, kind="stable")
    order = order[time[order] < days]
    return time[order], place[order], cluster[order]


def dated(days: NDArray) -> NDArray:
    """Times of days since the beginning of 2020."""
    return np.datetime64("2020-01-01", "ns") + np.round(np.asarray(days) * 86400e9).astype("timedelta64[ns]")
