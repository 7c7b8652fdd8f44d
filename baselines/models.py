"""The models beside the record: the pipeline's own and both baselines, all compared in the same way."""

from collections.abc import Sequence
from dataclasses import dataclass

import xarray as xr

from baselines.scores import Counted, MapScores, score_places
from catalogs.comparison import compare
from catalogs.comparison_settings import ComparisonSlice
from catalogs.exposure import Exposure, common_period

POTENCY, NUMBER = "potency", "number"


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
class BesideRecord:
    """The record, its events that count, the models, and how well each places the recorded events."""

    record: xr.Dataset
    recorded: Counted
    models: tuple[Model, ...]
    scores: MapScores
    steps: tuple[str, ...]

    @property
    def is_twin(self) -> bool:
        """Whether the record was made by the pipeline itself."""
        return self.record.attrs["kind"] == "twin"


def beside_record(
    own: Sequence[xr.Dataset],
    comparison: xr.Dataset,
    flaws: Sequence[xr.Dataset],
    excess_shear: Sequence[xr.Dataset],
    record: xr.Dataset,
    cell: float,
    settings: ComparisonSlice,
) -> BesideRecord:
    """All runs of each model beside the record.

    own, flaws, excess_shear: catalogues, the first of which stands for the model; comparison: that of the mine's own;
    cell: edge of the finest cells, m; settings: as the mine's own comparison has them.
    """
    exposure = Exposure.of(settings.steps, common_period(record))
    cut = float(comparison["cut"])
    made = [comparison]
    for runs in (flaws, excess_shear):
        with_runs = settings.model_copy(update={"members": len(runs) - 1})
        made.append(compare(runs[0], record, with_runs, runs[1:]))
    counted = [Counted.of(runs, exposure, cut) for runs in (own, flaws, excess_shear)]
    first = [Counted.of(runs[:1], exposure, cut) for runs in (own, flaws, excess_shear)]
    used = comparison["record_used"].values == 1
    scores = score_places(counted, record, used, exposure, cell, settings.resamplings, settings.seed)
    models = (
        Model("the pipeline's own model", "Pipeline", first[0], counted[0], made[0]),
        Model("seeded flaws", "Seeded flaws", first[1], counted[1], made[1], (NUMBER,)),
        Model("excess shear stress", "Excess shear stress", first[2], counted[2], made[2], (NUMBER, POTENCY), False),
    )
    recorded = Counted(
        record["location"].values[used],
        exposure.step(record["time"].values[used]),
        record["potency"].values[used],
    )
    return BesideRecord(record, recorded, models, scores, tuple(step.name for step in settings.steps))
