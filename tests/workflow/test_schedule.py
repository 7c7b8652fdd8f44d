"""A schedule and drawings make the steps: as the same mine written by hand, with a line for each mistake."""

import copy
import csv
import itertools
import json
import os
from pathlib import Path

import ezdxf
import numpy as np
import omf
import pandas as pd
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from tiny_mines import ROOT, TINY, changed, merged
from workbooks import write_xlsx

from common.errors import InputError
from mpm_core.geometry import build_shape
from workflow.configuration import load, load_mine
from workflow.schedule_periods import calendar_periods, period_of

HEAD = ["body", "start", "end", "filled", "fill"]
UNDATED = {key: value for key, value in TINY.items() if key not in ("steps", "excavations", "record")}
UNDATED |= {"materials": {**TINY["materials"], "paste": TINY["materials"]["fill"]}}
LAYERS = ["A", "B", "C", "D"]


def solid(number: int, edge: float = 4.0):
    """A box by itself among 20 in a row."""
    low = np.array([1.0 + 5 * (number % 20), 1.0 + 5 * (number // 20), 40.0])
    shape = {"name": "b", "shape": "box", "lower": low.tolist(), "upper": (low + edge).tolist()}
    return build_shape(shape, 3)


def write_dxf(path: Path, layers: list[str], first: int = 0) -> Path:
    """A drawing with a box on each layer."""
    drawing = ezdxf.new("R2000")
    drawing.header["$INSUNITS"] = 6
    for number, layer in enumerate(layers, first):
        body = solid(number)
        for facet in body.facets:
            drawing.modelspace().add_3dface(body.vertices[facet], dxfattribs={"layer": layer})
    path.parent.mkdir(parents=True, exist_ok=True)
    drawing.saveas(path)
    return path


def write_table(path: Path, rows: list[tuple], head: list[str] = HEAD) -> Path:
    """A CSV file; rows may be shorter than the head."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([head, *([*row, *[""] * (len(head) - len(row))] for row in rows)])
    return path


@pytest.fixture
def mine(tmp_path):
    """The mine of a table, rows or the text of its file, and of solids, by default those of a drawing with four."""

    def loaded(table, *, name="year.csv", solids=None, base=UNDATED, more=None, **schedule):
        solids = solids or [{"file": "stopes.dxf"}]
        if solids[0]["file"] == "stopes.dxf" and not (tmp_path / "stopes.dxf").exists():
            write_dxf(tmp_path / "stopes.dxf", LAYERS)
        if isinstance(table, str):
            (tmp_path / name).write_text(table, encoding="utf-8")
        elif table is not None:
            write_table(tmp_path / name, table)
        text = copy.deepcopy(base) | {"schedule": {"file": name, "solids": solids, **schedule}} | (more or {})
        (tmp_path / "mine.yaml").write_text(yaml.safe_dump(text, sort_keys=False))
        return load(merged(text), tmp_path / "mine.yaml")

    return loaded


@pytest.fixture
def lines(mine, tmp_path):
    """The lines that such a mine is refused with, without the names of the mine's file and of the folder."""

    def refused(*args, **kwargs) -> list[str]:
        with pytest.raises(InputError) as error:
            mine(*args, **kwargs)
        return [
            line.removeprefix(f"{tmp_path}/mine.yaml: ").replace(_shown(tmp_path), "") for line in error.value.lines
        ]

    return refused


def _shown(folder: Path) -> str:
    return f"{os.path.relpath(folder)}/"


def steps_of(mine) -> dict[str, tuple[str, str]]:
    """Step that mines each body, and step that fills it."""
    return {
        entry.name: (entry.step, "" if entry.fill_material is None else entry.fill_step) for entry in mine.excavations
    }


RIGHT = [
    ("A", "2024-01-02", "2024-01-20", "2024-02-10", "paste"),
    ("B", "2024-01-15", "2024-02-05", "2024-04-01", "paste"),
    ("C", "2024-03-01", "2024-03-31", "", "none"),
    ("D", "", "planned", "", "paste"),
]


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
    assert note == "schedule: bodies that begin before the step in which they end are mined in that step: B"


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


def test_a_section_in_plan_has_no_solids(lines):
    """One line for all bodies."""
    flat = {"plane": "xz", "domain": {"lower": ["0 m", "0 m"], "upper": ["80 m", "80 m"]}}
    (line,) = lines(RIGHT, more=flat)
    assert line.startswith("schedule.file: year.csv: row 1: A: a plane strain scene needs a shape in its plane")
    assert line.endswith("(and 3 more like it)")


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


# ---- 300 bodies ----

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


# ---- mistakes ----

MISTAKES = {
    "a body without a row": (
        RIGHT[:3],
        "schedule.solids: stopes.dxf: D: has no row in year.csv; add one, with planned as its end if it has no date "
        "yet",
    ),
    "a row without a body": (
        [*RIGHT, ("E7", "", "planned")],
        "schedule.file: year.csv: row 5: E7: no body of the solids has this name",
    ),
    "a row that names none": (
        [*RIGHT, ("", "", "2024-01-01")],
        "schedule.file: year.csv: row 5: no body: column 'body' is empty; name the body, or delete the row",
    ),
    "a row twice": (
        [*RIGHT, ("a", "", "planned")],
        "schedule.file: year.csv: row 5: a: this body has a row already (row 1); leave one out",
    ),
    "no date": (
        [*RIGHT[:3], ("D", "2024-01-01")],
        "schedule.file: year.csv: row 4: D: column 'end' is empty; give a date, history or planned",
    ),
    "an end before its start": (
        [*RIGHT[:3], ("D", "2024-02-01", "2024-01-31")],
        "schedule.file: year.csv: row 4: D: mining ends before it starts, on 2024-02-01; correct the dates",
    ),
    "a fill before the end": (
        [*RIGHT[:3], ("D", "", "2024-01-31", "2024-01-30", "paste")],
        "schedule.file: year.csv: row 4: D: is filled on 2024-01-30, before mining ends on 2024-01-31; correct the "
        "dates",
    ),
    "a material that is none": (
        [*RIGHT[:3], ("D", "", "2024-01-31", "", "cement")],
        "schedule.file: year.csv: row 4: D: 'cement' is not one of the materials host, fill, paste, none",
    ),
    "a fill that fails": (
        [*RIGHT[:3], ("D", "", "2024-01-31", "", "host")],
        "schedule.file: year.csv: row 4: D: 'host' is coulomb; only elastic fill is supported",
    ),
    "a fill without a material": (
        [*RIGHT[:3], ("D", "", "2024-01-31", "2024-02-02")],
        "schedule.file: year.csv: row 4: D: has a date of fill and no material; name it in the table, or for all by "
        "schedule.fill",
    ),
    "a fill of nothing": (
        [*RIGHT[:3], ("D", "", "2024-01-31", "2024-02-02", "none")],
        "schedule.file: year.csv: row 4: D: has a date of fill, and none as its material; leave one of the two out",
    ),
    "a fill in history": (
        [*RIGHT[:3], ("D", "", "2024-01-31", "history", "paste")],
        "schedule.file: year.csv: row 4: D: is filled in history but not mined in it; give the date of the fill",
    ),
    "no date at all": (
        [*RIGHT[:3], ("D", "", "soon")],
        "schedule.file: year.csv: row 4: D: column 'end': 'soon' is no date; write it as 2024-03-31, or history or "
        "planned",
    ),
    "a month of 13": (
        [*RIGHT[:3], ("D", "2024-13-01", "2024-01-31")],
        "schedule.file: year.csv: row 4: D: column 'start': '2024-13-01' is no date; write it as 2024-03-31",
    ),
    "a year that is none": (
        [*RIGHT[:3], ("D", "", "0204-01-31")],
        "schedule.file: year.csv: row 4: D: column 'end': '0204-01-31' is no date; write it as 2024-03-31, or history "
        "or planned",
    ),
    "a number": (
        [*RIGHT[:3], ("D", "", "45352")],
        "schedule.file: year.csv: row 4: D: column 'end': '45352' is no date; write it as 2024-03-31, or history or "
        "planned",
    ),
    "day or month": (
        [*RIGHT[:3], ("D", "", "03/04/2024")],
        "schedule.file: year.csv: '03/04/2024': day or month first? no day is above 12; say it with "
        "schedule.date_order: day or month",
    ),
}


@pytest.mark.parametrize("kind", MISTAKES)
def test_a_mistake_is_one_line_with_file_row_and_body(lines, kind):
    table, line = MISTAKES[kind]
    assert lines(table) == [line]


def test_all_mistakes_come_at_once_and_none_follows_from_another(lines):
    """In all rows, in the solids and elsewhere in the mine's file, where an excavation names a step of the schedule."""
    table = [
        ("A", "2024-01-02", "2023-01-20"),
        ("a", "2024-01-02", "2024-01-20"),
        ("STRANGER", "", "2024-02-05"),
        ("C", "", "soon", "later"),
    ]
    drive = {"name": "drive", "step": "2024-07", "file": "stopes.dxf", "layer": "B"}
    found = lines(table, more={"excavations": [drive], "solver": {"tolerance": 7}})
    assert [line.split(": ")[0] for line in found].count("schedule.file") == 5
    assert [line.split(": ")[2] for line in found if line.startswith("schedule.solids")] == ["B", "D"]
    assert [line for line in found if not line.startswith("schedule")] == [
        "solver.tolerance: 7 is greater than the maximum of 0.1"
    ]


def test_more_mistakes_than_a_screen_holds_are_all_told(lines, tmp_path):
    names = [f"S{number}" for number in range(50)]
    write_dxf(tmp_path / "many.dxf", names)
    found = lines([("none of them", "", "planned")], solids=[{"file": "many.dxf"}])
    assert len(found) == 51
    assert not [line for line in found if "more mistakes" in line]


def test_a_slip_is_told_with_the_name_that_may_be_meant(lines, tmp_path):
    write_dxf(tmp_path / "one.dxf", ["STOPE_12"])
    found = lines([("STOPE_21", "", "planned")], solids=[{"file": "one.dxf"}])
    assert found == [
        "schedule.file: year.csv: row 1: STOPE_21: no body of the solids has this name; did you mean STOPE_12?",
        "schedule.solids: one.dxf: STOPE_12: has no row in year.csv; did you mean STOPE_21?",
    ]


def test_a_body_in_two_files_is_told(lines, tmp_path):
    write_dxf(tmp_path / "one.dxf", ["A", "B"])
    write_dxf(tmp_path / "two.dxf", ["C", "b"], 5)
    rows = [(name, "", "2024-01-20") for name in "ABC"]
    found = lines(rows, solids=[{"file": "one.dxf"}, {"file": "two.dxf"}])
    assert found == [
        "schedule.solids: two.dxf: b: one.dxf has a body of this name already; rename one, or choose bodies with layer "
        "or element"
    ]


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"name": "missing.csv", "table": None}, "schedule.file: missing.csv is missing; paths resolve from"),
        (
            {"table": "Stope,end\nA,planned\n"},
            "schedule.file: year.csv: column 'body' (schedule.columns.body) is missing",
        ),
        ({"solids": [{"file": "a.dxf"}]}, "schedule.solids[0].file: a.dxf is missing; paths resolve from"),
        ({"solids": [{"file": "x/*.stl"}]}, "schedule.solids[0].file: x/*.stl is missing; paths resolve from"),
        ({"solids": [{"file": "**.stl"}]}, "schedule.solids[0].file: **.stl is missing; paths resolve from"),
        ({"name": "y" * 300 + ".csv", "table": None}, f"schedule.file: {'y' * 300}.csv is missing; paths resolve"),
        ({"name": "a\0.xlsx", "table": None}, "schedule.file: a\0.xlsx is missing; paths resolve"),
        (
            {"solids": [{"file": "stopes.dxf", "layer": "X*"}]},
            "schedule.solids[0]: stopes.dxf: no body has a name that",
        ),
        ({"solids": [{"file": "year.csv"}]}, "schedule.solids[0]: year.csv: not one of the formats .dxf, .obj"),
        ({"sheet": "Plan"}, "schedule.file: year.csv: a CSV file has no sheets; leave schedule.sheet out"),
        ({"start": "2024-04-01", "end": "2024-01-01"}, "schedule.end: 2024-01-01 is not after start, 2024-04-01"),
        ({"start": "2024-13-01"}, "schedule.start: '2024-13-01' is not a date"),
        (
            {"columns": {"period": "step"}},
            "schedule.file: year.csv: column 'step' (schedule.columns.period) is missing",
        ),
        ({"more": {"steps": [{"name": "history"}]}}, "steps: follow from schedule; leave them out"),
    ],
)
def test_mistakes_of_keys_and_files(lines, values, line):
    values = {"table": RIGHT} | values
    found = lines(values.pop("table"), **values)
    assert len(found) == 1
    assert found[0].startswith(line), found


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


