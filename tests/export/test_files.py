"""Files for other programs: opened again by other code than wrote them, to a tenth of a millimetre at 7,000 km."""

import json

import ezdxf
import meshio
import numpy as np
import omf
import pandas as pd
import pytest
from mechanics.scenes import ball, excavation, grid_around, make_dataset, make_scene

from catalogs.records import read_record
from catalogs.sources.source_parameters import parameters
from common.event_table import SOURCE_RADIUS, new_catalog, write_events
from common.mine_grid import GridMap
from common.voigt import tensor_from_voigt
from export.drawing import write_faces, write_points
from export.omf_project import Points, Triangles, write_project
from export.own_coordinates import OwnCoordinates
from export.stage import FAILED_ROCK, export_catalogues, export_step, layers_of, write_contents
from export.tables import equivalent_shear
from mpm_core.geometry.dxf import read_faces
from mpm_core.geometry.omf_files import read_omf

FAR = np.array([7_123_456.7891234, -543_210.98765432, 12.3456789])
FRAMES = {
    "map": {"surface": 0.0},
    "turned": {"surface": 0.0, "grid": {"angle": 33.0, "origin": {"grid": [7e6, 1e5, 0.0], "map": [10.0, 20.0, 5.0]}}},
    "mirrored": {"surface": 0.0, "grid": {"axes": ["north", "east"]}},
    "downward": {"surface": 0.0, "grid": {"axes": ["east", "south", "down"], "units": "ft"}},
    "scaled": {"surface": 0.0, "grid": {"axes": ["west", "south"], "scale": 0.9996, "units": "us_ft"}},
}


def faces_by_groups(path) -> list[tuple[str, np.ndarray]]:
    """Layer and corners of each 3DFACE or POINT, read line by line as the format is published: no library."""
    lines = path.read_text("cp1252").split("\n")
    groups = list(zip(map(int, lines[0:-1:2]), lines[1::2], strict=False))
    found: list[dict] = []
    kept = False
    for code, value in groups:
        if code == 0:
            kept = value in ("3DFACE", "POINT")
            if kept:
                found.append({})
        elif kept:
            found[-1][code] = value
    corners = [
        (one[8], np.array([[float(one[axis + k]) for axis in (10, 20, 30)] for k in range(4) if 10 + k in one]))
        for one in found
    ]
    return corners


def tetrahedron() -> tuple[np.ndarray, np.ndarray]:
    return FAR + np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array(
        [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    )


@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("ft", 0.3048), ("us_ft", 1200 / 3937)])
def test_a_drawing_of_faces_is_read_again(tmp_path, unit, metres):
    vertices, triangles = tetrahedron()
    path = tmp_path / "rock.dxf"
    write_faces(vertices, {"failed_rock_2019-08": triangles, "other": triangles[:1]}, unit, path)
    found = faces_by_groups(path)
    assert [layer for layer, _ in found] == ["failed_rock_2019-08"] * 4 + ["other"]
    for (_, corners), triangle in zip(found[:4], triangles, strict=True):
        np.testing.assert_allclose(corners[:3], vertices[triangle], rtol=0, atol=1e-6)
        np.testing.assert_array_equal(corners[3], corners[2])
    by_layer, stated = read_faces(path, "failed_rock_2019-08")
    (mesh,) = by_layer["failed_rock_2019-08"]
    assert len(mesh[1]) == 4
    assert stated == pytest.approx(metres, rel=1e-12)
    assert not ezdxf.readfile(path).audit().errors


def test_a_drawing_of_points_is_read_again(tmp_path):
    points = FAR + np.random.default_rng(1).normal(0.0, 100.0, (50, 3))
    layers = [f"events_{number % 3}" for number in range(50)]
    write_points(points, layers, "m", tmp_path / "events.dxf")
    found = faces_by_groups(tmp_path / "events.dxf")
    np.testing.assert_allclose([corners[0] for _, corners in found], points, rtol=0, atol=1e-6)
    assert [layer for layer, _ in found] == layers
    write_points(np.empty((0, 3)), [], "m", tmp_path / "none.dxf")
    assert faces_by_groups(tmp_path / "none.dxf") == []
    assert len(ezdxf.readfile(tmp_path / "none.dxf").modelspace()) == 0


