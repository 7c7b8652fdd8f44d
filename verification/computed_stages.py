"""The stages of a mine, computed in this process: for studies that look at each of them or measure it."""

from collections.abc import Iterator
from pathlib import Path

import xarray as xr

from mpm_core.scene.scene import parse_scene
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.grid_stage import make_grid
from workflow.mine import Mine


def computed_stages(mine: Mine, failed: Path) -> Iterator[tuple[str, xr.Dataset, dict]]:
    """Name, dataset and facts of the grid (without facts), of the elastic stage and of each step, one at a time.

    Nothing of a stage is computed before it is asked for. failed: where a stage leaves its last state if it fails.
    """
    grid = make_grid(mine.grid_slice(), {})
    yield "grid", grid, {}
    state, facts = elastic_stage(parse_scene(mine.scene_slice(0)), grid, failed)
    yield "elastic", state, facts
    for step in mine.mined_steps:
        state, facts = mining_step(parse_scene(mine.step_slice(step)), grid, state, failed)
        yield step, state, facts
