"""Records in QuakeML: this project's own files, read back as written, or others, by latitude, longitude and depth.

What needs ObsPy or PROJ is imported where it is used: to check a mine file must not wait for them.
"""

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
import pandas as pd
import xarray as xr
from pydantic import model_validator

from catalogs.records.build import (
    build_record,
    check_sizes,
    is_convertible,
    moment_magnitudes,
    sizes_text,
)
from catalogs.records.csv_units import unit_quantity
from catalogs.records.event_kinds import EVENT_TYPE, MODE, STATUS, is_left_out, kept_words
from catalogs.records.filters import filter_events
from catalogs.records.settings import EventFileSettings, EventFileSlice, LocationError, is_moment_type
from catalogs.records.times import FIRST_YEAR, LAST_YEAR
from common.errors import InputError
from common.event_table import LOCATION_UNCERTAINTY
from common.setting_types import refusal, short
from common.source_tensors import potency_from_moment

if TYPE_CHECKING:
    from obspy.core.event import Catalog, Event, Magnitude, Origin

    from catalogs.records.quakeml_forms import Words

NAME = "quakeml"
READS_FOLDER = False
FILTERED_TEXTS = (EVENT_TYPE, STATUS, MODE)  # Kinds of text that filters may ask for.
REJECTED = "rejected"
MAX_FRAME_DIFFERENCE = 0.1  # m, by which one place may differ in two frames that are meant to be one
# Coordinates of an origin, and the largest magnitude of each.
GLOBE_LIMITS = {"latitude": 90.0, "longitude": 180.0, "depth": np.inf}


class Record(EventFileSettings):
    """A record in a QuakeML file."""

    reader: Literal["quakeml"]
    """Format of the record."""
    location_error: LocationError
    """R.m.s. error in 3-D of the locations of events that state none."""
    units: dict[str, str] = None
    """Unit of the depths, where it is not m: {depth: km}."""

    @model_validator(mode="after")
    def _readable(self) -> Self:
        for kind, unit in (self.units or {}).items():
            if kind != "depth":
                raise refusal("QuakeML has its own unit here; depth alone may be in another one", "units", kind)
            quantity = unit_quantity(unit)
            if quantity is None:
                raise refusal(f"{short(unit)} is not a unit; expected one like m", "units", kind)
            if not quantity.check("m"):
                raise refusal(f"{short(unit)} is not convertible to m", "units", kind)
        if self.filter:
            for key in self.filter.model_fields_set & {"maximum", "minimum"}:
                raise refusal("a QuakeML file has no columns; leave it out", "filter", key)
            for key in self.filter.model_fields_set & {"only", "without"}:
                for name in getattr(self.filter, key):
                    if name not in FILTERED_TEXTS:
                        raise refusal(
                            f"no text of a QuakeML file; such are {', '.join(FILTERED_TEXTS)}", "filter", key, name
                        )
        return self


class RecordSlice(Record, EventFileSlice):
    """The slice of a record in a QuakeML file."""


def read(settings: RecordSlice) -> xr.Dataset:
    """The events of a QuakeML file in the form of common.event_table, filtered (catalogs.records.filters).

    Conversions: catalogs.records.build. An event's preferred origin and mechanism count, else the first of those whose
    evaluation ranks highest (quakeml_events.review_rank), and of these none whose status is rejected; an event is
    rejected where no other origin is there or the preferred one is. Its size is its moment tensor, else its moment
    magnitude, else a magnitude for which a conversion is stated; of several the preferred one, else by rank. Events
    that are no seismicity (catalogs.records.event_kinds) and those without a time, a place or a size are left out and
    counted, and so is one whose publicID is there before. Depth is in m, unless settings.units says otherwise. Location
    errors that origins state are kept (catalogs.records.quakeml_events). A file written by catalogs.sources.quakeml
    keeps its x, y, z and tensors bit for bit. Raises InputError, naming file and event, for degrees off the globe,
    magnitudes of other types, sizes that no event has, and what is no QuakeML.
    """
    from catalogs.records.quakeml_events import own_catalog, parse_quakeml, quakeml_bytes
    from catalogs.records.quakeml_forms import TIME, plain_quakeml

    path = Path(settings.file)
    content, words = plain_quakeml(quakeml_bytes(path), path)
    events = parse_quakeml(content, path)
    origins = [_origin(event, one) for event, one in zip(events, words, strict=True)]
    if REJECTED not in kept_words(settings):  # else what is rejected of an event counts as the event does
        for event in events:
            _leave_out_rejected(event)
    texts_of = {EVENT_TYPE: [one.event_type for one in words]}
    texts_of |= {
        kind: ["" if place is None else one.origins[place][kind] for one, place in zip(words, origins, strict=True)]
        for kind in (STATUS, MODE)
    }
    kinds = {kind: np.array(texts, dtype=object) for kind, texts in texts_of.items()}
    try:
        record = own_catalog(events)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    if record is None:
        _log_choice(events, origins, path)
        places = [None if place is None else event.origins[place] for event, place in zip(events, origins, strict=True)]
        times = ["" if place is None else one.origins[place][TIME] for one, place in zip(words, origins, strict=True)]
        record = _foreign(events, places, times, settings, path)
    else:
        record = _relabelled(record, settings, path)
    mode = {MODE: kinds.pop(MODE)}
    names = pd.Series([one.name or None for one in words])
    repeated = (names.duplicated() & names.notna()).to_numpy()
    return filter_events(record, settings, source=str(path), repeated=repeated, words=mode, kinds=kinds)


