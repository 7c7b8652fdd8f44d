"""`accuracy`: presets of cells, tolerances and increments for a mine.

`standard` uses the mine file unchanged. The other two change cells, tolerances and increments in proportion. Study
openings measures their costs and errors, and `snakemake tradeoff` those of each change alone.
"""

import math
from dataclasses import dataclass

from common.errors import InputError
from mpm_core.settings import MAX_LEVELS
from workflow.mine_configuration import MineConfiguration

LOOSE_TOLERANCE_MISS = {
    "tolerance": 1e-2,
    "cascade_tolerance": 0.05,
}  # with larger ones rock is far from equilibrium when failure is checked


@dataclass(frozen=True)
class Accuracy:
    """levels: number added to the file's; tolerances, overshoot: factors on the file's."""

    levels: int
    tolerances: float
    overshoot: float


DRAFT, STANDARD, FINE = "draft", "standard", "fine"
PRESETS = {DRAFT: Accuracy(-1, 3.0, 2.0), STANDARD: Accuracy(0, 1.0, 1.0), FINE: Accuracy(1, 1.0, 0.5)}


def apply_accuracy(mine: MineConfiguration) -> None:
    """Change cells and solver of a mine, its grid complete. Raises InputError where cells cannot."""
    name, grid, solver = mine.settings.accuracy, mine.settings.grid, mine.settings.solver
    preset = PRESETS[name]
    if name == STANDARD:
        return
    levels = grid.levels + preset.levels
    if levels < 1:
        coarse = grid.coarse_cell
        larger = (
            "use grid.levels: 2 or more"
            if mine.far_field
            else f"make sides of the domain whole multiples of {2 * coarse:g} m and the largest cells (grid) as large"
        )
        raise InputError(
            f"accuracy: {name}: leaves out the finest cells, but all cells are of {coarse:g} m; {larger}, or leave "
            "accuracy out"
        )
    if levels > MAX_LEVELS:
        fewer = "fewer grid.levels" if "levels" in mine.written_cells else "a smaller grid.coarse_cell"
        raise InputError(
            f"accuracy: {name}: halves the finest cells, but there are {MAX_LEVELS} sizes of cell, the most that "
            f"there can be; leave accuracy out, or use {fewer}"
        )
    mine.change("grid", levels=levels)
    mine.resized_by = name
    tolerances = {key: getattr(solver, key) for key in LOOSE_TOLERANCE_MISS}
    mine.change(
        "solver",
        **{
            key: max(value, min(value * preset.tolerances, LOOSE_TOLERANCE_MISS[key]))
            for key, value in tolerances.items()
        },
        max_overshoot=min(max(solver.max_overshoot * preset.overshoot, 0.001), 1.0),
        increments=min(math.ceil(solver.increments / preset.overshoot), 1000),  # 0 stays: max_overshoot decides
    )
