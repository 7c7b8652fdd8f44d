"""Error, cells and processor time on a regular grid, in nested boxes, and on cells that follow the rock."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from verification.answers.grids.figure import draw
from verification.answers.grids.runs import STOPE, Run, at_error, read_runs, work
from verification.page_tables import Pivot
from verification.results import Results
from verification.rows import Row

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
        Row(f"{run.title}: error, share", 0.0, run.error, run.error),
        Row(f"{run.title}: cells, thousands", np.nan, run.cells / 1e3, np.nan),
        Row(f"{run.title}: processor time, s", np.nan, work(run, runs), np.nan),
    ]
    if run.scene == STOPE:
        quantity = f"{run.title}: rock above strength in coarse cells, share"
        bound = None if run.grid == WALLS else 0.0
        rows.append(Row(quantity, 0.0, run.truncated, run.truncated, bound))
    return rows


def same_answer(runs: list[Run], allowed: float) -> list[Row]:
    """Errors in boxes and on the adaptive grid, beside that on the regular grid with the same finest cells."""
    rows = []
    for run in (run for run in runs if run.grid in (BOXES, ADAPTIVE)):
        regular = [other for other in runs if other.grid == REGULAR and other.cell == run.cell]
        for other in regular:
            quantity = f"{run.title}: error as on the regular grid, share"
            rows.append(Row(quantity, other.error, run.error, abs(run.error - other.error), allowed))
    return rows


def saved_cells(runs: list[Run], of_regular: float, of_boxes: float) -> list[Row]:
    """Cells of the adaptive grid over those of the others, for their smallest finest cells."""
    rows = []
    for grid, allowed in ((REGULAR, of_regular), (BOXES, of_boxes)):
        other = min((run for run in runs if run.grid == grid), key=lambda run: run.cell)
        same = [run for run in runs if run.grid == ADAPTIVE and run.cell == other.cell]
        for run in same:
            share = run.cells / other.cells
            quantity = f"{run.title}: cells over those of {grid}"
            rows.append(Row(quantity, allowed, share, share, allowed, f"{run.cells} and {other.cells} cells"))
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
                rows.append(Row(f"{scene} at {100 * level:g} % error, {what}: {grid}", np.nan, found, np.nan))
    return rows
