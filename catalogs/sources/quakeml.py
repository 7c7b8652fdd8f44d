"""A catalogue as QuakeML 1.2, for exchange: written through ObsPy, with the same bytes every time.

catalogs/records/quakeml_events.py reads it back, identical.

What any reader understands: origin time with how much earlier and later it may be, latitude, longitude, depth (m below
sea level, = -z), moment magnitude, the moment tensor in N m, Up-South-East (rr = zz, tt = yy, pp = xx, rt = -yz,
rp = xz, tp = -xy), with its own shares, sizes from 0 to 1 as QuakeML has them, and, where the event has P and T axes,
principal axes and nodal planes of that tensor. In addition, in the namespace NAMESPACE and bit for bit, stand every
variable of common.event_table per event, among them the signed shares of the potency tensor and the labels of synthetic
events, and the attributes once (JSON). Unresolved events are left out: QuakeML has no mark for them that other programs
read, and these would count them. An event's identifier ends in its own name (`event_id`), or in a catalogue without
names in its row there. A synthetic event says so in its description and its creationInfo.
ObsPy makes random resource identifiers and stamps the time by default: here every one is given.
"""

import io
import json
import os
import re
import warnings

import numpy as np
import scipy
import xarray as xr
from obspy import UTCDateTime
from obspy.core.event import (
    Axis,
    Catalog,
    Comment,
    CreationInfo,
    Event,
    EventDescription,
    FocalMechanism,
    Magnitude,
    MomentTensor,
    NodalPlane,
    NodalPlanes,
    Origin,
    OriginUncertainty,
    PrincipalAxes,
    QuantityError,
    ResourceIdentifier,
    Tensor,
)
from obspy.io.quakeml.core import _validate

from catalogs.sources.geographic_frame import MineFrame
from catalogs.sources.mechanisms import nodal_planes, trend_plunge
from common.datasets import atomic_path
from common.errors import InputError
from common.event_table import EVENT_ID, FIELDS, LABELS, check_events
from common.source_tensors import principal_axes, source_shares

NAMESPACE = "urn:mine-seismicity:catalogue:1"
PREFIX = "mine"
# Of the types of Storchak et al. (2012): caused by human activity. A "rock burst" does damage, which no model tells.
QUAKEML_EVENT_TYPE = "induced or triggered event"
AUTHOR = "rockburst-mpm"
SAYS = {  # what an event says of itself by its kind
    "synthetic": "Synthetic event of a numerical model of mine {mine}, not recorded",
    "twin": "Synthetic event of a numerical model of mine {mine}, not recorded: part of a made-up record",
    "recorded": "",
}
ATTRIBUTES = "attributes"
EVENTS_AT_ONCE = 2000  # Events that are written at a time.
EVENT_START, EVENT_END = b"    <event ", b"</event>\n"  # As ObsPy writes them; in texts < is written otherwise.
ONE_SIGMA_PERCENT = 68.27  # Confidence level of an uncertainty that states none: it is a standard error.
# Component of QuakeML's tensor -> sign, row, column in east, north, up.
UP_SOUTH_EAST = {
    "m_rr": (1, 2, 2),
    "m_tt": (1, 1, 1),
    "m_pp": (1, 0, 0),
    "m_rt": (-1, 1, 2),
    "m_rp": (1, 0, 2),
    "m_tp": (-1, 0, 1),
}


def write_quakeml(catalog: xr.Dataset, path: str | os.PathLike) -> None:
    """Write the resolved events of a catalogue (form of common.event_table) as QuakeML, atomically.

    ObsPy checks the file against the schema as it is written, EVENTS_AT_ONCE events at a time: its objects take much
    more memory than the catalogue. Needs attributes mine and frame.
    Raises InputError for a missing frame, a resolved event without time or location, or a file that the schema refuses.
    """
    catalog = check_events(catalog, "catalogue")
    rows = np.flatnonzero(catalog["resolved"].values)
    end = b""
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        for start in range(0, max(len(rows), 1), EVENTS_AT_ONCE):
            stream = io.BytesIO()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # ObsPy warns of every `extra`
                part = _obspy_catalog(catalog, rows[start : start + EVENTS_AT_ONCE], len(rows))
                part.write(stream, format="QUAKEML", nsmap={PREFIX: NAMESPACE})
            stream.seek(0)
            if not _validate(stream, verbose=True):
                raise InputError(f"{path}: ObsPy's QuakeML schema check failed; see the log, and report it")
            head, events, end = _around_events(stream.getvalue())
            file.write(events if start else head + events)
        file.write(end)


