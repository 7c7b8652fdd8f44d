"""Files as other programs write them: units, places, several bodies, blocks, odd headers, and what bounds no volume."""

import itertools
import logging
import re

import ezdxf
import numpy as np
import omf
import pytest
import trimesh
from ezdxf.render import MeshBuilder

from common.errors import InputError
from mpm_core.geometry import Solid, build_shape, read_solid
from mpm_core.geometry.inside import contains
from mpm_core.grid.domain import Domain
from mpm_core.stages.grid_stage import read_solids
from tests.geometry.test_files import write_dxf, write_omf

BOX = build_shape({"name": "b", "shape": "box", "lower": [0, 0, 0], "upper": [8, 4, 2]}, 3)
OTHER = Solid("o", BOX.vertices * 2 + [100, 0, 0], BOX.facets)
DOMAIN = Domain(np.zeros(3), np.array([10, 10, 10]), 20.0, 3)


def drawing(path, add, units=None, version="R2018"):
    """A DXF whose model space `add` fills."""
    document = ezdxf.new(version)
    if units is not None:
        document.header["$INSUNITS"] = units
    add(document, document.modelspace())
    document.saveas(path)
    return path


def solid_of(entry: dict) -> Solid:
    """By the way of a configuration."""
    return read_solids([{"name": "stope", **entry}], "excavations", DOMAIN)[0]


def add_box(document, space):
    for facet in BOX.facets:
        space.add_3dface(BOX.vertices[facet])


# ---- units and places ----


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


# ---- several bodies ----

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


# ---- drawings ----


def test_acis_bodies_and_flat_faces_are_named(tmp_path, caplog):
    """No mesh is in them; beside faces they are left out and said."""

    def acis(document, space):
        for body in (space.add_3dsolid(), space.add_region()):
            body.sat = ["400 0 1 0", "End-of-ACIS-data"]

    def add_both(document, space):
        acis(document, space)
        add_box(document, space)

    def flat(document, space):
        space.add_solid([(0, 0), (1, 0), (1, 1)])

    with pytest.raises(InputError, match=r"holds ACIS bodies \(1 3DSOLID, 1 REGION\), no mesh: export it as 3DFACE"):
        read_solid(drawing(tmp_path / "a.dxf", acis, version="R2000"), "stope")
    with pytest.raises(InputError, match=r"flat faces that bound no volume \(1 SOLID\)"):
        read_solid(drawing(tmp_path / "b.dxf", flat), "stope")
    both = drawing(tmp_path / "c.dxf", add_both, version="R2000")
    with caplog.at_level(logging.WARNING):
        assert read_solid(both, "stope").volume == pytest.approx(64)
    assert "also holds 1 3DSOLID, 1 REGION" in caplog.text


EMPTY_MESHES = {
    "polyface": lambda space: space.add_polyface(dxfattribs={"layer": "STOPE"}),
    "polyface without corners": lambda space: space.add_polyface(dxfattribs={"layer": "STOPE"}).append_faces([[]]),
}


@pytest.mark.parametrize("kind", EMPTY_MESHES)
@pytest.mark.parametrize("first", [True, False])
def test_a_mesh_without_a_face_is_left_out_and_named(tmp_path, caplog, kind, first):
    def add(document, space):
        steps = [lambda: add_box_mesh(space), lambda: EMPTY_MESHES[kind](space)]
        for step in reversed(steps) if first else steps:
            step()

    path = drawing(tmp_path / "stope.dxf", add)
    assert read_solid(path, "stope", layer="STOPE").volume == pytest.approx(64)
    assert "also holds 1 POLYLINE without a face" in caplog.text
    alone = drawing(tmp_path / "alone.dxf", lambda _, space: EMPTY_MESHES[kind](space))
    with pytest.raises(InputError, match=r"alone\.dxf: stope: holds no triangulated surface: export"):
        read_solid(alone, "stope", layer="STOPE")


def add_box_mesh(space) -> None:
    builder = MeshBuilder()
    builder.add_mesh(vertices=BOX.vertices.tolist(), faces=BOX.facets.tolist())
    builder.render_polyface(space, dxfattribs={"layer": "STOPE"})


