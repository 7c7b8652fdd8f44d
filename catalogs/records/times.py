"""Dates and times as mines export them: ISO 8601, day or month first, months by name, local time, UTC offsets.

And the time of recording: a file of events states when events occurred, not when the network was switched on.
"""

import datetime
import re
from collections.abc import Mapping
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from common.errors import InputError

FIRST_YEAR, LAST_YEAR = 1678, 2261  # whole years that nanoseconds since 1970 reach
FIRST, LAST = np.datetime64("1678-01-01"), np.datetime64("2261-12-31")  # limits of times in nanoseconds
# A longer silence has a chance of 0.1 % if days with events are random.
MAX_SILENCE_IN_MEAN_WAITS = np.log(1000.0)
DATE_PARTS = ("year", "month", "day", "hour", "minute", "second")
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
# Two digits of a year from this one on mean a year of the twentieth century, as in POSIX.
FIRST_TWO_DIGIT_YEAR_OF_1900S = 69
DATE = (
    r"(?:(?P<year>\d{4})(?P<mark>[-/.]?)(?P<month>\d{1,2})(?P=mark)(?P<day>\d{1,2})"
    r"|(?P<first>\d{1,2})[-/. ](?P<second>\d{1,2}|[A-Za-z]{3,9}\.?)[-/. ](?P<last>\d{4}|\d{2}(?!\d)))"
)
SECOND = r"(?::?(?P<whole>\d{2})(?:[.,](?P<fraction>\d+))?)?"
CLOCK = r"(?:[T ,;]+(?P<hour>\d{1,2}):?(?P<minute>\d{2})" + SECOND + r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?)?"
OFFSET = r"\s*(?:\(?(?:UTC|GMT)?(?P<sign>[-+])(?P<ahead>\d{1,2}):?(?P<minutes>\d{2})?\)?|(?P<zulu>Z|UTC|GMT))?"
PATTERN = re.compile(f"{DATE}{CLOCK}{OFFSET}", re.IGNORECASE)
OFFSET_OF_ISO = re.compile(r"[T ]\d[\d:.,]*\s*([-+\u2212])(\d{1,2})(?::?(\d{2}))?(?::\d{2}(?:\.\d+)?)?$", re.IGNORECASE)
DAY, ONE_SECOND, MILLISECOND, MICROSECOND = (
    np.timedelta64(size, "ns") for size in (86_400 * 10**9, 10**9, 10**6, 10**3)
)
EPOCHS = {  # of times that are numbers: an instant, its number, unit, to which it is rounded
    "excel": (np.datetime64("1899-12-30", "ns"), 0, DAY, MILLISECOND),  # a day off before March 1900, as the program is
    "excel_1904": (np.datetime64("1904-01-01", "ns"), 0, DAY, MILLISECOND),
    "matlab": (np.datetime64("1970-01-01", "ns"), 719_529, DAY, MILLISECOND),  # nanoseconds do not reach its year 0
    "unix": (np.datetime64("1970-01-01", "ns"), 0, ONE_SECOND, MICROSECOND),
    "unix_ms": (np.datetime64("1970-01-01", "ns"), 0, MILLISECOND, MICROSECOND),
}
CLOCK_PARTS = {
    "hour": (60 * 60 * ONE_SECOND, 24),
    "minute": (60 * ONE_SECOND, 60),
    "second": (ONE_SECOND, 61),
}  # unit, below
# Offsets from UTC, minutes: those in use, west of the date line and east of it.
FIRST_OFFSET, LAST_OFFSET, OFFSET_STEP = -12 * 60, 14 * 60, 15
# Abbreviations of zones, and names of the IANA database that they may mean. Many mean several offsets, and the database
# holds a few of them: its EST is five hours behind UTC, its CET has summer time.
ZONES_OF_ABBREVIATION = {
    **dict.fromkeys(("EST", "EDT"), "America/Toronto, Australia/Sydney, Australia/Brisbane"),
    **dict.fromkeys(("AEST", "AEDT", "AET"), "Australia/Sydney, Australia/Hobart, Australia/Brisbane"),
    **dict.fromkeys(("CST", "CDT"), "America/Chicago, Asia/Shanghai, Australia/Adelaide, Australia/Darwin"),
    **dict.fromkeys(("ACST", "ACDT"), "Australia/Adelaide, Australia/Broken_Hill, Australia/Darwin"),
    **dict.fromkeys(("WST", "AWST"), "Australia/Perth"),
    **dict.fromkeys(("MST", "MDT"), "America/Denver, America/Phoenix, Asia/Kuala_Lumpur"),
    **dict.fromkeys(("PST", "PDT"), "America/Vancouver, America/Los_Angeles, Asia/Manila"),
    **dict.fromkeys(("AST", "ADT"), "America/Halifax, Asia/Riyadh"),
    **dict.fromkeys(("AKST", "AKDT"), "America/Anchorage"),
    **dict.fromkeys(("NST", "NDT"), "America/St_Johns"),
    **dict.fromkeys(("NZST", "NZDT"), "Pacific/Auckland"),
    **dict.fromkeys(("CLT", "CLST"), "America/Santiago"),
    **dict.fromkeys(("CET", "CEST", "MET", "MEZ", "MESZ"), "Europe/Warsaw, Europe/Stockholm, Africa/Algiers"),
    **dict.fromkeys(("EET", "EEST"), "Europe/Helsinki, Africa/Cairo"),
    **dict.fromkeys(("WET", "WEST"), "Europe/Lisbon, Africa/Casablanca"),
    "BRT": "America/Sao_Paulo", "PET": "America/Lima", "HST": "Pacific/Honolulu", "BST": "Europe/London, Asia/Dhaka",
    "IST": "Asia/Kolkata, Europe/Dublin, Asia/Jerusalem", "MSK": "Europe/Moscow", "SAST": "Africa/Johannesburg",
    "CAT": "Africa/Harare", "EAT": "Africa/Nairobi", "WAT": "Africa/Lagos", "GST": "Asia/Dubai, Pacific/Guam",
    "SST": "Asia/Singapore, Pacific/Pago_Pago", "JST": "Asia/Tokyo", "KST": "Asia/Seoul", "HKT": "Asia/Hong_Kong",
    "WIB": "Asia/Jakarta",
}  # fmt: skip
MACHINE_ZONES = ("localtime", "posixrules", "factory")  # The first two are what a computer was set up with.
NANOSECONDS_PER = {"hour": 3_600_000_000_000, "minute": 60_000_000_000, "whole": 1_000_000_000}


