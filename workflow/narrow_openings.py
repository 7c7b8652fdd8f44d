"""Openings that are too narrow for the cells, told before anything is computed: those around which too little rock
would fail, and those that fill would not hold."""

from collections.abc import Sequence

from common.cell_sizes import CELLS_ACROSS_FILL
from workflow.cells_across import across_of
from workflow.mine import Mine
from workflow.mine_settings import Excavation

MAX_NAMED = 5  # Excavations that one line names.


def notes(mine: Mine) -> list[str]:
    """Lines on excavations with fewer cells across than they need, and on those with fewer than fill needs that is
    placed in a later step than mines them; planned ones are left out.

    A solid that cannot be read, or encloses nothing, is left to the stage that reads it.
    """
    cell, across = mine.finest_cell, across_of(mine)
    later = [entry.name for entry in mine.excavations if entry.name in across and _is_filled_later(mine, entry)]
    narrow = sorted((name for name in across if across[name].is_narrow()), key=lambda name: across[name].cells)
    loose = sorted((n for n in later if across[n].is_narrow(CELLS_ACROSS_FILL)), key=lambda name: across[name].cells)
    lines = []
    if narrow:
        size = min(across[name].largest_cell(cell) for name in narrow)
        told = [f"{name} {across[name].cells:.1f} of {across[name].needed}" for name in narrow]
        lines.append(
            f"excavations: narrow for cells of {cell:g} m, too little rock fails around them (cells across, of those "
            f"needed): {_listed(told)}; grid.finest_cell: {size:g} m is small enough"
        )
    if loose:
        size = min(across[name].largest_cell(cell, CELLS_ACROSS_FILL) for name in loose)
        told = [f"{name} {across[name].cells:.1f}" for name in loose]
        lines.append(
            f"excavations: fill may not hold the walls of {len(loose)} of {len(later)} filled in a later step; "
            f"it needs {CELLS_ACROSS_FILL} cells across: {_listed(told)}; use grid.finest_cell: {size:g} m, or fill "
            "them in the step that mines them"
        )
    return lines


def _is_filled_later(mine: Mine, entry: Excavation) -> bool:
    return entry.fill_material is not None and mine.step_index(entry.fill_step) > mine.step_index(entry.step)


def _listed(parts: Sequence[str]) -> str:
    """The first MAX_NAMED of them, and how many more there are."""
    more = f" and {len(parts) - MAX_NAMED} more" if len(parts) > MAX_NAMED else ""
    return ", ".join(parts[:MAX_NAMED]) + more
