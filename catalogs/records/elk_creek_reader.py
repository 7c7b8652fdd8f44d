"""The recorded catalogue of the Elk Creek longwall mine, Colorado (GitHub repository niosh-mining/elkcreek).

Two catalogues of the same ground are read, and never pooled:
- `ims_events`: sizes and counts. No filter on `Location Residual`: it grows with the number of sensors (median 11 m at
  4, 24 m at 10), is therefore no location error, and a cut at 30 m discards 43 % of the moment recorded in the box.
- `rocksigma_events`, reprocessed, with moment tensors: orientations only, of events whose `Location Error` is small.
  Norm of the tensor and scalar moment disagree by a factor of ten either way, so tensors are scaled to unit norm.
Times are UTC. Boltz, Chambers, Larson, Lawson and Tornman (2026), doi 10.1007/s42461-026-01497-0.
"""

import json
import logging
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
import pandas as pd
import xarray as xr
from pydantic import model_validator

from catalogs.records import settings as record_settings
from catalogs.records.filters import distance_beyond, domain_box, filter_events, limits_of
from catalogs.records.settings import Box, DomainBox, LocationError
from catalogs.records.times import check_offset, parse_time
from common.errors import InputError
from common.event_table import RADIATED_ENERGY, SOURCE_RADIUS, STATIC_STRESS_DROP, new_catalog
from common.setting_types import Instant, Settings, Size, Unit, refusal
from common.source_tensors import moment_magnitude

NAME = "elk_creek"
READS_FOLDER = True
ENVIRONMENT_VARIABLE = "ELK_CREEK_DATA"
REPOSITORY = "GitHub repository niosh-mining/elkcreek"
DEFAULT_RIGIDITY = 33e9  # Pa, which the IMS catalogue's own moments and potencies imply
DEFAULT_MATCH_WITHIN = 1.0  # s, more than the clocks of the two catalogues differ by
MIN_MATCHED_PAIRS = 20  # fewer give no usable median

CAVEATS = (
    "Elevations: a fifth of the events of September to December 2010 lie within 2 m of one plane some 26 m above the "
    "seam floor, where the locator put them. Compare locations in plan; elevations say little.",
    "Orientations: the axes of the reprocessed tensors look like east, north, up, but are not documented.",
)

COORDINATES = ["Location X", "Location Y", "Location Z"]
DATE = "Date"
IMS_COLUMNS = [DATE, *COORDINATES, "Moment Total"]
STATED_COLUMNS = {  # Of the IMS files; in J, m and Pa.
    "Energy Total": RADIATED_ENERGY,
    "Source Radius": SOURCE_RADIUS,
    "Static Stress Drop": STATIC_STRESS_DROP,
}
TENSOR_COLUMNS = {
    (0, 0): "Moment Tensor XxXyXz X",
    (0, 1): "Moment Tensor XxXyXz Y",
    (0, 2): "Moment Tensor XxXyXz Z",
    (1, 1): "Moment Tensor YyYzZz X",
    (1, 2): "Moment Tensor YyYzZz Y",
    (2, 2): "Moment Tensor YyYzZz Z",
}
ROCKSIGMA_COLUMNS = [DATE, *COORDINATES, "Location Error", *TENSOR_COLUMNS.values()]


class OrientationSettings(Settings):
    """Which reprocessed events give orientations. Limits that are not given are those of the record."""

    renamed_keys: ClassVar = {"location_error": "max_location_error"}

    max_location_error: Size
    """Largest location error of an event whose orientation is used."""
    lower: Box = None
    """Lower corner of the box."""
    upper: Box = None
    """Upper corner of the box."""
    start: Instant = None
    """First date."""
    end: Instant = None
    """First date that no longer counts."""


