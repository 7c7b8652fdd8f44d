"""Checks of `observations`: the steps and files that instruments name, and whether they are in rock of the model."""

import difflib
from collections.abc import Iterator

import numpy as np

from common.errors import InputError, Mistakes
from response.observation_settings import Instrument, ObservationSettings
from workflow.mine import Mine


def keyed(settings: ObservationSettings) -> Iterator[tuple[str, Instrument]]:
    """Key of each instrument in the mine file, and the instrument."""
    for kind in ("points", "lines", "closures"):
        for number, instrument in enumerate(getattr(settings, kind)):
            yield f"observations.{kind}[{number}]", instrument


def check_observations(mine: Mine, mistakes: Mistakes) -> None:
    """Steps that instruments name, readings, and places; each mistake on a line of its own."""
    from response.readings import read_readings

    settings = mine.settings.observations
    if settings is None:
        return
    if mine.plane is not None:
        raise InputError(f"observations: instruments need a mine in three dimensions, plane: none, not {mine.plane}")
    for where, instrument in keyed(settings):
        with mistakes.gather():
            if instrument.since is not None and instrument.since not in mine.mined_steps:
                near = difflib.get_close_matches(instrument.since, mine.mined_steps, n=1)
                meant = f"did you mean {near[0]}?" if near else f"there are {', '.join(mine.mined_steps) or 'none'}"
                raise InputError(f"{where}.since: no step {instrument.since}; {meant}")
        with mistakes.gather():
            if instrument.file is not None:
                _check_file(mine, where, instrument)
        with mistakes.gather():
            _check_place(mine, where, instrument)
    with mistakes.gather():
        _check_columns(mine, settings)
    for where, instrument in keyed(settings):
        if instrument.file is not None and mine.path(instrument.file).is_file():
            with mistakes.gather():
                read_readings(instrument.model_copy(update={"file": mine.path(instrument.file).as_posix()}), where)


def _check_file(mine: Mine, where: str, instrument: Instrument) -> None:
    """The file of readings is there, and there are dates to compare it with."""
    path = mine.path(instrument.file)
    if not path.is_file():
        raise InputError(f"{where}.file: {path}: no such file")
    if not mine.dated_steps:
        raise InputError(f"{where}.file: no step has dates, so no reading can be compared; give steps start and end")
    if instrument.since in mine.mined_steps and instrument.since not in mine.dated_steps:
        raise InputError(f"{where}.since: {instrument.since} has no dates, so no reading belongs to its end")


def _check_columns(mine: Mine, settings: ObservationSettings) -> None:
    """No two instruments have one column of one file."""
    seen: dict[tuple, str] = {}
    for where, instrument in keyed(settings):
        for column in instrument.columns if instrument.file is not None else ():
            other = seen.setdefault((mine.path(instrument.file), column), where)
            if other != where:
                raise InputError(f"{where}.columns: {column} of {instrument.file} is that of {other} already")


def _check_place(mine: Mine, where: str, instrument: Instrument) -> None:
    """Points are within the domain, and none that needs rock is within an opening. Marks are on walls, or near them."""
    from mpm_core.geometry.inside import contains
    from mpm_core.scene.scene_solids import read_entry
    from response.observations import places

    points = places(instrument)
    corners = mine.settings.domain
    for point in points:
        if not ((point >= corners.lower) & (point <= corners.upper)).all():
            text = ", ".join(f"{value:g}" for value in point)
            raise InputError(f"{where}: the point ({text}) m is outside the domain; enlarge domain, or correct it")
    if instrument.name in {one.name for one in mine.settings.observations.closures}:
        return
    reach = mine.finest_cell
    for entry in mine.excavations:
        solid = read_entry(mine.placed(entry), mine.dimension, "excavations")
        inside = contains(solid, points)
        for direction in np.concatenate([np.eye(3), -np.eye(3)]):  # a collar on a wall is no mistake
            inside &= contains(solid, points + reach * direction)
        if inside.any():
            text = ", ".join(f"{value:g}" for value in points[inside.argmax()])
            raise InputError(f"{where}: the point ({text}) m is inside {entry.name}, which is mined; put it into rock")
