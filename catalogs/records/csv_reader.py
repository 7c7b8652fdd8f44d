"""Records in CSV: the configuration says which column is what."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

from catalogs.frame import MineFrame
from catalogs.record_settings import (
    EVENT_TYPE,
    GLOBE_COORDINATES,
    MAGNITUDE,
    MAGNITUDE_TYPE,
    MINE_COORDINATES,
    SIZE_NAMES,
    STATUS,
    TENSOR_KINDS,
    TEXTS,
    UNITS,
    RecordSlice,
)
from catalogs.records.build import build_record
from catalogs.records.csv_table import Table, read_table
from catalogs.records.event_kinds import is_left_out, kept_words, plain_word
from catalogs.records.filters import filter_events
from catalogs.records.magnitudes import moment_magnitudes, sizes_text
from catalogs.records.times import parse_times
from pipeline.errors import InputError
from pipeline.source_tensors import potency_from_moment
from pipeline.voigt import COMPONENTS

FRAMES = {  # axes of a tensor's frame (row) in east, north, up; up south east is that of moment tensor catalogues
    "ENU": np.eye(3),
    "NED": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
    "USE": np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]),
}
CODES = (-99.0, -999.0, -9999.0)  # written for a missing value, unless record.missing names others


def read(settings: RecordSlice) -> xr.Dataset:
    """The events of a CSV file in the form of pipeline.event_table, filtered (catalogs.records.filters).

    settings.columns names the file's columns: time (one column, or a list of two or three: date, time of day,
    offset; see catalogs.records.times), x, y, z (m) or latitude, longitude (degrees), depth (m below sea level), at
    least one of potency (m3), log_potency, moment (N m), mw, or magnitude with magnitude_type, and optionally
    potency_xx, _yy, _zz, _yz, _xz, _xy (m3, tensor shear) or moment_xx ... (N m) in the axes of tensor_frame,
    time_uncertainty (s), step, event_type and evaluation_status (catalogs.records.event_kinds). units: {kind of
    column: unit}, where it is not the one above and not in the file; decimal, date_order, time_zone: what cannot be
    found from the file; conversions: catalogs.records.magnitudes; missing: numbers that stand for a missing value,
    else CODES. How the table is read: catalogs.records.csv_table.

    Events that are no seismicity or have no time, place or size are left out, and rows that are there twice. Raises
    InputError, naming file, column and event, for what is missing, not a number, or not a date.
    """
    path = Path(settings.file)
    columns = settings.columns.names()
    names = {key: name for key, name in columns.items() if key not in TEXTS}
    named = {name: f"record.columns.{key}" for key, value in columns.items() for name in _listed(value)}
    table = read_table(path, named, list(names.values()), settings.decimal)
    _check_untold_kinds(table, set(named), settings)
    table.decide_decimals(names.values())
    codes = CODES if settings.missing is None else settings.missing
    units = settings.units or {}
    numbers = {}
    for key, name in names.items():
        values = table.numbers(name)
        factor = table.factor(name, UNITS[key], units.get(key)) if key in UNITS else 1.0
        missing = np.isin(values, codes)
        if settings.missing is None:
            _check_codes(key, values[missing], factor, settings)
        numbers[key] = np.where(missing, np.nan, values) * factor
    time, local = _times(table, columns["time"], settings)
    place = _locations(table, columns, numbers, settings)
    tensor = _tensor(numbers, settings)
    sizes, told = _sizes(table, columns, numbers, tensor, settings)
    other = {key: numbers[key] for key in ("time_uncertainty",) if key in columns}
    if "step" in columns:
        other["step"] = table.text(columns["step"]).to_numpy(object)
    record = build_record(settings, time, place, sizes, tensor, source=str(path), **other)
    record.attrs |= {"sizes_text": told} if told else {}
    record.attrs |= {"times_text": f"{local} without an offset, as {settings.time_zone or 'UTC'}"} if local else {}
    limits = settings.filter
    quality = table.rows if limits and (limits.maximum or limits.minimum) else ()
    quality = {name: table.numbers(name, strict=False) for name in quality}
    words = table.rows if limits and (limits.only or limits.without) else ()
    words = {name: table.text(name).to_numpy(object) for name in words}
    kinds = {key: table.text(columns[key]).to_numpy(object) for key in (EVENT_TYPE, STATUS) if key in columns}
    return filter_events(record, settings, quality, str(path), table.repeated, words, kinds)


def _listed(value: str | list[str]) -> list[str]:
    return [value] if isinstance(value, str) else value


def _check_untold_kinds(table: Table, named: set[str], settings: RecordSlice) -> None:
    """Raise InputError for a column of which nothing is said, and whose cells say that events are no seismicity."""
    limits, kept = settings.filter, kept_words(settings)
    asked = {*((limits and limits.only) or ()), *((limits and limits.without) or ())}
    for name in table.rows:
        if name in named or name in asked:
            continue
        cells = table.text(name).value_counts()
        for kind in (EVENT_TYPE, STATUS):
            found = [cell for cell in cells.index if is_left_out(kind, plain_word(cell))]
            if found and plain_word(found[0]) not in kept:
                raise InputError(
                    f"{table.source}: column {name!r}: {cells[found[0]]} of {len(table.rows)} rows are {found[0]!r}, "
                    f"no seismicity: say record.columns.{kind}: {name} to leave such out, or record.filter.keep: "
                    f"[{found[0]}] to count them"
                )


def _check_codes(key: str, codes: np.ndarray, factor: float, settings: RecordSlice) -> None:
    """Raise InputError where usual codes of a missing value may as well be coordinates, of this domain.

    Outside the domain the question does not arise: the event is left out either way.
    """
    axis, up = ("z", -1.0) if key == "depth" else (key, 1.0)
    domain = settings.domain
    axes = (domain.plane or "xyz") if domain else ""
    if axis not in MINE_COORDINATES or axis not in axes:
        return
    low, high = (corner[axes.index(axis)] for corner in (domain.lower, domain.upper))
    place = up * factor * codes
    inside = (low <= place) & (place <= high)
    if inside.any():
        raise InputError(
            f"{settings.file}: column {getattr(settings.columns, key)!r}: {codes[inside][0]:g} stands for a missing "
            f"value in many files, and lies in this domain ({int(inside.sum())} such); say it with record.missing: a "
            "list of the numbers that do, [] if none does"
        )


def _times(table: Table, names: str | list[str], settings: RecordSlice) -> tuple[np.ndarray, int]:
    """UTC times (event,) datetime64[ns] of one column, or of date, clock and offset; how many had no offset."""
    names = _listed(names)
    text = table.text(names[0])
    there = text != ""
    for name in names[1:]:
        text = text + " " + table.text(name)
        there &= table.text(name) != ""
    where = f"{table.source}: column {names[0]!r}"
    time, local = parse_times(text.where(there, ""), settings.date_order, settings.time_zone, where)
    wrong = np.isnat(time) & there.to_numpy()
    if wrong.any():
        table.refuse(wrong, names[0], f"({text[wrong].iloc[0]}) is not a date and time", "write 2019-08-01T12:00:00")
    return time, local


def _locations(table: Table, columns: Mapping, numbers: Mapping, settings: RecordSlice) -> np.ndarray:
    """Mine coordinates (event, 3) m, NaN where one is missing. Raises InputError for degrees off the globe."""
    if set(MINE_COORDINATES) <= set(columns):
        return np.column_stack([numbers[key] for key in MINE_COORDINATES])
    for key, most in (("latitude", 90.0), ("longitude", 180.0)):
        table.refuse(
            np.abs(numbers[key]) > most, columns[key], f"is no {key}, which ends at {most:g} degrees", "correct it"
        )
    globe = np.column_stack([numbers[key] for key in GLOBE_COORDINATES])
    location = np.full(globe.shape, np.nan)
    known = np.isfinite(globe).all(axis=1)
    location[known] = MineFrame(settings.frame).to_mine(*globe[known].T)
    return location


def _sizes(
    table: Table, columns: Mapping, numbers: Mapping, tensor: np.ndarray | None, settings: RecordSlice
) -> tuple[dict[str, np.ndarray], str]:
    """Sizes of every kind (event,), NaN where unknown, and a sentence on the magnitudes that were converted."""
    sizes = {key: numbers[key] for key in SIZE_NAMES if key in columns}
    for key in ("potency", "moment"):
        if key in sizes:
            sizes[key] = np.where(sizes[key] == 0, np.nan, sizes[key])  # what was never computed
            table.refuse(
                sizes[key] < 0,
                columns[key],
                "is not positive",
                "if it is a logarithm, name it log_potency; else correct it",
            )
    if MAGNITUDE not in columns and MAGNITUDE_TYPE not in columns:
        return sizes, ""
    source = MAGNITUDE if MAGNITUDE in columns else "mw"
    needed = np.ones(len(table.rows), bool) if tensor is None else ~np.isfinite(tensor).all(axis=(1, 2))
    for key, values in sizes.items():
        needed &= np.isnan(values) | (key == source)
    kinds = table.text(columns[MAGNITUDE_TYPE]) if MAGNITUDE_TYPE in columns else [""] * len(table.rows)
    conversions = settings.conversions or {}
    mw, used = moment_magnitudes(numbers[source], list(kinds), conversions, needed, table.source)
    sizes["mw"] = np.where(np.isnan(mw), sizes.get("mw", np.nan), mw) if source == MAGNITUDE else mw
    return sizes, sizes_text(used, conversions)


def _tensor(numbers: Mapping, settings: RecordSlice) -> np.ndarray | None:
    """Potency tensors (event, 3, 3) m3, east north up, NaN where a component is empty; None without columns."""
    axes = FRAMES[settings.tensor_frame or "ENU"]
    for kind in TENSOR_KINDS:
        if f"{kind}_xx" not in numbers:
            continue
        tensor = np.empty((len(numbers[f"{kind}_xx"]), 3, 3))
        for name, (i, j) in COMPONENTS.items():
            tensor[:, i, j] = tensor[:, j, i] = numbers[f"{kind}_{name}"]
        tensor = axes.T @ tensor @ axes
        tensor[~np.isfinite(tensor).all(axis=(1, 2)) | ~tensor.any(axis=(1, 2))] = np.nan  # zero: never computed
        if kind == "potency":
            return tensor
        moduli = [settings.lame_lambda, settings.shear_modulus]
        if None in moduli:
            raise InputError("record: moment tensors need lame_lambda and shear_modulus of the host rock, in Pa")
        return potency_from_moment(tensor, *map(float, moduli))
    return None