class Record(record_settings.RecordSettings):
    """The record of the Elk Creek mine."""

    reader: Literal["elk_creek"]
    """Format of the record."""
    file: str
    """Folder of the data, relative to the mine file."""
    location_error: LocationError = None
    """R.m.s. error of the recorded locations in 3-D. Default: derived from the events of `orientations`, which is
    required then."""
    rigidity: Annotated[float, Unit("Pa", gt=0, le=1e20)] = None
    """Shear modulus in potency = moment / rigidity. Default: 33 GPa."""
    match_within: Annotated[float, Unit("s", gt=0, le=1e9)] = None
    """Largest time difference at which two catalogue entries count as the same event. Default: 1 s."""
    orientations: OrientationSettings = None
    """Which reprocessed events give orientations."""

    @model_validator(mode="after")
    def _has_location_error(self) -> Self:
        if not self.model_fields_set & {"location_error", "orientations"}:
            raise refusal("missing; give it, or name record.orientations to derive it from", "location_error")
        return self


class RecordSlice(Record, record_settings.RecordSlice):
    """The slice of the record of the Elk Creek mine."""


def data_folder(named: str | os.PathLike, key: str = "record.file") -> Path:
    """The folder with the recorded data: the environment variable ELK_CREEK_DATA if set, else `named` (config `key`).

    Raises InputError, saying where to get the data, when there is no such folder or it holds no IMS events.
    """
    override = os.environ.get(ENVIRONMENT_VARIABLE)
    folder = Path(override or named)
    if not any(any(folder.glob(f"{place}ims_events/*.parquet")) for place in ("", "events/")):
        origin = f"environment variable {ENVIRONMENT_VARIABLE}" if override else key
        raise InputError(
            f"{origin}: {folder}: no Elk Creek data here (no ims_events/*.parquet); get the folder data/raw of the "
            f"{REPOSITORY} and name it in {key} or in the environment variable {ENVIRONMENT_VARIABLE}"
        )
    return folder


def data_path(folder: Path, name: str) -> Path:
    """`name` inside the data folder; the repository keeps event files one folder deeper (`events/`), both are found."""
    for path in (folder / name, folder / "events" / name):
        if path.exists():
            return path
    raise InputError(f"{folder}: {name} is missing; copy it from data/raw of the {REPOSITORY}")


def read(settings: RecordSlice) -> xr.Dataset:
    """IMS events with sizes (dim event, tensors NaN) and, apart from them, orientations (dim orientation).

    settings: file (the data folder), mine, filter, period, domain (catalogs.records.filters; columns of the IMS files
    by their names), rigidity (Pa, 33 GPa unless given; potency = Moment Total / rigidity), orientations (absent: none;
    see read_orientations), location_error (m; absent: the median distance of pairs matched within match_within, 1 s).

    In addition to the variables of the event table: orientation_time, orientation_location (orientation, xyz) m,
    orientation_tensor (orientation, xyz, axis): moment tensor over its norm, axes taken as east, north, up (SOURCE: not
    documented).
    Attributes: location_error, location_error_from (text), rigidity, caveats (JSON list of text). Raises InputError.
    """
    folder = data_folder(settings.file)
    frame = _read_parquet(data_path(folder, "ims_events"), IMS_COLUMNS)
    moment = frame["Moment Total"].to_numpy(float)
    if not (moment > 0).all():
        bad = int((~(moment > 0)).sum())
        raise InputError(
            f"{folder}: ims_events: {bad} event{'s' * (bad != 1)} without a positive Moment Total; remove what has none"
        )
    rigidity = settings.rigidity or DEFAULT_RIGIDITY
    attributes = {
        "mine": settings.mine or "elk_creek",
        "kind": "recorded",
        "rigidity": rigidity,
        "shear_modulus": rigidity,
        "lame_lambda": np.nan,
        "caveats": json.dumps(CAVEATS),
    }
    events = new_catalog(
        len(frame),
        attributes,
        time=frame["time"].to_numpy("datetime64[ns]"),
        location=frame[COORDINATES].to_numpy(float),
        potency=moment / rigidity,
        moment=moment,
        mw=moment_magnitude(moment),
    )
    for column, field in STATED_COLUMNS.items():
        if column in frame:
            values = _numbers(frame[column], folder).to_numpy(float)
            events[field.name] = (field.dims, np.where(values > 0, values, np.nan), field.attributes)
    numbers = {name: frame[name].to_numpy() for name in frame.select_dtypes("number")}
    texts = frame.drop(columns="time").select_dtypes(["object", "string"])
    words = {name: texts[name].fillna("").astype(str).to_numpy(object) for name in texts}
    events = filter_events(events, settings, numbers, source=str(folder), words=words)

    chosen = settings.orientations
    if chosen:
        events = events.merge(
            read_orientations(folder, chosen, limits_of(settings), settings.domain),
            combine_attrs="drop_conflicts",
        )
    events.attrs |= _location_error(events, settings)
    logging.info("%s: %d events; %s", folder, events.sizes["event"], events.attrs["location_error_from"])
    return events


