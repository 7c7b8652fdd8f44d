"""Surfaces of open pits that are closed at the ground: volumes of stepped pits, relations, and refusals."""

import logging

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import InputError
from common.mine_grid import GridMap
from geometry.pits import GROUND, stepped_pit, with_ground, write_obj
from mpm_core.geometry.inside import contains
from mpm_core.geometry.open_pits import closed_at
from mpm_core.geometry.solid_files import Picked, read_solid
from mpm_core.geometry.solids import Solid
from mpm_core.geometry.thickness import cells_across

MAX_ERROR = 1e-3  # Of a volume, as the issue asks.
POINTS = np.random.default_rng(5).uniform([-130, -130, GROUND - 70], [130, 130, GROUND], (4000, 3))


def closed(vertices: np.ndarray, facets: np.ndarray, level: float = GROUND) -> Solid:
    """The solid of a surface that is closed at the ground."""
    found = closed_at(vertices, facets, level)
    return Solid("pit", found.vertices, found.facets)


def read(path, closed_at: float | None = GROUND, **keys) -> Solid:
    return read_solid(path, "pit", Picked(closed_at=closed_at, **keys))


@pytest.mark.parametrize("rim", [GROUND, GROUND + 20.0], ids=["at the ground", "above it"])
@pytest.mark.parametrize("sides", [4, 24, 301])
def test_volume_of_a_stepped_pit(rim, sides, tmp_path):
    """A sum of prisms; what rises above the ground is cut off."""
    vertices, facets, volume = stepped_pit(sides=sides, rim=rim)
    solid = read(write_obj(tmp_path / "pit.obj", vertices, facets))
    assert solid.is_closed
    assert solid.volume == pytest.approx(volume, rel=1e-9)
    assert solid.bounds[1, 2] == GROUND


def test_without_the_key_it_is_refused_as_before(tmp_path):
    with pytest.raises(InputError, match=r"large holes.* open at the ground needs closed_at_ground: true"):
        read(write_obj(tmp_path / "pit.obj", *stepped_pit(bench=4.0)[:2]), closed_at=None)


@given(
    turn=st.floats(0, 360), mirror=st.booleans(), order=st.randoms(use_true_random=False),
    flips=st.sampled_from(["none", "all", "some"]), shift=st.floats(-1e6, 1e6), parts=st.integers(1, 5),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_the_same_pit_however_it_is_written(turn, mirror, order, flips, shift, parts):
    """Turned, mirrored, moved, its triangles in another order, of another orientation, and in several pieces."""
    vertices, facets, volume = stepped_pit()
    inside = contains(closed(vertices, facets), POINTS)
    sine, cosine = np.sin(np.radians(turn)), np.cos(np.radians(turn))
    matrix = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]) @ np.diag([-1.0 if mirror else 1.0, 1, 1])
    moved = vertices @ matrix.T + [shift, -shift, 0.0]
    rows = list(range(len(facets)))
    order.shuffle(rows)
    facets = facets[rows]
    flipped = np.array([flips == "all" or (flips == "some" and order.random() < 0.5) for _ in rows])
    facets = np.where(flipped[:, None], facets[:, ::-1], facets)
    pieces = np.array_split(facets, parts)
    used, number = np.unique(np.concatenate(pieces), return_inverse=True)
    solid = closed(moved[used], number.reshape(-1, 3))
    assert solid.is_closed
    assert solid.volume == pytest.approx(volume, rel=1e-6)
    near = np.abs(np.linalg.norm(POINTS[:, :2], axis=1)[:, None] - [100, 92, 84, 70]).min(axis=1) > 1.0
    points = POINTS @ matrix.T + [shift, -shift, 0.0]
    assert (contains(solid, points) == inside)[near].all()


def test_a_lid_at_or_above_the_ground_changes_nothing():
    """A surface that is closed already, by a fan of triangles over its rim."""
    for rim in (GROUND, GROUND + 7.0):
        vertices, facets, volume = stepped_pit(rim=rim)
        middle = len(vertices)
        lid = np.column_stack([np.roll(np.arange(24), -1), np.arange(24), np.full(24, middle)])
        solid = closed(np.concatenate([vertices, [[0.0, 0.0, rim]]]), np.concatenate([facets, lid]))
        assert solid.volume == pytest.approx(volume, rel=1e-9)
        assert (contains(solid, POINTS) == contains(closed(*stepped_pit()[:2]), POINTS)).all()


