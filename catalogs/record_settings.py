"""What a configuration may say of a record, checked without the record: it is imported before anything runs."""

import datetime
import re
import unicodedata
from collections.abc import Mapping
from zoneinfo import ZoneInfo

from pipeline.errors import InputError
from pipeline.voigt import COMPONENTS

FIRST_YEAR, LAST_YEAR = 1678, 2261  # whole years that nanoseconds since 1970 reach
SIZE_NAMES = ("potency", "log_potency", "moment", "mw")
FOREIGN_TYPES = ("ml", "mlv", "mb", "mb_lg", "mblg", "md", "mc", "ms", "mn", "mr")
MINE_COORDINATES = ("x", "y", "z")
GLOBE_COORDINATES = ("latitude", "longitude", "depth")
TENSOR_KINDS = ("potency", "moment")
MAGNITUDE, MAGNITUDE_TYPE = "magnitude", "magnitude_type"
UNITS = {**dict.fromkeys((*MINE_COORDINATES, "depth"), "m"), "potency": "m^3", "moment": "N m", "time_uncertainty": "s"}
UNITS |= {f"{kind}_{name}": UNITS[kind] for kind in TENSOR_KINDS for name in COMPONENTS}
TEXTS = ("time", MAGNITUDE_TYPE, "step")  # kinds of columns that hold no numbers
COLUMN_KEYS = (
    "time",
    *MINE_COORDINATES,
    *GLOBE_COORDINATES,
    *SIZE_NAMES,
    MAGNITUDE,
    MAGNITUDE_TYPE,
    *(f"{kind}_{name}" for kind in TENSOR_KINDS for name in COMPONENTS),
    "time_uncertainty",
    "step",
)


def check_columns(columns: Mapping) -> dict:
    """The columns as named: every key known, a time, a location and a size among them. Raises InputError."""
    where = "record.columns"
    if not isinstance(columns, Mapping):
        raise InputError(f"{where}: {str(columns)[:60]} is no list of kinds; write one per line, for example x: East")
    unknown = set(columns) - set(COLUMN_KEYS)
    if unknown:
        raise InputError(f"{where}.{sorted(unknown)[0]}: not a column kind; known are {', '.join(COLUMN_KEYS)}")
    for key, name in columns.items():
        parts = name if key == "time" and isinstance(name, list) and 1 <= len(name) <= 3 else [name]
        if not all(isinstance(part, str) for part in parts):
            most = "one, or a list of up to three (date, time of day, offset)" if key == "time" else "one"
            raise InputError(f"{where}.{key}: {str(name)[:60]} names no column of the file; give {most}, as text")
    if "time" not in columns:
        raise InputError(f"{where}.time: missing; name the column that holds the date and time")
    if not any(set(names) <= set(columns) for names in (MINE_COORDINATES, GLOBE_COORDINATES)):
        raise InputError(f"{where}: name the columns x, y and z, or latitude, longitude and depth")
    kinds = [kind for kind in TENSOR_KINDS if all(f"{kind}_{name}" in columns for name in COMPONENTS)]
    if not kinds and not any(key in columns for key in (*SIZE_NAMES, MAGNITUDE)):
        raise InputError(f"{where}: name a column of sizes: {', '.join((*SIZE_NAMES, MAGNITUDE))}, or six of a tensor")
    for kind in TENSOR_KINDS:
        named = [f"{kind}_{name}" for name in COMPONENTS if f"{kind}_{name}" in columns]
        if 0 < len(named) < len(COMPONENTS):
            raise InputError(f"{where}: a tensor needs all six of {kind}_xx ... {kind}_xy")
    if MAGNITUDE_TYPE in columns and not {MAGNITUDE, "mw"} & set(columns):
        raise InputError(f"{where}.{MAGNITUDE_TYPE}: of which magnitude? name its column in {where}.{MAGNITUDE}")
    if columns.get("mw", "").strip().lower() in FOREIGN_TYPES:
        raise InputError(
            f"{where}.mw: column {columns['mw']!r} is by its name no Mw; name it in {where}.{MAGNITUDE}, and say how "
            "to convert it in record.conversions, untyped: {slope: ..., offset: ...}"
        )
    return {
        key: plain(name) if isinstance(name, str) else [plain(part) for part in name] for key, name in columns.items()
    }


def plain(name: str) -> str:
    """A name as it is compared: composed letters, no blanks around it."""
    return unicodedata.normalize("NFC", name).strip()


def check_zone(zone: str) -> datetime.tzinfo:
    """The time zone of an IANA name ("Australia/Hobart") or an offset ("+10:00"). Raises InputError."""
    fixed = re.fullmatch(r"(?:UTC|GMT)?([-+])(\d{1,2}):?(\d{2})?", zone)
    if fixed:
        ahead = datetime.timedelta(hours=int(fixed[2]), minutes=int(fixed[3] or 0))
        if ahead < datetime.timedelta(hours=24):
            return datetime.timezone(ahead if fixed[1] == "+" else -ahead)
    try:
        return ZoneInfo(zone)
    except (ValueError, OSError, LookupError) as error:
        raise InputError(
            f"record.time_zone: {zone!r} is no zone; give a name such as Australia/Hobart, or +10:00"
        ) from error
