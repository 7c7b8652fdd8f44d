"""Places of modelled and of recorded events relative to the face: FACE_FIELDS of catalogs.compare.layout.

A modelled event has no time within its step. So the events of both catalogues count from where the face stands at the
end of their step. Modelled ones are moved at random by the record's location error, and UNIFORM_SHARE of their weight
lies anywhere in the box of all events, as the record's own strays may: a model without either would seem more
concentrated than any record can show.
"""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.blocks import MIN_BLOCKS
from catalogs.compare.face import Face
from catalogs.compare.locations import UNIFORM_SHARE, box_around, location_errors
from catalogs.records.times import parse_time
from catalogs.settings import ComparisonSlice
from catalogs.sources.jackknife import INTERVAL_95

WEIGHTS = ("number", "potency")
MEASURES = ("median ahead", "share ahead", "median across", "half width")
MAX_DRAWS_PER_EVENT = 4  # Copies of a modelled event, each with a location error of its own.
UNIFORM_PLACES = 2000  # Places that stand for events anywhere in the box.


class _Sample:
    """Events of one catalogue relative to the face: coordinates (event, 2) m, weights (weight, event), blocks (event,)
    that are resampled; a block of -1 is always there once."""

    def __init__(self, coordinates: NDArray, weights: NDArray, block: NDArray):
        known = np.isfinite(coordinates).all(axis=1)
        self.coordinates, self.weights, self.block = coordinates[known], weights[:, known], block[known]
        self.order = np.argsort(self.coordinates, axis=0, kind="stable")

    @property
    def blocks(self) -> int:
        """Number of blocks that have an event."""
        return len(np.unique(self.block[self.block >= 0]))

    def measures(self, factor: NDArray | None = None) -> NDArray:
        """MEASURES of each weight (weight, measure); factor (event,): by what events count more."""
        return np.array([self._of(weight if factor is None else weight * factor) for weight in self.weights])

    def _of(self, weight: NDArray) -> list[float]:
        total = weight.sum()
        if not total > 0.0:
            return [np.nan] * len(MEASURES)
        ahead, across = (self._quantiles(axis, weight) for axis in (0, 1))
        return [
            ahead[1],
            float(weight[self.coordinates[:, 0] > 0.0].sum() / total),
            across[1],
            0.5 * (across[2] - across[0]),
        ]

    def _quantiles(self, axis: int, weight: NDArray) -> NDArray:
        """Weighted quantiles at 0.16, 0.5 and 0.84 (3,), m: the outer ones are two standard deviations of a normal
        distribution apart."""
        order = self.order[:, axis]
        share = np.cumsum(weight[order])
        place = np.searchsorted(share, np.array([0.16, 0.5, 0.84]) * share[-1])
        return self.coordinates[order, axis][np.minimum(place, len(order) - 1)]

    def intervals(self, resamplings: int, generator: np.random.Generator) -> NDArray:
        """95 % intervals (weight, measure, 2), blocks weighed at random (Rubin 1981); NaN of too few of them."""
        shape = (len(WEIGHTS), len(MEASURES), 2)
        if self.blocks < MIN_BLOCKS:
            return np.full(shape, np.nan)
        drawn = []
        for _ in range(resamplings):
            weight = generator.standard_exponential(int(self.block.max()) + 1)
            drawn.append(self.measures(np.append(weight / weight.mean(), 1.0)[self.block]))
        return np.moveaxis(np.quantile(drawn, INTERVAL_95, axis=0), 0, -1)


