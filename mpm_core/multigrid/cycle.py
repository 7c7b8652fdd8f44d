"""The V-cycle: smoothing by Chebyshev polynomials of D^-1 A on every level, a direct solution on the coarsest.

What a smoother must damp is every motion that the next coarser grid cannot show, those of about two cells' length.
The stiffest is the plane compression wave, whose eigenvalue is 1 (Level.set_constants). The slowest is a shear wave,
1 / c = m / (l + 2 m) of it; what holds hourglass patterns is stiffer. A polynomial of degree DEGREE_FACTOR sqrt(c) over
the part 1 / (EIGENVALUE_SPREAD c) to 1 of the spectrum keeps the number of iterations nearly constant.
"""

import math

import numpy as np
from numba import njit

from mpm_core.kernels.operator_rows import PROLONG, RESTRICT, mask, smooth_first, smooth_next, subtract
from mpm_core.multigrid.level import Level
from mpm_core.multigrid.stiff_bodies import StiffBodies
from mpm_core.simd.threads import threads_for

DEGREE_FACTOR = {2: 2.4, 3: 1.2}
"""Degree of the smoother's polynomial over sqrt(c), by dimension."""
EIGENVALUE_SPREAD = 5.0  # The smoother works on eigenvalues down to 1 / (EIGENVALUE_SPREAD c).
MAX_EIGENVALUE = 1.05  # The smoother works on eigenvalues up to this multiple of the largest one of a uniform grid.
FLOW_STIFFNESS_FACTOR = 3.0  # Factor on c where rock flows, which is softer still.
MAX_DIRECT_UNKNOWNS = 400  # Coarsest levels with at most this many unknowns are solved directly.
DIAGONAL_SHIFT = {True: 1e-7, False: 1e-3}
"""Share by which the diagonal of the coarsest level is enlarged, by whether anything holds the body."""
DIAGONAL_SHIFT_DOUBLE = 1e-11  # As DIAGONAL_SHIFT in double precision, in which stiff bodies move freely in soft rock.


def chebyshev(slow: float, dimension: int) -> list[tuple[float, float]]:
    """Steps of the smoother as (keep, factor): step <- keep step + factor D^-1 residual (Saad 2003, section 12.3)."""
    high = MAX_EIGENVALUE
    low = high / (EIGENVALUE_SPREAD * slow)
    centre, half = 0.5 * (high + low), 0.5 * (high - low)
    sigma = centre / half
    rho = 1.0 / sigma
    steps = [(0.0, 1.0 / centre)]
    for _ in range(1, max(2, round(DEGREE_FACTOR[dimension] * math.sqrt(slow)))):
        following = 1.0 / (2.0 * sigma - rho)
        steps.append((following * rho, 2.0 * following / half))
        rho = following
    return steps


@njit(cache=True)
def _factorise(matrix):
    """LU factors, the lower one with a diagonal of 1, in place; no pivoting: the symmetric part is positive."""
    count = len(matrix)
    for j in range(count):
        for i in range(j + 1, count):
            share = matrix[i, j] / matrix[j, j]
            matrix[i, j] = share
            for k in range(j + 1, count):
                matrix[i, k] -= share * matrix[j, k]


@njit(cache=True)
def _solve(factors, free, residual, solution):
    """Solution (element,) of the factorised system at elements `free`, written; 0 elsewhere."""
    count = len(free)
    values = np.empty(count)
    for i in range(count):
        total = np.float64(residual[free[i]])
        for k in range(i):
            total -= factors[i, k] * values[k]
        values[i] = total
    for i in range(count - 1, -1, -1):
        total = values[i]
        for k in range(i + 1, count):
            total -= factors[i, k] * values[k]
        values[i] = total / factors[i, i]
    solution[:] = 0.0
    for i in range(count):
        solution[free[i]] = values[i]


