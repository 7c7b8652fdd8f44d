"""Solids read from the formats of mine planning packages, whole and damaged."""

import ezdxf
import numpy as np
import omf
import pytest
import trimesh
from ezdxf.render import MeshBuilder

from common.errors import InputError
from mpm_core.geometry import Solid, build_shape, read_solid
from mpm_core.geometry.solid_files import Picked, bodies_in, read_outlines

OFFSET = np.array([512000.0, 4096000.0, -250.0])
BOX = build_shape({"name": "b", "shape": "box", "lower": [0, 0, 0], "upper": [8, 4, 2]}, 3)


def write_omf(path, solids: dict[str, Solid], origin=(0.0, 0.0, 0.0), project_origin=(0.0, 0.0, 0.0), units=""):
    project = omf.Project(name="mine", origin=project_origin, units=units)
    project.elements = [
        omf.SurfaceElement(
            name=name,
            geometry=omf.SurfaceGeometry(vertices=solid.vertices, triangles=solid.facets.astype(int), origin=origin),
        )
        for name, solid in solids.items()
    ]
    omf.OMFWriter(project, str(path))


def write_dxf(path, solids: dict[str, Solid], kind: str, offset=0.0):
    document = ezdxf.new("R2018")
    space = document.modelspace()
    for layer, solid in solids.items():
        vertices = solid.vertices + offset
        if kind == "3DFACE":
            for facet in solid.facets:
                space.add_3dface(vertices[facet], dxfattribs={"layer": layer})
            continue
        builder = MeshBuilder()
        builder.vertices, builder.faces = list(ezdxf.math.Vec3.generate(vertices)), solid.facets.tolist()
        render = builder.render_mesh if kind == "MESH" else builder.render_polyface
        render(space, dxfattribs={"layer": layer})
    document.saveas(path)


def assert_same(read: Solid, offset=0.0, tolerance=1e-9):
    assert read.name == "stope"
    assert read.is_closed
    assert read.signed_volume == pytest.approx(64, rel=max(tolerance, 1e-9))
    np.testing.assert_allclose(read.bounds - offset, BOX.bounds, atol=tolerance)
    assert len(read.vertices) == 8
    assert len(read.facets) == 12


@pytest.mark.parametrize("ending", ["stl", "STL", "obj", "ply"])
def test_mesh_file_round_trip(tmp_path, ending):
    path = tmp_path / f"stope.{ending}"
    trimesh.Trimesh(BOX.vertices, BOX.facets).export(path, file_type=ending.lower())
    assert_same(read_solid(path, "stope"))


def test_ascii_stl_keeps_mine_coordinates(tmp_path):
    path = tmp_path / "stope.stl"
    corners = (BOX.vertices + OFFSET + 0.0078125)[BOX.facets]
    text = "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {x:.9f} {y:.9f} {z:.9f}\n" for x, y, z in facet)
        + "endloop\nendfacet\n" for facet in corners
    )  # fmt: skip
    path.write_text(f"solid stope\n{text}endsolid stope\n")
    assert_same(read_solid(path, "stope"), OFFSET + 0.0078125, 1e-6)


def test_obj_keeps_mine_coordinates_and_its_several_bodies(tmp_path):
    path = tmp_path / "stope.obj"
    lines = []
    for body, shift in (("a", 0), ("b", 100)):
        lines += [f"o {body}", *("v {:.6f} {:.6f} {:.6f}".format(*(v + OFFSET + [shift, 0, 0])) for v in BOX.vertices)]
        start = 1 if body == "a" else 9
        lines += ["f {} {} {}".format(*(facet + start)) for facet in BOX.facets]
    path.write_text("\n".join(lines))
    solid = read_solid(path, "stope")
    assert solid.volume == pytest.approx(128)
    np.testing.assert_allclose(solid.bounds - OFFSET, [[0, 0, 0], [108, 4, 2]], atol=1e-6)


