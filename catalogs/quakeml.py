"""A catalogue as QuakeML 1.2, for exchange: written through ObsPy, read back identical, with the same bytes every time.

What any reader understands: origin time, latitude, longitude, depth (m below sea level, = -z), moment magnitude, and
the moment tensor in N m, Up-South-East (rr = zz, tt = yy, pp = xx, rt = -yz, rp = xz, tp = -xy), with its own shares,
sizes from 0 to 1 as QuakeML has them; those of the potency tensor, signed, stand in our namespace. Events of a model
are rock bursts, rock that breaks because it is mined; recorded ones may be of other making and are called induced or
triggered (event types: Storchak et al. 2012). Beside that, in the namespace NAMESPACE and bit for bit, every variable
of pipeline.event_table per event and the attributes once (JSON).
ObsPy makes random resource identifiers and stamps the time unless told otherwise: here every one is given.
"""

import io
import json
import os
import re
import warnings
from pathlib import Path

import numpy as np
import xarray as xr
from obspy import UTCDateTime, read_events
from obspy.core.event import (
    Catalog,
    CreationInfo,
    Event,
    FocalMechanism,
    Magnitude,
    MomentTensor,
    Origin,
    OriginUncertainty,
    QuantityError,
    ResourceIdentifier,
    Tensor,
)
from obspy.io.quakeml.core import _validate

from catalogs.frame import MineFrame
from pipeline.datasets import atomic_path
from pipeline.errors import InputError
from pipeline.event_table import FIELDS, check_events, new_catalog
from pipeline.fields import TEXT, Field
from pipeline.provenance import comment
from pipeline.source_tensors import source_shares

NAMESPACE = "urn:mine-seismicity:catalogue:1"
PREFIX = "mine"
EVENT_TYPES = {"synthetic": "rock burst", "twin": "rock burst", "recorded": "induced or triggered event"}
ATTRIBUTES = "attributes"
# Component of QuakeML's tensor -> sign, row, column in east, north, up.
UP_SOUTH_EAST = {
    "m_rr": (1, 2, 2),
    "m_tt": (1, 1, 1),
    "m_pp": (1, 0, 0),
    "m_rt": (-1, 1, 2),
    "m_rp": (1, 0, 2),
    "m_tp": (-1, 0, 1),
}


def write_quakeml(catalog: xr.Dataset, path: str | os.PathLike, made_from: str = "") -> None:
    """Write a catalogue (form of pipeline.event_table) as QuakeML, atomically, after ObsPy's own schema check.

    made_from: see pipeline.provenance. Needs attributes mine and frame. Raises InputError for a missing frame, an event
    without time or location, or a file that the schema refuses.
    """
    catalog = check_events(catalog, "catalogue")
    stream = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # ObsPy warns of every `extra`
        _obspy_catalog(catalog).write(stream, format="QUAKEML", nsmap={PREFIX: NAMESPACE})
    stream.seek(0)
    if not _validate(stream, verbose=True):
        raise InputError(f"{path}: ObsPy's QuakeML schema check failed; see the log, and report it")
    with atomic_path(path) as temporary:
        temporary.write_bytes(stream.getvalue() + comment(made_from).encode())


