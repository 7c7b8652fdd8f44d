"""Energy distance of two catalogues within steps, its resamplings and its test.

Where events lie depends on what a step mines, in model and mine alike. Steps that lie further apart than the events of
one would swamp any shift between the catalogues, so each step is moved to the mean of the two centroids that it has in
the catalogues (a shift between these stays), and given one weight in both: n m / (n + m) of its n modelled and m
recorded events. If the catalogues are of one process within each step, so are these two mixtures of all steps.
Distances in m.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from catalogs.sources.jackknife import Scatter

MAX_PAIRS_HELD = 1 << 22  # Pairs of events held in memory at once.


@dataclass
class Side:
    """One catalogue: its points (point, 3) m ordered by step and block, `draws` of them per event.

    labels (point,): what each point belongs to, a cluster of a record or a run of the model: its unit. What a unit has
    in a step is a block. block_step, block_unit (block,): step and unit of each, units numbered 0, 1, ...
    """

    points: NDArray
    labels: NDArray
    steps: NDArray
    draws: int = 1
    blocks: int = field(init=False)

    def __post_init__(self):
        pairs = np.stack([np.asarray(self.steps, np.int64), np.asarray(self.labels, np.int64)], axis=1)
        found, labels = np.unique(pairs, axis=0, return_inverse=True)
        labels, self.block_step = labels.reshape(-1), found[:, 0]
        self.block_unit = np.unique(found[:, 1], return_inverse=True)[1].reshape(-1)
        order = np.argsort(labels, kind="stable")
        self.points, self.labels = np.asarray(self.points, float)[order], labels[order]
        self.blocks = int(self.labels[-1]) + 1 if len(labels) else 0
        self.starts = np.searchsorted(self.labels, np.arange(self.blocks))
        self.counts = np.bincount(self.labels, minlength=self.blocks).astype(float)
        # the same shape as the others: each event once, for distances to the nearest
        self.singles = np.arange(0, len(order), self.draws)

    def centroids(self, weights: NDArray) -> NDArray:
        """Centroid (resampling, 3) of the blocks, repeated weights (resampling, block) times."""
        sums = np.add.reduceat(self.points, self.starts, axis=0)
        return weights @ sums / (weights @ self.counts)[:, None]


def block_starts(sides: tuple[Side, Side]) -> NDArray:
    """Index (block,) of the first point of each block, in the points of the first catalogue, then the second."""
    return np.concatenate([sides[0].starts, sides[1].starts + len(sides[0].points)])


def pairs_by_block(sides: tuple[Side, Side]) -> Iterator[tuple[int, NDArray]]:
    """Number of each block and the distances (some of its points, all points) m, a bounded number of pairs at once."""
    points, starts = np.concatenate([side.points for side in sides]), block_starts(sides)
    rows = max(1, MAX_PAIRS_HELD // len(points))
    for block, (first, last) in enumerate(zip(starts, np.append(starts[1:], len(points)), strict=True)):
        for begin in range(first, last, rows):
            yield block, cdist(points[begin : min(begin + rows, last)], points)


def pair_means(sums: NDArray, counts: list[NDArray], weights: list[NDArray]) -> tuple[NDArray, NDArray, NDArray]:
    """Means over model-record, model-model and record-record pairs (resampling,) of what `sums` adds up.

    counts: points of each block of the model, of the record. Pairs within one block, or within copies of it, are left
    out of the last two; NaN where no others are.
    """
    split = len(counts[0])
    inner = []
    for count, weight, part in zip(counts, weights, (sums[:split, :split], sums[split:, split:]), strict=True):
        own = weight**2 @ np.diag(part)
        total = np.sum((weight @ part) * weight, axis=1) - own
        pairs = (weight @ count) ** 2 - weight**2 @ count**2
        inner.append(np.divide(total, pairs, out=np.full_like(total, np.nan), where=pairs > 0))
    cross = np.sum((weights[0] @ sums[:split, split:]) * weights[1], axis=1)
    return cross / ((weights[0] @ counts[0]) * (weights[1] @ counts[1])), inner[0], inner[1]


class Matched:
    """The steps that have two blocks at least in each catalogue, moved onto each other; see the head of this module.

    own: numbers of these blocks within each catalogue; unit: the unit of each, numbered 0, 1, ...; units: how many;
    steps: how many steps.
    """

    def __init__(self, sides: tuple[Side, Side], shared: NDArray):
        self.steps = len(shared)
        self.own = [np.flatnonzero(np.isin(side.block_step, shared)) for side in sides]
        self.blocks = [len(own) for own in self.own]
        self.step = [np.searchsorted(shared, side.block_step[own]) for side, own in zip(sides, self.own, strict=True)]
        self.unit = [
            np.unique(side.block_unit[own], return_inverse=True)[1].reshape(-1)
            for side, own in zip(sides, self.own, strict=True)
        ]
        self.units = [int(unit.max()) + 1 for unit in self.unit]
        self.counts = [side.counts[own] for side, own in zip(sides, self.own, strict=True)]
        totals = [np.bincount(step, count) for step, count in zip(self.step, self.counts, strict=True)]
        events = [total / side.draws for total, side in zip(totals, sides, strict=True)]
        self.step_weight = events[0] * events[1] / (events[0] + events[1])
        # Of events that are as clustered: variance of the model's mean over that of the record's.
        variance = [float(np.sum(self.step_weight**2 / number)) for number in events]
        self.variance_ratio = variance[0] / variance[1]
        chosen = []
        for side, own in zip(sides, self.own, strict=True):
            kept = np.isin(side.labels, own)
            chosen.append((side.points[kept], np.searchsorted(shared, side.block_step[side.labels[kept]])))
        centre = np.zeros((len(shared), 3))
        for (points, step), total in zip(chosen, totals, strict=True):
            centre += np.stack([np.bincount(step, column) for column in points.T], axis=1) / total[:, None] / 2
        model, record = (
            Side(points - centre[step], side.labels[np.isin(side.labels, own)], step, side.draws)
            for (points, step), side, own in zip(chosen, sides, self.own, strict=True)
        )
        self.sides = model, record
        starts, size = block_starts(self.sides), sum(self.blocks)
        self._sums = {exponent: np.zeros((size, size)) for exponent in (1.0, 1.5)}
        for block, pairs in pairs_by_block(self.sides):
            self._sums[1.0][block] += np.add.reduceat(pairs.sum(axis=0), starts)
            self._sums[1.5][block] += np.add.reduceat((pairs * np.sqrt(pairs)).sum(axis=0), starts)

    def _weighted(self, weights: list[NDArray]) -> list[NDArray]:
        """The weights (resampling, block) with the sum over a step's points that the step has."""
        found = []
        for weight, count, step in zip(weights, self.counts, self.step, strict=True):
            member = step[:, None] == np.arange(self.steps)
            found.append(weight * (self.step_weight / ((weight * count) @ member))[:, step])
        return found

    def centroids(self, weights: list[NDArray]) -> list[NDArray]:
        """Centroid (resampling, 3), m, of model and record within steps, of the blocks, each counted so many times."""
        return [side.centroids(weight) for side, weight in zip(self.sides, self._weighted(weights), strict=True)]

    def offset_scatter(self, ran_once: bool) -> Scatter:
        """Scatter of the offset of the centroids, m: the jackknife over the units of both catalogues.

        ran_once: the model has no units; its events are taken to be as clustered as the record's.
        """
        both = [np.ones((1, count)) for count in self.blocks]
        estimate = [part[0] for part in self.centroids(both)]
        found = []
        for side in (1,) if ran_once else (0, 1):
            without = 1.0 - (self.unit[side] == np.arange(self.units[side])[:, None])
            moved = self.centroids([without if side == 0 else both[0], without if side == 1 else both[1]])[side]
            found.append(Scatter.of(moved, estimate[side], self._freedom(side)))
        return found[0].times(1.0 + self.variance_ratio) if ran_once else found[0] + found[1]

    def _freedom(self, side: int) -> float:
        """Degrees of freedom of a catalogue's centroid: the effective number of units, less one for each step's mean.

        Units that all steps have, such as the model's runs, lose one degree only.
        """
        step, weight = self.step[side], self.step_weight / self.step_weight.sum()
        share = weight[step] * self.counts[side] / np.bincount(step, self.counts[side])[step]
        of_unit = np.bincount(self.unit[side], share)
        together = np.sum(share**2) / np.sum(of_unit**2)
        return max(1.0 / np.sum(of_unit**2) - max(together / np.sum(weight**2), 1.0), 1.0)

    def energy(self, weights: list[NDArray]) -> NDArray:
        """Energy distance 2 E|X - Y| - E|X - X'| - E|Y - Y'| (resampling,), m (Szekely and Rizzo 2013).

        0 for one distribution: pairs within a block are left out of the last two, so that blocks however clustered give
        no bias.
        """
        cross, model, record = pair_means(self._sums[1.0], self.counts, self._weighted(weights))
        return 2 * cross - model - record

    def random_signs(self, resamplings: int, ran_once: bool, generator: np.random.Generator) -> NDArray:
        """Random factors (resampling, block of both) for `wild_bootstrap`: one sign for all blocks of a unit.

        ran_once: the model has no units. Its events are taken to be as clustered as the record's, so that a second sign
        of each unit of the record, times the ratio of the standard errors, stands for the model's.
        """
        model, record = (
            generator.choice([-1.0, 1.0], size=(resamplings, self.units[1 if ran_once else side]))[:, self.unit[own]]
            for side, own in ((0, 1 if ran_once else 0), (1, 1))
        )
        if not ran_once:
            return np.concatenate([model, record], axis=1)
        none = np.zeros((resamplings, self.blocks[0]))
        return np.concatenate([none, record + np.sqrt(self.variance_ratio) * model], axis=1)

    def wild_bootstrap(self, exponent: float, signs: NDArray) -> tuple[float, NDArray]:
        """Energy distance of a power of distance (1 or 1.5), and what it is (resampling,) if both are of one process.

        A dependent wild bootstrap (Leucht and Neumann 2013; Chwialkowski et al. 2014): the block sums are centred on
        the mean of the block's own catalogue in its step, so that a true difference drops out, and each unit takes a
        random sign, signs (resampling, block of both), `random_signs`. Unlike a permutation this also holds where one
        catalogue's blocks are larger than the other's. A large block draws that mean to itself: it is divided by one
        minus its share of the events, which puts it against the mean of the others (as in the CR3 estimate of a
        clustered variance).
        """
        sums, counts = self._sums[exponent], np.concatenate(self.counts)
        group = np.concatenate([self.step[0], self.step[1] + self.steps])  # step and catalogue
        member = (group == np.arange(2 * self.steps)[:, None]).astype(float)
        totals = member @ counts
        to_group = sums @ member.T / totals  # (block, group): sum over the block of the mean distance to a group
        between = member @ to_group / totals[:, None]
        mean_to = to_group[:, group]
        centred = sums - mean_to * counts - counts[:, None] * mean_to.T
        centred += np.outer(counts, counts) * between[np.ix_(group, group)]
        weight = np.concatenate([self.step_weight, -self.step_weight]) / self.step_weight.sum()
        share = (weight / totals)[group]
        scaled = signs * (share / (1 - counts / totals[group]))
        return float(-(share @ sums @ share)), -np.sum((scaled @ centred) * scaled, axis=1)


def match_steps(sides: tuple[Side, Side]) -> Matched | None:
    """The steps with two blocks at least in each catalogue; None without any."""
    steps = [np.unique(side.block_step, return_counts=True) for side in sides]
    model, record = (found[count > 1] for found, count in steps)
    shared = np.intersect1d(model, record)
    return Matched(sides, shared) if len(shared) else None
