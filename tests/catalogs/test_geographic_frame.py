import numpy as np
import pytest
from catalog_fixtures import FRAME
from pyproj import CRS

from catalogs.sources.geographic_frame import MineFrame
from common.errors import InputError


def test_frame_north_is_111_km_per_degree_and_goes_there_and_back():
    """One degree of latitude at 41.8 S is 111,066 m on WGS 84 (meridian radius 6,363,700 m)."""
    frame = MineFrame(FRAME)
    location = np.array([[0, 0, 950], [0, 1110.66, -30], [500, 0, 0]])
    latitude, longitude, depth = frame.to_globe(location)
    np.testing.assert_allclose(latitude[:2], [-41.8, -41.79], atol=1e-6)
    assert longitude[2] > 145.4
    np.testing.assert_array_equal(depth, [-950, 30, 0])
    np.testing.assert_allclose(frame.to_map(latitude, longitude, depth), location, atol=1e-6)


def test_frame_from_a_projected_system():
    for crs in (32755, "EPSG:32755", CRS.from_epsg(32755).to_wkt()):
        latitude, longitude, _ = MineFrame({"crs": crs, "surface": 0.0}).to_globe([[500_000.0, 5_372_000.0, 0.0]])
        assert longitude[0] == pytest.approx(147.0)
        assert latitude[0] == pytest.approx(-41.8, abs=0.02)


@pytest.mark.parametrize(
    ("crs", "longitude", "latitude"),
    [
        (32755, 147.0, -41.8),
        (2193, 174.0, -41.0),  # lists the northing first
        ("EPSG:2193+7839", 174.0, -41.0),
        ("+proj=tmerc +lon_0=174 +axis=neu +type=crs", 174.0, -41.0),
        (2053, 29.0, -26.0),  # west and south
        (5513, 15.0, 49.8),  # south and west
        ("+proj=tmerc +lon_0=29 +axis=wsu +datum=WGS84 +units=m +type=crs", 29.0, -26.0),
    ],
)
def test_x_is_east_and_y_north_wherever_the_axes_of_a_system_run(crs, longitude, latitude):
    """1 km along x leads east, 1 km along y north, but for the convergence of meridians."""
    frame = MineFrame({"crs": crs})
    origin = frame.to_map(np.array([latitude]), np.array([longitude]), np.zeros(1))
    north, east, _ = frame.to_globe(origin + np.array([[0, 0, 0], [1000, 0, 0], [0, 1000, 0]]))
    assert east[1] - east[0] > 0.009 > 0.002 > abs(north[1] - north[0])
    assert north[2] - north[0] > 0.008 > 0.002 > abs(east[2] - east[0])


@pytest.mark.parametrize(
    ("crs", "axes"),
    [(3413, "south and south"), (3031, "north and north")],  # polar: each axis follows a meridian
)
def test_a_system_whose_axes_follow_no_direction_of_the_compass_is_refused(crs, axes):
    with pytest.raises(InputError, match=rf"frame\.crs: .*: its axes run {axes}, not along a map") as error:
        MineFrame({"crs": crs})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        ({}, "give either"),
        ({"latitude": 1.0}, "give either"),
        ({"latitude": 1.0, "longitude": 2.0, "crs": 32755}, "give either"),
        ({"latitude": 91.0, "longitude": 2.0}, "degrees"),
        ({"crs": "nonsense"}, "neither an EPSG code nor WKT"),
        ({"crs": 4326}, "expected a projected system, not a geographic"),
    ],
)
def test_bad_frames_are_named(frame, message):
    with pytest.raises(InputError, match=message):
        MineFrame(frame)
