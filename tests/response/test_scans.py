"""Scanned voids: overbreak of known offsets by wall, whatever way the stope lies; repairs; walls that are not seen."""

import numpy as np
import pytest
import trimesh
from small_mines import load, rock_of, states_of, with_failed, with_fallen

from common.scan_table import FIELDS, POINT_FIELDS, read_scans
from mpm_core.geometry.inside import contains
from mpm_core.geometry.solids import Solid
from response import scan_rays
from response.scan_rays import reach_of_void
from response.scan_settings import ScanSlice
from response.scans import compare_scans

LOWER, UPPER = np.array([-6.0, -5.0, -4.0]), np.array([6.0, 5.0, 4.0])
BOX = {"name": "stope", "shape": "box", "lower": ["-6 m", "-5 m", "-4 m"], "upper": ["6 m", "5 m", "4 m"]}
SPHERE = {"name": "stope", "shape": "sphere", "center": ["0 m", "0 m", "0 m"], "radius": "6 m"}
BESIDE = {"name": "beside", "shape": "box", "lower": ["8 m", "-5 m", "-4 m"], "upper": ["10 m", "5 m", "4 m"]}
SIDES = ["roof", "floor", "wall 000", "wall 090", "wall 180", "wall 270"]
FINE = 1.0 / 32.0  # m: the points of the lattice of volumes lie so far apart.


@pytest.fixture(scope="module")
def stope(tmp_path_factory):
    """A box in elastic rock."""
    folder = tmp_path_factory.mktemp("stope")
    mine = load(folder, [BOX])
    return mine, *states_of(mine, folder)


def prism(angle: float, lower=LOWER, upper=UPPER) -> trimesh.Trimesh:
    """A box, turned about the vertical by an angle, degrees clockwise."""
    mesh = trimesh.creation.box(bounds=[lower, upper])
    return mesh.apply_transform(trimesh.transformations.rotation_matrix(-np.radians(angle), [0, 0, 1]))


def compared(made, mesh: trimesh.Trimesh, folder, **keys):
    """Rows by side, and the table, of a mesh that is scanned after the first step."""
    mine, grid, state = made
    mesh.export(folder / "scan.ply")
    openings = mine.openings_slice()
    scan = {"name": "CMS", "excavations": ["stope"], "file": (folder / "scan.ply").as_posix(), "error": 0.05}
    settings = {"scans": [scan | {"step": "history"} | keys]} | {key: openings[key] for key in ("steps", "excavations")}
    table = compare_scans(ScanSlice.of(settings), grid, [state])
    assert set(table) == {field.name for field in (*FIELDS, *POINT_FIELDS)}
    frame = table.drop_dims("point").to_dataframe().set_index("side")
    return frame, table


@pytest.mark.parametrize("offset", [0.3, 1.7, -0.6])
def test_one_wall_moved_by_an_offset(stope, tmp_path, offset):
    """Overbreak, ELOS and volume are those of the offset on that wall, and nothing on the others."""
    rows, _ = compared(stope, prism(0.0, upper=np.add(UPPER, [offset, 0.0, 0.0])), tmp_path)
    assert list(rows.index) == ["all", *SIDES]
    over = np.where(rows.index == "wall 090", max(offset, 0.0), 0.0)[1:]
    under = np.where(rows.index == "wall 090", max(-offset, 0.0), 0.0)[1:]
    for column, expected in (("overbreak_mean", over), ("overbreak_largest", over), ("underbreak_mean", under)):
        np.testing.assert_allclose(rows[column].iloc[1:], expected, atol=2e-3)
    np.testing.assert_allclose(rows["elos"].iloc[1:], over, atol=FINE)
    np.testing.assert_allclose(rows["overbreak_volume"].iloc[1:], 80.0 * over, atol=80.0 * FINE)
    corners = 18.0 * under.max() ** 2  # nearer to roof, floor and walls that the scan does not reach there
    assert rows["underbreak_volume"]["wall 090"] == pytest.approx(80.0 * under.max() - corners, abs=80.0 * FINE)
    np.testing.assert_allclose(rows["misfit"].iloc[1:], over, atol=2e-3)
    if offset > 0.0:
        np.testing.assert_allclose(rows["seen_area"], rows["wall_area"])
    assert rows["wall_area"]["all"] == pytest.approx(592.0)
    half = 1.96 * 0.05  # flat walls: the place of the scan alone
    np.testing.assert_allclose(rows["misfit_high"].iloc[1:] - rows["misfit"].iloc[1:], half, rtol=1e-3)