class DirectSolution:
    """The coarsest level, factorised."""

    def __init__(self, level: Level, held: bool):
        self.free = np.flatnonzero(level.inverse_diagonal)
        operator = level.operator.in_precision(np.float64)
        values, forces = operator.zeros(), operator.zeros()
        self.factors = np.empty((len(self.free), len(self.free)))
        for column, element in enumerate(self.free):
            values[:] = 0.0
            values[element] = 1.0
            operator.apply(values, forces)
            self.factors[:, column] = forces[self.free]
        diagonal = np.arange(len(self.free))
        single = level.operator.precision == np.float32
        self.factors[diagonal, diagonal] *= 1.0 + (DIAGONAL_SHIFT[held] if single else DIAGONAL_SHIFT_DOUBLE)
        _factorise(self.factors)

    def solve(self, level: Level) -> None:
        """Solution from residual."""
        _solve(self.factors, self.free, level.residual, level.solution)


class Cycle:
    """One V-cycle over levels, finest first, as a linear map from residual to solution, symmetric if they are."""

    def __init__(self, levels: list[Level], slow: float, held: bool, bodies: StiffBodies | None = None):
        """slow: the largest (l + 2 m) / m of any cell; held: whether anything holds the body; bodies: on the finest
        level, if any."""
        self.levels, self.slow, self.held, self.bodies = levels, slow, held, bodies
        dimension = levels[0].dimension
        self.steps = [(np.float32(keep), np.float32(factor)) for keep, factor in chebyshev(slow, dimension)]
        coarsest = levels[-1]
        few = np.count_nonzero(coarsest.inverse_diagonal) <= MAX_DIRECT_UNKNOWNS
        self.direct = DirectSolution(coarsest, held) if few else None
        if not few:  # too thin to be halved again, hence easy: no wave on it is longer than a few cells
            long = chebyshev(100.0 * slow, dimension)
            self.long_steps = [(np.float32(keep), np.float32(factor)) for keep, factor in long]

    def of_flow(self) -> "Cycle":
        """The V-cycle of the same levels as they are now, with tangents of rock that flows."""
        return Cycle(self.levels, FLOW_STIFFNESS_FACTOR * self.slow, self.held, self.bodies)

    def run(self, index: int = 0) -> None:
        """Solution of level `index` from its residual (0 where D^-1 is 0); the residual is used up."""
        with threads_for(self.levels[index].cells):
            self._run(index)

    def _run(self, index: int) -> None:
        level = self.levels[index]
        if index == len(self.levels) - 1:
            if self.direct:
                self.direct.solve(level)
            else:
                self._smooth(level, self.long_steps)
            return
        coarse, transfer, dimension = self.levels[index + 1], level.transfer, level.dimension
        assert transfer is not None  # only the coarsest level has none
        bodies = None if index else self.bodies
        self._smooth(level, self.steps)
        self._update_residual(level)
        if bodies:
            self._move(bodies, level)
            self._update_residual(level)
        RESTRICT[dimension](
            coarse.siblings.row_node, transfer.link_start, transfer.links, transfer.fine_weights,
            level.residual, coarse.residual,
        )  # fmt: skip
        coarse.operator.collect(coarse.residual)
        mask(coarse.inverse_diagonal, coarse.residual)
        self.run(index + 1)
        coarse.operator.spread(coarse.solution)
        PROLONG[dimension](
            level.siblings.row_node, transfer.parent_start, transfer.parents, level.inverse_diagonal,
            coarse.solution, level.step, level.solution,
        )  # fmt: skip
        if bodies:
            self._update_residual(level)
            self._move(bodies, level)
        self._go_on(level, self.steps)  # the first of them keeps nothing of the step from below

    def _smooth(self, level: Level, steps) -> None:
        """Smooth the error that the residual shows: the solution is written."""
        (_, factor), *following = steps
        smooth_first(level.inverse_diagonal, factor, level.residual, level.step, level.solution)
        self._go_on(level, following)

    def _go_on(self, level: Level, steps) -> None:
        """Subtract the latest step from the residual, then make these steps of the smoother."""
        for keep, factor in steps:
            level.operator.apply(level.step, level.change)
            smooth_next(
                level.inverse_diagonal, keep, factor, level.change, level.residual, level.step, level.solution
            )  # fmt: skip

    def _move(self, bodies: StiffBodies, level: Level) -> None:
        """Take what stiff bodies can of the residual as the latest step."""
        bodies.solve(level.residual, level.step)
        level.solution += level.step

    def _update_residual(self, level: Level) -> None:
        level.operator.apply(level.step, level.change)
        subtract(level.inverse_diagonal, level.change, level.residual)