def _around_events(content: bytes) -> tuple[bytes, bytes, bytes]:
    """What stands before the events of a file, the events, and what stands behind them."""
    first, last = content.find(EVENT_START), content.rfind(EVENT_END)
    if first < 0:
        return content, b"", b""
    last += len(EVENT_END)
    return content[:first], content[first:last], content[last:]


def _obspy_catalog(catalog: xr.Dataset, rows: np.ndarray, resolved: int) -> Catalog:
    """Events (k,) of a catalogue as ObsPy's object, every identifier explicit; resolved: number of all that are."""
    total = catalog.sizes["event"]
    catalog = catalog.isel(event=rows)
    if np.isnat(catalog["time"].values).any() or not np.isfinite(catalog["location"].values).all():
        raise InputError("QuakeML: an event without time or location cannot be written; leave it out")
    globe = np.transpose(MineFrame(catalog.attrs.get("frame")).to_globe(catalog["location"].values))
    kind = catalog.attrs["kind"]
    base = f"smi:local/{_word(catalog.attrs['mine'])}/{kind}"
    says = SAYS[kind].format(mine=catalog.attrs["mine"])
    made = CreationInfo(agency_id=kind, author=AUTHOR if says else None)
    known = [*FIELDS, *(field for field in LABELS if field.name in catalog)]
    values = {field.name: catalog[field.name].values for field in known}  # once: xarray takes long over each
    own_names = values.get(EVENT_ID.name, [f"{row + 1:06d}" for row in rows])
    mechanisms = _mechanisms(values)
    texts = {name: _texts(column) for name, column in values.items()}
    location_error = float(catalog.attrs.get("location_error", np.nan))
    events = []
    for index in range(len(rows)):
        name = f"{base}/event/{_word(own_names[index])}"
        event = Event(resource_id=ResourceIdentifier(name), event_type=QUAKEML_EVENT_TYPE, creation_info=made)
        event.event_descriptions = [EventDescription(text=says)] if says else []
        origin = _origin(f"{name}/origin", values, index, globe[index], location_error)
        event.origins, event.preferred_origin_id = [origin], origin.resource_id
        if np.isfinite(mw := float(values["mw"][index])):
            size = Magnitude(resource_id=ResourceIdentifier(f"{name}/magnitude"), mag=mw, magnitude_type="Mw")
            size.origin_id = origin.resource_id
            event.magnitudes, event.preferred_magnitude_id = [size], size.resource_id
        if mechanisms[index] is not None:
            mechanism = mechanisms[index]
            mechanism.resource_id = ResourceIdentifier(f"{name}/mechanism")
            mechanism.moment_tensor.resource_id = ResourceIdentifier(f"{name}/moment_tensor")
            mechanism.moment_tensor.derived_origin_id = origin.resource_id
            event.focal_mechanisms, event.preferred_focal_mechanism_id = [mechanism], mechanism.resource_id
        event.extra = {name: {"value": text[index], "namespace": NAMESPACE} for name, text in texts.items()}
        events.append(event)
    result = Catalog(events=events, resource_id=ResourceIdentifier(base), creation_info=made)
    left_out = f"{total - resolved} unresolved events of {total} are left out" if resolved < total else ""
    result.description = ". ".join(part for part in (says, left_out) if part) or None
    floor = float(catalog.attrs.get("potency_floor", np.nan))
    if np.isfinite(floor) and floor > 0.0:
        text = f"Complete from a potency of {floor:.3g} m3 on (log P {np.log10(floor):.2f}), the floor of the cells"
        result.comments = [Comment(text=text, resource_id=ResourceIdentifier(f"{base}/floor"))]
    result.extra = {ATTRIBUTES: {"value": json.dumps(_plain(catalog.attrs)), "namespace": NAMESPACE}}
    return result


