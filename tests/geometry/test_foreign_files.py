"""Files as other programs write them: units, places, several bodies, odd headers."""

import itertools

import numpy as np
import omf
import pytest
import trimesh

from common.errors import InputError
from mpm_core.geometry import Solid, read_solid
from mpm_core.grid.domain import Domain
from mpm_core.stages.grid_stage import read_solids
from tests.geometry.drawings import BOX, OTHER, add_box, drawing, solid_of
from tests.geometry.test_files import write_dxf, write_omf


@pytest.mark.parametrize(
    ("code", "metres"), [(0, 1.0), (1, 0.0254), (2, 0.3048), (4, 0.001), (6, 1.0), (21, 1200 / 3937)]
)
def test_a_drawing_is_read_in_its_own_units(tmp_path, code, metres):
    """Feet were taken for metres."""
    path = drawing(tmp_path / "stope.dxf", add_box, code)
    assert read_solid(path, "stope").volume == pytest.approx(64 * metres**3, rel=1e-9)
    assert read_solid(path, "stope", units="m").volume == pytest.approx(64, rel=1e-9)


def test_a_unit_that_no_mine_is_drawn_in_needs_another(tmp_path):
    path = drawing(tmp_path / "stope.dxf", add_box, 20)  # parsecs
    with pytest.raises(InputError, match=r"stope\.dxf: stope: .*no mine is drawn in: say `units`"):
        read_solid(path, "stope")
    assert read_solid(path, "stope", units="ft").volume == pytest.approx(64 * 0.3048**3)


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "omf", "dxf"])
def test_units_scale_and_offset_place_any_file(tmp_path, ending):
    """metres = coordinate x unit x scale + offset, so local grids in feet meet mine coordinates."""
    path = tmp_path / f"stope.{ending}"
    if ending == "omf":
        write_omf(path, {"s": BOX})
    elif ending == "dxf":
        write_dxf(path, {"S": BOX}, "3DFACE")
    else:
        trimesh.Trimesh(BOX.vertices, BOX.facets).export(path)
    solid = solid_of({"file": str(path), "units": "ft", "scale": 2.0, "offset": [50.0, 60.0, 70.0]})
    np.testing.assert_allclose(solid.bounds, np.array([[0, 0, 0], [8, 4, 2]]) * 0.6096 + [50, 60, 70], rtol=1e-12)


MAP = np.array([512_345.67, 7_523_456.78, 0.0])
FAR = trimesh.Trimesh(BOX.vertices + MAP, BOX.facets, process=False)


@pytest.mark.parametrize("ending", ["stl", "ply"])
def test_single_precision_that_moves_walls_is_told_with_its_step(tmp_path, caplog, ending):
    """Numbers of 32 bits lie 0.5 m apart at 7.5 million, 15 cm where these are feet; near the origin all is well."""
    path = tmp_path / f"stope.{ending}"
    FAR.export(path)
    read_solid(path, "stope")
    assert (
        f"stope.{ending}: stope: the file holds its coordinates in single precision, in steps of 0.5 m" in caplog.text
    )
    assert "walls may lie 0.25 m from their place; export it as OBJ or DXF, or near the origin" in caplog.text
    caplog.clear()
    read_solid(path, "stope", units="ft")
    assert "in steps of 0.15 m" in caplog.text
    caplog.clear()
    trimesh.Trimesh(BOX.vertices, BOX.facets).export(path)
    assert read_solid(path, "stope", offset=tuple(MAP)).volume == pytest.approx(64)
    assert "precision" not in caplog.text


def test_double_precision_is_not_told(tmp_path, caplog):
    """Text of STL, OBJ and PLY, and a PLY of doubles."""
    FAR.export(tmp_path / "stope.obj", digits=6)
    (tmp_path / "stope.stl").write_text(text_stl("s", Solid("s", FAR.vertices, FAR.faces)))
    head = "ply\nformat ascii 1.0\nelement vertex 8\nproperty double x\nproperty double y\nproperty double z\n"
    rows = [" ".join(map(repr, row)) for row in FAR.vertices.tolist()]
    rows += [" ".join(map(str, [3, *row])) for row in FAR.faces.tolist()]
    head += "element face 12\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "stope.ply").write_text(head + "\n".join(rows) + "\n")
    for ending in ("obj", "stl", "ply"):
        assert read_solid(tmp_path / f"stope.{ending}", "stope").volume == pytest.approx(64, rel=1e-6)
    assert "precision" not in caplog.text


def test_what_lands_outside_the_domain_asks_for_its_units(tmp_path):
    """Millimetres are what many programs write who drew in metres."""
    path = drawing(tmp_path / "stope.dxf", lambda d, s: [s.add_3dface(BOX.vertices[f] - 100) for f in BOX.facets], 4)
    with pytest.raises(InputError, match=r"excavations\.stope: lies outside .*check its coordinates, its units, scale"):
        solid_of({"file": str(path)})