@pytest.mark.parametrize("angle", [30.0, 45.0])
def test_all_walls_of_a_turned_stope(tmp_path, angle):
    """A turned stope, each wall moved by an offset of its own: walls are named by their bearings."""
    corners = [(-6, -5), (6, -5), (6, 5), (-6, 5)]
    turned = prism(angle)
    plan = (
        np.array([[x, y, 0.0] for x, y in corners])
        @ trimesh.transformations.rotation_matrix(-np.radians(angle), [0, 0, 1])[:3, :3].T
    )
    entry = {"name": "stope", "shape": "prism", "lower": "-4 m", "upper": "4 m"}
    mine = load(tmp_path, [entry | {"polygon": [[f"{x} m", f"{y} m"] for x, y, _ in plan]}])
    grid, state = states_of(mine, tmp_path)
    assert turned.volume == pytest.approx(960.0)
    mesh = prism(angle, LOWER - [0.4, 0.5, 0.6], np.add(UPPER, [0.1, 0.2, 0.3]))
    rows, _ = compared((mine, grid, state), mesh, tmp_path)
    offsets = zip((0.0, 90.0, 180.0, 270.0), (0.2, 0.1, 0.5, 0.4), strict=True)
    expected = {f"wall {angle + bearing:03.0f}": offset for bearing, offset in offsets} | {"roof": 0.3, "floor": 0.6}
    assert set(rows.index) == {"all", *expected}
    for side, offset in expected.items():
        assert rows["overbreak_mean"][side] == pytest.approx(offset, abs=2e-3)
        assert rows["overbreak_p90"][side] == pytest.approx(offset, abs=2e-3)
    total = mesh.volume - 960.0
    assert rows["overbreak_volume"]["all"] == pytest.approx(total, rel=0.02)
    assert rows["overbreak_volume"].iloc[1:].sum() == pytest.approx(rows["overbreak_volume"]["all"])


def test_a_sphere_that_has_grown(tmp_path):
    """Overbreak is the difference of radii; ELOS that of volumes over the area, which is more."""
    mine = load(tmp_path, [SPHERE])
    grid, state = states_of(mine, tmp_path)
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=7.0)
    rows, _ = compared((mine, grid, state), mesh, tmp_path)
    assert rows["overbreak_mean"]["all"] == pytest.approx(1.0, abs=0.04)  # the design is a polyhedron
    area = rows["wall_area"]["all"]
    assert area == pytest.approx(4.0 * np.pi * 36.0, rel=0.02)
    assert rows["elos"]["all"] == pytest.approx((mesh.volume - mine_volume(grid)) / area, rel=0.01)
    assert set(rows.index) == {"all", *SIDES}
    np.testing.assert_allclose(rows["overbreak_mean"].iloc[1:], 1.0, atol=0.05)


def mine_volume(grid) -> float:
    """Volume of the solids of a grid."""
    return trimesh.Trimesh(grid["solid_position"].values, grid["solid_facets"].values).volume


def changed(mesh: trimesh.Trimesh, how: str) -> trimesh.Trimesh:
    """The same surface in another form."""
    rng = np.random.default_rng(3)
    if how == "inverted":
        mesh.invert()
    if how == "some flipped":
        fine = mesh.subdivide().subdivide().subdivide()
        faces = fine.faces.copy()
        some = rng.random(len(faces)) < 0.2
        faces[some] = faces[some][:, ::-1]
        return trimesh.Trimesh(fine.vertices, faces, process=False)
    if how == "other triangles":
        return mesh.subdivide_to_size(0.7)
    if how == "other order":
        fine = mesh.subdivide().subdivide()
        return trimesh.Trimesh(fine.vertices, fine.faces[rng.permutation(len(fine.faces))], process=False)
    if how == "foreign pieces":
        far = trimesh.creation.box(bounds=[[9, 9, 9], [12, 12, 12]])
        dust = trimesh.creation.icosphere(subdivisions=1, radius=0.3)
        return trimesh.util.concatenate([mesh, far, dust])
    return mesh


