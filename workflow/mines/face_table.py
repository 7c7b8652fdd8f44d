"""Dated positions of longwall faces from a CSV file: checked row by row, all mistakes at once."""

import itertools
import re
from pathlib import Path

import numpy as np
import pandas as pd

from catalogs.records.csv_filters import MISSING_VALUE_CODES
from catalogs.records.csv_table import Table, read_table
from catalogs.records.csv_units import unit_factor
from catalogs.records.filters import MAX_COORDINATE
from catalogs.records.times import parse_time
from common.errors import InputError, InputErrors, Mistakes
from workflow.mines.longwall import Panel, seconds

DATE, PANEL = "local_date", "panel"
ENDS = ("tailgate", "headgate")
COORDINATES = [f"{end}_{axis}" for end in ENDS for axis in "xy"]
ISO_DATE = re.compile(r"\d{4}-\d{2}-\d{2}(?:[T ]\d{2}:\d{2}(?::\d{2}(?:\.\d+)?)?)?")
PANEL_NAME = re.compile(r"[A-Za-z0-9_-]{1,30}")


def read_faces(path: Path) -> list[Panel]:
    """Panels in the order of their names, from a file with a row for each position of a face.

    Columns: local_date (ISO 8601, without an offset), headgate_x, headgate_y, tailgate_x, tailgate_y (m), panel. Rows
    of one panel are in order of time. Raises InputErrors, a line for each mistake with its row and column.
    """
    needed = [DATE, *COORDINATES, PANEL]
    table = read_table(path, dict.fromkeys(needed, "required"), COORDINATES, has_keys=False)
    if table.rows.empty:
        raise InputError(f"{path}: no position of a face; give a row for each")
    table.decide_decimals(COORDINATES)
    mistakes = Mistakes()
    numbers = {name: table.numbers(name, strict=False) for name in COORDINATES}
    places = {name: _coordinates(table, name, numbers, mistakes) for name in COORDINATES}
    dates = _dates(table, mistakes)
    names = table.text(PANEL)
    for row, name in _rows(table, ~names.map(lambda name: bool(PANEL_NAME.fullmatch(name))), PANEL):
        shown = f"{name[:40]!r} is no name of a panel" if name else "is empty"
        mistakes.add(f"{path}: row {row}: column {PANEL!r}: {shown}; give up to 30 letters, digits, - and _")
    if not mistakes.lines:
        _check_panels(table, places, dates, mistakes)
    if mistakes.lines:
        raise InputErrors(mistakes.lines)
    panels = []
    for name in sorted(set(names)):
        here = (names == name).to_numpy()
        tailgate, headgate = (np.column_stack([places[f"{end}_{axis}"][here] for axis in "xy"]) for end in ENDS)
        panels.append(Panel(name, dates[here], tailgate, headgate))
    return panels


def _rows(table: Table, wrong, name: str) -> list[tuple[int, str]]:
    """Number of each wrong row, from 1, and its cell in a column as it is written."""
    return [(int(row) + 1, table.rows[name].fillna("").iloc[row].strip()) for row in np.flatnonzero(np.asarray(wrong))]


def _coordinates(table: Table, name: str, numbers: dict[str, np.ndarray], mistakes: Mistakes) -> np.ndarray:
    """A column of coordinates (row,) m; adds a mistake for each that is none. numbers: all columns, as written."""
    values = numbers[name]
    codes = _missing(numbers, name)
    for row, text in _rows(table, ~(np.abs(values) <= MAX_COORDINATE) | codes, name):
        shown, more = f"{text[:40]!r} is no coordinate in metres" if text else "is empty", ""
        if codes[row - 1]:
            shown = f"{text[:40]!r} is no coordinate in metres but stands for a missing value, far from the others"
            more = f", or write {text}.01 if the face lies there" if "." not in text else ""
        mistakes.add(f"{table.source}: row {row}: column {name!r}: {shown}; correct it{more}")
    return values * unit_factor(table.source, name, name, "m", None, table.units.get(name))


def _missing(numbers: dict[str, np.ndarray], name: str) -> np.ndarray:
    """True (row,) for numbers of a column that stand for a missing value: a usual code that lies far from the others,
    while the other end of the face is a code, too, or not as far away as in other faces."""
    end, axis = name.split("_")
    values, other = numbers[name], numbers[f"{ENDS[end == ENDS[0]]}_{axis}"]
    codes = np.isin(values, MISSING_VALUE_CODES)
    return codes & _far(values, codes) & (np.isin(other, MISSING_VALUE_CODES) | _far(values - other, codes))


def _far(values: np.ndarray, suspect: np.ndarray) -> np.ndarray:
    """True (row,) for values that are farther from those that are not suspect than these are from each other."""
    others = values[~suspect & np.isfinite(values)]
    if not len(others):
        return np.zeros(len(values), bool)
    low, high = others.min(), others.max()
    width = max(high - low, 1.0)
    return (values > high + width) | (values < low - width)


def _dates(table: Table, mistakes: Mistakes) -> np.ndarray:
    """Dates (row,), s since 1970, NaN where a cell is none; adds a mistake for each of these."""
    dates = np.full(len(table.rows), np.nan)
    for place, text in enumerate(table.text(DATE)):
        where = f"{table.source}: row {place + 1}: column {DATE!r}"
        with mistakes.gather():
            if not ISO_DATE.fullmatch(text):
                shown = f"{text[:40]!r} is no local date" if text else "is empty"
                raise InputError(f"{where}: {shown}; write it as 2010-03-01")
            dates[place] = seconds(pd.Timestamp(parse_time(text, where)))
    return dates


def _check_panels(table: Table, places: dict[str, np.ndarray], dates: np.ndarray, mistakes: Mistakes) -> None:
    """Add the mistakes of rows that are right by themselves: no length, no order, no advance, names alike."""
    source, names = table.source, table.text(PANEL)
    for row in np.flatnonzero(np.all([places[f"tailgate_{axis}"] == places[f"headgate_{axis}"] for axis in "xy"], 0)):
        mistakes.add(f"{source}: row {row + 1}: headgate and tailgate are one point; a face has two ends")
    seen: dict[str, str] = {}
    for name in dict.fromkeys(names):
        other = seen.setdefault(name.lower(), name)
        if other != name:
            mistakes.add(f"{source}: column {PANEL!r}: {name!r} and {other!r} differ in capitals alone; write one")
        rows = np.flatnonzero(names == name)
        written = table.text(DATE)
        for before, row in itertools.pairwise(rows):
            if not dates[before] < dates[row]:
                mistakes.add(
                    f"{source}: row {row + 1}: column {DATE!r}: {written.iloc[row]} is not after "
                    f"{written.iloc[before]}, the row before of panel {name}; order the rows by date, each once"
                )
        if all(np.ptp(values[rows]) == 0 for values in places.values()):
            mistakes.add(f"{source}: panel {name}: its face does not move; give two positions at least")
