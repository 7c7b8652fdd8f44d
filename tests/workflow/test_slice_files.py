"""Slices of the configuration travel as files: as many excavations as a mine has, and nothing written too early."""

import json
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from large_mines import large_mine
from tiny_mines import ROOT, TINY, changed, edited, snakemake, write_mine

from common.errors import InputError
from common.provenance import config_hash
from common.slices import read_slice
from workflow.stage_inputs import SliceFiles

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=20,
)


@settings(deadline=None)
@given(st.dictionaries(st.text(), VALUES))
def test_what_is_read_is_what_was_sliced(tmp_path_factory, values):
    """Any values, character by character; the provenance is the same on both sides."""
    folder = tmp_path_factory.mktemp("slices")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        read = read_slice(SliceFiles(at_once=True).name("mine", "steps/2019-08", values))
    assert read == values
    assert config_hash(read) == config_hash(values)


def test_nothing_is_written_before_the_run_begins_and_earlier_ones_go(tmp_path, monkeypatch):
    """A name depends on the content alone; what has not changed is not written again; other stages' stay."""
    monkeypatch.chdir(tmp_path)
    planned = SliceFiles()
    names = [planned.name("mine", stage, {"value": 1}) for stage in ("grid", "steps/2019-08", "steps/2019-08-1")]
    assert not list(tmp_path.iterdir())
    planned.begin()
    assert all((tmp_path / name).is_file() for name in names)
    before = (tmp_path / names[0]).stat().st_mtime_ns
    running = SliceFiles(at_once=True)
    assert running.name("mine", "grid", {"value": 1}) == names[0]
    assert (tmp_path / names[0]).stat().st_mtime_ns == before
    later = running.name("mine", "steps/2019-08", {"value": 2})
    left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert left == {names[0], names[2], later}


@pytest.mark.parametrize("content", [None, "", "{", "[1]"])
def test_an_unreadable_slice_is_one_line(tmp_path, content):
    """With the file, and what to do."""
    path = tmp_path / "grid.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=r"grid\.json: not .*; slices stand in results"):
        read_slice(path)


def test_a_dry_run_writes_no_slice(base, tiny_file, tmp_path):
    """Nor does a look at the code."""
    for option in ("--dry-run", "--lint"):
        status, text = snakemake(tiny_file, tmp_path / "dry", option)
        assert status == 0, text
    assert not (tmp_path / "dry/results").exists()


def test_a_changed_value_replaces_the_slices_of_its_stages_alone(spoiled, base, leave_empty):
    """One file per stage, before and after; those that do not depend on it keep theirs."""
    folder = spoiled / "results/tiny/slices"
    before = {path.relative_to(folder).as_posix() for path in folder.rglob("*.json")}
    assert {name.split(".")[0] for name in before} == {
        *("grid", "elastic", "steps/history", "steps/2019-08", "events/history", "events/2019-08"),
        *("catalog", "closeness", "record", "comparison", "report"),
    }
    with edited(base / "files" / "tiny.yaml", changed(TINY, **{"record.filter.minimum_potency": "1e-4 m^3"})) as file:
        status, text = snakemake(file, spoiled, interpreter=leave_empty)
    assert status == 0, text
    after = {path.relative_to(folder).as_posix() for path in folder.rglob("*.json")}
    assert {name.split(".")[0] for name in after - before} == {"record", "report"}
    assert len(after) == len(before)


def test_no_room_for_a_slice_is_one_line(tmp_path):
    """And no half file."""
    script = (
        "import resource; from workflow.stage_inputs import SliceFiles; "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (300, resource.RLIM_INFINITY)); "
        f"SliceFiles(at_once=True).name({str(tmp_path / 'mine')!r}, 'grid', list(range(1000)))"
    )
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode != 0
    assert f"InputError: the disk is full: no room in {tmp_path / 'mine/slices'}" in run.stderr.splitlines()[-1]
    assert not list((tmp_path / "mine/slices").iterdir())


def test_a_folder_that_takes_no_slice_is_one_line(tiny_file, tmp_path):
    """Told before any stage starts, without a traceback; once it is out of the way the run begins."""
    (tmp_path / "results/tiny").mkdir(parents=True)
    (tmp_path / "results/tiny/slices").write_text("a file of the user's")
    status, text = snakemake(tiny_file, tmp_path, "results/tiny/record.nc")
    assert status != 0
    assert "results/tiny/slices/record." in text.splitlines()[-1]
    assert "cannot be written" in text.splitlines()[-1]
    assert "Traceback" not in text
    (tmp_path / "results/tiny/slices").unlink()
    assert snakemake(tiny_file, tmp_path, "results/tiny/record.nc")[0] == 0


@pytest.mark.slow
def test_a_mine_of_many_excavations_gets_its_grid(tmp_path):
    """760 stopes in 40 steps, their names as long as may be: more than an argument of a command line holds."""
    mine = large_mine(760, 40)
    for entry in mine["excavations"]:
        entry["name"] = entry["name"].ljust(64, "_")
    file = write_mine(mine, tmp_path / "files/large.yaml")
    status, text = snakemake(file, tmp_path / "run", "results/large-760/grid.nc")
    assert status == 0, text
    slices = list((tmp_path / "run/results/large-760/slices").iterdir())
    assert len(slices) == 1
    assert len(json.loads(slices[0].read_text())["excavations"]) == 760
    assert slices[0].stat().st_size > 131_072
