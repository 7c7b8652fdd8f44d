"""What the model gives at each instrument after each step, beside its readings."""

import json
from collections.abc import Iterable, Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from common.fields import Field
from common.observation_table import FIELDS, READING_FIELDS
from common.voigt import NAMES, tensor_from_voigt
from response.field import Values, values_at
from response.observation_settings import (
    CLOSURE,
    EXTENSION,
    STRESS,
    Instrument,
    ObservationSlice,
    ObservedClosure,
    ObservedLine,
    ObservedPoint,
)
from response.readings import at_steps, read_readings
from response.rock import Rock, Voids, is_computed

MPA, MM = 1e-6, 1e3
AXES = ("east", "north", "up")


def places(instrument: Instrument) -> NDArray:
    """Points (n, xyz) m at which the model is read for an instrument; of an extensometer the collar comes first."""
    if isinstance(instrument, ObservedPoint):
        return np.array([instrument.at])
    if isinstance(instrument, ObservedClosure):
        return np.array([instrument.start, instrument.end])
    assert isinstance(instrument, ObservedLine)
    along = np.asarray(instrument.start) + instrument.distances[:, None] * instrument.vector
    return along if instrument.measures == STRESS else np.concatenate([[instrument.start], along])


def read_values(settings: ObservationSlice, grid: xr.Dataset, state: xr.Dataset, number: int) -> Values:
    """Fields at the places of all instruments, in order, in the state after the step of this number (from 0); NaN for
    a step that is not computed."""
    steps = [step["name"] for step in settings.steps]
    mined = {entry["name"]: entry["mined"] for entry in settings.excavations}
    names = json.loads(grid.attrs["excavation_names"])
    order = np.array([steps.index(mined[name]) if mined.get(name) in steps else len(steps) for name in names])
    points = np.concatenate([np.empty((0, 3)), *(places(one) for one in settings.observations.instruments)])
    if not is_computed(state):
        return Values.unknown(len(points))
    return values_at(Rock(state, Voids.of(grid, order <= number)), points)


def observe(settings: ObservationSlice, grid: xr.Dataset, states: Iterable[xr.Dataset]) -> xr.Dataset:
    """The table of observations. states: of the steps, in order."""
    return tabulate(settings, [read_values(settings, grid, state, number) for number, state in enumerate(states)])


def tabulate(settings: ObservationSlice, found: list[Values]) -> xr.Dataset:
    """The table of observations of the values that `read_values` found in each step."""
    instruments = settings.observations.instruments
    bounds = np.cumsum([0, *(len(places(one)) for one in instruments)])
    parts: list[tuple[NDArray, ...]] = []
    for number, instrument in enumerate(instruments):
        own = slice(bounds[number], bounds[number + 1])
        parts += _rows(instrument, [_part(values, own) for values in found], list(settings.steps))
    return _dataset(parts, FIELDS)


def _dataset(parts: list[tuple[NDArray, ...]], fields: Sequence[Field]) -> xr.Dataset:
    """A table with a variable for each field. parts: columns of some of its rows, one below another."""
    columns = zip(*parts, strict=True) if parts else [() for _ in fields]
    return xr.Dataset(
        {
            field.name: (field.dims, _joined(column, field.dtype), field.attributes)
            for field, column in zip(fields, columns, strict=True)
        }
    )


def _joined(parts: Sequence[NDArray], dtype: np.dtype) -> NDArray:
    """Parts of a column, one below another."""
    return np.concatenate(parts).astype(dtype, copy=False) if parts else np.empty(0, dtype)


def tabulate_readings(settings: ObservationSlice) -> xr.Dataset:
    """The table of the readings of all instruments, each of which has a file: READING_FIELDS, as read.

    Its rows are those of `tabulate` for the same instruments. Of an instrument that was zeroed, readings count from the
    step on in which it was. Raises InputError for a file that cannot be read.
    """
    parts: list[tuple[NDArray, ...]] = []
    names = [step["name"] for step in settings.steps]
    for instrument in settings.observations.instruments:
        scale, unit = scale_of(instrument)
        measured = scale * at_steps(read_readings(instrument, instrument.name), list(settings.steps), None)
        if instrument.since is not None:
            measured[: names.index(instrument.since)] = np.nan
        distances, count = distances_of(instrument), measured.size
        parts.append(
            (
                np.full(count, instrument.name, object), np.repeat(distances, len(names)),
                np.tile(np.array(names, object), len(distances)), np.full(count, unit, object), measured.T.ravel(),
                np.full(count, scale * instrument.reading_error()), np.full(count, int(instrument.since is not None)),
            )
        )  # fmt: skip
    return _dataset(parts, READING_FIELDS)


