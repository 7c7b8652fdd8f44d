"""`accuracy`: a mine as its file says it, in a hurry, or with patience.

What a file says is `standard`. The other two change its cells, tolerances and increments in proportion, so that what
they cost and err by is told once (docs/method.md, 2). `snakemake tradeoff` measures each of them alone.
"""

import math
from dataclasses import dataclass

from mpm_core.far_field import MOST_LEVELS
from pipeline.errors import InputError

LOOSEST = {"tolerance": 1e-2, "cascade_tolerance": 0.05}  # looser, rock is not at rest when its failure is looked for


@dataclass(frozen=True)
class Accuracy:
    """levels: of cells, more than the file's; tolerances, overshoot: times the file's."""

    levels: int
    tolerances: float
    overshoot: float


DRAFT, STANDARD, FINE = "draft", "standard", "fine"
PRESETS = {DRAFT: Accuracy(-1, 3.0, 2.0), STANDARD: Accuracy(0, 1.0, 1.0), FINE: Accuracy(1, 1.0, 0.5)}


def apply_accuracy(values: dict) -> None:
    """Change cells and solver of a configuration in SI, its grid complete. Raises InputError where cells cannot."""
    name = values["accuracy"]
    preset, grid, solver = PRESETS[name], values["grid"], values["solver"]
    if preset == PRESETS[STANDARD]:
        return
    levels = grid["levels"] + preset.levels
    if levels < 1:
        coarse = grid["coarse_cell"]
        raise InputError(
            f"accuracy: {name}: leaves out the finest cells, but all cells are of {coarse:g} m; make sides of the "
            f"domain whole multiples of {2 * coarse:g} m and the largest cells (grid) as large, or leave accuracy out"
        )
    if levels > MOST_LEVELS:
        raise InputError(
            f"accuracy: {name}: halves the finest cells, but there are {MOST_LEVELS} sizes of cell, the most that "
            "there can be; leave accuracy out, or take fewer grid.levels"
        )
    grid["levels"] = levels
    for key, loosest in LOOSEST.items():
        solver[key] = max(solver[key], min(solver[key] * preset.tolerances, loosest))
    solver["increment_error"] = min(max(solver["increment_error"] * preset.overshoot, 0.001), 1.0)
    solver["increments"] = min(math.ceil(solver["increments"] / preset.overshoot), 1000)  # 0: as the error asks