@pytest.mark.parametrize("kind", ["3DFACE", "MESH", "POLYFACE"])
def test_dxf_round_trip_at_mine_coordinates(tmp_path, kind):
    path = tmp_path / "stope.dxf"
    write_dxf(path, {"STOPES": BOX}, kind, OFFSET)
    assert_same(read_solid(path, "stope"), OFFSET, 1e-6)


def test_dxf_in_a_block_and_with_quadrilateral_faces(tmp_path):
    """The upper and lower face as one 3DFACE each, all in a block inserted elsewhere."""
    document = ezdxf.new()
    block = document.blocks.new("STOPE")
    x, y, z = 8.0, 4.0, 2.0
    lower, upper = [(0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0)], [(0, 0, z), (x, 0, z), (x, y, z), (0, y, z)]
    block.add_3dface(lower[::-1])
    block.add_3dface(upper)
    for n in range(4):
        m = (n + 1) % 4
        block.add_3dface([lower[n], lower[m], upper[m], upper[n]])
    document.modelspace().add_blockref("STOPE", OFFSET)
    document.saveas(tmp_path / "stope.dxf")
    assert_same(read_solid(tmp_path / "stope.dxf", "stope"), OFFSET, 1e-6)


def test_dxf_of_several_layers_needs_a_choice(tmp_path):
    path = tmp_path / "stopes.dxf"
    other = Solid("o", BOX.vertices + np.array([20, 0, 0]), BOX.facets)
    write_dxf(path, {"S1": BOX, "S2": other}, "3DFACE")
    with pytest.raises(InputError, match=r"stopes\.dxf: stope: has 2 layers: name one by `layer`.*S1, S2"):
        read_solid(path, "stope")
    with pytest.raises(InputError, match=r"layer 'S3' is not one of S1 \(faces\), S2 \(faces\)$"):
        read_solid(path, "stope", layer="S3")
    assert_same(read_solid(path, "stope", layer="S1"))
    assert read_solid(path, "stope", layer="*").volume == pytest.approx(128)


def test_capitals_make_no_other_layer_of_a_drawing(tmp_path, caplog):
    """Half of the faces name the layer in small letters: they are the same solid, and hidden with it."""
    path = tmp_path / "stopes.dxf"
    document = ezdxf.new("R2018")
    document.layers.add("S1").off()
    other = Solid("o", BOX.vertices + np.array([20, 0, 0]), BOX.facets)
    for layers, solid in ((("S1", "s1"), BOX), (("S2", "S2"), other)):
        for number, facet in enumerate(solid.facets):
            document.modelspace().add_3dface(solid.vertices[facet], dxfattribs={"layer": layers[number % 2]})
    document.saveas(path)
    assert_same(read_solid(path, "stope", layer="S1"))
    assert read_solid(path, "stope", layer="*").volume == pytest.approx(64)
    assert "layers hidden in the drawing: S1 (off)" in caplog.text


def test_dxf_outline_is_not_a_solid(tmp_path):
    document = ezdxf.new()
    document.modelspace().add_lwpolyline([(0, 0), (5, 0), (5, 5)], close=True)
    document.saveas(tmp_path / "stope.dxf")
    with pytest.raises(
        InputError, match=r"stope\.dxf: stope: holds 1 closed polylines but no faces: give shape: prism"
    ):
        read_solid(tmp_path / "stope.dxf", "stope")


def test_a_layer_that_a_drawing_lacks_is_told_with_those_that_it_has(tmp_path):
    """Also where the drawing has outlines alone: then a prism is what reads it."""
    document = ezdxf.new()
    document.layers.add("EMPTY")
    for layer in ("LEVEL_1", "LEVEL_2"):
        document.modelspace().add_lwpolyline([(0, 0), (5, 0), (5, 5)], close=True, dxfattribs={"layer": layer})
    document.modelspace().add_line((0, 0), (5, 5), dxfattribs={"layer": "GRID"})
    document.saveas(tmp_path / "levels.dxf")
    layers = (
        r"layer 'STOPES' is not one of LEVEL_1 \(outlines\), LEVEL_2 \(outlines\), GRID \(neither faces nor outlines\)"
    )
    with pytest.raises(InputError, match=rf"levels\.dxf: stope: {layers}; give shape: prism"):
        read_solid(tmp_path / "levels.dxf", "stope", layer="STOPES")
    with pytest.raises(InputError, match=rf"levels\.dxf: stope: {layers}$"):
        read_outlines(tmp_path / "levels.dxf", "stope", Picked(layer="STOPES"))
    with pytest.raises(InputError, match="layer 'GRID' holds no closed polyline"):
        read_outlines(tmp_path / "levels.dxf", "stope", Picked(layer="GRID"))


