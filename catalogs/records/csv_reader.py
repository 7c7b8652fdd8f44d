"""Records in CSV: the configuration says which column is what."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from catalogs.frame import MineFrame
from catalogs.records.build import SIZE_NAMES, build_record, potency_from_moment
from catalogs.records.filters import filter_events
from pipeline.errors import InputError

VOIGT = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "yz": (1, 2), "xz": (0, 2), "xy": (0, 1)}
MINE_COORDINATES = ("x", "y", "z")
GLOBE_COORDINATES = ("latitude", "longitude", "depth")
TENSOR_KINDS = ("potency", "moment")
COLUMN_KEYS = (
    "time",
    *MINE_COORDINATES,
    *GLOBE_COORDINATES,
    *SIZE_NAMES,
    *(f"{kind}_{name}" for kind in TENSOR_KINDS for name in VOIGT),
    "time_uncertainty",
    "step",
)


def read(settings: dict) -> xr.Dataset:
    """The events of a CSV file in the form of catalogs.schema, filtered (catalogs.records.filters).

    settings: file, mine, twin, location_error (m), lame_lambda, shear_modulus (Pa), frame (with latitude, longitude),
    filter, and columns, which names the file's columns: time (one column, or a list of two: date and time of day; ISO
    8601, UTC), x, y, z (m) or latitude, longitude (degrees), depth (m below sea level), at least one of potency (m3),
    log_potency, moment (N m), mw, and optionally potency_xx, _yy, _zz, _yz, _xz, _xy (m3, tensor shear) or moment_xx
    ... (N m), time_uncertainty (s), step. Lines that begin with # are comments. Raises InputError, naming file, column
    and event, for what is missing, not a number, or not a date; tensors and sizes may be empty, an event needs one.
    """
    path = Path(settings["file"])
    columns = dict(settings.get("columns") or {})
    table = _read_table(path)
    _check_columns(columns, table, path)
    time = _times(table, columns["time"], path)
    sizes = {key: _numbers(table, columns[key], path) for key in SIZE_NAMES if key in columns}
    tensor = _tensor(table, columns, settings, path)
    present = [np.isfinite(values) for values in sizes.values()]
    if tensor is not None:
        present.append(np.isfinite(tensor).all(axis=(1, 2)))
    _refuse(~np.logical_or.reduce(present), table, path, "an event without a size", "fill it in or remove the line")
    if "potency" in sizes or "moment" in sizes:
        for key in ("potency", "moment"):
            if key in sizes:
                _refuse(sizes[key] <= 0, table, path, f"column {columns[key]!r} is not positive", "remove the line")
    other = {}
    if "time_uncertainty" in columns:
        other["time_uncertainty"] = _numbers(table, columns["time_uncertainty"], path)
    if "step" in columns:
        other["step"] = table[columns["step"]].fillna("").astype(str).to_numpy(object)
    record = build_record(settings, time, _locations(table, columns, settings, path), sizes, tensor, **other)
    quality = {name: pd.to_numeric(table[name], errors="coerce").to_numpy(float) for name in table}
    return filter_events(record, settings.get("filter") or {}, quality, source=str(path))


def _read_table(path: Path) -> pd.DataFrame:
    """The file as text, one row per event."""
    try:
        table = pd.read_csv(path, dtype=str, comment="#", skipinitialspace=True)
    except (OSError, ValueError) as error:  # pandas' parser errors are ValueErrors
        raise InputError(f"{path}: not a readable CSV file ({error}); give a comma-separated table") from error
    if table.empty:
        raise InputError(f"{path}: no events in the file")
    return table


def _check_columns(columns: Mapping, table: pd.DataFrame, path: Path) -> None:
    """Every key known, every column there, a time, a location and a size among them."""
    where = "record.columns"
    unknown = set(columns) - set(COLUMN_KEYS)
    if unknown:
        raise InputError(f"{where}.{sorted(unknown)[0]}: not a column kind; known are {', '.join(COLUMN_KEYS)}")
    if "time" not in columns:
        raise InputError(f"{where}.time: missing; name the column of {path} that holds the date and time")
    if not any(set(names) <= set(columns) for names in (MINE_COORDINATES, GLOBE_COORDINATES)):
        raise InputError(f"{where}: {path}: name the columns x, y and z, or latitude, longitude and depth")
    kinds = [kind for kind in TENSOR_KINDS if all(f"{kind}_{name}" in columns for name in VOIGT)]
    if not kinds and not any(key in columns for key in SIZE_NAMES):
        raise InputError(f"{where}: {path}: name a column of sizes: {', '.join(SIZE_NAMES)}, or six of a tensor")
    for kind in TENSOR_KINDS:
        named = [f"{kind}_{name}" for name in VOIGT if f"{kind}_{name}" in columns]
        if 0 < len(named) < len(VOIGT):
            raise InputError(f"{where}: {path}: a tensor needs all six of {kind}_xx ... {kind}_xy")
    for key, names in columns.items():
        for name in [names] if isinstance(names, str) else names:
            if name not in table:
                raise InputError(f"{path}: column {name!r} ({where}.{key}) is missing; it has {', '.join(table)}")


def _times(table: pd.DataFrame, names: str | list[str], path: Path) -> np.ndarray:
    """UTC times (event,) datetime64[ns] from one column, or a date column and a time-of-day column."""
    names = [names] if isinstance(names, str) else list(names)
    text = table[names[0]].str.strip()
    for name in names[1:]:
        text = text + "T" + table[name].str.strip()
    time = pd.to_datetime(text, format="ISO8601", utc=True, errors="coerce")
    bad = time.isna().to_numpy()
    if bad.any():
        value = text.iloc[int(np.flatnonzero(bad)[0])]
        _refuse(
            bad, table, path, f"column {names[0]!r}: {value!r} is not an ISO 8601 time", "write 2019-08-01T12:00:00"
        )
    return time.dt.tz_localize(None).to_numpy("datetime64[ns]")


def _numbers(table: pd.DataFrame, name: str, path: Path) -> np.ndarray:
    """A column of numbers, NaN where empty."""
    values = pd.to_numeric(table[name], errors="coerce").to_numpy(float)
    wrong = (
        np.isnan(values) & table[name].notna().to_numpy() & (table[name].str.strip().str.lower() != "nan").to_numpy()
    )
    _refuse(wrong, table, path, f"column {name!r} is not a number", "correct it")
    return values


def _locations(table: pd.DataFrame, columns: Mapping, settings: Mapping, path: Path) -> np.ndarray:
    """Mine coordinates (event, 3) m, none of them NaN."""
    own = set(MINE_COORDINATES) <= set(columns)
    keys = MINE_COORDINATES if own else GLOBE_COORDINATES
    values = [_numbers(table, columns[key], path) for key in keys]
    for key, column in zip(keys, values, strict=True):
        bad = ~np.isfinite(column)
        _refuse(
            bad, table, path, f"column {columns[key]!r}: NaN location", "an event needs a location: remove the line"
        )
    return np.column_stack(values) if own else MineFrame(settings.get("frame")).to_mine(*values)


def _tensor(table: pd.DataFrame, columns: Mapping, settings: Mapping, path: Path) -> np.ndarray | None:
    """Potency tensors (event, 3, 3) m3, NaN where a component is empty; None if no columns are named."""
    for kind in TENSOR_KINDS:
        if f"{kind}_xx" not in columns:
            continue
        tensor = np.empty((len(table), 3, 3))
        for name, (i, j) in VOIGT.items():
            tensor[:, i, j] = tensor[:, j, i] = _numbers(table, columns[f"{kind}_{name}"], path)
        tensor[~np.isfinite(tensor).all(axis=(1, 2))] = np.nan
        if kind == "potency":
            return tensor
        moduli = [settings.get(name) for name in ("lame_lambda", "shear_modulus")]
        if None in moduli:
            raise InputError("record: moment tensors need lame_lambda and shear_modulus of the host rock, in Pa")
        return potency_from_moment(tensor, *map(float, moduli))
    return None


def _refuse(bad: np.ndarray, table: pd.DataFrame, path: Path, what: str, remedy: str) -> None:
    """Raise InputError for the first bad row and say how many there are."""
    if np.any(bad):
        row = int(np.flatnonzero(bad)[0])
        raise InputError(f"{path}: event {row + 1} of {len(table)}: {what} ({int(np.sum(bad))} such); {remedy}")
