"""`snakemake baselines` for the tiny mine: rock that does not fail, what it refuses, page, table and catalogues."""

import csv

import numpy as np
import pytest
import xarray as xr
from tiny_mines import FLAT, TINY, changed, edited, hashes, merged, snakemake, write_mine

from baselines.settings import BaselineReportSlice, FlawSlice, StressSlice
from common.costs import Costs
from workflow.configuration import load
from workflow.folders import Folders
from workflow.mine_baselines import MineBaselines

FACE = {
    "positions": [
        {"date": date, "ends": [[x, "30 m"], [x, "70 m"]]}
        for date, x in (("2019-07-01", "10 m"), ("2019-08-01", "30 m"), ("2019-09-01", "60 m"))
    ]
}
HOEK_BROWN = {
    "model": "hoek_brown",
    **{key: TINY["materials"]["host"][key] for key in ("youngs_modulus", "poisson_ratio", "density", "dilation_angle")},
    "sigma_ci": {"intact": "100 MPa", "residual": "100 MPa"},
    "gsi": {"intact": 60, "residual": 30},
    "mi": {"intact": 15, "residual": 15},
    "disturbance": {"intact": 0, "residual": 0},
    "tension_cutoff": "none",
}


def baselines_of(mine: dict, tmp_path) -> MineBaselines:
    """What a mine's file asks for."""
    file = write_mine(mine, tmp_path / "mine.yaml")
    return MineBaselines(load(merged(mine), file), file)


def test_rock_of_the_variant_does_not_fail_and_all_else_is_the_mines(accept):
    """More rings of cells, since none are split where rock nears its strength; strength is not there, fill is."""
    mine = accept(TINY)
    variant = Folders(mine).mine_at("tiny/elastic_rock")
    own, elastic = mine.mechanics_slice(1), variant.mechanics_slice(1)
    assert {key for key in own if own[key] != elastic[key]} == {"materials", "refinement"}
    assert elastic["materials"] == {
        name: {key: rock[key] for key in ("youngs_modulus", "poisson_ratio", "density")} | {"model": "elastic"}
        for name, rock in own["materials"].items()
    }
    grids = mine.grid_slice(), variant.grid_slice()
    assert grids[1] == grids[0] | {"grid": grids[0]["grid"] | {"buffer_cells": 4}}
    wide = accept(TINY, **{"grid.buffer_cells": 6}).in_elastic_rock()
    assert wide.settings.grid.buffer_cells == 6
    assert mine.settings.materials["host"].model == "coulomb"


def test_what_stages_are_given_follows_from_the_mine_file(tmp_path):
    """Strength of failed rock and radii by cells where nothing is given; the record's box; states in order."""
    mine_baselines = baselines_of(TINY, tmp_path)
    flaws = FlawSlice.of(mine_baselines.flaws_slice())
    assert flaws.strength["host"].given() == {"friction_angle": 20.0, "cohesion": 0.5e6}
    assert flaws.radii == (2.5, 30.0)
    assert flaws.lower is None
    assert [path.removeprefix("results/tiny/elastic_rock/") for path in mine_baselines.states()] == [
        "elastic.nc",
        "steps/history.nc",
        "steps/2019-08.nc",
    ]
    assert BaselineReportSlice.of(mine_baselines.report_slice()).planned == ("stope_2",)
    given = {
        "baselines": {"radii": ["1 m", "9 m"], "friction_angle": "25 deg", "cohesion": "0 MPa", "exponent": 2.5},
        "record.filter": {"lower": ["10 m", "10 m", "10 m"], "upper": ["70 m", "70 m", "70 m"]},
        "ensemble": 2,
    }
    mine_baselines = baselines_of(changed(TINY, **given), tmp_path)
    flaws = FlawSlice.of(mine_baselines.flaws_slice())
    assert flaws.strength["host"].given() == {"friction_angle": 25.0, "cohesion": 0.0}
    assert (flaws.radii, flaws.exponent, flaws.upper) == ((1.0, 9.0), 2.5, (70.0, 70.0, 70.0))
    assert StressSlice.of(mine_baselines.excess_shear_slice()).strength == flaws.strength
    assert "members" not in mine_baselines.report_slice()["comparison"]


