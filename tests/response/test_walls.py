"""Walls: their area and sides against closed forms, whatever way a drive runs; centre lines and chainage."""

import numpy as np
import pytest
import scipy.spatial
import xarray as xr
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from small_mines import CELL, load

from common.opening_table import SIDES
from mpm_core.stages.grid_stage import make_grid
from response.centre_lines import MIN_SHARE, CentreLine, _cells_by_excavation, centre_lines
from response.walls import POINTS_PER_CELL, _spread, sample_walls

BOX = {"name": "stope", "shape": "box", "lower": ["-4 m", "-3 m", "-2 m"], "upper": ["4 m", "3 m", "2 m"]}


def area_by_side(walls) -> dict[str, float]:
    return {side: float(walls.area[walls.side == number].sum()) for number, side in enumerate(SIDES)}


def walls_of(mine):
    grid = make_grid(mine.grid_slice(), {})
    entries = mine.openings_slice()["excavations"]
    paths = [None if "path" not in entry else np.array(entry["path"]) for entry in entries]
    return grid, sample_walls(grid, centre_lines(grid, paths))


def test_a_box_has_the_area_of_its_sides(tmp_path):
    _, walls = walls_of(load(tmp_path, [BOX]))
    assert area_by_side(walls) == pytest.approx({"roof": 48.0, "walls": 112.0, "floor": 48.0, "face": 0.0})
    np.testing.assert_allclose(np.linalg.norm(walls.normal, axis=1), 1.0)
    out = np.einsum("pi,pi->p", walls.place, walls.normal)
    assert out.min() > 0.0  # its middle is the origin, and normals look into the rock
    assert np.isnan(walls.chainage).all()


@pytest.mark.parametrize("azimuth", [0.0, 0.4, 1.9])
@pytest.mark.parametrize("dip", [0.0, 0.5])
def test_a_drive_has_a_roof_walls_a_floor_and_faces_whatever_way_it_runs(tmp_path, azimuth, dip):
    """A square drive of 3 m, 20 m long; chainage runs from one face to the other."""
    along = np.array([np.cos(azimuth) * np.cos(dip), np.sin(azimuth) * np.cos(dip), np.sin(dip)])
    path = [[f"{value} m" for value in end] for end in (-10.0 * along, 10.0 * along)]
    drive = {"name": "drive", "shape": "tunnel", "path": path, "width": "3 m", "height": "3 m"}
    _, walls = walls_of(load(tmp_path, [drive]))
    expected = {"roof": 60.0, "walls": 120.0, "floor": 60.0, "face": 18.0}
    assert area_by_side(walls) == pytest.approx(expected, rel=1e-9)
    np.testing.assert_allclose(np.einsum("pi,i->p", walls.up, along), 0.0, atol=1e-12)
    np.testing.assert_allclose(walls.chainage, walls.place @ along + 10.0, atol=1e-9)


def test_a_shaft_has_walls_and_faces_only(tmp_path):
    shaft = {"name": "shaft", "shape": "cylinder", "radius": "2 m", "start": ["0 m", "0 m", "-12 m"]}
    _, walls = walls_of(load(tmp_path, [shaft | {"end": ["0 m", "0 m", "12 m"]}]))
    found = area_by_side(walls)
    assert found["roof"] == found["floor"] == 0.0
    assert found["walls"] == pytest.approx(2 * np.pi * 2 * 24, rel=0.02)
    assert found["face"] == pytest.approx(2 * np.pi * 4, rel=0.02)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-5.0, 5.0), min_size=9, max_size=9), st.floats(0.05, 3.0))
def test_points_of_a_triangle_stand_for_parts_of_it(corners, spacing):
    """Slivers, too: areas add up, points are in the triangle, and their mean is near its middle."""
    triangle = np.array(corners).reshape(1, 3, 3)
    normal = np.cross(triangle[0, 1] - triangle[0, 0], triangle[0, 2] - triangle[0, 0])
    area = 0.5 * np.linalg.norm(normal)
    assume(area > 1e-6)
    place, size, facet = _spread(triangle, np.array([area]), spacing)
    assert size.sum() == pytest.approx(area)
    assert size.min() >= 0.0
    assert size.max() <= 1.0001 * spacing**2
    assert (facet == 0).all()
    solved = np.linalg.lstsq((triangle[0, 1:] - triangle[0, 0]).T, (place - triangle[0, 0]).T, rcond=None)[0]
    assert solved.min() > -1e-6
    assert solved.sum(axis=0).max() < 1 + 1e-6
    off = np.linalg.norm(np.average(place, axis=0, weights=size) - triangle[0].mean(axis=0))
    assert off <= spacing
    edges = np.linalg.norm(np.roll(triangle[0], -1, axis=0) - triangle[0], axis=1)
    height = 2.0 * area / edges.max()
    assert len(place) <= (edges.max() / spacing + 1) * (height / spacing + 1)


def test_points_are_as_close_as_asked_for(tmp_path):
    _, walls = walls_of(load(tmp_path, [BOX]))
    spacing = CELL / POINTS_PER_CELL
    assert walls.area.max() <= 4.0 * spacing**2  # points of one cube are one
    assert len(walls) < 2.0 * walls.area.sum() / spacing**2  # however many facets the surface has


