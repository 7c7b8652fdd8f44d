"""Drawings as other programs write them: bodies, meshes, blocks, layers, and what bounds no volume."""

import logging
import re

import ezdxf
import pytest
from ezdxf.render import MeshBuilder

from common.errors import InputError
from mpm_core.geometry import read_solid
from tests.geometry.drawings import BOX, add_box, drawing, solid_of, square


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
