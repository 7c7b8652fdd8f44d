"""Times of a CSV record: one column, date and clock, parts, or numbers, in UTC; and whether they are local."""

import datetime
import logging
import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from catalogs.records.csv_columns import ColumnSettings
from catalogs.records.csv_table import Table
from catalogs.records.times import (
    DATE_PARTS,
    check_zone,
    formats_of_number,
    is_offset,
    parse_times,
    shown_twice,
    times_of_numbers,
    times_of_parts,
    zones_of_abbreviation,
)
from common.errors import InputError

TIME_WORDS = re.compile(r"time|date|datum|zeit|uhr|heure|hora|fecha|clock|tijd|\bora\b|czas|время", re.IGNORECASE)
LOCAL_WORDS = re.compile(
    r"(?i:local(?!i[sz])|lokal|orts?zeit|(?:site|mine)[ _]?time|(?<![a-z])loc(?![a-z])|локальн|местн|当地|本地)"
    r"|(?<![A-Za-z])(?:AES?T|AEDT|ACST|ACDT|AWST|NZST|NZDT|[ECMP][SD]T|AK[SD]T|CES?T|MEZ|MESZ|MSK|SAST|WIB|BRT|CLS?T|HKT"
    r"|JST|LT)(?![A-Za-z])"
)
UTC_WORDS = re.compile(r"utc|gmt|zulu|(?<![A-Za-z])(?-i:UT[01C]?)(?![A-Za-z])", re.IGNORECASE)
OFFSET_IN_NAME = re.compile(r"(?:utc|gmt|\(|\[)\s*([-+\u2212])\s*(\d{1,2})(?::?(\d{2}))?", re.IGNORECASE)


def read_times(
    table: Table, names: ColumnSettings, numbers: Mapping, settings, codes: Sequence[float]
) -> tuple[np.ndarray, str]:
    """UTC times (event,) datetime64[ns], and a clause on those without an offset, empty where all have one.

    numbers: columns of the parts of a time (event,), by their kind. codes: numbers that stand for a missing value.
    Raises InputError for what is no time, and where names of columns say that times are local and no key says of which
    zone.
    """
    time, local = _times(table, names, numbers, settings, codes)
    if not local:
        return time, ""
    columns = names.names_of_time() or [names.names()[part] for part in DATE_PARTS if part in numbers]
    _check_names(table, columns, settings.time_zone, local)
    return time, _text(time, local, settings.time_zone)


def _times(
    table: Table, names: ColumnSettings, numbers: Mapping, settings, codes: Sequence[float]
) -> tuple[np.ndarray, int]:
    """UTC times (event,) datetime64[ns] of a column, of date, clock and offset, or of parts; how many had no offset."""
    columns = names.names_of_time()
    if not columns:
        parts = {part: numbers[part] for part in DATE_PARTS if part in numbers}
        time, local = times_of_parts(parts, settings.time_zone)
        wrong = np.isnat(time) & np.all([np.isfinite(values) for values in parts.values()], axis=0)
        if wrong.any():
            date = ", ".join(f"{values[wrong][0]:g}" for values in parts.values())
            table.refuse(wrong, names.names()["year"], f"({date}) is not a date and time", "correct it")
        return time, local
    if settings.time_format:
        found = [table.numbers(name) for name in columns]
        days = np.sum([np.where(np.isin(values, codes), np.nan, values) for values in found], axis=0)
        where = f"{table.source}: column {columns[0]!r}"
        return times_of_numbers(days, settings.time_format, settings.time_zone, where)
    text = table.text(columns[0])
    there = text != ""
    for name in columns[1:]:
        text = text + " " + table.text(name)
        there &= table.text(name) != ""
    where = f"{table.source}: column {columns[0]!r}"
    time, local = parse_times(text.where(there, ""), settings.date_order, settings.time_zone, where)
    wrong = np.isnat(time) & there.to_numpy()
    if wrong.any():
        first = text[wrong].iloc[0]
        remedy = "write 2019-08-01T12:00:00"
        if re.fullmatch(r"[-+]?\d+[.,]?\d*", first):
            remedy = f"say record.time_format: {formats_of_number(float(first.replace(',', '.')))}"
        if meant := zones_of_abbreviation(first):
            remedy = f"take the abbreviation of the zone out, and name a place with record.time_zone: {meant}"
        table.refuse(wrong, columns[0], f"({first}) is not a date and time", remedy)
    return time, local


