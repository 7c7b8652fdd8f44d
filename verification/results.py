"""Results of the stages for a study's variants, as an answer reads them."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from common.costs import Costs, cost_of
from common.datasets import read_dataset
from common.event_table import check_events
from mpm_core.scene.scene import Scene, parse_scene
from verification.studies import Study
from workflow.mine import Mine


@dataclass
class Variant:
    """One run of the scene.

    read: gives a dataset by its path below the variant's folder ("steps/load_1.nc"). costs: gives what a stage
    ("elastic", "steps/load_1", "events", "ensemble/1/events") took; None where it left no log. kept: datasets that
    were read.
    """

    mine: Mine
    read: Callable[[str], xr.Dataset]
    costs: Callable[[str], Costs | None] = lambda stage: None
    kept: dict[str, xr.Dataset] = field(default_factory=dict)

    @cached_property
    def values(self) -> dict:
        """The whole configuration as plain values in SI units."""
        return self.mine.settings.given()

    @property
    def step_names(self) -> list[str]:
        """Names of the listed steps, in order."""
        return self.mine.mined_steps

    def scene(self, step: str | None = None) -> Scene:
        """The scene up to a step, as the stage of that step has it; up to the first step without a name."""
        return parse_scene(self.mine.mechanics_slice(self.mine.step_index(step) if step else 0))

    def _dataset(self, path: str) -> xr.Dataset:
        if path not in self.kept:
            self.kept[path] = self.read(path)
        return self.kept[path]

    @property
    def grid(self) -> xr.Dataset:
        """grid.nc: the cells that the first step starts from. A step's own cells are in its file."""
        return self._dataset("grid.nc")

    @property
    def elastic(self) -> xr.Dataset:
        """elastic.nc"""
        return self._dataset("elastic.nc")

    def step(self, name: str) -> xr.Dataset:
        """steps/<name>.nc"""
        return self._dataset(f"steps/{name}.nc")

    @property
    def last(self) -> xr.Dataset:
        """The state after the last step; the elastic one where no step is listed."""
        return self.step(self.step_names[-1]) if self.step_names else self.elastic

    @property
    def stages(self) -> list[str]:
        """Names of the stages that make its grid and its states, in order."""
        return ["grid", "elastic", *(f"steps/{name}" for name in self.step_names)]

    def events(self, name: str) -> xr.Dataset:
        """events/<name>.nc"""
        return check_events(self._dataset(f"events/{name}.nc"), f"events/{name}.nc")

    def seconds(self, stage: str) -> float | None:
        """Wall time of a stage ("grid", "elastic", "steps/<name>")."""
        costs = self.costs(stage)
        return costs.seconds if costs else None

    def processor_time(self, stage: str) -> float | None:
        """Processor time of a stage without compiling, s."""
        costs = self.costs(stage)
        return costs.running if costs else None

    def processor_times(self, stages: Sequence[str]) -> NDArray:
        """Processor time of these stages (stage,) s without compiling; NaN where a stage left no log."""
        return np.array([np.nan if (time := self.processor_time(stage)) is None else time for stage in stages])

    def peak_memory(self, stage: str) -> float | None:
        """Largest resident memory of a stage, MiB."""
        costs = self.costs(stage)
        return costs.memory if costs else None


@dataclass
class Results:
    """All variants of a study, with its bounds and settings. threads: how many its answer may use."""

    study: Study
    variants: dict[str, Variant]
    threads: int = 1

    @property
    def allowed(self) -> dict[str, float]:
        """Bounds of the study, by short name."""
        return self.study.allowed

    @property
    def settings(self) -> dict:
        """Settings of the study, which its answer reads."""
        return self.study.settings

    def present(self, names: Iterable[str]) -> list[str]:
        """Those of these variants that were run. A reduced study leaves some out."""
        return [name for name in names if name in self.variants]

    def __getitem__(self, variant: str) -> Variant:
        return self.variants[variant]


def read_results(study: Study, folder: Path, logs: Path) -> Results:
    """Results in <folder>/<variant>/, and the costs of their stages by the logs in <logs>/<variant>/."""

    def variant(name: str, mine: Mine) -> Variant:
        return Variant(
            mine, lambda path: read_dataset(folder / name / path), lambda stage: cost_of(logs / name / f"{stage}.log")
        )

    return Results(study, {name: variant(name, mine) for name, mine in study.mines.items()})
