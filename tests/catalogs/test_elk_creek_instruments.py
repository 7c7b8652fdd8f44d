"""Instruments of Elk Creek: read from workbooks laid out as those of the recorded data, and from these data."""

import os
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
import yaml
from elk_creek_fixtures import ROOT, recorded_data, write_tiny_mine
from workbooks import write_xlsx

from common.errors import InputError
from response.observation_settings import ObservationSettings
from response.readings import read_readings
from workflow.mines import elk_creek_instruments as mine

CONFIG = ROOT / "config/mines/elk_creek.yaml"
DAY = pd.Timestamp("2010-09-01")
HOURS = (0, 1, 2, 40 * 24)  # Of readings: in September, and the last in October.
HEADER = ["Serial Date", "Date", "Time of day", "Data-logger number", "Time from zero time (hr)",
          "Distance from instrument site to face (ft)"]  # fmt: skip
CELLS = ["BP1 cell pressure (psi)", "BP2 cell pressure (psi)", "NP1 cell pressure (psi)", "NP2 cell pressure (psi)"]
POTS = [
    f"Set 1 -- Displ. between roof and {depth}-ft anchor--String pot. M1-{n} (in)" for n, depth in ((1, 20), (2, 5))
]
LIST = """site,location,sensor,type,easting,northing,borehole depth,set pressure,comment
C,2N Inby,BP1,BPC,100,200,15,1950,
C,2N Inby,BP2,BPC,101,210,30,1950,"a comment, with a comma"
C,2N Inby,NP1,BPC,102,220,2,0,
C,2N Inby,NP2,BPC,103,230,5,1950,
C,2N Inby,A,Closure,104,240,,,
C,2N Inby,M1-1,SP,105,250,,,
"""


def serial(time: pd.Timestamp) -> float:
    return (time - pd.Timestamp("1899-12-30")) / pd.Timedelta("1D")


def pressures(columns: list[list[float]], distances: list[float], pots: list[list[float]] | None = None) -> list[list]:
    """Rows of a workbook of pressure cells."""
    rows: list[list] = [["2 North Inby readings"], [""], [*HEADER, *CELLS, *(POTS if pots else [])]]
    for hour, distance, *values in zip(HOURS, distances, *columns, *(pots or []), strict=True):
        time = DAY + pd.Timedelta(hours=hour)
        rows.append([serial(time), time, time, 2.0, float(hour), float(distance), *(float(value) for value in values)])
    return rows


@pytest.fixture
def folder(tmp_path):
    """Recorded data of one site: a cell that is whole, one that breaks, one that was never set, one that leaks."""
    write_tiny_mine(tmp_path)
    (tmp_path / "instrumentation.csv").write_text(LIST, encoding="utf-8-sig")
    columns = [[1000, 1100, 1200, 1300], [2000, 2100, -1515, 2200], [500, 500, 500, 500], [3000, 1400, 1400, 1400]]
    pots = [[0.5, 0.5, 0.4, 0.1], [0.0, 0.0, -0.1, -0.2]]
    for below in (mine.CELLS, mine.STATIONS):
        (tmp_path / below).mkdir(parents=True)
    name = "2 North Inby Panel 2 BPC and String Pot Extensometer Raw Readings--Larson.xlsx"
    write_xlsx(tmp_path / mine.CELLS / name, pressures(columns, [-300, -200, -100, 0], pots), "Sheet1")
    rows = [["2 North Inby closure stations"], ["Date", "Floor point to roof point distance at station A (ft)"],
            [DAY, 8.0], [DAY + pd.Timedelta("1D"), ""], [DAY + pd.Timedelta("40D"), 7.5]]  # fmt: skip
    write_xlsx(tmp_path / mine.STATIONS / "2 North Inby closure stations measurements.xlsx", rows, "Sheet1")
    return tmp_path


def test_pressure_cells_end_where_they_break(folder):
    """In Pa and m past the site; the cell that was never set is left out."""
    whole, broken, leaking = mine.read_pressure_cells(folder, "2")
    assert [one.name for one in (whole, broken, leaking)] == ["BP1", "BP2", "NP2"]
    assert whole.readings["value"].tolist() == pytest.approx([1000 * 6894.757 * k for k in (1.0, 1.1, 1.2, 1.3)])
    assert whole.readings["face"].tolist() == pytest.approx([-91.44, -60.96, -30.48, 0.0])
    assert whole.readings.index.tolist() == [DAY + pd.Timedelta(hours=n) for n in HOURS]
    assert (len(broken.readings), len(leaking.readings)) == (2, 1)
    assert whole.place.tolist() == [100.0, 200.0]
    assert mine.read_pressure_cells(folder, "1") == []