def _obspy_catalog(catalog: xr.Dataset) -> Catalog:
    """The catalogue as ObsPy's object, every identifier explicit."""
    if np.isnat(catalog["time"].values).any() or not np.isfinite(catalog["location"].values).all():
        raise InputError("QuakeML: an event without time or location cannot be written; leave it out")
    latitude, longitude, depth = MineFrame(catalog.attrs.get("frame")).to_globe(catalog["location"].values)
    moment = catalog["moment_tensor"].values
    base = f"smi:local/{_word(catalog.attrs['mine'])}/{catalog.attrs['kind']}"
    shares = np.full((len(moment), 3), np.nan)
    known = np.isfinite(moment).all(axis=(1, 2))
    shares[known] = np.abs(source_shares(moment[known]))[:, [2, 1, 0]]  # DC, CLVD, ISO
    texts = {field.name: _texts(catalog[field.name].values) for field in FIELDS}
    events = []
    for index in range(catalog.sizes["event"]):
        name = f"{base}/event/{index + 1:06d}"
        event = _obspy_event(
            name,
            time=catalog["time"].values[index],
            time_uncertainty=[float(catalog[f"time_{side}_uncertainty"].values[index]) for side in ("lower", "upper")],
            place=(float(latitude[index]), float(longitude[index]), float(depth[index])),
            location_error=float(catalog.attrs.get("location_error", np.nan)),
            mw=float(catalog["mw"].values[index]),
            scalar_moment=float(catalog["moment"].values[index]),
            moment=moment[index],
            shares=shares[index].tolist(),
            event_type=EVENT_TYPES[catalog.attrs["kind"]],
        )
        event.extra = {name: {"value": text[index], "namespace": NAMESPACE} for name, text in texts.items()}
        events.append(event)
    result = Catalog(events=events, resource_id=ResourceIdentifier(base))
    result.creation_info = CreationInfo(agency_id=catalog.attrs["kind"])
    result.extra = {ATTRIBUTES: {"value": json.dumps(_plain(catalog.attrs)), "namespace": NAMESPACE}}
    return result


def _obspy_event(
    name: str, time, time_uncertainty, place, location_error, mw, scalar_moment, moment, shares, event_type
) -> Event:
    """One event with an origin, and a magnitude and a moment tensor where they are known."""
    origin = Origin(
        resource_id=ResourceIdentifier(f"{name}/origin"),
        time=UTCDateTime(ns=int(time.astype("datetime64[ns]").astype(np.int64))),
        latitude=place[0],
        longitude=place[1],
        depth=place[2],
        depth_type="other",
    )
    if np.isfinite(time_uncertainty).all():
        lower, upper = time_uncertainty
        origin.time_errors = QuantityError(lower_uncertainty=lower, upper_uncertainty=upper)
    if np.isfinite(location_error):
        origin.depth_errors = QuantityError(uncertainty=location_error)
        origin.origin_uncertainty = OriginUncertainty(
            horizontal_uncertainty=location_error, preferred_description="horizontal uncertainty"
        )
    event = Event(resource_id=ResourceIdentifier(name), event_type=event_type, origins=[origin])
    event.preferred_origin_id = origin.resource_id
    if np.isfinite(mw):
        size = Magnitude(resource_id=ResourceIdentifier(f"{name}/magnitude"), mag=mw, magnitude_type="Mw")
        size.origin_id = origin.resource_id
        event.magnitudes = [size]
        event.preferred_magnitude_id = size.resource_id
    if np.isfinite(moment).all():
        tensor = Tensor(**{key: float(sign * moment[i, j]) for key, (sign, i, j) in UP_SOUTH_EAST.items()})
        source = MomentTensor(
            resource_id=ResourceIdentifier(f"{name}/moment_tensor"),
            derived_origin_id=origin.resource_id,
            scalar_moment=scalar_moment if np.isfinite(scalar_moment) else None,
            tensor=tensor,
        )
        if np.isfinite(shares).all():
            source.double_couple, source.clvd, source.iso = shares
        mechanism = FocalMechanism(resource_id=ResourceIdentifier(f"{name}/mechanism"), moment_tensor=source)
        event.focal_mechanisms = [mechanism]
        event.preferred_focal_mechanism_id = mechanism.resource_id
    return event


def read_quakeml(path: str | os.PathLike) -> Catalog:
    """ObsPy's catalogue of a QuakeML file. Raises InputError if it is missing or not QuakeML."""
    return parse_quakeml(quakeml_bytes(path), path)


def quakeml_bytes(path: str | os.PathLike) -> bytes:
    """What a file holds: ObsPy would unpack it by its name's ending alone. Raises InputError if it is missing."""
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: not readable ({error.strerror}); give a QuakeML file") from error


