"""What the stages made of a study's variants, as an answer reads it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
import xarray as xr

from mpm_core.scene import Scene, parse_scene
from pipeline.datasets import read_dataset
from pipeline.event_table import check_events
from verification.studies import Study
from workflow.mine import Mine


@dataclass
class Variant:
    """One run of the scene. `read` gives a dataset by its path below the results' folder ("steps/load_1.nc").

    `costs`: by stage ("elastic", "steps/load_1"), where Snakemake ran it: seconds, peak memory (MB), and how much of a
    processor it had (%), on average.
    """

    mine: Mine
    read: Callable[[str], xr.Dataset]
    costs: Callable[[str], tuple[float, float, float] | None] = lambda stage: None
    kept: dict[str, xr.Dataset] = field(default_factory=dict)

    @property
    def values(self) -> dict:
        """The whole configuration in SI units."""
        return self.mine.values

    @property
    def step_names(self) -> list[str]:
        """Names of the listed steps, in order."""
        return self.mine.mined_steps

    def scene(self, step: str | None = None) -> Scene:
        """The scene up to a step (the first without a name), as a stage has it."""
        return parse_scene(self.mine.step_slice(step) if step else self.mine.scene_slice(0))

    def _dataset(self, path: str) -> xr.Dataset:
        if path not in self.kept:
            self.kept[path] = self.read(path)
        return self.kept[path]

    @property
    def grid(self) -> xr.Dataset:
        """grid.nc: cells that the first step starts from; those of a step are in its own file."""
        return self._dataset("grid.nc")

    @property
    def elastic(self) -> xr.Dataset:
        """elastic.nc"""
        return self._dataset("elastic.nc")

    def step(self, name: str) -> xr.Dataset:
        """steps/<name>.nc"""
        return self._dataset(f"steps/{name}.nc")

    def events(self, name: str) -> xr.Dataset:
        """events/<name>.nc"""
        return check_events(self._dataset(f"events/{name}.nc"), f"events/{name}.nc")

    def seconds(self, stage: str) -> float | None:
        """Wall time of a stage ("grid", "elastic", "steps/<name>"), start of its process included."""
        costs = self.costs(stage)
        return costs and costs[0]

    def peak_memory(self, stage: str) -> float | None:
        """Largest resident memory of a stage, MB."""
        costs = self.costs(stage)
        return costs and costs[1]

    def processor(self, stage: str) -> float | None:
        """How much of a processor a stage had, %; with one thread less than 100 where others kept it waiting."""
        costs = self.costs(stage)
        return costs and costs[2]


@dataclass
class Results:
    """All variants of a study, with its bounds and settings."""

    study: Study
    variants: dict[str, Variant]

    @property
    def allowed(self) -> dict[str, float]:
        """Bounds of the study, by short name."""
        return self.study.allowed

    @property
    def settings(self) -> dict:
        """Plain numbers of the study."""
        return self.study.settings

    def __getitem__(self, variant: str) -> Variant:
        return self.variants[variant]


def read_results(study: Study, folder: Path, benchmarks: Path) -> Results:
    """Results that Snakemake's stages left in <folder>/<variant>/ and their costs in <benchmarks>/<variant>/."""

    def variant(name: str, mine: Mine) -> Variant:
        def costs(stage: str) -> tuple[float, float, float] | None:
            path = benchmarks / name / f"{stage}.tsv"
            if not path.is_file():
                return None
            table = pd.read_csv(path, sep="\t", na_values="-")
            return tuple(float(table[column].iloc[-1]) for column in ("s", "max_rss", "mean_load"))

        return Variant(mine, lambda path: read_dataset(folder / name / path), costs)

    return Results(study, {name: variant(name, mine) for name, mine in study.mines.items()})
