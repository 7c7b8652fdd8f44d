"""A schedule and drawings make the steps, as the same mine written by hand does."""

import copy
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scheduled_mines import RIGHT, UNDATED, write_dxf
from tiny_mines import ROOT, changed, merged

from workflow.configuration import load, load_mine

COUNT = 300
WIDE = changed(UNDATED, **{"domain.upper": ["160 m", "80 m", "80 m"]})


def long_table() -> list[tuple]:
    """Rows of 300 bodies in no order: history, dated in 24 months, planned."""
    random = np.random.default_rng(3)
    rows = []
    for number in random.permutation(COUNT):
        name, first = f"ST_{number:03d}", pd.Timestamp("2021-10-01") + pd.Timedelta(days=int(random.integers(0, 800)))
        last = first + pd.Timedelta(days=int(random.integers(5, 40)))
        filled = last + pd.Timedelta(days=int(random.integers(0, 60)))
        dates = [f"{day:%Y-%m-%d}" for day in (first, last, filled)]
        rows.append((name, "", "planned") if number % 50 == 7 else (name, *dates, ["paste", "fill"][number % 2]))
    return rows


def by_hand(rows: list[tuple], months: list[str]) -> dict:
    """The same mine as its user would write it, month by month."""
    begins = [f"{month}-01" for month in months]
    ends = [*begins[1:], f"{pd.Timestamp(begins[-1]) + pd.offsets.MonthBegin():%Y-%m-%d}"]
    excavations = []
    for name, _, last, *fill in sorted(rows):
        entry = {"name": name, "file": "stopes.dxf", "layer": name}
        step = last if last == "planned" else "history" if last < begins[0] else last[:7]
        entry |= {"step": step}
        if fill:
            later = [month for month, begin in zip(months, begins, strict=True) if begin >= fill[0] and begin > last]
            entry |= {"fill": fill[1], "filled": later[0] if later else "planned"}
        excavations.append(entry)
    steps = [{"name": "history"}] + [
        {"name": month, "start": start, "end": end} for month, start, end in zip(months, begins, ends, strict=True)
    ]
    return {"excavations": excavations, "steps": steps}


def all_slices(mine) -> str:
    """Settings of all stages as JSON, to the byte."""
    slices = [mine.run_slices(), mine.events_slice(), mine.picture_slice(), mine.solids_slice(), mine.schedule()]
    return json.dumps([*slices, mine.comparison_slice(), mine.mined_openings()])


@pytest.fixture(scope="module")
def long_drawing(tmp_path_factory) -> Path:
    return write_dxf(tmp_path_factory.mktemp("long") / "stopes.dxf", [f"ST_{number:03d}" for number in range(COUNT)])


@pytest.fixture
def long_mine(long_drawing, mine, tmp_path):
    (tmp_path / "stopes.dxf").write_bytes(long_drawing.read_bytes())

    def loaded(rows):
        return mine(rows, base=WIDE, solids=[{"file": "stopes.dxf"}], start="2022-01-01")

    return loaded


def test_300_bodies_and_a_table_are_the_mine_written_by_hand(long_mine, tmp_path):
    rows = long_table()
    made = long_mine(rows)
    months = [step.name for step in made.listed_steps]
    assert len(months) == 25
    hand = load(merged(copy.deepcopy(WIDE) | by_hand(rows, months)), tmp_path / "hand.yaml")
    assert all_slices(made) == all_slices(hand)
    assert {entry.step for entry in made.excavations} == {"history", *months, "planned"}


def test_the_order_of_the_rows_changes_nothing(long_mine):
    rows = long_table()
    assert all_slices(long_mine(rows)) == all_slices(long_mine(sorted(rows, key=lambda row: row[1])))


def test_a_moved_date_changes_the_slices_of_later_steps_alone(long_mine):
    """A body of March 2023 moves to May: grid, elastic state and all steps before March stay."""
    rows = long_table()
    place = next(number for number, row in enumerate(rows) if row[2].startswith("2023-03"))
    moved = [*rows[:place], (*rows[place][:2], "2023-05-20", "2023-06-10", rows[place][4]), *rows[place + 1 :]]
    before, after = long_mine(rows).run_slices(), long_mine(moved).run_slices()
    assert before["grid"] == after["grid"]
    assert before["elastic"] == after["elastic"]
    pairs = zip(before["steps"], after["steps"], strict=True)
    different = [one["name"] for one, other in pairs if one != other]
    assert different[:1] == ["2023-03"]
    assert "2023-05" in different
    assert len(different) <= 4


def test_a_section_in_plan_has_no_solids(lines):
    """One line for all bodies."""
    flat = {"plane": "xz", "domain": {"lower": ["0 m", "0 m"], "upper": ["80 m", "80 m"]}}
    (line,) = lines(RIGHT, more=flat)
    assert line.startswith("schedule.file: year.csv: row 1: A: a plane strain scene needs a shape in its plane")
    assert line.endswith("(and 3 more like it)")


def test_the_shipped_mine_has_thirty_stopes_in_twelve_months():
    made = load_mine(ROOT / "config/mines/stoping_year.yaml")
    stopes = made.made_schedule.excavations
    assert len(stopes) == 30
    assert [step.name for step in made.listed_steps] == [f"2023-{month:02d}" for month in range(1, 13)]
    assert {entry.step for entry in stopes} == {step.name for step in made.steps} | {"planned"}
    assert all(
        made.step_index(entry.step) < made.step_index(entry.fill_step) or entry.fill_step == "planned"
        for entry in stopes
    )