def test_an_omf_project_is_read_again(tmp_path):
    """By the format's own library, and by the reader of solids: bit by bit."""
    vertices, triangles = tetrahedron()
    data = {"mw": np.array([0.5, np.nan, -1.0, 2.0]), "step": ["a", "b", "", "ü"]}
    elements = [Triangles("rock", vertices, triangles), Points("events", vertices, data), Points("none", vertices[:0])]
    write_project("mine", elements, "ft", tmp_path / "mine.omf")
    project = omf.OMFReader(str(tmp_path / "mine.omf")).get_project()
    assert project.validate()
    assert (project.name, project.units) == ("mine", "ft")
    rock, events = project.elements
    np.testing.assert_array_equal(np.asarray(rock.geometry.vertices.array), vertices)
    np.testing.assert_array_equal(np.asarray(rock.geometry.triangles.array), triangles)
    np.testing.assert_array_equal(np.asarray(events.geometry.vertices.array), vertices)
    np.testing.assert_array_equal(events.data[0].array.array, data["mw"])
    assert list(events.data[1].array.array) == data["step"]
    (read, facets), unit = read_omf(tmp_path / "mine.omf", "rock")
    np.testing.assert_array_equal(read, vertices)
    np.testing.assert_array_equal(facets, triangles)
    assert unit == pytest.approx(0.3048)
    before = (tmp_path / "mine.omf").read_bytes()
    write_project("mine", elements, "ft", tmp_path / "mine.omf")
    assert (tmp_path / "mine.omf").read_bytes() == before


@pytest.mark.parametrize("frame", FRAMES)
def test_own_coordinates_and_back(frame):
    """Places come back to the map; a vector's and a tensor's components are those along the grid's axes."""
    own = OwnCoordinates.of(FRAMES[frame])
    generator = np.random.default_rng(2)
    places = generator.uniform(-1e4, 1e4, (20, 3))
    np.testing.assert_allclose(own.grid.to_map(own.points(places) * own.grid.metres_per_unit), places, atol=1e-6)
    vectors = generator.normal(size=(20, 3))
    ahead = (own.points(places + vectors) - own.points(places)) * own.grid.metres_per_unit
    scale = np.array([own.grid.scale, own.grid.scale, 1.0])
    np.testing.assert_allclose(own.vectors(vectors), ahead * scale, atol=1e-6)
    tensors, normal = generator.normal(size=(20, 6)), generator.normal(size=(20, 3))
    traction = np.einsum("nij,nj->ni", tensor_from_voigt(tensors), normal)
    np.testing.assert_allclose(
        np.einsum("nij,nj->ni", tensor_from_voigt(own.tensors(tensors)), own.vectors(normal)), own.vectors(traction)
    )


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    """A state with failed rock around a void, with its scene, in files."""
    from mpm_core.stages.equilibrium_stages import elastic_stage

    folder = tmp_path_factory.mktemp("state")
    shape = ball([12.0, 11.0, 13.0], 4.5)
    stress = {"constant": [-1e6, -2e6, -4e6, 3e5, 2e5, 1e5], "gradient": [0.0] * 6}
    scene = make_scene(None, stress=stress, excavations=[excavation()])
    first = make_dataset(scene, grid_around([shape], [3] * 3, 2, 8.0), [shape])
    found, _ = elastic_stage(scene, first, folder / "failed.npz")
    near = np.linalg.norm(found["position"].values - [12.0, 11.0, 13.0], axis=1)
    found["failed"].values[near < 8.0] = 0
    found.attrs |= {"scene": json.dumps({"excavations": [excavation()]})}
    first.to_netcdf(folder / "grid.nc")
    found.to_netcdf(folder / "2019-08.nc")
    return folder, found


