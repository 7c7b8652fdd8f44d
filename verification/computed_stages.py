"""The stages of a mine, computed in this process. Studies use it that look at each stage or measure it."""

from collections.abc import Iterator
from pathlib import Path

import xarray as xr

from mpm_core.scene.scene import parse_scene
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.grid_stage import make_grid
from workflow.mine import Mine


def computed_stages(mine: Mine, failed: Path) -> Iterator[tuple[str, xr.Dataset, dict]]:
    """Yield name, dataset and facts of the grid (which has no facts), of the elastic stage and of each step.

    A stage is computed when it is asked for. failed: file in which a stage that fails leaves its last state.
    """
    grid = make_grid(mine.grid_slice(), {})
    yield "grid", grid, {}
    state, facts = elastic_stage(parse_scene(mine.scene_slice(0)), grid, failed)
    yield "elastic", state, facts
    for step in mine.mined_steps:
        state, facts = mining_step(parse_scene(mine.step_slice(step)), grid, state, failed)
        yield step, state, facts
