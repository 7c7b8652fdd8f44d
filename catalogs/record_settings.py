"""The settings of a record, checked without the record: this is imported before anything runs."""

import codecs
import datetime
import re
import unicodedata
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self
from zoneinfo import ZoneInfo

from pydantic import Field, model_validator

from catalogs.units import unit_quantity
from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.settings import (
    AsTuple,
    Length,
    Settings,
    Size,
    Unit,
    choose,
    is_list,
    is_section,
    real_number,
    refusal,
    short,
)
from pipeline.voigt import COMPONENTS

FIRST_YEAR, LAST_YEAR = 1678, 2261  # whole years that nanoseconds since 1970 reach
SIZE_NAMES = ("potency", "log_potency", "moment", "mw")
SIZE_COLUMNS = (*SIZE_NAMES, "log_moment", "energy", "log_energy")
FOREIGN_TYPES = ("ml", "mlv", "mb", "mb_lg", "mblg", "md", "mc", "ms", "mn", "mr")
MINE_COORDINATES = ("x", "y", "z")
GLOBE_COORDINATES = ("latitude", "longitude", "depth")
TENSOR_KINDS = ("potency", "moment")
MAGNITUDE, MAGNITUDE_TYPE = "magnitude", "magnitude_type"
UNITS = {**dict.fromkeys((*MINE_COORDINATES, "depth"), "m"), "potency": "m^3", "moment": "N m", "energy": "J"}
UNITS["time_uncertainty"] = "s"
UNITS |= {f"{kind}_{name}": UNITS[kind] for kind in TENSOR_KINDS for name in COMPONENTS}
LINEAR = ("potency", "moment", "energy")  # sizes that a column may also hold the logarithm of: log_potency ...
UNITS |= {f"log_{kind}": UNITS[kind] for kind in LINEAR}
LOGARITHM = re.compile(r"(log|lg|ln)(_?10)?([\W_]|[MPE]0?\b|10\b)", re.IGNORECASE)  # how the name of one begins
DATE_PARTS = ("year", "month", "day", "hour", "minute", "second")
TIME_FORMATS = ("excel", "excel_1904", "unix", "unix_ms")
EVENT_TYPE, STATUS, MODE = "event_type", "evaluation_status", "evaluation_mode"
QUAKEML_TEXTS = (EVENT_TYPE, STATUS, MODE)  # what filters of a QuakeML file may ask for
TEXTS = ("time", MAGNITUDE_TYPE, "step", EVENT_TYPE, STATUS)  # kinds of columns that hold no numbers
READ_BY = {  # keys of a record that not every reader uses
    **dict.fromkeys(("columns", "tensor_frame", "missing", "decimal", "date_order", "time_zone"), ("csv",)),
    **dict.fromkeys(("energy_conversion", "encoding", "time_format"), ("csv",)),
    **dict.fromkeys(("twin", "conversions", "units"), ("csv", "quakeml")),
    **dict.fromkeys(("rigidity", "match_within", "orientations"), ("elk_creek",)),
}


Numbers = dict[str, real_number()]  # by column of the file
Text = choose(is_list, Annotated[tuple[str, ...], Field(min_length=1), AsTuple], str)
Words = dict[str, Text]
Box = Annotated[tuple[Length, ...], Field(min_length=2, max_length=3), AsTuple]


