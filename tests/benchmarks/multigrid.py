"""How fast the scheme multigrid's kernels are, and what bounds them: bytes or arithmetic.

Run ``python -m tests.benchmarks.multigrid`` on a quiet machine. The grid is that of tests.benchmarks.grid, a mine on
four levels, 4.2 million cells with one particle each. Required: the elastic operator in float64 at 40 M cells/s on two
cores, return mapping of yielding particles at 5 M/s on one, 1.7 times faster on two threads, hierarchy and stiffness
set up in a third of an elastic solution (see also tests.benchmarks.setup). Medians of alternating turns.

Roofline: a kernel that does F operations on B bytes from memory takes at least F over the processor's speed and B over
the memory's. Both are measured here by plain loops on as many threads. `of memory` and `of arithmetic` are what the
kernel reaches of either; the larger one is its bound. Where both are small it is neither: latency, or instructions that
only move numbers (gathering the rows of eight groups, see simd/lanes.py).
"""

import argparse
import os
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numba
import numpy as np
from numba import njit, parallel_chunksize, prange

from mpm_core.constitutive.coulomb_strength import strength_row
from mpm_core.constitutive.general import make_return_particles
from mpm_core.constitutive.laws import coulomb
from mpm_core.grid import build_grid
from mpm_core.grid.mesh import BIT_ORDER
from mpm_core.kernels.flow_rows import make_add_flow_forces
from mpm_core.model.particles import bending_stiffness
from mpm_core.multigrid.anderson import Anderson
from mpm_core.multigrid.solver import ElasticSolver
from mpm_core.multigrid.stiffness import ElasticCells
from mpm_core.simd.lanes import LANES
from tests.benchmarks.grid import BASE_SHAPE, COARSE_CELL, LEVELS, mine, overlaps_a_box

LAME, SHEAR = 22.8e9, 22.8e9  # Pa: Poisson's ratio 0.25
OPERATOR_OPERATIONS = 190  # additions and multiplications per cell of apply_siblings_3, counted in its source
RETURN_OPERATIONS = 250  # about: eigenvalues, return and rotation of one yielding particle
FLOW_OPERATIONS = RETURN_OPERATIONS + 360  # and, for eight corners, from displacement to strain and back to forces
FLOW_BYTES = 8 * 32 * 3 + 8 * 4 + 12 * 8 + 6 * 8  # at most: displacement and force of eight rows, stresses, tables


@dataclass
class Kernel:
    """Something to time: so many items a call, operations and bytes of memory an item."""

    name: str
    call: Callable[[], object]
    items: int
    operations: float = np.nan
    traffic: float = np.nan
    clock: dict[int, list[float]] = field(default_factory=lambda: {1: [], 2: []})

    def measure(self) -> None:
        """Once on one thread, once on two."""
        for threads in (1, 2):
            numba.set_num_threads(threads)
            start = time.perf_counter()
            self.call()
            self.clock[threads].append(time.perf_counter() - start)

    def seconds(self, threads: int) -> float:
        return statistics.median(self.clock[threads])

    def line(self, speed: dict[int, float], memory: dict[int, float]) -> str:
        rate = {threads: self.items / self.seconds(threads) for threads in (1, 2)}
        text = f"{self.name:34}{rate[1] / 1e6:9.1f}{rate[2] / 1e6:9.1f}{rate[2] / rate[1]:8.2f}"
        if np.isfinite(self.traffic):
            text += f"{self.operations:7.0f}{self.traffic:7.0f}{100 * rate[2] * self.traffic / memory[2]:10.0f} %"
            text += f"{100 * rate[2] * self.operations / speed[2]:12.0f} %"
        return text


@njit(parallel=True)
def scale(source, target):
    for i in prange(len(source)):
        target[i] = 3.0 * source[i]


@njit(parallel=True, fastmath={"contract"})
def multiply_and_add(values, times):
    """32 operations on each value of a part that stays in the first-level cache, `times` over."""
    for part in prange(len(values)):
        for _ in range(times):
            for i in range(values.shape[1]):
                x = values[part, i]
                for _ in range(16):
                    x = x * 0.999 + 0.001
                values[part, i] = x