def test_a_mesh_of_vertices_that_it_lacks_is_refused(tmp_path):
    """Joined with other meshes, its faces took theirs."""

    def add(document, space):
        add_box_mesh(space)
        with space.add_mesh(dxfattribs={"layer": "STOPE"}).edit_data() as data:
            data.vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
            data.faces = [(0, 1, 3)]
        add_box_mesh(space)

    path = drawing(tmp_path / "stope.dxf", add)
    with pytest.raises(InputError, match="layer 'STOPE' holds a MESH with faces of vertices that it lacks"):
        read_solid(path, "stope", layer="STOPE")


def test_a_closed_polyline_without_three_corners_is_left_out_and_named(tmp_path, caplog):
    def add(document, space):
        for points in ([(0, 0)], [(0, 0), (1, 0)], [(0, 0), (4, 0), (4, 4), (0, 4)]):
            space.add_lwpolyline(points, close=True)

    entry = {"shape": "prism", "lower": 0.0, "upper": 2.0}
    path = drawing(tmp_path / "ring.dxf", add)
    assert solid_of({"file": str(path), **entry}).volume == pytest.approx(32)
    assert "layer 0: 2 closed polylines with less than three corners: left out" in caplog.text
    point = drawing(tmp_path / "point.dxf", lambda _, space: space.add_lwpolyline([(0, 0)], close=True))
    with pytest.raises(InputError, match=r"point\.dxf: stope: holds no closed polyline"):
        solid_of({"file": str(point), **entry})


def block_of_box(document, name: str, layer: str) -> None:
    """A block with the faces of BOX on a layer."""
    block = document.blocks.new(name)
    for facet in BOX.facets:
        block.add_3dface(BOX.vertices[facet], dxfattribs={"layer": layer})


@pytest.mark.parametrize("rows", [1, 2])
def test_what_a_block_holds_on_layer_0_is_on_the_layer_of_its_insert(tmp_path, rows):
    """Through blocks within blocks, too; what it holds on another layer stays there."""

    def add(document, space):
        block_of_box(document, "inner", "0")
        block_of_box(document, "own", "OWN")
        middle = document.blocks.new("middle")
        middle.add_blockref("inner", (0, 0, 0), dxfattribs={"layer": "0"})
        middle.add_blockref("inner", (0, 0, 50), dxfattribs={"layer": "DEEP"})
        grid = {"row_count": rows, "row_spacing": 100}
        space.add_blockref("inner", (0, 0, 0), dxfattribs={"layer": "STOPE", **grid})
        space.add_blockref("middle", (20, 0, 0), dxfattribs={"layer": "STOPE"})
        space.add_blockref("own", (40, 0, 0), dxfattribs={"layer": "STOPE"})
        space.add_blockref("inner", (60, 0, 0))

    path = drawing(tmp_path / "stope.dxf", add)
    assert read_solid(path, "stope", layer="STOPE").volume == pytest.approx(64 * (rows + 1))
    for layer, x in (("DEEP", 20), ("OWN", 40), ("0", 60)):
        found = read_solid(path, "stope", layer=layer)
        assert (found.volume, found.bounds[0][0]) == (pytest.approx(64), x)


def test_an_outline_of_a_block_is_on_the_layer_of_its_insert(tmp_path):
    def add(document, space):
        document.blocks.new("ring").add_lwpolyline([(0, 0), (4, 0), (4, 4), (0, 4)], close=True)
        space.add_blockref("ring", (0, 0), dxfattribs={"layer": "RING"})

    path = drawing(tmp_path / "ring.dxf", add)
    solid = solid_of({"file": str(path), "shape": "prism", "layer": "RING", "lower": 0.0, "upper": 2.0})
    assert solid.volume == pytest.approx(32)


def test_blocks_scaled_turned_mirrored_and_in_rows(tmp_path):
    """Mirrored blocks are inside out."""

    def add(document, space):
        add_box(None, document.blocks.new("STOPE"))
        space.add_blockref("STOPE", (0, 0, 0), {"xscale": 2.0, "rotation": 30})
        space.add_blockref("STOPE", (50, 0, 0), {"xscale": -1.0})
        space.add_blockref("STOPE", (100, 0, 0), {"column_count": 3, "column_spacing": 20})

    solid = read_solid(drawing(tmp_path / "stope.dxf", add), "stope")
    assert solid.volume == pytest.approx(64 * (2 + 1 + 3), rel=5e-3)


