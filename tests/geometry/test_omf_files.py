"""OMF projects, whole and damaged: what is written is what is read."""

import gzip
import io
import json
import logging
import struct
import zipfile
from collections.abc import Callable

import hypothesis.extra.numpy as arrays
import numpy as np
import omf
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from common.errors import InputError
from mpm_core.geometry import Solid, build_shape, read_solid
from mpm_core.geometry.omf_files import MAGIC_1, omf_names, read_omf
from mpm_core.geometry.solid_files import bodies_in
from tests.geometry.test_files import write_omf

BOX = build_shape({"name": "b", "shape": "box", "lower": [0, 0, 0], "upper": [8, 4, 2]}, 3)
FOLDER = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30, deadline=None)
COORDINATE = st.floats(-1e7, 1e7, allow_nan=False)
ORIGIN = st.tuples(COORDINATE, COORDINATE, COORDINATE)


def write_omf_2(
    path,
    bodies: dict,
    origin=(0.0, 0.0, 0.0),
    project_origin=(0.0, 0.0, 0.0),
    single=False,
    comment=b"Open Mining Format 2.0",
    change=None,
    **project,
):
    """An archive as the specification of OMF 2 has it.

    bodies: solids, or pairs of vertices and triangles, by name; a dict is a composite of them. single: whether vertices
    are float32. change: a function that changes the project and the files by name.
    """
    files: dict[str, bytes] = {}

    def array(values, names, kind) -> dict:
        schema = pa.schema([pa.field(name, kind, nullable=False) for name in names])
        buffer = io.BytesIO()
        pq.write_table(pa.table([pa.array(column, kind) for column in values.T], schema=schema), buffer)
        files[name := f"{len(files) + 1}.parquet"] = buffer.getvalue()
        return {"filename": name, "item_count": len(values)}

    def element(name, body) -> dict:
        if isinstance(body, dict):
            return {
                "name": name,
                "geometry": {"type": "Composite", "elements": [element(*one) for one in body.items()]},
            }
        points, facets = body if isinstance(body, tuple) else (body.vertices, body.facets)
        vertices = array(points, "xyz", pa.float32() if single else pa.float64())
        geometry = {"type": "Surface", "vertices": vertices, "triangles": array(facets, "abc", pa.uint32())}
        return {"name": name, "geometry": geometry | ({"origin": list(origin)} if any(origin) else {})}

    index = {"date": "2024-01-01T00:00:00Z", "elements": [element(*one) for one in bodies.items()], **project}
    index |= {"origin": list(project_origin)} if any(project_origin) else {}
    if change:
        change(index, files)
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
        archive.writestr("index.json.gz", gzip.compress(json.dumps(index).encode()))
        archive.comment = comment


@st.composite
def meshes(draw):
    """Vertices (v, 3) and triangles (f, 3) that need not bound a volume."""
    count = draw(st.integers(3, 20))
    vertices = draw(arrays.arrays(np.float64, (count, 3), elements=COORDINATE))
    facets = draw(arrays.arrays(np.int64, (draw(st.integers(1, 20)), 3), elements=st.integers(0, count - 1)))
    return vertices, facets


@FOLDER
@given(mesh=meshes(), origin=ORIGIN, project_origin=ORIGIN)
def test_omf_1_is_read_as_it_was_written(tmp_path, mesh, origin, project_origin):
    path = tmp_path / "mine.omf"
    project = omf.Project(name="mine", origin=project_origin)
    geometry = omf.SurfaceGeometry(vertices=mesh[0], triangles=mesh[1], origin=origin)
    project.elements = [omf.SurfaceElement(name="stope", geometry=geometry)]
    omf.OMFWriter(project, str(path))
    (vertices, facets), unit = read_omf(path)
    np.testing.assert_array_equal(vertices, mesh[0] + (np.array(origin) + np.array(project_origin)))
    np.testing.assert_array_equal(facets, mesh[1])
    assert unit is None


@FOLDER
@given(mesh=meshes(), origin=ORIGIN, project_origin=ORIGIN)
def test_omf_2_is_read_as_it_was_written(tmp_path, mesh, origin, project_origin):
    path = tmp_path / "mine.omf"
    write_omf_2(path, {"stope": mesh}, origin, project_origin)
    (vertices, facets), unit = read_omf(path)
    np.testing.assert_array_equal(vertices, mesh[0] + (np.array(origin) + np.array(project_origin)))
    np.testing.assert_array_equal(facets, mesh[1])
    assert unit is None


def test_surfaces_of_omf_2_are_picked_by_name_also_within_composites(tmp_path):
    path = tmp_path / "mine.omf"
    other = Solid("o", BOX.vertices * 2, BOX.facets)
    write_omf_2(
        path, {"A": BOX, "level 1": {"B": other, "level 2": {"C": BOX}}}, comment=b"Open Mining Format 2.0-beta.1"
    )
    assert [(body.name, body.keys) for body in bodies_in(path)] == [(name, {"element": name}) for name in "ABC"]
    assert read_solid(path, "stope", element="B").volume == pytest.approx(512)
    with pytest.raises(InputError, match=r"mine\.omf: stope: has 3 elements: name one by `element`"):
        read_solid(path, "stope")


