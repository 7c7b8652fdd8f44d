"""A job is a file: any settings, named by its content, damaged ones refused, and what it was made from."""

import dataclasses
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from large_mines import large_mine
from tiny_mines import ROOT, TINY, changed, edited, merged, snakemake, write_mine

from common.datasets import write_dataset
from common.errors import InputError
from common.job import MADE_FROM, Job, config_hash, content_of, files_of, read_job, remove_earlier, stage_of, write_job
from workflow.__main__ import main
from workflow.configuration import load
from workflow.stages import IMPORTS, package_hash, stages

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=20,
)


@settings(deadline=None)
@given(st.dictionaries(st.text(), VALUES))
def test_what_is_read_is_what_was_written(tmp_path_factory, values):
    """Any values, character by character."""
    folder = tmp_path_factory.mktemp("jobs")
    job = read_job(write_job(folder, "step", "2019-08", values, {"grid": ["grid.nc"]}, "code"))
    assert (job.stage, job.settings, job.inputs, job.code) == ("step", values, {"grid": ["grid.nc"]}, "code")
    assert config_hash(job.settings) == config_hash(values)


def test_a_name_depends_on_the_content_alone_and_earlier_jobs_go_when_one_runs(tmp_path):
    """What has not changed is not written again; the jobs of other stages and steps stay."""
    names = [
        write_job(tmp_path, *stage, {"value": 1}, {}, "") for stage in (("grid", ""), ("step", "8"), ("step", "8.1"))
    ]
    before = os.stat(names[0]).st_mtime_ns
    assert write_job(tmp_path, "grid", "", {"value": 1}, {}, "") == names[0]
    assert os.stat(names[0]).st_mtime_ns == before
    later = write_job(tmp_path, "step", "8", {"value": 2}, {}, "")
    assert Path(names[1]).is_file()
    remove_earlier(later)
    assert {str(path) for path in tmp_path.rglob("*.json")} == {names[0], names[2], later}
    assert [stage_of(name, ("grid", "step")) for name in names] == ["grid", "step", "step"]


@pytest.mark.parametrize("path", ["results/jobs/jobs/step/jobs/0.json", "results/m/jobs/step/grid/0.json"])
def test_a_mine_or_a_step_may_be_named_as_the_folder_or_as_a_stage(path):
    assert stage_of(path, ("grid", "step")) == "step"
    assert stage_of("results/step/grid.json", ("grid", "step")) == ""


def test_a_job_written_while_another_ran_is_written_again(monkeypatch, tmp_path):
    """By a dry run with other settings. Else it would be older than results that it does not describe."""
    running = write_job(tmp_path, "grid", "", {"value": 1}, {}, "")

    def run(job: Job) -> None:
        write_job(tmp_path, "grid", "", {"value": 2}, {}, "")

    monkeypatch.setitem(stages(), "grid", dataclasses.replace(stages()["grid"], run=run))
    # The stage's log, and its end with the process that started it, would stay with this one.
    monkeypatch.setattr("workflow.__main__.run_stage", lambda name, log, function, does: function())
    monkeypatch.setattr(sys, "argv", ["workflow", running, "--output", str(tmp_path / "grid.nc")])
    main()
    assert [str(path) for path in tmp_path.rglob("*.json")] == [running]


@pytest.mark.parametrize("content", [None, "", "{", "[1]"])
def test_an_unreadable_job_is_one_line(tmp_path, content):
    """With the file, and what to do."""
    path = tmp_path / "jobs/grid/0123.json"
    path.parent.mkdir(parents=True)
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=r"0123\.json: .*; jobs stand in results"):
        read_job(path)


def test_a_damaged_job_is_refused(tmp_path):
    """Its name says what was written."""
    path = Path(write_job(tmp_path, "grid", "", {"value": 1}, {}, ""))
    path.write_text(path.read_text().replace("1", "2", 1))
    with pytest.raises(InputError, match="damaged: its content is not what was written"):
        read_job(path)