def _text(time: np.ndarray, local: int, zone: str | None) -> str:
    """Clause on the times without an offset: their number, the zone in which they were read, and how many of all times
    lie in an hour that the zone's clock showed twice. time (event,) datetime64[ns], UTC; local: number without an
    offset."""
    text = f"{local} without an offset, as {zone or 'UTC'}"
    twice = np.count_nonzero(shown_twice(time, zone)) if zone else 0
    if not twice:
        return text
    return f"{text}; {twice} in an hour that the clock showed twice, taken as the later: they may be an hour too late"


def _check_names(table: Table, columns: Sequence[str], zone: str | None, local: int) -> None:
    """Compare what the names of the columns of time say of their zone with record.time_zone.

    Raises InputError where a name says local, or states an offset, and no zone is given, where another column of time
    says local or UTC and so makes this one doubtful, and where name and zone contradict each other. Warns where nothing
    says what the times are.
    """
    stated = [(name, offset) for name in columns if (offset := OFFSET_IN_NAME.search(name))]
    ask = "say it with record.time_zone: Australia/Hobart, +10:00, or UTC if they are that"
    for name, offset in stated:
        sign = "+" if offset[1] == "+" else "-"
        text = f"{sign}{int(offset[2]):02d}:{int(offset[3] or 0):02d}"
        if not is_offset(int(offset[2]), int(offset[3] or 0), sign == "-"):
            continue
        if zone is None:
            raise InputError(
                f"{table.source}: column {name!r}: {local} time{'s' * (local != 1)} without an offset, of this zone by "
                f"the column's name; say it with record.time_zone: '{text}', or UTC if they are that"
            )
        if fixed_offset(zone) not in (None, fixed_offset(text)):
            raise InputError(
                f"{table.source}: column {name!r} is of {text} by its name, and record.time_zone is {zone}; correct "
                "the one that is wrong"
            )
    if stated:
        return
    utc = _first(UTC_WORDS, columns)
    at_place = _first(LOCAL_WORDS, columns) or next((name for name in columns if zones_of_abbreviation(name)), None)
    if utc and not at_place and zone is not None and fixed_offset(zone) != datetime.timedelta():
        raise InputError(
            f"{table.source}: column {utc!r} is in UTC by its name, and record.time_zone is {zone}; leave that out, or "
            "name the column of local time"
        )
    if zone is not None or (utc and not at_place):
        return
    if at_place:
        raise InputError(f"{table.source}: column {at_place!r}: local times of which zone ({local} such)? {ask}")
    others = [name for name in table.rows if name not in columns and TIME_WORDS.search(name)]
    if other := _first(LOCAL_WORDS, others) or _first(UTC_WORDS, others):
        raise InputError(
            f"{table.source}: column {columns[0]!r}: are its times local or UTC? Column {other!r} is there, too; {ask}"
        )
    logging.warning(
        "%s: %s no zone: read as UTC; give record.time_zone if they are local",
        table.source,
        "1 time has" if local == 1 else f"{local} times have",
    )


def fixed_offset(zone: str) -> datetime.timedelta | None:
    """Time by which a zone is ahead of UTC; None of one that changes in the course of time. Raises InputError."""
    return check_zone(zone).utcoffset(None)


def _first(words: re.Pattern, names: Iterable[str]) -> str | None:
    """The first of the names in which a word occurs."""
    return next((name for name in names if words.search(name)), None)