@pytest.mark.parametrize("how", ["inverted", "some flipped", "other triangles", "other order", "foreign pieces"])
def test_the_same_surface_in_another_form_gives_the_same_table(stope, tmp_path, how):
    mesh = prism(0.0, upper=np.add(UPPER, [0.75, 0.0, 0.0]))
    expected, _ = compared(stope, mesh.copy(), tmp_path)
    found, _ = compared(stope, changed(mesh, how), tmp_path)
    numbers = [name for name in found if name not in ("scan", "step")]
    np.testing.assert_allclose(found[numbers].to_numpy(float), expected[numbers].to_numpy(float), atol=2e-3)


def test_a_scan_in_feet_beside_the_origin(stope, tmp_path):
    """Units, scale and offset are those of the solids' readers."""
    mesh = prism(0.0, upper=np.add(UPPER, [0.5, 0.0, 0.0]))
    mesh.apply_translation([100.0, -40.0, 10.0])
    mesh.apply_scale(1.0 / 0.3048)
    rows, _ = compared(stope, mesh, tmp_path, units="ft", offset=[-100.0, 40.0, -10.0])
    assert rows["overbreak_mean"]["wall 090"] == pytest.approx(0.5, abs=2e-3)
    assert rows["overbreak_mean"]["wall 270"] == pytest.approx(0.0, abs=2e-3)


def test_walls_behind_a_hole_have_no_value(stope, tmp_path):
    """The scan ends with an open draw point in one half of a wall: that half is unseen, and not zero."""
    mesh = prism(0.0, upper=np.add(UPPER, [0.4, 0.0, 0.0])).subdivide_to_size(0.6)
    middle = mesh.triangles_center
    mesh.update_faces(~((middle[:, 0] > 6.3) & (middle[:, 1] < -1.0) & (middle[:, 2] < 0.0)))
    rows, table = compared(stope, mesh, tmp_path)
    assert 0.7 * 80.0 < rows["seen_area"]["wall 090"] < 0.9 * 80.0
    assert rows["overbreak_mean"]["wall 090"] == pytest.approx(0.4, abs=2e-3)
    assert rows["elos"]["wall 090"] == pytest.approx(0.4, abs=0.05)  # the hole is closed a little inside
    hidden = np.isnan(table["scanned"].values)
    place = table["place"].values[hidden]
    assert hidden.any()
    assert (np.isclose(place[:, 0], 6.0) & (place[:, 1] < -0.5) & (place[:, 2] < 0.5)).all()


def test_walls_beyond_the_end_of_a_scan_have_no_value(stope, tmp_path):
    """A scan of the western half, closed by a plane: the eastern half of roof and walls is not underbreak."""
    rows, table = compared(stope, prism(0.0, upper=[0.0, 5.0, 4.0]), tmp_path)
    east = table["place"].values[:, 0] > 0.1
    along = np.abs(table["place"].values[:, 0]) < 5.9
    west = table["place"].values[:, 0] < -0.1
    assert np.isnan(table["scanned"].values[east & along]).all()
    np.testing.assert_allclose(table["scanned"].values[west], 0.0, atol=2e-3)
    assert rows["seen_area"]["roof"] == pytest.approx(60.0, rel=0.1)


