"""The same scenes in discretize.TreeMesh, an independent octree: same cells, nodes and hanging nodes.

TreeMesh builds powers of two only; with diagonal_balance it balances over faces, edges and corners as we do.
"""

import numpy as np
import pytest
from discretize import TreeMesh
from slow_grid import Boxes, cells_as_set

from mpm_core.grid import build_grid

SCENES = [
    ((8, 8), 4, [((20, 30), (25, 31)), ((50, 3), (51, 18))]),
    ((16, 16), 3, [((0, 0), (1, 1)), ((40, 63), (64, 64))]),
    ((4, 4, 4), 4, [((7, 9, 15), (12, 10, 16)), ((30, 1, 1), (31, 2, 9))]),
    ((8, 8, 8), 2, [((5, 5, 5), (6, 11, 6))]),
]


@pytest.mark.parametrize(("shape", "levels", "boxes"), SCENES)
@pytest.mark.parametrize("rings", [0, 1])
def test_cells_nodes_and_hanging_nodes_are_those_of_treemesh(shape, levels, boxes, rings):
    classify = Boxes(boxes, levels)
    grid = build_grid(np.zeros(len(shape)), 2.0 ** (levels - 1), shape, levels, classify, rings)
    mesh = TreeMesh([np.ones(side) for side in grid.shape], diagonal_balance=True)
    base_level = mesh.max_level - (levels - 1)
    mesh.refine(base_level, finalize=False)

    def wanted(cell):
        """One level finer where a cell of the ring around this one is crossed."""
        level = cell._level - base_level
        if not 0 <= level < levels - 1:
            return base_level
        index = np.rint(np.asarray(cell.origin) / cell.h[0]).astype(int)
        around = np.stack(np.meshgrid(*[np.arange(-rings, rings + 1)] * len(shape)), axis=-1).reshape(-1, len(shape))
        near = index + around
        near = near[((near >= 0) & (near < np.array(shape) * 2**level)).all(axis=1)]
        return cell._level + int(classify(level, near).any())

    mesh.refine(wanted)
    theirs = np.rint(mesh.cell_centers / mesh.h_gridded - 0.5).astype(int)
    levels_theirs = np.rint(levels - 1 - np.log2(mesh.h_gridded[:, 0])).astype(int)
    assert cells_as_set(grid) == {
        (int(level), *map(int, cell)) for level, cell in zip(levels_theirs, theirs, strict=True)
    }
    assert len(grid.node_index) == mesh.n_total_nodes
    ours = {tuple(place) for place in grid.node_index[grid.is_hanging].tolist()}
    assert ours == {tuple(place) for place in np.rint(mesh.hanging_nodes).astype(int).tolist()}
