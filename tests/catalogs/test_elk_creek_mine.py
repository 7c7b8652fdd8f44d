"""The gob prisms of the Elk Creek mine from its dated faces, and the mine's configuration.

Tests marked `elk_creek` read the recorded data (folder ELK_CREEK_DATA, else data/elk_creek) and skip without them; the
others read a tiny folder of the same layout whose answers are known.
"""

from pathlib import Path
from types import SimpleNamespace

import ezdxf
import numpy as np
import pandas as pd
import pint
import pytest
import yaml
from areas import polygon_area
from elk_creek_fixtures import ROOT, recorded_data, seam, write_tiny_mine
from matplotlib.path import Path as Outline

from catalogs.records import elk_creek_reader as record
from catalogs.settings import FaceSettings
from common.errors import InputError
from mpm_core.geometry.shapes import build_shape
from verification.extremes.tiny_mine import changed
from verification.studies import merge
from workflow.configuration import load
from workflow.face_positions import face_positions
from workflow.mines import elk_creek as mine
from workflow.mines.longwall import seconds

CONFIG = ROOT / "config/mines/elk_creek.yaml"
PERIOD = "2010-09-01", "2011-01-01"


def prisms_of(folder, **options):
    """What is mined up to the end of 2010."""
    return mine.schedule(folder, *PERIOD, **{"gob_height": 18.0} | options)[1]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(record.ENVIRONMENT_VARIABLE, str(write_tiny_mine(tmp_path)))
    return tmp_path


@pytest.fixture(scope="module")
def data():
    return recorded_data()


def area_by(prisms, key):
    total = {}
    for prism in prisms:
        total[prism[key]] = total.get(prism[key], 0.0) + polygon_area(prism["polygon"])
    return total


def assert_tiles(prisms):
    """No plan point inside two prisms: a raster of 4 m counts each at most once (points on shared edges left out)."""
    corners = np.concatenate([prism["polygon"] for prism in prisms])
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    x, y = np.meshgrid(np.arange(x0 + 0.37, x1, 4.0), np.arange(y0 + 0.37, y1, 4.0))
    points = np.column_stack([x.ravel(), y.ravel()])
    hits = sum(Outline(prism["polygon"]).contains_points(points, radius=-1e-3).astype(int) for prism in prisms)
    assert hits.max() == 1
    covered = 16.0 * hits.sum()
    assert covered == pytest.approx(sum(area_by(prisms, "step").values()), rel=0.02)


def assert_follows_seam(prisms, plane, gob_height):
    """Every corner on the plane; and as the geometry builds it, a closed solid of area times height."""
    for prism in prisms:
        assert np.allclose(prism["base"], [plane.elevation(*corner) for corner in prism["polygon"]])
        assert np.allclose(np.subtract(prism["top"], prism["base"]), gob_height)
        solid = build_shape(prism, 3)
        assert solid.is_closed
        assert solid.volume == pytest.approx(polygon_area(prism["polygon"]) * gob_height, rel=1e-9)


def test_seam_is_the_plane_through_stations_and_panels(folder):
    """Underground stations and the panel's middle lie on one plane; the surface station 700 m above it is left out."""
    plane = mine.fit_seam(folder)
    assert plane.misfit < 1e-6
    assert plane.elevation(10123.0, 5321.0) == pytest.approx(seam(10123.0, 5321.0), abs=1e-6)


def test_prisms_tile_the_ground_between_faces_and_carry_the_month_of_their_face(folder):
    """Parallel faces 240 m apart across y: an advance of d metres mines 240 d m2."""
    prisms = prisms_of(folder)
    advances = {"history": 500 + 100, "2010-09": 250, "2010-10": 150, "2010-11": 100, "2010-12": 200}
    areas = area_by(prisms, "step")
    assert list(areas) == list(advances)  # history first; nothing after December 2010
    for step, advance in advances.items():
        assert areas[step] == pytest.approx(240 * advance, rel=1e-6)
    assert_tiles(prisms)
    assert_follows_seam(prisms, mine.fit_seam(folder), 18.0)
    names = [prism["name"] for prism in prisms]
    assert len(set(names)) == len(names)


