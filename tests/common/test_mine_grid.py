"""The grid of a mine on the map: there and back, tensors, and the fit to common points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import InputError
from common.mine_grid import DIRECTIONS, EAST_NORTH, GridMap, MineGrid, fit
from common.voigt import NAMES, tensor_from_voigt

AXES = [(x, y) for x in DIRECTIONS for y in DIRECTIONS if (x in ("east", "west")) != (y in ("east", "west"))]
COORDINATES = st.floats(-1e7, 1e7)
PLACES = st.tuples(COORDINATES, COORDINATES, st.floats(-1e4, 1e4))
GRIDS = st.builds(
    GridMap,
    axes=st.sampled_from(AXES),
    angle=st.floats(-360, 360),
    scale=st.floats(0.991, 1.009),
    grid_origin=PLACES,
    map_origin=PLACES,
)


@given(GRIDS, st.lists(PLACES, min_size=1, max_size=5))
def test_to_the_map_and_back_is_the_same_place(grid, places):
    """To the rounding of places on the map, in space and in plan."""
    places = np.array(places)
    np.testing.assert_allclose(grid.to_grid(grid.to_map(places)), places, atol=2e-7, rtol=0)
    np.testing.assert_allclose(grid.to_map(grid.to_grid(places)), places, atol=2e-7, rtol=0)
    np.testing.assert_array_equal(grid.to_map(places[:, :2]), grid.to_map(places)[:, :2])


@given(GRIDS)
def test_a_grid_is_turned_and_mirrored_without_a_change_of_length(grid):
    """Its axes are at right angles; its north has the bearing `angle`."""
    np.testing.assert_allclose(grid.turn @ grid.turn.T, np.eye(3), atol=1e-15)
    north = grid.turn[:2, :2] @ np.array([DIRECTIONS[axis] for axis in grid.axes], float) @ [0.0, 1.0]
    expected = np.sin(np.radians(grid.angle)), np.cos(np.radians(grid.angle))
    np.testing.assert_allclose(north, expected, atol=1e-12)
    right_handed = (DIRECTIONS[grid.axes[0]], DIRECTIONS[grid.axes[1]])
    assert grid.is_mirrored == (np.linalg.det(right_handed) < 0)


@given(GRIDS, st.lists(st.floats(-100, 100), min_size=6, max_size=6))
def test_a_tensor_keeps_its_tractions(grid, components):
    """The traction on a plane of the grid is the same vector on the map; principal values stay."""
    own, there = tensor_from_voigt(components), tensor_from_voigt(grid.tensor(components))
    normal = np.array([0.48, 0.6, 0.64])
    np.testing.assert_allclose(there @ grid.vector(normal), grid.vector(own @ normal), atol=1e-12)
    np.testing.assert_allclose(np.linalg.eigvalsh(there), np.linalg.eigvalsh(own), atol=1e-12)


@pytest.mark.parametrize(
    ("axes", "signs"),
    [
        (("east", "north"), [1, 1, 1, 1, 1, 1]),
        (("west", "south"), [1, 1, 1, -1, -1, 1]),
        (("west", "north"), [1, 1, 1, 1, -1, -1]),
    ],
)
def test_a_mirrored_grid_mirrors_the_shear(axes, signs):
    """Exactly: xz and xy change their sign where x alone runs the other way; half a turn keeps xy."""
    components = np.array([-1.0, -2.0, -3.0, 0.4, 0.5, 0.6])
    np.testing.assert_array_equal(GridMap(axes).tensor(components), components * signs)


def test_quarter_turns_are_exact():
    """At 90 degrees the grid's north is the map's east; its east, the map's south."""
    grid = GridMap(angle=90.0)
    np.testing.assert_array_equal(grid.to_map([[0.0, 0.1], [0.1, 0.0]]), [[0.1, 0.0], [0.0, -0.1]])
    swapped = GridMap(("north", "east"))
    np.testing.assert_array_equal(swapped.tensor(np.arange(6.0)), [1.0, 0.0, 2.0, 4.0, 3.0, 5.0])
    assert NAMES == ("xx", "yy", "zz", "yz", "xz", "xy")


