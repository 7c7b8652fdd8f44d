"""Multi-level grid: cells that are small near excavations, 2:1 balanced, with constraints at hanging nodes (paper,
sections 2.1 and 2.2.1; docs/explanation/method.md)."""

from mpm_core.grid.adjacency import face_neighbors
from mpm_core.grid.building import GridCount, GridMemory, build_grid, count_cells, estimate_memory
from mpm_core.grid.mesh import CORNER_OFFSETS, MultiLevelGrid
from mpm_core.grid.nodes import number_nodes
from mpm_core.grid.octree import refine

__all__ = [
    "CORNER_OFFSETS",
    "GridCount",
    "GridMemory",
    "MultiLevelGrid",
    "build_grid",
    "count_cells",
    "estimate_memory",
    "face_neighbors",
    "number_nodes",
    "refine",
]
