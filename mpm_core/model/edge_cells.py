"""The cells at sharp edges of openings, and the angle that rock fills around the edge of each."""

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for

from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.distorted_cells import DistortedCells, corner_offsets
from mpm_core.grid.edge_points import EdgePoints
from mpm_core.grid.mesh import MultiLevelGrid

ANGLE_STEP = np.radians(5.0)  # Angles are rounded to multiples of it: each has rows of its own in a model's tables.
MAX_ANGLE = np.radians(350.0)


def angle_classes(points: EdgePoints) -> np.ndarray:
    """The rounded angles (class,) of edge points, ascending, radians."""
    return np.unique(_rounded(points)) * ANGLE_STEP


def edge_classes(
    points: EdgePoints, grid: MultiLevelGrid, distorted: DistortedCells, classes: np.ndarray
) -> np.ndarray:
    """Class (cell,) of the largest rounded angle at each finest cell next to an edge, of classes (class,); -1 none.

    Next to an edge are the cells around the node that is nearest to it, and around the place in the lattice that is.
    """
    found = np.full(len(grid.cell_level), -1)
    if not len(points.place):
        return found
    number = np.searchsorted(classes, _rounded(points) * ANGLE_STEP - 0.5 * ANGLE_STEP)
    nearest = np.rint(points.place).astype(np.int64)
    offsets = corner_offsets(grid.dimension).astype(np.int64)
    shift = distorted.corners - offsets
    row, corner = np.nonzero(shift.any(axis=2))
    nodes = grid.cell_index[distorted.cell[row]] + offsets[corner]
    around = [nearest]
    if len(nodes):
        distance, node = scipy.spatial.cKDTree(nodes + shift[row, corner]).query(points.place)
        nearer = distance < np.linalg.norm(points.place - nearest, axis=1)
        around.append(np.where(nearer[:, None], nodes[node], nearest))
    for node in around:
        for offset in offsets:
            cell = holding_cells(grid, (node - offset).astype(np.int32))
            there = np.flatnonzero((cell >= 0) & (grid.cell_level[cell] == grid.levels - 1))
            np.maximum.at(found, cell[there], number[there])
    return found


def _rounded(points: EdgePoints) -> np.ndarray:
    return np.rint(np.minimum(points.angle, MAX_ANGLE) / ANGLE_STEP)
