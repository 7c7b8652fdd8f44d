"""What a mine will cost on cells of a size, and how wrong they leave it: the price before the run.

A pilot on larger cells shows what the first steps take (workflow.pilot). From there:

- The cells of the grid are counted. Of those that steps add, the finest lie around failed rock: with cells of half the
  size there are 2^FINEST_ORDER times as many. The coarser ones surround these and what is mined: there are
  2^COARSER_ORDER times as many. Each later step adds LATER_SHARE of what the last one of the pilot adds. The run splits
  no cells beyond grid.max_cells.
- Failure spreads cell by cell, so a step takes more cycles on smaller cells: 2^CYCLES_ORDER times as many with half the
  size. A cycle takes time as cells^CELLS_ORDER, since many cells no longer stay in the cache. Other stages take time in
  proportion to their cells.
- In plane strain the orders of added cells and of cycles are less by one.
- Failed rock has nearly the same thickness in metres. Its last cell fails as a whole or not at all, so it is thinner on
  smaller cells, 2^-THICKNESS_ORDER times with half the size. Its thickness in cells gives the error, by the law of
  study openings (catalogs.compare.cell_error).
"""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from catalogs.compare.cell_error import MAX_ERROR, MIN_ERROR, error_at
from common.costs import duration_text
from common.errors import InputError
from mpm_core.geometry.thickness import Across
from mpm_core.settings import MAX_LEVELS
from mpm_core.stages.grid_stage import cells_at_start, draft_keeps_cells
from mpm_core.stages.stage_memory import stage_bytes, usable
from workflow.cells_across import across_of
from workflow.mine import Mine
from workflow.mine_settings import AccuracyRequest
from workflow.pilot import pilot_of, pilot_slices
from workflow.stages import stages

# Powers and shares from runs of demo, template and renison_scale on cells of two or three sizes (study scale); study
# foreseen holds them against other mines.
CYCLES_ORDER = 1.25
CELLS_ORDER = 1.14
FINEST_ORDER = 2.7
COARSER_ORDER = 1.4
LATER_SHARE = 0.25
THICKNESS_ORDER = 0.25
REPORT_SECONDS = 15.0  # processor time from events to report
SERIAL_SHARE = 0.4  # of a run's processor time, which one core takes alone
SIZES = {2.0: "twice as large", 1.0: "as they are", 0.5: "half as large"}
PRESET_OF = {2.0: "draft", 1.0: "standard", 0.5: "fine"}
MIN_SIZE, MAX_SIZE = 1.0 / 64.0, 64.0  # finest cells that are looked for, over those of the mine
HALVINGS = 40  # of the search for a size
MAX_NAMED = 3  # openings that one line names


@dataclass(frozen=True)
class Quote:
    """A run of a mine as it is foreseen on finest cells of a size.

    cell m; start, end: cells of the grid, and after the last step; memory: bytes at the peak, of steps and of the
    companion that runs beside them; processor, wall: time of the whole run, s, its companion and its ensemble included,
    without compiling; error: of potency and failed volume, a share; NaN where no rock failed in the pilot, or none
    beside sound rock, infinite where too little of it did.
    """

    cell: float
    start: int
    end: int
    memory: float
    processor: float
    wall: float
    error: float

    def text(self) -> str:
        """Costs and error in a few words."""
        return (
            f"foreseen: {duration_text(self.wall)}, {self.memory / 1e9:.1f} GB, error of potency and failed volume "
            f"{error_text(self.error)}"
        )


def quote_slice(mine: Mine) -> dict:
    """Settings of a quote: pilots, grids on cells of the sizes SIZES, and what costs depend on besides.

    Where the file gives cells or corners of the domain that go with them, other cells are doubled or halved ones.
    """
    settings, across = mine.settings, across_of(mine)
    doubled = bool(mine.written_cells & {"coarse_cell", "levels"}) or "lower" in (mine.text.get("domain") or {})
    grids = {}
    for size in SIZES:
        levels = settings.grid.levels - round(math.log2(size))
        if 1 <= levels <= MAX_LEVELS:
            grid = mine.grid_slice()
            grids[str(mine.finest_cell * size)] = grid | {"grid": grid["grid"] | {"levels": levels}}
    return {
        "name": mine.name,
        "cell": mine.finest_cell,
        "levels": settings.grid.levels,
        "doubled": doubled,
        "max_cells": settings.grid.max_cells,
        "pilots": pilot_slices(mine),
        "grids": grids,
        "across": {name: [one.cells * mine.finest_cell, one.needed] for name, one in across.items()},
        "steps": len(mine.mined_steps),
        "scheme": settings.solver.scheme,
        "dimension": mine.dimension,
        "particles_per_cell": settings.grid.particles_per_cell,
        "follows": mine.is_adaptive,
        "companion": mine.has_companion,
        "members": mine.members,
        "accuracy": settings.accuracy,
    }