def scale_of(instrument: Instrument) -> tuple[float, str]:
    """Factor from SI units to those of the tables, and their name."""
    return (MPA, "MPa") if instrument.quantity == STRESS else (MM, "mm")


def distances_of(instrument: Instrument) -> NDArray:
    """Distances (place,) of the points of a line from its start, m; NaN for the one place of any other instrument."""
    return instrument.distances if isinstance(instrument, ObservedLine) else np.array([np.nan])


def _part(values: Values, own: slice) -> Values:
    """Values at some of the points."""
    return Values(*(column[own] for column in vars(values).values()))


def _rows(instrument: Instrument, found: list[Values], steps: list[dict]) -> Iterable[tuple[NDArray, ...]]:
    """Columns, in the order of FIELDS, of the rows of each quantity of an instrument: each place by each step."""
    scale, unit = scale_of(instrument)
    first = None if instrument.since is None else [step["name"] for step in steps].index(instrument.since)
    distances = distances_of(instrument)
    measured = np.full((len(steps), len(distances)), np.nan)
    reading_error = np.nan
    if instrument.file is not None:
        measured = scale * at_steps(read_readings(instrument, instrument.name), steps, instrument.since)
        reading_error = scale * instrument.reading_error()
        if instrument.since is not None:  # the difference of two readings
            reading_error *= np.sqrt(2.0)
    cell = np.array([values.cell for values in found])  # (step, point)
    failed = np.array([values.failed for values in found])
    if instrument.quantity == EXTENSION:  # of the collar and each anchor
        cell, failed = np.maximum(cell[:, :1], cell[:, 1:]), np.logical_or(failed[:, :1], failed[:, 1:])
    if instrument.quantity == CLOSURE:
        cell, failed = cell.max(axis=1, keepdims=True), failed.max(axis=1, keepdims=True)
    count = measured.size
    names = np.array([step["name"] for step in steps], object)
    for quantity, value, error in _modelled(instrument, found):
        if first is not None:
            value, error = value - value[first], np.hypot(error, error[first])
            value[:first] = np.nan
            error = np.where(np.isfinite(value), error, np.nan)
        by_place = (scale * value, scale * error, measured, np.where(np.isfinite(measured), reading_error, np.nan))
        yield (
            np.full(count, instrument.name, object), np.full(count, quantity, object),
            np.repeat(distances, len(steps)), np.tile(names, len(distances)), np.full(count, unit, object),
            *(column.T.ravel() for column in (*by_place, cell, failed)),
        )  # fmt: skip


def _modelled(instrument: Instrument, found: list[Values]) -> Iterable[tuple[str, NDArray, NDArray]]:
    """Name of each quantity, its values and errors (step, place), SI units."""
    if isinstance(instrument, ObservedPoint | ObservedLine) and instrument.quantity == STRESS:
        stress = np.array([values.stress for values in found])  # (step, place, 6)
        error = np.array([values.stress_error for values in found])
        axis = instrument.axis if isinstance(instrument, ObservedPoint) else None
        if axis is not None:
            along = -np.einsum("i,spij,j->sp", axis.vector, tensor_from_voigt(stress), axis.vector)
            yield "compression along the axis", along, error
            return
        for number, name in enumerate(NAMES):
            yield f"stress {name}", stress[:, :, number], error
        known = np.where(np.isfinite(stress), stress, 0.0)
        principal = np.where(np.isfinite(stress[:, :, :3]), -np.linalg.eigvalsh(tensor_from_voigt(known)), np.nan)
        for number, name in enumerate(("major", "intermediate", "minor")):
            yield f"{name} compression", principal[:, :, number], error
        return
    moved = np.array([values.displacement for values in found])  # (step, place, xyz)
    error = np.array([values.displacement_error for values in found])
    if isinstance(instrument, ObservedPoint):
        if instrument.axis is not None:
            yield "displacement along the axis", moved @ instrument.axis.vector, error
            return
        for number, name in enumerate(AXES):
            yield f"displacement {name}", moved[:, :, number], error
        return
    if isinstance(instrument, ObservedLine):
        along = moved @ instrument.vector
        yield EXTENSION, along[:, 1:] - along[:, :1], np.hypot(error[:, 1:], error[:, :1])
        return
    assert isinstance(instrument, ObservedClosure)
    between = np.subtract(instrument.end, instrument.start)
    along = moved @ (between / np.linalg.norm(between))
    yield CLOSURE, along[:, :1] - along[:, 1:], np.hypot(error[:, :1], error[:, 1:])
