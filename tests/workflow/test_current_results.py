"""What is on disk is of these settings, inputs and sources, or runs again, whatever ended the last run."""

import functools
import hashlib
import os
import shutil
import time
from pathlib import Path

import pytest
import trimesh
from stand_ins import KILLED, ending
from tiny_mines import TINY, box, changed, copy_checkout, edited, hashes, jobs, snakemake, write_mine

from workflow.mine_folder import NOTES

ENDINGS = {
    "killed": KILLED,
    "terminated": "kill -TERM $$",
    "an error": "exit 1",
    "a full disk": 'ulimit -f 0; exec "{interpreter}" "$@"',
    "Snakemake killed": "kill -KILL $PPID; sleep 2; exit 1",
    "Snakemake terminated": "kill -TERM $PPID; sleep 2; exit 1",
}
STEELIER = {"materials.host.youngs_modulus": "60 GPa"}
STRONGER = {"materials.host.friction_angle": {"intact": "31 deg", "residual": "20 deg"}}
WIDER = {"excavations.1": box("stope_1", "2019-08", [30, 40, 25], [45, 60, 50], fill="fill")}
COARSER = {"seismic.closeness": 0.6}
NEARER = {"record.location_error": "4 m"}
REQUESTED = changed(
    TINY,
    baselines={"since": "2019-07-01"},
    calibration={
        "quantities": [
            {"key": "materials.host.cohesion.residual", "range": ["0.2 MPa", "0.9 MPa"], "scale": "log", "source": "-"}
        ],
        **{"trials": 4, "batches": 0, "replicates": 1, "pairs": 2},
    },
)
STAGES = {  # first result of a stage, and a change of what the stage depends on
    "grid.nc": WIDER,
    "elastic.nc": STEELIER,
    "steps/history.nc": STRONGER,
    "steps/2019-08.nc": STRONGER,
    "events": COARSER,
    "catalog.csv": COARSER,
    "record.nc": NEARER,
    "comparison.nc": NEARER,
    ".report.html": NEARER,
}
CASES = [
    ("grid.nc", "killed"),
    ("elastic.nc", "a full disk"),
    ("steps/2019-08.nc", "terminated"),
    ("steps/2019-08.nc", "Snakemake killed"),
    ("events", "an error"),
    ("events", "Snakemake killed"),
    ("catalog.csv", "killed"),
    ("record.nc", "an error"),
    ("comparison.nc", "killed"),
    (".report.html", "terminated"),
    (".report.html", "Snakemake terminated"),
]
if "WHOLE_KILL_CROSS" in os.environ:  # each stage with each ending takes some minutes
    CASES = [(result, how) for result in STAGES for how in ENDINGS]


@pytest.fixture(scope="module")
def fresh(tmp_path_factory, leave_empty):
    """The folder of a run of a mine, with its file; its results are empty."""
    known = {}

    def of(mine: dict) -> Path:
        if (key := str(mine)) not in known:
            folder = tmp_path_factory.mktemp("fresh")
            file = write_mine(mine, folder / "files/tiny.yaml")
            status, text = snakemake(file, folder / "run", interpreter=leave_empty)
            assert status == 0, text
            known[key] = folder
        return known[key]

    return of


@pytest.fixture
def copied(tmp_path, fresh):
    """A folder with a run of the tiny mine, and the mine's file."""
    shutil.copytree(fresh(TINY), tmp_path, dirs_exist_ok=True)
    file = tmp_path / "files/tiny.yaml"
    for note in (tmp_path / "run" / NOTES).iterdir():
        note.write_text(str(file.resolve()), encoding="utf-8")
    return tmp_path / "run", file