def test_forecasts_for_pycsep_need_a_place_on_earth(tmp_path):
    """The stage gets frame and depths below sea level of a mine that has one."""
    without = baselines_of(changed(TINY, frame={"surface": TINY["frame"]["surface"]}), tmp_path)
    assert not without.has_place
    assert BaselineReportSlice.of(without.report_slice()).frame is None
    located = baselines_of(TINY, tmp_path)
    assert located.has_place
    settings = BaselineReportSlice.of(located.report_slice())
    assert settings.frame.latitude == TINY["frame"]["latitude"]
    lower, upper = (float(TINY["domain"][key][2].split()[0]) for key in ("lower", "upper"))
    assert settings.depths == (-upper, -lower)


def test_a_rock_without_friction_angle_needs_one(tmp_path):
    """Hoek-Brown's curve has none; with both keys it has flaws all the same."""
    mine = changed(TINY, **{"materials.host": HOEK_BROWN})
    with pytest.raises(SystemExit, match=r"baselines\.friction_angle: missing key.*materials\.host.*hoek_brown"):
        baselines_of(mine, tmp_path).flaws_slice()
    given = changed(mine, baselines={"friction_angle": "30 deg", "cohesion": "1 MPa"})
    assert baselines_of(given, tmp_path).strength == {"host": {"friction_angle": 30.0, "cohesion": 1e6}}


@pytest.mark.parametrize(
    ("mine", "problem"),
    [
        ({key: value for key, value in TINY.items() if key != "record"}, "record: missing"),
        (FLAT | {"record": TINY["record"]}, "plane: xz"),
        (changed(TINY, **{"materials.host": {**TINY["materials"]["fill"]}}), "materials: no rock can fail"),
    ],
)
def test_mines_without_baselines_are_refused(mine, problem, tmp_path):
    """In one line, when their states or strengths are asked for."""
    mine_baselines = baselines_of(mine, tmp_path)
    with pytest.raises(SystemExit, match=problem) as refused:
        assert [mine_baselines.states(), mine_baselines.flaws_slice()]
    assert "\n" not in str(refused.value)


def test_the_record_is_read_again_from_an_earlier_date_on(tmp_path):
    """With all other filters, in the box that maps are compared in: that of the record within the domain."""
    mine_baselines = baselines_of(TINY, tmp_path)
    assert mine_baselines.earlier_record() == "results/tiny/record.nc"
    domain = TINY["domain"]
    assert mine_baselines.report_slice()["box"] == [
        [float(end.split()[0]) for end in domain[key][:2]] for key in ("lower", "upper")
    ]
    given = {
        "record.filter": {"lower": ["10 m", "-1 km", "10 m"], "start": "2019-08-05", "end": "2019-08-20"},
        "baselines": {"since": "2019-07-01", "complete_above": "10 mm^3"},
    }
    mine_baselines = baselines_of(changed(TINY, **given), tmp_path)
    assert mine_baselines.earlier_record() == "results/tiny/baselines/record.nc"
    slice_ = mine_baselines.earlier_record_slice()
    assert slice_["period"] == {"start": "2019-07-01", "end": "2019-09-01"}
    assert slice_["filter"] == {"lower": [10.0, -1000.0, 10.0], "end": "2019-08-20"}
    alone = changed(TINY, **{"record.filter": {"start": "2019-08-05"}, "baselines": {"since": "2019-07-01"}})
    assert "filter" not in baselines_of(alone, tmp_path).earlier_record_slice()  # the later of both dates counts
    assert mine_baselines.report_slice()["box"][0] == [10.0, float(domain["lower"][1].split()[0])]
    assert mine_baselines.report_slice()["since"] == "2019-07-01"
    assert mine_baselines.report_slice()["complete_above"] == pytest.approx(1e-8)