def _origin(name: str, values: dict[str, np.ndarray], index: int, globe: np.ndarray, location_error: float) -> Origin:
    """Origin (QuakeML) of event `index`; values: fields of all events; globe: latitude, longitude (degrees), depth m.

    location_error (m, NaN if not known) is the root mean square distance in 3-D: depth gets its share as a standard
    error, the horizontal the radius of a circle of the same confidence.
    """
    origin = Origin(
        resource_id=ResourceIdentifier(name),
        time=UTCDateTime(ns=int(values["time"][index].astype("datetime64[ns]").astype(np.int64))),
        latitude=float(globe[0]),
        longitude=float(globe[1]),
        depth=float(globe[2]),
        depth_type="other",
    )
    lower, upper = (float(values[f"time_{side}_uncertainty"][index]) for side in ("lower", "upper"))
    if np.isfinite(lower) and np.isfinite(upper):
        origin.time_errors = QuantityError(lower_uncertainty=lower, upper_uncertainty=upper)
    if np.isfinite(location_error):
        origin.depth_errors = QuantityError(uncertainty=location_error / np.sqrt(3))
        origin.origin_uncertainty = OriginUncertainty(
            horizontal_uncertainty=location_error / np.sqrt(3) * sigmas(ONE_SIGMA_PERCENT, 2),
            confidence_level=ONE_SIGMA_PERCENT,
            preferred_description="horizontal uncertainty",
        )
    return origin


def _mechanisms(values: dict[str, np.ndarray]) -> list[FocalMechanism | None]:
    """Focal mechanism of each event, without identifiers; None where it has no moment tensor.

    values: by field, of all events.
    """
    tensors = values["moment_tensor"]
    found: list[FocalMechanism | None] = [None] * len(tensors)
    known = np.flatnonzero(np.isfinite(tensors).all(axis=(1, 2)))
    tensors = tensors[known]
    shares = np.abs(source_shares(tensors))
    axes, lengths = principal_axes(tensors), np.linalg.eigvalsh(tensors)
    planes = nodal_planes(axes[:, 0], axes[:, 2])
    trends, plunges = trend_plunge(axes)
    clear = np.isfinite(values["p_axis"]).all(axis=1) & np.isfinite(values["t_axis"]).all(axis=1)
    for row, event in enumerate(known):
        scalar = float(values["moment"][event])
        source = MomentTensor(
            scalar_moment=scalar if np.isfinite(scalar) else None,
            tensor=Tensor(**{key: float(sign * tensors[row, i, j]) for key, (sign, i, j) in UP_SOUTH_EAST.items()}),
        )
        if np.isfinite(shares[row]).all():
            source.iso, source.clvd, source.double_couple = shares[row].tolist()
        found[event] = FocalMechanism(moment_tensor=source)
        if clear[event]:
            first, second = (
                NodalPlane(strike=strike, dip=dip, rake=rake) for strike, dip, rake in planes[row].tolist()
            )
            found[event].nodal_planes = NodalPlanes(nodal_plane_1=first, nodal_plane_2=second)
            columns = zip(trends[row].tolist(), plunges[row].tolist(), lengths[row].tolist(), strict=True)
            p, n, t = (Axis(azimuth=trend, plunge=plunge, length=length) for trend, plunge, length in columns)
            found[event].principal_axes = PrincipalAxes(p_axis=p, n_axis=n, t_axis=t)
    return found


def _word(text: str) -> str:
    """Text as a part of a resource identifier."""
    return re.sub(r"[^A-Za-z0-9_.-]", "_", text)


def _texts(values: np.ndarray) -> list[str]:
    """Texts, one per event, from which the event's values are read back exactly."""
    if values.dtype.kind == "f":
        return [
            " ".join(map(repr, row)) for row in values.reshape(len(values), int(np.prod(values.shape[1:]))).tolist()
        ]
    return [str(value) for value in values]


def _plain(attributes: dict) -> dict:
    """Attributes without numpy's types, as JSON needs them."""
    return {key: value.tolist() if hasattr(value, "tolist") else value for key, value in attributes.items()}


def sigmas(level: float | None, dimensions: int) -> float:
    """Radius of a confidence region in standard errors of one coordinate (normal errors, equal in all dimensions).

    level: confidence, %; that of one standard error in one dimension where it is None or not between 0 and 100.
    """
    share = (ONE_SIGMA_PERCENT if level is None or not 0 < level < 100 else level) / 100
    return float(np.sqrt(scipy.stats.chi2.ppf(share, dimensions)))