def test_gob_height_floor_and_fill_are_the_callers(folder):
    prisms = prisms_of(folder, gob_height=15.0, floor=1800.0, fill="rubble")
    assert len(prisms) == 2 + 1 + 4
    for prism in prisms:
        assert (prism["base"], prism["top"], prism["fill"]) == ([1800.0] * 4, [1815.0] * 4, "rubble")


@pytest.mark.parametrize(
    ("slices", "names"),
    [
        ("month", ["2010-09", "2010-10", "2010-11", "2010-12"]),
        ("week", [f"{date:%Y-%m-%d}" for date in pd.date_range("2010-09-01", "2010-12-29", freq="7D")]),
        ("100 m", [f"{metres:04d}_m" for metres in range(0, 700, 100)]),
    ],
)
def test_steps_follow_from_the_slices(folder, config, slices, names):
    """The shipped mine on the tiny folder: dated steps, history before them, nothing after the period."""
    made = of_shipped(config, **{"excavations_from.slices": slices})
    assert [step.name for step in made.steps] == ["history", *names]
    assert made.dated_steps == names
    assert (made.steps[1].start, made.steps[-1].end) == PERIOD
    assert {entry.step for entry in made.excavations} == {"history", *names}


def test_another_period_needs_no_edit_of_code(folder, config):
    """2011, when the face of panel 2b moves: all before is history."""
    made = of_shipped(config, **{"excavations_from.start": "2011-04-01", "excavations_from.end": "2011-05-01"})
    assert made.dated_steps == ["2011-04"]
    assert [entry.name for entry in made.excavations if entry.step != "history"] == ["panel_2b_2011-04-01"]


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"steps": [{"name": "history"}]}, "steps: follow from excavations_from; leave them out"),
        ({"excavations_from.slices": "weekly"}, "excavations_from.slices: 'weekly' is not one of month, week"),
        ({"excavations_from.slices": 50}, "excavations_from.slices: 50 has no unit"),
        ({"excavations_from.start": "2010-13-01"}, "excavations_from.start: '2010-13-01' is not a date"),
        (
            {"excavations_from.end": "2013-01-01"},
            "excavations_from.end: 2013-01-01, but faces are dated from 2010-01-01",
        ),
        ({"excavations_from.end": "2010-08-01"}, "excavations_from.end: 2010-08-01 is not after start 2010-09-01"),
    ],
)
def test_mistakes_in_the_period_are_one_line(folder, config, changes, line):
    with pytest.raises(InputError) as refused:
        of_shipped(config, **changes)
    (told,) = refused.value.lines
    assert line in told


def test_centroid_and_area_of_a_triangle_far_from_the_origin():
    triangle = np.array([[1e6, 1e6], [1e6 + 3, 1e6], [1e6, 1e6 + 6]])
    assert polygon_area(triangle) == pytest.approx(9)
    assert np.allclose(mine.polygon_centroid(triangle), [1e6 + 1, 1e6 + 2], atol=1e-6)


def test_faults_of_the_geometry_are_told_in_one_line(folder):
    faces = folder / "face_positions.csv"
    faces.write_text(faces.read_text().replace("tailgate_y", "tailgate_why"))
    with pytest.raises(InputError, match=r"column 'tailgate_y' .* is missing"):
        prisms_of(folder)
    (folder / "dxfs/placeholder_workings.dxf").write_text("no drawing")
    with pytest.raises(InputError, match="not a readable DXF"):
        mine.fit_seam(folder)
    faces.unlink()
    with pytest.raises(InputError, match=r"face_positions\.csv is missing"):
        prisms_of(folder)


