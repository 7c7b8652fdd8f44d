"""The stage of the table of openings: grid, states and catalogues, step by step."""

import logging
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.exposure import Exposure, common_period, window
from catalogs.records.times import parse_time
from catalogs.settings import InsituStress as VirginStress
from common.datasets import read_dataset
from common.event_table import read_events
from common.voigt import tensor_from_voigt
from mpm_core.scene.scene import InsituStress
from response.opening_table import StepOpenings, measure, rows_of, table
from response.rock import VARIABLES, Rock, Voids, is_computed
from response.settings import OpeningSlice, OpeningStep
from response.wall_rays import standing, wall_displacement
from response.walls import mined_walls


def read_and_measure(
    settings: OpeningSlice, grid: Path, states: Sequence[Path], events: Sequence[Path], record: Path | None
) -> xr.Dataset:
    """The table of openings of files. states, events: of the steps, in order; record: None without one."""
    return openings_table(
        settings,
        read_dataset(grid),
        (read_dataset(path, VARIABLES) for path in states),
        (_resolved(read_events(path)) for path in events),
        _recorded(settings.steps, None if record is None else read_events(record)),
    )


def openings_table(
    settings: OpeningSlice,
    grid: xr.Dataset,
    states: Iterable[xr.Dataset],
    events: Iterable[NDArray],
    recorded: Iterable[NDArray | None],
) -> xr.Dataset:
    """The table of openings after each step that is computed. states: of the steps, in order; events, recorded:
    locations (n, xyz) m of the modelled and the recorded events of each, None where there is no record."""
    names, mined, filled, walls = mined_walls(grid, settings.excavations, [step.name for step in settings.steps])
    virgin = virgin_compression(settings.insitu, walls.place)
    before, last = np.zeros((len(walls), 3)), None
    rows: list[tuple] = []
    of_steps = zip([step.name for step in settings.steps], states, events, recorded, strict=True)
    for number, (step, state, modelled, own_record) in enumerate(of_steps):
        if not is_computed(state):
            break  # nor are those after it
        openings = StepOpenings(names, mined, filled, number)
        rock = Rock(state, Voids.of(grid, openings.is_mined))
        if last is not None:
            new = np.flatnonzero(mined[walls.excavation] == number)
            before[new] = np.nan_to_num(wall_displacement(last, walls.at(new)))
        here = np.flatnonzero(openings.is_mined[walls.excavation])
        here = here[standing(rock, walls.at(here))]
        if len(here):
            own = walls.at(here)
            found = measure(rock, virgin[here], own, before[here], number, modelled, own_record)
            rows += rows_of(own, found, openings, step, settings.chainage)
        last = rock
    logging.info("openings: %d rows of %d points of walls", len(rows), len(walls))
    return table(rows)


def virgin_compression(insitu: VirginStress, place: NDArray) -> NDArray:
    """Largest virgin compression (n,) Pa at points (n, xyz) m."""
    stress = InsituStress(np.array(insitu.constant), np.array(insitu.gradient), insitu.surface)
    return -np.linalg.eigvalsh(tensor_from_voigt(stress.at(place[:, 2])))[:, 0]


def _resolved(events: xr.Dataset) -> NDArray:
    """Locations (n, xyz) m of the resolved events."""
    return events["location"].values[events["resolved"].values > 0]


def _recorded(steps: tuple[OpeningStep, ...], record: xr.Dataset | None) -> list[NDArray | None]:
    """Locations (n, xyz) m of the recorded events within the dates of each step; None without record or dates, and for
    a step that the record does not reach."""
    found: list[NDArray | None] = [None] * len(steps)
    dated = [number for number, step in enumerate(steps) if step.start]
    if record is None or not dated:
        return found
    windows = np.array([window(steps[number].model_dump()) for number in dated], "datetime64[ns]")
    own = Exposure(*windows.T).step(record["time"].values)
    reaches = np.ones(len(dated), bool)
    if period := common_period(record):
        first, last = (parse_time(time, "record") for time in period)
        reaches = (windows[:, 0] < last) & (windows[:, 1] > first)
    for index, number in enumerate(dated):
        if reaches[index]:
            found[number] = record["location"].values[own == index]
    return found
