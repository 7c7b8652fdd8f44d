"""Output in results/catalog_spread: table.csv, figures, and report.html, which refers to no other file."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from catalogs.figures import style
from common.datasets import atomic_path
from verification.html_page import write_page
from verification.results import Results
from verification.spread.figure import draw
from verification.spread.runs import MEMBERS, QUANTITIES, SOURCES, Catalogue, read_base, read_sources
from verification.spread.variances import Variance, make_table, variances
from verification.studies import Study


@dataclass(frozen=True)
class Scene:
    """One study: the mine's own run, the catalogues of each source, and their variances."""

    study: Study
    base: Catalogue
    sources: dict[str, list[Catalogue]]

    @classmethod
    def of(cls, results: Results) -> "Scene":
        """Read the results of a study's stages."""
        return cls(results.study, read_base(results), read_sources(results))

    @cached_property
    def variances(self) -> list[Variance]:
        """Variance of every quantity by every source."""
        return variances(self.sources)

    def by_quantity(self) -> list[tuple[str, list[Variance]]]:
        """Rows of the page's table: title of a quantity, and its variances by source."""
        return [(quantity.title, [v for v in self.variances if v.quantity is quantity]) for quantity in QUANTITIES]

    @property
    def member_cost(self) -> float:
        """Mean processor time of a member's steps and events over the mine's own; NaN where a log does not state it."""
        return float(np.mean([run.seconds for run in self.sources[MEMBERS]]) / self.base.seconds)

    def bought(self) -> list[str]:
        """Share of each quantity's variance that members show, in words, where it is known."""
        members = [variance for variance in self.variances if variance.source == MEMBERS]
        return [f"{100 * v.share:.0f} % of that of {v.quantity.title}" for v in members if np.isfinite(v.share)]


def write_report(scenes: list[Scene], table: Path, page: Path) -> None:
    """Write table and page, atomically."""
    with atomic_path(table) as temporary:
        rows = make_table({scene.study.name: scene.variances for scene in scenes})
        rows.to_csv(temporary, index=False, float_format="%.4g")
    with style.applied():
        figures = [
            style.save(draw(scene.base, scene.variances), page.parent / f"{scene.study.name}.svg") for scene in scenes
        ]
    write_page(page, "spread", sections=list(zip(scenes, figures, strict=True)), titles=SOURCES)