class ColumnSettings(Settings):
    """What the columns of a CSV file hold: kind of column, its name in the file."""

    time: choose(is_list, Annotated[tuple[str, ...], Field(min_length=1, max_length=3), AsTuple], str) = None
    """Column of the time, or a list of up to three: date, time of day, offset. record.time_format, if it holds
    numbers."""
    year: str = None
    """Instead of time: columns of year, month, day, and of hour, minute and second, as far as there are such
    columns."""
    month: str = None
    day: str = None
    hour: str = None
    minute: str = None
    second: str = None
    x: str = None
    y: str = None
    z: str = None
    latitude: str = None
    longitude: str = None
    depth: str = None
    """Depth in m below sea level."""
    potency: str = None
    log_potency: str = None
    moment: str = None
    log_moment: str = None
    """log_*: logarithm to base 10."""
    mw: str = None
    energy: str = None
    """Radiated energy. record.energy_conversion converts it."""
    log_energy: str = None
    magnitude: str = None
    magnitude_type: str = None
    potency_xx: str = None
    """potency_*, moment_*: six components of a tensor."""
    potency_yy: str = None
    potency_zz: str = None
    potency_yz: str = None
    potency_xz: str = None
    potency_xy: str = None
    moment_xx: str = None
    moment_yy: str = None
    moment_zz: str = None
    moment_yz: str = None
    moment_xz: str = None
    moment_xy: str = None
    time_uncertainty: str = None
    step: str = None
    event_type: str = None
    """Events that are not seismic (quarry blast, explosion, noise, not existing) are left out; see
    record.filter.keep."""
    evaluation_status: str = None
    """Rejected and deleted events are left out."""

    @model_validator(mode="after")
    def _enough(self) -> Self:
        """A time, a location and a size among them, and a tensor whole."""
        named = self.model_fields_set
        parts = [part in named for part in DATE_PARTS]
        if "time" not in named and not any(parts):
            raise refusal("missing; name the column that holds the date and time", "time")
        if "time" in named and any(parts):
            raise refusal("the time stands in columns of its parts, or in one; leave either out", "time")
        if any(parts) and (not all(parts[:3]) or sorted(parts, reverse=True) != parts):
            raise refusal(f"name the columns of all parts of the time down to the last: {', '.join(DATE_PARTS)}")
        if not any(set(names) <= named for names in (MINE_COORDINATES, GLOBE_COORDINATES)):
            raise refusal("name the columns x, y and z, or latitude, longitude and depth")
        kinds = [kind for kind in TENSOR_KINDS if all(f"{kind}_{name}" in named for name in COMPONENTS)]
        if not kinds and not named & {*SIZE_COLUMNS, MAGNITUDE}:
            raise refusal(f"name a column of sizes: {', '.join((*SIZE_COLUMNS, MAGNITUDE))}, or six of a tensor")
        for kind in TENSOR_KINDS:
            if 0 < sum(f"{kind}_{name}" in named for name in COMPONENTS) < len(COMPONENTS):
                raise refusal(f"a tensor needs all six of {kind}_xx ... {kind}_xy")
        if MAGNITUDE_TYPE in named and not {MAGNITUDE, "mw"} & named:
            raise refusal("of which magnitude? name its column in record.columns.magnitude", MAGNITUDE_TYPE)
        if (self.mw or "").strip().lower() in FOREIGN_TYPES:
            raise refusal(
                f"column {self.mw!r} is by its name no Mw; name it in record.columns.{MAGNITUDE}, and say how to "
                "convert it in record.conversions, untyped: {slope: ..., offset: ...}",
                "mw",
            )
        numeric = [(key, plain(getattr(self, key))) for key in sorted(named - set(TEXTS))]
        for number, (key, name) in enumerate(numeric):
            if same := next((other for other, theirs in numeric[:number] if theirs == name), None):
                raise refusal(f"column {name!r} is named as {same}, too; each has a column of its own", key)
        return self

    def names(self) -> dict[str, str | list[str]]:
        """The columns' names by kind, as they are compared."""
        return {
            key: plain(name) if isinstance(name, str) else [plain(part) for part in name]
            for key, name in self.given().items()
        }


COLUMN_KEYS = tuple(ColumnSettings.model_fields)


class Conversion(Settings):
    """Mw = slope M + offset."""

    slope: real_number(gt=0, le=10)
    offset: real_number(ge=-10, le=10)


class EnergyConversion(Settings):
    """log10 moment (N m) = slope log10 energy (J) + offset."""

    slope: real_number(gt=0, le=10)
    offset: real_number(ge=-30, le=30)


