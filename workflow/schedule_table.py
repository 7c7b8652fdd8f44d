"""The rows of a schedule, from a CSV or an Excel file. Each mistake is a line with its row and body."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pandas as pd

from catalogs.records.csv_table import Table, read_table
from catalogs.records.excel_sheets import is_workbook
from catalogs.records.times import PATTERN, parse_times
from common.errors import InputError, Mistakes
from workflow.mine_settings import Schedule, ScheduleColumns
from workflow.schedule_periods import DAY

HISTORY, PLANNED, OPEN = "history", "planned", "none"
WORDS = (HISTORY, PLANNED)  # in place of a date
DATED = ("start", "end", "filled")  # keys of the columns that hold dates
MAX_MONTH = 12
MIN_DATES_COMPARED = 5  # Days of fewer dates may all be up to MAX_MONTH by chance.
NUMBER_OF_DAY = re.compile(r"[3-6]\d{4}(\.\d+)?")  # days since 1900 of this century and the last one's end
MAX_SHOWN = 40  # Characters of a cell in a message.

When: TypeAlias = "pd.Timestamp | str | None"  # a day, one of WORDS, or nothing


@dataclass(frozen=True)
class Row:
    """A row of a schedule.

    number: from 1 below the header. where: how messages name it. body: as it is written. start, last: first and last
    day of mining; the latter may be a word, as the day of the fill. material: empty where the cell is. sound: False for
    a row with a mistake.
    """

    number: int
    where: str
    body: str
    start: pd.Timestamp | None
    last: When
    filled: When
    material: str
    period: str
    sound: bool


def read_rows(schedule: Schedule, path: Path, mistakes: Mistakes) -> list[Row]:
    """Rows that name a body, in their order. Adds a line for each mistake in a row.

    Raises InputError for a file that is no such table.
    """
    columns = schedule.columns or ScheduleColumns()
    names = {key: name for key in ScheduleColumns.model_fields if (name := getattr(columns, key)) is not None}
    needed = {"body", "end", *columns.model_fields_set, *(["start"] if schedule.period == "table" else [])}
    table = _table(schedule, path, {names[key]: f"schedule.columns.{key}" for key in names if key in needed})
    names = {key: name for key, name in names.items() if name in table.rows}
    cells = {key: table.rows[name].fillna("").str.strip() for key, name in names.items()}
    cells |= {key: table.text(names[key]) for key in DATED if key in names}
    try:
        table.words(names["body"])  # letters of a known encoding
    except InputError as error:
        raise InputError(f"schedule.file: {error}") from error
    times = _times(schedule, cells, table.source, mistakes)
    rows = []
    for number, body in enumerate(cells["body"]):
        before, where = len(mistakes.lines), f"schedule.file: {path}: row {number + 1}: {body or 'no body'}"
        if not body:
            mistakes.add(f"{where}: column {names['body']!r} is empty; name the body, or delete the row")
            continue
        text = {key: cells[key].iloc[number] if key in cells else "" for key in ScheduleColumns.model_fields}
        when: dict[str, When] = dict.fromkeys(DATED)
        for key in times:
            with mistakes.gather():
                when[key] = _when(f"{where}: column {names[key]!r}", text[key], times[key][number], key)
        days = when["start"], when["end"], when["filled"]
        row = Row(number + 1, where, body, *days, text["fill"], text["period"], bool(times))
        if len(mistakes.lines) == before and times:
            row = _with_last_day(row, schedule)
            mistakes.lines += _contradictions(row, schedule, names)
        rows.append(replace(row, sound=row.sound and len(mistakes.lines) == before))
    return rows


def _table(schedule: Schedule, path: Path, named: Mapping[str, str]) -> Table:
    """The table with the columns that are needed, by the key that names each. Raises InputError."""
    try:
        if schedule.sheet is not None and not is_workbook(path):
            raise InputError(f"{path}: a CSV file has no sheets; leave schedule.sheet out")
        return read_table(path, named, (), has_keys=False, sheet=schedule.sheet, has_comments=False)
    except InputError as error:
        raise InputError(f"schedule.file: {error}") from error


def _times(
    schedule: Schedule, cells: Mapping[str, pd.Series], source: str, mistakes: Mistakes
) -> dict[str, np.ndarray]:
    """Times of the columns of dates, by key, NaT for a cell that is no date; empty, and a line, where the order of day
    and month cannot be told."""
    text = {key: cells[key].map(_without_offset) for key in DATED if key in cells}
    together = pd.concat(text.values(), ignore_index=True)
    if line := _exchanged(together):
        mistakes.add(f"schedule.file: {source}: {line}")
        return {}
    try:
        times, _ = parse_times(together, schedule.date_order, None, source)
    except InputError as error:
        reason = str(error).replace("record.date_order", "schedule.date_order")
        if reason != str(error):
            mistakes.add(f"schedule.file: {reason}")
            return {}
        times = np.array([_time(cell, schedule.date_order) for cell in together])  # one of them is not possible
    return dict(zip(text, np.split(times, len(text)), strict=True))


def _without_offset(cell: str) -> str:
    """A date and time without its offset from UTC: the day of a schedule is that of the mine's clock."""
    found = PATTERN.fullmatch(cell)
    if found is None or found["hour"] is None or not (found["sign"] or found["zulu"]):
        return cell
    return re.sub(r"\s*\(?(?:UTC|GMT)?$", "", cell[: found.start("sign" if found["sign"] else "zulu")], flags=re.I)


