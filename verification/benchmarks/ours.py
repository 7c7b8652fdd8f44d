"""A case solved by the ordinary stages, in this process; see peers/stope.py for what is reported and how."""

import logging
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
import xarray as xr

from common.sources import source_hash
from mpm_core.kernels.threads import use_threads
from mpm_core.scene.scene import parse_scene
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.grid_stage import make_grid
from verification.benchmarks.peers.stope import announce, closure, peak_memory
from verification.benchmarks.settings import Case, Settings
from workflow.mine import Mine

WARM_UP = 2  # cells across: as small as it gets; kernels are compiled and in memory before the clock starts


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
    """Grid and stages of a case: what is reported, the last stage's dataset, the grid. `begin` is called in between."""
    start = time.perf_counter()
    grid = make_grid(mine.grid_slice(), {})
    grid_seconds = time.perf_counter() - start
    with tempfile.TemporaryDirectory() as folder:
        failed = Path(folder) / "failed.npz"
        stages = [lambda state: elastic_stage(parse_scene(mine.scene_slice(0)), grid, failed)]
        for step in mine.mined_steps:
            scene = parse_scene(mine.step_slice(step))
            stages.append(lambda state, scene=scene: mining_step(scene, grid, state, failed))
        state = None
        for stage in stages[:-1]:
            state, _ = stage(state)
        begin()
        start, processor = time.perf_counter(), time.process_time()
        state, facts = stages[-1](state)
        seconds, processor = time.perf_counter() - start, time.process_time() - processor
    logging.info("%s: grid %.2f s, stage %.2f s", mine.name, grid_seconds, seconds)
    return (
        {
            "converged": True,  # a stage that does not converge raises
            "reason": "",
            "seconds": seconds,
            "cpu_seconds": processor,
            "memory": peak_memory(),
            "iterations": int(facts["iterations"]),
            "closure": closure_of(mine, grid, state),
            "version": f"this code (sources {source_hash('mpm_core step')}, numba {version('numba')})",
        },
        state,
        grid,
    )


def closure_of(mine: Mine, grid: xr.Dataset, state: xr.Dataset) -> float:
    """Convergence of the stope's side walls, m."""
    stope, cell = mine.values["excavations"][0], mine.values["grid"]["coarse_cell"]
    lower = np.array(mine.values["domain"]["lower"])
    index = np.rint((grid.node_position.values - lower) / cell).astype(int)
    corners = {
        f"stope_{side}": np.rint((np.array(stope[side]) - lower) / cell).astype(int) for side in ("lower", "upper")
    }
    return closure(corners, index, state.node_displacement.values)