def test_a_missing_surface_is_not_that_of_the_opposite_wall(stope, tmp_path):
    """A void smaller than the design, with a hole in its western wall: behind the hole there is no value."""
    mesh = prism(0.0, LOWER + 1.0, UPPER - 1.0).subdivide_to_size(0.6)
    middle = mesh.triangles_center
    mesh.update_faces(~((middle[:, 0] < -4.9) & (np.abs(middle[:, 1]) < 2.0) & (np.abs(middle[:, 2]) < 2.0)))
    _, table = compared(stope, mesh, tmp_path)
    place, scanned = table["place"].values, table["scanned"].values
    west = np.isclose(place[:, 0], -6.0)
    hole = west & (np.abs(place[:, 1]) < 1.4) & (np.abs(place[:, 2]) < 1.4)
    assert hole.any()
    assert np.isnan(scanned[hole]).all()
    around = (
        west
        & ((np.abs(place[:, 1]) > 2.6) | (np.abs(place[:, 2]) > 2.6))
        & (np.abs(place[:, 1:]) < [3.9, 2.9]).all(axis=1)
    )
    np.testing.assert_allclose(scanned[around], -1.0, atol=2e-3)


def test_void_beyond_the_opposite_wall_is_no_underbreak(stope, tmp_path):
    """The west of the stope was not scanned, but a void south of it was: the northern wall there has no value."""
    east, south = prism(0.0, [0.0, -9.0, -4.0], UPPER), prism(0.0, [-6.0, -9.0, -4.0], [6.0, -5.5, 4.0])
    _, table = compared(stope, trimesh.util.concatenate([east, south]), tmp_path)
    place, scanned = table["place"].values, table["scanned"].values
    north = np.isclose(place[:, 1], 5.0)
    assert np.isnan(scanned[north & (place[:, 0] < -0.1)]).all()
    np.testing.assert_allclose(scanned[north & (place[:, 0] > 0.1)], 0.0, atol=2e-3)


def test_a_shadow_is_told_by_the_station(stope, tmp_path):
    """The scanner sees the roof past a ledge at x = 2 m: behind it the surface runs along the line of sight."""
    station, edge = np.array([-2.0, -3.0]), np.array([2.0, 2.0])  # x and z
    behind = edge + (edge - station) * (4.0 - edge[1]) / (edge[1] - station[1])
    outline = [(-6.0, -4.0), (6.0, -4.0), (6.0, 2.0), tuple(edge), tuple(behind), (-6.0, 4.0)]
    x, z = np.array(outline).T
    front, back = (np.column_stack([x, np.full(6, y), z]) for y in (-5.0, 5.0))
    cap = np.array([(0, 1, 3), (1, 2, 3), (0, 3, 4), (0, 4, 5)])
    sides = [(i, (i + 1) % 6, 6 + (i + 1) % 6) for i in range(6)] + [(i, 6 + (i + 1) % 6, 6 + i) for i in range(6)]
    mesh = trimesh.Trimesh(np.concatenate([front, back]), [*cap, *(cap[:, ::-1] + 6), *np.array(sides)[:, ::-1]])
    assert mesh.is_watertight
    blind, _ = compared(stope, mesh, tmp_path)
    rows, table = compared(stope, mesh, tmp_path, stations=[[station[0], 0.0, station[1]]])
    place, scanned = table["place"].values, table["scanned"].values
    roof, east = np.isclose(place[:, 2], 4.0), np.isclose(place[:, 0], 6.0)
    in_shadow = east & (place[:, 2] > 2.05) & (place[:, 2] < 3.95)
    assert in_shadow.any()
    assert np.isnan(scanned[in_shadow]).all()
    np.testing.assert_allclose(scanned[roof & (place[:, 0] > behind[0] + 0.05)], -2.0, atol=2e-3)  # the ledge
    assert blind["seen_area"]["wall 090"] == pytest.approx(80.0)
    assert rows["seen_area"]["wall 090"] == pytest.approx(60.0, rel=0.03)
    assert blind["underbreak_mean"]["wall 090"] > 0.5
    assert rows["underbreak_mean"]["wall 090"] == pytest.approx(0.0, abs=0.05)
    assert rows["seen_area"]["floor"] == pytest.approx(120.0)