def test_a_name_of_the_table_and_of_the_file_is_told(lines):
    found = lines(RIGHT, more={"excavations": [{"name": "B", "step": "2024-01", "file": "stopes.dxf", "layer": "A"}]})
    assert "schedule.file: year.csv: row 2: B: this name stands twice" in found


# ---- dates and columns ----


@pytest.mark.parametrize(
    ("dates", "keys"),
    [
        (("20/01/2024", "05/02/2024"), {}),
        (("02/01/2024", "05/02/2024"), {"date_order": "day"}),
        (("01/02/2024", "02/05/2024"), {"date_order": "month"}),
        (("20-Jan-24", "5 February 2024"), {}),
        (("2024-01-20 14:30", "2024-02-05T00:00:00"), {}),
        (("2024-02-01", "2024-03-01"), {"ends": "day_after"}),
    ],
)
def test_dates_as_tables_write_them(mine, dates, keys):
    made = mine([("A", "", dates[0]), ("B", "", dates[1]), ("C", "", "planned"), ("D", "", "History")], **keys)
    assert [step for step, _ in steps_of(made).values()] == ["2024-01", "2024-02", "planned", "history"]


def test_columns_have_the_names_of_the_file(mine):
    """Of a semicolon file with lines above its header, and a material for all."""
    table = (
        "Plan of the year\n\nSTOPE;Finish;Paste placed;t\n"
        + "a;2024-01-20;2024-02-03;1\nB;planned;;1\nc;planned;;\nD;planned;;\n"
    )
    made = mine(
        table, columns={"body": "STOPE", "end": "Finish", "filled": "Paste placed"}, fill="paste", end="2024-04-01"
    )
    assert steps_of(made)["A"] == ("2024-01", "2024-03")
    assert made.excavations[0].fill == "paste"
    assert [entry.name for entry in made.excavations] == LAYERS