def is_offset(hours: ArrayLike, minutes: ArrayLike, west: ArrayLike) -> NDArray:
    """True where hours and minutes ahead of UTC (west: behind it) are what clocks somewhere have; of any shape."""
    hours, minutes = np.asarray(hours, float), np.asarray(minutes, float)
    ahead = np.where(west, -1, 1) * (60 * hours + minutes)
    return (minutes < 60) & (minutes % OFFSET_STEP == 0) & (ahead >= FIRST_OFFSET) & (ahead <= LAST_OFFSET)


def check_offset(text: str, where: str) -> None:
    """Raise InputError for a date and time in ISO 8601 whose offset from UTC no clock has."""
    found = OFFSET_OF_ISO.search(text)
    if found and not is_offset(int(found[2]), int(found[3] or 0), found[1] != "+"):
        raise offset_refusal(text, where)


def offset_refusal(text: str, where: str) -> InputError:
    """The error for a text whose offset from UTC is none; where: file and column, or key."""
    return InputError(
        f"{where}: {text[:60]!r}: no clock has this offset from UTC; they run from -12:00 to +14:00 in quarters of an "
        "hour"
    )


def check_zone(zone: str) -> datetime.tzinfo:
    """The time zone of an IANA name ("Australia/Hobart") or an offset ("+10:00"). Raises InputError, also for an
    abbreviation."""
    fixed = re.fullmatch(r"(?:UTC|GMT)?([-+])(\d{1,2}):?(\d{2})?", zone)
    if fixed:
        hours, minutes = int(fixed[2]), int(fixed[3] or 0)
        if not is_offset(hours, minutes, fixed[1] == "-"):
            raise offset_refusal(zone, "record.time_zone")
        ahead = datetime.timedelta(hours=hours, minutes=minutes)
        return datetime.timezone(ahead if fixed[1] == "+" else -ahead)
    if meant := ZONES_OF_ABBREVIATION.get(zone.strip().upper()):
        raise InputError(
            f"record.time_zone: {zone!r} is an abbreviation, and many mean several offsets from UTC; name a place, "
            f"{meant}, or an offset such as +10:00"
        )
    try:
        if zone.lower() in MACHINE_ZONES:
            raise LookupError(zone)
        return ZoneInfo(zone)
    except (ValueError, OSError, LookupError) as error:
        raise InputError(
            f"record.time_zone: {zone!r} is no zone; give a name such as Australia/Hobart, or +10:00"
        ) from error


