"""What part of a record is compared: a box, dates, sizes and quality columns, each with its count before and after."""

import json
from collections.abc import Mapping

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.errors import InputError

KEYS = ("lower", "upper", "start", "end", "minimum_potency", "maximum", "minimum")


def filter_events(
    events: xr.Dataset, settings: Mapping, columns: Mapping[str, np.ndarray] | None = None, source: str = "record"
) -> xr.Dataset:
    """The events that pass every filter, and in attrs["filter"] what each took (JSON: filter, value, before, after).

    settings: lower, upper (3 numbers in m: a box, its faces included), start, end (ISO text; start <= time < end, UTC),
    minimum_potency (m3), maximum and minimum ({column: value}: quality columns of the file, in the file's own units).
    columns: name -> (event,) numbers of the file, for maximum and minimum. A missing value passes no filter.
    Raises InputError naming `source` and the key for an unknown key or column, a bad date, or when no event is left.
    """
    where = f"{source}: record.filter"
    unknown = set(settings) - set(KEYS)
    if unknown:
        raise InputError(f"{where}.{sorted(unknown)[0]}: not a filter; known are {', '.join(KEYS)}")
    columns = columns or {}
    kept = np.ones(events.sizes["event"], bool)
    account = []
    for key, value, passes in _conditions(events, settings, columns, where):
        before = int(kept.sum())
        kept &= passes
        after = int(kept.sum())
        account.append({"filter": key, "value": value, "before": before, "after": after})
        if after == 0:
            raise InputError(f"{where}.{key}: no event left ({before} before this filter); widen it")
    if not kept.any():
        raise InputError(f"{source}: no events in the file")
    filtered = events.isel(event=np.flatnonzero(kept))
    filtered.attrs["filter"] = json.dumps(account)
    return filtered


def _conditions(events: xr.Dataset, settings: Mapping, columns: Mapping[str, np.ndarray], where: str):
    """Yield (key, value, (event,) bool) for each filter named, always in the same order."""
    location = events["location"].values
    for key, inside in (("lower", np.greater_equal), ("upper", np.less_equal)):
        if settings.get(key) is not None:
            corner = np.asarray(settings[key], float)
            if corner.shape != (3,):
                raise InputError(f"{where}.{key}: expected three coordinates, got {settings[key]}")
            yield key, corner.tolist(), inside(location, corner).all(axis=1)
    time = events["time"].values
    for key, inside in (("start", np.greater_equal), ("end", np.less)):
        if settings.get(key):
            yield key, str(settings[key]), inside(time, parse_time(settings[key], f"{where}.{key}"))
    if settings.get("minimum_potency") is not None:
        smallest = float(settings["minimum_potency"])
        yield "minimum_potency", smallest, events["potency"].values >= smallest
    for key, inside in (("maximum", np.less_equal), ("minimum", np.greater_equal)):
        for column, bound in (settings.get(key) or {}).items():
            if column not in columns:
                raise InputError(
                    f"{where}.{key}.{column}: no such column of numbers; the file has {', '.join(columns)}"
                )
            yield f"{key}.{column}", float(bound), inside(np.asarray(columns[column], float), float(bound))


def parse_time(text: str, where: str) -> np.datetime64:
    """ISO 8601 text as UTC, ns; a time zone is converted, text without one is UTC. Raises InputError naming `where`."""
    try:
        moment = pd.Timestamp(text)
    except (ValueError, TypeError) as error:
        raise InputError(f"{where}: {text!r} is not an ISO date") from error
    if moment is pd.NaT:
        raise InputError(f"{where}: {text!r} is not an ISO date")
    if moment.tzinfo is not None:
        moment = moment.tz_convert("UTC").tz_localize(None)
    return np.datetime64(moment.to_datetime64(), "ns")
