"""Checks of a record and of the frame before anything is read: columns, boxes, dates, places on the globe."""

import math
from typing import TYPE_CHECKING

import numpy as np

from catalogs.records import READERS
from common.errors import InputError, Mistakes
from workflow.dates import read_date
from workflow.mine import Mine
from workflow.shapes import is_file

if TYPE_CHECKING:
    from catalogs.sources.geographic_frame import MineFrame

FARTHEST_FROM_ORIGIN = 100e3  # m; no mine is as large, and no easting or northing of a map as small
BEYOND_USE = 3.0  # degrees that a projected system may be used beyond its zone: half a zone of UTM


def check_record(mine: Mine, mistakes: Mistakes) -> None:
    """Check the settings of a mine's record."""
    record = mine.settings.record
    if record is None:
        return
    if not READERS[record.reader].READS_FOLDER and not is_file(mine.path(record.file)):
        mistakes.add(f"record.file: {mine.path(record.file)} is missing; paths resolve from {mine.folder}")
    columns = getattr(record, "columns", None)
    if columns and columns.latitude is not None and columns.x is None and not mine.settings.frame.has_place:
        mistakes.add(
            "record.columns.latitude: the frame has no place on Earth to compute it from; give frame.latitude and "
            "frame.longitude, or frame.crs, or the columns x, y and z"
        )
    for name in ("filter", "orientations"):
        if part := getattr(record, name, None):
            with mistakes.gather():
                _check_part(f"record.{name}", part.given())


def _check_part(where: str, part: dict) -> None:
    """Check that dates are valid and in order, boxes have three coordinates, and lower bounds are below upper ones."""
    dates = {key: read_date(f"{where}.{key}", part[key]) for key in ("start", "end") if key in part}
    if len(dates) == 2 and dates["start"] >= dates["end"]:
        raise InputError(f"{where}.end: {part['end']} is not after start {part['start']}")
    for key in ("lower", "upper"):
        if key in part and len(part[key]) != 3:
            raise InputError(f"{where}.{key}: {len(part[key])} coordinates; a record's box has three, x, y and z")
    for axis, low, high in zip("xyz", part.get("lower", ()), part.get("upper", ()), strict=False):
        if low >= high:
            raise InputError(f"{where}.upper: {axis} = {high:g} m is not above lower, {low:g} m: upside down")
    most, least = part.get("maximum", {}), part.get("minimum", {})
    for column in set(most) & set(least):
        if most[column] < least[column]:
            raise InputError(f"{where}.maximum.{column}: {most[column]:g} is below the minimum, {least[column]:g}")


def check_filter(mine: Mine, _: Mistakes) -> None:
    """Check that the filter's box reaches into the domain, to which the record is cropped. Raises InputError."""
    record, domain = mine.settings.record, mine.settings.domain
    chosen = record and record.filter
    if not chosen:
        return
    lowest, highest = chosen.lower or [-math.inf] * 3, chosen.upper or [math.inf] * 3
    axes = {"xz": (0, 2), "xy": (0, 1)}.get(mine.plane, (0, 1, 2))
    for axis, lower, upper in zip(axes, domain.lower, domain.upper, strict=True):
        low, high = lowest[axis], highest[axis]
        if low >= upper or high <= lower:
            raise InputError(
                f"record.filter: the box lies outside the domain, {'xyz'[axis]} {lower:g} to {upper:g} m, to which the "
                f"record is cropped; correct it{', or give domain.lower and domain.upper' if mine.far_field else ''}"
            )


def check_frame(mine: Mine, _: Mistakes) -> None:
    """Check that the domain's corners have a place on the globe, near that of the frame. Raises InputError."""
    frame, domain = mine.settings.frame, mine.settings.domain
    axes = (0, 1) if mine.plane != "xz" else (0,)
    corners = [[end[axis] for axis in axes] + [0.0] * (2 - len(axes)) for end in (domain.lower, domain.upper)]
    if frame.crs is None:
        farthest = max(math.hypot(*corner) for corner in corners)
        if frame.latitude is not None and farthest > FARTHEST_FROM_ORIGIN:
            raise InputError(
                f"frame: the domain lies {farthest / 1000:.0f} km from the frame's origin; x and y count from the "
                "point of that latitude and longitude. For eastings and northings of a map give crs instead (EPSG code)"
            )
        return
    from catalogs.sources.geographic_frame import MineFrame  # slow to import

    system = MineFrame(frame)
    latitude, longitude = system.to_globe(np.array([[*corner, 0.0] for corner in corners]))[:2]
    if system.area_of_use and degrees_outside(system, latitude, longitude).max() > BEYOND_USE:
        west, south, east, north = system.area_of_use
        raise InputError(
            f"frame.crs: the domain lies at latitude {latitude[0]:.1f}, longitude {longitude[0]:.1f}, outside the area "
            f"of {frame.crs[:40]} (longitude {west:g} to {east:g}, latitude {south:g} to {north:g}); coordinates of "
            "a mine grid need its own false origin, as PROJ text or WKT, or frame.grid"
        )


def degrees_outside(system: "MineFrame", latitude: np.ndarray, longitude: np.ndarray) -> np.ndarray:
    """Degrees (point,) by which points lie outside the area of a system; 0 where it states none."""
    if system.area_of_use is None:
        return np.zeros(len(latitude))
    west, south, east, north = system.area_of_use
    return np.array(
        [max(south - y, y - north, _outside(x, west, east)) for x, y in zip(longitude, latitude, strict=True)]
    )


def _outside(longitude: float, west: float, east: float) -> float:
    """Degrees by which a meridian lies outside a zone from west to east, which may cross 180 degrees."""
    if (longitude - west) % 360 <= (east - west) % 360:
        return 0.0
    return min((west - longitude) % 360, (longitude - east) % 360)
