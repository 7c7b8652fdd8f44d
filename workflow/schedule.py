"""Steps and excavations of a mine from a table of dates and files of solids: section `schedule` of a mine's file.

Excavations are in the order of the bodies in the files, so that moving a date changes no stage but those of its steps.
"""

import difflib
import fnmatch
import itertools
import logging
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from common.errors import InputError, InputErrors, Mistakes
from mpm_core.geometry.solid_files import Body, bodies_in
from workflow.dates import read_date
from workflow.mine_settings import Excavation, Schedule, ScheduledSolids, Step
from workflow.schedule_periods import DAY, Period, calendar_periods, first_after, period_of
from workflow.schedule_table import HISTORY, OPEN, PLANNED, Row, When, read_rows

NO_LETTER = re.compile("[^A-Za-z0-9_-]")
LEADING_ZEROS = re.compile(r"(?<!\d)0+(?=\d)")
MAX_STEPS = 600  # 50 years of months
MIN_EMPTY_STEPS = 12  # As many steps in a row without mining may come from a wrong year.
MAX_PAIRS_COMPARED = 100_000  # of rows without a body and bodies without a row; of more, none is the one that is meant
MADE_DATE = re.compile(r"\d{4}-\d\d-\d\d( [\d:]+)?")
MAX_NAMED = 5  # Bodies that a note names.


@dataclass
class MadeSchedule:
    """What follows from a schedule: steps and excavations in order, how messages name the row of each excavation, a
    line for each mistake, and notes for the user. What has mistakes is left out of steps and excavations."""

    steps: list[Step] = field(default_factory=list)
    excavations: list[Excavation] = field(default_factory=list)
    rows: dict[str, str] = field(default_factory=dict)
    mistakes: Mistakes = field(default_factory=Mistakes)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class FoundBody:
    """A body, the file that it is in, as the mine's file would name it and as messages do, and the entry of `solids`
    that names the file. alone: True for the only body of its file."""

    body: Body
    file: str
    path: Path
    entry: ScheduledSolids
    alone: bool

    @property
    def names(self) -> list[str]:
        """Names by which a table may call it, as _plain has them."""
        return [_plain(self.body.name), *([_plain(Path(self.file).stem)] if self.alone else [])]


def make_schedule(schedule: Schedule, folder: Path) -> MadeSchedule:
    """The steps and excavations of a schedule; folder: that of the mine's file. A file that cannot be read is a
    mistake, too."""
    made = MadeSchedule()
    rows: list[Row] = []
    with made.mistakes.gather():
        table = _found(folder, schedule.file, "schedule.file")
        rows = read_rows(schedule, table, made.mistakes)
    could_read = bool(rows) or not made.mistakes.lines
    start, end = (_day(schedule, key, made.mistakes) for key in ("start", "end"))
    if start is not None and end is not None and not start < end:
        made.mistakes.add(f"schedule.end: {schedule.end} is not after start, {schedule.start}")
    bodies, are_all = _bodies(schedule, folder, made.mistakes)
    if could_read:
        matched = _match(bodies, are_all, rows, _shown(folder, schedule.file), made.mistakes)
        days = [day for row in rows if row.sound for day in _ends(row, 1)]
        days += [day for found, row in matched if row.sound for day in _ends(row, found.entry.parts or 1)]
        periods, start = _periods(schedule, [row for row in rows if row.sound], days, start, end, made.mistakes)
        _check_number(schedule, periods, [row for row in rows if row.sound], made.mistakes)
        made.steps = [period.step() for period in periods]
        for found, row in matched:
            if row.sound:
                with made.mistakes.gather():
                    _add(made, schedule, found, row, periods, start, end)
        made.notes = _notes([row for found, row in matched if row.sound and found.entry.parts is None], periods)
        made.notes += _notes_on_gaps(made, days)
    return made


def _shown(folder: Path, file: str) -> Path:
    """A file of the mine's file, relative to the working directory."""
    return Path(os.path.relpath(folder / file))


def _found(folder: Path, file: str, where: str) -> Path:
    """A file of the mine's file, relative to the working directory. Raises InputError for one that is missing."""
    path = _shown(folder, file)
    try:
        if path.is_file():
            return path
    except (OSError, ValueError):  # a name that the system refuses
        pass
    raise InputError(f"{where}: {path} is missing; paths resolve from {folder}")


