"""The mine frame on the globe: x east, y north, z up above sea level, in metres <-> latitude, longitude, depth.

Two forms: {latitude, longitude, surface}: the origin of the frame, degrees WGS 84, axes of the local tangent plane
(azimuthal equidistant: exact at the origin, 1 mm off at 20 km); or {crs: EPSG code, WKT or PROJ text, surface}.
`surface` (elevation of the ground, m) turns z into a depth below ground elsewhere; it plays no part here.
"""

import json
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError, ProjError

from common.errors import InputError
from common.frame import Frame

GEOGRAPHIC = "EPSG:4326"


class MineFrame:
    """Transforms between mine coordinates (m) and latitude, longitude (degrees, WGS 84), depth below sea level (m)."""

    def __init__(self, settings: Frame | Mapping | str | None):
        """settings: the mine's `frame`, as such, as a mapping or JSON. Raises InputError if absent or not a frame."""
        if isinstance(settings, Frame):
            settings = settings.given()
        settings = json.loads(settings) if isinstance(settings, str) else dict(settings or {})
        given = {key for key, value in settings.items() if value is not None} - {"surface"}
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
        self._to_globe = Transformer.from_crs(projection, GEOGRAPHIC, always_xy=True)
        self._to_mine = Transformer.from_crs(GEOGRAPHIC, projection, always_xy=True)

    def to_globe(self, location: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Latitude, longitude (degrees) and depth (m below sea level, = -z) of mine coordinates (event, 3) m."""
        location = np.asarray(location, float)
        longitude, latitude = _transformed(self._to_globe, location[:, 0], location[:, 1])
        return np.asarray(latitude), np.asarray(longitude), -location[:, 2]

    def to_mine(self, latitude: NDArray, longitude: NDArray, depth: NDArray) -> NDArray:
        """Mine coordinates (event, 3) m from degrees and metres below sea level."""
        x, y = _transformed(self._to_mine, np.asarray(longitude, float), np.asarray(latitude, float))
        return np.column_stack([x, y, -np.asarray(depth, float)])


def _transformed(transformer: Transformer, first: NDArray, second: NDArray) -> tuple[NDArray, NDArray]:
    """Coordinates in the other system; raises InputError for those that it cannot hold."""
    try:
        return transformer.transform(first, second, errcheck=True)
    except ProjError as error:
        raise InputError(
            f"frame: coordinates such as {first[0]:g}, {second[0]:g} have no place in it ({error}); check frame"
        ) from error


def _parse_crs(text: str | int) -> CRS:
    try:
        projection = CRS.from_user_input(int(text) if str(text).isdigit() else text)
    except CRSError as error:
        raise InputError(f"frame.crs: {str(text)[:60]!r} is neither an EPSG code nor WKT") from error
    units = {axis.unit_name for axis in projection.axis_info[:2]}
    if not projection.is_projected or units != {"metre"}:
        raise InputError(f"frame.crs: {projection.name}: expected a projected system in metres, not {', '.join(units)}")
    directions = [axis.direction for axis in projection.axis_info[:2]]
    if {*directions} != {"east", "north"}:  # in either order: always_xy puts the easting first
        raise InputError(
            f"frame.crs: {projection.name}: its axes run {' and '.join(directions)}, and here x runs east and y north; "
            "transform all coordinates to a system whose axes run east and north, and give that one (EPSG code, or "
            "PROJ text without +axis)"
        )
    return projection