def test_elements_of_omf_2_that_are_no_surfaces_are_named(tmp_path):
    path = tmp_path / "mine.omf"

    def to_points(index, files):
        index["elements"][0]["geometry"]["type"] = "PointSet"

    write_omf_2(path, {"collars": BOX}, change=to_points)
    with pytest.raises(InputError, match=r"mine\.omf: stope: collars: no triangulated surface"):
        read_solid(path, "stope")


def test_a_surface_may_have_the_name_of_what_is_none(tmp_path):
    """Contacts and the surface through them are often called alike; the surface was refused."""
    path = tmp_path / "mine.omf"

    def with_points(index, files):
        index["elements"].append({"name": "dyke", "geometry": {"type": "PointSet"}})

    write_omf_2(path, {"dyke": BOX}, change=with_points)
    assert read_solid(path, "s", element="dyke").volume == pytest.approx(64)


def test_a_file_of_omf_2_is_parsed_once(tmp_path, monkeypatch):
    path, parsed = tmp_path / "mine.omf", []
    write_omf_2(path, {f"S{number}": BOX for number in range(4)})
    real = zipfile.ZipFile
    monkeypatch.setattr(zipfile, "ZipFile", lambda *args: parsed.append(1) or real(*args))
    for body in bodies_in(path):
        read_solid(path, "s", **body.keys)
    assert len(parsed) == 1


@pytest.mark.parametrize(("origin", "told"), [((0.0, 0.0, 0.0), True), ((512345.0, 7523456.0, 0.0), False)])
def test_single_precision_of_omf_2_is_told_unless_its_origin_keeps_it_fine(tmp_path, caplog, origin, told):
    path = tmp_path / "mine.omf"
    shift = 0.0 if any(origin) else np.array([512345.0, 7523456.0, 0.0])
    write_omf_2(path, {"s": (BOX.vertices + shift, BOX.facets)}, origin, single=True, units="ft")
    with caplog.at_level(logging.WARNING):
        read_solid(path, "stope")
    assert ("in steps of 0.15 m" in caplog.text) == told


# ---- units ----


@pytest.mark.parametrize(
    ("text", "metres"), [("", 1.0), ("m", 1.0), ("metres", 1.0), ("Feet", 0.3048), ("ft", 0.3048), ("unknown", 1.0)]
)
def test_a_project_is_read_in_the_unit_that_it_states(tmp_path, text, metres):
    path = tmp_path / "mine.omf"
    write_omf(path, {"s": BOX}, units=text)
    assert read_solid(path, "stope").volume == pytest.approx(64 * metres**3)
    assert read_solid(path, "stope", units="cm").volume == pytest.approx(64e-6)


@pytest.mark.parametrize(
    ("keys", "metres"),
    [
        ({"units": "feet"}, 0.3048),
        ({"coordinate_reference_system": "EPSG:32755"}, 1.0),
        ({"coordinate_reference_system": "EPSG:2277"}, 1200 / 3937),
        ({"coordinate_reference_system": "EPSG:2277", "units": "metres"}, 1.0),
        ({"coordinate_reference_system": "EPSG:4326"}, None),
        ({"coordinate_reference_system": "mine grid"}, None),
    ],
)
def test_the_unit_of_omf_2_is_stated_or_that_of_its_reference_system(tmp_path, keys, metres):
    path = tmp_path / "mine.omf"
    write_omf_2(path, {"s": BOX}, **keys)
    if metres is None:
        with pytest.raises(InputError, match=r"mine\.omf: stope: .*say `units`"):
            read_solid(path, "stope")
    else:
        assert read_solid(path, "stope").volume == pytest.approx(64 * metres**3)


@pytest.mark.parametrize("text", ["mine grid", "seconds", "9**9**9", "ms"])
def test_a_unit_that_is_no_length_needs_another(tmp_path, text):
    path = tmp_path / "mine.omf"
    write_omf(path, {"s": BOX}, units=text)
    with pytest.raises(InputError, match=r"mine\.omf: stope: .*say `units`"):
        read_solid(path, "stope")
    assert read_solid(path, "stope", units="m").volume == pytest.approx(64)


# ---- damaged files ----


def change_1(path, change: Callable[[dict], None]) -> None:
    """Write an OMF 1 file again with a description that `change` has changed."""
    content = path.read_bytes()
    start = struct.unpack_from("<Q", content, 52)[0]
    objects = json.loads(content[start:])
    change(objects)
    path.write_bytes(content[:start] + json.dumps(objects).encode())