@pytest.mark.parametrize("rise", [0.0, 0.3, -0.3, 8.0])
def test_ground_around_the_pit_bounds_nothing(rise):
    """Level, a little uneven, or rising away from the pit."""
    vertices, facets, volume = stepped_pit()
    found = closed_at(*with_ground(vertices, facets, rise=rise), GROUND)
    assert Solid("pit", found.vertices, found.facets).volume == pytest.approx(volume, rel=MAX_ERROR)
    said = " ".join(found.notes)
    assert ("is taken as level" in said) == (abs(rise) == 0.3)
    assert ("rises up to 8 m above frame.surface" in said) == (rise == 8.0)


def test_two_pits_and_rock_left_in_one():
    """Pits next to each other; and a knoll that reaches the ground within a pit: a hole of the lid."""
    one, facets, volume = stepped_pit()
    other, _, other_volume = stepped_pit(radii=(50.0, 40.0, 30.0, 20.0), center=(400.0, 0.0))
    both = closed(np.concatenate([one, other]), np.concatenate([facets, facets[:, ::-1] + len(one)]))
    assert both.volume == pytest.approx(volume + other_volume, rel=1e-9)
    knoll, _, rock = stepped_pit(radii=(10.0, 20.0, 30.0, 60.0))
    last = len(facets) - 24
    vertices, walls = np.concatenate([one, knoll]), np.concatenate([facets[:last], facets[:last] + len(one)])
    # the floor between the last ring of the pit and that of the knoll
    outer, inner, ahead = 7 * 24 + np.arange(24), len(one) + 7 * 24 + np.arange(24), np.roll(np.arange(24), -1)
    floor = [np.column_stack([outer, outer[ahead], inner]), np.column_stack([outer[ahead], inner[ahead], inner])]
    left = closed(vertices, np.concatenate([walls, *floor]))
    assert left.is_closed
    assert left.volume == pytest.approx(volume - rock, rel=1e-9)
    assert not contains(left, np.array([[0.0, 0.0, GROUND - 10.0]]))[0]


def test_pits_within_one_another_are_their_union():
    """Two pushbacks in one file: what both enclose is mined once."""
    inner, facets, _ = stepped_pit(radii=(50.0, 40.0, 30.0, 20.0))
    outer, _, volume = stepped_pit()
    both = closed(np.concatenate([inner, outer]), np.concatenate([facets, facets + len(inner)]))
    assert both.volume == pytest.approx(volume, rel=MAX_ERROR)


def test_overhanging_walls():
    """Each bench is wider than the one above."""
    vertices, facets, volume = stepped_pit(radii=(60.0, 70.0, 80.0, 90.0))
    assert closed(vertices, facets).volume == pytest.approx(volume, rel=1e-9)


def test_points_on_a_straight_side_of_the_rim():
    """A square rim with many points on each side: the lid meets all of them."""
    vertices, facets, volume = stepped_pit(sides=4)
    for _ in range(3):  # each triangle at the rim is divided at the middle of its side there
        rim = (vertices[facets, 2] == GROUND) & (vertices[np.roll(facets, -1, axis=1), 2] == GROUND)
        row, corner = np.nonzero(rim)
        a, b, c = (facets[row, (corner + ahead) % 3] for ahead in range(3))
        new = len(vertices) + np.arange(len(row))
        vertices = np.concatenate([vertices, 0.5 * (vertices[a] + vertices[b])])
        rest = np.delete(facets, row, axis=0)
        facets = np.concatenate([rest, np.column_stack([a, new, c]), np.column_stack([new, b, c])])
    solid = closed(vertices, facets)
    assert solid.is_closed
    assert solid.volume == pytest.approx(volume, rel=1e-9)


def test_level_is_compared_after_the_file_was_placed(tmp_path):
    """A pit in feet, in a turned grid whose elevations are shifted."""
    vertices, facets, volume = stepped_pit()
    grid = GridMap(angle=30.0, grid_origin=(0.0, 0.0, 0.0), map_origin=(1000.0, 2000.0, -100.0), units="ft")
    path = write_obj(tmp_path / "pit.obj", vertices / 0.3048, facets)
    solid = read(path, closed_at=GROUND - 100.0, grid=grid)
    assert solid.volume == pytest.approx(volume, rel=1e-6)
    assert solid.bounds[1, 2] == GROUND - 100.0