def _day(schedule: Schedule, key: str, mistakes: Mistakes) -> pd.Timestamp | None:
    """The day of a key; None where it is not given, or is no date."""
    text = getattr(schedule, key)
    with mistakes.gather():
        return None if text is None else pd.Timestamp(read_date(f"schedule.{key}", text)).tz_localize(None).normalize()
    return None


def _bodies(schedule: Schedule, folder: Path, mistakes: Mistakes) -> tuple[list[FoundBody], bool]:
    """Bodies of all files, in order, and whether they are all. Adds a line for each file that has none."""
    found, before = [], len(mistakes.lines)
    for number, entry in enumerate(schedule.solids):
        for file in _files(folder, entry.file):
            with mistakes.gather():
                path = _found(folder, file, f"schedule.solids[{number}].file")
                try:
                    bodies = [body for body in bodies_in(path) if _is_picked(entry, body)]
                except InputError as error:
                    raise InputError(f"schedule.solids[{number}]: {error}") from error
                if not bodies:
                    raise InputError(
                        f"schedule.solids[{number}]: {path}: no body has a name that layer or element fits"
                    )
                found += [FoundBody(body, file, path, entry, len(bodies) == 1) for body in bodies]
    return found, len(mistakes.lines) == before


def _files(folder: Path, file: str) -> list[str]:
    """The files that a name with `*` stands for, by name; the name itself where it has none, or no file fits."""
    if "*" not in Path(file).name:
        return [file]
    try:
        names = sorted(path.name for path in (folder / file).parent.iterdir())
    except (OSError, ValueError):  # there is no such folder
        return [file]
    return [Path(file).with_name(name).as_posix() for name in fnmatch.filter(names, Path(file).name)] or [file]


def _is_picked(entry: ScheduledSolids, body: Body) -> bool:
    """True for a body whose name fits the pattern of its kind."""
    patterns = {"layer": entry.layer, "element": entry.element}
    return all(fnmatch.fnmatchcase(name, patterns[key] or "*") for key, name in body.keys.items())


def _match(
    bodies: Sequence[FoundBody], are_all: bool, rows: Sequence[Row], table: Path, mistakes: Mistakes
) -> list[tuple[FoundBody, Row]]:
    """Each body with its row, in the order of the bodies. Adds a line for each that is unmatched or there twice.

    are_all: False where a file cannot be read; then a row without a body is no mistake.
    """
    by_name: dict[str, Row] = {}
    for row in rows:
        first = by_name.setdefault(_plain(row.body), row)
        if first is not row:
            mistakes.add(f"{row.where}: this body has a row already (row {first.number}); leave one out")
    matched: list[tuple[FoundBody, Row]] = []
    without_row, seen, called = [], dict[str, FoundBody](), set[str]()
    for one in bodies:
        name = next((name for name in one.names if name in by_name), None)
        first_body = seen.setdefault(name or one.names[0], one)
        if first_body is not one:
            mistakes.add(
                f"schedule.solids: {one.path}: {one.body.name}: {first_body.path} has a body of this name already; "
                "rename one, or choose bodies with layer or element"
            )
        elif name is None:
            without_row += [] if one.body.hidden else [one]
        else:
            called.add(name)
            matched.append((one, by_name[name]))
    strangers = [row for name, row in by_name.items() if are_all and name not in called]
    is_few = len(strangers) * len(without_row) <= MAX_PAIRS_COMPARED
    near_bodies = {name: one.body.name for one in without_row for name in one.names if is_few}
    for row in strangers:
        remedy = _near(row.body, near_bodies)
        if MADE_DATE.fullmatch(row.body):
            remedy = "; a program has made a date of it: let the column be text, and write the name again"
        mistakes.add(f"{row.where}: no body of the solids has this name{remedy}")
    near_rows = {_plain(row.body): row.body for row in strangers if is_few}
    for one in without_row:
        remedy = _near(one.body.name, near_rows) or f"; add one, with {PLANNED} as its end if it has no date yet"
        mistakes.add(f"schedule.solids: {one.path}: {one.body.name}: has no row in {table}{remedy}")
    return matched


@contextmanager
def _in_row(row: Row) -> Iterator[None]:
    """Let lines of what is raised within begin with the place of a row."""
    try:
        yield
    except InputError as error:
        raise InputErrors(f"{row.where}: {line}" for line in error.lines) from error


