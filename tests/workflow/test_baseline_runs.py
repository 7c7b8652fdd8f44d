"""`snakemake baselines` for the tiny mine: rock that does not fail, what it refuses, page, table and catalogues."""

import csv

import numpy as np
import pytest
import xarray as xr
from tiny_mines import FLAT, TINY, changed, edited, hashes, merged, snakemake, write_mine

from baselines.settings import BaselineReportSlice, FlawSlice, StressSlice
from workflow.baseline_plans import BaselinePlan
from workflow.configuration import load
from workflow.folders import Folders

HOEK_BROWN = {
    "model": "hoek_brown",
    **{key: TINY["materials"]["host"][key] for key in ("youngs_modulus", "poisson_ratio", "density", "dilation_angle")},
    "sigma_ci": {"intact": "100 MPa", "residual": "100 MPa"},
    "gsi": {"intact": 60, "residual": 30},
    "mi": {"intact": 15, "residual": 15},
    "disturbance": {"intact": 0, "residual": 0},
    "tension_cutoff": "none",
}


def plan_of(mine: dict, tmp_path) -> BaselinePlan:
    """What a mine's file asks for."""
    file = write_mine(mine, tmp_path / "mine.yaml")
    return BaselinePlan(load(merged(mine), file), file)


def test_rock_of_the_variant_does_not_fail_and_all_else_is_the_mines(accept):
    """More rings of cells, since none are split where rock nears its strength; strength is not there, fill is."""
    mine = accept(TINY)
    variant = Folders(mine).mine_at("tiny/elastic_rock")
    own, elastic = mine.scene_slice(1), variant.scene_slice(1)
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
    plan = plan_of(TINY, tmp_path)
    flaws = FlawSlice.of(plan.flaws_slice())
    assert flaws.strength["host"].given() == {"friction_angle": 20.0, "cohesion": 0.5e6}
    assert flaws.radii == (2.5, 30.0)
    assert flaws.lower is None
    assert [path.removeprefix("results/tiny/elastic_rock/") for path in plan.states()] == [
        "elastic.nc",
        "steps/history.nc",
        "steps/2019-08.nc",
    ]
    assert BaselineReportSlice.of(plan.report_slice()).planned == ("stope_2",)
    given = {
        "baselines": {"radii": ["1 m", "9 m"], "friction_angle": "25 deg", "cohesion": "0 MPa", "exponent": 2.5},
        "record.filter": {"lower": ["10 m", "10 m", "10 m"], "upper": ["70 m", "70 m", "70 m"]},
        "ensemble": 2,
    }
    plan = plan_of(changed(TINY, **given), tmp_path)
    flaws = FlawSlice.of(plan.flaws_slice())
    assert flaws.strength["host"].given() == {"friction_angle": 25.0, "cohesion": 0.0}
    assert (flaws.radii, flaws.exponent, flaws.upper) == ((1.0, 9.0), 2.5, (70.0, 70.0, 70.0))
    assert StressSlice.of(plan.excess_shear_slice()).strength == flaws.strength
    assert plan.member_events() == [f"results/tiny/ensemble/{n}/events/2019-08.nc" for n in (1, 2)]
    assert "members" not in plan.report_slice()["comparison"]


def test_a_rock_without_friction_angle_needs_one(tmp_path):
    """Hoek-Brown's curve has none; with both keys it has flaws all the same."""
    mine = changed(TINY, **{"materials.host": HOEK_BROWN})
    with pytest.raises(SystemExit, match=r"baselines\.friction_angle: missing key.*materials\.host.*hoek_brown"):
        plan_of(mine, tmp_path).flaws_slice()
    given = changed(mine, baselines={"friction_angle": "30 deg", "cohesion": "1 MPa"})
    assert plan_of(given, tmp_path).strength == {"host": {"friction_angle": 30.0, "cohesion": 1e6}}


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
    plan = plan_of(mine, tmp_path)
    with pytest.raises(SystemExit, match=problem) as refused:
        assert [plan.states(), plan.flaws_slice()]
    assert "\n" not in str(refused.value)


def test_wrong_radii_are_refused(refuse):
    """In one line."""
    line = refuse(TINY, baselines={"radii": ["9 m", "1 m"]})
    assert line == "baselines.radii: 9 m to 1 m is empty; give the smaller radius first"


@pytest.mark.slow
def test_baselines_of_the_tiny_mine(spoiled, base):
    """Beside results that stand, with a record of larger events: elastic steps, catalogues, page and table. A second
    call has nothing to do, and a plain run takes nothing of it for left over."""
    results = spoiled / "results/tiny"
    steps = {path: digest for path, digest in hashes(results).items() if path.startswith("steps/")}
    mine = changed(TINY, **{"record.file": "large.csv", "record.twin": True})
    random = np.random.default_rng(2)
    rows = [
        f"2019-08-{day % 30 + 1:02d}T06:00:00,{x:.2f},{y:.2f},{z:.2f},{random.exponential(0.3) - 1.4:.3f}"
        for day, (x, y, z) in enumerate(random.uniform([25, 35, 20], [50, 60, 55], (60, 3)))
    ]
    (base / "files/large.csv").write_text("\n".join(["date,x,y,z,size", *rows, ""]))
    with edited(base / "files" / "tiny.yaml", mine) as file:
        status, text = snakemake(file, spoiled, "baselines")
        again = snakemake(file, spoiled, "--dry-run", "baselines")
        plain = snakemake(file, spoiled)
    assert status == 0, text
    assert "Nothing to be done" in again[1]
    assert plain[0] == 0, plain[1]
    assert "not part of the mine file's plan" not in plain[1]
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
    assert "Recorded events are placed best by" in page or "No model places recorded events" in page
    with open(results / "baselines/scores.csv") as file:
        table = list(csv.DictReader(file))
    assert [row["model"] for row in table if row["step"] == "all"] == [
        "Pipeline",
        "Seeded flaws",
        "Excess shear stress",
    ]
    assert all(np.isfinite(float(row["gain, nats per event"])) for row in table)
