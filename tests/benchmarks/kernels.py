"""How fast the explicit steps are.

Run ``python -m tests.benchmarks.kernels`` on a quiet machine (the load is printed: with others at work clock times mean
little, CPU times more). float64, 8 particles per cell, 3-D. Required: 10 M particle-steps per CPU-second elastic on one
thread, 5 M with Coulomb while a tenth of the particles yields; 1.7 times faster on two threads, same bits. Rates are
medians of alternating turns.

The state is a slow uniform compression along y of rock so heavy (mass times 1e12) that forces cannot change its
velocity: every step costs what any step costs. Virgin stress is that of the paper's Table 2 at 1000 m.

  elastic   no particle has failed: the cost of intact rock, which fails between relaxations only (cascade.py)
  Coulomb   all particles have failed, so all are compared with residual strength in every step. A tenth, at random
            (the worst case for a processor's branch prediction), carry 70 MPa along y and yield in each step; the
            others stay below strength by a sixth. The share that yielded in the last step is printed.

Bytes are those of the arrays that a step passes through, once per pass; the copy speed of one thread stands beside.
"""

import os

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # before numba: waiting threads would count as CPU time

import argparse
import statistics
import time
from dataclasses import dataclass, field

import numba
import numpy as np
from numba import njit, prange

from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.moving_scheme import MovingBody
from mpm_core.grid import build_grid
from mpm_core.model.model import Model
from tests.benchmarks.grid import overlaps_a_box
from tests.mechanics.scenes import COULOMB, make_model, make_scene, uniform

TABLE_2_AT_1000_M = uniform(-24.9e6, -40.97e6, -28.13e6, -3.95e6, 2.7e6, -0.7e6)
YIELDING_STRESS = -70e6  # Pa, along y
YIELDING_SHARE = 0.1
HEAVINESS = 1e12
STRAIN_PER_STEP = 1e-8
STEPS = 8
DRIVES = (  # lower, upper, m: two drives and a crosscut of 5 x 5 m, a stope
    np.array([[10.0, 20, 38], [10, 55, 38], [45, 20, 38], [60, 30, 50]]),
    np.array([[90.0, 25, 43], [90, 60, 43], [50, 60, 43], [70, 50, 62]]),
)


def regular_grid(side: int):
    """A block of side^3 cells of one level."""
    return build_grid((0, 0, 0), 1.25, (side,) * 3, 1, lambda level, index: np.zeros(len(index), bool), 0)


def mine_grid():
    """100 x 80 x 80 m around drives and a stope, 10 m to 1.25 m."""
    return build_grid(
        (0, 0, 0), 10.0, (10, 8, 8), 4, lambda level, index: overlaps_a_box(index, 10.0 / 2**level, *DRIVES), 2
    )


@dataclass
class Case:
    """A body in the state described above, and what was measured of it."""

    name: str
    body: Body
    clock: dict[int, list[float]] = field(default_factory=lambda: {1: [], 2: []})  # s, by number of threads
    processor: dict[int, list[float]] = field(default_factory=lambda: {1: [], 2: []})
    yielding: float = 0.0

    def __post_init__(self):
        self.no_force = np.zeros_like(self.body.unbalanced)

    def steps(self, number: int) -> None:
        for _ in range(number):
            self.body.advance(self.no_force, self.body.time_step)
            self.body.update(self.body.time_step)

    def measure(self) -> None:
        """Half a second or so: once on one thread, once on two."""
        for threads in (1, 2):
            numba.set_num_threads(threads)
            start, processor = time.perf_counter(), time.process_time()
            self.steps(STEPS)
            self.processor[threads].append(time.process_time() - processor)
            self.clock[threads].append(time.perf_counter() - start)

    @property
    def rate(self) -> float:
        """Particle-steps per CPU-second on one thread."""
        return self.body.model.particles.count * STEPS / statistics.median(self.processor[1])

    @property
    def overhead(self) -> float:
        """CPU time of two threads over that of one: 1 if they neither wait for nor disturb each other."""
        return statistics.median(self.processor[2]) / statistics.median(self.processor[1])

    @property
    def speed_up(self) -> float:
        """Clock time on one thread over that on two, each the best of all turns: the least disturbed by others."""
        return min(self.clock[1]) / min(self.clock[2])

    def measure_yielding(self) -> None:
        before = self.body.state.later_strain.copy()
        self.steps(1)
        self.yielding = float((self.body.state.later_strain != before).any(axis=1).mean())


def compressed(model: Model, moving: bool, coulomb: bool) -> Body:
    """A body whose nodes (and particles) keep the velocity of a uniform compression along y."""
    state = model.virgin_state()
    if coulomb:
        state.failed[:] = 0
    body = (MovingBody if moving else Body)(model, state, model.volumes(0))
    rate = STRAIN_PER_STEP / body.time_step
    state.velocity[:, 1] = -rate * model.grid.node_position[:, 1]
    body.mass *= HEAVINESS
    if moving:
        body.density *= HEAVINESS
        body.particle_mass *= HEAVINESS
        body.velocity[:, 1] = -rate * model.particles.position[:, 1]
    body.update(0.0)
    return body