def face_measures(
    both: Sequence[xr.Dataset],
    used: Sequence[NDArray],
    blocks: Sequence[NDArray | None],
    steps: Sequence[NDArray],
    settings: ComparisonSlice,
) -> dict:
    """The variables; none without a face. Arguments as in `compare.place_and_axis_measures`, steps of all events."""
    if not settings.face:
        return {}
    generator = np.random.default_rng([settings.seed, 4])
    samples = [
        _model_sample(both, used, blocks[0], steps[0], settings, generator),
        _sample(both[1], used[1], blocks[1], steps[1], settings),
    ]
    found = np.array([sample.measures() for sample in samples])
    intervals = np.array([sample.intervals(settings.resamplings, generator) for sample in samples])
    names = ("model", "record")
    return {
        "face_measure": (("catalogue", "weight", "measure"), found),
        "face_measure_interval": (("catalogue", "weight", "measure", "interval"), intervals),
        "face_events": ("catalogue", np.array([_known(*one, settings) for one in zip(used, steps, strict=True)])),
        **{
            f"{name}_face": ((f"event_face_{name}", "face_axis"), sample.coordinates)
            for name, sample in zip(names, samples, strict=True)
        },
        **{
            f"{name}_face_weight": ((f"event_face_{name}", "weight"), _shares(sample.weights).T)
            for name, sample in zip(names, samples, strict=True)
        },
    }


def _shares(weights: NDArray) -> NDArray:
    """Weights over their sum."""
    total = weights.sum(axis=1, keepdims=True)
    return weights / np.where(total > 0.0, total, 1.0)


def _ends(settings: ComparisonSlice) -> NDArray:
    """End of each dated step (step,)."""
    return np.array([parse_time(step.end, "steps") for step in settings.steps]).astype("datetime64[ns]")


def _known(used: NDArray, step: NDArray, settings: ComparisonSlice) -> int:
    """Number of used events whose step ends while there is a face; used (event,) bool, step (event,) int, -1: none."""
    stands = np.isfinite(Face.of(settings.face).at(_ends(settings)).ahead).all(axis=1)
    return int(np.sum(used & (step >= 0) & stands[np.maximum(step, 0)]))


def _sample(
    events: xr.Dataset, used: NDArray, block: NDArray | None, step: NDArray, settings: ComparisonSlice
) -> _Sample:
    places, potency = events["location"].values[used], events["potency"].values[used]
    coordinates = Face.of(settings.face).at(_ends(settings)[step[used]]).coordinates(places)
    own = np.full(len(places), -1) if block is None else block[used]
    return _Sample(coordinates, np.stack([np.ones(len(places)), potency]), own)


def _model_sample(
    both: Sequence[xr.Dataset],
    used: Sequence[NDArray],
    run: NDArray | None,
    step: NDArray,
    settings: ComparisonSlice,
    generator: np.random.Generator,
) -> _Sample:
    """The model as a record with location errors and a uniform share would show it."""
    model, record = both
    index = np.flatnonzero(used[0])
    if not len(index):
        return _sample(model, used[0], run, step, settings)
    index = np.tile(index, MAX_DRAWS_PER_EVENT)
    places = model["location"].values[index][:, :2]
    recorded = record["location"].values[used[1]][:, :2]
    errors = location_errors(record)[used[1]] / np.sqrt(3.0)
    box = box_around(places, recorded, margin=0.0)
    if len(errors):
        places = places + generator.choice(errors, (len(places), 1)) * generator.normal(size=places.shape)
    anywhere = box[0] + (box[1] - box[0]) * generator.uniform(size=(UNIFORM_PLACES, 2))
    weights = np.stack([np.ones(len(index)), model["potency"].values[index]])
    part = weights.sum(axis=1, keepdims=True) * UNIFORM_SHARE / (1.0 - UNIFORM_SHARE) / UNIFORM_PLACES
    weights = np.concatenate([weights, np.broadcast_to(part, (len(WEIGHTS), UNIFORM_PLACES))], axis=1)
    time = _ends(settings)[np.concatenate([step[index], generator.choice(step[index], UNIFORM_PLACES)])]
    coordinates = Face.of(settings.face).at(time).coordinates(np.concatenate([places, anywhere]))
    own = np.full(len(index), -1) if run is None else run[index]
    return _Sample(coordinates, weights, np.concatenate([own, np.full(UNIFORM_PLACES, -1)]))
