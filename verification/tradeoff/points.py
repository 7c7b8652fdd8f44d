"""One point for each variant of a study: values of its knobs, its measures, and its costs."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from common.costs import Costs
from common.errors import InputError
from verification.results import Results, Variant
from verification.tradeoff.knobs import Value, settings_of
from verification.tradeoff.scenes import SCENES

UNKNOWN = Costs(np.nan, np.nan, np.nan, np.nan)


@dataclass(frozen=True)
class Point:
    """A run. accuracy: its preset. settings: value of each knob. measures: see tradeoff.measures.

    seconds: processor time of all stages with the starts of their processes and without compiling, s. stages: their
    number. least: processor time of the quickest stage, s. wall: wall time of all, s. compiling: processor time of
    compiling, s. memory: largest of any stage, MiB, more where it compiled. cells, failed: cells and failed particles
    at the end. Costs are NaN where a stage left no closing line in its log.
    """

    variant: str
    accuracy: str
    settings: dict[str, Value]
    measures: dict[str, float]
    seconds: float
    stages: int
    least: float
    wall: float
    compiling: float
    memory: float
    cells: int
    failed: int


@dataclass(frozen=True)
class Points:
    """Points of one study. exact: values of measures in closed form."""

    exact: dict[str, float]
    points: list[Point]

    @classmethod
    def read(cls, given: dict[str, Any]) -> "Points":
        """From what `asdict` made of them."""
        return cls(given["exact"], [Point(**point) for point in given["points"]])


def measure_study(results: Results) -> Points:
    """Points of all variants of a study. Raises InputError where the study names an unknown kind of scene."""
    kind = results.settings["scene"]
    if kind not in SCENES:
        raise InputError(f"{results.study.name}: settings.scene: no '{kind}'; there are {', '.join(SCENES)}")
    points: list[Point] = []
    exact: dict[str, float] = {}
    for name, variant in results.variants.items():
        measures, exact = SCENES[kind](results, variant)
        points.append(_point(name, variant, measures, results.study.events))
        if name not in results.settings.get("limit", []):
            variant.kept.clear()  # States are large.
    return Points(exact, points)


def _point(name: str, variant: Variant, measures: dict[str, float], with_events: bool) -> Point:
    steps, last = variant.step_names, variant.last
    stages = variant.stages + (["events"] if with_events and steps else [])
    costs = [variant.costs(stage) or UNKNOWN for stage in stages]
    running = np.array([cost.running for cost in costs])
    return Point(
        variant=name,
        accuracy=variant.mine.settings.accuracy,
        settings=settings_of(variant.mine.settings)
        | {"cell": float(variant.grid.attrs["fine_cell"])},  # drafts may keep it
        measures=measures,
        seconds=float(running.sum()),
        stages=len(stages),
        least=float(running.min()),
        wall=float(sum(cost.seconds for cost in costs)),
        compiling=float(sum(cost.compiling for cost in costs)),
        memory=float(np.max([cost.memory for cost in costs])),
        cells=int(last.attrs.get("cells", variant.grid.sizes["cell"])),
        failed=int((last.failed.values >= 0).sum()) if steps else 0,
    )
