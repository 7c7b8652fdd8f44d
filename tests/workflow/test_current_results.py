"""What is on disk is of these settings, inputs and sources, or runs again, whatever ended the last run."""

import functools
import os
import shutil
from pathlib import Path

import pytest
import trimesh
from stand_ins import KILLED, ending
from tiny_mines import TINY, box, changed, copy_checkout, edited, hashes, jobs, snakemake, write_mine

from common.provenance import comment, content_of, files_of, made_from, read_made_from
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
CASES = [  # result whose stage is ended, how, after which change
    ("grid.nc", "killed", WIDER),
    ("elastic.nc", "a full disk", STEELIER),
    ("steps/history.nc", "killed", STRONGER),
    ("steps/2019-08.nc", "terminated", STRONGER),
    ("steps/2019-08.nc", "Snakemake killed", STRONGER),
    ("events/2019-08.nc", "an error", COARSER),
    ("catalog.nc", "killed", COARSER),
    ("closeness.nc", "terminated", COARSER),
    ("catalog.xml", "a full disk", COARSER),
    ("record.nc", "an error", NEARER),
    ("comparison.nc", "killed", NEARER),
    ("report.html", "terminated", NEARER),
    ("report.html", "Snakemake terminated", NEARER),
]


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


@pytest.mark.parametrize(("result", "how", "values"), CASES, ids=[f"{case[0]} {case[1]}" for case in CASES])
def test_the_same_command_ends_as_in_a_fresh_folder(result, how, values, tmp_path, fresh, leave_empty):
    """The result of the old settings may stand for a while; the next identical command does not take it."""
    mine, folder, file = changed(TINY, **values), tmp_path / "run", tmp_path / "files/tiny.yaml"
    shutil.copytree(fresh(TINY), tmp_path, dirs_exist_ok=True)
    for note in (folder / NOTES).iterdir():
        note.write_text(str(file.resolve()), encoding="utf-8")
    write_mine(mine, file)
    ends = ending(f"results/tiny/{result}", ENDINGS[how], tmp_path, leave_empty)
    status, text = snakemake(file, folder, interpreter=ends)
    assert status != 0
    assert (tmp_path / "once").is_dir(), text
    if how.startswith("Snakemake"):
        snakemake(file, folder, "--unlock")
    status, text = snakemake(file, folder, interpreter=leave_empty)
    assert status == 0, text
    assert "Nothing to be done" not in text
    assert what_stands(folder) == what_stands(fresh(mine) / "run")


def what_stands(folder: Path) -> dict[str, str]:
    """Hashes of the results, and what the page was made from: it tells of times, too."""
    results = folder / "results/tiny"
    return hashes(results) | {"report.html": read_made_from(results / "report.html")}


@pytest.mark.slow
def test_a_killed_stage_ends_in_the_bytes_of_a_fresh_folder(spoiled, base, tmp_path):
    """What the stages themselves leave and find."""
    mine, step = changed(TINY, **{"materials.fill.youngs_modulus": "20 GPa"}), "results/tiny/steps/2019-08.nc"
    old = (spoiled / step).read_bytes()
    with edited(base / "files/tiny.yaml", mine) as file:
        assert snakemake(file, spoiled, step, interpreter=ending(step, KILLED, tmp_path))[0] != 0
        assert (spoiled / step).read_bytes() == old
        status, text = snakemake(file, spoiled, step)
    assert status == 0, text
    assert jobs(text) == {"mining_step": 1}
    status, text = snakemake(write_mine(mine, tmp_path / "tiny.yaml"), tmp_path, step)
    assert status == 0, text
    assert old != (spoiled / step).read_bytes() == (tmp_path / step).read_bytes()


def planned(file: Path, folder: Path, *options: str) -> dict[str, int]:
    """The jobs of a dry run."""
    status, text = snakemake(file, folder, "--dry-run", *options)
    assert status == 0, text
    return jobs(text)