def of_class(objects: dict, name: str) -> dict:
    return next(one for one in objects.values() if one["__class__"] == name)


def assert_refused(path, match: str = "") -> None:
    """Both readers name the file and what is wrong in one line."""
    for read in (lambda: read_solid(path, "stope"), lambda: bodies_in(path)):
        with pytest.raises(InputError, match=rf"{path.name}: (stope: )?.*{match}") as caught:
            read()
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kept", [0, 3, 30, 59, 60, 80, -200, -1])
def test_omf_1_that_is_cut_off_is_one_line(tmp_path, kept):
    path = tmp_path / "mine.omf"
    write_omf(path, {"stope": BOX})
    path.write_bytes(path.read_bytes()[:kept])
    assert_refused(path)


def test_omf_1_of_another_version_or_with_another_start_of_its_description_is_one_line(tmp_path):
    path = tmp_path / "mine.omf"
    write_omf(path, {"stope": BOX})
    content = path.read_bytes()
    path.write_bytes(MAGIC_1 + b"OMF-v0.8.0".ljust(32, b"\0") + content[36:])
    assert_refused(path, r"is of version 'OMF-v0\.8\.0' of OMF, which is not read here")
    path.write_bytes(content[:52] + struct.pack("<Q", 2**63) + content[60:])
    assert_refused(path, "is cut off")


@pytest.mark.parametrize(
    "change",
    [
        lambda objects: objects.clear(),
        lambda objects: of_class(objects, "Project").update(elements=["gone"]),
        lambda objects: of_class(objects, "Project").update(origin=[0.0, 0.0]),
        lambda objects: of_class(objects, "SurfaceElement").pop("geometry"),
        lambda objects: of_class(objects, "Vector3Array")["array"].update(length=7),
        lambda objects: of_class(objects, "Vector3Array")["array"].update(start=10**12),
        lambda objects: of_class(objects, "Vector3Array")["array"].update(dtype="<U9"),
    ],
)
def test_omf_1_whose_description_is_wrong_is_one_line(tmp_path, change):
    path = tmp_path / "mine.omf"
    write_omf(path, {"stope": BOX})
    change_1(path, change)
    assert_refused(path)


def test_an_omf_1_project_without_elements_says_so(tmp_path):
    path = tmp_path / "mine.omf"
    omf.OMFWriter(omf.Project(name="mine"), str(path))
    with pytest.raises(InputError, match=r"mine\.omf: stope: holds no triangulated surface"):
        read_solid(path, "stope")
    assert omf_names(path) == []


@pytest.mark.parametrize("kept", [4, 100, 0.5, -60, -30, -1])
def test_omf_2_that_is_cut_off_is_one_line(tmp_path, kept):
    path = tmp_path / "mine.omf"
    write_omf_2(path, {"stope": BOX})
    content = path.read_bytes()
    path.write_bytes(content[: kept if isinstance(kept, int) else int(kept * len(content))])
    assert_refused(path)


@pytest.mark.parametrize(
    ("comment", "match"),
    [
        (b"", "is a zip archive, but no OMF project"),
        (b"Open Mining Format", "is a zip archive, but no OMF project"),
        (b"Open Mining Format 2.1", r"is of OMF 2\.1, which is not read here"),
        (b"Open Mining Format 3.0-alpha.1", r"is of OMF 3\.0, which is not read here"),
    ],
)
def test_another_archive_or_version_is_one_line(tmp_path, comment, match):
    path = tmp_path / "mine.omf"
    write_omf_2(path, {"stope": BOX}, comment=comment)
    assert_refused(path, match)


def geometry(index: dict) -> dict:
    return index["elements"][0]["geometry"]


@pytest.mark.parametrize(
    "change",
    [
        lambda index, files: files.pop("1.parquet"),
        lambda index, files: files.update({"1.parquet": b"PAR1"}),
        lambda index, files: files.update({"1.parquet": files["2.parquet"]}),
        lambda index, files: geometry(index)["vertices"].update(item_count=7),
        lambda index, files: geometry(index).pop("triangles"),
        lambda index, files: geometry(index).update(origin=[0.0]),
        lambda index, files: geometry(index).update(origin=["a", "b", "c"]),
        lambda index, files: index.update(elements=3),
        lambda index, files: index.update(units=3),
    ],
)
def test_omf_2_whose_content_is_wrong_is_one_line(tmp_path, change):
    path = tmp_path / "mine.omf"
    write_omf_2(path, {"stope": BOX}, change=change)
    assert_refused(path)


def test_a_triangle_of_a_vertex_that_omf_2_lacks_is_one_line(tmp_path):
    path = tmp_path / "mine.omf"
    write_omf_2(path, {"stope": (BOX.vertices, BOX.facets + 2)})
    with pytest.raises(InputError, match=r"mine\.omf: stope: has triangles of vertices that it does not hold"):
        read_solid(path, "stope")