def test_the_cost_of_baselines_is_told_once_before_they_run(tmp_path, monkeypatch, capsys):
    """Three elastic states, each as long as the mine's own one of a minute; each baseline as long as last time."""
    monkeypatch.chdir(tmp_path)
    baselines_of(TINY, tmp_path).report_slice()
    assert capsys.readouterr().err == (
        "tiny: baselines need 3 elastic states (time not known yet), flaws (time not known yet), excess_shear (time "
        "not known yet); first 2 steps of the mine itself\n"
    )

    def write(path: str, seconds: float = 0.0) -> None:
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(f"{Costs(seconds, seconds, 0.0, 900.0).closing_line('stage')}\n")

    for step in ("history", "2019-08"):
        write(f"results/tiny/steps/{step}.nc")
    write("logs/tiny/elastic.log", 60.0)
    write("logs/tiny/baselines/flaws.log", 300.0)
    write("logs/tiny/baselines/excess_shear.log", 20.0)
    told = baselines_of(TINY, tmp_path)
    told.report_slice()
    assert capsys.readouterr().err == (
        "tiny: baselines need 3 elastic states (about 3 min), flaws (about 5 min), excess_shear (about 20 s)\n"
    )
    for path in (*told.states(), "results/tiny/baselines/flaws_runs.nc"):
        write(path)
    told.report_slice()
    assert capsys.readouterr().err == ""
    baselines_of(TINY, tmp_path).report_slice()
    assert capsys.readouterr().err == "tiny: baselines need excess_shear (about 20 s)\n"
    write("results/tiny/baselines/excess_shear_runs.nc")
    baselines_of(TINY, tmp_path).report_slice()
    assert capsys.readouterr().err == ""


def test_a_face_reaches_the_comparison_and_is_checked(accept, refuse, monkeypatch):
    """Positions in metres; a panel that begins after the steps is left out."""
    later = (
        {"date": "2019-09-01", "panel": "next", "ends": ["0 m", "0 m"]},
        {
            "date": "2019-10-01",
            "panel": "next",
            "ends": ["9 m", "0 m"],
        },
    )
    mine = accept(TINY, face={"positions": [*FACE["positions"], *later]})
    face = mine.comparison_slice()["face"]
    assert [one["date"] for one in face] == ["2019-07-01", "2019-08-01", "2019-09-01"]
    assert face[1]["ends"] == [[30.0, 30.0], [30.0, 70.0]]
    early = {"positions": [one | {"date": one["date"].replace("2019", "2018")} for one in FACE["positions"]]}
    assert refuse(TINY, face=early).startswith(
        "face: no position before and after the end of any dated step (2019-09-01)"
    )
    assert refuse(FLAT, face=FACE).startswith("face: its positions are in plan")
    undated = [{"name": step["name"]} for step in TINY["steps"]]
    assert refuse(TINY, face=FACE, steps=undated).startswith("face: no step has dates")
    monkeypatch.delenv("ELK_CREEK_DATA", raising=False)
    assert refuse(TINY, face={"source": "elk_creek", "folder": "nowhere"}).startswith("face.folder: ")


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"radii": ["9 m", "1 m"]}, "baselines.radii: 9 m to 1 m is empty; give the smaller radius first"),
        ({"radii": ["9 m", "50 m"]}, "baselines.radii: a flaw with a radius of 50 m does not fit into the domain"),
        ({"since": "2019-13-45"}, "baselines.since: '2019-13-45' is not a date (month must be in 1..12)"),
        ({"since": "2019-07-01T25:00"}, "baselines.since: '2019-07-01T25:00' is not a date (hour must be in 0..23)"),
        ({"since": "1066-01-01"}, "baselines.since: 1066-01-01: give a year from 1678 to 2261"),
        ({"since": "2019-08-02"}, "baselines.since: 2019-08-02 is after the first dated step begins, 2019-08-01"),
        ({"since": "2019-10-01"}, "baselines.since: 2019-10-01 is after the first dated step begins, 2019-08-01"),
    ],
)
def test_wrong_keys_are_refused_when_the_mine_file_is_read(values, line, refuse):
    """In one line, by every command, before anything runs."""
    assert refuse(TINY, baselines=values).startswith(line)


@pytest.mark.parametrize("key", ["start", "end"])
def test_a_wrong_date_of_a_plan_is_refused_when_the_mine_file_is_read(key, refuse):
    """As those of the mine's own steps are."""
    step = {"name": "2019-09", "start": "2019-09-01", "end": "2019-10-01", key: "2019-02-30"}
    line = refuse(TINY, plans={"longer": {"steps": [step]}})
    assert line.startswith(f"plans.longer.steps.2019-09.{key}: '2019-02-30' is not a date")


