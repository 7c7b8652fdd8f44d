"""Elastic displacement under nodal forces: conjugate gradients in double precision, a V-cycle in single precision."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.kernels.operator_rows import (
    add_scaled,
    gather_rows,
    mask,
    product,
    scale_residual,
    scatter_rows,
    turn_direction,
)
from mpm_core.model.model import Model
from mpm_core.multigrid.flow_forces import FlowForces, drop_tangents, set_tangents
from mpm_core.multigrid.hierarchy import Hierarchy
from mpm_core.multigrid.level import Operator
from mpm_core.multigrid.stiffness import ElasticCells


@dataclass(frozen=True)
class Solution:
    """Displacement (element,) m, what is left of the force (2-norm over that at the start), and iterations taken."""

    displacement: np.ndarray
    ratio: float
    iterations: int


class ElasticSolver:
    """Solves C^T K C u = f on a multi-level grid with held nodes, for one stiffness.

    Vectors between its methods are flat nodal arrays of rows (multigrid.siblings), float64.
    """

    def __init__(
        self,
        grid: MultiLevelGrid,
        cell_nodes: np.ndarray,
        held: np.ndarray,
        cells: ElasticCells,
        free: Sequence[np.ndarray] = (),
    ):
        """cell_nodes (cell, 2^d) in bit order; held (node, d) bool; free: rigid motions (node, d) that the held nodes
        leave, the operator's null space."""
        self.hierarchy = Hierarchy(grid, cell_nodes, held)
        self.finest = self.hierarchy.levels[0]
        self.operator = Operator(self.finest.siblings, grid.dimension, np.float64)
        self.operator.set_cells(cells)
        self.cycle = self.elastic_cycle = self.hierarchy.set_stiffness(cells, self.operator, not len(free))
        self.rigid = self._orthonormal(free)

    def set_tangents(self, model: Model, flow: FlowForces, displacement: np.ndarray) -> None:
        """Let the V-cycle be that of rock as it flows at this displacement, copies filled in, until `drop_tangents`."""
        set_tangents(self.hierarchy.levels, model, flow, displacement)
        self.cycle = self.elastic_cycle.of_flow()

    def drop_tangents(self) -> None:
        """Make the V-cycle elastic again."""
        drop_tangents(self.hierarchy.levels)
        self.cycle = self.elastic_cycle

    def to_rows(self, values: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """Values at nodes (node, d) as a flat array; 0 on copies, held components and where nothing is attached.

        rows: the array to write, a new one without it.
        """
        rows = self.operator.zeros() if rows is None else rows
        gather_rows(self.finest.siblings.row_node, self.finest.inverse_diagonal, self.operator.width, values, rows)
        return rows

    def to_nodes(self, rows: np.ndarray, values: np.ndarray) -> None:
        """Write values at nodes (node, d), hanging ones too, from a flat array, whose copies are filled in."""
        self.operator.spread(rows)
        scatter_rows(self.finest.siblings.node_row, self.operator.width, rows, values)

    def precondition(self, residual: np.ndarray, size: float) -> np.ndarray:
        """One V-cycle: the solution (float32, an array of the finest level) times `size` approximates A^-1 residual.

        size: the residual's 2-norm, by which it is scaled for single precision.
        """
        scale_residual(self.finest.inverse_diagonal, 1.0 / size, residual, self.finest.residual)
        self.cycle.run()
        self.project(self.finest.solution)
        return self.finest.solution

    def project(self, values: np.ndarray) -> None:
        """Remove the rigid motions that nothing holds from a flat array, in place."""
        for motion in self.rigid:
            add_scaled(-product(motion, values), motion, values)

    def solve(
        self,
        force: np.ndarray,
        tolerance: float,
        most_iterations: int,
        progress: Callable[[float], None] = lambda ratio: None,
    ) -> Solution:
        """Displacement under nodal forces (node, d) N at free nodes, to a residual of tolerance times the force.

        progress receives the ratio after every iteration. Conjugate gradients (Saad 2003, alg. 9.1); a ratio above
        the tolerance says that it has not been reached.
        """
        residual = self.to_rows(force)
        self.project(residual)
        whole = np.sqrt(product(residual, residual))
        displacement, direction, change = (self.operator.zeros() for _ in range(3))
        ratio, before, iterations = (1.0 if whole > 0.0 else 0.0), 0.0, 0
        while ratio > tolerance and iterations < most_iterations:
            solution = self.precondition(residual, ratio * whole)
            now = ratio * whole * product(residual, solution)
            keep = now / before if before else 0.0
            turn_direction(self.finest.inverse_diagonal, ratio * whole, solution, keep, direction)
            self.operator.apply(direction, change)
            mask(self.finest.inverse_diagonal, change)
            step = now / product(direction, change)
            add_scaled(step, direction, displacement)
            add_scaled(-step, change, residual)
            before = now
            iterations += 1
            ratio = float(np.sqrt(product(residual, residual)) / whole)
            progress(ratio)
            if not np.isfinite(ratio):
                break
        return Solution(displacement, ratio, iterations)

    def _orthonormal(self, motions: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Motions (node, d) as orthonormal flat arrays."""
        found: list[np.ndarray] = []
        for motion in motions:
            rows = self.to_rows(motion)
            for _ in range(2):  # once more against round-off
                for other in found:
                    add_scaled(-product(other, rows), other, rows)
            found.append(rows / np.sqrt(product(rows, rows)))
        return found
