"""Bodies that several steps mine: parts of equal volume, each in the step in which it ends."""

import copy

import pytest
from scheduled_mines import RIGHT, UNDATED, steps_of
from test_schedule import all_slices
from tiny_mines import merged

from mpm_core.scene.scene_solids import read_entry
from workflow.configuration import load

QUARTERS = [{"file": "stopes.dxf", "parts": 4, "advance": "90 deg"}]
ROWS = [("A", "2024-01-16", "2024-03-15", "2024-04-01", "paste"), ("B", "2024-02-10", "2024-02-12"), *RIGHT[2:]]


def test_parts_are_mined_at_an_even_rate_and_filled_after_the_last(mine):
    """60 days from the middle of January: 15 in each part. A fill waits for the last part."""
    made = mine(ROWS, solids=QUARTERS, end="2024-05-01")
    steps = steps_of(made)
    assert [steps[f"A_{number}"] for number in range(1, 5)] == [(f"2024-0{month}", "2024-04") for month in (1, 2, 2, 3)]
    assert [steps[f"B_{number}"][0] for number in range(1, 5)] == ["2024-02"] * 4
    assert [steps[f"D_{number}"][0] for number in range(1, 5)] == ["planned"] * 4
    assert made.made_schedule.notes == []


def test_parts_have_equal_volumes_from_west_to_east(mine):
    made = mine(ROWS, solids=QUARTERS)
    solids = [read_entry(made.placed(entry), 3, "") for entry in made.excavations[:4]]
    assert [solid.volume for solid in solids] == pytest.approx([16.0] * 4)
    assert [solid.bounds[0][0] for solid in solids] == pytest.approx([1.0, 2.0, 3.0, 4.0])


def test_parts_are_the_mine_written_by_hand(mine, tmp_path):
    made = mine(ROWS, solids=QUARTERS)
    hand = copy.deepcopy(UNDATED) | {"steps": [step.given() for step in made.listed_steps]}
    hand["excavations"] = [
        {**entry.given(), **({"advance": "90 deg"} if entry.part else {})} for entry in made.excavations
    ]
    assert hand["excavations"][1]["part"] == [2, 4]
    assert all_slices(load(merged(hand), tmp_path / "hand.yaml")) == all_slices(made)


def test_a_moved_date_moves_no_wall(mine):
    """Cuts are those of volumes, not of dates: grid and elastic state stay."""
    moved = [("A", "2024-01-16", "2024-04-20", "2024-06-01", "paste"), *ROWS[1:]]
    before, after = (mine(rows, solids=QUARTERS, start="2024-01-01", end="2024-07-01") for rows in (ROWS, moved))
    assert before.run_slices()["grid"] == after.run_slices()["grid"]
    assert before.run_slices()["elastic"] == after.run_slices()["elastic"]


@pytest.mark.parametrize(
    ("solids", "rows", "line"),
    [
        ({"parts": 4}, ROWS, "schedule.solids[0].parts: stands without advance; give both, or leave both out"),
        ({"advance": "3 deg"}, ROWS, "schedule.solids[0].advance: stands without parts; give both, or leave both out"),
        (
            {"parts": 4, "advance": "0 deg"},
            [*ROWS[:3], ("D", "", "2024-03-04")],
            "schedule.file: year.csv: row 4: D: has no start; solids with parts are mined from the start to the end of "
            "their row",
        ),
    ],
)
def test_parts_need_a_direction_and_a_start(lines, solids, rows, line):
    assert lines(rows, solids=[{"file": "stopes.dxf", **solids}]) == [line]


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        (
            {"part": [3, 2], "advance": "0 deg"},
            "part: part 3 of 2; give its number, then how many there are",
        ),
        ({"part": [1, 2]}, "part: stands without advance; give both, or leave both out"),
        ({"advance": "0 deg"}, "advance: stands without part; give both, or leave both out"),
    ],
)
def test_a_part_of_an_excavation_that_is_none_is_one_line(lines, keys, line):
    drive = {"name": "drive", "step": "2024-01", "file": "stopes.dxf", "layer": "B", **keys}
    assert lines(RIGHT, more={"excavations": [drive]}) == [f"excavations.drive.{line}"]