def read_orientations(
    folder: Path, chosen: OrientationSettings, limits: Mapping, domain: DomainBox | None = None
) -> xr.Dataset:
    """Orientations (dim orientation) of reprocessed events with `Location Error` below chosen.max_location_error (m).

    chosen: max_location_error; lower and upper (corners of a box, m), start and end (ISO, UTC), each the record's own
    limit where absent. domain: as in catalogs.records.filters; only events within it count. A small location error
    alone selects ground near a sensor: most such events are in the mains, 700 m from the face, so name the box that is
    to be compared. Raises InputError when no event is left.
    """
    frame = _read_parquet(data_path(folder, "rocksigma_events"), ROCKSIGMA_COLUMNS)
    location = frame[COORDINATES].to_numpy(float)
    time = frame["time"].to_numpy("datetime64[ns]")
    kept = frame["Location Error"].to_numpy(float) < chosen.max_location_error
    given = chosen.given()
    limit: dict[str, Any] = {key: given.get(key, limits.get(key)) for key in ("lower", "upper", "start", "end")}
    for key, inside in (("lower", np.greater_equal), ("upper", np.less_equal)):
        if limit[key] is not None:
            kept &= inside(location, np.asarray(limit[key], float)).all(axis=1)
    for key, inside in (("start", np.greater_equal), ("end", np.less)):
        if limit[key]:
            kept &= inside(time, parse_time(limit[key], f"record.orientations.{key}"))
    if domain:
        kept &= distance_beyond(location, *domain_box(domain)) == 0
    if not kept.any():
        raise InputError(
            f"{folder}: record.orientations: none of {len(frame)} left; widen max_location_error, box or dates"
        )

    tensor = np.empty((kept.sum(), 3, 3))
    for (row, column), name in TENSOR_COLUMNS.items():
        tensor[:, row, column] = tensor[:, column, row] = frame[name].to_numpy(float)[kept]
    norm = np.sqrt((tensor**2).sum(axis=(1, 2)))
    if not (np.isfinite(norm) & (norm > 0)).all():
        raise InputError(f"{folder}: rocksigma_events: a moment tensor is zero or not a number; remove that event")
    account = {"max_location_error": chosen.max_location_error, **limit}
    account |= {"before": len(frame), "after": int(kept.sum())}
    return xr.Dataset(
        {
            "orientation_time": ("orientation", time[kept], {"long_name": "origin time, UTC"}),
            "orientation_location": (("orientation", "xyz"), location[kept], {"long_name": "location", "units": "m"}),
            "orientation_tensor": (
                ("orientation", "xyz", "axis"),
                tensor / norm[:, None, None],
                {"long_name": "moment tensor over its norm: orientation only", "units": "1"},
            ),
        },
        attrs={"orientation_filter": json.dumps(account)},
    )


def matched_pairs(first: np.ndarray, second: np.ndarray, within: float) -> tuple[np.ndarray, np.ndarray]:
    """Indices of events that are each other's nearest in time, at most `within` seconds apart.

    first (n,), second (m,) datetime64; returns two equally long index arrays, in the order of `second`.
    """
    if first.size == 0 or second.size == 0:
        return np.empty(0, int), np.empty(0, int)
    to_first, to_second = _nearest(first, second), _nearest(second, first)
    index = np.arange(second.size)
    apart = np.abs((first[to_first] - second) / np.timedelta64(1, "ns")) / 1e9
    kept = (to_second[to_first] == index) & (apart <= within)
    return to_first[kept], index[kept]