def _plain(name: str) -> str:
    """A name as names are compared: in small letters, with single blanks between words and none around them."""
    return " ".join(name.split()).casefold()


def _near(name: str, others: Mapping[str, str]) -> str:
    """A question for the most similar of the others, by their names as _plain has them; empty if none is similar.

    Names that differ in leading zeros alone, which spreadsheets drop, are the most similar.
    """
    near = [other for other in others if LEADING_ZEROS.sub("", other) == LEADING_ZEROS.sub("", _plain(name))]
    near = near or difflib.get_close_matches(_plain(name), others, n=1, cutoff=0.8)
    return f"; did you mean {others[near[0]]}?" if near else ""


def _periods(
    schedule: Schedule,
    rows: Sequence[Row],
    days: Sequence[pd.Timestamp],
    start: pd.Timestamp | None,
    end: pd.Timestamp | None,
    mistakes: Mistakes,
) -> tuple[list[Period], pd.Timestamp | None]:
    """The periods of a schedule, and the day before which all is history. days: on which a body or a part ends."""
    if schedule.period == "table":
        periods = list(_table_periods(rows, start, end, mistakes))
    else:
        periods = calendar_periods(schedule.period, days, start, end)
    return periods, start if start is not None or not periods else periods[0].start


def _check_number(schedule: Schedule, periods: Sequence[Period], rows: Sequence[Row], mistakes: Mistakes) -> None:
    """Add a line on more steps than a mine has: a year is wrong then."""
    if len(periods) <= MAX_STEPS:
        return
    dated = sorted((row for row in rows if isinstance(row.last, pd.Timestamp)), key=lambda row: str(row.last))
    line = f"schedule.period: {schedule.period}: makes {len(periods)} steps, and {MAX_STEPS} are possible"
    if not dated:
        mistakes.add(f"{line}; no body has a date: correct start and end")
        return
    ends = " to ".join(f"{row.last:%Y-%m-%d} (row {row.number}: {row.body})" for row in (dated[0], dated[-1]))
    mistakes.add(f"{line}; bodies end from {ends}: correct a date, or give start and end")


def _table_periods(
    rows: Sequence[Row], start: pd.Timestamp | None, end: pd.Timestamp | None, mistakes: Mistakes
) -> Iterator[Period]:
    """The periods that rows have as their start and end, in order. Adds a line for each row whose period overlaps one
    before it, or has another name."""
    dated: list[Any] = [row for row in rows if isinstance(row.last, pd.Timestamp)]  # Any: they have both days
    known: dict[tuple[pd.Timestamp, pd.Timestamp], Any] = {}
    by_name: dict[str, Any] = {}
    before: Any = None
    for row in sorted(dated, key=lambda row: (row.start, row.last)):
        if (start is not None and row.last < start) or (end is not None and row.last >= end):
            continue
        first = known.get((row.start, row.last))
        if first is not None:
            if first.period != row.period:
                mistakes.add(
                    f"{row.where}: its period is {row.period or 'without a name'}, and with the same dates "
                    f"{first.period or 'without a name'} (row {first.number}); give both one name"
                )
            continue
        known[row.start, row.last] = row
        same = by_name.setdefault(row.period, row)
        if before is not None and row.start <= before.last:
            mistakes.add(
                f"{row.where}: its period begins on {row.start:%Y-%m-%d}, before that of row {before.number} ends, "
                f"{before.last:%Y-%m-%d}; with period: table periods follow each other"
            )
        elif row.period and same is not row:
            mistakes.add(f"{row.where}: period {row.period} has other dates in row {same.number}; correct one")
        else:
            with mistakes.gather():
                period = Period(row.period or f"{row.start:%Y-%m-%d}", row.start, row.last + DAY)
                with _in_row(row):
                    period.step()
                yield period
        before = row if before is None or row.last > before.last else before