@pytest.mark.slow
def test_baselines_of_the_tiny_mine(spoiled, base):
    """Beside results that stand, with a record of larger events: elastic steps, catalogues, page and table. A second
    call has nothing to do."""
    results = spoiled / "results/tiny"
    steps = {path: digest for path, digest in hashes(results).items() if path.startswith("steps/")}
    given = {"record.file": "large.csv", "record.twin": True, "face": FACE, "baselines": {"since": "2019-07-01"}}
    mine = changed(TINY, **given)
    random = np.random.default_rng(2)
    rows = [
        f"2019-{7 + number % 2:02d}-{number // 2 % 30 + 1:02d}T06:00:00,{x:.2f},{y:.2f},{z:.2f},"
        f"{random.exponential(0.3) - 1.4:.3f}"
        for number, (x, y, z) in enumerate(random.uniform([25, 35, 20], [50, 60, 55], (120, 3)))
    ]
    (base / "files/large.csv").write_text("\n".join(["date,x,y,z,size", *rows, ""]))
    with edited(base / "files" / "tiny.yaml", mine) as file:
        status, text = snakemake(file, spoiled, "baselines")
        again = snakemake(file, spoiled, "--dry-run", "baselines")
    assert status == 0, text
    assert "Nothing to be done" in again[1]
    after = hashes(results)
    assert {path: after[path] for path in steps} == steps

    elastic = xr.open_dataset(results / "elastic_rock/steps/2019-08.nc")
    assert (elastic["failed"] < 0).all()
    own = xr.open_dataset(results / "steps/2019-08.nc")
    rock = [float(state["volume"].values[state["excavation"].values < 0].sum()) for state in (elastic, own)]
    assert rock[0] == pytest.approx(rock[1], rel=1e-6)

    recorded = int(xr.open_dataset(results / "comparison.nc")["events_above_cut"].sel(catalogue="record"))
    assert recorded > 20
    for name in ("flaws", "excess_shear"):
        catalog, runs = (xr.open_dataset(results / f"baselines/{name}{part}.nc") for part in ("", "_runs"))
        assert runs.sizes["event"] / runs.attrs["runs"] == pytest.approx(recorded, rel=0.5)
        assert catalog.sizes["event"] == int((runs["run"] == 0).sum())
    page = (results / "baselines/report.html").read_text()
    assert "The record is a twin" in page
    assert "model places recorded events" in page or "too few independent clusters" in page
    with open(results / "baselines/scores.csv") as file:
        table = list(csv.DictReader(file))
    assert [row["model"] for row in table if row["step"] == "all"] == [
        "Pipeline",
        "Seeded flaws",
        "Excess shear stress",
    ]
    assert all(np.isfinite(float(row["gain, nats per event"])) for row in table)

    earlier, own = (xr.open_dataset(results / name) for name in ("baselines/record.nc", "record.nc"))
    assert earlier.sizes["event"] > 1.5 * own.sizes["event"]
    with open(results / "baselines/months.csv") as file:
        gains = {row["map"]: float(row["gain, nats per event"]) for row in csv.DictReader(file) if row["step"] == "all"}
    assert {"all_earlier", "last", "line", "Pipeline", "mixed", "ceiling"} < set(gains)
    assert all(np.isfinite(gain) for gain in gains.values())
    with open(results / "baselines/rates.csv") as file:
        (rates,) = csv.DictReader(file)
    assert float(rates["metres"]) == pytest.approx(30.0)
    assert float(rates["expected events, all earlier by metres"]) > 0.0
    with open(results / "baselines/alerts.csv") as file:
        rows = [row for row in csv.DictReader(file) if row["step"] == "all" and row["on alert"] == "rock"]
    skills = {row["map"]: float(row["area skill score"]) for row in rows}
    assert set(skills) == set(gains) - {"ceiling"}
    assert all(0.0 <= skill <= 1.0 for skill in skills.values())
    forecasts = sorted((results / "baselines/csep").glob("*.dat"))
    assert [path.name for path in forecasts if path.name.startswith("last_")] == ["last_2019-08.dat"]
    for path in forecasts:
        expected = float(rates["expected events, all earlier by metres"])
        assert np.loadtxt(path)[:, -2].sum() == pytest.approx(expected, rel=1e-4)
    assert "face_measure" in xr.open_dataset(results / "comparison.nc")
