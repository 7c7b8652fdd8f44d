"""Settings that all readers of records share. They are checked without the record, before anything runs."""

import unicodedata
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from common.frame import Frame
from common.setting_types import (
    AsTuple,
    EachOnce,
    Instant,
    Length,
    Settings,
    Unit,
    choose,
    is_list,
    is_section,
    real_number,
    refusal,
)

MOMENT_TYPES = ("mw", "mww", "mwc", "mwb", "mwr", "mwp")

Numbers = dict[str, real_number()]  # by column of the file
Text = choose(is_list, Annotated[tuple[str, ...], Field(min_length=1), AsTuple, EachOnce], str)
Words = dict[str, Text]
Box = Annotated[tuple[Length, ...], Field(min_length=2, max_length=3), AsTuple]
LocationError = Annotated[float, Unit("m", ge=0, le=1e8)]


class Conversion(Settings):
    """Conversion of a magnitude M: Mw = slope M + offset."""

    slope: real_number(gt=0, le=10)
    """Slope of the relation."""
    offset: real_number(ge=-10, le=10)
    """Offset of the relation."""


class FilterSettings(Settings):
    """Which part of a record is compared."""

    lower: Box = None
    """Corner of the box in which events are compared, with three coordinates."""
    upper: Box = None
    """The opposite corner of the box."""
    start: Instant = None
    """First date that is compared. Default: the start of the first dated step."""
    end: Instant = None
    """First date that is no longer compared. Default: the end of the last dated step."""
    minimum_potency: Annotated[float, Unit("m^3", ge=0, le=1e20)] = None
    """Smallest potency of an event that is compared."""
    maximum: Numbers = None
    """Largest value that is compared, by the name of a column of the file. Events without a number in that column are
    left out and counted."""
    minimum: Numbers = None
    """Smallest value that is compared, by the name of a column of the file. Events without a number in that column are
    left out and counted."""
    only: Words = None
    """Texts of the events that are compared, by the name of a column of the file: {status: [manual, reviewed]}. Events
    with another text are left out."""
    without: Words = None
    """Texts of the events that are left out, by the name of a column of the file: {status: automatic}. A QuakeML file
    has event_type, evaluation_status and evaluation_mode (manual, automatic)."""
    keep: Text = None
    """Event types and evaluation statuses that are compared although they are not seismic: [quarry blast, rejected]."""


class RecordSettings(Settings):
    """The recorded catalogue: its file, and the meaning of its contents."""

    reader: str
    """Format of the record."""
    file: str
    """File of the record, relative to the mine file."""
    location_error: LocationError = None
    """R.m.s. error of the recorded locations in 3-D."""
    filter: FilterSettings = None
    """Which part of the record is compared."""
    quiet: bool = False
    """Whether it is known that no event was recorded in the domain in the modelled months. Without it, a record without
    events there is an error: its times or places may have been misread."""


class EventFileSettings(RecordSettings):
    """A record in one file that another system wrote: its magnitudes may be of any type."""

    location_error: LocationError
    """R.m.s. error of the recorded locations in 3-D."""
    twin: bool = False
    """Whether the record was computed by a model."""
    conversions: dict[str, choose(is_section, Conversion, Literal["none"])] = None
    """Conversion of magnitudes of other types to Mw: {ML: {slope: 0.9, offset: 0.2}}. `none`: events of that type are
    left out. Moment magnitudes (Mw, Mww, Mwc ...) have none."""

    @model_validator(mode="after")
    def _converted_once(self) -> Self:
        names = [normalized(name) for name in self.conversions or {}]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise refusal("this type stands there twice, but for blanks around it; leave one out", "conversions", twice)
        if moment := next((name for name in names if is_moment_type(name)), None):
            raise refusal("is a moment magnitude already and is read as it stands; leave it out", "conversions", moment)
        return self


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
    """The slice of the record's stage: all of `record`, whose it is, where and when the model mines, its host rock.

    Each reader has one with its own keys.
    """

    mine: str = ""
    frame: Frame = None
    lame_lambda: float = None
    """Pa"""
    shear_modulus: float = None
    """Pa"""
    period: Period = None
    domain: DomainBox = None

    def names_of_text(self, kind: str) -> set[str]:
        """Names by which a filter may ask for texts of this kind (event type, status, mode)."""
        return {kind}


class EventFileSlice(EventFileSettings, RecordSlice):
    """The slice of a record in one file."""


def is_moment_type(kind: str) -> bool:
    """True if a magnitude type is a moment magnitude, whichever way it was measured."""
    return kind.strip().lower() in MOMENT_TYPES


def normalized(name: str) -> str:
    """A name as it is compared: composed letters, no blanks around it."""
    return unicodedata.normalize("NFC", name).strip()
