"""Scans that are refused, each in one line with its key; those that are taken; the step that a date belongs to."""

import logging

import numpy as np
import pytest
import trimesh
from small_mines import load, states_of

from common.errors import InputError
from response.scan_settings import ScanSlice
from response.scans import compare_scans
from workflow.configuration import load_mine

LOWER, UPPER = np.array([-6.0, -5.0, -4.0]), np.array([6.0, 5.0, 4.0])
EAST = np.array([1.0, 0.0, 0.0])
FILL = {"model": "elastic", "youngs_modulus": "1 GPa", "poisson_ratio": 0.25, "density": "1800 kg/m^3"}
ROCK = {"model": "elastic", "youngs_modulus": "50 GPa", "poisson_ratio": 0.25, "density": "2700 kg/m^3"}
STEPS = [{"name": "history"}, {"name": "a", "start": "2020-01-01", "end": "2020-02-01"}]
STEPS += [{"name": "b", "start": "2020-02-01", "end": "2020-03-01"}]
STOPE = {
    "name": "stope",
    "shape": "box",
    "lower": ["-6 m", "-5 m", "-4 m"],
    "upper": ["6 m", "5 m", "4 m"],
    "step": "a",
}
LATER = {
    "name": "later",
    "shape": "box",
    "lower": ["8 m", "-5 m", "-4 m"],
    "upper": ["12 m", "5 m", "4 m"],
    "step": "b",
}
PLANNED = LATER | {
    "name": "planned",
    "step": "planned",
    "lower": ["-12 m", "-5 m", "-4 m"],
    "upper": ["-8 m", "5 m", "4 m"],
}
FILLED = STOPE | {"fill": "fill", "filled": "b"}
SCAN = {"name": "CMS", "excavations": ["stope"], "file": "scan.stl", "date": "2020-01-20", "error": "5 cm"}


def box(lower=LOWER, upper=UPPER) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[lower, upper])


def without_faces(mesh: trimesh.Trimesh, count: int) -> trimesh.Trimesh:
    mesh.update_faces(np.arange(len(mesh.faces)) >= count)
    return mesh


def mine_with(folder, scan: dict, mesh: trimesh.Trimesh | None = None, excavations=(STOPE, LATER, PLANNED), **more):
    """A mine with a scan; keys that are None are left out."""
    if mesh is not None:
        mesh.export(folder / "scan.stl")
    scan = {key: value for key, value in scan.items() if value is not None}
    materials = {"host": ROCK, "fill": FILL}
    return load(
        folder, list(excavations), steps=STEPS, materials=materials, observations={"scans": [scan]} | more
    )  # fmt: skip


