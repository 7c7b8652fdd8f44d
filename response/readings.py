"""Readings of an instrument: a CSV file with a date and a column for each anchor, as one value for each step."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from common.errors import InputError
from response.observation_settings import Instrument

NINES = re.compile(r"-?9{3,}(?:\.(?:9+|25))?")  # as loggers and programs write a value that is missing


def read_readings(instrument: Instrument, where: str) -> pd.DataFrame:
    """Readings (date, column) in SI units, by date (UTC, without a zone).

    where: key of the instrument in the mine file, for messages. Raises InputError, one line, for a file that cannot be
    read, a column that it does not have, dates that are none, and values that are no numbers.
    """
    path = Path(str(instrument.file))
    try:
        table = pd.read_csv(path, comment="#", skipinitialspace=True, dtype=str, encoding="utf-8-sig")
        if not isinstance(table.index, pd.RangeIndex):  # pandas takes the first column of such a file as names of rows
            raise ValueError("rows have more fields than the line of column names")
    except (OSError, ValueError, pd.errors.ParserError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{where}.file: {path}: cannot be read as CSV ({reason})") from error
    for key, names in (("date", [instrument.date]), ("columns", list(instrument.columns))):
        for name in names:
            if name not in table:
                raise InputError(f"{where}.{key}: {path.name} has no column {name}; it has {', '.join(table.columns)}")
    dates = pd.to_datetime(table[instrument.date], format="ISO8601", errors="coerce", utc=True)
    if dates.isna().any():
        line = int(dates.isna().to_numpy().argmax())
        value = table[instrument.date].iloc[line]
        raise InputError(f"{where}.date: {path.name}: row {line + 1}: {value} is no date; write it as 2010-03-31")
    values = table[list(instrument.columns)].apply(pd.to_numeric, errors="coerce").astype(float)
    bad = ~np.isfinite(values) & table[list(instrument.columns)].notna()
    if bad.to_numpy().any():
        line, column = np.argwhere(bad.to_numpy())[0]
        value = table[instrument.columns[column]].iloc[line]
        raise InputError(
            f"{where}.columns: {path.name}: row {line + 1}, {instrument.columns[column]}: {value} is no number"
        )
    for name in instrument.columns:
        _refuse_codes(values[name].to_numpy(), f"{where}.columns: {path.name}: {name}")
    values.index = dates.dt.tz_localize(None)
    return (values * instrument.factor()).sort_index(kind="stable")


def _refuse_codes(values: NDArray, where: str) -> None:
    """Raise InputError for numbers of nines, which stand for no reading, that lie apart from all others of a column:
    farther from them than they are from each other."""
    known = values[np.isfinite(values)]
    nines = np.array([NINES.fullmatch(f"{value:.10g}") is not None for value in known], bool)
    others = known[~nines]
    if not len(others):
        return
    width = max(float(np.ptp(others)), 1.0)
    apart = known[nines & ((known > others.max() + width) | (known < others.min() - width))]
    if len(apart):
        raise InputError(
            f"{where}: is {apart[0]:.10g} a missing reading ({len(apart)} such; the others run from "
            f"{others.min():g} to {others.max():g})? Leave the cell empty"
        )


def at_steps(readings: pd.DataFrame, steps: list[dict], since: str | None) -> NDArray:
    """Last reading within the dates of each step, (step, column); NaN without one.

    since: step whose last reading is taken from all later ones; rows up to it are NaN. Without it readings stay as they
    are.
    """
    found = np.full((len(steps), readings.shape[1]), np.nan)
    for number, step in enumerate(steps):
        if not step["start"]:
            continue
        start, end = (pd.Timestamp(step[key]).tz_localize(None) for key in ("start", "end"))
        own = readings[(readings.index >= start) & (readings.index < end)]
        for column in range(readings.shape[1]):
            known = own.iloc[:, column].dropna()
            if len(known):
                found[number, column] = known.iloc[-1]
    if since is not None:
        first = [step["name"] for step in steps].index(since)
        found = found - found[first]
        found[: first + 1] = np.nan
    return found
