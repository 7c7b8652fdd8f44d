"""Slow, obvious twins of the grid code: plain loops and all-pairs comparisons, independent of the builder."""

import itertools
from contextlib import contextmanager
from unittest import mock

import numpy as np
from hypothesis import strategies as st

from mpm_core.grid import build_grid, nodes
from mpm_core.grid.mesh import CORNER_OFFSETS


class Boxes:
    """Excavations that are boxes in fine units, lower <= x < upper: a cell counts if it overlaps one."""

    def __init__(self, boxes, levels: int):
        self.lower, self.upper = np.array([box[0] for box in boxes]), np.array([box[1] for box in boxes])
        self.levels = levels
        self.calls = []

    def __call__(self, level: int, index: np.ndarray) -> np.ndarray:
        self.calls.append((level, index))
        width = 2 ** (self.levels - 1 - level)
        inside = np.zeros(len(index), dtype=bool)
        for lower, upper in zip(self.lower, self.upper, strict=True):
            inside |= ((index * width < upper) & ((index + 1) * width > lower)).all(axis=1)
        return inside


@st.composite
def scenes(draw, dimensions=(2, 3), most_fine_cells=6000):
    """Base shape, levels, boxes and rings of a small random scene."""
    dimension = draw(st.sampled_from(dimensions))
    levels = draw(st.integers(1, 5 if dimension == 2 else 4))
    sides = []
    room = max(1, most_fine_cells >> dimension * (levels - 1))
    for _ in range(dimension):
        sides.append(draw(st.integers(1, min(room, 13))))
        room //= sides[-1]
    shape = np.array(draw(st.permutations(sides)))
    boxes = []
    for _ in range(draw(st.integers(1, 3))):
        lower = [draw(st.integers(0, side * 2 ** (levels - 1) - 1)) for side in shape]
        boxes.append((lower, [start + draw(st.integers(1, 3)) for start in lower]))
    return shape, levels, boxes, draw(st.integers(0, 2))


def build(scene):
    shape, levels, boxes, buffer_cells = scene
    return build_grid(np.zeros(len(shape)), 2.0 ** (levels - 1), shape, levels, Boxes(boxes, levels), buffer_cells)


@contextmanager
def small_blocks(width: int = 4):
    """Blocks of a few cells and a hash table that must grow, so that small grids use both."""
    with mock.patch.dict(nodes.BLOCK_WIDTH, {2: width, 3: width}), mock.patch.object(nodes, "INITIAL_SLOTS", 4):
        yield


def slow_leaves(scene) -> set[tuple]:
    """The leaves as a set of (level, index...): sets of split cells, closed by repetition until nothing changes."""
    shape, levels, boxes, buffer_cells = scene
    dimension = len(shape)
    classify = Boxes(boxes, levels)

    def inside(level, cell):
        return all(0 <= c < side * 2**level for c, side in zip(cell, shape, strict=True))

    def ring(cell, rings):
        return (tuple(np.add(cell, shift)) for shift in itertools.product(range(-rings, rings + 1), repeat=dimension))

    split = [set() for _ in range(levels)]
    for level in range(levels - 1):
        for cell in itertools.product(*(range(side * 2**level) for side in shape)):
            if classify(level, np.array([cell]))[0]:
                split[level] |= {near for near in ring(cell, buffer_cells) if inside(level, near)}
    changed = True
    while changed:
        changed = False
        for level in range(1, levels - 1):
            for cell in split[level]:
                for near in ring(cell, 1):
                    parent = tuple(c // 2 for c in near)
                    if inside(level, near) and parent not in split[level - 1]:
                        split[level - 1].add(parent)
                        changed = True
    found = set()
    for level in range(levels):
        for cell in itertools.product(*(range(side * 2**level) for side in shape)):
            exists = level == 0 or tuple(c // 2 for c in cell) in split[level - 1]
            if exists and cell not in split[level]:
                found.add((level, *cell))
    return found


def cells_as_set(grid) -> set[tuple]:
    index = grid.cell_index // grid.cell_width[:, None]
    return {(int(level), *map(int, cell)) for level, cell in zip(grid.cell_level, index, strict=True)}


def overlap(grid):
    """(cell, cell, d) fine units: how far the closed boxes of each pair of cells overlap; 0 touch, negative apart."""
    lower = grid.cell_index.astype(np.int64)
    upper = lower + grid.cell_width[:, None]
    return np.minimum(upper[:, None], upper) - np.maximum(lower[:, None], lower)


def slow_parents(grid) -> dict[int, set[int]]:
    """Hanging nodes and their parents by definition: every node against the edges and faces of every cell."""
    parents = {}
    dimension = grid.dimension
    node_at = {tuple(place): node for node, place in enumerate(grid.node_index)}
    for lower, width in zip(grid.cell_index, grid.cell_width, strict=True):
        local = grid.node_index - lower
        in_cell = np.flatnonzero(((local >= 0) & (local <= width)).all(axis=1))
        for node in in_cell:
            between = (local[node] > 0) & (local[node] < width)
            if not 0 < between.sum() < dimension:
                continue
            assert (local[node][between] == width // 2).all(), "a node inside an edge or face, but not in its middle"
            steps = itertools.product(*([-1, 1] if free else [0] for free in between))
            ends = {node_at[tuple(grid.node_index[node] + np.array(step) * (width // 2))] for step in steps}
            assert parents.setdefault(node, ends) == ends
    return parents


def interpolate(grid, cell: int, place: np.ndarray, node_value: np.ndarray) -> float:
    """Multilinear interpolation of node values (node,) at a place (d,), fine units, as that cell sees it."""
    local = (place - grid.cell_index[cell]) / grid.cell_width[cell]
    weights = np.prod(np.where(CORNER_OFFSETS[grid.dimension] == 1, local, 1 - local), axis=1)
    return float(weights @ node_value[grid.vtk_nodes[cell]])


def constrain(grid, node_value: np.ndarray) -> np.ndarray:
    """Node values with hanging nodes set to the mean of their parents."""
    value = node_value.copy()
    for node in np.flatnonzero(grid.is_hanging):
        parents = grid.node_parents[node]
        value[node] = node_value[parents[parents >= 0]].mean(axis=0)
    return value