def _exchanged(cells: pd.Series) -> str:
    """Line on dates in which a program seems to have exchanged day and month; empty without.

    A program that reads 03/04/2024 the other way makes a date of it, and leaves 13/04/2024 as text.
    """
    found = [match for cell in cells if (match := PATTERN.fullmatch(cell))]
    text = [match for match in found if match["first"] and match["second"].isdigit()]
    made = [match for match in found if match["year"] and match["mark"] == "-"]
    if len(made) < MIN_DATES_COMPARED or not text or any(int(match["day"]) > MAX_MONTH for match in made):
        return ""
    if any(max(int(match["first"]), int(match["second"])) <= MAX_MONTH for match in text):
        return ""
    return (
        f"dates such as {text[0][0]} are text, and all {len(made)} others, such as {made[0][0][:10]}, have days up to "
        f"{MAX_MONTH}: a program may have exchanged day and month in these; write all dates as 2024-03-31"
    )


def _time(cell: str, order: str | None) -> np.datetime64:
    """The time of a cell, NaT for what is none."""
    try:
        return parse_times(pd.Series([cell]), order or "day", None, "")[0][0]
    except InputError:
        return np.datetime64("NaT", "ns")


def _when(where: str, cell: str, time: np.datetime64, key: str) -> When:
    """The day or the word of a cell; None for an empty one. Raises InputError for what is neither."""
    if not np.isnat(time):
        return pd.Timestamp(time).normalize()
    if key != "start" and cell.casefold() in WORDS:
        return cell.casefold()
    if not cell:
        return None
    words = "" if key == "start" else f", or {HISTORY} or {PLANNED}"
    if NUMBER_OF_DAY.fullmatch(cell):
        words += f" ({cell} may be the number of a day in a spreadsheet: let the cell be a date)"
    raise InputError(f"{where}: {cell[:MAX_SHOWN]!r} is no date; write it as 2024-03-31{words}")


def _with_last_day(row: Row, schedule: Schedule) -> Row:
    """The row with the last day of mining in place of the first day after it, where that is what the table has."""
    is_after = schedule.ends == "day_after" and isinstance(row.last, pd.Timestamp)
    return replace(row, last=row.last - DAY) if is_after else row


def _contradictions(row: Row, schedule: Schedule, names: Mapping[str, str]) -> list[str]:
    """Lines on what contradicts itself in a row, or is missing from it."""
    found, is_day = [], isinstance(row.last, pd.Timestamp)
    if row.last is None:
        found.append(f"column {names['end']!r} is empty; give a date, {HISTORY} or {PLANNED}")
    if is_day and row.start is None and schedule.period == "table":
        found.append(f"column {names['start']!r} is empty; with period: table the row says when its step begins")
    if is_day and row.start is not None and row.last < row.start:
        found.append(f"mining ends before it starts, on {row.start:%Y-%m-%d}; correct the dates")
    if is_day and isinstance(row.filled, pd.Timestamp) and row.filled < row.last:
        found.append(
            f"is filled on {row.filled:%Y-%m-%d}, before mining ends on {row.last:%Y-%m-%d}; correct the dates"
        )
    if row.last == PLANNED and isinstance(row.filled, pd.Timestamp):
        found.append(f"is filled on {row.filled:%Y-%m-%d}, but its mining is {PLANNED}; give the date of its end")
    if row.filled is not None and row.material.casefold() == OPEN:
        found.append(f"has a date of fill, and {OPEN} as its material; leave one of the two out")
    if row.filled is not None and not row.material and schedule.fill is None:
        found.append("has a date of fill and no material; name it in the table, or for all by schedule.fill")
    return [f"{row.where}: {line}" for line in found]