FACES = "local_date,headgate_x,headgate_y,tailgate_x,tailgate_y,panel,notes"
ROWS = ["2010-01-01,70,240,0,0,1,", "2010-02-01,370,240,300,0,1,", "2010-03-01,570,240,500,0,1,"]


def panels_of(folder, rows, header=FACES, change=lambda text: text, encoding="utf-8"):
    text = change("\n".join([header, *rows]) + "\n")
    (folder / "face_positions.csv").write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
    return mine.read_panels(folder)


@pytest.mark.parametrize(
    ("change", "encoding"),
    [
        (lambda text: text, "utf-8-sig"),
        (lambda text: text.replace(",", ";"), "utf-8"),
        (lambda text: text.replace(",", ";").replace("570", "570,0"), "utf-8"),
        (lambda text: text.replace(",", "\t"), "utf-16"),
        (lambda text: "faces of the mine\n\n" + text.replace("\n", "\r\n"), "utf-8"),
        (lambda text: text.replace("notes\n", "notes\n,m,m,m,m,,\n"), "utf-8"),
        (lambda text: text.replace("2010-02-01", "2010-02-01T00:00:00").replace(",1,", ", 1 ,"), "utf-8"),
    ],
)
def test_face_positions_are_read_in_the_forms_that_records_are(folder, change, encoding):
    (panel,) = panels_of(folder, ROWS, change=change, encoding=encoding)
    assert panel.name == "1"
    assert panel.headgate.tolist() == [[70, 240], [370, 240], [570, 240]]
    assert panel.tailgate.tolist() == [[0, 0], [300, 0], [500, 0]]
    assert panel.date.tolist() == [seconds(pd.Timestamp(f"2010-0{month}-01")) for month in (1, 2, 3)]


def row(number: int, **cells) -> list[str]:
    """The rows with other cells in one of them."""
    names = FACES.split(",")
    changed = ROWS[number - 1].split(",")
    for name, text in cells.items():
        changed[names.index(name)] = text
    return [*ROWS[: number - 1], ",".join(changed), *ROWS[number:]]


SPOILED = {  # rows, and the lines that say what is wrong
    "date of another form": (row(3, local_date="01/03/2010"), ["row 3: column 'local_date': '01/03/2010' is no local"]),
    "no such day": (row(2, local_date="2010-02-30"), ["row 2: column 'local_date': '2010-02-30' is not an ISO date"]),
    "no date": (row(2, local_date=""), ["row 2: column 'local_date': is empty; write it as 2010-03-01"]),
    "an offset": (row(2, local_date="2010-02-01T00:00:00+99:00"), ["row 2: column 'local_date': '2010-02-01T00"]),
    "year 3010": (row(2, local_date="3010-02-01"), ["years run from 1678 to 2261"]),
    "text": (row(2, headgate_x="far"), ["row 2: column 'headgate_x': 'far' is no coordinate in metres"]),
    "empty": (row(1, tailgate_y=""), ["row 1: column 'tailgate_y': is empty"]),
    "code": (row(1, tailgate_y="-999"), ["row 1: column 'tailgate_y': '-999' is no coordinate"]),
    "endless": (row(1, tailgate_y="inf"), ["row 1: column 'tailgate_y': 'inf' is no coordinate"]),
    "huge": (row(1, tailgate_y="1e300"), ["row 1: column 'tailgate_y': '1e300' is no coordinate"]),
    "no panel": (row(3, panel=""), ["row 3: column 'panel': is empty"]),
    "a path": (row(3, panel="../1"), ["row 3: column 'panel': '../1' is no name of a panel"]),
    "twice": (row(3, local_date="2010-02-01"), ["row 3: column 'local_date': 2010-02-01 is not after 2010-02-01"]),
    "order": (row(3, local_date="2009-03-01"), ["row 3: column 'local_date': 2009-03-01 is not after 2010-02-01"]),
    "no length": (row(2, tailgate_x="370", tailgate_y="240"), ["row 2: headgate and tailgate are one point"]),
    "alone": (row(3, panel="2"), ["panel 2: its face does not move"]),
    "capitals": ([*row(3, panel="a"), ROWS[0].replace(",1,", ",A,")], ["'A' and 'a' differ in capitals alone"]),
    "no rows": ([], ["no position of a face"]),
    "all at once": (
        ["soon,far,240,0,0,1,", *ROWS[1:]],
        ["row 1: column 'headgate_x': 'far'", "row 1: column 'local_date': 'soon'"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SPOILED)
def test_spoiled_face_positions_are_told_by_row_and_column(folder, name):
    """They ended in tracebacks of pandas, or were read as other positions."""
    rows, lines = SPOILED[name]
    with pytest.raises(InputError) as refused:
        panels_of(folder, rows)
    assert [line for line in lines if line not in str(refused.value)] == []
    assert all(str(folder / "face_positions.csv") in line for line in refused.value.lines)
    with pytest.raises(InputError):
        prisms_of(folder)


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"", "not a readable CSV file (it is empty)"),
        (b"PK\x03\x04 more", "a zip archive or an Excel workbook"),
        (bytes(range(256)), "zero bytes"),
        ("\n".join([FACES.replace("head", "main"), *ROWS]).encode(), "columns 'headgate_x' (required"),
        ("\n".join([FACES, ROWS[0] + ",,,,", *ROWS[1:]]).encode(), "not a readable CSV"),
    ],
)
def test_face_positions_that_are_no_table_are_one_line(folder, content, line):
    with pytest.raises(InputError) as refused:
        panels_of(folder, [], change=lambda _: content)
    (told,) = refused.value.lines
    assert line in told
    assert "record." not in told