MISTAKES = {  # Changes of the scan's keys, its surface, and the line that it is refused with.
    "unknown excavation": ({"excavations": ["stop"]}, box, "excavations: no excavation stop; did you mean stope?"),
    "not yet mined": ({"excavations": ["later"]}, box, "later is mined in b, the scan is that of the end of a"),
    "planned": ({"excavations": ["planned"]}, box, "excavations: planned is planned, the scan is that"),
    "before all steps": ({"date": "2019-12-31"}, box, "date: 2019-12-31 is before the first dated step, a"),
    "no date": ({"date": "2020-13-01"}, box, "date: '2020-13-01' is not a date"),
    "date and step": ({"step": "a"}, box, "date: give either date or step"),
    "neither": ({"date": None}, box, "date: give either date or step"),
    "unknown step": ({"date": None, "step": "aa"}, box, "step: no step aa; did you mean a?"),
    "twice": ({"excavations": ["stope", "stope"]}, box, "excavations: names an excavation twice"),
    "no error": ({"error": None}, box, "error: missing key"),
    "no file": ({"file": "none.stl"}, box, "file: "),
    "another place": ({}, lambda: box(LOWER + 11.0, UPPER + 11.0), "0 % of the scan and stope are the same rock"),
    "shifted": ({}, lambda: box(LOWER + EAST * 8.0, UPPER + EAST * 8.0), "its middle lies (8, 0, 0) m from theirs"),
    "offset": ({"offset": ["0 m", "14 m", "0 m"]}, box, "lies (0, 14, 0) m from theirs; correct units and offset"),
    "feet as metres": (
        {}, lambda: box(LOWER / 0.3048, UPPER / 0.3048),
        "35 times the volume of stope (3.39e+04 and 960 m3); with units: ft it would be 1;",
    ),
    "metres as millimetres": ({"units": "mm"}, box, "1e-09 times the volume of stope (9.6e-07 and 960 m3); with units"),
    "open": ({}, lambda: without_faces(box(), 6), "is no volume: export it again as one closed surface"),
    "flat": ({}, lambda: box(upper=[6.0, 5.0, -4.0]), "scan.stl"),
    "station": ({"stations": [["0 m", "99 m", "0 m"]]}, box, "stations: (0, 99, 0) m is not in the scanned void"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line(tmp_path, mistake):
    keys, mesh, expected = MISTAKES[mistake]
    with pytest.raises(InputError) as raised:
        mine_with(tmp_path, SCAN | keys, mesh())
    (line,) = str(raised.value).splitlines()
    assert "observations.scans[0]" in line
    assert expected in line
    assert "pit" not in line.replace("/pytest", "")


def test_no_file_and_no_surface_are_one_line(tmp_path):
    (tmp_path / "scan.stl").write_text("solid nothing\nendsolid nothing\n")
    with pytest.raises(InputError, match=r"observations\.scans\[0\]\.file: .*scan.stl: CMS: ") as raised:
        mine_with(tmp_path, SCAN)
    assert len(str(raised.value).splitlines()) == 1


def test_a_filled_stope_names_the_step_before(tmp_path):
    with pytest.raises(InputError, match=r"stope is filled in b, so there is no void at the end of b; .*step: a"):
        mine_with(tmp_path, SCAN | {"date": "2020-02-03"}, box(), (FILLED,))
    mine = mine_with(tmp_path, SCAN | {"date": None, "step": "a"}, box(), (FILLED,))
    assert mine.scan_steps == ["a"]


def test_a_name_is_that_of_one_instrument(tmp_path):
    point = {"name": "CMS", "at": ["14 m", "0 m", "0 m"]}
    with pytest.raises(InputError, match="two instruments are called 'CMS'"):
        mine_with(tmp_path, SCAN, box(), points=[point])


@pytest.mark.parametrize(("date", "step"), [("2020-01-01", "a"), ("2020-01-31T23:00:00", "a"), ("2020-02-01", "b")])
def test_a_date_belongs_to_the_step_that_holds_it_or_the_last_before(tmp_path, date, step):
    assert mine_with(tmp_path, SCAN | {"date": date}, box()).scan_steps == [step]
    assert mine_with(tmp_path, SCAN | {"date": "2021-06-01"}, box()).scan_steps == ["b"]


def test_a_change_of_a_scan_leaves_instruments_alone(tmp_path):
    """The slice of the instruments does not hold scans, and that of scans names the file."""
    point = {"name": "SC1", "at": ["14 m", "0 m", "0 m"]}
    mine = mine_with(tmp_path, SCAN, box(), points=[point])
    other = mine_with(tmp_path, SCAN | {"error": "9 cm"}, box(), points=[point])
    assert mine.observations_slice() == other.observations_slice()
    assert mine.scans_slice() != other.scans_slice()
    (scan,) = ScanSlice.of(mine.scans_slice()).scans
    assert scan.file == mine.path("scan.stl").as_posix()
    assert scan.step == "a"


def test_a_scan_in_the_grid_of_the_mine(tmp_path):
    """A grid turned by 90 degrees, with another origin: surface and stations are on the map."""
    mine_with(tmp_path, SCAN | {"stations": [["1 m", "2 m", "3 m"]]}, box())
    grid = {"angle": "90 deg", "origin": {"grid": ["0 m", "0 m"], "map": ["0 m", "0 m"]}}
    text = (tmp_path / "small.yaml").read_text().replace("surface: 0 m", f"surface: 0 m\n  grid: {grid}")
    (tmp_path / "turned.yaml").write_text(text)
    mine = load_mine(tmp_path / "turned.yaml")
    (scan,) = mine.settings.observations.scans
    np.testing.assert_allclose(scan.stations, [[2.0, -1.0, 3.0]], atol=1e-6)
    made, state = states_of(mine, tmp_path)
    found = compare_scans(ScanSlice.of(mine.scans_slice()), made, [state])
    np.testing.assert_allclose(found["overbreak_mean"].values, 0.0, atol=2e-3)
    np.testing.assert_allclose(found["underbreak_mean"].values, 0.0, atol=2e-3)


def test_a_scan_of_two_excavations_has_the_walls_of_both(tmp_path):
    """Two halves of a stope, mined one after the other; the wall between them is none."""
    west, east = STOPE | {"name": "west", "upper": ["0 m", "5 m", "4 m"]}, STOPE | {"name": "east"}
    east |= {"lower": ["0 m", "-5 m", "-4 m"], "step": "b"}
    scan = SCAN | {"excavations": ["west", "east"], "date": "2020-02-20"}
    mine = mine_with(tmp_path, scan, box(upper=np.add(UPPER, [0.5, 0.0, 0.0])), (west, east))
    grid, state = states_of(mine, tmp_path)
    found = compare_scans(ScanSlice.of(mine.scans_slice()), grid, [state]).drop_dims("point").to_dataframe()
    rows = found.set_index("side")
    assert rows["wall_area"]["wall 090"] == pytest.approx(80.0)
    assert rows["overbreak_mean"]["wall 090"] == pytest.approx(0.5, abs=2e-3)
    assert rows["overbreak_volume"]["all"] == pytest.approx(40.0, rel=0.07)


def test_a_shifted_scan_is_told(tmp_path, caplog):
    """A metre to the east: what one wall gains the other one lacks."""
    mine = mine_with(tmp_path, SCAN, box(LOWER + EAST, UPPER + EAST))
    grid, state = states_of(mine, tmp_path)
    with caplog.at_level(logging.WARNING):
        compare_scans(ScanSlice.of(mine.scans_slice()), grid, [state])
    assert "CMS lies (1.00, 0.00, 0.00) m from the design" in caplog.text