def test_a_drive_without_a_path_has_a_line_through_its_cells(tmp_path):
    """An L of two boxes' outline, as a solid of a file would be; a stope is none, nor is a ring."""
    arms = [[-12, -12], [12, -12], [12, 12], [9, 12], [9, -9], [-12, -9]]
    drive = {"name": "drive", "shape": "prism", "lower": "-1.5 m", "upper": "1.5 m"}
    bent = drive | {"polygon": [[f"{x} m", f"{y} m"] for x, y in arms]}
    grid, walls = walls_of(
        load(tmp_path, [bent, BOX | {"lower": ["-4 m", "3 m", "-2 m"], "upper": ["4 m", "8 m", "2 m"]}])
    )
    line, none = centre_lines(grid, [None, None])
    assert none is None
    assert line.length == pytest.approx(45.0, rel=0.1)  # along its middle, 22.5 m and 22.5 m
    west = walls.chainage[(walls.excavation == 0) & (walls.place[:, 0] < -11.9)]
    north = walls.chainage[(walls.excavation == 0) & (walls.place[:, 1] > 11.9)]
    assert west.max() < 2.0  # chainage begins at the end that comes first by x
    assert north.min() > 0.9 * line.length
    assert np.isnan(walls.chainage[walls.excavation == 1]).all()


@pytest.mark.parametrize(
    ("lower", "upper"),
    [((-14, -14, -1.5), (14, 14, 1.5)), ((-14, -1.5, -10), (14, 1.5, 10)), ((-14, -7, -2), (14, 7, 2))],
    ids=["panel", "vein", "room"],
)
def test_a_flat_body_is_no_drive(tmp_path, lower, upper):
    """A square panel, an upright vein and a room: their sides are those of a box."""
    corners = {"lower": [f"{one} m" for one in lower], "upper": [f"{one} m" for one in upper]}
    _, walls = walls_of(load(tmp_path, [BOX | corners]))
    assert np.isnan(walls.chainage).all()
    assert area_by_side(walls)["face"] == 0.0


def test_a_ring_is_no_drive_and_neither_are_drives_that_branch(tmp_path):
    """As solids of files: four boxes around a pillar, and a T."""
    ring = [
        [-13, -13],
        [13, -13],
        [13, 13],
        [-13, 13],
        [-13, 10],
        [10, 10],
        [10, -10],
        [-10, -10],
        [-10, 9.9],
        [-13, 9.9],
    ]
    tee = [[-13, -1.5], [-1.5, -1.5], [-1.5, -13], [1.5, -13], [1.5, -1.5], [13, -1.5], [13, 1.5], [-13, 1.5]]
    for outline in (ring, tee):
        polygon = [[f"{x} m", f"{y} m"] for x, y in outline]
        body = {"name": "body", "shape": "prism", "lower": "-1.5 m", "upper": "1.5 m", "polygon": polygon}
        _, walls = walls_of(load(tmp_path, [body]))
        assert np.isnan(walls.chainage).all()


def test_what_is_outside_of_the_domain_has_no_points(tmp_path):
    corners = {"lower": ["-4 m", "-3 m", "-2 m"], "upper": ["400 m", "3 m", "2 m"]}
    _, walls = walls_of(load(tmp_path, [BOX | corners]))
    assert walls.place.max() <= 16.0
    assert area_by_side(walls)["roof"] == pytest.approx(6.0 * 20.0, rel=0.02)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 5), st.integers(0, 30), st.integers(0, 10**6))
def test_cells_go_to_their_excavations_as_by_comparing_all(excavations, pieces, seed):
    """In any order, also where an excavation has none, or only small parts of cells."""
    rng = np.random.default_rng(seed)
    pieces = pieces if excavations else 0
    owner = rng.integers(0, max(excavations, 1), pieces).astype(np.int16)
    place, share = rng.integers(0, 9, (pieces, 3)), rng.random(pieces)
    grid = xr.Dataset(
        {"piece_excavation": ("piece", owner), "piece_fraction": ("piece", share)}
        | {"piece_origin": (("piece", "xyz"), -3.0 + 0.5 * place)},
        attrs={"fine_cell": 0.5, "domain_lower": [-3.0, -3.0, -3.0]},
    )
    found = _cells_by_excavation(grid, excavations)
    assert len(found) == excavations
    for number, cells in enumerate(found):
        np.testing.assert_array_equal(cells, place[(owner == number) & (share > MIN_SHARE)])


def test_a_long_line_is_projected_onto_as_by_trying_all(tmp_path):
    """Stretches of very different lengths, against the nearest of many points along the line."""
    generator = np.random.default_rng(5)
    step = generator.normal(size=(60, 3)) * generator.choice([0.5, 3.0, 40.0], size=(60, 1))
    line = CentreLine(np.cumsum(step, axis=0))
    place = line.at(generator.uniform(0.0, line.length, 300)) + generator.normal(size=(300, 3))
    along = np.linspace(0.0, line.length, 200_000)
    nearest = np.linalg.norm(line.at(line.project(place)[0]) - place, axis=1)
    expected = scipy.spatial.cKDTree(line.at(along)).query(place)[0]
    assert np.quantile(nearest - expected, 0.97) < 0.02


def test_a_line_gives_chainage_of_points_and_points_of_chainage():
    line = CentreLine(np.array([[0.0, 0, 0], [10, 0, 0], [10, 5, 0]]))
    chainage, along = line.project(np.array([[4.0, 3, 1], [12, 3, 0], [-5, 0, 0], [10, 9, 0]]))
    np.testing.assert_allclose(chainage, [4.0, 13.0, 0.0, 15.0])
    np.testing.assert_allclose(along[[0, 1]], [[1, 0, 0], [0, 1, 0]])
    np.testing.assert_allclose(line.at(np.array([4.0, 13.0])), [[4, 0, 0], [10, 3, 0]])
