"""One trial: a whole run of a mine in one process, from the grid to its events."""

from pathlib import Path

import xarray as xr

from calibration.extractions import joined
from common.errors import InputError
from mpm_core.scene.scene import parse_scene
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.grid_stage import make_grid
from seismic.catalog import merge
from seismic.event_settings import EventSettings
from seismic.events import extract_events


def run_trial(slices: dict, failed: Path) -> xr.Dataset:
    """The events of a trial, one catalogue for each setting of their extraction, with the potency before the record.

    slices: `grid`, `elastic` and, for each step in order, `scene` and `events`: those of the stages of the same names,
    of `events` one for each extraction. failed: where a stage leaves its last state if it fails. A stage of its own
    for each part would cost some seconds to start, which is what a small trial takes. calibration.extractions
    tells the catalogues apart.
    """
    grid = make_grid(slices["grid"], {})
    state, _ = elastic_stage(parse_scene(slices["elastic"]), grid, failed)
    events: list[list[xr.Dataset]] = []
    for step in slices["steps"]:
        state, _ = mining_step(parse_scene(step["scene"]), grid, state, failed)
        try:
            settings = [EventSettings.of(one, "seismic") for one in step["events"]]
            events.append([extract_events(state, one)[0] for one in settings])
        except InputError as error:
            raise InputError(f"step {step['name']}: {error}") from error
    undated = sum(float(of_step[0].potency.sum()) for of_step in events if not of_step[0].attrs["dated"])
    catalogues = [merge(list(one)) for one in zip(*events, strict=True)]
    return joined(catalogues).assign_attrs(potency_before_record=undated)
