"""The section of resources: a row for each stage of this plan, one for each other run."""

from catalogs.report.sections.resources import read_resources
from common.costs import Costs


def test_companion_and_members_are_one_row_each_of_the_resources(tmp_path):
    """Times add up, the largest peak counts; members in order of their numbers, after the mine's own stages. A stage
    that is under way has no row."""
    runs = [("ensemble/10", "steps/a", 1, 5), ("ensemble/2", "steps/a", 3, 7), ("ensemble/2", "events", 4, 6)]
    runs += [("", "coarse", 3, 2), ("", "comparison", 1, 1)]
    for run, stage, seconds, peak in runs:
        path = tmp_path / run / f"{stage}.log"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{Costs(seconds, 1.0, 0.5, peak).closing_line(stage)}\n")
    (tmp_path / "report.log").write_text("at work\n")
    rows = read_resources(tmp_path, {"a"}, set(), 10)
    parts = [f"{run}, all stages" for run in ("coarse", "ensemble/2", "ensemble/10")]
    assert [row["stage"] for row in rows] == [parts[0], "comparison", *parts[1:]]
    found = [tuple(row[name] for name in ("seconds", "processor", "compiling", "memory")) for row in rows[::2]]
    assert found == [(3, 1, 0.5, 2), (7, 2, 1, 7)]


def test_resources_are_of_the_stages_of_this_plan(tmp_path):
    """A plan that once had another step, a record, a companion and more members has left their logs, and so has an
    earlier version; other plans and a calibration have a page of their own."""
    for stage in ("grid", "steps/a", "steps/old", "vtk/steps/old", "record", "coarse", "ensemble/1/steps/a",
                  "ensemble/1/steps/old", "ensemble/2/steps/a", "plans/b/steps/a", "calibration/own/1", "comparison",
                  "events/a", "ensemble/1/events/a", "catalog", "quakeml", "coarse/grid"):  # fmt: skip
        path = tmp_path / f"{stage}.log"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{Costs(2, 1.0, 0.5, 3).closing_line(stage)}\n")
    rows = read_resources(tmp_path, {"a"}, {"record", "coarse", "comparison"}, 1)
    assert [(row["stage"], row["seconds"]) for row in rows] == [
        ("grid", 2), ("steps/a", 2), ("ensemble/1, all stages", 2)
    ]  # fmt: skip
