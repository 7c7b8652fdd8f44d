"""Memory that a rule requests (`mem_mb`), from the size of the grid of its stage.

It is a promise to a cluster's scheduler, and what `--resources mem_mb=` shares out; the stages of the mechanics look at
the free memory themselves (mpm_core.stages.stage_memory) before they start. Rules that are not here ask for a round
number: those that hold events but no cells take 0.2 to 0.4 GB for some hundred of them, and the grid's own size is
known when it is made.
"""

import errno
import functools
import os

from mpm_core.stages.stage_memory import stage_bytes
from workflow.mine import Mine

MB = 1e6
COMPILING = 0.6e9  # bytes more while kernels are compiled in several processes, for the first run of a version
LIBRARIES = 0.5e9  # bytes of a stage that reads results: ObsPy or matplotlib and what it imports; 0.35e9 measured
DRAWING = 0.3e9  # bytes more of the report, whose sections are drawn in several processes
GRID = 500.0  # bytes per cell: grid.nc holds 150, read once, and arrays that follow from it
READS = {  # bytes per particle: what a stage reads of a state (240, 80, 480), twice: as stored and as it works on it
    "events": 500.0,
    "report": 300.0,  # two of its sections may work on a state at the same time
    "vtk": 1000.0,
    "baselines": 3000.0,  # the stress of every state, and some flaws for each particle near openings
}


@functools.cache
def _cells(path: str, stamp: float) -> int:
    import netCDF4  # here: nothing else of the workflow needs it

    try:
        with netCDF4.Dataset(path) as dataset:
            return len(dataset.dimensions["cell"])
    except (OSError, KeyError):  # the stage that reads it says what is wrong with it
        return 0


def cells_of(path: str) -> int:
    """Cells of a grid.nc or a state. Raises FileNotFoundError, which tells Snakemake to ask again when there is one."""
    return _cells(str(path), os.stat(path).st_mtime)


def mechanics_mb(mine: Mine, grid: str, elastic: bool) -> int:
    """MB that the elastic stage, or a mining step, needs at its peak on the cells of a grid.nc or a state."""
    cells, settings = cells_of(grid), mine.settings
    particles = cells * settings.grid.particles_per_cell
    needed = stage_bytes(settings.solver.scheme, mine.dimension, cells, particles, elastic, mine.is_adaptive)
    return round((COMPILING + needed) / MB)


def reading_mb(mine: Mine, grid: str, stage: str, results: list[str]) -> int:
    """MB that a stage of READS needs for its `results` on a grid, which may be none of them.

    Raises FileNotFoundError naming the first of them while there is no grid: Snakemake knows its own input only.
    """
    if not os.path.exists(grid):
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(results[0]))
    # states have more cells than the grid where these follow the rock; a catalogue has none
    made = [path for path in results if str(path).endswith(".nc") and os.path.exists(path)]
    cells = max(cells_of(path) for path in (grid, *made))
    particles = cells * mine.settings.grid.particles_per_cell
    libraries = LIBRARIES + (DRAWING if stage == "report" else 0.0)
    return round((libraries + GRID * cells + READS[stage] * particles) / MB)
