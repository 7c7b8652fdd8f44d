"""The multi-level grid: its arrays and what they mean. Corner, edge and face numbering is defined here, once.

Files and this package have VTK's order, `vtk_nodes`. The mechanics has bit order, `cell_nodes`: bit k of a corner's
place says on which side of axis k it lies (BIT_ORDER). Hexahedron (VTK) and, in 2-D, quadrilateral: corners 0 1 2 3
with the grid's own two axes::

             7----------6
            /|         /|                 3--------2
           / |        / |                 |        |
          4----------5  |     z           |        |     y
          |  3-------|--2     | y         |        |     |
          | /        | /      |/          0--------1     +-- x
          |/         |/       +-- x
          0----------1
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

CORNER_OFFSETS = {
    2: np.array([[0, 0], [1, 0], [1, 1], [0, 1]]),
    3: np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]),
}
"""by dimension: (2^d, d) offset of each corner from the cell's lower corner, in cells"""

BIT_ORDER = {2: [0, 1, 3, 2], 3: [0, 1, 3, 2, 4, 5, 7, 6]}
"""by dimension: VTK corner at each bit-ordered place, and the other way round: cell_nodes = vtk_nodes[:, BIT_ORDER[d]]
"""

EDGE_CORNERS = {
    2: np.array([[0, 1], [3, 2], [0, 3], [1, 2]]),
    3: np.array(
        [[0, 1], [3, 2], [4, 5], [7, 6], [0, 3], [1, 2], [4, 7], [5, 6], [0, 4], [1, 5], [2, 6], [3, 7]],
    ),
}
"""by dimension: (edge, 2) the corners at an edge's ends, lower one first: cells that share an edge name its ends
alike"""

FACE_CORNERS = {
    2: np.empty((0, 2), dtype=np.int64),
    3: np.array([[0, 3, 7, 4], [1, 2, 6, 5], [0, 1, 5, 4], [3, 2, 6, 7], [0, 1, 2, 3], [4, 5, 6, 7]]),
}
"""by dimension: (face, 4) the corners of a face, starting from its lowest; none in 2-D, where only edges can hang"""


@dataclass(frozen=True)
class MultiLevelGrid:
    """Square or cubic cells of several sizes that tile a box, 2:1 balanced over faces, edges and corners.

    A subdomain (stages/step_subdomain.py) tiles some of the box's base cells only, and is held still where the box goes
    on.

    Arrays in "fine units" count finest cells from the lower corner of the domain: exact, and the basis of every
    comparison.
    """

    origin: np.ndarray
    """(d,) float64, m: lower corner of the domain"""
    fine_cell: float
    """m: edge of a finest cell"""
    levels: int
    """number of levels; 0 is the coarsest, levels - 1 the finest"""
    shape: np.ndarray
    """(d,) int64, fine units: size of the domain"""
    cell_index: np.ndarray
    """(cell, d) int32, fine units: lower corner, in Morton order (x fastest); sibling leaves are contiguous"""
    cell_level: np.ndarray
    """(cell,) int8: 0 coarsest"""
    vtk_nodes: np.ndarray
    """(cell, 2^d) int32: nodes at the corners, in the order drawn above"""
    node_index: np.ndarray
    """(node, d) int32, fine units; numbered as the cells first touch them, so that neighbours in space are near in
    memory"""
    node_parents: np.ndarray
    """(node, 2^(d-1)) int32, -1 padded: a hanging node moves with the mean of its parents, 2 (middle of a coarser
    cell's edge, weight 1/2) or 4 (middle of its face, weight 1/4); parents never hang"""
    phantoms: int = 0
    """how many of the last nodes stand where another does, see model/phantom_nodes.py"""

    @property
    def dimension(self) -> int:
        """2 or 3"""
        return len(self.shape)

    @property
    def cell_width(self) -> np.ndarray:
        """(cell,) int32, fine units: edge of each cell"""
        return np.int32(1) << (self.levels - 1 - self.cell_level).astype(np.int32)

    @cached_property
    def cell_size(self) -> np.ndarray:
        """(cell,) float64, m: edge of each cell"""
        return self.cell_width * self.fine_cell

    @property
    def cell_origin(self) -> np.ndarray:
        """(cell, d) float64, m: lower corner"""
        return self.origin + self.cell_index * self.fine_cell

    @property
    def cell_center(self) -> np.ndarray:
        """(cell, d) float64, m"""
        return self.centers(slice(None))

    def centers(self, cells: np.ndarray | slice) -> np.ndarray:
        """(k, d) float64, m: middle of some cells (k,)"""
        return self.origin + (self.cell_index[cells] + 0.5 * self.cell_width[cells, None]) * self.fine_cell

    @property
    def node_position(self) -> np.ndarray:
        """(node, d) float64, m"""
        return self.origin + self.node_index * self.fine_cell

    @property
    def is_hanging(self) -> np.ndarray:
        """(node,) bool"""
        return self.node_parents[:, 0] >= 0

    @cached_property
    def present(self) -> np.ndarray:
        """Base cells that the grid has, (base cells along each axis) bool: all of them except in a subdomain."""
        found = np.zeros(self.shape >> self.levels - 1, bool)
        found[tuple((self.cell_index >> self.levels - 1).T)] = True
        return found

    @property
    def cells_per_level(self) -> np.ndarray:
        """Number of cells of each level, (levels,) int64."""
        return np.bincount(self.cell_level, minlength=self.levels)

    def boundary_nodes(self, axis: int, side: int) -> np.ndarray:
        """(node,) bool: nodes on the lower (side 0) or upper (side 1) face of the domain across an axis."""
        if not 0 <= axis < self.dimension or side not in (0, 1):
            raise ValueError(f"axis {axis}, side {side}: an axis below {self.dimension} and side 0 or 1 are expected")
        return self.node_index[:, axis] == side * self.shape[axis]

    def border_nodes(self) -> np.ndarray:
        """Nodes (node,) bool of faces where a subdomain's grid ends inside the domain; none in a whole mine."""
        result = np.zeros(len(self.node_index), bool)
        if self.present.all():
            return result
        corners = CORNER_OFFSETS[self.dimension]
        for axis in range(self.dimension):
            for side in range(2):
                beyond = self.cell_index.copy()
                beyond[:, axis] += self.cell_width if side else -1
                inside = (beyond[:, axis] >= 0) & (beyond[:, axis] < self.shape[axis])
                beyond[~inside] = self.cell_index[~inside]
                ends = ~self.present[tuple((beyond >> self.levels - 1).T)]
                result[self.vtk_nodes[np.ix_(ends, corners[:, axis] == side)]] = True
        return result
