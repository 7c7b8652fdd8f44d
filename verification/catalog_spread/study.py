"""The study of the spread of a catalogue: a case for each scene, a row for each quantity and source of its spread."""

from dataclasses import asdict, dataclass

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from verification.catalog_spread.figure import draw
from verification.catalog_spread.runs import MEMBERS, SOURCES, Catalogue, read_base, read_sources
from verification.catalog_spread.variances import values_of, variances
from verification.frame import CaseResults, Inputs, MeasuringStudy, read_study
from verification.page_tables import Columns
from verification.results import Results


@dataclass(frozen=True)
class Scene:
    """The mine's own run, and the catalogues of each source."""

    base: Catalogue
    sources: dict[str, list[Catalogue]]

    @classmethod
    def of(cls, results: Results) -> "Scene":
        """From the results of a study's stages."""
        return cls(read_base(results), read_sources(results))

    @classmethod
    def read(cls, given: dict) -> "Scene":
        """From what `asdict` made of it."""
        sources = {source: [Catalogue(**run) for run in runs] for source, runs in given["sources"].items()}
        return cls(Catalogue(**given["base"]), sources)

    @property
    def table(self) -> pd.DataFrame:
        """Variance of every quantity by every source, with the cost of a member beside those that members show."""
        table = variances(values_of(self.sources))
        return table.assign(member_cost=np.where(table["source"] == MEMBERS, self.member_cost, np.nan))

    @property
    def member_cost(self) -> float:
        """Mean processor time of a member's steps and events over the mine's own; NaN where a log does not state it."""
        return float(np.mean([run.seconds for run in self.sources[MEMBERS]]) / self.base.seconds)


def measure_case(name: str, inputs: Inputs, threads: int) -> dict:
    """Catalogues of one scene."""
    return asdict(Scene.of(read_study(name)))


def tables(results: CaseResults) -> dict[str, pd.DataFrame]:
    """The table of all variances. Potency and number are logarithms: 0.1 is a factor of 1.26."""
    scenes = {name: Scene.read(given).table for name, given in results.items()}
    table = pd.concat(scenes, names=["scene", None]).reset_index("scene").reset_index(drop=True)
    return {"table": table.replace({"source": SOURCES})}


def figures(results: CaseResults) -> dict[str, Figure]:
    """A figure of each scene, by its name."""
    scenes = {name: Scene.read(given) for name, given in results.items()}
    return {name: draw(scene.base, scene.sources) for name, scene in scenes.items()}


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
