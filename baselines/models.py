"""The models compared with the record: the pipeline's own and both baselines, all in the same way.

How well a model places the recorded events is its information gain over a uniform rate (baselines.map_scores).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from baselines.catalogues import LEFT_OUT
from baselines.map_scores import MapScores, coarser_clusters
from catalogs.compare.comparison import compare, record_clusters
from catalogs.compare.exposure import Exposure, common_period
from catalogs.compare.locations import UNIFORM_SHARE, box_around, information_gain, location_errors
from catalogs.settings import ComparisonSlice
from catalogs.sources.sizes import log_potency

BOX_MARGIN = 3.0  # Standard deviations of a location between all events and the faces of the box.
POTENCY, NUMBER, SIZES = "potency", "number", "sizes"  # Inputs of a model that are not scored; sizes: their b.
NAMES = {
    "Pipeline": "the pipeline's own model",
    "Seeded flaws": "seeded flaws",
    "Excess shear stress": "excess shear stress",
}
INPUTS = {"Pipeline": (), "Seeded flaws": (NUMBER, SIZES), "Excess shear stress": (NUMBER, POTENCY, SIZES)}


@dataclass(frozen=True)
class Counted:
    """Events that are compared, of one catalogue or of all runs of a model.

    place (event, 3) m; step (event,) as an index; potency (event,) m3; run (event,): number of the catalogue that it is
    from, below `runs`.
    """

    place: NDArray
    step: NDArray
    potency: NDArray
    run: NDArray
    runs: int = 1

    @classmethod
    def of(cls, runs: Sequence[xr.Dataset], exposure: Exposure, cut: float) -> "Counted":
        """Resolved events from the cut on, log10 m3, in the time compared."""
        place, step, potency, numbers = [], [], [], []
        for events in runs:
            index = exposure.step(events["time"].values)
            size = log_potency(events["potency"].values)
            counts = (events["resolved"].values == 1) & (index >= 0) & (size >= cut)
            place.append(events["location"].values[counts])
            step.append(index[counts])
            potency.append(events["potency"].values[counts])
            numbers.append(int(counts.sum()))
        run = np.repeat(np.arange(len(runs)), numbers)
        return cls(np.concatenate(place), np.concatenate(step), np.concatenate(potency), run, len(runs))

    def by_step(self, steps: int) -> tuple[NDArray, NDArray]:
        """Number and potency (m3) of each step (step,), means of the runs."""
        number = np.bincount(self.step, minlength=steps)
        return number / self.runs, np.bincount(self.step, self.potency, minlength=steps) / self.runs


def run_gains(
    model: Counted,
    place: NDArray,
    step: NDArray,
    deviation: NDArray,
    box: NDArray,
    uniform_share: float = UNIFORM_SHARE,
) -> NDArray:
    """Information gain of each run of a model at recorded places (run, event), nats; 0 where it has none in the step.

    place (event, 3) or, in plan, (event, 2), m; step (event,); deviation (event,): of the place along each axis, m;
    box: its lower and upper corner, m; uniform_share: of the density that is uniform in the box.
    """
    gain = np.zeros((model.runs, len(place)))
    for number in np.unique(step):
        own, of_step = step == number, model.step == number
        for run in range(model.runs):
            events = model.place[of_step & (model.run == run)][:, : place.shape[1]]
            gain[run, own] = information_gain(place[own], events, deviation[own], box, uniform_share)
    return gain


def score_places(
    models: Mapping[str, Counted], record: xr.Dataset, used: NDArray, exposure: Exposure, cell: float
) -> MapScores:
    """Information gain of each run of the models, by label, at the recorded events of the same step.

    used (event,) bool: recorded events that count. The events of a run are smoothed by the location error of a recorded
    event and by the edge of a cell, m, within which no model locates one. The box holds all events.
    """
    step = exposure.step(record["time"].values)
    place = record["location"].values[used]
    error = np.hypot(location_errors(record)[used], cell) / np.sqrt(3.0)
    box = box_around(place, *(model.place for model in models.values()), margin=BOX_MARGIN * float(error.max()))
    known = (record["resolved"].values == 1) & (step >= 0)
    clusters = coarser_clusters(record_clusters(record, known, step)[used], record["time"].values[used])
    gains = tuple(run_gains(model, place, step[used], error, box) for model in models.values())
    return MapScores(tuple(models), gains, step[used], clusters)


@dataclass(frozen=True)
class Model:
    """A model: name in sentences, label of its column, events of its first run and of all, comparison with the record.

    inputs: which of NUMBER, POTENCY and SIZES it is given, by the record or the mine file; has_axes: whether its events
    have mechanisms.
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
    """The record, its events that count, the models, and how well each places the recorded events.

    left_out: reasons of baselines that could not be made, by name.
    """

    record: xr.Dataset
    recorded: Counted
    models: tuple[Model, ...]
    scores: MapScores
    steps: tuple[str, ...]
    left_out: Mapping[str, str] = field(default_factory=dict)

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
    catalogues = {"Pipeline": list(own), "Seeded flaws": list(flaws), "Excess shear stress": list(excess_shear)}
    made = {label: runs for label, runs in catalogues.items() if LEFT_OUT not in runs[0].attrs}
    comparisons = {"Pipeline": comparison}
    for label in list(made)[1:]:
        runs = made[label]
        with_runs = settings.model_copy(update={"members": len(runs) - 1})
        comparisons[label] = compare(runs[0], record, with_runs, runs[1:])
    counted = {label: Counted.of(runs, exposure, cut) for label, runs in made.items()}
    used = comparison["record_used"].values == 1
    scores = score_places(counted, record, used, exposure, cell)
    models = tuple(
        Model(
            NAMES[label],
            label,
            Counted.of(runs[:1], exposure, cut),
            counted[label],
            comparisons[label],
            inputs=INPUTS[label],
            has_axes=label != "Excess shear stress",
        )
        for label, runs in made.items()
    )
    left_out = {NAMES[label]: runs[0].attrs[LEFT_OUT] for label, runs in catalogues.items() if label not in made}
    recorded = Counted(
        record["location"].values[used],
        exposure.step(record["time"].values[used]),
        record["potency"].values[used],
        np.zeros(int(used.sum()), int),
    )
    return ModelComparison(record, recorded, models, scores, tuple(step.name for step in settings.steps), left_out)