def test_omf_round_trip_adds_both_origins(tmp_path):
    path = tmp_path / "stope.omf"
    write_omf(path, {"stope 1": BOX}, origin=(12.0, 0.0, 0.0), project_origin=(500000.0, 4096000.0, -250.0))
    assert_same(read_solid(path, "stope"), [500012.0, 4096000.0, -250.0], 1e-6)


def test_omf_of_several_surfaces_needs_a_choice(tmp_path):
    path = tmp_path / "mine.omf"
    write_omf(path, {"stope 1": BOX, "stope 2": Solid("o", BOX.vertices * 2, BOX.facets)})
    with pytest.raises(InputError, match=r"mine\.omf: stope: has 2 elements: name one by `element`"):
        read_solid(path, "stope")
    assert read_solid(path, "stope", element="stope 2").volume == pytest.approx(512)


def test_repeated_and_flat_triangles_are_dropped_and_opposite_ones_kept(tmp_path):
    path = tmp_path / "stope.ply"
    facets = np.concatenate([BOX.facets, np.roll(BOX.facets[:3], 1, axis=1), [[0, 1, 1]], BOX.facets[:1, ::-1]])
    trimesh.Trimesh(BOX.vertices, facets, process=False).export(path)
    assert len(read_solid(path, "stope").facets) == 13


def test_vertices_that_no_triangle_uses_decide_nothing(tmp_path):
    """One is no number, one far away; beside a flat sheet one made it bound a volume."""
    beside = np.array([[np.nan, 0.0, 0.0], [1e12, 0.0, 0.0]])
    trimesh.Trimesh(np.concatenate([beside, BOX.vertices]), BOX.facets + 2, process=False).export(tmp_path / "a.ply")
    assert read_solid(tmp_path / "a.ply", "a").volume == pytest.approx(BOX.volume)
    flat, above = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0.0, 0.0, 5.0]])
    facets = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]]) + 1
    trimesh.Trimesh(np.concatenate([above, flat]), facets, process=False).export(tmp_path / "b.ply")
    with pytest.raises(InputError, match="is flat"):
        read_solid(tmp_path / "b.ply", "b")


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "dxf", "omf", "ts"])
@pytest.mark.parametrize("content", [b"", b"\n", b"not a solid at all\n", bytes(range(256)) * 8])
def test_empty_or_unreadable_file_is_refused_by_name(tmp_path, ending, content):
    path = tmp_path / f"stope_1.{ending}"
    path.write_bytes(content)
    with pytest.raises(InputError, match=rf"stope_1\.{ending}: stope_1: "):
        read_solid(path, "stope_1")


def test_truncated_binary_stl_is_refused(tmp_path):
    path = tmp_path / "stope.stl"
    trimesh.Trimesh(BOX.vertices, BOX.facets).export(path)
    path.write_bytes(path.read_bytes()[:-60])
    with pytest.raises(InputError, match=r"stope\.stl: stope: "):
        read_solid(path, "stope")


def test_points_without_triangles_are_refused(tmp_path):
    path = tmp_path / "stope.ply"
    trimesh.PointCloud(BOX.vertices).export(path)
    with pytest.raises(InputError, match="no triangles"):
        read_solid(path, "stope")