def test_results_without_snakemakes_notes_are_judged_by_what_they_say(spoiled, base, tiny_file):
    """As after a move to another folder: those of these settings stand, those of others are made again."""
    shutil.rmtree(spoiled / ".snakemake")
    solved = {"grid", "elastic", "mining_step", "events", "catalog", "closeness", "quakeml"}
    assert not solved & set(planned(tiny_file, spoiled))  # the record's file may have been written again meanwhile
    with edited(base / "files/tiny.yaml", changed(TINY, **COARSER)) as file:
        again = planned(file, spoiled)
    assert {"events", "catalog", "closeness", "quakeml", "compare", "report"} <= set(again)
    assert not {"grid", "elastic", "mining_step"} & set(again)


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
def test_another_content_under_the_same_name_counts_whatever_its_time(spoiled, tiny_file, stamp):
    """Of a record and of a solid."""
    record = tiny_file.parent / "record.csv"
    before = record.read_bytes()
    try:
        record.write_bytes(before.replace(b"-2.", b"-1.", 1))
        os.utime(record, (stamp, stamp))
        assert set(planned(tiny_file, spoiled)) == {"record", "compare", "report", "all"}
    finally:
        record.write_bytes(before)
        os.utime(record, (1, 1))
    assert planned(tiny_file, spoiled) == {}


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


def test_edited_sources_count_after_a_stage_was_killed(tmp_path, leave_empty_in_copies):
    """The earlier grid is put back when its stage is killed, and is not taken as that of the new sources."""
    checkout, file = copy_checkout(tmp_path / "checkout"), write_mine(TINY, tmp_path / "tiny.yaml")
    grid = "results/tiny/grid.nc"
    run = functools.partial(snakemake, file, tmp_path, grid, checkout=checkout)
    assert run(interpreter=leave_empty_in_copies)[0] == 0
    with (checkout / "mpm_core/stages/grid_stage.py").open("a") as source:
        source.write("# edited\n")
    assert run(interpreter=ending(grid, KILLED, tmp_path))[0] != 0
    assert (tmp_path / grid).is_file()
    status, text = run("--dry-run")
    assert status == 0, text
    assert jobs(text) == {"grid": 1}


# ---- what a result is made from ----


def test_the_digest_follows_configuration_sources_inputs_and_files(tmp_path):
    """Each alone changes it; folder and time of a file do not."""
    solid = tmp_path / "a" / "stope.stl"
    solid.parent.mkdir()
    solid.write_text("solid")
    slice_ = {"excavations": [{"name": "stope", "file": str(solid)}], "levels": 2}
    page = tmp_path / "page.html"
    page.write_text(f"<html></html>\n{comment('0123456789abcdef')}")
    first = made_from(slice_, "mpm_core grid", [page])
    assert made_from(slice_ | {"levels": 3}, "mpm_core grid", [page]) != first
    assert made_from(slice_, "mpm_core elastic", [page]) != first
    assert made_from(slice_, "mpm_core grid") != first
    moved = tmp_path / "b" / "stope.stl"
    moved.parent.mkdir()
    shutil.copy(solid, moved)
    os.utime(moved, (1, 1))
    elsewhere = {"excavations": [{"name": "stope", "file": str(moved)}], "levels": 2}
    assert made_from(elsewhere, "mpm_core grid", [page]) == first
    content_of.cache_clear()
    moved.write_text("solid of another mine")
    assert made_from(elsewhere, "mpm_core grid", [page]) != first


def test_a_folder_counts_with_all_in_it(tmp_path):
    """As a reader of folders names it; hidden files are left out, a missing file is told from an empty one."""
    (tmp_path / "data/events").mkdir(parents=True)
    (tmp_path / "data/events/a.parquet").write_text("1")
    slice_ = {"file": str(tmp_path / "data")}
    assert list(files_of(slice_)) == [tmp_path / "data"]
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
    slice_ = {"config": {"record": {"file": "../record.csv"}}, "default": {}, "excavations": [{"file": "a.stl"}]}
    assert list(files_of(slice_)) == [Path("a.stl")]


def test_what_cannot_be_read_says_nothing(tmp_path):
    """A missing, empty or broken result is made again."""
    for name, content in (("a.nc", b"no netCDF"), ("b.nc", b""), ("c.html", b"<html></html>")):
        (tmp_path / name).write_bytes(content)
        assert read_made_from(tmp_path / name) is None
    assert read_made_from(tmp_path / "missing.nc") is None
    (tmp_path / "c.html").write_text(comment("0123456789abcdef"))
    assert read_made_from(tmp_path / "c.html") == "0123456789abcdef"
