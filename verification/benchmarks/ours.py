"""Solution of a case by the ordinary stages in this process. peers/stope.py describes what is reported."""

import logging
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
import xarray as xr

from mpm_core.simd.threads import use_threads
from verification.benchmarks.peers.stope import announce, closure, peak_memory
from verification.benchmarks.settings import Case, Settings
from workflow.mine import Mine
from workflow.run_mine import run_stages
from workflow.stages import package_hash

WARM_UP = 2  # Cells across the stope of a first run, which compiles and loads the kernels before the clock starts.


def solve(settings: Settings, case: Case, threads: int) -> None:
    """Solve a case, again if it is short, and announce what came of it each time.

    Seconds and processor time are those of one stage, from the grid in memory to its dataset: `elastic`, or in Coulomb
    rock the step that mines the stope. The stages before that find the block as it was, and are left out.
    """
    use_threads(threads)
    run(settings.mine(Case(case.problem, case.code, WARM_UP)))
    for _ in range(settings.repetitions):
        facts, *_ = run(settings.mine(case), lambda: announce(begins=True))
        announce(**facts)
        if facts["seconds"] > settings.repeat_below:
            break


def run(mine: Mine, begin=lambda: None) -> tuple[dict, xr.Dataset, xr.Dataset]:
    """Run a case: reported facts, the last stage's dataset, and the grid. `begin` is called before the last stage."""
    with tempfile.TemporaryDirectory() as folder:
        stages = run_stages(mine.run_slices(extracted_as=()), Path(folder) / "failed.npz")
        start = time.perf_counter()
        _, grid, _ = next(stages)
        grid_seconds = time.perf_counter() - start
        for _ in mine.mined_steps:  # All stages but the last run here.
            next(stages)
        begin()
        start, processor = time.perf_counter(), time.process_time()
        _, state, facts = next(stages)
        seconds, processor = time.perf_counter() - start, time.process_time() - processor
    logging.info("%s: grid %.2f s, stage %.2f s", mine.name, grid_seconds, seconds)
    return (
        {
            "converged": True,  # A stage that does not converge raises an error.
            "reason": "",
            "seconds": seconds,
            "cpu_seconds": processor,
            "memory": peak_memory(),
            "iterations": int(facts["iterations"]),
            "closure": closure_of(mine, state),
            "cells_at_end": int(state.attrs["cells"]),
            "failed_volume": float(state.attrs["failed_volume"]),
            "version": f"this code (sources {package_hash('mpm_core')}, numba {version('numba')})",
        },
        state,
        grid,
    )


def closure_of(mine: Mine, state: xr.Dataset) -> float:
    """Convergence of the stope's side walls, m. These have finest cells on every grid."""
    stope, cell = mine.excavations[0], mine.finest_cell
    lower = np.array(mine.settings.domain.lower)
    index = np.rint((state.node_position.values - lower) / cell).astype(int)
    corners = {
        f"stope_{side}": np.rint((np.array(corner) - lower) / cell).astype(int)
        for side, corner in (("lower", stope.lower), ("upper", stope.upper))
    }
    return closure(corners, index, state.node_displacement.values)
