"""What a mine will cost on cells of a size, and how wrong they leave it: the price before the run.

A pilot on larger cells shows what the first steps take (workflow.pilot). From there:

- The cells of the grid are counted. Of those that steps add, the finest lie around failed rock: with cells of half the
  size there are 2^FINEST_ORDER times as many. The coarser ones surround these and what is mined: there are
  2^COARSER_ORDER times as many. Each later step adds LATER_SHARE of what the first dated one adds.
- Failure spreads cell by cell, so a step takes more cycles on smaller cells: 2^CYCLES_ORDER times as many with half the
  size. A cycle takes time as cells^CELLS_ORDER, since many cells no longer stay in the cache. Other stages take time in
  proportion to their cells.
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
from mpm_core.stages.grid_stage import cells_at_start
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
SIZES = {2.0: "twice as large", 1.0: "as in the file", 0.5: "half as large"}
PRESET_OF = {2.0: "draft", 1.0: "standard", 0.5: "fine"}
MIN_SIZE, MAX_SIZE = 1.0 / 64.0, 64.0  # finest cells that are looked for, over those of the file
HALVINGS = 40  # of the search for a size
MAX_NAMED = 3  # openings that one line names


@dataclass(frozen=True)
class Quote:
    """A run of a mine as it is foreseen on finest cells of a size.

    cell m; start, end: cells of the grid, and after the last step; memory: bytes at the peak; processor, wall: time of
    the whole run, s, its companion and its ensemble included, without compiling; error: of potency and failed volume,
    a share; NaN where no rock fails, infinite where too little of it is shown.
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
    """Settings of a quote: pilots, grids on cells of the sizes SIZES, and what costs depend on besides."""
    settings, across = mine.settings, across_of(mine)
    grids = {}
    for size in SIZES:
        levels = settings.grid.levels - round(math.log2(size))
        if 1 <= levels <= MAX_LEVELS:
            grid = mine.grid_slice()
            grids[str(mine.finest_cell * size)] = grid | {"grid": grid["grid"] | {"levels": levels}}
    return {
        "name": mine.name,
        "cell": mine.finest_cell,
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
                "grid.levels: all cells are of one size, and the mine cannot be tried on larger ones; use "
                "grid.levels: 2 or more"
            )
        self.settings, self.cores = settings, cores
        self.cells = {float(cell): cells_at_start(grid) for cell, grid in settings["grids"].items()}
        self.pilot = pilot_of(settings["name"], settings["pilots"], self.cells[settings["cell"]], code, cores)
        self.cells[self.pilot.cell] = self.pilot.start

    def cells_at(self, cell: float) -> float:
        """Cells of the grid with finest cells of a size (m): a power of the size between those that were counted."""
        sizes = np.log(sorted(self.cells))
        numbers = np.log([self.cells[size] for size in sorted(self.cells)])
        place = int(np.clip(np.searchsorted(sizes, math.log(cell)) - 1, 0, len(sizes) - 2))
        slope = (numbers[place + 1] - numbers[place]) / (sizes[place + 1] - sizes[place])
        return math.exp(numbers[place] + slope * (math.log(cell) - sizes[place]))

    def at(self, cell: float) -> Quote:
        """The quote on finest cells of a size (m)."""
        settings = self.settings
        own, steps, end = self._costs(cell)
        whole = own + REPORT_SECONDS + settings["members"] * steps
        if settings["companion"]:
            whole += self._costs(2.0 * cell)[0]
        alone = own * (SERIAL_SHARE + (1.0 - SERIAL_SHARE) / self.cores)
        particles = end * settings["particles_per_cell"]
        memory = stage_bytes(settings["scheme"], settings["dimension"], end, particles, follows=settings["follows"])
        law = error_at(self.pilot.thickness / cell * (cell / self.pilot.cell) ** THICKNESS_ORDER)
        error = math.inf if law > MAX_ERROR else math.expm1(law)
        return Quote(cell, round(self.cells_at(cell)), end, memory, whole, max(alone, whole / self.cores), error)

    def _costs(self, cell: float) -> tuple[float, float, int]:
        """Processor time of grid, elastic equilibrium and all steps, s, of the steps alone, and cells at the end."""
        pilot, finer = self.pilot, self.pilot.cell / cell
        before, start = (pilot.start, pilot.start_finest), self.cells_at(cell)
        cells = start
        steps = seconds = added = 0.0
        for step in pilot.steps:
            more, finest = step.cells - before[0], step.finest - before[1]
            added = finest * finer**FINEST_ORDER + (more - finest) * finer**COARSER_ORDER
            before = step.cells, step.finest
            cells += added
            seconds = step.seconds * (cells / step.cells) ** CELLS_ORDER * finer**CYCLES_ORDER
            steps += seconds
        for _ in range(self.settings["steps"] - len(pilot.steps)):
            seconds *= (1.0 + LATER_SHARE * added / cells) ** CELLS_ORDER
            cells += LATER_SHARE * added
            steps += seconds
        return (pilot.grid + pilot.elastic) * start / pilot.start + steps, steps, round(cells)

    def half(self, one: Quote) -> Quote | None:
        """The quote on the largest cells with half of the error of another; None where study openings vouches for no
        such error, or no error is known."""
        cell = self.largest(lambda other: other.error <= 0.5 * one.error) if math.isfinite(one.error) else 0.0
        return self.at(cell) if cell else None

    def narrow(self, cell: float) -> list[str]:
        """Openings that are narrow for cells of a size (m), the narrowest first, as text."""
        found = {name: Across(width / cell, needed) for name, (width, needed) in self.settings["across"].items()}
        narrow = sorted((name for name in found if found[name].is_narrow()), key=lambda name: found[name].cells)
        return [f"{name} ({found[name].cells:.1f} cells across, of {found[name].needed})" for name in narrow]

    def largest(self, suits: Callable[[Quote], bool]) -> float:
        """The largest finest cells (m) that suit, and all smaller ones do; 0 if none do."""
        return self._bisect(suits, MIN_SIZE, MAX_SIZE)

    def smallest(self, suits: Callable[[Quote], bool]) -> float:
        """The smallest finest cells (m) that suit, and all larger ones do; infinite if none do."""
        return self._bisect(suits, MAX_SIZE, MIN_SIZE) or math.inf

    def _bisect(self, suits: Callable[[Quote], bool], good: float, bad: float) -> float:
        own = self.settings["cell"]
        if not suits(self.at(own * good)):
            return 0.0
        for _ in range(HALVINGS):
            middle = math.sqrt(good * bad)
            good, bad = (middle, bad) if suits(self.at(own * middle)) else (good, middle)
        return own * good