def machine_limits() -> tuple[dict[int, float], dict[int, float]]:
    """Operations per second (float64) and bytes per second of plain loops, by threads."""
    source, target, small = np.ones(32_000_000), np.ones(32_000_000), np.ones((2, 1024))
    copy = Kernel("copy", lambda: scale(source, target), 2 * source.nbytes)
    sums = Kernel("sums", lambda: multiply_and_add(small, 20_000), 32 * small.size * 20_000)
    for kernel in (copy, sums):
        for _ in range(6):
            kernel.measure()
    return (
        {threads: sums.items / min(sums.clock[threads]) for threads in (1, 2)},
        {threads: copy.items / min(copy.clock[threads]) for threads in (1, 2)},
    )


def scene(base_shape, levels: int):
    """Grid, cells' nodes in bit order, held nodes, stiffness and a load at the mine's walls."""
    lower, upper = mine()
    grid = build_grid(
        (0, 0, 0), COARSE_CELL, base_shape, levels,
        lambda level, index: overlaps_a_box(index, COARSE_CELL / 2**level, lower, upper), 1,
    )  # fmt: skip
    held = np.zeros((len(grid.node_index), 3), bool)
    for axis in range(3):
        for side in range(2):
            held[grid.boundary_nodes(axis, side)] = True
    load = (
        np.random.default_rng(0).normal(0.0, 1e6, held.shape)
        * (overlaps_a_box(grid.node_index, 1.0, lower / grid.fine_cell - 1, upper / grid.fine_cell + 1)[:, None])
    )
    load[held] = 0.0
    return grid, np.ascontiguousarray(grid.vtk_nodes[:, BIT_ORDER[3]]), held, uniform_rock(grid), load


def uniform_rock(grid) -> ElasticCells:
    """One particle per cell, everything intact."""
    size = grid.cell_size
    scale_of = (2.0 / (8.0 * size)) ** 2 * size**3
    constants = np.stack(
        [LAME * scale_of, SHEAR * scale_of, 0.25 * bending_stiffness(LAME, SHEAR) * scale_of, 0.0 * size], axis=1
    )
    none = np.empty(0, np.int64)
    return ElasticCells(constants, none, None, none, np.empty((0, 4, 8)))


def yielding_particles(count: int):
    """Arguments of return_particles, all of which yield; stress is put back before each call."""
    generator = np.random.default_rng(1)
    stress = generator.normal(0.0, 3e6, (count, 6)) - [90e6, 25e6, 20e6, 0, 0, 0]
    rows = np.array([strength_row(20.0, 10.0, 1e6, 0.0)])
    work, strain = np.empty_like(stress), np.zeros((count, 6))
    regions, index = np.zeros(count, np.int8), np.zeros(count, np.int64)
    moduli = np.full(count, LAME), np.full(count, SHEAR)

    return_particles = make_return_particles(coulomb)

    def call():
        work[:] = stress
        return_particles(work, *moduli, rows, index, strain, regions)

    call()
    assert (regions != 0).all()
    return call


