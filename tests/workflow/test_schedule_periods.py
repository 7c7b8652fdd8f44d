"""Periods of a schedule: each day lies in one, and a body is mined in the one in which it ends."""

import itertools

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scheduled_mines import RIGHT, steps_of, write_dxf

from workflow.schedule_periods import calendar_periods, period_of


def test_a_body_is_mined_in_the_month_it_ends_in_and_filled_before_a_later_one_begins(mine):
    made = mine(RIGHT)
    assert [step.name for step in made.listed_steps] == ["2024-01", "2024-02", "2024-03"]
    assert steps_of(made) == {
        "A": ("2024-01", "2024-03"),
        "B": ("2024-02", "planned"),
        "C": ("2024-03", ""),
        "D": ("planned", "planned"),
    }
    (note,) = made.made_schedule.notes
    assert note == (
        "schedule: bodies that begin before the step in which they end are mined in that step: B; "
        "schedule.solids.parts divides them"
    )


def test_a_fill_never_acts_in_the_step_that_mines(mine):
    """Mined and filled on the first day of a month, and mined in history."""
    made = mine(
        [
            ("A", "", "2024-02-01", "2024-02-01", "paste"),
            ("B", "", "2023-06-01", "2023-07-01", "paste"),
            ("C", "", "history", "history", "paste"),
            ("D", "", "history", "2024-02-01", "paste"),
        ],
        start="2024-01-01",
        end="2024-04-01",
    )
    assert steps_of(made) == {
        "A": ("2024-02", "2024-03"),
        "B": ("history", "2024-01"),
        "C": ("history", "history"),
        "D": ("history", "2024-02"),
    }


def test_fill_of_history_is_that_of_a_body_mined_before_the_start(mine):
    rows = [("A", "", "2023-05-10", "history", "paste"), *RIGHT[1:]]
    assert steps_of(mine(rows, start="2024-01-01"))["A"] == ("history", "history")


def test_what_ends_after_the_last_step_is_planned(mine):
    made = mine(RIGHT, end="2024-03-01", start="2024-02-01")
    assert [step.name for step in made.listed_steps] == ["2024-02"]
    assert [step for step, _ in steps_of(made).values()] == ["history", "2024-02", "planned", "planned"]


@pytest.mark.parametrize(
    ("period", "more", "names"),
    [
        ("quarter", {}, ["2024-Q1"]),
        ("week", {"start": "2024-01-18"}, [f"2024-{day}" for day in ("01-18", "01-25", "02-01", "02-08")]),
        ("week", {"end": "2024-02-01"}, ["2024-01-15", "2024-01-22", "2024-01-29"]),
        ("table", {}, ["2024-01-02", "2024-01-21", "2024-03-01"]),
    ],
)
def test_periods(mine, period, more, names):
    rows = [RIGHT[0], ("B", "2024-01-21", "2024-02-05"), RIGHT[2], RIGHT[3]]
    made = mine(rows, period=period, **more)
    assert [step.name for step in made.listed_steps][: len(names)] == names
    for step in made.listed_steps:
        assert step.start < step.end


def test_a_year_that_may_be_wrong_is_told(mine, lines):
    rows = [("A", "", "2042-01-20"), ("B", "", "2024-02-05"), *RIGHT[2:]]
    assert mine(rows).made_schedule.notes == [
        "schedule: nothing is mined in 213 steps in a row, 2024-04 to 2041-12; correct the dates if a year is wrong"
    ]
    assert lines([("A", "", "1924-01-20"), *RIGHT[1:]]) == [
        "schedule.period: month: makes 1203 steps, and 600 are possible; bodies end from 1924-01-20 (row 1: A) to "
        "2024-03-31 (row 3: C): correct a date, or give start and end"
    ]


def test_too_many_periods_without_a_date_are_one_line(lines):
    rows = [(*row[:2], "planned", "", "") for row in RIGHT]
    assert lines(rows, period="week", start="2010-01-01", end="2030-01-01") == [
        "schedule.period: week: makes 1044 steps, and 600 are possible; no body has a date: correct start and end"
    ]


def test_a_time_in_which_no_body_ends_is_told(mine):
    (note,) = mine(RIGHT, start="2042-01-01").made_schedule.notes
    assert note == "schedule: no body ends between schedule.start and schedule.end, so that there are no steps"