def test_positions_of_one_day_keep_their_hours(folder):
    """A face that is dated twice on a day was refused as out of order."""
    panels_of(folder, row(3, local_date="2010-02-01 12:00"))
    settings = SimpleNamespace(face=FaceSettings.of({"source": "elk_creek", "folder": str(folder)}, "face"))
    positions = face_positions(SimpleNamespace(settings=settings, path=Path, listed_steps=[]))
    assert [one["date"] for one in positions] == ["2010-01-01", "2010-02-01", "2010-02-01T12:00:00"]


# -- the configuration ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def config():
    return yaml.safe_load(CONFIG.read_text())


def si(text):
    return pint.UnitRegistry()(text).to_base_units().magnitude


def of_shipped(config, **changes):
    """The shipped mine with changes by dotted key, checked; its record left out."""
    values = {key: value for key, value in config.items() if key != "record"}
    default = yaml.safe_load((ROOT / "config/default.yaml").read_text())
    return load(merge(default, changed(values, **changes)), CONFIG)


def test_domain_is_whole_multiples_of_the_coarse_cell(config):
    lower, upper = (np.array([si(value) for value in config["domain"][key]]) for key in ("lower", "upper"))
    coarse = si(config["grid"]["coarse_cell"])
    assert np.allclose((upper - lower) % coarse, 0)
    assert upper[2] == si(config["frame"]["surface"])


@pytest.mark.parametrize(("name", "levels"), [("host", (1760, 1860)), ("strong", (1200, 2400))])
def test_virgin_stress_stays_below_intact_strength_of_each_rock(config, name, levels):
    """Coulomb: largest compression < N times the least + 2 c sqrt(N), N = (1 + sin phi) / (1 - sin phi)."""
    host, stress = config["materials"][name], config["insitu_stress"]
    friction = np.radians(float(host["friction_angle"]["intact"].split()[0]))
    ratio = (1 + np.sin(friction)) / (1 - np.sin(friction))
    depth = si(config["frame"]["surface"]) - np.linspace(*levels, 200)
    components = ("xx", "yy", "zz")
    compression = np.array([-si(stress["constant"][c]) - si(stress["gradient"][c]) * depth for c in components])
    strength = ratio * compression.min(axis=0) + 2 * si(host["cohesion"]["intact"]) * np.sqrt(ratio)
    assert (compression.min(axis=0) >= 0).all()
    assert (compression.max(axis=0) / strength).max() < 0.9
    weight = si(host["density"]) * 9.81
    assert -si(stress["gradient"]["zz"]) == pytest.approx(weight, rel=2e-3)