def test_round_off_of_a_turn_moves_no_place():
    """A corner at 45 m stays there, by whatever turn and unit it is written."""
    feet = GridMap(angle=32.0, grid_origin=(10.0, 20.0, 0.0), map_origin=(6e5, 7.1e6, 0.0))
    corner = [600045.0, 7100045.0, 25.0]
    assert feet.to_map(feet.to_grid(corner) / 0.3048 * 0.3048).tolist() == corner
    assert feet.elevation(25.0 / 0.3048 * 0.3048 + 1e-12) == 25.0


def test_without_a_grid_places_stay_as_they_are():
    """Bit for bit."""
    place = np.array([0.1 + 0.2, 1e7 / 3, -0.0])
    assert GridMap().to_map(place).tobytes() == place.tobytes()


def test_feet_are_international_or_of_the_us_survey():
    """Metres of one unit of files."""
    assert [GridMap(units=unit).metres_per_unit for unit in ("m", "ft", "us_ft")] == [1.0, 0.3048, 1200 / 3937]


def grid_of(grid: GridMap, places: np.ndarray, **others) -> tuple[MineGrid, np.ndarray]:
    """Settings with common points at these places of a grid (point, 2 or 3) m, and the points on the map."""
    there = grid.to_map(places)
    points = [{"grid": own.tolist(), "map": on.tolist()} for own, on in zip(places, there, strict=True)]
    return MineGrid.of({"points": points} | others), there


@given(GRIDS, st.integers(2, 6), st.booleans(), st.integers(0, 2**32 - 1))
def test_points_without_error_give_the_grid_back(grid, count, in_space, seed):
    """Whatever the turn, the shift and the scale, by two points or more; nothing is left over."""
    random = np.random.default_rng(seed)
    places = (
        np.array(grid.grid_origin) + random.uniform(-2000, 2000, (count, 3)) + [[500.0 * k, 0, 0] for k in range(count)]
    )
    settings, there = grid_of(grid, places[:, : 3 if in_space else 2])
    found = fit(settings, there, grid.axes)
    assert found.residual.max() < 1e-6
    assert found.elevation_residual.max() < 1e-6
    near = places[:, : 3 if in_space else 2] + 100.0
    np.testing.assert_allclose(found.map.to_map(near), grid.to_map(near), atol=1e-4)


def test_residuals_are_those_of_least_squares():
    """A point that is 0.3 m off: the fit agrees with a numerical one, and no other similarity has smaller squares."""
    grid = GridMap(angle=32.0, scale=0.9996, grid_origin=(1000.0, 2000.0, 0.0), map_origin=(5e5, 7e6, 12.0))
    places = np.array([[0.0, 0.0, 0.0], [900.0, 100.0, 50.0], [400.0, 800.0, 100.0], [1000.0, 1000.0, 0.0]])
    settings, there = grid_of(grid, places)
    moved = there + np.array([[0.3, 0, 0.1], [0, 0, 0], [0, 0, 0], [0, 0, 0]])
    found = fit(settings, moved, EAST_NORTH)
    # as linear least squares: E = a x + b y + e, N = -b x + a y + n
    x, y, one, none = *places[:, :2].T, np.ones(4), np.zeros(4)
    design = np.concatenate([np.stack([x, y, one, none], axis=1), np.stack([y, -x, none, one], axis=1)])
    solution, *_ = np.linalg.lstsq(design, moved[:, :2].T.ravel(), rcond=None)
    miss = (design @ solution - moved[:, :2].T.ravel()).reshape(2, 4)
    np.testing.assert_allclose(found.residual, np.hypot(*miss), atol=1e-6)
    np.testing.assert_allclose(found.elevation_residual, [0.075, 0.025, 0.025, 0.025], atol=1e-9)


def test_the_scale_may_be_fixed():
    """Then points 1000 m apart that the map has 999.6 m apart leave 0.2 m each."""
    grid = GridMap(scale=0.9996)
    settings, there = grid_of(grid, np.array([[0.0, 0.0], [1000.0, 0.0]]), scale=1.0)
    found = fit(settings, there, EAST_NORTH)
    assert found.map.scale == 1.0
    np.testing.assert_allclose(found.residual, 0.2, atol=1e-9)