@pytest.mark.parametrize("has_notes", [True, False], ids=["", "without .snakemake"])
@pytest.mark.parametrize(("result", "how"), CASES, ids=[f"{result} {how}" for result, how in CASES])
def test_the_same_command_ends_as_in_a_fresh_folder(result, how, has_notes, tmp_path, copied, fresh, leave_empty):
    """No result of the old settings is taken as one of the new, nor after the old settings have come back."""
    (folder, file), mine = copied, changed(TINY, **STAGES[result])
    if not has_notes and how not in ("killed", "an error"):
        pytest.skip("the notes are lost in the same way")
    write_mine(mine, file)
    page = (folder / "results/tiny/report.html").read_text()
    ends = ending(f"results/tiny/{result}", ENDINGS[how], tmp_path, leave_empty)
    status, text = snakemake(file, folder, interpreter=ends)
    assert status != 0
    assert (tmp_path / "once").is_dir(), text
    assert (folder / "results/tiny/report.html").read_text() == page  # until its successor is whole
    if how.startswith("Snakemake"):
        snakemake(file, folder, "--unlock")
    if not has_notes:
        shutil.rmtree(folder / ".snakemake")
    for wanted in (mine, TINY):
        write_mine(wanted, file)
        status, text = snakemake(file, folder, interpreter=leave_empty)
        assert status == 0, text
        assert "Nothing to be done" not in text
        assert what_stands(folder) == what_stands(fresh(wanted) / "run")


def what_stands(folder: Path) -> dict[str, str]:
    """Hashes of all results."""
    results = folder / "results/tiny"
    files = [path for path in results.rglob("*") if path.is_file() and path.name != ".snakemake_timestamp"]
    return {str(path.relative_to(results)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_a_result_that_is_asked_for_by_name_is_no_old_one(tmp_path, copied, fresh, leave_empty):
    """A step was killed. Its state is missing, and what was made from the earlier one still stands."""
    (folder, file), catalog = copied, "results/tiny/catalog.nc"
    write_mine(changed(TINY, **STRONGER), file)
    ends = ending("results/tiny/steps/2019-08.nc", KILLED, tmp_path, leave_empty)
    assert snakemake(file, folder, catalog, interpreter=ends)[0] != 0
    status, text = snakemake(file, folder, catalog, interpreter=leave_empty)
    assert status == 0, text
    assert jobs(text) == {"step": 1, "events": 1}
    wanted = fresh(changed(TINY, **STRONGER)) / "run"
    assert (folder / catalog).read_bytes() == (wanted / catalog).read_bytes()


@pytest.mark.slow
def test_a_killed_stage_ends_in_the_bytes_of_a_fresh_folder(spoiled, base, tmp_path):
    """What the stages themselves leave and find."""
    mine, step = changed(TINY, **{"materials.fill.youngs_modulus": "20 GPa"}), "results/tiny/steps/2019-08.nc"
    old = (spoiled / step).read_bytes()
    with edited(base / "files/tiny.yaml", mine) as file:
        assert snakemake(file, spoiled, step, interpreter=ending(step, KILLED, tmp_path))[0] != 0
        status, text = snakemake(file, spoiled, step)
    assert status == 0, text
    assert jobs(text) == {"step": 1}
    status, text = snakemake(write_mine(mine, tmp_path / "tiny.yaml"), tmp_path, step)
    assert status == 0, text
    assert old != (spoiled / step).read_bytes() == (tmp_path / step).read_bytes()


def planned(file: Path, folder: Path, *options: str) -> dict[str, int]:
    """The jobs of a dry run."""
    status, text = snakemake(file, folder, "--dry-run", *options)
    assert status == 0, text
    return jobs(text)


def test_results_without_snakemakes_notes_are_judged_by_their_jobs(copied):
    """As after a move to another folder: those of these settings stand, those of others are made again."""
    folder, file = copied
    shutil.rmtree(folder / ".snakemake")
    assert planned(file, folder) == {}
    write_mine(changed(TINY, **COARSER), file)
    assert set(planned(file, folder)) == {"events", "catalogue", "comparison", "report", "report_page", "all"}


@pytest.fixture(scope="module")
def requested(tmp_path_factory, leave_empty) -> tuple[Path, Path]:
    """Folder and mine file of a run of baselines and calibration; their results are empty."""
    folder = tmp_path_factory.mktemp("requested")
    file = write_mine(REQUESTED, folder / "files/tiny.yaml")
    for target in ("baselines", "calibrate"):
        status, text = snakemake(file, folder / "run", target, interpreter=leave_empty)
        assert status == 0, text
    return folder / "run", file


# Jobs that depend on the record.
OF_RECORD = ("record", "comparison", "flaws", "excess_shear", "baselines", "calibration_record", "calibrate")


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({}, {}),
        ({"baselines.friction_angle": "17 deg"}, {"flaws": 1, "excess_shear": 1, "baselines": 1}),
        ({"baselines.since": "2019-06-01"}, {"baselines": 1}),
        ({"calibration.model_error": 0.5}, {"calibrate": 1}),
        (NEARER, dict.fromkeys(OF_RECORD, 1)),
    ],
    ids=["nothing", "friction", "since", "model error", "location error"],
)
def test_baselines_and_calibration_without_snakemakes_notes_are_made_again(values, expected, requested):
    """What depends on a changed key, and nothing else. The calibration copies the mine file, so its page follows it."""
    folder, file = requested
    shutil.rmtree(folder / ".snakemake", ignore_errors=True)
    with edited(file, changed(REQUESTED, **values)) as other:
        found = planned(other, folder, "baselines", "calibrate")
    found.pop("earlier_record", None)
    assert {"calibrate": 1, **found} == {"calibrate": 1, **expected}
    assert ("calibrate" in found) == bool(values)


