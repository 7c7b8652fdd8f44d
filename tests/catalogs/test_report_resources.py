"""The section of resources: a row for each stage of this plan, one for each other run."""

import json

import pytest

from catalogs.report.sections.resources import foreseen, read_resources
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


OWN = {"cell": 2.0, "end": 90_000, "processor": 180.0, "memory": 7e8, "error": 0.12}
RUN = {"cell": 2.0, "steps": 3, "members": 0, "companion": True, "made_of": ["grid", "rock"]}
ROWS = [
    {"stage": "steps/a", "processor": 200.0, "compiling": 20.0, "memory": 600.0},
    {"stage": "grid", "processor": 60.0, "compiling": 0.0, "memory": 500.0},
    {"stage": "elastic_rock, all stages", "processor": 900.0, "compiling": 0.0, "memory": 900.0},  # was in no quote
    {"stage": "vtk/steps/a", "processor": 900.0, "compiling": 0.0, "memory": 900.0},
]
QUOTE = {"own": OWN, "half": None, "steps": 3, "members": 0, "companion": True}


@pytest.mark.parametrize("half", [None, {"cell": 1.41, "processor": 600.0}])
def test_what_was_foreseen_stands_beside_what_it_took(tmp_path, half):
    (tmp_path / "quote.json").write_text(json.dumps(QUOTE | {"half": half, "made_of": RUN["made_of"]}))
    said = foreseen(tmp_path, ROWS, RUN, 92_000).replace("\u202f", ",")
    assert said.startswith("Before the run, 3 min of processor time, 0.7 GB at a time and 90,000 cells were foreseen. ")
    assert "It took 4 min without compiling, 0.6 GB in its largest stage, and 92,000 cells. " in said
    assert "error of potency and of failed volume was 12 %" in said
    assert said.endswith("Half of it needs cells of 1.41 m and about 10 min of processor time.") is bool(half)
    assert said.endswith("No cells are known to halve it.") is not bool(half)
    (tmp_path / "quote.json").unlink()
    assert foreseen(tmp_path, ROWS, RUN, 92_000, QUOTE | {"half": half}).replace("\u202f", ",") == said  # of a request


def test_what_was_foreseen_for_another_run_or_not_at_all_is_not_told(tmp_path):
    assert foreseen(tmp_path, ROWS, RUN, 92_000) == ""
    (tmp_path / "quote.json").write_text(json.dumps(QUOTE | {"made_of": RUN["made_of"]}))
    assert foreseen(tmp_path, ROWS, RUN, 92_000)
    for other in (
        {"cell": 1.0},
        {"steps": 4},
        {"members": 8},
        {"companion": False},
        {"made_of": ["grid", "weaker rock"]},
    ):
        assert foreseen(tmp_path, ROWS, RUN | other, 92_000) == ""
    assert foreseen(tmp_path, [], RUN, 92_000) == ""
    (tmp_path / "quote.json").write_text("{")
    assert foreseen(tmp_path, ROWS, RUN, 92_000) == ""
