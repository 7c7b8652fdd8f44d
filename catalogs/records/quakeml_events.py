"""Content of events of a QuakeML file: catalogues that were written here, moment tensors, location uncertainties.

catalogs/sources/quakeml.py writes such files. Forms of other programs: quakeml_forms.py.
"""

import io
import json
import os
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from obspy import read_events
from obspy.core.event import Catalog, Event, FocalMechanism, Magnitude, Origin

from catalogs.sources.quakeml import ATTRIBUTES, NAMESPACE, PREFIX, UP_SOUTH_EAST, sigmas
from common.errors import InputError
from common.event_table import FIELDS, LABELS, new_catalog
from common.fields import TEXT, Field

# Parts of an event whose evaluation comes first count before others where none is preferred.
MODES, STATUSES = ("manual", "", "automatic"), ("final", "reviewed", "confirmed", "", "preliminary", "rejected")
METRES_PER_DEGREE = 111_195.0  # Length of a degree of latitude: 6,371 km times pi / 180.


def quakeml_bytes(path: str | os.PathLike) -> bytes:
    """Bytes of a file. ObsPy would unpack a path by its ending alone. Raises InputError if the file is unreadable."""
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
    catalog = new_catalog(len(events), attributes, **{field.name: _values(events, field) for field in FIELDS})
    has_labels = bool(events) and all(field.name in getattr(events[0], "extra", {}) for field in LABELS)
    labels = {field: _values(events, field) for field in LABELS if has_labels}
    return catalog.assign({field.name: (field.dims, column, field.attributes) for field, column in labels.items()})


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


def review_rank(part: Origin | Magnitude | FocalMechanism, origins: Sequence[Origin] = ()) -> tuple[bool, int, int]:
    """Rank of an origin, magnitude or mechanism by its evaluation: rejected last, manual before automatic, by status.

    origins: of the event. A magnitude without mode and status has those of its origin.
    """
    named = getattr(part, "origin_id", None)
    if named and not part.evaluation_mode and not part.evaluation_status:
        part = next((origin for origin in origins if origin.resource_id == named), part)
    status = part.evaluation_status or ""
    return status == "rejected", MODES.index(part.evaluation_mode or ""), STATUSES.index(status)


def moment_tensor(event: Event) -> np.ndarray:
    """Moment tensor (3, 3) N m, east, north, up, of an ObsPy event; NaN where it has none."""
    matrix = np.full((3, 3), np.nan)
    mechanism = event.preferred_focal_mechanism() or min(event.focal_mechanisms, key=review_rank, default=None)
    tensor = mechanism.moment_tensor.tensor if mechanism is not None and mechanism.moment_tensor else None
    if tensor is not None and all(getattr(tensor, key) is not None for key in UP_SOUTH_EAST):
        for key, (sign, i, j) in UP_SOUTH_EAST.items():
            matrix[i, j] = matrix[j, i] = sign * getattr(tensor, key)
    return matrix


def location_uncertainty(origin: Origin | None, depth_unit: float = 1.0) -> float:
    """Root mean square location error in 3-D, m; NaN unless the origin states it across and in depth.

    depth_unit: of depths and their uncertainty, m.

    From the confidence ellipsoid, else from the uncertainties of latitude, longitude and depth, else from horizontal
    uncertainty (circle or ellipse) and that of depth. A confidence level (%) makes a standard error of each (normal
    errors, chi-square of as many degrees of freedom as the region has dimensions).
    """
    if origin is None:
        return np.nan
    region, depth = origin.origin_uncertainty, depth_unit * _standard_error(origin.depth_errors)
    if region is not None and region.confidence_ellipsoid is not None:
        body = region.confidence_ellipsoid
        axes = (body.semi_major_axis_length, body.semi_intermediate_axis_length, body.semi_minor_axis_length)
        if all(axis is not None for axis in axes):
            return float(np.sqrt(np.sum(np.square(axes, dtype=float)))) / sigmas(region.confidence_level, 3)
    north, east = _standard_error(origin.latitude_errors), _standard_error(origin.longitude_errors)
    across = METRES_PER_DEGREE * np.hypot(north, east * np.cos(np.radians(origin.latitude or 0.0)))
    if not np.isfinite(across) and region is not None:
        both = (region.max_horizontal_uncertainty, region.min_horizontal_uncertainty)
        if None in both:
            both = (region.horizontal_uncertainty,) * 2
        across = np.nan if None in both else np.hypot(*both) / sigmas(region.confidence_level, 2)
    error = float(np.hypot(across, depth))
    return error if error > 0 else np.nan


def _standard_error(errors) -> float:
    """Standard error of one coordinate; NaN if it states none."""
    if not errors or errors.uncertainty is None:
        return np.nan
    return float(errors.uncertainty) / sigmas(errors.confidence_level, 1)