def zones_of_abbreviation(text: str) -> str:
    """IANA names, separated by commas, that an abbreviation of a zone at the end of a text may mean; empty without."""
    word = re.search(r"(?:^|[\W\d_])([A-Za-z]+)\W*$", text)
    return ZONES_OF_ABBREVIATION.get(word[1].upper(), "") if word else ""


def parse_time(text: str, where: str) -> np.datetime64:
    """ISO 8601 text as UTC, ns; a time zone is converted, text without one is UTC. Raises InputError naming `where`."""
    check_offset(text, where)
    try:
        moment = pd.Timestamp(text if text[:1].isdigit() else None)  # it also reads "now"
    except (ValueError, TypeError) as error:
        raise InputError(f"{where}: {text!r} is not an ISO date") from error
    if moment is pd.NaT:
        raise InputError(f"{where}: {text!r} is not an ISO date")
    if not FIRST_YEAR <= moment.year <= LAST_YEAR:
        raise InputError(f"{where}: {text!r}: years run from {FIRST_YEAR} to {LAST_YEAR} here")
    if moment.tzinfo is not None:
        moment = moment.tz_convert("UTC").tz_localize(None)
    return np.datetime64(moment.to_datetime64(), "ns")


def parse_times(text: pd.Series, order: str | None, zone: str | None, source: str) -> tuple[np.ndarray, int]:
    """UTC times (event,) datetime64[ns] of a column of text, NaT where it is empty or no date; how many had no offset.

    order: "day" or "month", what 01/02/2019 begins with; None: found from days above 12. zone: of times without an
    offset of their own, IANA name or offset such as "+10:00"; None: UTC. An hour that a clock set back shows twice is
    taken as the later, one that it skips as its end. Raises InputError naming `source` where the order cannot
    be told, for a year outside 1678 to 2261, and for a zone that is none.
    """
    parts = text.str.strip().str.extract(f"^{PATTERN.pattern}$", flags=re.IGNORECASE)
    other = parts["first"].notna()  # day, month, year in this order or month before day
    month_name = parts["second"].str.lower().str[:3]
    named = other & month_name.isin(MONTHS)
    bare = other & ~named
    first = _numbers(parts["first"])
    second = month_name.map({name: float(number) for number, name in enumerate(MONTHS, 1)}).astype(float)
    second = second.where(named, _numbers(parts["second"]))
    short = _numbers(parts["last"])
    if bare.any() and not _day_first(first[bare], second[bare], short[bare], text, order, source):
        first, second = first.where(~bare, second), second.where(~bare, first)
    year = short.where(short > 99, short + np.where(short < FIRST_TWO_DIGIT_YEAR_OF_1900S, 2000, 1900)).where(
        other, _numbers(parts["year"])
    )
    strange = (year < FIRST_YEAR) | (year > LAST_YEAR)
    if strange.any():
        raise InputError(f"{source}: {text[strange].iloc[0]!r}: years run from {FIRST_YEAR} to {LAST_YEAR} here")
    dated = pd.DataFrame(
        {
            "year": year,
            "month": second.where(other, _numbers(parts["month"])),
            "day": first.where(other, _numbers(parts["day"])),
        }
    )
    days = pd.to_datetime(dated, errors="coerce").to_numpy("datetime64[ns]")
    time = days + _time_of_day(parts)
    ahead, minutes = (_numbers(parts[name]).fillna(0).to_numpy() for name in ("ahead", "minutes"))
    west = (parts["sign"] == "-").to_numpy()
    odd = ~is_offset(ahead, minutes, west)
    if odd.any():
        raise offset_refusal(text[odd].iloc[0], source)
    offset = np.where(west, -1, 1) * (60 * ahead + minutes)
    time -= offset.astype("timedelta64[m]").astype("timedelta64[ns]")
    local = (parts["sign"].isna() & parts["zulu"].isna()).to_numpy()
    if zone is not None:
        time[local] = _to_utc(time[local], zone)
    return time, int((local & ~np.isnat(time)).sum())