def _ends(row: Row, parts: int) -> list[pd.Timestamp]:
    """Last day of mining of each part of a row's body, which are mined at an even rate; all on the last day of one
    without a start; none of one that has no dates."""
    if not isinstance(row.last, pd.Timestamp):
        return []
    first = row.last if row.start is None else row.start
    days = (row.last - first).days + 1
    return [first + DAY * (-(-number * days // parts) - 1) for number in range(1, parts + 1)]


def _when_mined(last: When, periods: Sequence[Period], start: pd.Timestamp | None, end: pd.Timestamp | None) -> str:
    """Name of the step in which a body or a part is mined: that in which it ends."""
    if not isinstance(last, pd.Timestamp):
        return str(last)
    if start is not None and last < start:
        return HISTORY
    period = period_of(last, periods)
    return PLANNED if period is None else period.name


def _add(
    made: MadeSchedule,
    schedule: Schedule,
    found: FoundBody,
    row: Row,
    periods: Sequence[Period],
    start: pd.Timestamp | None,
    end: pd.Timestamp | None,
) -> None:
    """Add the excavation of a body, or those of its parts. Raises InputErrors for one that cannot be."""
    body = NO_LETTER.sub("_", found.body.name.strip() if _plain(found.body.name) == _plain(row.body) else row.body)
    body = body.lstrip("_-") or body  # the first of a name is a letter or digit
    own = ("file", "layer", "element", "parts", "advance")
    solids = {key: value for key, value in found.entry.given().items() if key not in own}
    material = row.material or (schedule.fill if row.filled is not None else None)
    step = _when_mined(row.last, periods, start, end)
    parts = found.entry.parts
    if parts and row.start is None and isinstance(row.last, pd.Timestamp):
        raise InputError(
            f"{row.where}: has no start; solids with parts are mined from the start to the end of their row"
        )
    for number, last in enumerate(_ends(row, parts or 1) or [row.last] * (parts or 1), 1):
        name = f"{body}_{number}" if parts else body
        part: dict[str, Any] = {"part": [number, parts], "advance": found.entry.advance} if parts else {}
        entry: dict[str, Any] = {"name": name, "step": _when_mined(last, periods, start, end), "file": found.file}
        entry |= {**found.body.keys, **solids, **part}
        if material and material.casefold() != OPEN:
            entry |= {"fill": material, "filled": _when_filled(row, step, periods)}
        with _in_row(row):
            made.excavations.append(Excavation.of(entry))
        made.rows[name] = row.where


def _when_filled(row: Row, step: str, periods: Sequence[Period]) -> str:
    """Name of the step that places the fill of a body: the first one that begins on the day of the fill or later, after
    the mining of the body has ended."""
    if row.filled == HISTORY and step != HISTORY:
        raise InputError(f"{row.where}: is filled in {HISTORY} but not mined in it; give the date of the fill")
    if step == PLANNED or row.filled in (None, PLANNED):
        return PLANNED
    if row.filled == HISTORY:
        return HISTORY
    last = row.last if isinstance(row.last, pd.Timestamp) else pd.Timestamp.min
    period = first_after(last, row.filled, periods)
    return PLANNED if period is None else period.name


def _notes(rows: Sequence[Row], periods: Sequence[Period]) -> list[str]:
    """Sentences on the bodies that are not mined as the table has it."""
    across = []
    for row in rows:
        period = period_of(row.last, periods) if isinstance(row.last, pd.Timestamp) else None
        if period is not None and row.start is not None and row.start < period.start:
            across.append(row.body)
    if not across:
        return []
    more = f" and {len(across) - MAX_NAMED} more" if len(across) > MAX_NAMED else ""
    listed = f"{', '.join(across[:MAX_NAMED])}{more}"
    note = f"schedule: bodies that begin before the step in which they end are mined in that step: {listed}"
    note += "; schedule.solids.parts divides them"
    logging.info(note)
    return [note]


def _notes_on_gaps(made: MadeSchedule, days: Sequence[pd.Timestamp]) -> list[str]:
    """Sentences on many steps in a row without mining, and on a time in which no body ends."""
    notes = []
    if days and not made.steps:
        notes.append("schedule: no body ends between schedule.start and schedule.end, so that there are no steps")
    mined = {entry.step for entry in made.excavations}
    for is_mined, group in itertools.groupby(made.steps, key=lambda step: step.name in mined):
        names = [step.name for step in group]
        if not is_mined and len(names) >= MIN_EMPTY_STEPS:
            notes.append(
                f"schedule: nothing is mined in {len(names)} steps in a row, {names[0]} to {names[-1]}; correct the "
                "dates if a year is wrong"
            )
    for note in notes:
        logging.info(note)
    return notes