@pytest.mark.parametrize("frame", FRAMES)
def test_files_of_a_step(state, tmp_path, frame):
    """Volumes, positions, stresses and cells are those of the state, in the mine's own coordinates."""
    folder, dataset = state
    own = OwnCoordinates.of(FRAMES[frame])
    settings = {"mine": "test", "frame": FRAMES[frame], "steps": ["2019-08"]}
    export_step(settings, folder / "grid.nc", folder / "2019-08.nc", tmp_path)
    rows = (dataset["failed"].values >= 0) & (dataset["volume"].values > 0)
    volume = dataset["volume"].values[rows].sum()
    per_volume = own.grid.metres_per_unit**3 * own.grid.scale**2

    project = omf.OMFReader(str(tmp_path / f"{FAILED_ROCK}.omf")).get_project()
    (surface,) = project.elements
    corners = np.asarray(surface.geometry.vertices.array)[np.asarray(surface.geometry.triangles.array)]
    faces = np.array([corners[:3] for _, corners in faces_by_groups(tmp_path / f"{FAILED_ROCK}.dxf")])
    np.testing.assert_allclose(faces, corners, rtol=0, atol=1e-6)
    corners = corners - corners[0, 0]
    enclosed = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    assert enclosed * per_volume == pytest.approx(volume, rel=2e-3)

    table = pd.read_csv(tmp_path / f"{FAILED_ROCK}.csv")
    assert table["volume [m3]"].sum() == pytest.approx(volume, rel=1e-9)
    places = table[[f"{axis} [{own.unit}]" for axis in "xyz"]].to_numpy()
    np.testing.assert_allclose(places, own.points(dataset["position"].values[rows]), rtol=0, atol=6e-5)
    assert set(table["failed in step"]) == {"2019-08"}
    stress = table[[f"stress {name} (tension positive) [MPa]" for name in ("xx", "yy", "zz", "yz", "xz", "xy")]]
    sizes = np.linalg.eigvalsh(tensor_from_voigt(dataset["stress"].values[rows])) / 1e6
    np.testing.assert_allclose(np.linalg.eigvalsh(tensor_from_voigt(stress.to_numpy())), sizes, rtol=1e-6, atol=1e-9)
    named = ["most compressive", "intermediate", "least compressive"]
    np.testing.assert_allclose(table[[f"{name} stress (tension positive) [MPa]" for name in named]], sizes, rtol=1e-6)

    mesh = meshio.read(tmp_path / "cells.vtu")
    np.testing.assert_allclose(mesh.points, own.points(dataset["node_position"].values), rtol=0, atol=1e-6)
    (block,) = mesh.cells
    corner = mesh.points[block.data]
    edges = corner[:, [1, 3, 4]] - corner[:, [0]]
    size = own.grid.metres_per_unit**3 * own.grid.scale**2 * np.linalg.det(edges)
    np.testing.assert_allclose(size, dataset["cell_size"].values ** 3, rtol=1e-6)
    number = np.flatnonzero(mesh.cell_data["solid_fraction"][0] > 0.99)[0]
    paraview = mesh.cell_data["stress_Pa"][0][number][[0, 1, 2, 4, 5, 3]]
    (here,) = np.flatnonzero(dataset["cell"].values == number)
    np.testing.assert_allclose(paraview, own.tensors(dataset["stress"].values[here]), rtol=1e-9, atol=1e-3)

    write_contents(settings, {"2019-08": tmp_path}, tmp_path / "contents.csv")
    contents = pd.read_csv(tmp_path / "contents.csv")
    assert contents["failed rock volume [m3]"][0] == pytest.approx(volume, rel=1e-9)
    assert contents["within its surface volume [m3]"][0] == pytest.approx(volume, rel=2e-3)


def test_a_step_without_failed_rock(state, tmp_path):
    """All files are there, and hold nothing."""
    folder, dataset = state
    quiet = dataset.copy(deep=True)
    quiet["failed"].values[:] = -1
    quiet.to_netcdf(tmp_path / "quiet.nc")
    settings = {"mine": "test", "frame": {"surface": 0.0}, "steps": ["2019-08"]}
    export_step(settings, folder / "grid.nc", tmp_path / "quiet.nc", tmp_path)
    assert faces_by_groups(tmp_path / f"{FAILED_ROCK}.dxf") == []
    assert omf.OMFReader(str(tmp_path / f"{FAILED_ROCK}.omf")).get_project().elements == []
    assert len(pd.read_csv(tmp_path / f"{FAILED_ROCK}.csv")) == 0
    write_contents(settings, {"2019-08": tmp_path}, tmp_path / "contents.csv")
    assert pd.read_csv(tmp_path / "contents.csv")["triangles [1]"][0] == 0


def events(count: int, kind: str = "synthetic", **values):
    generator = np.random.default_rng(3)
    tensor = generator.normal(size=(count, 3, 3))
    tensor = 0.5 * (tensor + tensor.transpose(0, 2, 1))
    known = {
        "location": generator.uniform(0.0, 1e3, (count, 3)),
        "time": np.datetime64("2019-08-01T01:02:03", "ns") + np.arange(count) * np.timedelta64(3600, "s"),
        "potency": 10.0 ** generator.uniform(-3, 1, count),
        "potency_tensor": tensor,
        "mw": generator.uniform(-2, 2, count),
        "step": np.array(["2019-08"] * count),
        "resolved": np.arange(count) % 3 > 0,
    }
    return new_catalog(count, {"mine": "test", "kind": kind}, **known | values)