class FilterSettings(Settings):
    """What part of a record is compared."""

    lower: Box = None
    """Corner of a box, with three coordinates."""
    upper: Box = None
    """The opposite corner of the box."""
    start: str = None
    """First date that is compared. Default: the start of the first dated step."""
    end: str = None
    """Last date that is compared. Default: the end of the last dated step."""
    minimum_potency: Annotated[float, Unit("m^3", ge=0, le=1e20)] = None
    maximum: Numbers = None
    """Largest value of a column of the file, by the name of the column."""
    minimum: Numbers = None
    """Smallest value of a column of the file, by the name of the column."""
    only: Words = None
    """Events are kept whose text in a column of the file is this text, or one of a list of texts: {status: [manual,
    reviewed]}."""
    without: Words = None
    """Events are left out whose text in a column of the file is this text, or one of a list of texts: {status:
    automatic}. QuakeML: event_type, evaluation_status and evaluation_mode (manual, automatic)."""
    keep: Text = None
    """Event types and evaluation statuses that count although they are not seismic: [quarry blast, rejected]."""


class OrientationSettings(Settings):
    """Which reprocessed events of the Elk Creek data give orientations; limits that are absent are the record's."""

    location_error: Size
    """Largest location error of an event whose orientation is used."""
    lower: Box = None
    upper: Box = None
    start: str = None
    end: str = None


