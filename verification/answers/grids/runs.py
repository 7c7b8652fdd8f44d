"""Runs of one scene on several grids: error, number of cells and processor time of each, and these at equal error."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mpm_core.equilibrium.increments import potency
from verification.cavities.cavity import Cavity, read_pressure
from verification.results import Results, Variant
from verification.tradeoff.runs import MIN_WORK
from verification.tradeoff.scenes import wall_hoop

SPHERE, STOPE = "sphere", "stope"
STEP = "mined"  # Of the stope.
GOODIER_HOOP = 1.5  # Hoop stress at the wall of a sphere under all-round pressure, over the pressure (Goodier 1933).


@dataclass(frozen=True)
class Run:
    """A variant `scene_grid_cell`.

    cell: edge of the finest cells, m. cells: number of all cells at the end. error: a share. truncated: share of the
    rock above its strength that lies in coarse cells. seconds: processor time of its stages without compiling, s; NaN
    where a stage left no log. stages: their number. least: processor time of the quickest, s.
    """

    scene: str
    grid: str
    cell: float
    cells: int
    error: float
    truncated: float
    seconds: float
    stages: int
    least: float

    @property
    def title(self) -> str:
        """Scene, grid and finest cell in words."""
        return f"{self.scene}, {self.grid}, {self.cell:g} m"


def read_runs(results: Results) -> list[Run]:
    """All variants of the study but the reference of the stope, in the order of the file."""
    settings = results.settings
    edge = settings["block"]
    reference = results[settings["reference"]]
    domain = np.array([reference.values["domain"][side] for side in ("lower", "upper")])
    expected = potency_by_block(reference.step(STEP), domain, edge)
    runs = []
    for name, variant in results.variants.items():
        if variant is reference:
            continue
        scene, grid, _ = name.split("_", 2)
        if scene == SPHERE:
            error, truncated, last = wall_stress_error(variant), 0.0, variant.elastic
        else:
            last = variant.step(STEP)
            error = difference(potency_by_block(last, domain, edge), expected)
            truncated = float(last.attrs["truncated_share"])
        costs = [variant.processor_time(stage) for stage in stages_of(variant)]
        known = [np.nan if cost is None else cost for cost in costs]
        runs.append(
            Run(
                scene=scene,
                grid=grid,
                cell=float(variant.grid.attrs["fine_cell"]),
                cells=int(last.attrs.get("cells", variant.grid.sizes["cell"])),
                error=error,
                truncated=truncated,
                seconds=float(np.sum(known)),
                stages=len(known),
                least=float(np.min(known)),
            )
        )
        variant.kept.clear()  # States are large.
    return runs


def stages_of(variant: Variant) -> list[str]:
    """Names of the stages of a run."""
    return ["grid", "elastic", *(f"steps/{step}" for step in variant.step_names)]


def wall_stress_error(variant: Variant) -> float:
    """Error of the hoop stress at the wall of the sphere, extrapolated to it, as a share of the exact one."""
    cavity = Cavity(variant, variant.elastic)
    return abs(wall_hoop(cavity) / (-GOODIER_HOOP * read_pressure(variant)) - 1.0)


def potency_by_block(state: xr.Dataset, domain: NDArray, edge: float) -> NDArray:
    """Seismic potency of the rock that failed in the step, m3, by blocks of `edge` m of the domain (2, 3) m."""
    failed = state.failed.values == state.attrs["step_index"]
    weights = potency(state.seismic_strain.values[failed], state.volume.values[failed])
    sides = [np.arange(low, high + 0.5 * edge, edge) for low, high in domain.T]
    return np.histogramdd(state.position.values[failed], bins=sides, weights=weights)[0]


def difference(found: NDArray, expected: NDArray) -> float:
    """Sum of the differences of all blocks, as a share of the expected sum. Potency in a wrong block counts twice."""
    return float(np.abs(found - expected).sum() / expected.sum())


def starts(run: Run, runs: Sequence[Run]) -> float:
    """Processor time of the starts of a run's processes, s: each takes at most that of the quickest stage."""
    return run.stages * min(other.least for other in runs)


def work(run: Run, runs: Sequence[Run]) -> float:
    """Processor time of a run less the starts of its processes, at least MIN_WORK, s; NaN where it is not known."""
    return float(np.maximum(MIN_WORK, run.seconds - starts(run, runs)))  # max() would drop a NaN


def at_error(level: float, errors: ArrayLike, costs: ArrayLike) -> float:
    """Cost at which a grid comes to an error, by a straight line in logarithms between its runs.

    errors, costs (run,): in order of cost. NaN where no two neighbouring runs have errors above and below the level.
    """
    error, cost = np.log(np.asarray(errors, float)), np.log(np.asarray(costs, float))
    for before, after in zip(range(len(error) - 1), range(1, len(error)), strict=True):
        if error[before] >= np.log(level) >= error[after]:
            share = (error[before] - np.log(level)) / (error[before] - error[after])
            return float(np.exp(cost[before] + share * (cost[after] - cost[before])))
    return np.nan
