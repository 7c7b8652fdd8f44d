"""One trial: a whole run of a mine in one process, from the grid to its events."""

from pathlib import Path

import xarray as xr

from common.errors import InputError
from mpm_core.scene.scene import parse_scene
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.grid_stage import make_grid
from seismic.catalog import merge
from seismic.event_settings import EventSettings
from seismic.events import extract_events


def run_trial(slices: dict, failed: Path) -> xr.Dataset:
    """The catalogue of a trial, with its potency by step as attributes.

    slices: `grid`, `elastic` and, for each step in order, `scene` and `events` (those of the stages of the same names);
    failed: where a stage leaves its last state if it fails. A stage of its own for each part would cost some seconds to
    start, which is what a small trial takes.
    """
    grid = make_grid(slices["grid"], {})
    state, _ = elastic_stage(parse_scene(slices["elastic"]), grid, failed)
    events = []
    for step in slices["steps"]:
        state, _ = mining_step(parse_scene(step["scene"]), grid, state, failed)
        try:
            events.append(extract_events(state, EventSettings.of(step["events"], "seismic"))[0])
        except InputError as error:
            raise InputError(f"step {step['name']}: {error}") from error
    undated = sum(float(one.potency.sum()) for one in events if not one.attrs["dated"])
    return merge(events).assign_attrs(potency_before_record=undated)