class RecordSettings(Settings):
    """The recorded catalogue: where it is, and what it means. Which keys a reader asks for: catalogs.records."""

    reader: Literal["quakeml", "csv", "elk_creek"]
    file: str
    """File of the record, relative to the mine file. elk_creek: the folder of the data."""
    twin: bool = False
    """Whether the record was computed by a model."""
    location_error: Annotated[float, Unit("m", ge=0, le=1e8)] = None
    """R.m.s. error of the recorded locations in 3-D. QuakeML: of events that state none. Required, except for elk_creek
    with orientations."""
    columns: ColumnSettings = None
    """Columns of a CSV file."""
    tensor_frame: Literal["ENU", "NED", "USE"] = None
    """Meaning of x, y and z of the tensor columns: east north up, north east down, or up south east. Default: ENU."""
    units: dict[str, str] = None
    """Unit of a kind of column, where it is not m, m^3, N m, J or s and the file does not state it. QuakeML: {depth:
    km}."""
    missing: Annotated[tuple[real_number(), ...], AsTuple] = None
    """Numbers that stand for a missing value. Default: -99, -999, -9999."""
    decimal: Literal["point", "comma"] = None
    date_order: Literal["day", "month"] = None
    """What comes first in 01/02/2019."""
    time_zone: str = None
    """Time zone of times without an offset: Australia/Hobart, +10:00. Default: UTC. An hour that a clock shows twice is
    the later one."""
    conversions: dict[str, choose(is_section, Conversion, Literal["none"])] = None
    """Conversion of magnitudes of other types to Mw: {ML: {slope: 0.9, offset: 0.2}}. `none`: events of that type are
    left out."""
    energy_conversion: EnergyConversion = None
    """Conversion of radiated energy: log10 moment (N m) = slope log10 energy (J) + offset. Nothing is assumed."""
    encoding: str = None
    """Encoding of a CSV file that is not in UTF-8 or UTF-16, where its names or texts matter: gbk, shift_jis,
    cp1252."""
    time_format: Literal["excel", "excel_1904", "unix", "unix_ms"] = None
    """Format of a time that is a number: days of a worksheet (since 1900, since 1904), seconds or milliseconds since
    1970 in UTC."""
    rigidity: Annotated[float, Unit("Pa", gt=0, le=1e20)] = None
    """elk_creek: shear modulus in potency = moment / rigidity. Default: 33 GPa."""
    match_within: Annotated[float, Unit("s", gt=0, le=1e9)] = None
    """elk_creek: largest time difference at which two catalogue entries count as the same event. Default: 1 s."""
    filter: FilterSettings = None
    orientations: OrientationSettings = None
    """elk_creek: which reprocessed events give orientations."""

    @model_validator(mode="before")
    @classmethod
    def _asked_for(cls, values: Any) -> Any:
        if isinstance(values, Mapping):
            reader = values.get("reader")
            if reader in ("csv", "quakeml") and values.get("location_error") is None:
                raise refusal("missing key", "location_error")
            if reader == "csv" and values.get("columns") is None:
                raise refusal("missing key", "columns")
            if reader == "elk_creek" and not (set(values) & {"location_error", "orientations"}):
                raise refusal("missing; give it, or name record.orientations to derive it from", "location_error")
        return values

    @model_validator(mode="after")
    def _known(self) -> Self:
        for key, readers in READ_BY.items():
            if key in self.model_fields_set and self.reader not in readers:
                raise refusal(f"not used by reader {self.reader}, by {' and '.join(readers)} only; leave it out", key)
        if self.columns:
            self._check_columns()
        for kind, unit in (self.units or {}).items():
            if self.reader == "quakeml" and kind != "depth":
                raise refusal("QuakeML has its own unit here; depth alone may be in another one", "units", kind)
            if kind not in UNITS or (self.columns and kind not in self.columns.model_fields_set):
                raise refusal(f"not a named column with a unit; such are {', '.join(UNITS)}", "units", kind)
            quantity = unit_quantity(unit)
            if quantity is None:
                raise refusal(f"{short(unit)} is not a unit; expected one like {UNITS[kind]}", "units", kind)
            if not quantity.check(UNITS[kind]):
                raise refusal(f"{short(unit)} is not convertible to {UNITS[kind]}", "units", kind)
        if self.reader == "quakeml" and self.filter:
            for key in self.filter.model_fields_set & {"maximum", "minimum"}:
                raise refusal("a QuakeML file has no columns; leave it out", "filter", key)
            for key in self.filter.model_fields_set & {"only", "without"}:
                for name in getattr(self.filter, key):
                    if name not in QUAKEML_TEXTS:
                        raise refusal(
                            f"no text of a QuakeML file; such are {', '.join(QUAKEML_TEXTS)}", "filter", key, name
                        )
        names = [plain(name) for name in self.conversions or {}]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise refusal("this type stands there twice, but for blanks around it; leave one out", "conversions", twice)
        if self.tensor_frame and not {f"{kind}_xx" for kind in TENSOR_KINDS} & self.columns.model_fields_set:
            raise refusal("of which tensor? name its six columns, or leave it out", "tensor_frame")
        if self.time_zone:
            try:
                check_zone(self.time_zone)
            except InputError as error:
                raise refusal(str(error).partition(": ")[2], "time_zone") from error
        return self

    def _check_columns(self) -> None:
        """What the columns of a CSV file ask of other keys."""
        named = self.columns.model_fields_set
        for kind in LINEAR:
            name = getattr(self.columns, kind) or ""
            if LOGARITHM.match(name.strip()) and kind not in (self.units or {}):
                raise refusal(
                    f"column {name!r} is by its name a logarithm; name it in record.columns.log_{kind}, or give its "
                    f"unit in record.units.{kind} if it is none",
                    "columns",
                    kind,
                )
        if named & {"energy", "log_energy"} and not self.energy_conversion:
            raise refusal(
                "missing; an energy is no moment: say {slope: ..., offset: ...} for log10 moment (N m) = slope log10 "
                "energy (J) + offset",
                "energy_conversion",
            )
        if self.energy_conversion and not named & {"energy", "log_energy"}:
            raise refusal("of which energy? name its column in record.columns.energy", "energy_conversion")
        if self.time_format and "time" not in named:
            raise refusal("of which number? name its column in record.columns.time", "time_format")
        if self.time_format and self.date_order:
            raise refusal("a time that is a number has no order of day and month; leave it out", "date_order")
        if (self.time_format or "").startswith("unix") and self.time_zone:
            raise refusal("Unix time is UTC everywhere; leave it out", "time_zone")
        if self.encoding:
            try:
                known = codecs.lookup(self.encoding)._is_text_encoding
            except (LookupError, ValueError):
                known = False
            if not known:
                raise refusal(
                    f"{short(self.encoding)} is no encoding; such are utf-8, cp1252, gbk, shift_jis", "encoding"
                )


class Period(Settings):
    """The modelled months."""

    start: str = None
    end: str = None


class DomainBox(Settings):
    """The model's domain, m."""

    lower: Box
    upper: Box
    plane: Literal["xz", "xy"] | None = None


class RecordSlice(RecordSettings):
    """The slice of the record's stage: all of `record`, whose it is, where and when the model mines, its host rock."""

    mine: str = ""
    frame: Frame = None
    lame_lambda: float = None
    """Pa"""
    shear_modulus: float = None
    """Pa"""
    period: Period = None
    domain: DomainBox = None


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