def test_closure_is_what_the_height_lost(folder):
    (station,) = mine.read_closure_stations(folder)
    assert station.readings["value"].tolist() == pytest.approx([0.0, 0.5 * 0.3048])
    assert station.label == "2N_Inby_A"


def test_anchors_get_farther_from_the_roof(folder):
    """What the sheet has as negative; the site lists the set by another name than the sheet."""
    (pots,) = mine.read_extensometers(folder, "2")
    assert list(pots.readings.columns) == pytest.approx([5 * 0.3048, 20 * 0.3048])
    assert pots.readings.iloc[-1].tolist() == pytest.approx([0.2 * 0.0254, 0.4 * 0.0254])


def test_the_section_is_one_that_a_mine_file_takes(folder, tmp_path):
    """Instruments that were read in two steps; readings come back in SI units and UTC."""
    out = tmp_path / "out"
    done = command(folder, CONFIG, out)
    assert (done.returncode, done.stdout) == (0, f"{out}: readings of 3 instruments, and instruments.yaml\n")
    given = yaml.safe_load((out / "instruments.yaml").read_text())["observations"]
    settings = ObservationSettings.of(given, "observations")
    (cell,), (line,), (station,) = settings.points, settings.lines, settings.closures
    assert (cell.name, cell.since, cell.at) == ("2N_Inby_BP1_panel_2", "2010-09", (100.0, 200.0, 1810.0))
    np.testing.assert_allclose(cell.axis.vector, [0.0, 0.0, -1.0], atol=1e-12)
    found = read_readings(cell.model_copy(update={"file": str(out / cell.file)}), "points.0")
    assert found.index[0] == pd.Timestamp("2010-09-01T06:00")  # Mountain daylight time.
    assert found["value"].iloc[-1] == pytest.approx(1300 * 6894.757, rel=1e-5)
    assert (line.columns, line.anchors) == (("anchor_1.524", "anchor_6.096"), pytest.approx((1.524, 6.096)))
    assert 0.5 * (station.start[2] + station.end[2]) == pytest.approx(1810.0)
    assert station.end[2] - station.start[2] == pytest.approx(mine.GATE_ROAD, abs=1e-3)


def command(folder, *arguments) -> subprocess.CompletedProcess:
    words = [sys.executable, "-m", "workflow.mines.elk_creek_instruments", *arguments]
    own = os.environ | {"ELK_CREEK_DATA": str(folder)}
    return subprocess.run(words, cwd=ROOT, env=own, capture_output=True, text=True)


def test_a_mine_without_instruments_is_one_line(folder, tmp_path):
    done = command(folder, ROOT / "config/mines/template.yaml", tmp_path / "out")
    assert done.returncode == 1
    assert done.stderr.strip().endswith("excavations_from: missing; the instruments are those of the mine Elk Creek")
    done = command(folder, CONFIG, tmp_path / "out", "--panel", "7")  # closures alone
    assert done.stdout.startswith(f"{tmp_path / 'out'}: readings of 1 instruments")
    for file in (folder / mine.STATIONS).iterdir():
        file.unlink()
    done = command(folder, CONFIG, tmp_path / "none", "--panel", "7")
    assert done.returncode == 1
    assert "no instrument beside panel 7 was read in two of its steps" in done.stderr.splitlines()[-1]
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda folder: (folder / mine.LIST).unlink(), "instrumentation.csv is missing"),
        (lambda folder: (folder / mine.LIST).write_text("a,b\n1,2\n"), "not the list of instruments"),
        (lambda folder: (folder / mine.LIST).write_text(LIST.replace("BP1", "BP9")), "lists no BPC BP1 of 2N Inby"),
        (
            lambda folder: write_xlsx(
                next((folder / mine.CELLS).glob("*.xlsx")), [["no", "units"], [1.0, 2.0]], "Sheet1"
            ),
            "no line names columns with their units",
        ),
    ],
)
def test_what_is_wrong_is_one_line(folder, change, line):
    change(folder)
    with pytest.raises(InputError, match=line) as error:
        mine.read_pressure_cells(folder, "2")
    assert "\n" not in str(error.value)


@pytest.mark.elk_creek
def test_the_recorded_data():
    """Cells of both panels lie at the gate roads, read within their panel's time, and none of what they read is low."""
    data = recorded_data()
    for panel, sites in (("1", set(mine.SITES)), ("2", {"2N Inby", "2N Outby"})):
        cells = mine.read_pressure_cells(data, panel)
        assert {one.site for one in cells} == sites
        for one in cells:
            assert (one.readings["value"] >= mine.LEAST_PRESSURE).all()
            assert 10400 < one.place[0] < 11800
    stations = mine.read_closure_stations(data)
    assert {one.site for one in stations} == set(mine.SITES)
    assert max(one.readings["value"].max() for one in stations) > 1.0  # m: floor heave closed one of them
