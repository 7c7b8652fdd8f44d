"""Each fault ends with one line that says where and what to do, and leaves every result as it was."""

import re
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from tiny_mines import FLAT, ROOT, TINY, box, changed, edited, hashes, merged, snakemake, write_mine

from catalogs.records import read_record
from common.datasets import read_dataset
from common.errors import InputError
from common.job import write_job
from mpm_core.scene.scene import parse_scene
from mpm_core.stages import equilibrium_stages, grid_stage, stage_memory
from workflow.configuration import load


def spoken(text: str) -> list[str]:
    """What the terminal says beside Snakemake's table of jobs, its progress and the stages' good news."""
    lines = text.splitlines()
    last = max((number for number, line in enumerate(lines) if line.startswith("total")), default=0)
    noise = re.compile(
        r"jobs \(|runs again|because of changes|Using workflow specific profile| MiB|; log: logs/| \(\d+ s\)$"
    )
    return [line for line in lines[last + bool(last) :] if line and not noise.search(line)]


STOPE = {"name": "stope_1", "step": "2019-08", "fill": "fill"}
FAULTS = {  # values changed, the one line's parts, result of the stage that fails
    "unknown key": ({"solver.tolerancee": 1}, ("files/tiny.yaml: solver.tolerancee: unknown key", "tolerance?"), ""),
    "no convergence": (
        {"solver.scheme": "explicit", "solver.max_iterations": 20},
        ("elastic results/tiny/elastic.nc: no convergence", "solver.max_iterations"),
        "elastic.nc",
    ),
    "outside the domain": (
        {"excavations.2": box("stope_2", "planned", [145, 40, 25], [155, 55, 50], fill="fill")},
        ("files/tiny.yaml: excavations.stope_2: lies outside the domain", "check its coordinates"),
        "",
    ),
    "record without a column": (
        {"record.columns.log_potency": "magnitude"},
        ("record.csv: column 'magnitude' (record.columns.log_potency) is missing", "it has date, x, y, z, size"),
        "record.nc",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_user_reads_one_line_and_other_results_stand(spoiled, base, fault):
    """On the terminal, as the profile shows it: no traceback, no shell command, no configuration as JSON."""
    values, says, failed = FAULTS[fault]
    before = hashes(spoiled / "results/tiny")
    with edited(base / "files/tiny.yaml", changed(TINY, **values)) as file:
        status, text = snakemake(file, spoiled)
    lines = spoken(text)
    assert status != 0
    assert len(lines) == 1, text
    assert all(part in lines[0] for part in says), lines[0]
    before.pop(failed, None)
    assert hashes(spoiled / "results/tiny") == before


def test_a_record_that_cannot_be_read_ends_the_run_before_anything_is_solved(base):
    """Hours of mechanics came first where files of solids are larger than the record; now not even the grid is made."""
    folder = base / "files/unreadable"
    solid = trimesh.creation.box(
        extents=(10, 15, 25), transform=trimesh.transformations.translation_matrix([35, 47, 37])
    )
    values = {"record.columns.log_potency": "magnitude", "excavations.1": STOPE | {"file": "stope.stl"}}
    file = write_mine(changed(TINY, **values), folder / "mine.yaml")
    solid.subdivide_loop(4).export(folder / "stope.stl")
    assert (folder / "stope.stl").stat().st_size > (folder / "record.csv").stat().st_size
    status, text = snakemake(file, base / "unreadable")
    assert status != 0
    assert "record.csv: column 'magnitude' (record.columns.log_potency) is missing" in text
    assert not list((base / "unreadable").glob("results/tiny/*.nc"))


def test_a_record_spoiled_later_leaves_comparison_and_report(spoiled, base):
    """A value that is no number, in a file that was good: what was compared stands as it was."""
    file = write_mine(TINY, base / "files/spoiled/mine.yaml")
    record = file.parent / "record.csv"
    record.write_text(record.read_text().replace("2019-08-07T06:00:00,", "2019-08-07T06:00:00,north ", 1))
    before = hashes(spoiled / "results/tiny")
    status, text = snakemake(file, spoiled)
    assert status != 0
    assert "is not a number" in text
    before.pop("record.nc")
    assert hashes(spoiled / "results/tiny") == before
    assert (spoiled / "results/tiny/report.html").is_file()


def test_results_of_another_file_are_not_replaced(spoiled, base, tiny_file):
    """A copy of a mine file with other values and the old name: refused while both are there, fine once one is not."""
    before = hashes(spoiled / "results/tiny")
    copy = write_mine(changed(TINY, **{"seismic.closeness": 0.7}), base / "files/copies/other.yaml")
    status, text = snakemake(copy, spoiled)
    assert status != 0
    (line,) = spoken(text)
    assert line.startswith("../files/copies/other.yaml: name: results/tiny was made from ")
    assert str(tiny_file) in line
    assert hashes(spoiled / "results/tiny") == before
    away = tiny_file.rename(tiny_file.with_suffix(".away"))
    try:
        status, text = snakemake(copy, spoiled, "--dry-run")
    finally:
        away.rename(tiny_file)
    assert status == 0, text
    same = write_mine(TINY, base / "files/copies/same.yaml")
    status, text = snakemake(same, spoiled, "--dry-run")
    assert status == 0, text


def test_missing_mine_file_is_named(tmp_path):
    """Snakemake's own words, but they are there."""
    status, text = snakemake(tmp_path / "nowhere.yaml", tmp_path)
    assert status != 0
    assert "nowhere.yaml" in text


def test_a_locked_folder_is_told(spoiled, base, tiny_file):
    """Snakemake's own errors are not swallowed with its chatter."""
    locks = spoiled / ".snakemake/locks"
    locks.mkdir(exist_ok=True)
    (locks / "0.output.lock").write_text("results/tiny/elastic.nc\n")
    (spoiled / "results/tiny/elastic.nc").unlink()
    status, text = snakemake(tiny_file, spoiled)
    assert status != 0
    assert "--unlock" in text


# ---- the same, stage by stage ----


@pytest.fixture
def mine(tmp_path):
    """A mine with values changed, checked, in SI."""

    def make(base, **values):
        return load(merged(changed(base, **values)), write_mine(base, tmp_path / "mine.yaml"))

    return make


@pytest.fixture
def refused(mine):
    """The line that the grid stage ends with."""

    def line(base, **values) -> str:
        with pytest.raises(InputError) as error:
            grid_stage.make_grid(mine(base, **values).grid_slice(), {})
        assert "\n" not in str(error.value)
        return str(error.value)

    return line


def test_solid_outside_the_domain(refused, tmp_path):
    """Named, with its extent and the domain's; what stands in a file is known when the grid stage has read it."""
    far = trimesh.creation.box(bounds=[[200, 30, 40], [210, 40, 50]]).export(file_type="stl")
    line = refused(TINY, **{"excavations.0": solid("far.stl", far, tmp_path)})
    assert line.startswith("excavations.drive: lies outside the domain (200 to 210 m")


def test_solid_that_reaches_beyond_the_domain_is_told(mine, tmp_path):
    """On the terminal, when the grid is made: a coordinate typed wrong, or a drive that goes on."""
    made = mine(TINY, **{"excavations.0": box("drive", "history", [20, 30, 40], [99, 40, 50])})
    job = write_job(tmp_path, "grid", "", made.grid_slice(), {}, "")
    line = [
        sys.executable,
        "-m",
        "workflow",
        job,
        "--output",
        str(tmp_path / "grid.nc"),
        "--log",
        str(tmp_path / "log"),
    ]
    run = subprocess.run(line, cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert "excavations.drive reaches beyond the domain; the part inside is used" in run.stderr


def test_excavation_that_adds_no_volume(refused):
    """A sheet of 5 cm in cells of 5 m: 1 % of each cell it crosses."""
    line = refused(TINY, **{"excavations.0": box("sheet", "history", [20, 31, 40], [60, 31.05, 50])})
    assert line.startswith("excavations.sheet: adds no volume")
    assert "grid.levels" in line


def solid(name: str, content: bytes, folder) -> dict:
    """An excavation of history from a file of such content."""
    (folder / name).write_bytes(content)
    return {"name": "drive", "step": "history", "file": name}


def test_a_surface_that_stands_twice_and_once_inward_encloses_nothing(refused, tmp_path):
    """Large as it is, smaller cells would not help."""
    outward = trimesh.creation.box(bounds=[[20, 30, 40], [60, 40, 50]])
    inward = outward.copy()
    inward.invert()
    twice = trimesh.util.concatenate([outward, inward]).export(file_type="stl")
    line = refused(TINY, **{"excavations.0": solid("twice.stl", twice, tmp_path)})
    assert line.startswith("excavations.drive: adds no volume: its surface encloses nothing; where it stands twice")
    assert "grid.levels" not in line


SPOILED = {
    "text.stl": b"this is no solid",
    "empty.stl": b"",
    "facetless.stl": b"solid nothing\nendsolid nothing\n",
    "cut.ply": trimesh.creation.box().export(file_type="ply")[:80],
    "empty.obj": b"# no faces\n",
    "text.dxf": b"no drawing",
    "text.omf": b"no project",
    "solid.docx": b"PK",
}


@pytest.mark.parametrize("name", SPOILED)
def test_unreadable_or_empty_solid(refused, tmp_path, name):
    """File and excavation are named, whatever the parser stumbled over."""
    line = refused(TINY, **{"excavations.0": solid(name, SPOILED[name], tmp_path)})
    assert line.startswith("excavations.drive: ")
    assert name in line


def test_solid_file_in_a_plane_strain_scene(refused, tmp_path):
    """A section needs a shape in its plane."""
    content = trimesh.creation.box().export(file_type="stl")
    assert "plane" in refused(FLAT, **{"excavations.0": solid("box.stl", content, tmp_path)})


def test_too_little_memory_is_told_before_the_arrays_are_made(refused, monkeypatch):
    """With the figure, and the keys that make the grid smaller."""
    monkeypatch.setattr(stage_memory, "usable", lambda: 10**6)
    line = refused(TINY)
    assert "GB of memory are needed, 0.0 GB are free" in line
    assert "grid.finest_cell" in line


def test_no_event_left_by_the_filter_and_spoiled_records(mine, tmp_path):
    """Each names the file, and the line, column or filter."""
    settings = mine(TINY).record_slice() | {"file": str(tmp_path / "record.csv")}
    text = (tmp_path / "record.csv").read_text()

    def line(record: str, **others) -> str:
        (tmp_path / "record.csv").write_text(record)
        with pytest.raises(InputError) as error:
            read_record(settings | others)
        return str(error.value)

    assert "record.filter: start and end leave nothing of the modelled" in line(text, filter={"start": "2031-01-01"})
    assert "column 'z' (record.columns.z) is missing" in line(text.replace(",z,", ",depth,"))
    rows = text.splitlines()
    rows[3] = rows[3].split(",")[0] + ",nan,1,1,-2"
    rows[4] = rows[4].split(",")[0] + ",far,1,1,-2"
    assert "event 4 of 60: column 'x': 'far' is not a number" in line("\n".join(rows))
    assert "record.csv" in line("")


def test_no_convergence_and_nan_leave_the_last_state_beside_the_output(mine, tmp_path, monkeypatch):
    """The line names what to raise; the state is there to look at."""
    made = mine(TINY, **{"solver.scheme": "explicit", "solver.max_iterations": 20})
    grid = grid_stage.make_grid(made.grid_slice(), {})
    failed = tmp_path / "elastic.failed.npz"
    with pytest.raises(InputError, match=r"no convergence: .* raise solver\.max_iterations"):
        equilibrium_stages.elastic_stage(parse_scene(made.mechanics_slice(0)), grid, failed)
    assert "displacement" in np.load(failed)
    external_force = equilibrium_stages.external_force
    monkeypatch.setattr(equilibrium_stages, "external_force", lambda model, step: external_force(model, step) * np.nan)
    with pytest.raises(InputError, match="not a number at iteration 0"):
        equilibrium_stages.elastic_stage(parse_scene(mine(TINY).mechanics_slice(0)), grid, failed)


def test_state_of_another_grid_is_refused(mine, undisturbed, tmp_path):
    """A step from a state that does not belong to its grid would be nonsense of the right shape."""
    state = read_dataset(undisturbed[0] / "results/tiny/elastic.nc")
    moved = box("drive", "history", [20, 30, 60], [60, 40, 70])
    for change in ({"grid.levels": 3}, {"excavations.0": moved}):
        made = mine(TINY, **change)
        grid = grid_stage.make_grid(made.grid_slice(), {})
        with pytest.raises(InputError, match="another grid"):
            equilibrium_stages.mining_step(parse_scene(made.mechanics_slice(0)), grid, state, tmp_path / "unused")
