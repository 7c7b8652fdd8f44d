"""How well each model places the recorded events: information gain over a uniform rate, with intervals by clusters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.blocks import MIN_BLOCKS
from catalogs.comparison import record_clusters
from catalogs.event_density import box_around, information_gain
from catalogs.exposure import Exposure
from catalogs.jackknife import INTERVAL_95
from catalogs.location_errors import location_errors
from catalogs.sizes import log_potency

BOX_MARGIN = 3.0  # Standard deviations of a location between all events and the faces of the box.


@dataclass(frozen=True)
class Counted:
    """The events of a catalogue, or of all runs of a model, that are compared: place (event, 3) m, step (event,) as an
    index, potency (event,) m3. runs: how many catalogues they are of."""

    place: NDArray
    step: NDArray
    potency: NDArray
    runs: int = 1

    @classmethod
    def of(cls, runs: Sequence[xr.Dataset], exposure: Exposure, cut: float) -> "Counted":
        """Resolved events from the cut on, log10 m3, in the time compared."""
        place, step, potency = [], [], []
        for events in runs:
            index = exposure.step(events["time"].values)
            size = log_potency(events["potency"].values)
            kept = (events["resolved"].values == 1) & (index >= 0) & (size >= cut)
            place.append(events["location"].values[kept])
            step.append(index[kept])
            potency.append(events["potency"].values[kept])
        return cls(np.concatenate(place), np.concatenate(step), np.concatenate(potency), len(runs))

    def by_step(self, steps: int) -> tuple[NDArray, NDArray]:
        """Number and potency (m3) of each step (step,), means of the runs."""
        number = np.bincount(self.step, minlength=steps)
        return number / self.runs, np.bincount(self.step, self.potency, minlength=steps) / self.runs


@dataclass(frozen=True)
class MapScores:
    """Information gain of models at recorded events (model, event), nats, with step and cluster of each event (event,)
    and weights of clusters (resampling, cluster) for intervals."""

    gain: NDArray
    step: NDArray
    cluster: NDArray
    weights: NDArray

    def mean(self, step: int | None = None) -> NDArray:
        """Mean of each model (model,), nats per recorded event, of one step or of all; NaN without an event."""
        own = self._own(step)
        return self.gain[:, own].mean(axis=1) if own.any() else np.full(len(self.gain), np.nan)

    def interval(self, step: int | None = None) -> NDArray:
        """Its 95 % interval (model, 2); NaN with fewer than MIN_BLOCKS clusters."""
        return self._quantiles(self._resampled(self.gain, step), step)

    def lead(self, best: int, other: int) -> tuple[float, NDArray]:
        """By how much a model gains more than another over all events, nats per event, with its 95 % interval (2,)."""
        difference = self.gain[[best]] - self.gain[[other]]
        return float(difference.mean()), self._quantiles(self._resampled(difference, None), None)[0]

    @property
    def clusters(self) -> int:
        """Clusters of all recorded events."""
        return len(np.unique(self.cluster))

    def _own(self, step: int | None) -> NDArray:
        return np.ones(len(self.step), bool) if step is None else self.step == step

    def _resampled(self, values: NDArray, step: int | None) -> NDArray:
        """Means (row, resampling) of values (row, event) with weighted clusters."""
        own = self._own(step)
        weights = self.weights[:, self.cluster[own]]
        return values[:, own] @ weights.T / np.maximum(weights.sum(axis=1), np.finfo(float).tiny)

    def _quantiles(self, resampled: NDArray, step: int | None) -> NDArray:
        if len(np.unique(self.cluster[self._own(step)])) < MIN_BLOCKS:
            return np.full((len(resampled), 2), np.nan)
        return np.quantile(resampled, INTERVAL_95, axis=1).T


def score_places(
    models: Sequence[Counted],
    record: xr.Dataset,
    used: NDArray,
    exposure: Exposure,
    cell: float,
    resamplings: int,
    seed: int,
) -> MapScores:
    """Information gain of each model's events of a step at the recorded ones of that step.

    used (event,) bool: recorded events that count. The events of all runs of a model are smoothed by the location error
    of a recorded event and by the edge of a cell, m, within which no model locates one. The box holds all events.
    Clusters of the record are weighed at random (Bayesian bootstrap, Rubin 1981).
    """
    step = exposure.step(record["time"].values)
    place = record["location"].values[used]
    error = np.hypot(location_errors(record)[used], cell) / np.sqrt(3.0)
    box = box_around(place, *(model.place for model in models), margin=BOX_MARGIN * float(error.max()))
    clusters = np.unique(record_clusters(record, used, step)[used], return_inverse=True)[1].reshape(-1)
    step = step[used]
    gain = np.zeros((len(models), len(place)))
    for row, model in enumerate(models):
        for number in np.unique(step):
            own = step == number
            gain[row, own] = information_gain(place[own], model.place[model.step == number], error[own], box)
    generator = np.random.default_rng([seed, 3])
    weights = generator.standard_exponential((resamplings, int(clusters.max()) + 1))
    return MapScores(gain, step, clusters, weights)
