"""Checks of `observations`: the steps and files that instruments name, and whether they are in rock of the model."""

import difflib
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from common.errors import InputError, Mistakes
from response.observation_settings import Instrument, ObservationSettings, ObservedClosure
from workflow.mine import Mine
from workflow.scan_checks import check_scans

if TYPE_CHECKING:
    import pandas as pd

NEAR_WALL = 0.5  # Finest cells within which a point in an opening counts as one on its wall.


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
                own = instrument.model_copy(update={"file": mine.path(instrument.file).as_posix()})
                _check_dates(mine, where, own, read_readings(own, where))
    _check_rock(mine, settings, mistakes)
    check_scans(mine, mistakes)


def _check_dates(mine: Mine, where: str, instrument: Instrument, readings: "pd.DataFrame") -> None:
    """Readings within the dates of steps, and within those of the step that they are relative to."""
    from response.readings import at_steps

    steps = mine.observations_slice()["steps"]
    found = np.isfinite(at_steps(readings, steps, None))
    if not found.any():
        raise InputError(f"{where}.file: {instrument.file}: no reading is within the dates of a step")
    if instrument.since in mine.dated_steps:
        zero = found[[step["name"] for step in steps].index(instrument.since)]
        if not zero.all():
            lacking = ", ".join(name for name, known in zip(instrument.columns, zero, strict=True) if not known)
            raise InputError(
                f"{where}.since: {instrument.file}: no reading of {lacking} is within the dates of {instrument.since}, "
                "from which the others count; add one, for example the zero at its end"
            )


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
    """Raise InputError for a point outside of the domain."""
    from response.observations import places

    corners = mine.settings.domain
    for point in places(instrument):
        if not ((point >= corners.lower) & (point <= corners.upper)).all():
            raise InputError(f"{where}: the point {_text(point)} is outside the domain; enlarge domain, or correct it")


def _check_rock(mine: Mine, settings: ObservationSettings, mistakes: Mistakes) -> None:
    """Points that are mined from the first step on; marks of a closure are on walls, or near them. Points that are
    mined later have values until then."""
    from mpm_core.geometry.inside import contains
    from mpm_core.scene.scene_solids import read_entry
    from response.observations import places

    checked = [(where, one) for where, one in keyed(settings) if not isinstance(one, ObservedClosure)]
    points = [places(instrument) for _, instrument in checked]
    owner = np.repeat(np.arange(len(points)), [len(own) for own in points])
    every, refused = np.concatenate([np.empty((0, 3)), *points]), set()
    for entry in mine.excavations:
        if mine.step_index(entry.step) != 0:
            continue
        solid = read_entry(mine.placed(entry), mine.dimension, "excavations")
        inside = np.flatnonzero(contains(solid, every))
        for direction in np.concatenate([np.eye(3), -np.eye(3)]):  # a collar on a wall is no mistake
            inside = inside[contains(solid, every[inside] + NEAR_WALL * mine.finest_cell * direction)]
        for row in inside:
            if owner[row] not in refused:
                refused.add(owner[row])
                where = checked[owner[row]][0]
                mistakes.lines.append(
                    f"{where}: the point {_text(every[row])} is inside {entry.name}; put it into rock"
                )


def _text(point: np.ndarray) -> str:
    return f"({', '.join(f'{value:.10g}' for value in point)}) m"