def quote_source() -> str:
    """Hash of the sources that a pilot runs."""
    return stages()["quote"].source_hash()


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Quotes:
    """The quotes of a mine. settings: see `quote_slice`; code: see pilot_of; cores: of this machine.

    Raises InputError where there can be no pilot, or where it reaches no equilibrium.
    """

    def __init__(self, settings: dict, code: str, cores: int):
        if not settings["pilots"]:
            raise InputError(
                "grid.levels: all cells are of one size (as those of a draft may be), and the mine cannot be tried on "
                "larger ones; use more grid.levels"
            )
        if settings["accuracy"] == PRESET_OF[2.0] and draft_keeps_cells(settings["grids"][str(settings["cell"])]):
            settings = settings | {"cell": 0.5 * settings["cell"], "levels": settings["levels"] + 1}
        self.settings, self.cores = settings, cores
        self.cells: dict[float, int] = {}
        for cell, grid in settings["grids"].items():
            try:
                self.cells[float(cell)] = cells_at_start(grid)
            except InputError:  # too little memory to count them
                if float(cell) >= settings["cell"]:
                    raise
        self.pilot = pilot_of(settings["name"], settings["pilots"], self.cells[settings["cell"]], code, cores)
        self.cells[self.pilot.cell] = self.pilot.start

    @property
    def own(self) -> Quote:
        """The quote on the mine's own cells."""
        return self.at(self.settings["cell"], draft=self.settings["accuracy"] == PRESET_OF[2.0])

    @property
    def sizes(self) -> tuple[float, float]:
        """The smallest and the largest finest cells (m) that there can be, as far as they are looked for."""
        settings = self.settings
        least, most = MIN_SIZE, MAX_SIZE
        if settings["doubled"]:
            least = max(least, 2.0 ** (settings["levels"] - MAX_LEVELS))
            most = min(most, 2.0 ** (settings["levels"] - 1))
        return least * settings["cell"], most * settings["cell"]

    def possible(self, cell: float, up: bool = False) -> float:
        """The largest size (m) not above this one, or (up) the smallest not below, that the cells of the file can have:
        of two digits, or doubled or halved."""
        if not self.settings["doubled"]:
            return _rounded(cell, up)
        halvings = math.log2(self.settings["cell"] / cell)
        return self.settings["cell"] / 2.0 ** (math.floor(halvings + 1e-9) if up else math.ceil(halvings - 1e-9))

    def cells_at(self, cell: float) -> float:
        """Cells of the grid with finest cells of a size (m): a power of the size between those that were counted."""
        sizes = np.log(sorted(self.cells))
        numbers = np.log([self.cells[size] for size in sorted(self.cells)])
        place = int(np.clip(np.searchsorted(sizes, math.log(cell)) - 1, 0, len(sizes) - 2))
        slope = (numbers[place + 1] - numbers[place]) / (sizes[place + 1] - sizes[place])
        return math.exp(numbers[place] + slope * (math.log(cell) - sizes[place]))

    def at(self, cell: float, draft: bool = False) -> Quote:
        """The quote on finest cells of a size (m). draft: without a companion."""
        settings = self.settings
        own, steps, end = self._costs(cell)
        whole, memory = own + REPORT_SECONDS + settings["members"] * steps, self._memory(end)
        if settings["companion"] and not draft:
            more, _, beside = self._costs(2.0 * cell)
            whole += more
            memory += self._memory(beside) if self.cores > 1 else 0.0
        alone = own * (SERIAL_SHARE + (1.0 - SERIAL_SHARE) / self.cores)
        law = error_at(self.pilot.thickness / cell * (cell / self.pilot.cell) ** THICKNESS_ORDER)
        error = math.inf if law > MAX_ERROR else math.expm1(law)
        return Quote(cell, round(self.cells_at(cell)), end, memory, whole, max(alone, whole / self.cores), error)

    def _memory(self, cells: int) -> float:
        settings = self.settings
        particles = cells * settings["particles_per_cell"]
        return stage_bytes(settings["scheme"], settings["dimension"], cells, particles, follows=settings["follows"])

    def _costs(self, cell: float) -> tuple[float, float, int]:
        """Processor time of grid, elastic equilibrium and all steps, s, of the steps alone, and cells at the end."""
        pilot, finer, most = self.pilot, self.pilot.cell / cell, self.settings["max_cells"]
        less = 3 - self.settings["dimension"]
        before, start = (pilot.start, pilot.start_finest), self.cells_at(cell)
        cells = start
        steps = seconds = added = 0.0
        for step in pilot.steps:
            more, finest = step.cells - before[0], step.finest - before[1]
            added = finest * finer ** (FINEST_ORDER - less) + (more - finest) * finer ** (COARSER_ORDER - less)
            before = step.cells, step.finest
            cells = max(cells, min(cells + added, most))
            seconds = step.seconds * (cells / step.cells) ** CELLS_ORDER * finer ** (CYCLES_ORDER - less)
            steps += seconds
        later = 0 if pilot.collapsed else self.settings["steps"] - len(pilot.steps)
        for _ in range(later):
            grown = max(cells, min(cells + LATER_SHARE * added, most))
            seconds *= (grown / cells) ** CELLS_ORDER
            cells = grown
            steps += seconds
        return (pilot.grid + pilot.elastic) * start / pilot.start + steps, steps, round(cells)

    def half(self, one: Quote) -> Quote | None:
        """The quote on the largest cells that there can be with half of the error of another; None where study openings
        vouches for no such error, where cells can be no smaller, or no more of them, or where no error is known."""
        cell = self.largest(lambda other: other.error <= 0.5 * one.error) if math.isfinite(one.error) else 0.0
        found = self.at(max(self.possible(cell), self.sizes[0])) if cell else None
        return None if found is None or self.is_truncated(found) else found

    def is_truncated(self, one: Quote) -> bool:
        """True if a run would not split all cells that rock near its strength needs."""
        return self.settings["follows"] and one.end >= self.settings["max_cells"]

    def narrow(self, cell: float) -> list[str]:
        """Openings that are narrow for cells of a size (m), the narrowest first, as text."""
        found = {name: Across(width / cell, needed) for name, (width, needed) in self.settings["across"].items()}
        narrow = sorted((name for name in found if found[name].is_narrow()), key=lambda name: found[name].cells)
        return [f"{name} ({found[name].cells:.1f} cells across, of {found[name].needed})" for name in narrow]

    def largest(self, suits: Callable[[Quote], bool]) -> float:
        """The largest finest cells (m) that suit, and all smaller ones do; 0 if none do."""
        least, most = self.sizes
        return self._bisect(suits, least, most)

    def smallest(self, suits: Callable[[Quote], bool]) -> float:
        """The smallest finest cells (m) that suit, and all larger ones do; infinite if none do."""
        least, most = self.sizes
        return self._bisect(suits, most, least) or math.inf

    def _bisect(self, suits: Callable[[Quote], bool], good: float, bad: float) -> float:
        if not suits(self.at(good)):
            return 0.0
        for _ in range(HALVINGS):
            middle = math.sqrt(good * bad)
            good, bad = (middle, bad) if suits(self.at(middle)) else (good, middle)
        return good