@pytest.mark.parametrize("kind", ["nested", "rows", "itself"])
def test_blocks_by_the_million_are_refused_at_once(tmp_path, kind):
    def add(document, space):
        add_box(None, document.blocks.new("B0"))
        for level in range(1, 8):
            block = document.blocks.new(f"B{level}")
            for place in range(10):
                block.add_blockref(f"B{level - 1}", (place, 0, 0))
        if kind == "itself":
            document.blocks.get("B0").add_blockref("B1", (0, 0, 0))
        rows = {"row_count": 30000, "column_count": 30000, "row_spacing": 9, "column_spacing": 9}
        space.add_blockref("B0" if kind == "rows" else "B7", (0, 0, 0), rows if kind == "rows" else None)

    path = drawing(tmp_path / "stope.dxf", add)
    with pytest.raises(InputError, match=r"unfold to 1\.\d*e\+\d+ entities|inserted into itself"):
        read_solid(path, "stope")


def test_a_triangle_of_a_vertex_that_is_not_there_is_one_line(tmp_path):
    """In a PLY, and in an OBJ."""
    ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    ply += "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 99\n"
    for name, text in (
        ("a.ply", ply),
        ("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"),
        ("c.obj", "v 0 0 0\nf 0 1 2\n"),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError, match=rf"{name}: stope: .*export it again") as caught:
            read_solid(tmp_path / name, "stope")
        assert "\n" not in str(caught.value)


# ---- outlines ----


@pytest.mark.parametrize("kind", ["flag", "repeated", "3-D"])
def test_a_prism_takes_its_outline_from_a_drawing(tmp_path, kind):
    """With heights of its own, or standing on the polyline; in feet; another layer's outline beside it."""
    corners = [(100, 100), (200, 100), (200, 150), (100, 150)]

    def add(document, space):
        space.add_lwpolyline([(0, 0), (1, 0), (1, 1)], close=True, dxfattribs={"layer": "OTHER"})
        on = {"layer": "STOPE"}
        if kind == "3-D":
            space.add_polyline3d([(*corner, 80) for corner in corners], close=True, dxfattribs=on)
        elif kind == "repeated":
            space.add_lwpolyline([*corners, corners[0]], dxfattribs={**on, "elevation": 80})
        else:
            space.add_lwpolyline(corners, close=True, dxfattribs={**on, "elevation": 80})

    path = drawing(tmp_path / "level.dxf", add, units=2)
    entry = {"shape": "prism", "file": str(path), "layer": "STOPE"}
    foot = 0.3048
    for keys, levels in (({"lower": 20.0, "upper": 30.0}, (20, 30)), ({"height": 10.0}, (80 * foot, 80 * foot + 10))):
        solid = solid_of(entry | keys)
        np.testing.assert_allclose(solid.bounds[:, :2], np.array([[100, 100], [200, 150]]) * foot)
        np.testing.assert_allclose(solid.bounds[:, 2], levels)
        assert solid.volume == pytest.approx(5000 * foot**2 * 10)
    with pytest.raises(InputError, match=r"level\.dxf: stope: has 2 layers: name one by `layer`"):
        solid_of({"shape": "prism", "file": str(path), "height": 10.0})


def test_arcs_of_an_outline_are_chords(tmp_path):
    """Two half circles of 20 m."""
    path = drawing(
        tmp_path / "shaft.dxf", lambda d, s: s.add_lwpolyline([(50, 50, 1), (90, 50, 1)], format="xyb", close=True)
    )
    solid = solid_of({"shape": "prism", "file": str(path), "lower": 0.0, "upper": 1.0})
    assert solid.volume == pytest.approx(np.pi * 400, rel=2e-3)


def test_a_prism_of_a_drawing_without_one_outline_is_refused(tmp_path):
    path = drawing(tmp_path / "a.dxf", add_box)
    with pytest.raises(
        InputError, match=r"excavations\.stope: .*a\.dxf: stope: holds faces but no closed polyline: leave out"
    ):
        solid_of({"shape": "prism", "file": str(path), "height": 10.0})
    with pytest.raises(InputError, match="reads its outline from a DXF polyline"):
        solid_of({"shape": "prism", "file": "b.obj", "height": 10.0})


def outlines(path, *lines, layers=(), elevation=0.0):
    """A drawing of closed polylines [(x, y), ...], all on layer PANELS or each on its own, at one elevation or each."""

    def add(document, space):
        for number, line in enumerate(lines):
            level = elevation if np.isscalar(elevation) else elevation[number]
            on = {"layer": layers[number] if layers else "PANELS", "elevation": level}
            space.add_lwpolyline(line, close=True, dxfattribs=on)

    return str(drawing(path, add, 6))