def parse_quakeml(content: bytes, path: str | os.PathLike) -> Catalog:
    """ObsPy's catalogue of what a QuakeML file holds. Raises InputError, naming it, if it is not QuakeML."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return read_events(io.BytesIO(content), format="QUAKEML")
    except Exception as error:  # ObsPy lets through whatever its XML parser raises
        raise InputError(f"{path}: not QuakeML 1.2 ({type(error).__name__}: {error})") from error


def read_catalog(path: str | os.PathLike) -> xr.Dataset:
    """The catalogue that write_quakeml wrote, identical: every variable and attribute. Raises InputError for others."""
    catalog = own_catalog(read_quakeml(path))
    if catalog is None:
        raise InputError(f"{path}: no {PREFIX} namespace in it; read it as a record (reader quakeml)")
    return catalog


def own_catalog(events: Catalog) -> xr.Dataset | None:
    """The catalogue from the `mine` namespace of ObsPy's catalogue; None if it was not written here."""
    extra = getattr(events, "extra", {})
    if ATTRIBUTES not in extra or extra[ATTRIBUTES]["namespace"] != NAMESPACE:
        return None
    try:
        attributes = json.loads(extra[ATTRIBUTES]["value"])
    except (ValueError, TypeError) as error:
        raise InputError(f"{PREFIX}:{ATTRIBUTES}: not JSON ({error}); write the file again") from error
    if not isinstance(attributes, dict):
        raise InputError(f"{PREFIX}:{ATTRIBUTES}: not a mapping; write the file again")
    return new_catalog(len(events), attributes, **{field.name: _values(events, field) for field in FIELDS})


def _values(events: Catalog, field: Field) -> np.ndarray:
    """A variable of all events from the `mine` namespace. Raises InputError naming the event and what is wrong."""
    shape = tuple(3 for _ in field.dims[1:])
    values = np.empty((len(events), *shape), field.dtype)
    for index, event in enumerate(events):
        text = getattr(event, "extra", {}).get(field.name, {}).get("value")
        if text is None and field.dtype != TEXT:
            raise InputError(f"event {index + 1}: {PREFIX}:{field.name} is missing; write the file again")
        try:
            if field.dtype.kind == "f":
                values[index] = np.array([float(word) for word in text.split()]).reshape(shape)
            else:
                values[index] = (text or "") if field.dtype == TEXT else np.array(text, dtype=field.dtype)
        except (ValueError, OverflowError, AttributeError) as error:
            raise InputError(
                f"event {index + 1}: {PREFIX}:{field.name}: {str(text)[:60]!r} is not what was written there; write "
                "the file again"
            ) from error
    return values


def moment_tensor(event: Event) -> np.ndarray:
    """Moment tensor (3, 3) N m, east, north, up, of an ObsPy event; NaN where it has none."""
    matrix = np.full((3, 3), np.nan)
    mechanism = event.preferred_focal_mechanism() or (event.focal_mechanisms or [None])[0]
    tensor = mechanism.moment_tensor.tensor if mechanism is not None and mechanism.moment_tensor else None
    if tensor is not None and all(getattr(tensor, key) is not None for key in UP_SOUTH_EAST):
        for key, (sign, i, j) in UP_SOUTH_EAST.items():
            matrix[i, j] = matrix[j, i] = sign * getattr(tensor, key)
    return matrix


def _word(text: str) -> str:
    """Text as a part of a resource identifier."""
    return re.sub(r"[^A-Za-z0-9_.-]", "_", text)


def _texts(values: np.ndarray) -> list[str]:
    """One text per event that gives its values back exactly."""
    if values.dtype.kind == "f":
        return [
            " ".join(map(repr, row)) for row in values.reshape(len(values), int(np.prod(values.shape[1:]))).tolist()
        ]
    return [str(value) for value in values]


def _plain(attributes: dict) -> dict:
    """Attributes without numpy's types, as JSON needs them."""
    return {key: value.tolist() if hasattr(value, "tolist") else value for key, value in attributes.items()}