def text_of(quotes: Quotes) -> str:
    """The quotes of a mine on cells of the sizes SIZES as lines of text."""
    settings, pilot = quotes.settings, quotes.pilot
    own, truncated = quotes.own, []
    rows = [
        ("finest cells", "", "cells at the start", "at the end", "memory", "processor time", "by the clock", "error")
    ]
    for size, title in SIZES.items():
        cell = settings["cell"] * size
        if cell not in quotes.cells:
            continue
        preset = PRESET_OF[size] if settings["accuracy"] == PRESET_OF[1.0] else ""
        if preset == PRESET_OF[2.0] and draft_keeps_cells(settings["grids"][str(cell)]):
            preset = ""  # a draft has other cells
        one = quotes.at(cell, draft=preset == PRESET_OF[2.0])
        truncated += [f"{cell:.4g} m"] * quotes.is_truncated(one)
        rows.append(
            (
                title + f" ({preset})" * bool(preset), f"{cell:.4g} m", f"{one.start:,}", f"{one.end:,}",
                f"{one.memory / 1e9:.1f} GB", duration_text(one.processor), duration_text(one.wall),
                error_text(one.error),
            )
        )  # fmt: skip
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    tried = " and ".join(step.name for step in pilot.steps) or "elastic equilibrium"
    lines = [
        f"{settings['name']}: what it takes on this machine with {quotes.cores} core{'s' * (quotes.cores > 1)}, by "
        f"{tried} on cells of {pilot.cell:.4g} m. The error is that of potency and of failed volume.",
        *("  ".join(part.rjust(width) for part, width in zip(row, widths, strict=True)) for row in rows),
    ]
    if pilot.around:
        lines.append(
            f"the error is above all that of {pilot.around}: more rock fails there than around any other opening"
        )
    if settings["follows"] and pilot.start == pilot.start_finest:
        lines.append("it was tried on cells of one size: how many the run splits around failing rock is not foreseen")
    if pilot.collapsed:
        lines.append(
            f"the mine that was tried collapses in {pilot.collapsed}: steps after it are not computed, and cost nothing"
        )
    if truncated:
        lines.append(
            f"grid.max_cells ({settings['max_cells']:,}) is reached with cells of {' and '.join(truncated)}: rock that "
            "nears its strength then stays in larger ones and does not fail, whatever the error above"
        )
    free = usable()
    if own.memory > free:
        fits = quotes.smallest(lambda one: one.memory <= free)
        which = f"cells of {quotes.possible(fits, up=True):.4g} m fit" if math.isfinite(fits) else "no cells fit"
        lines.append(f"{free / 1e9:.1f} GB of memory are free: {which}")
    if narrow := quotes.narrow(settings["cell"]):
        more = f" and {len(narrow) - MAX_NAMED} more" if len(narrow) > MAX_NAMED else ""
        lines.append(
            f"too little rock fails around openings that are narrow for these cells, whatever the error above: "
            f"{', '.join(narrow[:MAX_NAMED])}{more}"
        )
    return "\n".join(lines) + "\n"