TRIANGLE = np.array([[0.0, 0.0], [900.0, 100.0], [400.0, 800.0]])


def test_a_residual_that_is_too_large_is_refused():
    """In one line that names the point; in plan and in elevation."""
    settings, there = grid_of(GridMap(angle=10.0), TRIANGLE)
    there[2] += [3.0, 0.0]
    with pytest.raises(InputError, match=r"^frame\.grid\.points\[\d\]: is missed by .* in plan \(max_residual 0.5 m\)"):
        fit(settings, there, EAST_NORTH)
    settings, there = grid_of(GridMap(), np.column_stack([TRIANGLE, [0.0, 0.0, 9.0]]))
    there[2] += [0.0, 0.0, 3.0]
    with pytest.raises(InputError, match=r"frame\.grid\.points\[2\]: is missed by 2 m in elevation"):
        fit(settings, there, EAST_NORTH)


def test_points_of_a_mirrored_grid_say_so():
    """Three points tell that the axes are mirrored; two cannot."""
    settings, there = grid_of(GridMap(("north", "east"), angle=32.0), TRIANGLE)
    with pytest.raises(InputError, match=r"with axes: \[north, east\], mirrored, they fit"):
        fit(settings, there, EAST_NORTH)
    assert fit(settings, there, ("north", "east")).residual.max() < 1e-9


def test_points_in_other_units_are_refused():
    """A scale that no map has is one of units."""
    settings, there = grid_of(GridMap(), TRIANGLE)
    with pytest.raises(InputError, match=r"frame\.grid\.points: distances on the map are 3.28084 times those in the"):
        fit(settings, there / 0.3048, EAST_NORTH)


@pytest.mark.parametrize(
    ("grid", "line"),
    [
        ({"axes": ["east", "nort"]}, r"^axes\[1\]: 'nort' is not one of east, north, west, south, up, down$"),
        ({"axes": ["east", "down"]}, r"^axes: give the directions of x and y in plan, then up or down as that of z"),
        ({"axes": ["east", "north", "west"]}, r"^axes: give the directions of x and y in plan, then up or down as"),
        ({"axes": ["east", "west"]}, r"^axes: east and west are on one line; give one of east, west and one of"),
        ({"axes": ["east"]}, r"^axes: .* is too short; give at least 2$"),
        ({"angle": "32"}, r"^angle: '32' has no unit"),
        ({"scale": 0.3048}, r"^scale: 0.3048 is less than the minimum of 0.99$"),
        ({"units": "feet"}, r"^units: 'feet' is not one of m, ft, us_ft$"),
        ({"max_residual": "1 m"}, r"^max_residual: of which points\? give points, or leave it out$"),
        ({"origin": {"grid": ["1 m", "2 m"], "map": ["1 m", "2 m", "3 m"]}}, r"^origin\.map: 3 coordinates, but 2 in"),
    ],
)
def test_a_wrong_grid_is_refused_in_a_line(grid, line):
    with pytest.raises(InputError, match=line):
        MineGrid.read(grid)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda points: points[:1], r"points: .*too short; give at least 2"),
        (lambda points: [points[0], points[0]], r"points\[1\]\.grid: the same place as an earlier point"),
        (
            lambda points: [points[0], points[1] | {"map": points[0]["map"]}],
            r"points\[1\]\.map: the same place as an earlier point",
        ),
        (
            lambda points: [points[0], {key: [*place, "0 m"] for key, place in points[1].items()}],
            r"points: some have elevations and some have none",
        ),
    ],
)
def test_wrong_points_are_refused_in_a_line(change, line):
    points = [{"grid": [f"{x} m", "0 m"], "map": [f"{x} m", "9 m"]} for x in (0, 100)]
    MineGrid.read({"points": points})
    with pytest.raises(InputError, match=line):
        MineGrid.read({"points": change(points)})
    with pytest.raises(InputError, match=r"^angle: stands beside points"):
        MineGrid.read({"points": points, "angle": "3 deg"})
