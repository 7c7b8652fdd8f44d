"""The study of the spread of a catalogue: a case for each scene, a row for each quantity and source of its spread."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from verification.frame import LOGS, RESULTS, CaseResults, Inputs, MeasuringStudy
from verification.page_tables import Columns
from verification.results import Results, read_results
from verification.spread.figure import draw
from verification.spread.runs import MEMBERS, SOURCES, Catalogue, read_base, read_sources
from verification.spread.variances import Variance, make_table, variances
from verification.studies import FOLDER, load_study


@dataclass(frozen=True)
class Scene:
    """The mine's own run, the catalogues of each source, and their variances."""

    base: Catalogue
    sources: dict[str, list[Catalogue]]

    @classmethod
    def of(cls, results: Results) -> "Scene":
        """From the results of a study's stages."""
        return cls(read_base(results), read_sources(results))

    @classmethod
    def read(cls, given: dict) -> "Scene":
        """From what `written` gave."""
        sources = {source: [Catalogue.read(run) for run in runs] for source, runs in given["sources"].items()}
        return cls(Catalogue.read(given["base"]), sources)

    def written(self) -> dict:
        """Its catalogues, as JSON can hold them."""
        sources = {source: [run.written() for run in runs] for source, runs in self.sources.items()}
        return {"base": self.base.written(), "sources": sources}

    @cached_property
    def variances(self) -> list[Variance]:
        """Variance of every quantity by every source."""
        return variances(self.sources)

    @property
    def member_cost(self) -> float:
        """Mean processor time of a member's steps and events over the mine's own; NaN where a log does not state it."""
        return float(np.mean([run.seconds for run in self.sources[MEMBERS]]) / self.base.seconds)


def measure_case(name: str, inputs: Inputs, threads: int) -> dict:
    """Catalogues of one scene."""
    study = load_study(FOLDER / f"{name}.yaml")
    return Scene.of(read_results(study, RESULTS / name, LOGS / name)).written()


def tables(results: CaseResults) -> dict[str, pd.DataFrame]:
    """The table of all variances, with the cost of a member beside those that members show."""
    scenes = {name: Scene.read(given) for name, given in results.items()}
    table = make_table({name: scene.variances for name, scene in scenes.items()})
    costs = table["scene"].map({name: scene.member_cost for name, scene in scenes.items()})
    table["member_cost"] = costs.where(table["source"] == SOURCES[MEMBERS])
    return {"table": table}


def figures(results: CaseResults) -> dict[str, Figure]:
    """A figure of each scene, by its name."""
    scenes = {name: Scene.read(given) for name, given in results.items()}
    return {name: draw(scene.base, scene.variances) for name, scene in scenes.items()}


STUDY = MeasuringStudy(
    measure_case,
    tables,
    figures,
    shown=(
        Columns(
            "Standard deviation by source, and its share of the variance",
            (
                *("scene", "quantity", "source", "mean", "standard_deviation", "lower_95", "upper_95"),
                *("share", "not_defined"),
            ),
        ),
        Columns(
            "Processor time of a member's steps and events over that of the mine's own",
            ("scene", "member_cost"),
            ("source", (SOURCES[MEMBERS],)),
        ),
    ),
    names=("scene", "quantity", "source"),
)