# ---- solids of all formats ----


def write_omf(path: Path, names: list[str]) -> None:
    project = omf.Project(name="mine")
    project.elements = [
        omf.SurfaceElement(
            name=name, geometry=omf.SurfaceGeometry(vertices=solid(number).vertices, triangles=solid(number).facets)
        )
        for number, name in enumerate(names)
    ]
    omf.OMFWriter(project, str(path))


def write_gocad(path: Path, names: list[str]) -> None:
    lines = []
    for number, name in enumerate(names):
        lines += ["GOCAD TSurf 1", "HEADER {", f"name:{name}", "}", "TFACE"]
        lines += ["VRTX {} {} {} {}".format(place, *vertex) for place, vertex in enumerate(solid(number).vertices)]
        lines += [*("TRGL {} {} {}".format(*facet) for facet in solid(number).facets), "END"]
    path.write_text("\n".join(lines) + "\n")


def write_obj(path: Path, names: list[str], key: str = "o") -> None:
    lines, before = [], 1
    for number, name in enumerate(names):
        body = solid(number)
        lines += [f"{key} {name}", *("v {} {} {}".format(*vertex) for vertex in body.vertices)]
        lines += ["f {} {} {}".format(*(facet + before)) for facet in body.facets]
        before += len(body.vertices)
    path.write_text("\n".join(lines) + "\n")


