"""Displacement in distorted cells, what is mined at a point, depth of failure and closure of made-up fields."""

import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from small_mines import CELL, load, moved_by, rock_of, states_of, with_failed, with_fallen

from common.event_table import new_catalog
from common.opening_table import ALL, FIELDS, SIDES
from response.centre_lines import CentreLine, centre_lines
from response.excess_shear import find_excess
from response.loading_settings import ShearPlane
from response.openings import _recorded, openings_table
from response.rock import FAILED, INTACT, MINED, OUTSIDE, shape_functions
from response.settings import OpeningSlice, OpeningStep
from response.wall_rays import closure, find_chords, look_behind, standing, wall_displacement
from response.walls import sample_walls

DRIVE = {"name": "drive", "shape": "cylinder", "radius": "3 m"}
DRIVE |= {"start": ["-13 m", "-7 m", "-2 m"], "end": ["13 m", "7 m", "2 m"]}
AXIS = np.array([26.0, 14.0, 4.0]) / np.linalg.norm([26.0, 14.0, 4.0])
GRADIENT = np.array([[1e-4, 2e-5, 0.0], [-3e-5, -2e-4, 4e-5], [1e-5, 0.0, 3e-4]])


def from_axis(place):
    """Distance (n,) m of points (n, xyz) from the drive's axis."""
    return np.linalg.norm(place - np.outer(place @ AXIS, AXIS), axis=1)


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Mine, grid, elastic state and walls of a drive that runs across the cells."""
    folder = tmp_path_factory.mktemp("drive")
    mine = load(folder, [DRIVE])
    grid, state = states_of(mine, folder)
    walls = sample_walls(grid, centre_lines(grid, [np.array(mine.openings_slice()["excavations"][0]["path"])]))
    return mine, grid, state, walls


@settings(max_examples=50, deadline=None)
@given(st.integers(2, 3), st.integers(0, 10**6))
def test_shape_functions_take_any_linear_field(dimension, seed):
    """In cubes and in distorted cells; they add up to one."""
    generator = np.random.default_rng(seed)
    bits = (np.arange(1 << dimension)[:, None] >> np.arange(dimension) & 1).astype(float)
    corners = bits + generator.uniform(-0.24, 0.24, (5, 1 << dimension, dimension)) * (
        generator.random((5, 1, 1)) < 0.7
    )
    place = np.einsum(
        "nc,nci->ni", shape_functions(generator.random((5, dimension)), np.tile(bits, (5, 1, 1))), corners
    )
    slope, shift = generator.normal(size=(dimension, dimension)), generator.normal(size=dimension)
    found = np.einsum("nc,nci->ni", shape_functions(place, corners), corners @ slope + shift)
    np.testing.assert_allclose(found, place @ slope + shift, atol=1e-5)
    np.testing.assert_allclose(shape_functions(place, corners).sum(axis=1), 1.0)


def test_what_is_at_a_point(drive):
    _, grid, state, _ = drive
    rock = rock_of(grid, with_failed(state, from_axis(state["position"].values) < 5.0))
    generator = np.random.default_rng(1)
    place = generator.uniform(-15.9, 15.9, (4000, 3))
    what, particle = rock.what(place)
    distance = from_axis(place)
    middle = np.abs(place @ AXIS) < 11.0  # elsewhere faces are near
    clear = middle & (np.abs(distance - 3.0) > CELL) & (np.abs(distance - 5.0) > CELL)
    expected = np.where(distance < 3.0, MINED, np.where(distance < 5.0, FAILED, INTACT))
    np.testing.assert_array_equal(what[clear], expected[clear])
    apart = np.linalg.norm(state["position"].values[particle] - place, axis=1)
    assert (apart <= np.sqrt(3.0) * state["spacing"].values[particle])[what == INTACT].all()
    assert rock.what(np.array([[40.0, 0.0, 0.0]]))[0] == OUTSIDE


def test_walls_move_as_a_linear_field_says(drive):
    _, grid, state, walls = drive
    shift = np.array([0.1, 0.2, -0.3])
    rock = rock_of(grid, moved_by(state, GRADIENT, shift))
    here = walls.at(np.flatnonzero(standing(rock, walls)))
    assert len(here) > 0.95 * len(walls)
    np.testing.assert_allclose(wall_displacement(rock, here), here.place @ GRADIENT.T + shift, atol=2e-7)


def test_closure_of_a_linear_field_is_that_of_its_chords(drive):
    """A rigid motion closes nothing; a stretch opens each chord by its strain along it."""
    _, grid, state, walls = drive
    turn = np.array([[0.0, -1e-4, 2e-4], [1e-4, 0.0, -3e-4], [-2e-4, 3e-4, 0.0]])
    for gradient in (turn, GRADIENT):
        rock = rock_of(grid, moved_by(state, gradient, np.ones(3)))
        chords = find_chords(rock, walls, 10.0)
        assert len(chords.wall) > 0.3 * len(walls)
        between = walls.place[chords.opposite] - walls.place[chords.wall]
        expected = -np.einsum("ci,ij,cj->c", chords.direction, gradient, between)
        np.testing.assert_allclose(closure(chords, wall_displacement(rock, walls)), expected, atol=3e-7)


def test_chords_run_across_the_drive(drive):
    """From roof to floor and from wall to wall, perpendicular to the drive, and not longer than its diameter."""
    _, grid, state, walls = drive
    chords = find_chords(rock_of(grid, state), walls, 10.0)
    side, other = walls.side[chords.wall], walls.side[chords.opposite]
    roof, floor, wall = (SIDES.index(name) for name in ("roof", "floor", "walls"))
    assert set(side.tolist()) == {roof, wall}
    assert np.mean(other[side == roof] == floor) > 0.9  # where a roof ends, a wall may be opposite
    assert np.mean(other[side == wall] == wall) > 0.9
    np.testing.assert_allclose(chords.direction[side == roof] @ AXIS, 0.0, atol=1e-9)
    length = np.linalg.norm(walls.place[chords.opposite] - walls.place[chords.wall], axis=1)
    assert length.max() < 6.0 + CELL
    assert np.quantile(length, 0.95) > 5.5


@pytest.mark.parametrize("depth", [0.0, 1.0, 2.4, 4.0])
def test_depth_of_failure_is_that_of_a_ring(drive, depth):
    """A ring of failed particles around the drive; a single depth is within a cell, the mean within a quarter."""
    _, grid, state, walls = drive
    rock = rock_of(grid, with_failed(state, from_axis(state["position"].values) < 3.0 + depth))
    middle = walls.at(np.flatnonzero((np.abs(walls.place @ AXIS) < 8.0) & (walls.side != SIDES.index("face"))))
    found = look_behind(rock, middle, cKDTree(middle.place))
    assert np.abs(found.depth - depth).max() <= 1.5 * CELL
    assert np.average(found.depth, weights=middle.area) == pytest.approx(depth, abs=0.35 * CELL)
    assert not found.through.any()
    behind = from_axis(state["position"].values[found.particle])
    assert (behind >= 3.0 + depth).all()  # the first intact rock


def test_failed_rock_that_does_not_touch_a_wall_is_not_its_own(drive):
    _, grid, state, walls = drive
    distance = from_axis(state["position"].values)
    rock = rock_of(grid, with_failed(state, (distance > 6.0) & (distance < 8.0)))
    assert look_behind(rock, walls, cKDTree(walls.place)).depth.max() == 0.0


@pytest.mark.parametrize("grid", [{"particles_per_cell": 8}, {"cut_cells": "whole", "volume_error": 0.5}])
def test_walls_are_alike_whatever_the_cells(tmp_path, grid):
    """A symmetric room: roof and floor bear the same, and all its walls stand, with eight particles in a cell, too."""
    room = {
        "name": "room",
        "shape": "box",
        "lower": ["-4.3 m", "-3.3 m", "-2.3 m"],
        "upper": ["4.3 m", "3.3 m", "2.3 m"],
    }
    mine = load(tmp_path, [room], grid={"coarse_cell": "4 m", "levels": 3, "buffer_cells": 2} | grid)
    cells, state = states_of(mine, tmp_path)
    table = table_of(mine, cells, [state])
    value = {
        str(table["side"].values[row]): table.isel(row=row)
        for row in np.flatnonzero(np.isnan(table["chainage_from"].values))
    }
    assert float(value["roof"]["major_stress"]) == pytest.approx(float(value["floor"]["major_stress"]), rel=0.02)
    assert float(value["roof"]["wall_area"]) == pytest.approx(8.6 * 6.6, rel=0.05)
    assert np.isfinite(float(value["roof"]["closure_median"]))


def test_failed_rock_between_two_openings_is_shared(tmp_path):
    """A pillar of 4 m that has failed through: each side has its half, and says that it meets the other."""
    west = {"name": "west", "shape": "box", "lower": ["-8 m", "-4 m", "-3 m"], "upper": ["-2 m", "4 m", "3 m"]}
    east = {"name": "east", "shape": "box", "lower": ["2 m", "-4 m", "-3 m"], "upper": ["8 m", "4 m", "3 m"]}
    mine = load(tmp_path, [west, east])
    grid, state = states_of(mine, tmp_path)
    rock = rock_of(grid, with_failed(state, np.abs(state["position"].values[:, 0]) < 2.0))
    walls = sample_walls(grid, [None, None])
    pillar = np.flatnonzero((np.abs(np.abs(walls.place[:, 0]) - 2.0) < 0.01) & (np.abs(walls.place[:, 1]) < 3.0))
    found = look_behind(rock, walls, cKDTree(walls.place))
    np.testing.assert_allclose(found.depth[pillar], 2.0, atol=0.3)
    assert found.through[pillar].all()


def table_of(mine, grid, states, events=None, recorded=None):
    nothing = [np.empty((0, 3))] * len(states)
    return openings_table(OpeningSlice.of(mine.openings_slice()), grid, states, events or nothing, recorded or nothing)


def test_the_table_adds_up(drive):
    """Volumes and events are counted once, in sides and in stretches; each row has all columns."""
    mine, grid, state, _ = drive
    failed = with_failed(state, from_axis(state["position"].values) < 5.0)
    events = [np.array([[0.0, 0.0, 5.0], [3.0, 8.0, -1.0]])]
    table = table_of(mine, grid, [failed], events, [np.array([[0.0, 0.0, -6.0]])])
    assert set(table) == {field.name for field in FIELDS}
    whole = np.isnan(table["chainage_from"].values)
    every = table["side"].values == ALL
    rock = (failed["failed"].values >= 0) & (failed["volume"].values > 0.0)
    for rows in (whole & every, whole & ~every, ~whole & every, ~whole & ~every):
        assert table["failed_volume"].values[rows].sum() == pytest.approx(failed["volume"].values[rock].sum())
        assert table["events_modelled"].values[rows].sum() == 2
        assert table["events_recorded"].values[rows].sum() == 1
    one = table.isel(row=np.flatnonzero(whole & every)[0])
    assert one["major_stress_change"] > 0.0
    assert one["depth_mean"] == pytest.approx(2.0, abs=0.35)
    ends = table["chainage_to"].values[~whole]
    assert ends.max() == pytest.approx(np.linalg.norm([26, 14, 4]), abs=1e-6)


def test_fallen_rock_has_a_volume_and_a_depth_of_its_own(tmp_path):
    """A metre of the roof has fallen, another one has failed: each counts once, and with the roof."""
    room = {"name": "room", "shape": "box", "lower": ["-4 m", "-3 m", "-2 m"], "upper": ["4 m", "3 m", "2 m"]}
    mine = load(tmp_path, [room])
    grid, state = states_of(mine, tmp_path)
    place = state["position"].values
    above = (np.abs(place[:, 0]) < 4.0) & (np.abs(place[:, 1]) < 3.0) & (state["volume"].values > 0.0)
    failed = with_failed(state, above & (place[:, 2] > 2.0) & (place[:, 2] < 4.0))
    table = table_of(mine, grid, [with_fallen(failed, above & (place[:, 2] > 2.0) & (place[:, 2] < 3.0))])
    rows = table.to_dataframe().set_index("side")
    for side in ("all", "roof"):
        assert rows["fallen_volume"][side] == pytest.approx(48.0)
        assert rows["failed_volume"][side] == pytest.approx(48.0)
    assert rows["depth_mean"]["roof"] == pytest.approx(2.0)
    assert rows["fallen_volume"]["walls"] == rows["fallen_volume"]["floor"] == 0.0
    assert table_of(mine, grid, [failed]).to_dataframe()["fallen_volume"].abs().max() == 0.0


def test_fallen_rock_has_no_stress_on_a_plane(tmp_path):
    """A flat plane through the roof: of what has failed it has a value, of what has fallen none."""
    room = {"name": "room", "shape": "box", "lower": ["-4 m", "-3 m", "-2 m"], "upper": ["4 m", "3 m", "2 m"]}
    grid, state = states_of(load(tmp_path, [room]), tmp_path)
    place = state["position"].values
    above = (np.abs(place[:, 0]) < 4.0) & (np.abs(place[:, 1]) < 3.0) & (state["volume"].values > 0.0)
    failed = with_failed(state, above & (place[:, 2] > 2.0) & (place[:, 2] < 4.0))
    fallen = with_fallen(failed, above & (place[:, 2] > 2.0) & (place[:, 2] < 3.0))
    plane = ShearPlane(name="flat", point=["0.3 m", "0.3 m", "2.6 m"], strike="0 deg", dip="0 deg")
    found = [find_excess(rock_of(grid, one), plane, np.radians(30.0)).at_point for one in (failed, fallen)]
    assert np.isfinite(found[0])
    assert np.isnan(found[1])


def test_fallen_rock_of_a_plane_has_the_volume_of_its_thickness(tmp_path):
    hole = {"name": "hole", "shape": "circle", "center": ["0 m", "0 m"], "radius": "3 m"}
    mine = load(
        tmp_path, [hole], plane="xz", thickness="7 m", domain={"lower": ["-16 m", "-16 m"], "upper": ["16 m", "16 m"]}
    )
    grid, state = states_of(mine, tmp_path)
    place = state["position"].values
    chosen = (np.abs(place[:, 0]) < 1.0) & (place[:, 2] > 4.0) & (place[:, 2] < 5.0)
    where, volume = rock_of(grid, with_fallen(state, chosen)).fallen_volume
    assert volume.sum() == pytest.approx(2.0 * 7.0)
    np.testing.assert_allclose(where[:, 1], 0.0)
    np.testing.assert_allclose(where[:, 2], 4.5)


def test_the_order_of_excavations_changes_no_row(tmp_path):
    """Two drives that cross, listed the other way round."""
    other = {"name": "other", "shape": "box", "lower": ["-2 m", "-11 m", "-9 m"], "upper": ["2 m", "11 m", "-5 m"]}
    found = []
    for number, order in enumerate(([DRIVE, other], [other, DRIVE])):
        folder = tmp_path / str(number)
        folder.mkdir()
        mine = load(folder, order)
        grid, state = states_of(mine, folder)
        place = state["position"].values
        state = with_failed(state, (from_axis(place) < 4.5) | (np.abs(place - [0.0, 0.0, -7.0]).max(axis=1) < 4.0))
        table = table_of(mine, grid, [state]).to_dataframe()
        found.append(table.sort_values(["excavation", "side", "chainage_from"]).reset_index(drop=True))
    numbers = found[0].columns[3:]
    assert (found[0][found[0].columns[:3]] == found[1][found[1].columns[:3]]).all(axis=None)
    np.testing.assert_allclose(found[0][numbers].astype(float), found[1][numbers].astype(float), rtol=1e-6, atol=1e-9)


def test_closure_counts_from_the_step_that_mines(tmp_path):
    """What the rock has moved before an opening is mined does not close it; later steps add to it."""
    later = {"name": "later", "shape": "box", "lower": ["6 m", "-3 m", "-3 m"], "upper": ["11 m", "3 m", "3 m"]}
    first = {"name": "first", "shape": "box", "lower": ["-11 m", "-3 m", "-3 m"], "upper": ["-6 m", "3 m", "3 m"]}
    steps = [{"name": "history"}, {"name": "second"}]
    mine = load(tmp_path, [first, later | {"step": "second"}], steps=steps)
    grid, state = states_of(mine, tmp_path)
    squeeze = np.diag([0.0, -1e-3, 0.0])
    states = [moved_by(state, squeeze, np.zeros(3)), moved_by(state, 3 * squeeze, np.zeros(3))]
    table = table_of(mine, grid, states)
    walls = {
        (str(table["step"].values[row]), str(table["excavation"].values[row])): float(
            table["closure_largest"].values[row]
        )
        for row in np.flatnonzero((table["side"].values == "walls") & np.isnan(table["chainage_from"].values))
    }
    expected = {("history", "first"): 6e-3, ("second", "first"): 18e-3, ("second", "later"): 12e-3}
    assert walls == pytest.approx(expected, rel=1e-3)


def test_a_line_of_one_stretch_ends_where_it_ends():
    chainage, _ = CentreLine(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 7.0]])).project(np.array([[1.0, 0.0, 9.0]]))
    assert chainage == 7.0


@pytest.mark.parametrize(
    ("period", "numbers"),
    [
        (None, [None, 1, 1, 0]),
        (["2019-08-01T00:00:00Z", "2019-09-10T00:00:00Z"], [None, 1, 1, None]),
        (["2019-09-01T00:00:00Z", "2019-11-01T00:00:00Z"], [None, None, 1, 0]),
    ],
)
def test_a_step_that_the_record_does_not_reach_has_no_number_of_recorded_events(period, numbers):
    """It was 0: a month that nobody has recorded looked like a quiet one."""
    dates = [f"2019-{month:02d}-01T00:00:00Z" for month in (8, 9, 10, 11)]
    dated = [OpeningStep(name=start[:7], start=start, end=end) for start, end in pairwise(dates)]
    steps = (OpeningStep(name="history", start="", end=""), *dated)
    record = new_catalog(
        2, {"mine": "demo", "kind": "recorded", "period": json.dumps({"common": period} if period else {})},
        time=np.array(["2019-08-20", "2019-09-05"], "datetime64[ns]"),
    )  # fmt: skip
    assert [one if one is None else len(one) for one in _recorded(steps, record)] == numbers
    assert _recorded(steps, None) == [None] * 4