def test_gob_and_layers_are_whole_finest_cells(config):
    """Cells that the roof or the floor cuts would support the roof."""
    cell = si(config["grid"]["coarse_cell"]) / 2 ** (config["grid"]["levels"] - 1)
    made = config["excavations_from"]
    floor, height = si(made["floor"]), si(made["gob_height"])
    assert height == cell
    layers = {body["name"]: [si(body[key][2]) for key in ("lower", "upper")] for body in config["rock_bodies"]}
    bottom, surface = si(config["domain"]["lower"][2]), si(config["frame"]["surface"])
    assert layers == {"floor": [bottom, floor - 40], "roof": [floor + height + 40, surface]}
    assert [(level - bottom) % cell for level in (floor, *layers["floor"], *layers["roof"])] == [0.0] * 5
    for body in config["rock_bodies"]:
        assert [body[key][:2] for key in ("lower", "upper")] == [
            config["domain"][key][:2] for key in ("lower", "upper")
        ]


def test_missing_folder_names_the_key_of_the_excavations(folder, tmp_path, monkeypatch):
    monkeypatch.delenv(record.ENVIRONMENT_VARIABLE, raising=False)
    with pytest.raises(InputError, match=r"excavations_from\.folder"):
        prisms_of(tmp_path / "nowhere")
    monkeypatch.setenv(record.ENVIRONMENT_VARIABLE, str(folder))
    assert prisms_of(tmp_path / "nowhere")


@pytest.mark.elk_creek
def test_recorded_prisms_match_the_production_drawing(data):
    """Panels 1 and 2 as mined by 2011-01-01, against the outlines drawn from production; areas to 0.5 %."""
    prisms = prisms_of(data)
    plane = mine.fit_seam(data)
    assert_tiles(prisms)
    assert_follows_seam(prisms, plane, 18.0)
    assert np.degrees(np.arctan(np.hypot(plane.east, plane.north))) == pytest.approx(3, abs=0.5)
    assert plane.misfit < 18.0 / 3
    drawing = ezdxf.readfile(data / "dxfs/production.dxf").modelspace()

    def drawn(layer):
        outlines = [np.array(line.get_points("xy")) for line in drawing.query(f'LWPOLYLINE[layer=="{layer}"]')]
        return [(outline, abs(polygon_area(outline))) for outline in outlines]

    panel = {name: [p for p in prisms if p["name"].startswith(f"panel_{name}_")] for name in ("1", "2")}
    first = sum(area for _, area in drawn("Panel1_production"))
    second = sum(area for outline, area in drawn("Panel2_production") if outline[:, 0].min() < 10100)
    assert sum(area_by(panel["1"], "step").values()) == pytest.approx(first, rel=0.005)
    assert sum(area_by(panel["2"], "step").values()) == pytest.approx(second, rel=0.005)
    workings = [Outline(outline) for outline, _ in mine.read_outlines(data)]
    for prism in prisms:
        inside = [line.contains_points(prism["polygon"], radius=r).all() for line in workings for r in (8.0, -8.0)]
        assert any(inside)  # within 8 m of a panel outline: the drawing calls them placeholders


@pytest.mark.elk_creek
def test_recorded_months_advance_as_the_faces_say(data):
    """Area over the length of the face (251 m) is the monthly advance: 278, 237, 135, 206 m along the gate roads."""
    areas = area_by(prisms_of(data), "step")
    advance = {step: area / 251.0 for step, area in areas.items() if step != "history"}
    assert list(advance) == ["2010-09", "2010-10", "2010-11", "2010-12"]
    panel = next(panel for panel in mine.read_panels(data) if panel.name == "2")
    first, last = (seconds(pd.Timestamp(text)) for text in PERIOD)
    headgate = panel.headgate[(panel.date >= first) & (panel.date <= last)]
    measured = np.linalg.norm(np.diff(headgate, axis=0), axis=1)
    assert np.allclose(list(advance.values()), measured, rtol=0.06)