@pytest.mark.parametrize("frame", FRAMES)
def test_files_of_events(tmp_path, frame):
    """Places to a tenth of a millimetre in all three files, also as the project's own reader of records reads them."""
    catalog = events(40)
    write_events(catalog, tmp_path / "catalog.nc")
    settings = {"mine": "test", "frame": FRAMES[frame]}
    export_catalogues(settings, {"events": tmp_path / "catalog.nc"}, tmp_path)
    own = OwnCoordinates.of(FRAMES[frame])
    points = own.points(catalog["location"].values)
    np.testing.assert_allclose(
        [corners[0] for _, corners in faces_by_groups(tmp_path / "events.dxf")], points, rtol=0, atol=1e-6
    )
    (element,) = omf.OMFReader(str(tmp_path / "events.omf")).get_project().elements
    np.testing.assert_array_equal(np.asarray(element.geometry.vertices.array), points)
    table = pd.read_csv(tmp_path / "events.csv")
    np.testing.assert_allclose(table[[f"{axis} [{own.unit}]" for axis in "xyz"]], points, rtol=0, atol=6e-5)
    np.testing.assert_allclose(table["log10 potency [m3]"], np.log10(catalog["potency"].values), rtol=1e-8)
    tensor = tensor_from_voigt(table[[f"potency {name} [m3]" for name in ("xx", "yy", "zz", "yz", "xz", "xy")]])
    np.testing.assert_allclose(np.linalg.eigvalsh(tensor), np.linalg.eigvalsh(catalog["potency_tensor"].values),
                               rtol=1e-6, atol=1e-9)  # fmt: skip
    columns = {axis: f"{axis} [{own.unit}]" for axis in "xyz"}
    columns |= {"time": "date and time [UTC]", "log_potency": "log10 potency [m3]"}
    read = read_record(
        {
            "mine": "test", "frame": FRAMES[frame], "lame_lambda": 3e10, "shear_modulus": 3e10, "reader": "csv",
            "file": str(tmp_path / "events.csv"), "columns": columns, "location_error": 1.0, "period": {},
            "domain": {"lower": [-1e6] * 3, "upper": [1e6] * 3, "plane": None},
        }
    )  # fmt: skip
    np.testing.assert_allclose(read["location"].values, catalog["location"].values, rtol=0, atol=2e-4)
    np.testing.assert_array_equal(read["time"].values, catalog["time"].values)


def test_source_parameters_are_columns_of_the_table(tmp_path):
    """Of modelled events those of the model, of recorded ones those that the record states."""
    catalog = events(12)
    catalog.attrs |= {"lame_lambda": 3e10, "shear_modulus": 3e10}
    catalog["source_size"].values[:] = 10.0
    write_events(catalog, tmp_path / "catalog.nc")
    found = parameters(catalog, 1e6 * catalog["potency"].values, 3, None)
    found.to_netcdf(tmp_path / "parameters.nc")
    record = events(5, "recorded")
    record["source_radius"] = ("event", np.arange(5.0), SOURCE_RADIUS.attributes)
    write_events(record, tmp_path / "record.nc")
    files = {"events": tmp_path / "catalog.nc", "recorded_events": tmp_path / "record.nc"}
    export_catalogues({"mine": "test", "frame": {"surface": 0.0}}, files, tmp_path, tmp_path / "parameters.nc")
    table = pd.read_csv(tmp_path / "events.csv")
    np.testing.assert_allclose(table["apparent stress [Pa]"], 1e6)
    np.testing.assert_allclose(table["source radius [m]"], found["source_radius"])
    recorded = pd.read_csv(tmp_path / "recorded_events.csv")
    np.testing.assert_allclose(recorded["source radius [m]"], np.arange(5.0))
    assert "drop energy [J]" not in recorded


def test_events_are_on_layers_of_their_steps():
    catalog = events(4, step=np.array(["a", "a", "b", "b"]))
    assert layers_of(catalog, "events") == ["unresolved_events_a", "events_a", "events_b", "unresolved_events_b"]
    assert layers_of(events(2, kind="recorded"), "recorded_events") == ["recorded_events"] * 2


@pytest.mark.parametrize("kind", ["synthetic", "recorded"])
def test_a_catalogue_without_events(tmp_path, kind):
    write_events(events(0, kind), tmp_path / "catalog.nc")
    export_catalogues({"mine": "test", "frame": {"surface": 0.0}}, {"events": tmp_path / "catalog.nc"}, tmp_path)
    assert faces_by_groups(tmp_path / "events.dxf") == []
    assert len(pd.read_csv(tmp_path / "events.csv")) == 0


def test_equivalent_shear_is_that_of_simple_shear():
    """Engineering shear g on one plane, tensor shear g / 2: sqrt(2 e_ij e_ij) = g; a change of volume has none."""
    np.testing.assert_allclose(equivalent_shear(np.array([[0, 0, 0, 0, 0.01, 0], [0.3, 0.3, 0.3, 0, 0, 0]])), [0.02, 0])


def test_the_map_is_left_as_it_is():
    points = np.array([FAR])
    assert OwnCoordinates(GridMap()).points(points) is not None
    np.testing.assert_array_equal(OwnCoordinates(GridMap()).points(points), points)