def _origin(event: "Event", words: "Words") -> int | None:
    """Index of the origin of an event that is used: the preferred one, else the first of those not rejected whose
    evaluation ranks highest."""
    from catalogs.records.quakeml_events import review_rank

    preferred = event.preferred_origin()
    if preferred is not None and preferred in event.origins:
        return event.origins.index(preferred)
    sound = [place for place, one in enumerate(words.origins) if not is_left_out(STATUS, one[STATUS])]
    places = sound or range(len(event.origins))
    return min(places, key=lambda place: review_rank(event.origins[place]), default=None)


def _log_choice(events: "Catalog", origins: list[int | None], path: Path) -> None:
    """Log of how many events the origin or the magnitude was chosen by its evaluation, since none is preferred.

    origins: index of the origin of each event that is used.
    """
    several = [
        place for event, place in zip(events, origins, strict=True)
        if len(event.origins) > 1 and event.preferred_origin() is None
    ]  # fmt: skip
    sizes = sum(len(event.magnitudes) > 1 and event.preferred_magnitude() is None for event in events)
    if several or sizes:
        logging.info(
            "%s: %d events have several origins and %d several magnitudes, none of them preferred: reviewed ones count "
            "before automatic ones; %d origins are not the first of their event",
            path, len(several), sizes, sum(bool(place) for place in several),
        )  # fmt: skip


def _leave_out_rejected(event: "Event") -> None:
    """Remove rejected magnitudes and mechanisms from an event."""
    event.magnitudes = [one for one in event.magnitudes if one.evaluation_status != REJECTED]
    event.focal_mechanisms = [one for one in event.focal_mechanisms if one.evaluation_status != REJECTED]
    for kind in ("magnitude", "focal_mechanism"):
        preferred = getattr(event, f"preferred_{kind}")()
        if preferred is not None and preferred.evaluation_status == REJECTED:
            setattr(event, f"preferred_{kind}_id", None)


def _relabelled(record: xr.Dataset, settings: RecordSlice, path: Path) -> xr.Dataset:
    """Set mine, kind and location error of a record read from a file of this project to those of the configuration.

    Returns the same dataset. Raises InputError for a magnitude that no event has, for a catalogue that a model made and
    that is not said to be a twin, and for one whose x, y and z are those of another frame.
    """
    check_sizes(record["mw"].values, str(path))
    if record.attrs["kind"] != "recorded" and not settings.twin:
        raise InputError(f"{path}: is {record.attrs['kind']}, made by a model: say record.twin: true, or name a record")
    _check_frame(record, settings, path)
    record.attrs |= {
        "mine": settings.mine or record.attrs["mine"],
        "kind": "twin" if settings.twin else "recorded",
        "location_error": settings.location_error,
    }
    return record


def _check_frame(record: xr.Dataset, settings: RecordSlice, path: Path) -> None:
    """Raise InputError if the x, y and z of a catalogue are elsewhere on the globe in the frame of the mine file."""
    from catalogs.sources.geographic_frame import MineFrame

    own, location = record.attrs.get("frame"), record["location"].values
    if not own or not (settings.frame and settings.frame.has_place) or not len(location):
        return
    try:
        written = MineFrame(own)
    except (InputError, ValueError, TypeError) as error:
        raise InputError(f"{path}: its frame is not what was written there ({error}); write the file again") from error
    moved = MineFrame(settings.frame).to_map(*written.to_globe(location)) - location
    if np.abs(moved).max() > MAX_FRAME_DIFFERENCE:
        raise InputError(
            f"{path}: has x, y and z in another frame, in which its events lie {np.abs(moved).max():.3g} m from where "
            "frame places them: write it again in the frame of the mine file, or give that of the file"
        )


