"""Error, cells and processor time on a regular grid, in nested boxes, and on cells that follow the rock."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from catalogs.figures import style
from verification.cavities.cavity import Cavity, read_pressure
from verification.comparisons import bounded, failed_in_step, reported, seismic_potency, vanishing
from verification.page_tables import Pivot
from verification.plots import plain_decades, plot_series
from verification.results import Results, Variant
from verification.rows import Row
from verification.tradeoff.runs import MIN_WORK
from verification.tradeoff.scenes import wall_hoop

COLUMNS = "error, share|cells, thousands|processor time, s|rock above strength in coarse cells, share"
RUN = r"(?P<row>{scene}, \w+, [\d.]+ m): (?P<column>{columns})"

TABLES = (
    Pivot("Sphere by grid and finest cell", RUN.format(scene="sphere", columns=COLUMNS), "measured"),
    Pivot("Stope by grid and finest cell", RUN.format(scene="stope", columns=COLUMNS), "measured"),
    Pivot(
        "At equal error, interpolated",
        r"(?P<row>\w+ at [\d.]+ % error, (?:cells, thousands|processor time, s)): (?P<column>\w+)",
        "measured",
    ),
    Pivot(
        "Error as on the regular grid with the same finest cells (difference of the errors, %)",
        r"(?P<column>\w+, \w+), (?P<row>[\d.]+ m): error as on the regular grid, share",
        "error, %",
    ),
)

REGULAR, BOXES, ADAPTIVE, WALLS = "regular", "boxes", "adaptive", "walls"
GRIDS = {
    REGULAR: "regular grid",
    BOXES: "nested boxes",
    ADAPTIVE: "cells that follow walls and failed rock",
    WALLS: "cells that follow walls only",
}
SPHERE, STOPE = "sphere", "stope"
STEP = "mined"  # Of the stope.
PANELS = {  # Title of each scene, and its error.
    SPHERE: ("Sphere in elastic rock", "error of the hoop stress at the wall (%)"),
    STOPE: ("Stope in brittle rock", "difference of potency by blocks (%)"),
}
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
        times = variant.processor_times(variant.stages)
        runs.append(
            Run(
                scene=scene,
                grid=grid,
                cell=float(variant.grid.attrs["fine_cell"]),
                cells=int(last.attrs.get("cells", variant.grid.sizes["cell"])),
                error=error,
                truncated=truncated,
                seconds=float(times.sum()),
                stages=len(times),
                least=float(times.min()),
            )
        )
        variant.kept.clear()  # States are large.
    return runs


def wall_stress_error(variant: Variant) -> float:
    """Error of the hoop stress at the wall of the sphere, extrapolated to it, as a share of the exact one."""
    cavity = Cavity(variant, variant.elastic)
    return abs(wall_hoop(cavity) / (-GOODIER_HOOP * read_pressure(variant)) - 1.0)


def potency_by_block(state: xr.Dataset, domain: NDArray, edge: float) -> NDArray:
    """Seismic potency of the rock that failed in the step, m3, by blocks of `edge` m of the domain (2, 3) m."""
    failed = failed_in_step(state)
    weights = seismic_potency(state, failed)
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


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    runs = read_runs(results)
    return make_rows(results, runs), draw(runs)


def make_rows(results: Results, runs: list[Run]) -> list[Row]:
    """All rows of the study."""
    rows = [row for run in runs for row in run_rows(run, runs)]
    for scene, levels in results.settings["equal"].items():
        chosen = [run for run in runs if run.scene == scene]
        rows += same_answer(chosen, results.allowed["beside_regular"])
        rows += saved_cells(chosen, results.allowed[f"cells_{scene}"], results.allowed["cells_of_boxes"])
        for level in levels:
            rows += equal_error(scene, level, chosen, runs)
    return rows


def run_rows(run: Run, runs: list[Run]) -> list[Row]:
    """Error, cells and processor time of a run; where rock fails, whether some of it lies in cells that cannot."""
    rows = [
        vanishing(f"{run.title}: error, share", run.error),
        reported(f"{run.title}: cells, thousands", run.cells / 1e3),
        reported(f"{run.title}: processor time, s", work(run, runs)),
    ]
    if run.scene == STOPE:
        quantity = f"{run.title}: rock above strength in coarse cells, share"
        bound = None if run.grid == WALLS else 0.0
        rows.append(vanishing(quantity, run.truncated, bound))
    return rows


def same_answer(runs: list[Run], allowed: float) -> list[Row]:
    """Errors in boxes and on the adaptive grid, beside that on the regular grid with the same finest cells."""
    rows = []
    for run in (run for run in runs if run.grid in (BOXES, ADAPTIVE)):
        regular = [other for other in runs if other.grid == REGULAR and other.cell == run.cell]
        for other in regular:
            quantity = f"{run.title}: error as on the regular grid, share"
            rows.append(Row.absolute(quantity, other.error, run.error, allowed))
    return rows


def saved_cells(runs: list[Run], of_regular: float, of_boxes: float) -> list[Row]:
    """Cells of the adaptive grid over those of the others, for their smallest finest cells."""
    rows = []
    for grid, allowed in ((REGULAR, of_regular), (BOXES, of_boxes)):
        other = min((run for run in runs if run.grid == grid), key=lambda run: run.cell)
        same = [run for run in runs if run.grid == ADAPTIVE and run.cell == other.cell]
        for run in same:
            quantity = f"{run.title}: cells over those of {grid}"
            remark = f"{run.cells} and {other.cells} cells"
            rows.append(bounded(quantity, run.cells / other.cells, allowed, remark))
    return rows


def equal_error(scene: str, level: float, runs: list[Run], every: list[Run]) -> list[Row]:
    """Cells and processor time at which each grid comes to an error; grids without such runs are left out."""
    costs: dict[str, Callable[[Run], float]] = {
        "cells, thousands": lambda run: run.cells / 1e3,
        "processor time, s": lambda run: work(run, every),
    }
    rows = []
    for what, cost in costs.items():
        for grid in (REGULAR, BOXES, ADAPTIVE):
            members = [run for run in runs if run.grid == grid]
            found = at_error(level, [run.error for run in members], [cost(run) for run in members])
            if np.isfinite(found):
                rows.append(reported(f"{scene} at {100 * level:g} % error, {what}: {grid}", found))
    return rows


def draw(runs: list[Run]) -> Figure:
    """Error against cells and against processor time for both scenes. Each point is labelled with its finest cell."""
    figure = style.new_figure(height=7.4)
    panels = figure.subplots(2, 2)
    for (cells, time), (scene, (title, error)) in zip(panels, PANELS.items(), strict=True):
        members = {
            name: [run for run in runs if (run.scene, run.grid) == (scene, grid)] for grid, name in GRIDS.items()
        }
        look: dict = {
            "notes": {name: [f"{run.cell:g} m" for run in some] for name, some in members.items()},
            "marks": ("s-", "D-", "o-", "^-"),
            "legend": None,
            "ylabel": error,
            "xscale": "log",
            "yscale": "log",
        }
        errors = {name: [100 * run.error for run in some] for name, some in members.items()}
        counts = {name: ([run.cells for run in some], errors[name]) for name, some in members.items()}
        plot_series(cells, counts, title=f"{title}: cells", xlabel="cells at the end", **look)
        times = {name: ([work(run, runs) for run in some], errors[name]) for name, some in members.items()}
        what = "processor time of all stages, less the start of their processes (s)"
        plot_series(time, times, title=f"{title}: time", xlabel=what, **look)
        for axes in (cells, time):
            axes.margins(0.09)
            plain_decades(axes)
        least = max((starts(run, runs) for run in runs if run.scene == scene), default=np.nan)
        if np.isfinite(least):
            time.axvspan(time.get_xlim()[0], least, color="#eeeeee", zorder=0, label="less time than the starts take")
    figure.legend(*panels[1, 1].get_legend_handles_labels(), loc="outside lower center", ncols=len(GRIDS) + 1)
    return figure