def test_periods_of_the_table_have_its_names_and_dates(mine):
    """Two bodies of one period; a month without any."""
    rows = [("A", "2024-01-01", "2024-01-31"), ("B", "2024-01-01", "2024-01-31"), ("C", "2024-03-01", "2024-03-31")]
    table = "body,start,end,when\n" + "\n".join(",".join([*row, f"p{row[1][6]}"]) for row in rows) + "\nD,,planned,\n"
    made = mine(table, period="table", columns={"period": "when"})
    assert [tuple(step.given().values()) for step in made.listed_steps] == [
        ("p1", "2024-01-01", "2024-02-01"),
        ("p3", "2024-03-01", "2024-04-01"),
    ]
    assert [step for step, _ in steps_of(made).values()] == ["p1", "p1", "p3", "planned"]


def test_periods_of_the_table_outside_of_the_time_are_no_steps(mine):
    """One that ends on the first day after it, too."""
    rows = [("A", "2023-12-01", "2023-12-31"), ("B", "2024-01-01", "2024-01-31"), ("C", "2024-01-25", "2024-02-01")]
    made = mine([*rows, RIGHT[3]], period="table", start="2024-01-01", end="2024-02-01")
    assert [step.name for step in made.listed_steps] == ["2024-01-01"]
    assert [step for step, _ in steps_of(made).values()] == ["history", "2024-01-01", "planned", "planned"]


days = st.dates(pd.Timestamp("1999-12-25").date(), pd.Timestamp("2030-01-10").date()).map(pd.Timestamp)


@given(st.sampled_from(["month", "week", "quarter"]), st.lists(days, min_size=1, max_size=8), st.none() | days, days)
def test_each_day_lies_in_one_period(kind, mined, start, day):
    """Without gaps or overlaps, from the first day that is mined in, or the start, to the last one."""
    periods = calendar_periods(kind, mined, start)
    for before, after in itertools.pairwise(periods):
        assert before.end == after.start
    assert len({period.name for period in periods}) == len(periods)
    inside = [period for period in periods if period.start <= day < period.end]
    assert inside == ([found] if (found := period_of(day, periods)) else [])
    for one in mined:
        assert (period_of(one, periods) is None) == (start is not None and one < start)
    if periods:
        assert periods[0].start <= (start or min(mined))
        assert period_of(max(mined), periods) == periods[-1]
        length = {"month": 31, "week": 7, "quarter": 92}[kind]
        assert all(pd.Timedelta(0) < period.end - period.start <= pd.Timedelta(days=length) for period in periods)


@pytest.mark.parametrize(
    ("kind", "first", "last", "names"),
    [
        ("month", "2023-12-31", "2024-01-01", ["2023-12", "2024-01"]),
        ("month", "2024-02-29", "2024-03-01", ["2024-02", "2024-03"]),
        ("quarter", "2024-03-31", "2024-04-01", ["2024-Q1", "2024-Q2"]),
        ("week", "2023-12-31", "2024-01-01", ["2023-12-25", "2024-01-01"]),
    ],
)
def test_the_last_day_of_a_period_is_its_own(kind, first, last, names):
    made = calendar_periods(kind, [pd.Timestamp(first), pd.Timestamp(last)])
    assert [period.name for period in made] == names
    assert [period_of(pd.Timestamp(day), made).name for day in (first, last)] == names


@pytest.mark.parametrize(
    ("table", "line"),
    [
        (
            "A,2024-01-01,2024-02-10\nB,2024-02-01,2024-02-29",
            "row 2: B: its period begins on 2024-02-01, before that of",
        ),
        (
            "A,2024-01-01,2024-01-31\nB,,2024-02-29",
            "row 2: B: column 'start' is empty; with period: table the row says",
        ),
        (
            "A,2024-01-01,2024-01-31,x\nB,2024-01-01,2024-01-31,y",
            "row 2: B: its period is y, and with the same dates x",
        ),
        ("A,2024-01-01,2024-01-31,x\nB,2024-02-01,2024-02-29,x", "row 2: B: period x has other dates in row 1"),
        ("A,2024-01-01,2024-01-31,x y\nB,2024-02-01,2024-02-29,z", "row 1: A: name: 'x y' does not match"),
    ],
)
def test_mistakes_of_periods_of_the_table(lines, tmp_path, table, line):
    write_dxf(tmp_path / "two.dxf", ["A", "B"])
    head = "body,start,end,step\n" if table.count(",") == 6 else "body,start,end\n"
    columns = {"columns": {"period": "step"}} if "step" in head else {}
    found = lines(head + table + "\n", solids=[{"file": "two.dxf"}], period="table", **columns)
    assert len(found) == 1
    assert found[0].startswith(f"schedule.file: year.csv: {line}"), found