def flowing_rock(solver, cell_size, count: int):
    """Forces of failed rock, about `count` cells of one particle whose stress is above their strength throughout."""
    siblings, generator = solver.finest.siblings, np.random.default_rng(3)
    place = siblings.cell_place
    cells = np.argsort(place, kind="stable")[:: max(1, len(place) // count)]
    batch = place[cells] // (8 * LANES)
    trial = generator.normal(0.0, 3e6, (len(cells), 6)) - [90e6, 25e6, 20e6, 0, 0, 0]
    values, forces = (solver.operator.zeros() for _ in range(2))
    arguments = (
        np.searchsorted(batch, siblings.batch_start),
        np.arange(len(cells)),
        siblings.corner_rows(cells),
        0.25 / cell_size[cells],
        np.zeros(len(cells), np.int64),
        np.eye(1, 8),
        values,
        cell_size[cells] ** 3,
        np.zeros(len(cells), np.int64),
        np.array([[LAME, SHEAR]]),
        strength_row(20.0, 10.0, 1e6, 0.0)[None],
        trial.copy(),
        trial,
        forces,
    )

    add_flow_forces = make_add_flow_forces(coulomb, 3)

    def call():
        with parallel_chunksize(1):
            add_flow_forces(*arguments)

    call()
    assert np.count_nonzero(forces) > len(cells)
    return call, len(cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=7, help="turns of which the median is taken")
    repetitions = parser.parse_args().repetitions
    grid, cell_nodes, held, rock, load = scene(BASE_SHAPE, LEVELS)
    cells = len(grid.cell_level)

    solver = ElasticSolver(grid, cell_nodes, held, rock)
    finest, double = solver.finest, solver.operator
    rows = len(double.zeros())
    generator = np.random.default_rng(2)
    values = {precision: generator.standard_normal(rows).astype(precision) for precision in (np.float64, np.float32)}
    forces = {precision: np.zeros(rows, precision) for precision in values}
    unknowns = np.flatnonzero(finest.inverse_diagonal).astype(np.int32)
    anderson = Anderson(unknowns, 6)

    def set_up():
        ElasticSolver(grid, cell_nodes, held, rock)

    def apply(operator, precision):
        return lambda: operator.apply(values[precision], forces[precision])

    def traffic(operator, size):  # displacement read, force read and written, tables, stiffness
        return (size * rows * 3 + operator.places.nbytes + operator.constants.nbytes) / cells

    yielding = 1_000_000
    kernels = [
        Kernel("operator, float64", apply(double, np.float64), cells, OPERATOR_OPERATIONS, traffic(double, 8)),
        Kernel("operator, float32", apply(finest.operator, np.float32), cells, OPERATOR_OPERATIONS / 2,
               traffic(finest.operator, 4)),
        Kernel("one V-cycle", lambda: solver.precondition(values[np.float64], 1.0), cells),
        Kernel("Anderson, one step", lambda: anderson.next_step(values[np.float64], values[np.float32], 1.0,
               forces[np.float64]), cells, 4 * 6 * 3, len(unknowns) / cells * (6 * 4 * 3 + 8 * 10)),
        Kernel("return mapping, all yield", yielding_particles(yielding), yielding, RETURN_OPERATIONS, 6 * 8 * 6 + 41),
        Kernel("forces of failed rock, all yields", *flowing_rock(solver, grid.cell_size, yielding), FLOW_OPERATIONS,
               FLOW_BYTES),
        Kernel("elastic solution to 1e-6", lambda: solver.solve(load, 1e-6, 100), cells),
        Kernel("set-up of hierarchy and stiffness", set_up, cells),
    ]  # fmt: skip
    solution = solver.solve(load, 1e-6, 100)
    for kernel in kernels:
        kernel.call()  # compiled, in memory
    print(f"{cells:,} cells, {grid.cells_per_level.tolist()}; {solution.iterations} iterations to 1e-6")
    print("load before:", *(f"{value:.1f}" for value in os.getloadavg()))
    for _ in range(repetitions):
        for kernel in kernels:
            kernel.measure()
    speed, memory = machine_limits()
    print("load after: ", *(f"{value:.1f}" for value in os.getloadavg()))
    for threads in (1, 2):
        print(f"plain loops, {threads} threads: {speed[threads] / 1e9:.1f} G operations/s, ", end="")
        print(f"{memory[threads] / 1e9:.1f} GB/s")
    print(
        f"\n{'':34}{'M/s on 1':>9}{'on 2':>9}{'2 : 1':>8}{'ops':>7}{'bytes':>7}{'of memory':>12}{'of arithmetic':>14}"
    )
    for kernel in kernels:
        print(kernel.line(speed, memory))
    share = kernels[-1].seconds(2) / kernels[-2].seconds(2)
    print(f"\nset-up over solution, two threads: {share:.2f}")


if __name__ == "__main__":
    main()
