"""A stage that fails or is killed takes what can be made again, but no forecast, also without Snakemake's notes."""

import shutil
from pathlib import Path

import pytest
import xarray as xr
from stand_ins import KILLED, ending
from test_plan_runs import PLANNED
from tiny_mines import changed, hashes, snakemake, write_mine

from common.datasets import write_dataset
from common.errors import InputError
from common.job import Job
from workflow.stages import plans

ENDINGS = {
    "killed": KILLED,
    "an error": "exit 1",
    "a full disk": 'ulimit -f 0; exec "{interpreter}" "$@"',
    "Snakemake killed": "kill -KILL $PPID; sleep 2; exit 1",
}
RESULTS = {"plans": "plans/longer/outcome.nc", "baselines": "baselines/flaws.nc"}
CASES = [("plans", how) for how in ENDINGS] + [("baselines", "killed")]


@pytest.fixture(scope="module")
def made(tmp_path_factory, leave_empty) -> Path:
    """Folder of a run of plans and baselines whose results are empty, and of the mine's file; with kept forecasts."""
    folder = tmp_path_factory.mktemp("made")
    file = write_mine(PLANNED, folder / "files/tiny.yaml")
    status, text = snakemake(file, folder / "run", *RESULTS, interpreter=leave_empty)
    assert status == 0, text
    forecasts = folder / "run/results/tiny/forecasts"
    forecasts.mkdir()
    (forecasts / "2019-08-31_longer_0123.nc").write_text("what was said in August")
    return folder


@pytest.mark.parametrize("has_notes", [True, False], ids=["", "without .snakemake"])
@pytest.mark.parametrize(("target", "how"), CASES)
def test_forecasts_stand_and_the_rest_is_made_again(target, how, has_notes, made, tmp_path, leave_empty):
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    folder, results = tmp_path / "run", tmp_path / "run/results/tiny"
    shutil.rmtree(folder / ".snakemake/mine_files")  # they name the file of the first folder
    kept, before = hashes(results / "forecasts"), hashes(results)
    file = write_mine(changed(PLANNED, **{"seismic.closeness": 0.6}), tmp_path / "files/tiny.yaml")
    if not has_notes:
        shutil.rmtree(folder / ".snakemake")
    ends = ending(f"results/tiny/{RESULTS[target]}", ENDINGS[how], tmp_path, leave_empty)
    status, text = snakemake(file, folder, target, interpreter=ends)
    assert status != 0
    assert (tmp_path / "once").is_dir(), text
    assert hashes(results / "forecasts") == kept
    if not has_notes:
        shutil.rmtree(folder / ".snakemake")
    elif how.startswith("Snakemake"):
        snakemake(file, folder, "--unlock")
    status, text = snakemake(file, folder, target, interpreter=leave_empty)
    assert status == 0, text
    after = hashes(results)
    assert hashes(results / "forecasts") == kept
    assert set(after) == set(before)
    assert after[RESULTS[target]] != before[RESULTS[target]]


@pytest.fixture
def plan_job(tmp_path, monkeypatch) -> Job:
    """The job of an outcome, whose computation is left out."""
    outcome = xr.Dataset({"chance": ("size", [0.1, 0.2])}, attrs={"plan": "longer"})
    monkeypatch.setattr("plans.outcome.outcome_stage", lambda *_, **__: outcome)
    output = tmp_path / "results/tiny/plans/longer/outcome.nc"
    return Job("plan_outcome", {"plan": "longer"}, {"grid": [str(tmp_path / "grid.nc")]}, "code", {}, (output,))


def test_a_forecast_is_kept_before_its_outcome_is_written(plan_job, tmp_path, monkeypatch):
    """What ends the stage between the two leaves the kept file, and the next run makes no second one of it."""
    output = plan_job.output()

    def full(dataset: xr.Dataset, path: Path) -> None:
        if path == output:
            raise InputError("the disk is full")
        write_dataset(dataset, path)

    monkeypatch.setattr("common.datasets.write_dataset", full)
    with pytest.raises(InputError):
        plans.plan_outcome(plan_job)
    folder = tmp_path / "results/tiny/forecasts"
    (kept,) = folder.iterdir()
    content = kept.read_bytes()
    monkeypatch.setattr("common.datasets.write_dataset", write_dataset)
    kept.rename(folder / f"2019-08-31{kept.name[10:]}")  # made on another day
    plans.plan_outcome(plan_job)
    (kept,) = folder.iterdir()
    assert kept.name.startswith("2019-08-31_longer_")
    assert output.read_bytes() == kept.read_bytes() == content