def times_of_numbers(values: np.ndarray, form: str, zone: str | None, source: str) -> tuple[np.ndarray, int]:
    """UTC times (event,) datetime64[ns] of numbers (event,), NaT where NaN; how many had no offset.

    form: one of EPOCHS; days are rounded to milliseconds, which a worksheet has, seconds to microseconds, which a
    number of 16 digits has. zone: of days, as of parse_times; Unix time is UTC. Raises InputError as it.
    """
    epoch, number, unit, step = EPOCHS[form]
    steps = np.round((values - number) * (unit / step))
    first, last = (
        np.datetime64(f"{year}-01-01").astype("datetime64[s]").astype(float) * (ONE_SECOND / step)
        - epoch.astype(float) / step.astype(float)
        for year in (FIRST_YEAR, LAST_YEAR + 1)
    )
    strange = (steps < first) | (steps >= last)  # NaN is neither
    if strange.any():
        raise InputError(
            f"{source}: {values[strange][0]:.17g} is no time of record.time_format: {form}: years run from "
            f"{FIRST_YEAR} to {LAST_YEAR} here; it may be {formats_of_number(values[strange][0])}"
        )
    known = np.isfinite(steps)
    time = np.full(len(values), np.datetime64("NaT", "ns"))
    time[known] = epoch + steps[known].astype(np.int64) * step
    if form.startswith("unix"):
        return time, 0
    if zone is not None:
        time = _to_utc(time, zone)
    return time, int(known.sum())


def formats_of_number(number: float) -> str:
    """Formats of EPOCHS by which a number is a time, each with its day, in a list for a message; else all of them."""
    days = {}
    for form, (epoch, zero, unit, _) in EPOCHS.items():
        second = (number - zero) * (unit / ONE_SECOND) + epoch.astype("datetime64[s]").astype(float)
        if FIRST.astype("datetime64[s]").astype(float) <= second <= LAST.astype("datetime64[s]").astype(float):
            days[form] = str(np.datetime64(int(second), "s"))[:10]
    return ", ".join(f"{form} ({day})" for form, day in days.items()) or ", ".join(EPOCHS)


def times_of_parts(parts: Mapping[str, np.ndarray], zone: str | None) -> tuple[np.ndarray, int]:
    """UTC times (event,) datetime64[ns] of years, months, days ..., NaT where they are none, and how many there are.

    parts: those of DATE_PARTS that there are columns of, numbers (event,); seconds may have fractions. zone: as of
    parse_times.
    """
    year, month, day = (parts[name] for name in DATE_PARTS[:3])
    dated = pd.DataFrame({"year": year, "month": month, "day": day})
    whole = np.all([values == np.floor(values) for name, values in parts.items() if name != "second"], axis=0)
    dated[~(whole & (year >= FIRST_YEAR) & (year <= LAST_YEAR))] = np.nan
    time = pd.to_datetime(dated, errors="coerce").to_numpy("datetime64[ns]")
    for name, (unit, most) in CLOCK_PARTS.items():
        if name in parts:
            values = parts[name]
            fits = (values >= 0) & (values < most)
            size = np.round(np.where(fits, values, 0) * (unit / MICROSECOND)).astype(np.int64) * MICROSECOND
            time = np.where(fits, time + size, np.datetime64("NaT", "ns"))
    if zone is not None:
        time = _to_utc(time, zone)
    return time, int((~np.isnat(time)).sum())


