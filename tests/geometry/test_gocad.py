"""Surfaces of GOCAD, whole and damaged: what is written is what is read."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import InputError
from common.mine_grid import GridMap
from mpm_core.geometry import Solid, build_shape, read_solid
from mpm_core.geometry.gocad import read_gocad
from mpm_core.geometry.solid_files import bodies_in
from tests.geometry.test_omf_files import FOLDER, meshes

BOX = build_shape({"name": "b", "shape": "box", "lower": [0, 0, 0], "upper": [8, 4, 2]}, 3)
OTHER = Solid("o", BOX.vertices * 2, BOX.facets)
SYSTEM = """GOCAD_ORIGINAL_COORDINATE_SYSTEM
NAME Default
AXIS_NAME "X" "Y" "Z"
AXIS_UNIT {unit}
ZPOSITIVE {positive}
END_ORIGINAL_COORDINATE_SYSTEM
"""


def tsurf(name, vertices, facets, system="", first=1, point="VRTX {} {!r} {!r} {!r}", properties="") -> str:
    """Text of a TSurf. first: identifier of its first vertex."""
    lines = ["GOCAD TSurf 1", "HEADER {", "*solid*color: 0.2 0.8 0.2 1", f"name: {name}", "}"]
    lines += ["PROPERTY_CLASS_HEADER X {", "kind: X", "name: no name of it", "}", "GEOLOGICAL_TYPE fault", "TFACE"]
    lines += [point.format(number, *vertex) + properties for number, vertex in enumerate(vertices.tolist(), first)]
    lines += [" ".join(map(str, ["TRGL", *corners])) for corners in (facets + first).tolist()]
    text = "\n".join([*lines, f"BSTONE {first}", f"BORDER 9 {first} {first + 1}", "END"]) + "\n"
    return text.replace("GEOLOGICAL_TYPE", system + "GEOLOGICAL_TYPE")


def write_gocad(path, solids: dict[str, Solid], **keys) -> None:
    path.write_text("".join(tsurf(name, solid.vertices, solid.facets, **keys) for name, solid in solids.items()))


@FOLDER
@given(mesh=meshes(), first=st.integers(0, 1000), is_downward=st.booleans())
def test_a_surface_is_read_as_it_was_written(tmp_path, mesh, first, is_downward):
    """By depth, too: the mirrored surface, and each triangle the other way round."""
    path = tmp_path / "mine.ts"
    vertices, facets = mesh
    written = (vertices * [1, 1, -1], facets[:, ::-1]) if is_downward else mesh
    system = SYSTEM.format(unit='"m" "m" "m"', positive="Depth" if is_downward else "Elevation")
    path.write_text(tsurf("stope", *written, system, first))
    (found, corners), unit = read_gocad(path)
    np.testing.assert_array_equal(found, vertices)
    np.testing.assert_array_equal(corners, facets)
    assert unit == 1.0


@pytest.mark.parametrize("positive", ["Depth", "Elevation", None])
def test_what_a_file_states_counts_in_a_grid_whose_z_runs_down(tmp_path, positive):
    """Depths are coordinates of such a grid as they are; elevations change their sign; else the file has the grid's."""
    path = tmp_path / "stope.ts"
    down = Solid("d", BOX.vertices * [1, 1, -1], BOX.facets[:, ::-1])
    system = "" if positive is None else SYSTEM.format(unit="m m m", positive=positive)
    write_gocad(path, {"stope": BOX if positive == "Elevation" else down}, system=system)
    solid = read_solid(path, "stope", grid=GridMap(axes=("east", "north", "down")))
    np.testing.assert_array_equal(solid.bounds, BOX.bounds)
    assert solid.signed_volume == pytest.approx(64)


