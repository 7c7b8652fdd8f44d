"""The models compared with the record: the pipeline's own and both baselines, all in the same way.

How well a model places the recorded events is its information gain over a uniform rate, with intervals by clusters.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.blocks import MIN_BLOCKS
from catalogs.compare.comparison import compare, record_clusters
from catalogs.compare.exposure import Exposure, common_period
from catalogs.compare.locations import box_around, information_gain, location_errors
from catalogs.settings import ComparisonSlice
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.sizes import log_potency

BOX_MARGIN = 3.0  # Standard deviations of a location between all events and the faces of the box.
POTENCY, NUMBER = "potency", "number"


@dataclass(frozen=True)
class Counted:
    """Events that are compared, of one catalogue or of all runs of a model.

    place (event, 3) m; step (event,) as an index; potency (event,) m3; runs: number of catalogues that they are from.
    """

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
            counts = (events["resolved"].values == 1) & (index >= 0) & (size >= cut)
            place.append(events["location"].values[counts])
            step.append(index[counts])
            potency.append(events["potency"].values[counts])
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
        """95 % interval of the mean (model, 2); NaN with fewer than MIN_BLOCKS clusters."""
        return self._quantiles(self._resampled(self.gain, step), step)

    def lead(self, best: int, other: int) -> tuple[float, NDArray]:
        """Mean gain of a model less that of another over all events, nats per event, with its 95 % interval (2,)."""
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


@dataclass(frozen=True)
class Model:
    """A model: name in sentences, label of its column, events of its first run and of all, comparison with the record.

    inputs: which of NUMBER and POTENCY it takes from the record; has_axes: whether its events have mechanisms.
    """

    name: str
    label: str
    first: Counted
    counted: Counted
    comparison: xr.Dataset
    inputs: tuple[str, ...] = ()
    has_axes: bool = True


@dataclass(frozen=True)
class ModelComparison:
    """The record, its events that count, the models, and how well each places the recorded events."""

    record: xr.Dataset
    recorded: Counted
    models: tuple[Model, ...]
    scores: MapScores
    steps: tuple[str, ...]

    @property
    def is_twin(self) -> bool:
        """True if the record was made by the pipeline itself."""
        return self.record.attrs["kind"] == "twin"


def compare_with_record(
    own: Sequence[xr.Dataset],
    comparison: xr.Dataset,
    flaws: Sequence[xr.Dataset],
    excess_shear: Sequence[xr.Dataset],
    record: xr.Dataset,
    cell: float,
    settings: ComparisonSlice,
) -> ModelComparison:
    """Compare all runs of each model with the record.


    own, flaws, excess_shear: catalogues, the first of which stands for the model; comparison: that of the mine's own;
    cell: edge of the finest cells, m; settings: as the mine's own comparison has them.
    """
    exposure = Exposure.of(settings.steps, common_period(record))
    cut = float(comparison["cut"])
    comparisons = [comparison]
    for runs in (flaws, excess_shear):
        with_runs = settings.model_copy(update={"members": len(runs) - 1})
        comparisons.append(compare(runs[0], record, with_runs, runs[1:]))
    counted = [Counted.of(runs, exposure, cut) for runs in (own, flaws, excess_shear)]
    first = [Counted.of(runs[:1], exposure, cut) for runs in (own, flaws, excess_shear)]
    used = comparison["record_used"].values == 1
    scores = score_places(counted, record, used, exposure, cell, settings.resamplings, settings.seed)
    of_own, of_flaws, of_stress = zip(first, counted, comparisons, strict=True)
    models = (
        Model("the pipeline's own model", "Pipeline", *of_own),
        Model("seeded flaws", "Seeded flaws", *of_flaws, inputs=(NUMBER,)),
        Model("excess shear stress", "Excess shear stress", *of_stress, inputs=(NUMBER, POTENCY), has_axes=False),
    )
    recorded = Counted(
        record["location"].values[used],
        exposure.step(record["time"].values[used]),
        record["potency"].values[used],
    )
    return ModelComparison(record, recorded, models, scores, tuple(step.name for step in settings.steps))


def lead_verdict(interval: NDArray) -> str:
    """Words that say whether a difference with this 95 % interval (2,) may be chance.

    >>> lead_verdict(np.array([0.1, 0.4])), lead_verdict(np.array([-0.1, 0.4]))
    ('more than chance explains', 'no more than chance explains')
    """
    return "more than chance explains" if interval[0] > 0.0 or interval[1] < 0.0 else "no more than chance explains"