def error_text(error: float) -> str:
    """An error as a quote states it."""
    if math.isnan(error):
        return "no rock failed in the trial"
    return f"{100 * error:.0f} %" if math.isfinite(error) else "too large to say"


def _rounded(cell: float, up: bool = False) -> float:
    """A size with two significant digits, rounded up or down."""
    unit = 10.0 ** (math.floor(math.log10(cell)) - 1)
    return (math.ceil(cell / unit - 1e-9) if up else math.floor(cell / unit + 1e-9)) * unit


def choose(quotes: Quotes, request: AccuracyRequest) -> float:
    """Finest cells (m) that a request asks for, and that grid.max_cells allows. Without a memory in the request, that
    which is free counts.

    Raises InputError, one line that says what can be had, where there are none.
    """
    asked = {"memory": usable() / 1e9} | request.given()
    limits: list[Callable[[Quote], bool]] = [
        lambda one: one.memory <= asked["memory"] * 1e9,
        lambda one: "time" not in asked or one.wall <= asked["time"] * 60.0,
        lambda one: not quotes.is_truncated(one),
    ]
    fit = max(map(quotes.smallest, limits))
    least, most = map(quotes.at, quotes.sizes)
    if fit == math.inf:
        raise InputError(
            f"accuracy: not to be had: on cells of {most.cell:.4g} m it still takes {duration_text(most.wall)}, "
            f"{most.memory / 1e9:.1f} GB and {most.end:,} cells"
        )
    fit = min(quotes.possible(fit, up=True), most.cell)
    if "error" not in asked:
        return fit
    if math.isnan(quotes.pilot.thickness):
        raise InputError(
            f"accuracy.error: no rock fails on the cells of {quotes.pilot.cell:.4g} m that the mine was tried on: no "
            "error is foreseen; ask for a time or a memory, or give grid.finest_cell"
        )
    cell = quotes.largest(lambda one: one.error <= asked["error"] / 100.0)
    if not cell:
        vouched = math.expm1(MIN_ERROR)
        why = (
            f"study openings vouches for no less than {100 * vouched:.1f} %"
            if asked["error"] / 100.0 < vouched
            else f"on cells of {least.cell:.4g} m, the smallest with so many sizes (grid.levels), it is still "
            f"{error_text(least.error)}"
        )
        raise InputError(f"accuracy.error: {asked['error']:g} % is not to be had: {why}")
    cell = max(quotes.possible(cell), least.cell)
    if cell < fit:
        takes, instead = quotes.at(cell), quotes.at(fit)
        free = "" if "memory" in request.given() else " of free memory"
        within = [] if request.time is None else [f"{request.time:g} min"]
        within.append(f"{asked['memory']:,.4g} GB{free}")
        within += [f"{quotes.settings['max_cells']:,} cells (grid.max_cells)"] * quotes.is_truncated(takes)
        raise InputError(
            f"accuracy: an error of {asked['error']:g} % needs cells of {cell:.4g} m, {duration_text(takes.wall)} and "
            f"{takes.memory / 1e9:.1f} GB; within {' and '.join(within)} the error is {error_text(instead.error)}, on "
            f"cells of {fit:.4g} m"
        )
    return cell
