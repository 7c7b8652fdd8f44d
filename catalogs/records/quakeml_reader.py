"""Records in QuakeML: our own, read back as they were written, or any other, through latitude, longitude and depth."""

from pathlib import Path

import numpy as np
import xarray as xr
from obspy.core.event import Catalog, Event

from catalogs.frame import MineFrame
from catalogs.quakeml import moment_tensor, own_catalog, read_quakeml
from catalogs.records.build import build_record, potency_from_moment
from catalogs.records.filters import filter_events
from pipeline.errors import InputError


def read(settings: dict) -> xr.Dataset:
    """The events of a QuakeML file in the form of catalogs.schema, filtered (catalogs.records.filters).

    settings: file, mine, twin, location_error (m), frame, lame_lambda, shear_modulus (Pa), filter. An event's preferred
    origin, magnitude and mechanism count, else its first; its size is its moment tensor, else its magnitude read as Mw.
    A file written by catalogs.quakeml keeps its x, y, z and tensors bit for bit. Raises InputError, naming file and
    event, for a missing or NaN location or time, or an event without magnitude and tensor.
    """
    path = Path(settings["file"])
    events = read_quakeml(path)
    if len(events) == 0:
        raise InputError(f"{path}: no events in the file")
    record = own_catalog(events)
    record = _foreign(events, settings, path) if record is None else _relabelled(record, settings)
    return filter_events(record, settings.get("filter") or {}, source=str(path))


def _relabelled(record: xr.Dataset, settings: dict) -> xr.Dataset:
    """Our own file as this mine's record: what it is and how well located is the configuration's to say."""
    if settings.get("location_error") is None:
        raise InputError("record.location_error: missing; give the record's location error in m (0 if it is a model's)")
    record.attrs |= {
        "mine": settings.get("mine", record.attrs["mine"]),
        "kind": "twin" if settings.get("twin") else "recorded",
        "location_error": float(settings["location_error"]),
    }
    return record


def _foreign(events: Catalog, settings: dict, path: Path) -> xr.Dataset:
    """A catalogue from what every QuakeML file holds."""
    origins = [_origin(event, number, path) for number, event in enumerate(events, 1)]
    time = np.array([origin.time.ns for origin in origins]).astype("datetime64[ns]")
    uncertainty = [origin.time_errors.uncertainty if origin.time_errors else None for origin in origins]
    location = MineFrame(settings.get("frame")).to_mine(
        *(np.array([getattr(origin, name) for origin in origins], float) for name in ("latitude", "longitude", "depth"))
    )
    tensor = np.array([moment_tensor(event) for event in events])
    magnitudes = np.array([_magnitude(event) for event in events], float)
    known = np.isfinite(tensor).all(axis=(1, 2))
    without = np.isnan(magnitudes) & ~known
    if without.any():
        raise InputError(
            f"{path}: event {int(np.flatnonzero(without)[0]) + 1} of {len(events)}: neither magnitude nor moment "
            f"tensor ({int(without.sum())} such); remove it"
        )
    if known.any():
        moduli = [settings.get(name) for name in ("lame_lambda", "shear_modulus")]
        if None in moduli:
            raise InputError("record: moment tensors need lame_lambda and shear_modulus of the host rock, in Pa")
        tensor = potency_from_moment(tensor, *map(float, moduli))
    # where there is a tensor the scalar potency is the tensor's own, not the rounded magnitude's
    sizes = {"mw": np.where(known, np.nan, magnitudes)}
    return build_record(settings, time, location, sizes, tensor, time_uncertainty=np.array(uncertainty, float))


def _origin(event: Event, number: int, path: Path):
    origin = event.preferred_origin() or (event.origins or [None])[0]
    if origin is None or origin.time is None:
        raise InputError(f"{path}: event {number}: no origin with a time; remove it")
    for name in ("latitude", "longitude", "depth"):
        value = getattr(origin, name)
        if value is None or not np.isfinite(value):
            raise InputError(f"{path}: event {number}: NaN location ({name}); remove it or fill it in")
    return origin


def _magnitude(event: Event) -> float:
    magnitude = event.preferred_magnitude() or (event.magnitudes or [None])[0]
    return np.nan if magnitude is None or magnitude.mag is None else magnitude.mag