def text_of(quotes: Quotes) -> str:
    """The quotes of a mine on cells of the sizes SIZES as lines of text."""
    settings, pilot = quotes.settings, quotes.pilot
    rows = [
        ("finest cells", "", "cells at the start", "at the end", "memory", "processor time", "by the clock", "error")
    ]
    for size, title in SIZES.items():
        cell = settings["cell"] * size
        if str(cell) not in settings["grids"]:
            continue
        one = quotes.at(cell)
        preset = f" ({PRESET_OF[size]})" if settings["accuracy"] == PRESET_OF[1.0] else ""
        rows.append(
            (
                title + preset, f"{cell:.3g} m", f"{one.start:,}", f"{one.end:,}", f"{one.memory / 1e9:.1f} GB",
                duration_text(one.processor), duration_text(one.wall), error_text(one.error),
            )
        )  # fmt: skip
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    tried = " and ".join(step.name for step in pilot.steps) or "elastic equilibrium"
    lines = [
        f"{settings['name']}: what it takes on this machine with {quotes.cores} core{'s' * (quotes.cores > 1)}, by "
        f"{tried} on cells of {pilot.cell:.3g} m. The error is that of potency and of failed volume.",
        *("  ".join(part.rjust(width) for part, width in zip(row, widths, strict=True)) for row in rows),
    ]
    free = usable()
    if quotes.at(settings["cell"]).memory > free:
        fits = quotes.smallest(lambda one: one.memory <= free)
        which = f"cells of {_rounded(fits, up=True):g} m fit" if math.isfinite(fits) else "no cells fit"
        lines.append(f"{free / 1e9:.1f} GB of memory are free: {which}")
    if narrow := quotes.narrow(settings["cell"]):
        more = f" and {len(narrow) - MAX_NAMED} more" if len(narrow) > MAX_NAMED else ""
        lines.append(
            f"too little rock fails around openings that are narrow for the file's cells, whatever the error above: "
            f"{', '.join(narrow[:MAX_NAMED])}{more}"
        )
    return "\n".join(lines) + "\n"


def error_text(error: float) -> str:
    """An error as a quote states it."""
    if math.isnan(error):
        return "no rock fails"
    return f"{100 * error:.0f} %" if math.isfinite(error) else "too large to say"


def _rounded(cell: float, up: bool = False) -> float:
    """A size with two significant digits, rounded up or down."""
    unit = 10.0 ** (math.floor(math.log10(cell)) - 1)
    return (math.ceil(cell / unit - 1e-9) if up else math.floor(cell / unit + 1e-9)) * unit


def choose(quotes: Quotes, request: AccuracyRequest, doubled: bool) -> float:
    """Finest cells (m) that a request asks for. doubled: only those of the file, doubled or halved. Without a memory
    in the request, that which is free counts.

    Raises InputError, one line that says what can be had, where there are none.
    """
    asked = {"memory": usable() / 1e9} | request.given()
    limits: dict[str, Callable[[Quote], bool]] = {
        "time": lambda one: one.wall <= asked["time"] * 60.0,
        "memory": lambda one: one.memory <= asked["memory"] * 1e9,
    }
    fit = max(quotes.smallest(limits[key]) for key in limits.keys() & asked.keys())
    own = quotes.settings["cell"]
    if fit == math.inf:
        least = quotes.at(own * MAX_SIZE)
        raise InputError(
            f"accuracy: not to be had: on cells of {least.cell:.3g} m it still takes {duration_text(least.wall)} and "
            f"{least.memory / 1e9:.1f} GB"
        )
    if "error" not in asked:
        return own * 2.0 ** math.ceil(math.log2(fit / own) - 1e-9) if doubled else _rounded(fit, up=True)
    if math.isnan(quotes.pilot.thickness):
        raise InputError(
            f"accuracy.error: no rock fails on the cells of {quotes.pilot.cell:.3g} m that the mine was tried on: no "
            "error is foreseen; ask for a time or a memory, or give grid.finest_cell"
        )
    cell = quotes.largest(lambda one: one.error <= asked["error"] / 100.0)
    if not cell:
        raise InputError(
            f"accuracy.error: {asked['error']:g} % is not to be had: study openings vouches for no less than "
            f"{100 * math.expm1(MIN_ERROR):.1f} %"
        )
    cell = own * 2.0 ** math.floor(math.log2(cell / own) + 1e-9) if doubled else _rounded(cell)
    if cell < fit:
        takes, instead = quotes.at(cell), quotes.at(fit)
        raise InputError(
            f"accuracy: an error of {asked['error']:g} % needs cells of {cell:.3g} m, {duration_text(takes.wall)} and "
            f"{takes.memory / 1e9:.1f} GB; within the limits the error is {error_text(instead.error)}, on cells of "
            f"{_rounded(fit, up=True):g} m"
        )
    return cell