@pytest.mark.elk_creek
def test_configured_frame_is_that_of_the_data(data, config):
    pyproj = pytest.importorskip("pyproj")
    ours = pyproj.CRS.from_user_input(config["frame"]["crs"])
    theirs = pyproj.CRS.from_wkt((data / "elk_creek_coordinates.wkt").read_text())
    point = [
        pyproj.Transformer.from_crs(crs, "EPSG:4269", always_xy=True).transform(10760, 5120) for crs in (ours, theirs)
    ]
    assert np.allclose(point[0], point[1], atol=1e-9)
    assert np.allclose(point[0], [-107.4866, 38.9608], atol=1e-3)


@pytest.mark.elk_creek
def test_excavations_stay_well_inside_the_configured_domain(data, config):
    """More than two face lengths (500 m) to every side and below; the surface is the domain's top."""
    lower, upper = (np.array([si(value) for value in config["domain"][key]]) for key in ("lower", "upper"))
    prisms = of_shipped(config).excavations
    corners = np.concatenate([prism.polygon for prism in prisms])
    assert (corners.min(axis=0) - lower[:2] > 500).all()
    assert (upper[:2] - corners.max(axis=0) > 500).all()
    assert min(min(prism.base) for prism in prisms) - lower[2] > 500


@pytest.mark.elk_creek
def test_configured_floor_is_that_of_the_seam_where_these_months_mine(data, config):
    """Within half a cell."""
    prisms = [prism for prism in prisms_of(data) if prism["step"] != "history"]
    area = [polygon_area(prism["polygon"]) for prism in prisms]
    mean = np.average([np.mean(prism["base"]) for prism in prisms], weights=area)
    assert abs(mean - si(config["excavations_from"]["floor"])) < 10.0


@pytest.mark.elk_creek
def test_later_panels_are_planned_from_the_file(data, config):
    """Panels 3 and 4, north of panel 2, with a domain that reaches them; no event of theirs is read."""
    upper = {f"{key}.upper.1": "7040 m" for key in ("domain", "rock_bodies.0", "rock_bodies.1")}
    period = {"excavations_from.start": "2011-07-09", "excavations_from.end": "2012-12-01"}
    made = of_shipped(config, **upper, **period)
    assert (len(made.dated_steps), made.dated_steps[0], made.dated_steps[-1]) == (17, "2011-07", "2012-11")
    panels = {entry.name.split("_")[1]: entry.step == "history" for entry in made.excavations}
    assert panels == {"1": True, "2": True, "2b": True, "3": False, "3b": False, "4": False, "4b": False}


@pytest.mark.parametrize(
    "rows",
    [
        ["2010-01-01,-29,240,-99,0,1,", "2010-02-01,370,240,300,0,1,", "2010-03-01,570,240,500,0,1,"],
        ["2010-01-01,0,240,0,-99,1,", "2010-02-01,300,240,300,-99,1,", "2010-03-01,500,240,500,-99,1,"],
        ["2010-01-01,-199,240,-199,0,1,", "2010-02-01,-99,240,-99,0,1,", "2010-03-01,0,240,0,0,1,"],
    ],
)
def test_a_face_may_lie_where_other_files_have_a_missing_value(folder, rows):
    """-99 m among others, or of a face as long as the others, is a coordinate; -999 m far from them is none."""
    (panel,) = panels_of(folder, rows)
    assert -99 in np.concatenate([panel.tailgate, panel.headgate])
    with pytest.raises(InputError, match="is no coordinate in metres but stands for a missing value"):
        panels_of(folder, [rows[0].replace("240", "-999"), *rows[1:]])