def test_no_room_for_a_job_is_one_line(tmp_path):
    """And no half file."""
    script = (
        "import resource; from common.job import write_job; "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (300, resource.RLIM_INFINITY)); "
        f"write_job({str(tmp_path)!r}, 'grid', '', {{'numbers': list(range(1000))}}, {{}}, '')"
    )
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode != 0
    assert f"InputError: the disk is full: no room in {tmp_path / 'jobs/grid'}" in run.stderr.splitlines()[-1]
    assert not list((tmp_path / "jobs/grid").iterdir())


def test_a_folder_that_takes_no_job_is_one_line(tiny_file, tmp_path):
    """Told before any stage starts, without a traceback; once it is out of the way the run begins."""
    (tmp_path / "results/tiny").mkdir(parents=True)
    (tmp_path / "results/tiny/jobs").write_text("a file of the user's")
    status, text = snakemake(tiny_file, tmp_path, "results/tiny/record.nc")
    assert status != 0
    assert "results/tiny/jobs/record/" in text
    assert "cannot be written" in text
    assert "Traceback" not in text
    (tmp_path / "results/tiny/jobs").unlink()
    assert snakemake(tiny_file, tmp_path, "results/tiny/record.nc")[0] == 0


def test_a_changed_value_makes_jobs_of_its_stages_alone(spoiled, base, leave_empty):
    """One file for each job, before and after; those that do not depend on the value keep theirs."""
    folder = spoiled / "results/tiny/jobs"
    before = {path.relative_to(folder).as_posix() for path in folder.rglob("*.json")}
    assert {name.rpartition("/")[0] for name in before} == {
        *("grid", "elastic", "step/history", "step/2019-08"),
        *("events", "catalogue", "record", "openings", "comparison", "report"),
    }
    with edited(base / "files" / "tiny.yaml", changed(TINY, **{"record.filter.minimum_potency": "1e-4 m^3"})) as file:
        status, text = snakemake(file, spoiled, interpreter=leave_empty)
    assert status == 0, text
    after = {path.relative_to(folder).as_posix() for path in folder.rglob("*.json")}
    assert {name.rpartition("/")[0] for name in after - before} == {"record", "report"}
    assert len(after) == len(before)


@pytest.mark.slow
def test_a_mine_of_many_excavations_gets_its_grid(tmp_path):
    """760 stopes in 40 steps, their names as long as may be: more than an argument of a command line holds."""
    mine = large_mine(760, 40)
    for entry in mine["excavations"]:
        entry["name"] = entry["name"].ljust(64, "_")
    file = write_mine(mine, tmp_path / "files/large.yaml")
    status, text = snakemake(file, tmp_path / "run", "results/large-760/grid.nc")
    assert status == 0, text
    (job,) = (tmp_path / "run/results/large-760/jobs/grid").iterdir()
    assert len(json.loads(job.read_text())["settings"]["excavations"]) == 760
    assert job.stat().st_size > 131_072


def test_jobs_grow_with_openings_and_steps_and_not_with_their_product():
    """A step's job lists what the step changes, however much was mined before; so does that of the companion."""

    def sizes(excavations: int, steps: int) -> tuple[list[int], int]:
        mine = load(merged(large_mine(excavations, steps)), "large.yaml")
        slices = mine.coarser().run_slices()
        return [len(json.dumps(mine.step_slice(name))) for name in mine.mined_steps], len(json.dumps(slices))

    of_steps, of_companion = sizes(200, 20)
    assert max(of_steps) < 1.02 * of_steps[1]  # numbers and names get longer
    more_steps, more_companion = sizes(400, 40)
    assert max(more_steps) < 1.02 * max(of_steps)
    assert more_companion < 2.05 * of_companion


# ---- what a result is made from ----