def test_depths_make_a_solid_that_is_not_inside_out(tmp_path, caplog):
    path = tmp_path / "stope.ts"
    down = Solid("d", BOX.vertices * [1, 1, -1], BOX.facets[:, ::-1])
    write_gocad(path, {"stope": down}, system=SYSTEM.format(unit="m m m", positive="Depth"))
    solid = read_solid(path, "stope")
    np.testing.assert_array_equal(solid.bounds, BOX.bounds)
    assert solid.signed_volume == pytest.approx(64)
    assert "turned" not in caplog.text


def test_objects_of_a_file_are_picked_by_name(tmp_path):
    path = tmp_path / "mine.ts"
    write_gocad(path, {"stope 1": BOX, "stope 2": OTHER, "topo": BOX})
    assert [(body.name, body.keys) for body in bodies_in(path)] == [
        (name, {"element": name}) for name in ("stope 1", "stope 2", "topo")
    ]
    assert read_solid(path, "s", element="stope 2").volume == pytest.approx(512)
    with pytest.raises(InputError, match=r"mine\.ts: s: has 3 elements: name one by `element`"):
        read_solid(path, "s")
    with pytest.raises(InputError, match=r"mine\.ts: s: `element` is for .*GOCAD.*, `layer` for DXF"):
        read_solid(path, "s", layer="stope 2")


def test_a_file_of_hundreds_of_objects_is_parsed_once_until_it_changes(tmp_path, monkeypatch):
    path, parsed = tmp_path / "mine.ts", []
    write_gocad(path, {f"S{number}": BOX for number in range(300)})
    real = type(path).open
    monkeypatch.setattr(type(path), "open", lambda *args, **keys: parsed.append(1) or real(*args, **keys))
    bodies = bodies_in(path)
    for body in bodies[::50]:
        read_solid(path, "s", **body.keys)
    assert (len(bodies), len(parsed)) == (300, 1)
    path.write_text(tsurf("other", BOX.vertices, BOX.facets))
    assert [body.name for body in bodies_in(path)] == ["other"]


@pytest.mark.parametrize(
    "header",
    [
        "HEADER {{\nname: {}\n}}",
        "HEADER {{name:{}}}",
        "HEADER{{\n  NAME : {}  \n}}",
        "HEADER name:{}",
        "HEADER\n{{\nname:{}\n}}",
        "HDR name:{}",
    ],
)
def test_forms_of_a_header(tmp_path, header):
    path = tmp_path / "mine.ts"
    rest = tsurf("x", BOX.vertices, BOX.facets).partition("PROPERTY_CLASS")
    path.write_text("GOCAD TSurf 1\n" + header.format("a stope") + "\n" + rest[1] + rest[2])
    assert [body.name for body in bodies_in(path)] == ["a stope"]
    assert read_solid(path, "s").volume == pytest.approx(64)


def test_vertices_with_properties_and_atoms_are_corners_too(tmp_path):
    """Each part of a surface (TFACE) has its own identifiers of vertices on their common edge."""
    path = tmp_path / "mine.ts"
    text = tsurf("s", BOX.vertices, BOX.facets, point="PVRTX {} {} {} {}", properties=" 3.5 -99999 CNXYZ")
    lines = text.splitlines()
    place = next(number for number, line in enumerate(lines) if line.startswith("TRGL"))
    atoms = ["TFACE", *(f"{'ATOM' if number % 2 else 'PATOM'} {number + 8} {number} 1.5" for number in range(1, 9))]
    rest = [
        " ".join(["TRGL", *(str(int(word) + 8) for word in line.split()[1:])]) if line.startswith("TRGL") else line
        for line in lines[place + 6 :]
    ]
    path.write_text("\r\n".join([*lines[: place + 6], *atoms, *rest]))
    solid = read_solid(path, "s")
    assert (solid.is_closed, len(solid.vertices), solid.volume) == (True, 8, pytest.approx(64))


def test_a_file_without_names_is_one_body(tmp_path):
    path = tmp_path / "mine.ts"
    path.write_text(tsurf("x", BOX.vertices, BOX.facets).replace("name: x\n", ""))
    assert [(body.name, body.keys) for body in bodies_in(path)] == [("mine", {})]


