"""The block with a stope that every code of the equilibrium benchmark solves: nodes, hexahedra, walls, closure.

All codes stand on one mesh of equal cubes, the stope's cells left out. Needs numpy only: the peers run in environments
of their own, from this folder.

A case is the JSON that benchmarks/settings.py writes: `cells` of the block, `stope_lower`, `stope_upper` (first cell
inside, first beyond) along x, y and z; `cell` m; `stress` xx, yy, zz Pa, tension positive; `youngs_modulus` Pa,
`poisson_ratio`; for Coulomb rock `cohesion` Pa, `friction_angle`, `dilation_angle` degrees and `increments`;
`tolerance`; `threads`.
"""

import ctypes
import json
import resource
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

# VTK order of a hexahedron's corners
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
PR_SET_PDEATHSIG = 1  # prctl(2)
# Linear solvers get this share of the tolerance, so that one solution suffices where all is linear.
LINEAR_TOLERANCE_SHARE = 0.5


@dataclass(frozen=True)
class Wall:
    """One of the stope's six walls: faces (face, 4) nodes, rock (face,) cells behind them, traction Pa.

    traction: the force along `axis` and per area by which the stope's rock held the wall up before it was mined.
    """

    axis: int
    side: int
    faces: np.ndarray
    rock: np.ndarray
    traction: float


@dataclass(frozen=True)
class Block:
    """The mesh. Nodes and cells are numbered with z running fastest; what lies inside the stope has no number."""

    case: dict

    @property
    def shape(self) -> np.ndarray:
        """Cells along x, y and z, the stope's included."""
        return np.array(self.case["cells"])

    @property
    def lower(self) -> np.ndarray:
        """Index of the stope's first cell, and of its first node plane."""
        return np.array(self.case["stope_lower"])

    @property
    def upper(self) -> np.ndarray:
        """Index of the first cell beyond the stope, and of its last node plane."""
        return np.array(self.case["stope_upper"])

    @cached_property
    def cells(self) -> np.ndarray:
        """Indices of the cells of rock, (cell, 3)."""
        index = _lattice(self.shape)
        return index[~((index >= self.lower) & (index < self.upper)).all(axis=1)]

    @cached_property
    def nodes(self) -> np.ndarray:
        """Indices of the nodes, (node, 3)."""
        index = _lattice(self.shape + 1)
        return index[~((index > self.lower) & (index < self.upper)).all(axis=1)]

    @property
    def position(self) -> np.ndarray:
        """Places of the nodes, (node, 3) m."""
        return self.nodes * self.case["cell"]

    @cached_property
    def hexahedra(self) -> np.ndarray:
        """Nodes of each cell in VTK order, (cell, 8)."""
        return np.stack([self._node_at(self.cells + corner) for corner in CORNERS], axis=1)

    @cached_property
    def outer(self) -> np.ndarray:
        """Nodes on the block's faces, which are held."""
        return np.flatnonzero(((self.nodes == 0) | (self.nodes == self.shape)).any(axis=1))

    def walls(self) -> Iterator[Wall]:
        """The stope's walls."""
        cell_number = _numbering(self.shape, self.cells)
        for axis in range(3):
            along = [k for k in range(3) if k != axis]
            span = _lattice((self.upper - self.lower)[along]) + self.lower[along]
            for side in range(2):
                corner = np.empty((len(span), 3), int)
                corner[:, along] = span
                corner[:, axis] = (self.lower, self.upper)[side][axis]
                faces = []
                for step in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    place = corner.copy()
                    place[:, along] += step
                    faces.append(self._node_at(place))
                corner[:, axis] -= 1 - side
                rock = cell_number[tuple(corner.T)]
                # stress times the outward normal of the rock behind the wall: +1 at the lower wall, -1 at the upper
                traction = self.case["stress"][axis] * (1 - 2 * side)
                yield Wall(axis, side, np.stack(faces, axis=1), rock, traction)

    def support(self) -> np.ndarray:
        """Forces by which the stope's rock held its walls up, (node, 3) N. Mining takes them away."""
        force = np.zeros((len(self.nodes), 3))
        for wall in self.walls():
            np.add.at(force[:, wall.axis], wall.faces.ravel(), 0.25 * self.case["cell"] ** 2 * wall.traction)
        return force

    @cached_property
    def released(self) -> float:
        """2-norm of these forces, N: what unbalanced forces are measured by, as in our own schemes."""
        return float(np.sqrt(np.sum(self.support() ** 2)))

    def closure(self, displacement: np.ndarray) -> float:
        """Convergence of the side walls along x, mean over their area, m; displacement (node, 3) m."""
        return closure(self.case, self.nodes, displacement)

    def _node_at(self, index: np.ndarray) -> np.ndarray:
        return self._node_number[tuple(index.T)]

    @cached_property
    def _node_number(self) -> np.ndarray:
        return _numbering(self.shape + 1, self.nodes)


def sizes(case: dict) -> dict[str, int]:
    """Cells of rock, and displacements that are solved for: those of nodes neither held nor inside the stope."""
    shape = np.array(case["cells"], dtype=np.int64)
    stope = np.array(case["stope_upper"]) - np.array(case["stope_lower"])
    return {
        "cells": int(shape.prod() - stope.prod()),
        "unknowns": 3 * int((shape - 1).prod() - (stope - 1).prod()),
    }


def closure(case: dict, index: np.ndarray, displacement: np.ndarray) -> float:
    """Convergence of the side walls along x, m, of any code: index (node, 3) of its nodes, displacement (node, 3) m.

    The mean over a wall weights each node by the area that it stands for.
    """
    lower, upper = np.array(case["stope_lower"]), np.array(case["stope_upper"])
    area = ((index[:, 1:] >= lower[1:]) & (index[:, 1:] <= upper[1:])).all(axis=1).astype(float)
    for axis in (1, 2):
        area[(index[:, axis] == lower[axis]) | (index[:, axis] == upper[axis])] *= 0.5
    means = []
    for plane in (lower[0], upper[0]):
        weight = area * (index[:, 0] == plane)
        means.append(np.sum(weight * displacement[:, 0]) / np.sum(weight))
    return float(means[0] - means[1])


def end_with_parent() -> None:
    """Ask Linux to end this process, and what it starts in this way, when the process that started it ends."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def read_case(path: str) -> dict:
    """The case of a JSON file."""
    with open(path) as file:
        return json.load(file)


def announce(**values) -> None:
    """Tell the supervising process in one line of JSON: that a solution begins, or what came of it."""
    print(json.dumps(values), flush=True)


def peak_memory(of: int = resource.RUSAGE_SELF) -> float:
    """GB, of this process (or its ended children) so far."""
    return resource.getrusage(of).ru_maxrss * 1024 / 1e9


def _lattice(shape) -> np.ndarray:
    return np.stack(np.meshgrid(*[np.arange(n) for n in shape], indexing="ij"), axis=-1).reshape(-1, len(shape))


def _numbering(shape: np.ndarray, index: np.ndarray) -> np.ndarray:
    number = np.full(tuple(shape), -1, np.int64)
    number[tuple(index.T)] = np.arange(len(index))
    return number
