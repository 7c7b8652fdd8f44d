"""Memory that a mechanics stage will need, estimated before it starts.

The numbers below were fitted to the peak resident memory of stages of the mines demo and renison_scale.
"""

import logging

import psutil

from common.errors import InputError
from common.free_memory import free_memory
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.scene.scene import Scene

FALLBACK_SCHEME = "multigrid"  # Schemes that were not measured count as this one, which takes the most memory.
BASE_BYTES = {"explicit": 0.35e9, "multigrid": 0.45e9}  # Memory of libraries and compiled kernels.
BYTES_PER_CELL = {"explicit": 1160.0, "multigrid": 1500.0}
BYTES_PER_PARTICLE = 300.0
# The elastic stage has no flow and keeps no differences.
ELASTIC_BYTES_SAVED_PER_CELL = {"explicit": 0.0, "multigrid": 250.0}
MEMORY_REMEDY = "use larger cells (grid.finest_cell, or grid.coarse_cell), fewer grid.particles_per_cell, or free some"
REFINEMENT_MEMORY_FACTOR = 1.65
"""Factor on the memory of a step with adaptive refinement. While cells are split it holds the cells before, too, and a
cell that a wall cuts takes more memory than another."""
CELL_SHARE_2D = 0.6  # Memory of a cell in 2-D over that in 3-D. A cell in 2-D has fewer corners and components.


def stage_bytes(
    scheme: str, dimension: int, cells: int, particles: int, elastic: bool = False, follows: bool = False
) -> float:
    """Peak memory of a stage of the mechanics, bytes; `elastic`: of the elastic history, not of a mining step;
    `follows`: of a step whose cells follow the rock."""
    scheme = scheme if scheme in BASE_BYTES else FALLBACK_SCHEME
    per_cell = BYTES_PER_CELL[scheme] - (ELASTIC_BYTES_SAVED_PER_CELL[scheme] if elastic else 0.0)
    size = cells * per_cell * (CELL_SHARE_2D if dimension == 2 else 1.0) + particles * BYTES_PER_PARTICLE
    return BASE_BYTES[scheme] + size * (REFINEMENT_MEMORY_FACTOR if follows and not elastic else 1.0)


def usable() -> float:
    """Memory that this process may use: what is free now and what it holds already, bytes."""
    return free_memory() + psutil.Process().memory_info().rss


def require(needed: float, what: str, advice: str) -> None:
    """Log what a process will hold at its peak, bytes, and raise InputError if that is more than is usable now."""
    free = usable()
    logging.info("%s: about %.2f GB of memory, %.1f GB are free", what, needed / 1e9, free / 1e9)
    if needed > free:
        raise InputError(
            f"{what}: about {needed / 1e9:.1f} GB of memory are needed, {free / 1e9:.1f} GB are free: {advice}"
        )


def require_cells(scene: Scene, grid: MultiLevelGrid, elastic: bool = False) -> None:
    """Raise InputError if a stage on this grid would not fit into the memory that is usable now."""
    cells, follows = len(grid.cell_level), scene.refinement is not None
    particles = cells * scene.particles_per_cell**grid.dimension  # it counts them along an edge
    needed = stage_bytes(scene.solver.scheme, grid.dimension, cells, particles, elastic, follows)
    require(needed, f"{cells:,} cells", MEMORY_REMEDY)