def make_cases() -> tuple[list[Case], dict[str, Model]]:
    """Every kind of body and material on both grids; models by name of the grid."""
    cases, models = [], {}
    scene = make_scene(None, host=COULOMB, stress=TABLE_2_AT_1000_M, boundary="free", particles_per_cell=2)
    for grid_name, grid in (("block", regular_grid(38)), ("mine", mine_grid())):
        model = models[grid_name] = make_model(scene, grid)
        yields = np.random.default_rng(1).random(model.particles.count) < YIELDING_SHARE
        model.insitu[yields, 1] = YIELDING_STRESS
        for moving in (False, True):
            for coulomb in (False, True):
                body = compressed(model, moving, coulomb)
                name = f"{'moving' if moving else 'resting'}, {'Coulomb' if coulomb else 'elastic'}, {grid_name}"
                cases.append(Case(name, body))
    return cases, models


def same_bits(model: Model, moving: bool) -> bool:
    """Whether ten steps from one state end alike, to the last bit, on one thread and on two."""
    ends = []
    for threads in (1, 2):
        numba.set_num_threads(threads)
        case = Case("", compressed(model, moving, coulomb=True))
        case.body.state.stress[:] = np.random.default_rng(2).standard_normal(case.body.state.stress.shape) * 1e6
        case.body.mass /= HEAVINESS  # forces do matter here
        if moving:
            case.body.density /= HEAVINESS
            case.body.particle_mass /= HEAVINESS
        case.body.update(0.0)
        case.steps(10)
        state = case.body.state
        ends.append((state.stress, state.later_strain, state.displacement, state.velocity, state.position))
    return all(np.array_equal(one, two) for one, two in zip(*ends, strict=True))


def bytes_per_particle(body: Body) -> float:
    """Bytes of the arrays that one step reads or writes, per particle; those it reads and writes count twice."""
    model, state, scatter = body.model, body.state, body.model.scatter
    read = [model.cell_nodes, scatter.cell_slots, model.grid.cell_size, body.volume, model.particles.material]
    read += [
        scatter.sum_slots,
        scatter.sum_weights,
        scatter.sum_start,
        body.failed,
        model.held,
        body.unbalanced,
    ]
    both = [state.stress, state.velocity, state.displacement]
    if isinstance(body, MovingBody):
        read += [body.particle_mass, body.cell_particles, body.cell_start, body.mass]
        both += [body.xi, body.velocity, body.acceleration, body.slot_values]
    else:
        groups = model.particles
        read += [groups.cell_groups_start, groups.cell_groups, groups.group_start, groups.group_table, body.mass]
        both += [body.slot_force]
    total = sum(array.nbytes for array in read) + 2 * sum(array.nbytes for array in both)
    if body.failed.any():
        total += model.insitu.nbytes
        total += 2 * YIELDING_SHARE * state.later_strain.nbytes
    return total / model.particles.count


@njit(parallel=True)
def scale(source, target):
    for i in prange(len(source)):
        target[i] = 3.0 * source[i]


def memory_speed() -> float:
    """GB/s that one thread reads and writes in a plain loop over arrays far larger than any cache."""
    numba.set_num_threads(1)
    source, target = np.ones(16_000_000), np.ones(16_000_000)
    scale(source, target)
    times = []
    for _ in range(5):
        start = time.process_time()
        scale(source, target)
        times.append(time.process_time() - start)
    return 2 * source.nbytes / statistics.median(times) / 1e9


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=9, help="turns of which the median is taken")
    arguments = parser.parse_args()
    cases, models = make_cases()
    for name, model in models.items():
        print(f"{name}: {len(model.cell_nodes):,} cells, {len(model.hanging):,} hanging nodes", end="; ")
        print(f"{model.particles.count:,} particles")
    for case in cases:
        for threads in (1, 2):
            numba.set_num_threads(threads)
            case.steps(2)  # compiled, in memory
    print("load before:", *(f"{value:.1f}" for value in os.getloadavg()))
    for _ in range(arguments.repetitions):
        for case in cases:
            case.measure()
    print("load after: ", *(f"{value:.1f}" for value in os.getloadavg()))

    copy = memory_speed()
    columns = f"{'M / CPU-s':>10}{'2 threads':>10}{'CPU 2:1':>9}{'yielding':>10}{'bytes':>7}{'GB/s':>6}"
    print(f"\n{'':30}{columns}")
    for case in cases:
        case.measure_yielding()
        rate, traffic = case.rate, bytes_per_particle(case.body)
        print(f"{case.name:30}{rate / 1e6:10.1f}{case.speed_up:10.2f}{case.overhead:9.2f}", end="")
        print(f"{100 * case.yielding:9.1f}%{traffic:7.0f}{rate * traffic / 1e9:6.1f}")
    print(f"\na plain loop of one thread moves {copy:.1f} GB/s: where GB/s is far below, arithmetic is the bound")
    for moving in (False, True):
        same = all(same_bits(model, moving) for model in models.values())
        print(
            f"{'moving' if moving else 'resting'}: one thread and two give {'the same bits' if same else 'OTHER BITS'}"
        )


if __name__ == "__main__":
    main()