def write_stl(path: Path, names: list[str]) -> None:
    lines = []
    for number, name in enumerate(names):
        lines.append(f"solid {name}")
        for corners in solid(number).corners(np.zeros(3)):
            vertices = ["vertex {} {} {}".format(*corner) for corner in corners]
            lines += ["facet normal 0 0 0", "outer loop", *vertices, "endloop", "endfacet"]
        lines.append(f"endsolid {name}")
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(
    ("file", "write"),
    [
        ("s.omf", write_omf),
        ("s.ts", write_gocad),
        ("s.obj", write_obj),
        ("g.obj", lambda path, names: write_obj(path, names, "g")),
        ("s.stl", write_stl),
    ],
)
def test_bodies_of_other_formats(mine, tmp_path, file, write):
    """Also those of a pattern alone."""
    write(tmp_path / file, ["A", "B", "C", "D", "TOPO"])
    made = mine(RIGHT, solids=[{"file": file, "element": "?", "units": "m"}])
    assert [entry.given() for entry in made.excavations][:2] == [
        {
            "name": "A",
            "step": "2024-01",
            "file": file,
            "element": "A",
            "units": "m",
            "fill": "paste",
            "filled": "2024-03",
        },
        {
            "name": "B",
            "step": "2024-02",
            "file": file,
            "element": "B",
            "units": "m",
            "fill": "paste",
            "filled": "planned",
        },
    ]
    assert [entry.name for entry in made.excavations] == LAYERS