def test_a_record_replaced_by_an_older_file_is_seen_without_snakemakes_notes(requested):
    """By baselines and calibration alike."""
    folder, file = requested
    record = file.parent / "record.csv"
    before = record.read_bytes()
    record.write_bytes(before.replace(b"-2.", b"-1.", 1))
    os.utime(record, (1, 1))
    shutil.rmtree(folder / ".snakemake", ignore_errors=True)
    found = planned(file, folder, "baselines", "calibrate")
    record.write_bytes(before)
    assert {"record", "comparison", "flaws", "excess_shear", "baselines", "calibrate"} <= set(found)


def test_results_that_were_touched_are_not_taken_for_those_of_planned_settings(requested):
    """A dry run has written the jobs of other settings; then results get a newer time, as a copy of a folder has."""
    folder, file = requested
    with edited(file, changed(REQUESTED, **{"calibration.model_error": 0.5, "baselines.seed": 7})) as other:
        before = planned(other, folder, "baselines", "calibrate")
        now = time.time_ns()  # one time for all: none is newer than what was made from it
        for path in sorted((folder / "results/tiny").rglob("*")):
            if path.is_file() and "jobs" not in path.parts:
                os.utime(path, ns=(now, now))
        after = planned(other, folder, "baselines", "calibrate")
    assert {"flaws", "excess_shear", "baselines", "calibrate"} <= set(before) <= set(after)


def test_a_dry_run_of_other_settings_makes_nothing_old(copied):
    """It leaves its jobs; those of the results stay."""
    folder, file = copied
    write_mine(changed(TINY, **STEELIER), file)
    assert planned(file, folder)["elastic"] == 1
    write_mine(TINY, file)
    assert planned(file, folder) == {}


def test_another_solid_makes_the_companion_anew_with_the_grid(tmp_path, leave_empty):
    """In the same command: a job with an input that is `ancient` and made anew is not looked at by Snakemake 9."""
    mine = changed(TINY, grid_convergence=True)
    file = write_mine(mine, tmp_path / "files/tiny.yaml")
    status, text = snakemake(file, tmp_path / "run", interpreter=leave_empty)
    assert status == 0, text
    assert "Nothing to be done" in snakemake(file, tmp_path / "run", "--dry-run")[1]
    write_mine(changed(mine, **WIDER), file)
    planned = jobs(snakemake(file, tmp_path / "run", "--dry-run")[1])
    assert planned["grid"] == planned["companion"] == 1
    assert planned["report"] == 1


def test_an_opening_that_gets_an_earlier_month_runs_that_month_and_all_that_follow(tmp_path, fresh, leave_empty):
    """The last month changes nothing of the scene. Its job stays, and runs again from the state before it.

    A run that ends in the first of these months is taken up there.
    """
    following = [{"name": f"2019-{m:02d}", "start": f"2019-{m:02d}-01", "end": f"2019-{m + 1:02d}-01"} for m in (9, 10)]
    late = changed(TINY, steps=[*TINY["steps"], *following], **{"excavations.2.step": "2019-09"})
    early = changed(late, **{"excavations.2.step": "2019-08"})
    shutil.copytree(fresh(late) / "run", tmp_path / "run")
    folder, file = tmp_path / "run", tmp_path / "files/tiny.yaml"
    write_mine(early, file)
    (note,) = (folder / NOTES).iterdir()
    note.write_text(str(file.resolve()), encoding="utf-8")
    (last,) = (folder / "results/tiny/jobs/step/2019-10").iterdir()
    assert planned(file, folder)["step"] == 3
    assert {"grid", "elastic"}.isdisjoint(planned(file, folder))
    ends = ending("results/tiny/steps/2019-09.nc", KILLED, tmp_path, leave_empty)
    assert snakemake(file, folder, interpreter=ends)[0] != 0
    assert planned(file, folder)["step"] == 2
    status, text = snakemake(file, folder, interpreter=leave_empty)
    assert status == 0, text
    assert list((folder / "results/tiny/jobs/step/2019-10").iterdir()) == [last]
    assert what_stands(folder) == what_stands(fresh(early) / "run")