def square(x, y, width, height=None):
    return [(x, y), (x + width, y), (x + width, y + (height or width)), (x, y + (height or width))]


FLAT_PRISM = {"shape": "prism", "layer": "PANELS", "lower": 10.0, "upper": 15.0}


@pytest.mark.parametrize(
    "line",
    [
        pytest.param([(0, 0), (40, 20), (40, 0), (0, 30)], id="crossing"),
        pytest.param([(0, 0), (20, 20), (40, 40), (40, 0), (20, 20), (0, 40)], id="crossing at a corner"),
        pytest.param(square(0, 0, 40) + square(0, 0, 40), id="twice around"),
        pytest.param([(0, 0), (60, 0), (60, 40), (20, 40), (20, 10), (40, 10), (40, 60), (0, 60)], id="over itself"),
    ],
)
def test_an_outline_that_crosses_itself_is_refused(tmp_path, line):
    """It was mined: some places by the sign of one lobe, some twice. Far from the origin, too."""
    for shift in (0.0, 512000.0):
        path = outlines(tmp_path / "level.dxf", [(x + shift, y + 2 * shift) for x, y in line])
        with pytest.raises(
            InputError, match=r"level\.dxf: stope: layer PANELS: crosses itself near [-\d.]+, [-\d.]+ m: put its points"
        ) as caught:
            solid_of({**FLAT_PRISM, "file": path, "offset": [-shift, -2 * shift, 0.0]})
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "line",
    [
        pytest.param([(0, 0), (100, 0), (100, 100), (50, 0), (0, 100)], id="touching at a corner"),
        pytest.param(
            [
                (0, 0),
                (100, 0),
                (100, 100),
                (0, 100),
                (0, 50),
                (30, 50),
                (30, 70),
                (60, 70),
                (60, 50),
                (30, 50),
                (0, 50),
            ],
            id="a hole at the end of a slit",
        ),
        pytest.param([(0, 0), (100, 0), (150, 0), (100, 0), (100, 100), (0, 100)], id="a spike"),
    ],
)
def test_an_outline_that_touches_itself_is_taken(tmp_path, line):
    solid = solid_of({**FLAT_PRISM, "file": outlines(tmp_path / "level.dxf", line)})
    area = abs(sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(line, line[1:] + line[:1], strict=True))) / 2
    assert solid.volume == pytest.approx(5 * area, rel=2e-3)


@pytest.mark.parametrize(
    ("lines", "area", "inside", "outside"),
    [
        pytest.param([square(0, 0, 40), square(60, 0, 20)], 2000, (70, 10), (50, 10), id="apart"),
        pytest.param([square(0, 0, 40), square(40, 0, 20)], 2000, (50, 10), (50, 30), id="side by side"),
        pytest.param([square(0, 0, 40), square(40, 40, 20)], 2000, (50, 50), (50, 30), id="touching at a corner"),
        pytest.param([square(10, 10, 20), square(0, 0, 40)], 1200, (5, 5), (20, 20), id="one within the other"),
        pytest.param([square(0, 10, 20), square(0, 0, 40)], 1200, (5, 5), (10, 20), id="within, at its side"),
        pytest.param(
            [square(0, 0, 40), square(10, 10, 20), square(15, 15, 10)], 1300, (20, 20), (12, 12), id="within a hole"
        ),
        pytest.param([square(0, 0, 40), square(0, 0, 40)[::-1], square(50, 0, 9)], 1681, (5, 5), (45, 5), id="twice"),
        pytest.param([square(20 * n, 0, 20, 50) for n in range(7)], 7000, (130, 5), (145, 5), id="seven panels"),
    ],
)
def test_outlines_of_one_layer_are_prisms_and_holes(tmp_path, caplog, lines, area, inside, outside):
    """Side by side each is a prism, one within another a hole."""
    with caplog.at_level(logging.WARNING):
        solid = solid_of({**FLAT_PRISM, "file": outlines(tmp_path / "level.dxf", *lines)})
    assert solid.volume == pytest.approx(5 * area, rel=1e-9)
    assert contains(solid, np.array([[*inside, 12.0], [*outside, 12.0], [*inside, 16.0]])).tolist() == [
        True,
        False,
        False,
    ]
    assert ("layer PANELS: 1 of " in caplog.text) == (area in (1200, 1300))


