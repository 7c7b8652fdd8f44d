"""OMF projects, whole and damaged: what is written is what is read."""

import json
import struct
from collections.abc import Callable

import hypothesis.extra.numpy as arrays
import numpy as np
import omf
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from common.errors import InputError
from mpm_core.geometry import build_shape, read_solid
from mpm_core.geometry.omf_files import MAGIC_1, omf_names, read_omf
from mpm_core.geometry.solid_files import bodies_in
from tests.geometry.test_files import write_omf

BOX = build_shape({"name": "b", "shape": "box", "lower": [0, 0, 0], "upper": [8, 4, 2]}, 3)
FOLDER = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30, deadline=None)
COORDINATE = st.floats(-1e7, 1e7, allow_nan=False)
ORIGIN = st.tuples(COORDINATE, COORDINATE, COORDINATE)


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


# ---- units ----


@pytest.mark.parametrize(
    ("text", "metres"), [("", 1.0), ("m", 1.0), ("metres", 1.0), ("Feet", 0.3048), ("ft", 0.3048), ("unknown", 1.0)]
)
def test_a_project_is_read_in_the_unit_that_it_states(tmp_path, text, metres):
    path = tmp_path / "mine.omf"
    write_omf(path, {"s": BOX}, units=text)
    assert read_solid(path, "stope").volume == pytest.approx(64 * metres**3)
    assert read_solid(path, "stope", units="cm").volume == pytest.approx(64e-6)


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