@pytest.mark.parametrize(
    ("surface", "level", "message"),
    [
        (stepped_pit()[:2], GROUND + 12.3, r"its rim at .* is 12\.3 m below frame.surface, 512\.3 m; the model's"),
        (stepped_pit()[:2], GROUND / 0.3048, "does not reach the ground: its rim at .* is 1140 m below frame.surface"),
        (stepped_pit()[:2], GROUND * 0.3048, r"lies above the ground, z 440 m and more \(frame.surface: 152.4 m\)"),
        (with_ground(*stepped_pit()[:2], rise=-4.0), GROUND, r"its rim at .* is 4 m below frame.surface, 500 m"),
    ],
)  # fmt: skip
def test_a_surface_that_does_not_reach_the_ground_is_refused_with_the_place(surface, level, message, tmp_path):
    """A rim below it, a ground in feet or of feet, ground that falls away from the pit."""
    path = write_obj(tmp_path / "pit.obj", *surface)
    with pytest.raises(InputError, match=message) as error:
        read(path, level)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_one_of_two_pits_that_does_not_reach_the_ground_is_named():
    low, facets, _ = stepped_pit(radii=(50.0, 40.0), center=(400.0, 0.0), rim=GROUND - 10.0)
    pit, more, _ = stepped_pit()
    with pytest.raises(InputError, match=r"its rim at (3|4)\d\d\.\d\d, .* is 10 m below"):
        closed(np.concatenate([pit, low]), np.concatenate([more, facets + len(pit)]))


def test_a_solid_below_the_ground_is_refused():
    """A lid below the ground would leave rock above the pit."""
    vertices, facets, _ = stepped_pit(rim=GROUND - 5.0)
    lid = np.column_stack([np.roll(np.arange(24), -1), np.arange(24), np.full(24, len(vertices))])
    surface = np.concatenate([vertices, [[0.0, 0.0, GROUND - 5.0]]]), np.concatenate([facets, lid])
    with pytest.raises(InputError, match="closed 5 m below the ground"):
        closed(*surface)


def test_holes_below_the_ground_are_no_rim(tmp_path):
    """A small one in a wall is accepted, as in any solid; without walls and floor below the first bench it is refused,
    as before; a hole at the rim is a rim that is too low."""
    vertices, facets, volume = stepped_pit(sides=96)
    middle = vertices[facets].mean(axis=1)
    wall = np.flatnonzero(np.abs(middle[:, 2] - (GROUND - 25.0)) < 6.0)
    solid = read(write_obj(tmp_path / "small.obj", vertices, np.delete(facets, wall[0], axis=0)))
    assert solid.volume == pytest.approx(volume, rel=5e-3)
    with pytest.raises(InputError, match="large holes"):
        read(write_obj(tmp_path / "floor.obj", vertices, facets[middle[:, 2] > GROUND - 16.0]))
    at_rim = np.flatnonzero((vertices[facets, 2] == GROUND).any(axis=1))
    with pytest.raises(InputError, match=r"does not reach the ground: its rim at .* is 15 m below"):
        closed(vertices, np.delete(facets, at_rim[:2], axis=0))


def test_many_benches_take_seconds():
    """Half a million triangles."""
    radii = np.linspace(700.0, 200.0, 250)
    vertices, facets, volume = stepped_pit(radii=radii, bench=1.6, sides=500)
    assert len(facets) > 400_000
    assert closed(vertices, facets).volume == pytest.approx(volume, rel=1e-9)


def test_hollows_of_the_ground_are_said():
    """A pond beside the pit counts as mined, and is named."""
    pit, facets, _ = stepped_pit()
    pond, more, _ = stepped_pit(radii=(8.0,), bench=2.0, center=(300.0, 0.0))
    found = closed_at(np.concatenate([pit, pond]), np.concatenate([facets, more + len(pit)]), GROUND)
    assert "1 hollows of its ground lie below frame.surface" in " ".join(found.notes)


def test_benches_of_a_pit_are_not_narrow():
    """With the ground as the top of the rock a wide pit of one bench is wide; as a slot below ground it is thin."""
    solid = closed(*stepped_pit(radii=(100.0,))[:2])
    assert cells_across(solid, 10.0).is_narrow()
    assert not cells_across(solid, 10.0, GROUND).is_narrow()


def test_warnings_reach_the_log(tmp_path, caplog):
    surface = with_ground(*stepped_pit()[:2], rise=8.0)
    with caplog.at_level(logging.WARNING):
        read(write_obj(tmp_path / "pit.obj", *surface))
    assert "rises up to 8 m above frame.surface, 500 m" in caplog.text