def test_missing_foreign_and_misdirected_files_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"gone\.stl: stope: no such file"):
        read_solid(tmp_path / "gone.stl", "stope")
    with pytest.raises(InputError, match=r"stope\.docx: stope: not one of the formats \.stl"):
        read_solid(tmp_path / "stope.docx", "stope")
    with pytest.raises(InputError, match="`layer` for DXF"):
        read_solid(tmp_path / "stope.stl", "stope", layer="S1")


# ---- files with many bodies ----

ROW = {f"S{number}": Solid("s", BOX.vertices + np.array([20 * number, 0, 0]), BOX.facets) for number in range(4)}


def write_obj(path, solids: dict[str, Solid], word="o"):
    lines, before = [], 1
    for name, solid in solids.items():
        lines += [f"{word} {name}"]
        lines += [f"v {x} {y} {z}" for x, y, z in solid.vertices] + [
            f"f {a} {b} {c}" for a, b, c in solid.facets + before
        ]
        before += len(solid.vertices)
    path.write_text("\n".join(lines))


def test_bodies_of_a_drawing_are_its_layers_with_faces(tmp_path):
    write_dxf(tmp_path / "many.dxf", ROW, "3DFACE")
    drawing = ezdxf.readfile(tmp_path / "many.dxf")
    drawing.modelspace().add_line((0, 0), (5, 5), dxfattribs={"layer": "GRID"})
    drawing.layers.add("S2").freeze()
    drawing.saveas(tmp_path / "many.dxf")
    found = bodies_in(tmp_path / "many.dxf")
    assert [(body.name, body.keys, body.hidden) for body in found] == [
        (name, {"layer": name}, name == "S2") for name in ROW
    ]


def test_bodies_of_other_files(tmp_path):
    """Surfaces, groups, and formats or files without names."""
    write_omf(tmp_path / "many.omf", ROW)
    write_obj(tmp_path / "groups.obj", ROW, "g")
    write_obj(tmp_path / "one.obj", {"S0": BOX}, "#")
    mesh = trimesh.Trimesh(BOX.vertices, BOX.facets, process=False)
    mesh.export(tmp_path / "binary.stl")
    mesh.export(tmp_path / "box.ply")
    for name in ("many.omf", "groups.obj"):
        assert [(body.name, body.keys) for body in bodies_in(tmp_path / name)] == [(n, {"element": n}) for n in ROW]
    for name in ("one.obj", "binary.stl", "box.ply"):
        assert [(body.name, body.keys) for body in bodies_in(tmp_path / name)] == [(name[:-4], {})]
    with pytest.raises(InputError, match=r"box\.off: no such file|not one of the formats"):
        bodies_in(tmp_path / "box.off")
    with pytest.raises(InputError, match=r"no\.dxf: no such file"):
        bodies_in(tmp_path / "no.dxf")


@pytest.mark.parametrize("ending", ["dxf", "obj", "omf"])
def test_a_file_of_many_bodies_is_parsed_once_until_it_changes(tmp_path, monkeypatch, ending):
    path, parsed = tmp_path / f"many.{ending}", []
    module, parser = {"dxf": (ezdxf, "readfile"), "omf": (type(path), "read_bytes"), "obj": (type(path), "open")}[
        ending
    ]
    write = {"dxf": lambda path, solids: write_dxf(path, solids, "3DFACE"), "obj": write_obj, "omf": write_omf}[ending]
    write(path, ROW)
    real = getattr(module, parser)
    monkeypatch.setattr(module, parser, lambda *args, **keys: parsed.append(1) or real(*args, **keys))
    for body in bodies_in(path):
        solid = read_solid(path, "s", **body.keys)
        np.testing.assert_array_equal(solid.bounds, ROW[body.name].bounds)
        assert len(solid.vertices) == 8
    once = len(parsed)
    write(path, {"S0": ROW["S3"], "S1": ROW["S1"]})
    np.testing.assert_array_equal(read_solid(path, "s", Picked(**bodies_in(path)[0].keys)).bounds, ROW["S3"].bounds)
    assert once == 1
    assert len(parsed) > once
