"""`snakemake plans` for the tiny mine: what runs, what is shared, what stands after it."""

import contextlib
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from stand_ins import program
from tiny_mines import FLAT, NEXT_STEP, STILL, TINY, changed, edited, hashes, jobs, merged, snakemake, write_mine

from calibration.mine_files import stamped
from common.job import read_job
from workflow.calibration_trials import CalibrationTrials
from workflow.configuration import load

PLANS = {
    "swapped": {
        "excavations": {"stope_1": {"step": "2019-09"}, "stope_2": {"step": "2019-08"}},
        "steps": [NEXT_STEP],
    },
    "longer": {"excavations": {"stope_2": {"step": "2019-09"}}, "steps": [NEXT_STEP]},
}
HAZARD = {
    "distances": ["5 m", "15 m"],
    "magnitudes": {"small": -1.5, "large": 0.5},
    "likelihoods": {"rare": 0, "likely": 0.5},
    "runs": 1,
}
PLANNED = changed(TINY, plans=PLANS, hazard=HAZARD)


@pytest.fixture(scope="module")
def planned(undisturbed, base) -> tuple[Path, str]:
    """Folder and terminal text of a run of `plans` beside results that stand."""
    folder = base / "planned"
    shutil.copytree(undisturbed[0], folder)
    with edited(base / "files" / "tiny.yaml", PLANNED) as file:
        status, text = snakemake(file, folder, "plans")
    assert status == 0, text
    return folder, text


@pytest.mark.slow
def test_plans_of_the_tiny_mine(planned, undisturbed, base):
    """Only steps that differ are computed; the mine's own results stay as they are; a second call has nothing to do;
    another class of chance makes no step again."""
    folder, text = planned
    results = folder / "results/tiny"
    assert jobs(text) == {"step": 3, "events": 2, "plan_outcome": 3, "plan_openings": 3, "plans": 1}
    with edited(base / "files" / "tiny.yaml", PLANNED) as file:
        again = snakemake(file, folder, "--dry-run", "plans")
    assert "Nothing to be done" in again[1]
    before, after = hashes(undisturbed[0] / "results/tiny"), hashes(results)
    assert {name: after[name] for name in before} == before
    made = {f"plans/{plan}/steps/{step}.nc" for plan, step in (("swapped", "2019-08"), ("swapped", "2019-09"))}
    made |= {"plans/longer/steps/2019-09.nc", "plans/plans.csv"}
    made |= {f"plans/{plan}/events/{step}.nc" for plan in PLANS for step in ("history", "2019-08", "2019-09")}
    made |= {f"plans/{plan}/{name}.nc" for plan in PLANS for name in ("outcome", "catalog")}
    made |= {"plans/mine_file/outcome.nc"}
    made |= {f"plans/{plan}/opening{end}" for plan in ("mine_file", *PLANS) for end in ("s.nc", "s.csv", "_runs.nc")}
    kept = {name for name in after if name.startswith("forecasts/")}
    assert len(kept) == 3
    assert set(after) - set(before) - kept == made

    outcome = {plan: xr.open_dataset(results / f"plans/{plan}/outcome.nc") for plan in ("mine_file", *PLANS)}
    own, longer = outcome["mine_file"], outcome["longer"]
    assert longer.step.values.tolist() == ["2019-08", "2019-09"]
    for name in ("whole_potency", "energy_released", "failed_volume"):
        assert float(longer[name][0, 0]) == float(own[name][0, 0])
    events = [xr.open_dataset(results / f"{folder}events/{step}.nc") for folder, step in (
        ("", "2019-08"), ("plans/longer/", "2019-09"))]  # fmt: skip
    assert longer.whole_potency[0].values.tolist() == [float(one.potency.sum()) for one in events]

    page = (results / "plans/report.html").read_text()
    assert all(plan in page for plan in PLANS)

    other = changed(PLANNED, **{"hazard.magnitudes": {"small": -1.0}})
    with edited(base / "files" / "tiny.yaml", other) as file:
        _, text = snakemake(file, folder, "--dry-run", "plans")
    assert jobs(text) == {"plan_outcome": 3, "plans": 1}


@pytest.mark.slow
def test_a_kept_forecast_is_scored_when_its_month_is_recorded(planned, base):
    """The plan's month becomes the mine's: the report says what was forecast and what came. A forecast that is made
    again with the longer record is none."""
    folder, files = base / "a kept forecast", base / "files"
    shutil.copytree(planned[0], folder)
    results = folder / "results/tiny"
    shutil.copy(results / "plans/longer/outcome.nc", files / "said.nc")

    months = [
        f"{month}-{day:02d}T06:00:00,{40 + day % 7},{45 + day % 5},{38 + day % 9},{-2 + 0.1 * (day % 11)}"
        for month in ("2019-08", "2019-09")
        for day in range(1, 31)
    ]
    (files / "longer.csv").write_text("\n".join(["date,x,y,z,size", *months, ""]))
    mined = changed(TINY, forecasts=["said.nc"], **{"excavations.2.step": "2019-09", "record.file": "longer.csv"})
    mined["steps"].append(NEXT_STEP)
    with edited(files / "tiny.yaml", mined) as file:
        status, text = snakemake(file, folder, "results/tiny/report.html")
    assert status == 0, text
    assert jobs(text)["comparison"] == 1
    scores = xr.open_dataset(results / "forecast_scores.nc")
    assert dict(zip(scores.step.values, scores.status.values, strict=True))["2019-09"] == "scored"
    assert scores.recorded.sel(quantity="number")[scores.step.values == "2019-09"].item() > 0
    page = (results / "report.html").read_text()
    assert "Forecast for 2019-09 (plan longer, said.nc):" in page
    assert "No forecast was kept" not in page

    with edited(files / "tiny.yaml", changed(mined, forecasts=["gone.nc"])) as file:
        status, text = snakemake(file, folder, "--dry-run")
    assert status != 0
    assert "forecasts.0: " in text
    assert "gone.nc: no such file" in text


