"""Cores and memory that rules request.

Memory (`mem_mb`) is a promise to a cluster's scheduler, and what `--resources mem_mb=` shares out. It follows from the
number of cells. The stages of the mechanics look at the free memory themselves (mpm_core.stages.stage_memory) before
they start. Rules that hold events but no cells ask for a round number.
"""

import errno
import functools
import os
from collections.abc import Callable, Iterable

import netCDF4
from snakemake.iocontainers import InputFiles, Wildcards

from common.result_folders import ELASTIC_ROCK
from mpm_core.stages.stage_memory import stage_bytes
from workflow.mine import Mine
from workflow.result_files import ResultFiles

MB = 1e6
COMPILING = 0.6e9  # bytes more while kernels are compiled in several processes, for the first run of a version
LIBRARIES = 0.5e9  # bytes of a stage that reads results: ObsPy or matplotlib and what it imports
DRAWING = 0.3e9  # bytes more of the report, whose sections are drawn in several processes
BYTES_PER_CELL = 500.0  # what a stage that reads results holds of a grid and of arrays that follow from it
BYTES_PER_PARTICLE = {  # what a stage reads of a state, twice: as stored and as it works on it
    "events": 500.0,
    "openings": 700.0,
    "observations": 700.0,
    "loading": 1400.0,  # of two states
    "scans": 700.0,
    "report": 300.0,  # two of its sections may work on a state at the same time
    "vtk": 1000.0,
    "baselines": 3000.0,  # the stress of every state, and some flaws for each particle near openings
}
BYTES_PER_OBSERVATION = 800.0  # of a row of the table of observations, while it is made
BYTES_PER_OBSERVED_POINT = 14_000.0  # while stress is fitted to the particles around it
LARGER_CELLS = 4  # At least so many cells of a mine make one of its companion, whose cells are twice as large.


def by_attempt(megabytes: int) -> Callable[[Wildcards, int], int]:
    """MB of a rule that asks for a round number, more each time that Snakemake starts its job again (`retries`)."""
    return lambda wildcards, attempt: attempt * megabytes


class RuleResources:
    """Cores and memory of the rules of any mine.

    cores: those that Snakemake was given; None on a cluster. Snakemake starts no job while all its cores are taken. So
    a step of a mine with a companion takes one core less of it than it uses, and the companion runs in the time that
    the step leaves (IN_IDLE_TIME).
    """

    def __init__(self, files: ResultFiles, cores: int | None):
        self.files = files
        self.folders = files.folders
        self.cores = cores

    def threads(self, wildcards: Wildcards) -> int:
        """Snakemake's cores for a stage of the mechanics."""
        threads = self.folders.threads(wildcards.mine)
        if self.cores is None or self.cores < 2 or wildcards.mine != self.files.mine.name or not self.files.has_coarse:
            return threads
        return min(threads, self.cores - 1)

    def used_threads(self, wildcards: Wildcards, threads: int) -> int:
        """Threads of a stage of the mechanics; threads: what Snakemake has made of `threads`."""
        wanted = self.folders.threads(wildcards.mine)
        return threads if self.cores is None else min(wanted, max(threads, self.cores))

    def all_cores(self, wildcards: Wildcards) -> int:
        """All cores here, one on a cluster."""
        return self.cores or 1

    def elastic_memory(self, wildcards: Wildcards, input: InputFiles, attempt: int) -> int:
        """MB that the elastic stage needs on the grid."""
        return attempt * mechanics_mb(self.files.mine_of(wildcards), input.grid, elastic=True)

    def step_memory(self, wildcards: Wildcards, input: InputFiles, attempt: int) -> int:
        """MB that a mining step needs on the cells of the step before, and on those that it may add to them."""
        return attempt * mechanics_mb(self.files.mine_of(wildcards), input.state, elastic=False)

    def companion_memory(self, wildcards: Wildcards, input: InputFiles, attempt: int) -> int:
        """MB that the run on cells of twice the size needs, by the cells of the mine."""
        return attempt * mechanics_mb(self.files.mine_of(wildcards), input.cells, elastic=False, share=1 / LARGER_CELLS)

    def trial_memory(self, wildcards: Wildcards, input: InputFiles, attempt: int) -> int:
        """MB that a trial of a calibration needs, if its cells are those of the mine."""
        return attempt * mechanics_mb(self.files.mine, input.cells, elastic=False)

    def baseline_memory(self, wildcards: Wildcards, input: InputFiles, attempt: int) -> int:
        """MB that a stage needs which reads all states of the mine in elastic rock."""
        grid = self.files.own(f"{ELASTIC_ROCK}/grid.nc")
        return attempt * reading_mb(self.files.mine, grid, "baselines", input.states)

    def observation_memory(self, wildcards: Wildcards, input: InputFiles, attempt: int) -> int:
        """MB that the stage of instruments needs: for a state, for the points of long lines, and for its table."""
        mine = self.files.mine
        read = reading_mb(mine, self.files.grid_of_any(wildcards), "observations", input)
        return attempt * (read + round(observation_bytes(mine) / MB))

    def reading_memory(self, stage: str, at_once: int = 1) -> Callable[[Wildcards, InputFiles, int], int]:
        """MB that a stage needs which reads results on the mine's grid, at_once of them at a time."""

        def megabytes(wildcards: Wildcards, input: InputFiles, attempt: int) -> int:
            mine, grid = self.files.mine_of(wildcards), self.files.grid_of_any(wildcards)
            return attempt * reading_mb(mine, grid, stage, input, at_once)

        return megabytes