def _nearest(haystack: np.ndarray, needles: np.ndarray) -> np.ndarray:
    """Index (needle,) of the time in the haystack that is nearest to each needle. Neither need be sorted."""
    order = np.argsort(haystack, kind="stable")
    ordered = haystack[order]
    right = np.clip(np.searchsorted(ordered, needles), 1, max(ordered.size - 1, 1)).clip(max=ordered.size - 1)
    left = np.maximum(right - 1, 0)
    closer_left = np.abs(needles - ordered[left]) <= np.abs(ordered[right] - needles)
    return order[np.where(closer_left, left, right)]


def _location_error(events: xr.Dataset, settings: RecordSlice) -> dict:
    """location_error (m) and where it comes from: given, or the median distance of pairs of the two catalogues.

    That distance holds the errors of both catalogues: it bounds the record's own error from above.
    """
    if settings.location_error is not None:
        return {"location_error": settings.location_error, "location_error_from": "configuration"}
    within = settings.match_within or DEFAULT_MATCH_WITHIN
    ours, theirs = matched_pairs(events["time"].values, events["orientation_time"].values, within)
    if ours.size < MIN_MATCHED_PAIRS:
        raise InputError(
            f"record: only {ours.size} events of the two catalogues match within {within:g} s, too few for a location "
            f"error; give record.location_error"
        )
    apart = events["location"].values[ours] - events["orientation_location"].values[theirs]
    low, median, high = np.percentile(np.linalg.norm(apart, axis=1), [5, 50, 95])
    source = f"median distance of {ours.size} pairs matched within {within:g} s; 5 to 95 %: {low:.0f} to {high:.0f} m"
    return {"location_error": float(median), "location_error_pairs": int(ours.size), "location_error_from": source}


def _read_parquet(folder: Path, columns: list[str]) -> pd.DataFrame:
    """All months of one catalogue in order of time, with `time` (UTC, from mixed ISO 8601 text). Raises InputError."""
    paths = sorted(folder.glob("*.parquet"))
    if not paths:
        raise InputError(f"{folder}: no parquet files; copy them from the {REPOSITORY}")
    frames = []
    for path in paths:
        try:
            frame = pd.read_parquet(path)
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: not a readable parquet file ({error}); copy it again") from error
        missing = [name for name in columns if name not in frame]
        if missing:
            raise InputError(f"{path}: column {missing[0]!r} is missing; the file has {', '.join(map(str, frame))}")
        frames.append(frame)
    frame = pd.concat(frames, ignore_index=True)
    for name in columns:
        if name != DATE:
            frame[name] = _numbers(frame[name], folder)
    frame["time"] = _utc(frame[DATE], folder)
    if frame["time"].isna().any() or frame[COORDINATES].isna().any(axis=None):
        bad = int((frame["time"].isna() | frame[COORDINATES].isna().any(axis=1)).sum())
        raise InputError(
            f"{folder}: {bad} event{'s' * (bad != 1)} without a date or with NaN locations; remove what lacks one"
        )
    return frame.sort_values("time", kind="stable", ignore_index=True)


def _numbers(values: pd.Series, folder: Path) -> pd.Series:
    """A column as numbers, NaN where empty. Raises InputError for what is none."""
    numbers = pd.to_numeric(values, errors="coerce")
    wrong = numbers.isna() & values.notna()
    if wrong.any():
        raise InputError(
            f"{folder}: column {values.name!r}: {str(values[wrong].iloc[0])[:60]!r} is not a number "
            f"({int(wrong.sum())} such); copy the files again"
        )
    return numbers.astype(float)


def _utc(dates: pd.Series, folder: Path) -> pd.Series:
    """ISO 8601 text, mixed forms, as UTC (event,) datetime64[ns], NaT where empty. Raises InputError for another."""
    text = dates.astype("string").str.strip()
    for date in text.dropna().unique():
        check_offset(date, f"{folder}: column {DATE!r}")
    time = pd.to_datetime(text, format="ISO8601", errors="coerce", utc=True)
    wrong = time.isna() & text.notna()
    if wrong.any():
        raise InputError(
            f"{folder}: column {DATE!r}: {text[wrong].iloc[0][:60]!r} is not a date and time ({int(wrong.sum())} "
            "such); expected ISO 8601"
        )
    return time.dt.tz_localize(None).astype("datetime64[ns]")
