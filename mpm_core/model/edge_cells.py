"""The kinds of sharp edges of openings, and the cells at edges of each kind."""

from typing import NamedTuple

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for

from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.distorted_cells import DistortedCells, corner_offsets
from mpm_core.grid.edge_points import EdgePoints
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.model.edge_factor import PATCH, PATCH_OF_SHARED_NODES, edge_factor

ANGLE_STEP = np.radians(5.0)  # Angles are rounded to multiples of it: each has rows of its own in a model's tables.
MAX_ANGLE = np.radians(350.0)


class EdgeKinds(NamedTuple):
    """Kinds of edges: code (kind,) ascending, see _codes; angle (kind,) that rock fills, rounded, radians;
    shares_nodes (kind,) bool: see EdgePoints."""

    code: np.ndarray
    angle: np.ndarray
    shares_nodes: np.ndarray

    @classmethod
    def of(cls, points: EdgePoints) -> "EdgeKinds":
        """Kinds that occur among these points, each once."""
        code = np.unique(_codes(points))
        return cls(code, code // 2 * ANGLE_STEP, code % 2 == 1)

    def factors(self, poisson_ratios: list[float]) -> np.ndarray:
        """Factor (kind, k) on the stiffness of rock with these Poisson's ratios (k,) around edges of each kind."""
        patch = np.where(self.shares_nodes, PATCH_OF_SHARED_NODES, PATCH).tolist()
        factors = [
            [edge_factor(angle, nu, cells) for nu in poisson_ratios]
            for angle, cells in zip(self.angle.tolist(), patch, strict=True)
        ]
        return np.array(factors).reshape(len(patch), len(poisson_ratios))


def kinds_at_cells(points: EdgePoints, grid: MultiLevelGrid, distorted: DistortedCells, kinds: EdgeKinds) -> np.ndarray:
    """Kind (cell,) of the edge next to each finest cell, of these kinds; -1 none.

    Of several edges, the one of the largest angle counts, and of equal angles one that shares nodes: the softer rock.
    Next to an edge are the cells around the node that is nearest to it, and around the place in the lattice that is.
    """
    found = np.full(len(grid.cell_level), -1)
    if not len(points.place):
        return found
    number = np.searchsorted(kinds.code, _codes(points))
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


def _codes(points: EdgePoints) -> np.ndarray:
    """Code (k,) of each point's kind: twice the steps of its angle, and one more where nodes are shared."""
    return 2 * np.rint(np.minimum(points.angle, MAX_ANGLE) / ANGLE_STEP).astype(np.int64) + points.shares_nodes
