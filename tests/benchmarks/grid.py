"""How long a mine's grid takes: 1100 x 750 x 750 m, twelve drift levels and four stopes, 10 m to 1.25 m, 4.2 M cells.

Run ``python -m tests.benchmarks.grid``. Required: cells, nodes and constraints within 20 s and 4 GB on two cores. Both
clock and processor time (all threads) are printed; kernels are compiled before the clocks start.
"""

import argparse
import resource
import time

import numpy as np
from numba import get_num_threads, njit, prange

from mpm_core.grid import build_grid, estimate_memory, face_neighbors, number_nodes
from mpm_core.grid.octree import leaves, mark_splits

BASE_SHAPE, COARSE_CELL, LEVELS = (110, 75, 75), 10.0, 4


def mine() -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners (box, 3) m: four stopes; on twelve levels a drive and crosscuts every 60 m, 5 x 5 m."""
    boxes = []
    for stope in range(4):
        x, z = 450 + 50 * stope, 250 + 40 * (stope % 2)
        boxes.append(((x, 350, z), (x + 30, 370, z + 50)))
    for z in range(100, 700, 50):
        boxes.append(((100, 360, z), (1000, 365, z + 5)))
        boxes += [((x, 250, z), (x + 5, 500, z + 5)) for x in range(150, 1000, 60)]
    return np.array([lower for lower, _ in boxes], dtype=float), np.array([upper for _, upper in boxes], dtype=float)


@njit(parallel=True)
def overlaps_a_box(index, size, lower, upper):
    """Cells index (n, 3) of edge size that overlap a box: (n,) bool."""
    found = np.zeros(len(index), np.bool_)
    for cell in prange(len(index)):
        for box in range(len(lower)):
            overlap = True
            for axis in range(3):
                start = index[cell, axis] * size
                overlap &= start < upper[box, axis] and start + size > lower[box, axis]
            if overlap:
                found[cell] = True
                break
    return found


class Stopwatch:
    """Prints what the clock and the processor spent since the last lap."""

    def __init__(self):
        self.last = self._now()

    def lap(self, what: str) -> None:
        now = self._now()
        print(f"{what:<32}{now[0] - self.last[0]:8.2f} s{now[1] - self.last[1]:8.2f} s processor")
        self.last = self._now()

    @staticmethod
    def _now() -> tuple[float, float]:
        return time.perf_counter(), time.process_time()


def peak_memory() -> float:
    """GB, of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--buffer-cells", type=int, default=1, help="rings around excavations (1: 4.2 M cells)")
    buffer_cells = parser.parse_args().buffer_cells
    lower, upper = mine()

    def classify(level, index):
        return overlaps_a_box(index, COARSE_CELL / 2**level, lower, upper)

    small = build_grid((0, 0, 0), COARSE_CELL, (2, 2, 2), 2, classify, 0, before_allocation=print)
    face_neighbors(small)
    before = peak_memory()
    print(f"{get_num_threads()} threads, {before:.2f} GB before the grid")

    watch = Stopwatch()
    marks = mark_splits(BASE_SHAPE, LEVELS, classify, buffer_cells)
    watch.lap("splits, rings, balance")
    per_level, nodes = marks.cells_per_level(), marks.number_of_nodes()
    watch.lap("count of cells and nodes")
    cell_index, cell_level = leaves(marks)
    watch.lap("leaves in Morton order")
    width = np.int32(1) << (LEVELS - 1 - cell_level).astype(np.int32)
    _, node_index, node_parents = number_nodes(cell_index, width, np.array(BASE_SHAPE) << (LEVELS - 1))
    watch.lap("nodes and constraints")
    assert len(node_index) == nodes
    print(
        f"{len(cell_index):,} cells {per_level.tolist()}, {nodes:,} nodes, {(node_parents[:, 0] >= 0).sum():,} hanging"
    )
    estimate = estimate_memory(len(cell_index), nodes)
    print(f"peak {peak_memory():.2f} GB, {peak_memory() - before:.2f} GB of it the grid's", end="; ")
    print(f"estimated {estimate.building / 1e9:.2f} GB while building, {estimate.arrays / 1e9:.2f} GB after")
    del marks, cell_index, cell_level, width, node_index, node_parents

    watch = Stopwatch()
    grid = build_grid((0, 0, 0), COARSE_CELL, BASE_SHAPE, LEVELS, classify, buffer_cells)
    watch.lap("build_grid, all of it")
    _, indices = face_neighbors(grid)
    watch.lap(f"face neighbours ({len(indices):,})")


if __name__ == "__main__":
    main()
