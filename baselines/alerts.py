"""Alarms: the share of events that lie in rock on alert, against the share of rock that is on alert (Molchan 1991).

A map ranks the places of a mine. Rock is put on alert from its most probable place on. A recorded event has its alert
share: the share of the rock, here of the area in plan of the box that the record is taken from, that is on alert when
the event's own place is. The hit rate of an alert share s is the share of events whose own is s at most. The area
under hit rates over s is the area skill score (Zechar and Jordan 2008). It is 1 less the mean alert share of the
events: 1/2 of a map that knows nothing, close to 1 of a perfect one.

Where people are, rock is counted by metres of the drives that stand open in the step: the share on alert is that of the
metres in cells on alert. Cells without drives cost no metres.

Places that are equally probable go on alert together. Of such a tie, any part may be on alert, so an event in it is hit
in proportion, and its alert share is that of the middle. So a map that is equal everywhere has exactly 1/2, wherever
the events lie.

Events trigger events, so clusters of the record are what is independent (baselines.map_scores).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from baselines.drives import DriveMetres
from baselines.map_scores import CEILING, MapScores, Variance, cluster_variance, run_variance
from baselines.month_maps import MonthMaps
from catalogs.compare.locations import UNIFORM_SHARE
from catalogs.sources.jackknife import INTERVAL_95, effective_blocks

ALERT_SHARES = (0.05, 0.1, 0.2)  # Shares of rock on alert that the page states hit rates of.
CELLS_PER_DEVIATION = 2.0  # Cells of a map within the standard deviation of its smoothing.
MIN_CELLS_ACROSS = 20.0  # Cells along the shorter side of the box, unless these are more than MAX_CELLS in all.
MAX_CELLS = 40_000
TIE = 1e-9  # Densities that differ by less, as a share of the uniform one, are equal.
SMOOTHED_DEVIATIONS = 8.0  # Beyond, a point adds nothing to a map.
BAND_DRAWS = 9_999


@dataclass(frozen=True)
class AlertCells:
    """Equal cells of the box in plan; box (2, xy), m; shape: number of cells along x and y."""

    box: NDArray
    shape: tuple[int, int]

    @classmethod
    def of(cls, box: NDArray, deviation: float) -> "AlertCells":
        """Cells that resolve maps with this standard deviation, m, and are at most MAX_CELLS in number."""
        sides = box[1] - box[0]
        resolved = min(deviation / CELLS_PER_DEVIATION, sides.min() / MIN_CELLS_ACROSS)
        edge = max(resolved, np.sqrt(np.prod(sides) / MAX_CELLS))
        along_x, along_y = (max(int(side / edge), 1) for side in sides)
        return cls(box, (along_x, along_y))

    @property
    def edges(self) -> NDArray:
        """Edges of a cell (xy,), m."""
        return (self.box[1] - self.box[0]) / self.shape

    def of_places(self, places: NDArray) -> NDArray:
        """Number of the cell (place,) that each place in plan (place, xy), m, lies in; the nearest one outside of the
        box."""
        index = np.floor((places - self.box[0]) / self.edges).astype(int)
        index = np.clip(index, 0, np.array(self.shape) - 1)
        return index[:, 0] * self.shape[1] + index[:, 1]

    def density(self, points: NDArray, deviation: float, uniform_share: float = UNIFORM_SHARE) -> NDArray:
        """Probability of an event in each cell (cell,) over that of a uniform rate: points (point, xy), m, smoothed by
        a normal distribution with the standard deviation, m, and the uniform share.

        Without points it is 1 everywhere. What smoothing carries out of the box is lost.
        """
        count = np.prod(self.shape)
        inside = points[((points >= self.box[0]) & (points <= self.box[1])).all(axis=1)]
        if not len(points):
            return np.ones(count)
        number = np.bincount(self.of_places(inside), minlength=count).reshape(self.shape).astype(float)
        smoothed = scipy.ndimage.gaussian_filter(
            number, deviation / self.edges, mode="constant", truncate=SMOOTHED_DEVIATIONS
        )
        return uniform_share + (1.0 - uniform_share) * count / len(points) * smoothed.ravel()


def alert_shares(density: NDArray, cell: NDArray, worth: NDArray | None = None) -> tuple[NDArray, NDArray]:
    """Shares of the rock that is more probable than an event's cell, and at least as probable, (event,) each.

    density (cell,) over the uniform one; cell (event,): the cell of each event; worth (cell,): what each cell counts, 1
    if not given. NaN where no cell counts anything.

    >>> alert_shares(np.array([1.0, 3.0, 1.0, 2.0]), np.array([1, 2]))
    (array([0. , 0.5]), array([0.25, 1.  ]))
    >>> alert_shares(np.array([1.0, 3.0, 1.0, 2.0]), np.array([1, 2]), np.array([0.0, 6.0, 2.0, 0.0]))
    (array([0.  , 0.75]), array([0.75, 1.  ]))
    """
    ranked = np.round(density / TIE)
    order = np.argsort(-ranked, kind="stable")
    above = np.append(0.0, np.cumsum(np.ones(len(order)) if worth is None else worth[order]))
    own, ordered = -ranked[cell], -ranked[order]
    more, as_many = (above[np.searchsorted(ordered, own, side=side)] for side in ("left", "right"))
    with np.errstate(invalid="ignore"):
        return more / above[-1], as_many / above[-1]


@dataclass(frozen=True)
class AlertScores:
    """Alert shares of recorded events under each map.

    labels: of the maps; more, as_many: of each map (run, event), as `alert_shares`, NaN where it has no forecast of the
    event's step; step and cluster of each event (event,).
    """

    labels: tuple[str, ...]
    more: tuple[NDArray, ...]
    as_many: tuple[NDArray, ...]
    step: NDArray
    cluster: NDArray

    @property
    def skill(self) -> MapScores:
        """Scores whose mean is the area skill score: 1 less the alert share of each event."""
        shares = zip(self.more, self.as_many, strict=True)
        skills = tuple(1.0 - 0.5 * (more + as_many) for more, as_many in shares)
        return MapScores(self.labels, skills, self.step, self.cluster)

    def hits(self, label: str, share: float) -> NDArray:
        """Share of each event (run, event) that is hit with a share of the rock on alert: 0 or 1, between in a tie."""
        row = self.labels.index(label)
        more, as_many = self.more[row], self.as_many[row]
        tie = as_many > more
        part = np.clip((share - more) / np.where(tie, as_many - more, 1.0), 0.0, 1.0)
        # a place that costs nothing is on alert with what is more probable
        return np.where(tie, part, np.where(np.isnan(more), np.nan, share >= more))

    def hit_rate(self, label: str, share: float, step: int | None = None) -> tuple[float, NDArray]:
        """Hit rate of an alert share and its 95 % interval (2,), of one step or of those that all maps forecast."""
        own = self.skill.common if step is None else self.step == step
        hits = self.hits(label, share)[:, own]
        if not hits.size or not np.isfinite(hits).all():
            return np.nan, np.full(2, np.nan)
        return float(hits.mean()), share_interval(hits, self.cluster[own])

    def curve(self, label: str, shares: NDArray) -> NDArray:
        """Hit rates (share,) of alert shares over the steps that all maps forecast."""
        own = self.skill.common
        return np.array([self.hits(label, share)[:, own].mean() for share in shares])

    def no_skill(self, shares: NDArray) -> tuple[NDArray, NDArray]:
        """95 % of the hit rates (share, 2), and of the area skill scores (2,), of maps that know nothing of the events
        that all maps forecast.

        Of independent events a hit rate is binomial. The events of a cluster are taken to lie at one place: they are
        hit together.
        """
        sizes = np.unique(self.cluster[self.skill.common], return_counts=True)[1]
        return no_skill_band(sizes, shares)


def no_skill_band(sizes: NDArray, shares: NDArray) -> tuple[NDArray, NDArray]:
    """Band of `AlertScores.no_skill` by simulation; sizes (cluster,): number of events of each cluster;
    shares (share,): alert shares, ascending."""
    if not len(sizes):
        return np.full((len(shares), 2), np.nan), np.full(2, np.nan)
    generator, weight = np.random.default_rng(0), sizes / sizes.sum()
    rates, skill = np.empty((BAND_DRAWS, len(shares))), np.empty(BAND_DRAWS)
    for draw in range(BAND_DRAWS):
        uniform = generator.random(len(sizes))
        hit_at = np.searchsorted(shares, uniform)  # the first alert share that hits the cluster
        rates[draw] = np.cumsum(np.bincount(hit_at, weight, minlength=len(shares) + 1))[:-1]
        skill[draw] = 1.0 - uniform @ weight
    return np.quantile(rates, INTERVAL_95, axis=0).T, np.quantile(skill, INTERVAL_95)


def share_interval(hits: NDArray, cluster: NDArray) -> NDArray:
    """95 % interval (2,) of a share of events, hits (run, event) in 0 to 1, whose clusters (event,) are independent.

    The limits of Clopper and Pearson for the number of independent events that would leave the share as uncertain as
    the clusters do, less for the degrees of freedom with which that is known (Korn and Graubard 1998). It is at most
    the effective number of clusters: of few that are missed, the scatter says too little. NaN with too few clusters.
    """
    mean, count = float(hits.mean()), hits.shape[1]
    worth = effective_blocks(np.unique(cluster, return_counts=True)[1])
    variance = cluster_variance(hits.mean(axis=0), cluster)
    if not np.isfinite(variance.value):
        return np.full(2, np.nan)
    # unlike a gain, a hit is bounded: how rare misses are, is in the limits already
    variance = Variance(variance.value, worth - 1.0) + run_variance(hits.mean(axis=1))
    binomial = mean * (1.0 - mean)
    if binomial > 0.0 and variance.value > 0.0:
        quantiles = scipy.stats.t.ppf(INTERVAL_95[1], [max(count - 1, 1), variance.freedom])
        worth = min(binomial / variance.value * float(quantiles[0] / quantiles[1]) ** 2, worth)
    hit, missed = mean * worth, (1.0 - mean) * worth
    lower = scipy.stats.beta.ppf(INTERVAL_95[0], hit, missed + 1.0) if hit > 0.0 else 0.0
    upper = scipy.stats.beta.ppf(INTERVAL_95[1], hit + 1.0, missed) if missed > 0.0 else 1.0
    return np.array([lower, upper])


def find_alerts(maps: MonthMaps) -> AlertScores:
    """Alert shares, of the rock, of the recorded events under each map that is a forecast.

    One map serves all events of a step, so it is smoothed by the median of their deviations.
    """
    return _find(maps, None)


def find_drive_alerts(maps: MonthMaps, drives: DriveMetres | None) -> AlertScores | None:
    """The same of the metres of drives that stand open; None without a drive in the box in any step with events.

    Events of steps without an open drive have none, NaN.
    """
    if drives is None:
        return None
    found = _find(maps, drives)
    return found if any(np.isfinite(more).any() for more in found.more) else None


def _find(maps: MonthMaps, drives: DriveMetres | None) -> AlertScores:
    labels = {label: runs for label, runs in maps.runs.items() if label != CEILING}
    more, as_many = ({label: np.full((runs, len(maps.step)), np.nan) for label, runs in labels.items()} for _ in "12")
    for step in np.unique(maps.step):
        own = maps.step == step
        cells, densities = step_densities(maps, int(step))
        cell = cells.of_places(maps.recorded.place[own])
        worth = None if drives is None else _metres(cells, drives, int(step))
        for label, runs in densities.items():
            for run, density in enumerate(runs):
                more[label][run, own], as_many[label][run, own] = alert_shares(density, cell, worth)
    return AlertScores(tuple(labels), tuple(more.values()), tuple(as_many.values()), maps.step, maps.cluster)


def _metres(cells: AlertCells, drives: DriveMetres, step: int) -> NDArray:
    """Metres of open drives in each cell of the box (cell,) in a step."""
    inside = ((drives.place >= cells.box[0]) & (drives.place <= cells.box[1])).all(axis=1)
    cell = np.where(inside, cells.of_places(drives.place), -1)
    return drives.in_cells(cell, int(np.prod(cells.shape)), step)


def step_densities(maps: MonthMaps, step: int) -> tuple[AlertCells, Mapping[str, NDArray]]:
    """Cells, and the density of each map that has a forecast of a step over the uniform one (run, cell), by label."""
    deviation = float(np.median(maps.deviation))
    cells, points = AlertCells.of(maps.box, deviation), maps.points(step)
    found = {label: np.array([cells.density(run, deviation) for run in runs]) for label, runs in points.items()}
    for label, (one, other, part) in maps.mixtures(step, points).items():
        found[label] = part * found[one] + (1.0 - part) * found[other]
    return cells, found