def test_surfaces_without_names_are_one_solid_with_a_warning(tmp_path, caplog):
    other = tsurf("x", BOX.vertices + np.array([100.0, 0.0, 0.0]), BOX.facets)
    (tmp_path / "mine.ts").write_text((tsurf("x", BOX.vertices, BOX.facets) + other).replace("name: x\n", ""))
    assert read_solid(tmp_path / "mine.ts", "s").volume == pytest.approx(128)
    assert "its 2 surfaces have no names of their own" in caplog.text


@pytest.mark.parametrize(
    ("unit", "metres"),
    [('"ft" "ft" "ft"', 0.3048), ("m m m", 1.0), ('" m " "M" "metres"', 1.0), ('"none" "" unknown', 1.0)],
)
def test_a_file_is_read_in_the_unit_that_it_states(tmp_path, unit, metres):
    path = tmp_path / "mine.ts"
    write_gocad(path, {"s": BOX}, system=SYSTEM.format(unit=unit, positive="Elevation"))
    assert read_solid(path, "stope").volume == pytest.approx(64 * metres**3)
    assert read_solid(path, "stope", units="cm").volume == pytest.approx(64e-6)


def test_a_unit_that_is_no_length_needs_another(tmp_path):
    path = tmp_path / "mine.ts"
    write_gocad(path, {"s": BOX}, system=SYSTEM.format(unit="ms ms ms", positive="Elevation"))
    with pytest.raises(InputError, match=r"mine\.ts: stope: .*say `units`"):
        read_solid(path, "stope")
    assert read_solid(path, "stope", units="m").volume == pytest.approx(64)


# ---- damaged files ----

WHOLE = tsurf("stope", BOX.vertices, BOX.facets, SYSTEM.format(unit="m m m", positive="Elevation"))


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", r"no triangulated surface of GOCAD \(TSurf\), no line begins with GOCAD"),
        ("<?xml version='1.0'?>\n<TS language='de'></TS>", "no line begins with GOCAD"),
        ("GOCAD VSet 1\nVRTX 1 0 0 0\nEND\nGOCAD PLine 1\nEND\n", "its objects are VSet, PLine"),
        ("GOCAD TSurf 1\nHEADER {\nname:s\n}\nTFACE\nEND\n", "no triangulated surface"),
        (WHOLE[:-4], "is cut off"),
        (WHOLE[: len(WHOLE) // 2], "is cut off"),
        (WHOLE[:-4] + WHOLE, "is cut off"),
        (WHOLE.replace("TRGL 1", "TRGL 99"), "vertex 99, which it lacks: export it again"),
        (WHOLE.replace("Elevation", "Sideways"), "ZPOSITIVE Sideways, neither Depth nor Elevation"),
        (WHOLE.replace("m m m", "m m ft"), r"states several units \(m, ft\): export it in one"),
        (WHOLE.replace("VRTX 2 0", "VRTX 2 east"), "unreadable as TS"),
        (WHOLE.replace("VRTX 2 ", "VRTX 2\nVRTX 99 "), "unreadable as TS"),
        (WHOLE.replace("TRGL 1", "TRGL\nTRGL 1"), "unreadable as TS"),
        (WHOLE.replace("ZPOSITIVE Elevation", "ZPOSITIVE"), "unreadable as TS"),
    ],
)
def test_what_is_no_whole_surface_is_one_line(tmp_path, text, match):
    path = tmp_path / "mine.ts"
    path.write_text(text)
    with pytest.raises(InputError, match=rf"mine\.ts: stope: .*{match}") as caught:
        read_solid(path, "stope")
    assert "\n" not in str(caught.value)


def test_video_in_a_file_of_the_same_ending_is_one_line(tmp_path):
    path = tmp_path / "mine.ts"
    path.write_bytes((b"\x47\x40\x11\x10" + bytes(range(184))) * 20)
    with pytest.raises(InputError, match=r"mine\.ts: no triangulated|mine\.ts: holds no triangulated surface of GOCAD"):
        bodies_in(path)