def test_a_file_for_each_body_is_called_by_its_name(mine, tmp_path):
    """STL files of one solid, whatever the solid is called in them; a drawing with one layer."""
    (tmp_path / "stopes").mkdir()
    for name in "abc":
        write_stl(tmp_path / "stopes" / f"{name}.stl", ["export"])
    write_dxf(tmp_path / "d.dxf", ["0"])
    made = mine(RIGHT, solids=[{"file": "stopes/*.stl"}, {"file": "d.dxf"}])
    assert [entry.name for entry in made.excavations] == LAYERS
    assert [entry.file for entry in made.excavations] == [*(f"stopes/{name}.stl" for name in "abc"), "d.dxf"]
    assert made.excavations[3].layer == "0"


def test_names_that_no_excavation_may_have_are_written_with_underscores(mine, tmp_path):
    write_dxf(tmp_path / "odd.dxf", ["Stope 12-3.5", "B"])
    made = mine([("stope 12-3.5", "", "2024-01-20"), ("B", "", "planned")], solids=[{"file": "odd.dxf"}])
    assert [(entry.name, entry.layer) for entry in made.excavations] == [("Stope_12-3_5", "Stope 12-3.5"), ("B", "B")]


def test_a_name_that_is_too_long_is_told(lines, tmp_path):
    name = "L" * 70
    write_dxf(tmp_path / "long.dxf", [name])
    (line,) = lines([(name, "", "planned")], solids=[{"file": "long.dxf"}])
    assert line.startswith(f"schedule.file: year.csv: row 1: {name}: name: 'LLL")


def test_a_hidden_layer_is_a_body_if_the_table_names_it(mine, tmp_path):
    path = write_dxf(tmp_path / "hidden.dxf", ["A", "B", "OLD"])
    drawing = ezdxf.readfile(path)
    drawing.layers.add("B").off()
    drawing.layers.add("OLD").freeze()
    drawing.saveas(path)
    made = mine(RIGHT[:2], solids=[{"file": "hidden.dxf"}])
    assert [entry.name for entry in made.excavations] == ["A", "B"]


# ---- Excel ----

SHEET = [
    ["Plan", "", "", ""],
    ["body", "end", "filled", "fill"],
    ["A", pd.Timestamp("2024-01-20"), pd.Timestamp("2024-02-03"), "paste"],
    [12.0, pd.Timestamp("2024-02-05"), "", ""],
    ["", "", "", ""],
]


def test_a_sheet_reads_as_the_same_table(mine, tmp_path, monkeypatch):
    """Dates and whole numbers as the sheet has them."""
    write_dxf(tmp_path / "two.dxf", ["A", "12"])
    (tmp_path / "year.xlsx").touch()
    asked = {}
    monkeypatch.setattr(pd, "read_excel", lambda path, **keys: asked.update(keys) or pd.DataFrame(SHEET, dtype=object))
    made = mine(None, name="year.xlsx", solids=[{"file": "two.dxf"}], sheet="Plan 2024", end="2024-04-01")
    assert steps_of(made) == {"A": ("2024-01", "2024-03"), "12": ("2024-02", "")}
    assert asked["sheet_name"] == "Plan 2024"
    assert asked["engine"] == "calamine"


def test_without_the_package_an_excel_file_is_one_line(lines, tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise ImportError("Missing optional dependency 'python_calamine'.")

    (tmp_path / "year.xlsx").touch()
    monkeypatch.setattr(pd, "read_excel", refuse)
    found = lines(None, name="year.xlsx")
    assert found == [
        "schedule.file: year.xlsx: Excel files need the package python-calamine, which is not installed; install it, "
        "or save the sheet as CSV"
    ]


def test_an_excel_file(mine, lines, tmp_path):
    pytest.importorskip("python_calamine")
    write_xlsx(tmp_path / "year.xlsx", SHEET[1:3], "Plan")
    write_dxf(tmp_path / "one.dxf", ["A"])
    made = mine(None, name="year.xlsx", solids=[{"file": "one.dxf"}], sheet="Plan", end="2024-04-01")
    assert steps_of(made) == {"A": ("2024-01", "2024-03")}
    (line,) = [line for line in lines(None, name="year.xlsx", solids=[{"file": "one.dxf"}], sheet="No") if "No" in line]
    assert line.startswith("schedule.file: year.xlsx: not readable (")


# ---- the shipped mine ----


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