@pytest.mark.parametrize(
    ("mine", "line"),
    [
        (STILL, "steps: none has dates; plans are compared by dated steps"),
        (FLAT, "plane: xz; plans need a mine in three"),
    ],
)
def test_mines_without_plans_are_refused(mine, line, tmp_path):
    """In one line."""
    file = write_mine(mine, tmp_path / "mine.yaml")
    status, text = snakemake(file, tmp_path, "--dry-run", "plans")
    assert status != 0
    assert line in text
    assert "Traceback" not in text


# In place of the interpreter that runs the stages: in drawn rock a stage takes what the same stage has made in the
# mine's own rock, with more energy by tenths.
IN_DRAWN_ROCK = f"""#!{sys.executable}
import os, re, runpy, shutil, sys
from pathlib import Path
sys.path.insert(0, os.environ["PYTHONPATH"])
sys.argv = sys.argv[2:]
outputs = sys.argv[sys.argv.index("--output") + 1 : sys.argv.index("--log")]
if drawn := re.search("drawn_rock/([0-9])/", outputs[0]):
    for output in outputs:
        Path(output).parent.mkdir(parents=True, exist_ok=True)
        own = output.replace(drawn[0], "")
        if "/steps/" in own:
            from common.datasets import read_dataset, write_dataset
            state = read_dataset(own)
            state.attrs["energy_released"] *= 1.0 + int(drawn[1]) / 10.0
            write_dataset(state, output)
        elif Path(own).is_dir():
            shutil.copytree(own, output, dirs_exist_ok=True)
        else:
            shutil.copy(own, output)
else:
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
"""


@pytest.mark.slow
def test_plans_in_rock_that_a_calibration_has_drawn(planned, base, tmp_path):
    """Each plan in each drawn rock, on the mine's grid; what the intervals contain says so. Without the draws the run
    ends in one line."""
    folder = base / "drawn rock"
    shutil.copytree(planned[0], folder)
    quantity = {"key": "materials.host.cohesion.residual", "range": ["0.3 MPa", "0.8 MPa"], "source": "made up"}
    values = {"plans": {"swapped": PLANS["swapped"]}, "hazard.rock": "posterior"}
    mine = changed(PLANNED, calibration={"trials": 8, "quantities": [quantity]}, **values)
    other = changed(mine, **{"calibration.quantities": [{**quantity, "range": ["0.2 MPa", "0.8 MPa"]}]})
    results, residual = folder / "results/tiny", {draw: 0.25e6 + 0.1e6 * draw for draw in range(1, 6)}
    with edited(base / "files" / "tiny.yaml", mine) as file:
        status, text = snakemake(file, folder, "--dry-run", "plans")
        assert status != 0
        assert "hazard.rock: there is no results/tiny/calibration/draw_1.yaml; run `snakemake calibrate` first" in text
        for draw, value in residual.items():
            drawn = changed(TINY, **{"materials.host.cohesion.residual": f"{value:g} Pa"})
            write_mine(drawn, results / f"calibration/draw_{draw}.yaml")
        with contextlib.chdir(folder):
            posterior = CalibrationTrials(load(merged(mine), file), file).posterior_hash
        for path in (results / "calibration").glob("draw_*.yaml"):
            path.write_text(stamped(path.read_text(), posterior))
    with edited(base / "files" / "tiny.yaml", other) as file:
        status, text = snakemake(file, folder, "--dry-run", "plans")
        assert status != 0
        assert "calibration/draw_1.yaml is of another calibration than this file asks for" in text
    with edited(base / "files" / "tiny.yaml", mine) as file:
        stages = program(IN_DRAWN_ROCK, tmp_path / "in_drawn_rock")
        status, text = snakemake(file, folder, "plans", interpreter=stages)
    assert status == 0, text
    # in each rock two steps of either plan, which share history
    assert jobs(text) == {"elastic": 5, "step": 20, "events": 10, "plan_outcome": 2, "plans": 1}
    for draw, value in residual.items():
        for place in (f"drawn_rock/{draw}", f"plans/swapped/drawn_rock/{draw}"):
            (job,) = (results / place / "jobs/step/2019-08").glob("*.json")
            assert read_job(job).settings["materials"]["host"]["cohesion"]["residual"] == pytest.approx(value)
    for plan, place in (("mine_file", results), ("swapped", results / "plans/swapped")):
        outcome = xr.open_dataset(results / f"plans/{plan}/outcome.nc")
        assert outcome.run_kind.values.tolist() == ["own", *["draw"] * 5]
        released = xr.open_dataset(place / "steps/2019-08.nc").energy_released
        np.testing.assert_allclose(outcome.energy_released[:, 0], released * np.array([1, 1.1, 1.2, 1.3, 1.4, 1.5]))
    assert not (results / "drawn_rock/1/grid.nc").exists()
    page = (results / "plans/report.html").read_text()
    assert "Intervals do not contain what is not known of the rock" not in page