def test_what_lands_outside_the_domain_with_x_and_y_exchanged_says_so(tmp_path):
    domain = Domain(np.array([500.0, 7000, 0]), np.array([10, 10, 10]), 20.0, 3)
    path = tmp_path / "stope.obj"
    trimesh.Trimesh(BOX.vertices + np.array([7010, 510, 10]), BOX.facets).export(path)
    with pytest.raises(InputError, match=r"domain\.upper; with x and y exchanged it would lie there"):
        read_solids([{"name": "stope", "file": str(path)}], "excavations", domain)
    with pytest.raises(InputError, match=r"domain\.upper$"):
        read_solids([{"name": "stope", "file": str(path), "offset": [0, 900, 0]}], "excavations", domain)


def test_coordinates_beyond_any_mine_are_refused(tmp_path):
    path = tmp_path / "stope.ply"
    trimesh.Trimesh(BOX.vertices * 1e300, BOX.facets, process=False).export(path)
    with pytest.raises(InputError, match=r"are no mine's|not finite"):
        read_solid(path, "stope")


OBJ = """# quads, negative and slashed indices, objects and groups, a line that goes on
o Level 1
v 0 0 0
v 8 0 0
v 8 4 0
v 0 4 0
v 0 0 2
v 8 0 2
v 8 4 2
v 0 4 2
g skin
f 4/1/1 3/1/1 2/1/1 1/1/1
f -4 -3 -2 -1
f 1 2 6 5
g ends
f 2 3 7 6
f 3 4 \\
8 7
f 4//3 1//3 5//3 8//3
o Level 2
g skin
v 100 0 0
v 101 0 0
v 100 1 0
v 100 0 1
f 9 11 10
f 9 10 12
f 10 11 12
f 11 9 12
"""


def test_bodies_of_an_obj_are_picked_by_object_or_group(tmp_path):
    path = tmp_path / "stope.obj"
    path.write_text(OBJ)
    assert read_solid(path, "stope").volume == pytest.approx(64 + 1 / 6)
    assert read_solid(path, "stope", element="Level 1").volume == pytest.approx(64)
    assert read_solid(path, "stope", element="Level 2").volume == pytest.approx(1 / 6)
    assert read_solid(path, "stope", element="Level*").volume == pytest.approx(64 + 1 / 6)
    with pytest.raises(InputError, match="'Level 3' is not one of Level 1"):
        read_solid(path, "stope", element="Level 3")


def text_stl(name: str, solid: Solid) -> str:
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join("vertex {} {} {}\n".format(*v) for v in facet)
        + "endloop\nendfacet\n" for facet in solid.vertices[solid.facets]
    )  # fmt: skip
    return f"solid {name}\n{facets}endsolid {name}\n"


def test_solids_of_a_text_stl_are_picked_by_name(tmp_path):
    path = tmp_path / "stope.stl"
    path.write_text("".join(text_stl(name, solid) for name, solid in (("Stope A", BOX), ("Stope B", OTHER))))
    assert read_solid(path, "stope").volume == pytest.approx(64 * 9)
    assert read_solid(path, "stope", element="Stope B").volume == pytest.approx(512)
    with pytest.raises(InputError, match="'C' is not one of Stope A, Stope B"):
        read_solid(path, "stope", element="C")


@pytest.mark.parametrize("start", ["", "\n\n  ", "\ufeff", "; exported by a planning package\n"])
@pytest.mark.parametrize("name", ["S", "s" * 100, "long/folder/" * 2000, "étage", ""])
@pytest.mark.parametrize("capitals", [False, True])
def test_a_text_stl_is_told_by_its_bytes_not_by_its_first_line(tmp_path, start, name, capitals):
    """A name of many kilobytes was read as a binary header, and its letters as a number of triangles."""
    path = tmp_path / "stope.stl"
    text = start + text_stl(name, BOX)
    path.write_text(text.upper() if capitals else text, encoding="utf-8")
    assert read_solid(path, "stope").volume == pytest.approx(64)


def test_a_text_without_vertices_has_no_number_of_triangles(tmp_path):
    path = tmp_path / "stope.stl"
    path.write_text("solid " + "stope of a long name " * 20 + "\nendsolid\n")
    with pytest.raises(InputError, match=r"stope\.stl: stope: neither text with vertices nor binary with triangles"):
        read_solid(path, "stope")


@pytest.mark.parametrize(
    ("header", "after"),
    itertools.product(
        [b"solid COLOR=" + bytes(range(200, 255)), b"\x00" * 80, b"solid facet vertex"], [b"", b"\x00\x01 left over"]
    ),
)
def test_binary_stl_with_an_odd_header(tmp_path, header, after):
    path = tmp_path / "stope.stl"
    trimesh.Trimesh(BOX.vertices, BOX.facets).export(path)
    path.write_bytes(header.ljust(80)[:80] + path.read_bytes()[80:] + after)
    assert read_solid(path, "stope").volume == pytest.approx(64)
    with pytest.raises(InputError, match="no names: remove `element`"):
        read_solid(path, "stope", element="Stope A")


def test_elements_of_omf_that_are_no_surfaces_are_named(tmp_path):
    project = omf.Project(name="mine")
    project.elements = [omf.PointSetElement(name="collars", geometry=omf.PointSetGeometry(vertices=BOX.vertices))]
    omf.OMFWriter(project, str(tmp_path / "mine.omf"))
    with pytest.raises(InputError, match=r"mine\.omf: stope: collars: no triangulated surface"):
        read_solid(tmp_path / "mine.omf", "stope")