def shown_twice(time: np.ndarray, zone: str) -> np.ndarray:
    """True (event,) for times (event,) datetime64[ns], UTC, within an hour that a zone's clocks showed twice.

    Raises InputError for a zone that is not known.
    """
    local = pd.DatetimeIndex(time).tz_localize("UTC").tz_convert(check_zone(zone)).tz_localize(None)
    first, second = (
        local.tz_localize(check_zone(zone), ambiguous=np.full(len(time), summer), nonexistent="shift_forward")
        for summer in (True, False)
    )
    return np.asarray(first.tz_convert("UTC") < second.tz_convert("UTC"))


def _numbers(text: pd.Series) -> pd.Series:
    """A column of digits as numbers, NaN where there are none."""
    return pd.to_numeric(text, errors="coerce").astype(float)


def _time_of_day(parts: pd.DataFrame) -> np.ndarray:
    """Time since midnight (event,) timedelta64[ns]; NaT for an hour or minute that is none; 0 where not given."""
    hour, minute, second = (_numbers(parts[name]).fillna(0).to_numpy() for name in NANOSECONDS_PER)
    half = parts["half"].str[0].str.lower().to_numpy(object)
    twelve = pd.notna(half)
    wrong = (hour > 23) | (minute > 59) | (second > 60) | (twelve & ((hour < 1) | (hour > 12)))
    hour = np.where(twelve, hour % 12 + 12 * (half == "p"), hour)
    whole = sum(
        (value * scale).astype(np.int64)
        for value, scale in zip((hour, minute, second), NANOSECONDS_PER.values(), strict=True)
    )
    fraction = parts["fraction"].fillna("").str[:9].str.ljust(9, "0").astype(np.int64).to_numpy()
    return np.where(wrong, np.timedelta64("NaT", "ns"), (whole + fraction).astype("timedelta64[ns]"))


def _day_first(
    first: pd.Series, second: pd.Series, short: pd.Series, text: pd.Series, order: str | None, source: str
) -> bool:
    """True if the day comes before the month, so that 01/02/2019 is the first of February.

    first, second, short (event,): the three numbers of each date; text (event,): the dates as written; order: "day" or
    "month" where it is given, None: found from a number above 12. Raises InputError if neither number or each of them
    is above 12 in some date, and where the first looks like a year of two digits.
    """
    if order is not None:
        return order == "day"
    days, months = bool((first > 12).any()), bool((second > 12).any())
    if days and first.min() > 12 and short.max() < 100 and short.nunique() > 2 * first.nunique():
        raise InputError(
            f"{source}: {text.loc[first.index[0]]!r}: the first number is {first.min():g} to {first.max():g} and the "
            "last one varies: is the year first? Write 2019-08-31, or say record.date_order: day or month"
        )
    if days != months:
        return days
    example = text.loc[first.index[0]]
    why = "both orders are in it" if days else "no day is above 12"
    raise InputError(f"{source}: {example!r}: day or month first? {why}; say it with record.date_order: day or month")


def _to_utc(time: np.ndarray, zone: str) -> np.ndarray:
    """Local times (event,) datetime64[ns] as UTC."""
    local = pd.DatetimeIndex(time).tz_localize(
        check_zone(zone), ambiguous=np.zeros(len(time), bool), nonexistent="shift_forward"
    )
    return local.tz_convert("UTC").tz_localize(None).to_numpy("datetime64[ns]")


def recorded_period(time: NDArray) -> tuple[np.datetime64, np.datetime64]:
    """First and last instant (UTC, ns) of recording, from the times of all events of a file, NaT ignored.

    Whole days from the first to the last event, and on either side as much silence as chance may leave: where the
    first event comes later, the record begins with that silence before it; so at its end. Of fewer than
    two days with events the silence is without bounds: all of time.
    """
    time = np.asarray(time, "datetime64[ns]")
    days = np.unique(time[~np.isnat(time)].astype("datetime64[D]"))
    if len(days) < 2:
        return FIRST.astype("datetime64[ns]"), LAST.astype("datetime64[ns]")
    wait = int(np.ceil(MAX_SILENCE_IN_MEAN_WAITS * (days[-1] - days[0]).astype(int) / (len(days) - 1)))
    # in days, which reach further than nanoseconds do: decades of silence would come round at the other end
    return max(days[0] - wait, FIRST).astype("datetime64[ns]"), min(days[-1] + 1 + wait, LAST).astype("datetime64[ns]")
