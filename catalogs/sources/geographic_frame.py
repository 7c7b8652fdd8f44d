"""The map on the globe: x east, y north, z up above sea level, in metres <-> latitude, longitude, depth.

Two forms: {latitude, longitude, surface}: the origin of the frame, degrees WGS 84, axes of the local tangent plane
(azimuthal equidistant: exact at the origin, 1 mm off at 20 km); or {crs: EPSG code, WKT or PROJ text, surface}, whose
axes may run in any direction: its westing is minus the easting here. `surface` (elevation of the ground, m) and `grid`
(coordinates of the mine's files on this map) play no part here.
"""

import json
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError, ProjError

from common.errors import InputError
from common.frame import Frame
from common.mine_grid import DIRECTIONS, EAST_NORTH

GEOGRAPHIC = "EPSG:4326"


class MineFrame:
    """Transforms between map coordinates (x east, y north, z up, m) and latitude, longitude (degrees, WGS 84), depth
    below sea level (m)."""

    def __init__(self, settings: Frame | Mapping | str | None):
        """settings: the mine's `frame`, as such, as a mapping or JSON. Raises InputError if absent or not a frame."""
        if isinstance(settings, Frame):
            settings = settings.given()
        settings = json.loads(settings) if isinstance(settings, str) else dict(settings or {})
        given = {key for key, value in settings.items() if value is not None} - {"surface", "grid"}
        if given == {"crs"}:
            projection = _parse_crs(settings["crs"])
        elif given == {"latitude", "longitude"}:
            latitude, longitude = float(settings["latitude"]), float(settings["longitude"])
            if not (abs(latitude) <= 90 and abs(longitude) <= 180):
                raise InputError(f"frame: latitude {latitude}, longitude {longitude}: not degrees on the globe")
            projection = CRS.from_proj4(
                f"+proj=aeqd +lat_0={latitude!r} +lon_0={longitude!r} +datum=WGS84 +units=m +no_defs"
            )
        else:
            raise InputError("frame: give either latitude and longitude of its origin, or crs (EPSG code or WKT)")
        use = projection.area_of_use if "crs" in given else None
        self.area_of_use = use.bounds if use else None  # west, south, east, north in degrees, where the system says so
        # (2, 2): a row for each coordinate of the system, in its order, in east and north
        self._axes = np.array([DIRECTIONS[axis] for axis in _directions(projection)], float)
        self._to_globe = Transformer.from_crs(projection, GEOGRAPHIC)
        self._to_map = Transformer.from_crs(GEOGRAPHIC, projection)

    def to_globe(self, location: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Latitude, longitude (degrees) and depth (m below sea level, = -z) of map coordinates (event, 3) m."""
        location = np.asarray(location, float)
        latitude, longitude = _transformed(self._to_globe, *(self._axes @ location[:, :2].T))
        return np.asarray(latitude), np.asarray(longitude), -location[:, 2]

    def to_map(self, latitude: NDArray, longitude: NDArray, depth: NDArray) -> NDArray:
        """Map coordinates (event, 3) m from degrees and metres below sea level."""
        own = _transformed(self._to_map, np.asarray(latitude, float), np.asarray(longitude, float))
        return np.column_stack([*(self._axes.T @ np.stack(own)), -np.asarray(depth, float)])


def axes_of_crs(text: str) -> tuple[str, ...]:
    """Directions of x and y in coordinates of a system, as files have them.

    They are the system's own, in its order, where one of them is west or south. Of a system with east and north they
    are these, whichever comes first: nearly all programs write x east and y north, whatever a system's order is.
    Raises InputError for what is no projected system, and for axes in no direction of the compass.
    """
    found = _directions(_parse_crs(text))
    return EAST_NORTH if set(found) == set(EAST_NORTH) else found


def _directions(projection: CRS) -> tuple[str, ...]:
    """Directions of the first two axes of a system. Raises InputError for those in no direction of the compass."""
    found = tuple(axis.direction for axis in projection.axis_info[:2])
    if len({direction in ("east", "west") for direction in found if direction in DIRECTIONS}) < 2:
        raise InputError(
            f"frame.crs: {projection.name}: its axes run {' and '.join(found)}, not along a map; give a system with "
            "axes east or west and north or south"
        )
    return found


def _transformed(transformer: Transformer, first: NDArray, second: NDArray) -> tuple[NDArray, NDArray]:
    """Coordinates in the other system; raises InputError for those that it cannot hold."""
    try:
        return transformer.transform(first, second, errcheck=True)
    except ProjError as error:
        raise InputError(
            f"frame: coordinates such as {first[0]:g}, {second[0]:g} have no place in it ({error}); check frame"
        ) from error


def _from_text(text: str | int) -> CRS:
    try:
        return CRS.from_user_input(int(text) if str(text).isdigit() else text)
    except CRSError as error:
        raise InputError(f"frame.crs: {str(text)[:60]!r} is neither an EPSG code nor WKT") from error


def _parse_crs(text: str | int) -> CRS:
    """The system in metres. Raises InputError for what is no projected system."""
    projection = _from_text(text)
    units = unit_of(projection)
    if not projection.is_projected:
        kind = projection.type_name.removesuffix(" CRS").lower()
        raise InputError(f"frame.crs: {projection.name}: expected a projected system, not a {kind} one ({units})")
    return projection if units == "metre" else _in_metres(projection, units)


def unit_of(projection: CRS) -> str:
    """Name of the unit of a system's first two axes, or names."""
    return ", ".join(sorted({axis.unit_name for axis in projection.axis_info[:2]}))


def unit_of_crs(text: str) -> str:
    """Name of the unit of a system that a mine file names, such as metre or US survey foot. Raises InputError."""
    return unit_of(_from_text(text))


def _in_metres(projection: CRS, units: str) -> CRS:
    """The same projection with axes in metres. Raises InputError for a system of several parts."""
    system = projection.to_json_dict()
    if system["type"] != "ProjectedCRS":
        raise InputError(f"frame.crs: {projection.name}: expected a projected system in metres, not {units}")
    for axis in system["coordinate_system"]["axis"]:
        axis["unit"] = "metre"
    system.pop("id", None)  # it is that of the system in feet
    return CRS.from_json_dict(system)
