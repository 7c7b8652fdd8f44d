"""Results of an earlier plan are named when a run begins, and left where they are."""

from pathlib import Path

from tiny_mines import TINY, changed, edited, hashes, jobs, snakemake

from workflow.mine_folder import leftovers, leftovers_line

PLAN = ["results/a/steps/history.nc", "results/a/report.html", "results/a/coarse/steps/history.nc", "results/b/x.nc"]
PLAN += ["results/a/calibration/", "results/a/plans/b/"]


def make(folder: Path, *paths: str) -> Path:
    """Empty files below a folder."""
    for path in paths:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).touch()
    return folder


def test_what_no_stage_of_the_plan_makes_is_named(tmp_path, monkeypatch):
    """Steps, members and companions, and what was made of them for ParaView; not what belongs to none, nor logs."""
    monkeypatch.chdir(tmp_path)
    kept = ("report.html", "steps/history.nc", "vtk/steps/history.vtu", "vtk/solids.vtm", "vtk/solids/stope.vtp")
    kept += ("coarse/steps/history.nc", "coarse/vtk/steps/history.vtu", "slices/grid.12.json", "figures/a.svg")
    kept += ("calibration/own/1.nc", "calibration/report.html", "plans/b/steps/m1.nc")
    left = (
        "coarse/steps/m2.nc",
        "ensemble/9/events/m1.nc",
        "record.nc",
        "steps/m2.nc",
        "vtk/steps/m2.vtu",
        "plans/b2/x.nc",
    )
    make(tmp_path / "results/a", *kept, *left)
    assert leftovers(Path("results/a"), PLAN) == sorted(left)
    assert leftovers(Path("results/none"), PLAN) == []


def test_many_are_counted():
    """The line stays a line."""
    text = leftovers_line(Path("results/a"), [f"steps/m{number}.nc" for number in range(20)])
    assert text.startswith("results/a: not part of the mine file's plan any more, and left as they are: steps/m0.nc, ")
    assert text.endswith("steps/m5.nc and 14 more")


def test_a_record_given_up_is_named_and_counts_again(spoiled, base, tiny_file, leave_empty):
    """The run without it says so; nothing of it is lost, and with it again it is not read anew."""
    before = hashes(spoiled / "results/tiny")
    without = changed(TINY)
    del without["record"]
    with edited(base / "files/tiny.yaml", without) as file:
        status, text = snakemake(file, spoiled, interpreter=leave_empty)
    assert status == 0, text
    assert "left as they are: comparison.nc, record.nc" in text
    assert hashes(spoiled / "results/tiny") == before
    assert jobs(snakemake(tiny_file, spoiled, "--dry-run")[1]) == {"report": 1, "all": 1}