def test_the_digest_follows_settings_code_inputs_and_files(tmp_path):
    """Each alone changes it; folder and time of a file do not."""
    solid = tmp_path / "a" / "stope.stl"
    solid.parent.mkdir()
    solid.write_text("solid")
    settings_ = {"excavations": [{"name": "stope", "file": str(solid)}], "levels": 2}
    before = tmp_path / "before.nc"
    write_dataset(xr.Dataset(attrs={MADE_FROM: "0123456789abcdef"}), before)

    def made(values: dict, code: str = "code", inputs: tuple[Path, ...] = (before,), stage: str = "grid") -> str:
        job = read_job(write_job(tmp_path, stage, "", values, {"state": [str(path) for path in inputs]}, code))
        return job.provenance()[MADE_FROM]

    first = made(settings_)
    assert made(settings_ | {"levels": 3}) != first
    assert made(settings_, code="other") != first
    assert made(settings_, stage="elastic") != first
    assert made(settings_, inputs=()) != first
    moved = tmp_path / "b" / "stope.stl"
    moved.parent.mkdir()
    moved.write_text("solid")
    os.utime(moved, (1, 1))
    elsewhere = {"excavations": [{"name": "stope", "file": str(moved)}], "levels": 2}
    assert made(elsewhere) == first
    content_of.cache_clear()
    moved.write_text("solid of another mine")
    assert made(elsewhere) != first


def test_a_folder_counts_with_all_in_it(tmp_path):
    """As a reader of folders names it; hidden files are left out, a missing file is told from an empty one."""
    (tmp_path / "data/events").mkdir(parents=True)
    (tmp_path / "data/events/a.parquet").write_text("1")
    assert list(files_of({"file": str(tmp_path / "data")})) == [tmp_path / "data"]
    first = content_of(tmp_path / "data")
    (tmp_path / "data/.git").mkdir()
    content_of.cache_clear()
    assert content_of(tmp_path / "data") == first
    (tmp_path / "data/events/a.parquet").write_text("2")
    content_of.cache_clear()
    assert content_of(tmp_path / "data") != first
    assert content_of(tmp_path / "missing") == ""


def test_a_reports_quoted_configuration_names_no_files():
    """Its paths are relative to the mine's file; what they hold comes in by the results that are made of them."""
    values = {"config": {"record": {"file": "../record.csv"}}, "default": {}, "excavations": [{"file": "a.stl"}]}
    assert list(files_of(values)) == [Path("a.stl")]


def test_what_cannot_be_read_says_nothing(tmp_path):
    """A missing, empty or broken result, and one that is no dataset."""
    names = []
    for name, content in (("a.nc", b"no netCDF"), ("b.nc", b""), ("c.html", b"<html></html>")):
        (tmp_path / name).write_bytes(content)
        names.append(str(tmp_path / name))
    alone = Job("grid", {}, {}, "code", {}).provenance()
    assert Job("grid", {}, {"state": [*names, str(tmp_path / "missing.nc")]}, "code", {}).provenance() == alone


# ---- the table of stages ----


def test_each_stage_names_packages_that_hold_its_code():
    """And their code decides its hash."""
    for name, stage in stages().items():
        assert stage.packages, name
        assert set(stage.packages) <= set(IMPORTS), name
        assert stage.about
        assert len(stage.source_hash()) == 16
    assert stages()["grid"].source_hash() != stages()["events"].source_hash()


@pytest.mark.parametrize(
    ("file", "used", "unused"),
    [
        ("workflow/run_mine.py", {"companion", "trial"}, {"grid", "step", "events", "report"}),
        ("seismic/events.py", {"events", "trial", "companion", "calibrate"}, {"grid", "step", "record", "report"}),
        ("catalogs/records/build.py", {"record", "report", "plans", "earlier_record"}, {"grid", "events", "trial"}),
        ("mpm_core/stages/grid_stage.py", {"grid", "step", "trial", "companion"}, {"events", "record", "report"}),
        ("common/errors.py", set(stages()), set()),
    ],
)
def test_an_edit_changes_the_hash_of_the_stages_that_run_the_file(monkeypatch, file, used, unused):
    """And of no other, so a report that is worded anew does not run the mechanics again."""
    read = Path.read_bytes

    def hashes_now() -> dict[str, str]:
        package_hash.cache_clear()
        return {name: stage.source_hash() for name, stage in stages().items()}

    before = hashes_now()
    monkeypatch.setattr(Path, "read_bytes", lambda path: read(path) + b"# edit" * path.as_posix().endswith(file))
    changed_now = {name for name, code in hashes_now().items() if code != before[name]}
    package_hash.cache_clear()
    assert used <= changed_now
    assert not unused & changed_now