def test_overbreak_ends_where_another_opening_begins(tmp_path):
    """A void that reaches through a pillar of two metres into the opening beside it."""
    mine = load(tmp_path, [BOX, BESIDE])
    grid, state = states_of(mine, tmp_path)
    rows, _ = compared((mine, grid, state), prism(0.0, upper=[9.0, 5.0, 4.0]), tmp_path)
    assert rows["overbreak_mean"]["wall 090"] == pytest.approx(2.0, abs=0.26)
    assert rows["through_share"]["wall 090"] > 0.9
    assert rows["overbreak_volume"]["wall 090"] == pytest.approx(160.0, rel=0.02)
    assert rows["through_share"]["wall 270"] == 0.0


def test_modelled_depth_and_fallen_rock_stand_beside(stope, tmp_path):
    """Rock has failed two cells deep behind the eastern wall, and fallen one cell deep."""
    mine, grid, state = stope
    position = state["position"].values
    rock = (state["volume"].values > 0.0) & (state["excavation"].values < 0)
    east = rock & (np.abs(position[:, 1]) < 5.0) & (np.abs(position[:, 2]) < 4.0)
    failed = with_failed(state, east & (position[:, 0] > 6.0) & (position[:, 0] < 8.0))
    gone = east & (position[:, 0] > 6.0) & (position[:, 0] < 7.0)
    rock_before = rock_of(grid, state)
    within = rock_before.cells(rock_before.in_cells(np.array([[0.5, 0.5, 0.5]])))  # fell before it was mined
    fallen = with_fallen(failed, gone, within)
    rows, _ = compared((mine, grid, fallen), prism(0.0, upper=np.add(UPPER, [1.5, 0.0, 0.0])), tmp_path)
    wall = rows.loc["wall 090"]
    assert wall["depth_mean"] == pytest.approx(2.0)
    assert wall["fallen_mean"] == pytest.approx(1.0)
    assert wall["failed_volume"] == pytest.approx(160.0)
    assert wall["fallen_volume"] == pytest.approx(80.0)
    assert wall["misfit"] == pytest.approx(-0.5, abs=2e-3)
    assert wall["misfit_fallen"] == pytest.approx(0.5, abs=2e-3)
    others = rows.loc[[side for side in SIDES if side != "wall 090"]]
    assert (others[["depth_mean", "fallen_mean", "failed_volume", "fallen_volume"]] == 0.0).all(axis=None)
    assert rock_of(grid, fallen).fallen_volume[1].sum() == pytest.approx(80.0)


def test_the_table_is_read_again(stope, tmp_path):
    _, table = compared(stope, prism(0.0), tmp_path)
    table.to_netcdf(tmp_path / "scans.nc")
    assert read_scans(tmp_path / "scans.nc").identical(table)


def test_rays_agree_with_winding_numbers():
    """A crumpled sphere: just before the distance found the point is in the void, just behind it is not."""
    rng = np.random.default_rng(5)
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=5.0)
    mesh.vertices *= 1.0 + 0.15 * np.sin(3.0 * mesh.vertices[:, :1]) * np.cos(2.0 * mesh.vertices[:, 1:2])
    solid = Solid("void", mesh.vertices, mesh.faces)
    normal = rng.normal(size=(300, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    place = rng.uniform(3.0, 6.0, (300, 1)) * normal
    reach = reach_of_void(solid, place, normal)
    assert np.isfinite(reach).all()
    assert contains(solid, place + (reach - 1e-2)[:, None] * normal).all()
    assert not contains(solid, place + (reach + 1e-2)[:, None] * normal).any()
    inside = contains(solid, place)
    assert (inside == (reach > 0.0)).all()
    assert inside.any()
    assert not inside.all()


def test_lines_in_parts_meet_what_they_meet_at_once(monkeypatch):
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=5.0)
    solid = Solid("void", mesh.vertices, mesh.faces)
    normal = np.random.default_rng(6).normal(size=(50, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    expected = reach_of_void(solid, 4.0 * normal, normal)
    monkeypatch.setattr(scan_rays, "LINES_AT_ONCE", 7)
    np.testing.assert_array_equal(reach_of_void(solid, 4.0 * normal, normal), expected)
    assert np.isfinite(expected).all()
