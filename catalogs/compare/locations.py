"""Do two catalogues lie in the same places? Distances between them, with intervals from blocks of events.

Events come in clusters, so a catalogue of n events holds far fewer than n independent places; resampling single
events would find a difference between any two catalogues of one clustered process. Here whole blocks are resampled:
clusters of a record (`compare.blocks`), runs of a model. A model that ran once has no blocks. The offset and the test
then take its events to be as clustered as the record's, which they are if both are of one process; other distances have
no interval. Where events lie depends on
what is mined, in model and mine alike, so offset, energy distance and p-value are computed within steps
(`compare.energy_distance`): how far steps lie apart drops out. Everything is computed once between blocks and then
only re-weighted, so a thousand resamplings cost little. Distances in m. BLAS is held to one thread: the same bytes with
any number.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist
from scipy.special import logsumexp
from threadpoolctl import threadpool_limits

from catalogs.compare.blocks import MIN_BLOCKS
from catalogs.compare.energy_distance import Side, block_starts, match_steps, pair_means, pairs_by_block
from catalogs.sources.jackknife import INTERVAL_95
from common.event_table import LOCATION_UNCERTAINTY


def location_errors(record: xr.Dataset) -> NDArray:
    """Root mean square location error (event,), m; 0 where nothing is known."""
    general = float(record.attrs.get("location_error", 0.0))
    name = LOCATION_UNCERTAINTY.name
    stated = record[name].values if name in record else np.full(record.sizes["event"], np.nan)
    return np.where(np.isfinite(stated), stated, general if np.isfinite(general) else 0.0)


MIN_TEST_DRAWS = 999  # Draws of the test, whose smallest p-value must lie far below its level.
LENGTH_DRAWS = 9999  # Draws for the quantile of a length.
# Exponent of distance in the statistic of the p-value. It finds shifts as well as the mean does, and other shapes, too.
TEST_EXPONENT = 1.5


def smear(
    location: NDArray, errors: float | NDArray, draws: int, generator: np.random.Generator
) -> tuple[NDArray, NDArray]:
    """Locations (event * draws, 3) as a network of such location errors would report them, and each one's event.

    errors: root mean square distance in 3-D, m, so errors / sqrt(3) in each coordinate: one, or those of recorded
    events (recorded,), of which each copy has one at random. Several draws per event lower the noise that this adds
    to the comparison. No error: the locations themselves.
    """
    location, errors = np.asarray(location, float), np.atleast_1d(np.asarray(errors, float))
    if not (errors > 0).any():
        return location, np.arange(len(location))
    event = np.repeat(np.arange(len(location)), draws)
    scale = generator.choice(errors, size=(len(event), 1)) if len(errors) > 1 else errors
    return location[event] + generator.normal(size=(len(event), 3)) * scale / np.sqrt(3), event


def _no_interval() -> NDArray:
    """An interval that is not known, (2,) NaN; it broadcasts to the shape of any interval."""
    return np.full(2, np.nan)


@dataclass(frozen=True)
class LocationComparison:
    """The numbers of `compare_locations`; an interval is (..., 2), the lower and upper bound of 95 %.

    blocks: of the model (0 where it ran once), of the record. Unless the model's are MIN_BLOCKS, intervals are NaN but
    those of the offset. shift_noticed: m, of the centroid, that the test notices (`sources.significance`).
    """

    centroids: NDArray
    offset: NDArray
    offset_distance: float
    energy_distance: float
    distance: NDArray
    cross_k: NDArray
    model_k: NDArray
    record_k: NDArray
    cross_ratio: NDArray
    nearest: NDArray
    blocks: tuple[int, int]
    steps: int
    offset_interval: NDArray = field(default_factory=_no_interval)
    offset_distance_interval: NDArray = field(default_factory=_no_interval)
    energy_interval: NDArray = field(default_factory=_no_interval)
    energy_null: NDArray = field(default_factory=_no_interval)
    energy_p_value: float = np.nan
    shift_noticed: float = np.nan
    cross_k_interval: NDArray = field(default_factory=_no_interval)
    cross_ratio_interval: NDArray = field(default_factory=_no_interval)
    nearest_interval: NDArray = field(default_factory=_no_interval)


def compare_locations(
    model: NDArray,
    record: NDArray,
    model_blocks: NDArray | None,
    record_blocks: NDArray,
    seed: int = 0,
    location_error: float | NDArray = 0.0,
    draws: int = 4,
    resamplings: int = 999,
    distances: NDArray | None = None,
    model_steps: NDArray | None = None,
    record_steps: NDArray | None = None,
) -> LocationComparison | None:
    """Model (event, 3) against record (event, 3), m, with block and step of each event (without steps: all of one).

    model_blocks: None for a model that ran once: its events count as independent where pairs of one block are left out,
    and intervals are NaN but those of the offset. location_error: as in `smear`. None if no step has two blocks in each
    catalogue, or the record fewer than MIN_BLOCKS in all. A model with as few blocks counts as one that ran once.
    Offset, energy distance and p-value: of such steps, moved onto each other (`energy_distance.Matched`). The others:
    of all events, where they lie. Intervals of the offset: jackknife over blocks (`sources.jackknife`); the others
    weigh blocks at random (Bayesian bootstrap, Rubin 1981), with one weight in all steps.
    Cross-K: share of model-record pairs closer than r, times the volume of the box that holds both catalogues.
    """
    generator = np.random.default_rng(seed)
    smeared, event = smear(model, location_error, draws, generator)
    steps = [
        np.zeros(len(points), int) if given is None else np.asarray(given)
        for points, given in ((model, model_steps), (record, record_steps))
    ]
    labels = np.arange(len(model)) if model_blocks is None else np.asarray(model_blocks)
    sides = (
        Side(smeared, labels[event], steps[0][event], len(smeared) // max(len(model), 1)),
        Side(record, record_blocks, steps[1]),
    )
    matched = match_steps(sides)
    if matched is None or matched.units[1] < MIN_BLOCKS:
        return None
    tested = model_blocks is not None and matched.units[0] >= MIN_BLOCKS
    points = np.concatenate([side.points for side in sides])
    distances = default_distances(points) if distances is None else np.asarray(distances, float)
    weights = [
        generator.standard_exponential((resamplings, int(side.block_unit.max()) + 1))[:, side.block_unit]
        for side in sides
    ]
    once = [np.ones((1, side.blocks)) for side in sides]
    signs = matched.random_signs(max(resamplings, MIN_TEST_DRAWS), not tested, generator)

    with threadpool_limits(1, user_api="blas"):
        energy = matched.energy([np.ones((1, count)) for count in matched.blocks])[0]
        counts = [side.counts for side in sides]
        found_shares, found_resampled = [], []
        for distance in distances:  # one after the other: the pairs of all at once would take many times the memory
            closer = _pairs_closer(sides, distance)
            found_shares.append([share[0] for share in pair_means(closer, counts, once)])
            if tested:
                found_resampled.append(pair_means(closer, counts, weights))
        del closer
        shares = np.array(found_shares).T
        model_centre, record_centre = matched.centroids([np.ones((1, count)) for count in matched.blocks])
        centroids = np.concatenate([side.centroids(one) for side, one in zip(sides, once, strict=True)])
        nearest, nearest_interval = _nearest(sides, weights)
        offset = model_centre[0] - record_centre[0]
        volume = float(np.prod(np.maximum(np.ptp(points, axis=0), 1.0)))
        found = LocationComparison(
            centroids=centroids,
            offset=offset,
            offset_distance=float(np.linalg.norm(offset)),
            energy_distance=float(energy),
            distance=distances,
            cross_k=shares[0] * volume,
            model_k=shares[1] * volume,
            record_k=shares[2] * volume,
            cross_ratio=_ratio(*shares),
            nearest=nearest,
            blocks=(0 if model_blocks is None else matched.units[0], matched.units[1]),
            steps=matched.steps,
        )
        null = matched.wild_bootstrap(1.0, signs)[1]
        statistic, chance = matched.wild_bootstrap(TEST_EXPONENT, signs)
        scatter = matched.offset_scatter(not tested)
        # Few blocks do not know their own scatter: as Student's t is wider than a normal distribution.
        chance = chance * scatter.freedom / generator.chisquare(scatter.freedom, len(chance))
        energies = resampled = None
        if tested:
            energies = matched.energy([weight[:, own] for weight, own in zip(weights, matched.own, strict=True)])
            resampled = np.array(found_resampled).transpose(1, 0, 2)
    # How far the offset may be off is at least by how much its length is.
    lengths = scatter.lengths(max(resamplings, LENGTH_DRAWS), generator)
    reach = float(np.quantile(lengths, 0.95))
    found = replace(
        found,
        offset_interval=scatter.interval(offset),
        offset_distance_interval=np.array([max(0.0, found.offset_distance - reach), found.offset_distance + reach]),
        energy_null=_interval(null - null.mean()),
        energy_p_value=float((1 + np.sum(chance >= statistic)) / (len(signs) + 1)),
        shift_noticed=scatter.noticed(lengths),
    )
    if energies is None or resampled is None:
        return found
    return replace(
        found,
        energy_interval=_interval(energies),
        cross_k_interval=_interval(resampled[0]) * volume,
        cross_ratio_interval=_interval(_ratio(*resampled)),
        nearest_interval=nearest_interval,
    )


def default_distances(points: NDArray, count: int = 12) -> NDArray:
    """Distances for the cross-K function, m: from a fiftieth to half of the diagonal of the box around all points."""
    diagonal = max(float(np.linalg.norm(np.ptp(points, axis=0))), 1.0)
    return np.geomspace(diagonal / 50, diagonal / 2, count)


def _pairs_closer(sides: tuple[Side, Side], distance: float) -> NDArray:
    """Number of pairs of points closer than `distance` (m), by the blocks of the two points (block, block)."""
    starts = block_starts(sides)
    closer = np.zeros((len(starts), len(starts)))
    for block, pairs in pairs_by_block(sides):
        closer[block] += np.add.reduceat(np.count_nonzero(pairs < distance, axis=0), starts)
    return closer


def _ratio(cross: NDArray, model: NDArray, record: NDArray) -> NDArray:
    """cross / sqrt(model record); NaN where either catalogue has no pair so close."""
    within = np.sqrt(np.maximum(model * record, 0.0))  # round-off of weights may leave less than none
    return np.divide(cross, within, out=np.full_like(within, np.nan), where=within > 0)


def _nearest(sides: tuple[Side, Side], weights: list[NDArray]) -> tuple[NDArray, NDArray]:
    """Median distance, m, model to nearest record, record to nearest model, record to nearest other record.

    The interval (3, 2) resamples the blocks that distances are measured from, not those they are measured to.
    """
    points = [side.points[side.singles] for side in sides]
    trees = [cKDTree(part) for part in points]
    medians, intervals = [], []
    for origin, target in ((0, 1), (1, 0), (1, 1)):
        neighbours = 2 if origin == target else 1
        reach = trees[target].query(points[origin], k=[neighbours])[0][:, 0]
        order = np.argsort(reach, kind="stable")
        labels = sides[origin].labels[sides[origin].singles][order]
        medians.append(float(np.median(reach)))
        below = np.cumsum(weights[origin][:, labels], axis=1)
        middle = np.argmax(below >= below[:, -1:] / 2, axis=1)
        intervals.append(np.quantile(reach[order][middle], INTERVAL_95))
    return np.array(medians), np.array(intervals)


def _interval(resampled: NDArray) -> NDArray:
    """95 % interval (..., 2) over the last dimension; NaN where nothing could be resampled."""
    with np.errstate(invalid="ignore"):
        finite = np.isfinite(resampled).any(axis=-1, keepdims=True)
        safe = np.where(finite, resampled, 0.0)
        return np.where(finite, np.moveaxis(np.nanquantile(safe, INTERVAL_95, axis=-1), 0, -1), np.nan)


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