def _foreign(
    events: "Catalog", origins: "list[Origin | None]", times: list[str], settings: RecordSlice, path: Path
) -> xr.Dataset:
    """A catalogue from what every QuakeML file holds, and from the origin of each event that counts.

    times: texts of the origins' times, for messages.
    """
    from catalogs.records.quakeml_events import location_uncertainty, moment_tensor
    from catalogs.sources.geographic_frame import MineFrame

    read = [_time(*one, f"{path}: event {number}") for number, one in enumerate(zip(origins, times, strict=True), 1)]
    time = np.array(read, "datetime64[ns]")
    lower, upper = np.array([_time_uncertainties(origin) for origin in origins], float).reshape(-1, 2).T
    globe = np.array([[getattr(origin, name, None) for name in GLOBE_LIMITS] for origin in origins], float)
    globe = globe.reshape(-1, len(GLOBE_LIMITS))  # of no event, too
    depth_unit = unit_quantity(settings.units["depth"]).to("m").magnitude if settings.units else 1.0
    globe[:, list(GLOBE_LIMITS).index("depth")] *= depth_unit
    for column, (name, most) in enumerate(GLOBE_LIMITS.items()):
        off = np.abs(globe[:, column]) > most
        if off.any():
            event = int(np.flatnonzero(off)[0])
            raise InputError(
                f"{path}: event {event + 1} of {len(events)}: {globe[event, column]:g} is no {name}, which ends at "
                f"{most:g} degrees ({int(off.sum())} such); correct it"
            )
    location = np.full(globe.shape, np.nan)
    known = np.isfinite(globe).all(axis=1)
    if known.any():
        location[known] = MineFrame(settings.frame).to_map(*globe[known].T)
    tensor = np.array([moment_tensor(event) for event in events]).reshape(-1, 3, 3)
    tensor[~tensor.any(axis=(1, 2))] = np.nan  # never computed
    known = np.isfinite(tensor).all(axis=(1, 2))
    conversions = settings.conversions or {}
    magnitudes = [_magnitude(event, conversions) for event in events]
    values = np.array([np.nan if one is None or one.mag is None else one.mag for one in magnitudes], float)
    kinds = ["" if one is None else one.magnitude_type or "" for one in magnitudes]
    # where there is a tensor the scalar potency is the tensor's own, not the rounded magnitude's
    mw, used = moment_magnitudes(values, kinds, conversions, ~known, str(path))
    if known.any():
        moduli = [settings.lame_lambda, settings.shear_modulus]
        if None in moduli:
            raise InputError("record: moment tensors need lame_lambda and shear_modulus of the host rock, in Pa")
        tensor = potency_from_moment(tensor, *map(float, moduli))
    uncertainties = {"time_lower_uncertainty": lower, "time_upper_uncertainty": upper}
    record = build_record(settings, time, location, {"mw": mw}, tensor, str(path), **uncertainties)
    text = sizes_text(used, conversions)
    record.attrs |= {"sizes_text": text} if text else {}
    errors = np.array([location_uncertainty(origin, depth_unit) for origin in origins], float)
    if np.isfinite(errors).any():
        record[LOCATION_UNCERTAINTY.name] = (LOCATION_UNCERTAINTY.dims, errors, LOCATION_UNCERTAINTY.attributes)
    return record


def _time(origin, text: str, where: str) -> np.datetime64:
    """Origin time, NaT where there is none. Raises InputError for a text that is no time, and for a year that
    nanoseconds do not reach."""
    if origin is None or origin.time is None:
        if text:
            raise InputError(f"{where}: {text[:60]!r} is not a date and time of QuakeML; write 2019-08-01T12:00:00Z")
        return np.datetime64("NaT", "ns")
    if not FIRST_YEAR <= origin.time.year <= LAST_YEAR:
        raise InputError(f"{where}: {str(origin.time)!r}: years run from {FIRST_YEAR} to {LAST_YEAR} here")
    return np.datetime64(origin.time.ns, "ns")


def _time_uncertainties(origin) -> tuple[float | None, float | None]:
    """Uncertainties of an origin's time, s: how much earlier and how much later it may be; None where not stated."""
    errors = getattr(origin, "time_errors", None)
    if not errors:
        return None, None
    both = errors.uncertainty
    return tuple(both if one is None else one for one in (errors.lower_uncertainty, errors.upper_uncertainty))


def _magnitude(event: "Event", conversions: dict) -> "Magnitude | None":
    """The magnitude that counts: a moment magnitude, else a convertible one, else any; the preferred one first, then by
    the rank of its evaluation."""
    from catalogs.records.quakeml_events import review_rank

    preferred = event.preferred_magnitude()
    ranked = sorted(event.magnitudes, key=lambda one: review_rank(one, event.origins))
    listed = ([preferred] if preferred else []) + ranked
    listed = [one for one in listed if one.mag is not None]
    for fits in (is_moment_type, lambda kind: is_convertible(kind, conversions), lambda _: True):
        for one in listed:
            if fits(one.magnitude_type or ""):
                return one
    return None
