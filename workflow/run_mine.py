"""A whole run of a mine in this process, without files between its stages.

The companion on larger cells, the trials of a calibration and the studies of the verification run so, and a notebook
may. `run_mine` takes a checked mine, `run_stages` the settings of its stages as plain values.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import xarray as xr

from common.errors import InputError
from mpm_core.scene.scene import parse_scene
from mpm_core.scene.step_settings import settings_up_to
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.grid_stage import make_grid
from seismic.catalog import merge
from seismic.event_settings import EventSettings
from seismic.events import extract_events
from workflow.mine import Mine


@dataclass
class Run:
    """Datasets of a run, laid out as the files of the same names: steps and events by the name of the step."""

    grid: xr.Dataset
    elastic: xr.Dataset
    steps: dict[str, xr.Dataset] = field(default_factory=dict)
    events: dict[str, xr.Dataset] = field(default_factory=dict)

    @property
    def catalog(self) -> xr.Dataset:
        """The synthetic catalogue of the dated steps. Raises InputError for a mine without steps."""
        return merge(list(self.events.values()))


def run_mine(mine: Mine, failed: Path = Path("failed_state.npz")) -> Run:
    """Compute all stages of a mine, from its grid to its events.

    failed: file in which a stage that fails leaves its last state. Raises InputError where a stage cannot be solved.

    >>> from workflow.configuration import load_mine
    >>> run = run_mine(load_mine("tests/golden/mines/flat.yaml"))
    >>> list(run.steps)
    ['history', '2019-08']
    >>> run.catalog.sizes["event"] > 0
    True
    """
    found = {name: dataset for name, dataset, _ in run_stages(mine.run_slices(), failed)}
    run = Run(found["grid"], found["elastic"])
    for name, dataset in found.items():
        folder, _, step = name.partition("/")
        if step:
            getattr(run, folder)[step] = dataset
    return run


def run_stages(slices: dict, failed: Path) -> Iterator[tuple[str, xr.Dataset, dict]]:
    """Yield path below results/<mine> without ending, dataset and facts of each stage, when it is computed.

    slices: settings of the stages as Mine.run_slices gives them: `grid`, `elastic` and, for each step in order, its
    `name`, `scene` (what it changes) and `events`; a step has several `events` if they are extracted with several
    settings. Raises InputError where a stage cannot be solved.
    """
    grid = make_grid(slices["grid"], {})
    yield "grid", grid, {}
    scene = slices["elastic"]
    state, facts = elastic_stage(parse_scene(scene), grid, failed)
    yield "elastic", state, facts
    for step in slices["steps"]:
        scene = settings_up_to(scene, step["scene"])
        state, facts = mining_step(parse_scene(scene), grid, state, failed)
        yield f"steps/{step['name']}", state, facts
        for settings in step["events"]:
            try:
                events, _ = extract_events(state, EventSettings.of(settings, "seismic"))
            except InputError as error:
                raise InputError(f"step {step['name']}: {error}") from error
            yield f"events/{step['name']}", events, {}