def test_a_refused_record_is_refused_again(spoiled, base, tiny_file):
    """A file older than the result, which only its stage refuses: the second call said that there is nothing to do."""
    bad = tiny_file.parent / "older.csv"
    bad.write_text("date,x,y,z,size\n2019-08-07T06:00:00,north,1,1,-2\n")
    os.utime(bad, (1, 1))
    with edited(tiny_file, changed(TINY, **{"record.file": "older.csv"})) as file:
        for _ in range(2):
            status, text = snakemake(file, spoiled)
            assert status != 0
            assert "is not a number" in text
    bad.unlink()


@pytest.mark.parametrize("stamp", [1, 4_000_000_000], ids=["older", "newer"])
def test_another_content_under_the_same_name_counts_whatever_its_time(copied, stamp):
    """Of a record; the same content with another time does not count."""
    folder, file = copied
    record = file.parent / "record.csv"
    before = record.read_bytes()
    record.write_bytes(before.replace(b"-2.", b"-1.", 1))
    os.utime(record, (stamp, stamp))
    assert set(planned(file, folder)) == {"record", "comparison", "report", "report_page", "all"}
    record.write_bytes(before)
    os.utime(record, (stamp, stamp))
    assert planned(file, folder) == {}


def test_a_solid_replaced_by_an_older_file(tmp_path, leave_empty):
    """Its grid is made again."""
    solid = tmp_path / "files/stope.stl"
    values = {"excavations.1": {"name": "stope_1", "step": "2019-08", "fill": "fill", "file": "stope.stl"}}
    file = write_mine(changed(TINY, **values), tmp_path / "files/tiny.yaml")
    trimesh.creation.box(bounds=[[30, 40, 25], [45, 55, 50]]).export(solid)
    grid = "results/tiny/grid.nc"
    status, text = snakemake(file, tmp_path, grid, interpreter=leave_empty)
    assert status == 0, text
    assert planned(file, tmp_path, grid) == {}
    trimesh.creation.box(bounds=[[30, 40, 25], [45, 50, 50]]).export(solid)
    os.utime(solid, (1, 1))
    assert planned(file, tmp_path, grid) == {"grid": 1}


def test_edited_sources_count_after_a_stage_was_killed(tmp_path, leave_empty):
    """An edit makes the stages of its package old, and no others."""
    checkout, file = copy_checkout(tmp_path / "checkout"), write_mine(TINY, tmp_path / "tiny.yaml")
    grid = "results/tiny/grid.nc"
    run = functools.partial(snakemake, file, tmp_path, grid, checkout=checkout)
    assert run(interpreter=leave_empty)[0] == 0
    with (checkout / "seismic/events.py").open("a") as source:
        source.write("# edited\n")
    assert "Nothing to be done" in run("--dry-run")[1]
    with (checkout / "mpm_core/stages/grid_stage.py").open("a") as source:
        source.write("# edited\n")
    assert run(interpreter=ending(grid, KILLED, tmp_path))[0] != 0
    status, text = run("--dry-run")
    assert status == 0, text
    assert jobs(text) == {"grid": 1}


def test_the_report_stays_until_the_next_one_is_whole(spoiled, base):
    """A figure that cannot be drawn: the page of before is there to be read."""
    page = (spoiled / "results/tiny/report.html").read_bytes()
    (spoiled / "results/tiny/event_rules.nc").write_bytes(b"no dataset")
    status, _ = snakemake(base / "files/tiny.yaml", spoiled)
    assert status != 0
    assert (spoiled / "results/tiny/report.html").read_bytes() == page
    assert "catalog.nc" in hashes(spoiled / "results/tiny")