@functools.cache
def _cells(path: str, stamp: float) -> int:
    try:
        with netCDF4.Dataset(path) as dataset:
            return len(dataset.dimensions["cell"])
    except (OSError, KeyError):  # the stage that reads it says what is wrong with it
        return 0


def cells_of(path: str) -> int:
    """Cells of a grid.nc or a state. Raises FileNotFoundError, which tells Snakemake to ask again when there is one."""
    return _cells(str(path), os.stat(path).st_mtime)


def mechanics_mb(mine: Mine, grid: str, elastic: bool, share: float = 1.0) -> int:
    """MB that the elastic stage, or a mining step, needs at its peak on (a share of) the cells of a grid or a state."""
    cells, settings = round(share * cells_of(grid)), mine.settings
    particles = cells * settings.grid.particles_per_cell
    needed = stage_bytes(settings.solver.scheme, mine.dimension, cells, particles, elastic, mine.is_adaptive)
    return round((COMPILING + needed) / MB)


def observation_bytes(mine: Mine) -> float:
    """Memory of the points and the table of a mine's instruments, beside that of a state."""
    instruments = mine.settings.observations.instruments if mine.settings.observations else []
    points = sum(one.places + 1 for one in instruments)
    rows = sum(one.places * one.components for one in instruments) * len(mine.mined_steps)
    return BYTES_PER_OBSERVATION * rows + BYTES_PER_OBSERVED_POINT * points


def reading_mb(mine: Mine, grid: str, stage: str, results: Iterable[str], at_once: int = 1) -> int:
    """MB that a stage of BYTES_PER_PARTICLE needs for its `results` on a grid, which may be none of them.

    at_once: how many of the results it holds at the same time.

    Raises FileNotFoundError naming one of them while there is no grid: Snakemake knows its own input only.
    """
    datasets = [path for path in map(str, results) if path.endswith(".nc")]
    if not os.path.exists(grid):
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), datasets[0] if datasets else grid)
    # states have more cells than the grid where these follow the rock; a catalogue has none
    cells = max(cells_of(path) for path in (grid, *datasets) if os.path.exists(path))
    particles = cells * mine.settings.grid.particles_per_cell
    libraries = LIBRARIES + (DRAWING if stage == "report" else 0.0)
    held = max(1, min(at_once, len(datasets)))
    return round((libraries + held * (BYTES_PER_CELL * cells + BYTES_PER_PARTICLE[stage] * particles)) / MB)