@pytest.mark.parametrize("other", [square(20, 20, 40), square(20, 0, 40), square(-10, 10, 60, 10)])
def test_outlines_that_overlap_are_refused(tmp_path, other):
    path = outlines(tmp_path / "level.dxf", square(0, 0, 40), other)
    with pytest.raises(InputError, match=r"level\.dxf: stope: layer PANELS: two closed polylines overlap near .* draw"):
        solid_of({**FLAT_PRISM, "file": path})


def test_each_outline_has_its_own_elevation(tmp_path):
    """Panels at 10 and 20 m; levels above one another overlap in plan alone; a hole keeps to its outline."""
    standing = {"shape": "prism", "layer": "PANELS", "height": 4.0}
    path = outlines(tmp_path / "a.dxf", square(0, 0, 40), square(60, 0, 20), elevation=(10.0, 20.0))
    solid = solid_of({**standing, "file": path})
    assert solid.volume == pytest.approx(8000)
    points = np.array([[5, 5, 12], [5, 5, 22], [65, 5, 22], [65, 5, 12]], float)
    assert contains(solid, points).tolist() == [True, False, True, False]
    levels = outlines(tmp_path / "b.dxf", square(0, 0, 40), square(10, 0, 40), square(0, 0, 40), elevation=(0, 10, 20))
    assert solid_of({**standing, "file": levels}).volume == pytest.approx(3 * 6400)
    ring = outlines(tmp_path / "c.dxf", square(0, 0, 40), square(10, 10, 20), elevation=10.0)
    assert solid_of({**standing, "file": ring}).volume == pytest.approx(4800)


def test_a_mesh_that_is_shown_smooth_says_that_its_cage_is_taken(tmp_path, caplog):
    def add(document, space):
        for layer, levels in (("A", 0), ("B", 2)):
            builder = MeshBuilder()
            builder.vertices, builder.faces = list(ezdxf.math.Vec3.generate(BOX.vertices)), BOX.facets.tolist()
            mesh = builder.render_mesh(space, dxfattribs={"layer": layer})
            mesh.dxf.subdivision_levels = levels

    path = drawing(tmp_path / "stope.dxf", add)
    with caplog.at_level(logging.WARNING):
        assert read_solid(path, "stope", layer="A").volume == pytest.approx(64)
        assert "smooth" not in caplog.text
        assert read_solid(path, "stope", layer="B").volume == pytest.approx(64)
    assert re.search(r"stope\.dxf: layer B: 1 MESH are shown smooth .* cages are used", caplog.text)


@pytest.mark.parametrize("how", ["off", "frozen"])
@pytest.mark.parametrize("kind", ["faces", "outlines"])
def test_layers_that_are_off_or_frozen_are_named(tmp_path, caplog, how, kind):
    """Taken where `layer` names one, left out where a pattern fits it with others."""

    def add(document, space):
        for layer, shift in (("STOPES", 0.0), ("STOPES_OLD", 50.0)):
            on = document.layers.add(layer)
            if layer == "STOPES_OLD":
                on.off() if how == "off" else on.freeze()
            if kind == "faces":
                for facet in BOX.facets:
                    space.add_3dface(BOX.vertices[facet] + [shift, 0, 0], dxfattribs={"layer": layer})
            else:
                space.add_lwpolyline(
                    [(x + shift, y) for x, y in square(0, 0, 8, 4)], close=True, dxfattribs={"layer": layer}
                )

    path = drawing(tmp_path / "stope.dxf", add, 6)
    entry = {"file": str(path)} | ({} if kind == "faces" else {"shape": "prism", "lower": 0.0, "upper": 2.0})
    with caplog.at_level(logging.WARNING):
        assert solid_of({**entry, "layer": "STOPES"}).volume == pytest.approx(64)
    assert not caplog.text
    with caplog.at_level(logging.WARNING):
        assert solid_of({**entry, "layer": "STOPES_OLD"}).bounds[0, 0] == 50.0
    assert f"stope.dxf: layer STOPES_OLD ({how}) in the drawing; used all the same" in caplog.text
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        assert solid_of({**entry, "layer": "*"}).volume == pytest.approx(64)
    assert f"stope.dxf: layers hidden in the drawing: STOPES_OLD ({how}); left out: name one to use it" in caplog.text
    with pytest.raises(InputError, match=r"stope\.dxf: stope: layer '\*_OLD': fits hidden layers only, STOPES_OLD"):
        solid_of({**entry, "layer": "*_OLD"})
