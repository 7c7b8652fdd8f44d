"""The table of a schedule, CSV or Excel: a line for each mistake, with its row and body."""

import pandas as pd
import pytest
from scheduled_mines import LAYERS, RIGHT, steps_of, write_dxf
from workbooks import write_xlsx

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
    "a fill of what is planned": (
        [*RIGHT[:3], ("D", "", "planned", "2024-02-02", "paste")],
        "schedule.file: year.csv: row 4: D: is filled on 2024-02-02, but its mining is planned; give the date of its "
        "end",
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
        "planned (45352 may be the number of a day in a spreadsheet: let the cell be a date)",
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


def test_a_material_that_is_missing_from_many_rows_is_one_line(lines):
    """Also of rows with parts; another wrong material has its own line."""
    table = [(name, "2024-01-01", "2024-01-31", "", "grout" if name < "D" else "mud") for name in "ABCD"]
    assert lines(table, solids=[{"file": "stopes.dxf", "parts": 3, "advance": "0 deg"}]) == [
        "schedule.file: year.csv: row 1: A: 'grout' is not one of the materials host, fill, paste, none (and 2 more "
        "like it)",
        "schedule.file: year.csv: row 4: D: 'mud' is not one of the materials host, fill, paste, none",
    ]


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


# ---- dates and columns ----


@pytest.mark.parametrize(
    ("dates", "keys"),
    [
        (("20/01/2024", "05/02/2024"), {}),
        (("02/01/2024", "05/02/2024"), {"date_order": "day"}),
        (("01/02/2024", "02/05/2024"), {"date_order": "month"}),
        (("20-Jan-24", "5 February 2024"), {}),
        (("2024-01-20 14:30", "2024-02-05T00:00:00"), {}),
        (("2024-01-31T23:00:00-05:00", "2024-02-01T00:00:00+02:00"), {}),
        (("2024-01-31 23:00 (UTC-05:00)", "2024-02-01 00:00 Z"), {}),
        (("2024-02-01", "2024-03-01"), {"ends": "day_after"}),
    ],
)
def test_dates_as_tables_write_them(mine, dates, keys):
    made = mine([("A", "", dates[0]), ("B", "", dates[1]), ("C", "", "planned"), ("D", "", "History")], **keys)
    assert [step for step, _ in steps_of(made).values()] == ["2024-01", "2024-02", "planned", "history"]


def test_days_and_months_that_a_program_may_have_exchanged_are_one_line(lines, tmp_path):
    """A program that expects the month first makes dates of 03/04/2024, and leaves 13/02/2024 as text."""
    names = list("ABCDEF")
    write_dxf(tmp_path / "six.dxf", names)
    days = ["13/02/2024", "2024-03-12", "2024-03-11", "2024-04-10", "2024-05-09", "2024-01-09"]
    rows = [(name, "", day) for name, day in zip(names, days, strict=True)]
    assert lines(rows, solids=[{"file": "six.dxf"}]) == [
        "schedule.file: year.csv: dates such as 13/02/2024 are text, and all 5 others, such as 2024-03-12, have days "
        "up to 12: a program may have exchanged day and month in these; write all dates as 2024-03-31"
    ]


def test_dates_of_both_kinds_are_read_where_nothing_was_exchanged(mine, tmp_path):
    names = list("ABCDEF")
    write_dxf(tmp_path / "six.dxf", names)
    days = ["13/02/2024", "2024-03-22", "2024-03-11", "2024-04-10", "2024-05-09", "2024-01-09"]
    made = mine([(name, "", day) for name, day in zip(names, days, strict=True)], solids=[{"file": "six.dxf"}])
    assert [step for step, _ in steps_of(made).values()] == [f"2024-0{month}" for month in (2, 3, 3, 4, 5, 1)]


def test_letters_of_an_unknown_encoding_are_one_line(lines, tmp_path):
    (tmp_path / "year.csv").write_bytes("body;end\nSchräg;planned\n".encode("cp1252"))
    write_dxf(tmp_path / "one.dxf", ["Schräg"])
    assert lines(None, solids=[{"file": "one.dxf"}])[0].startswith("schedule.file: year.csv: column 'body': 'Schräg'?")


def test_a_name_of_a_column_may_have_two_lines(mine):
    table = 'body,"start\nof mining",end\nA,,2024-01-20\nB,,planned\nC,,planned\nD,,planned\n'
    assert steps_of(mine(table, columns={"start": "start of mining"}))["A"] == ("2024-01", "")


def test_bodies_have_names_that_are_words_of_tables_elsewhere(mine, tmp_path):
    """A number sign begins no comment, and NA is no empty cell."""
    write_dxf(tmp_path / "odd.dxf", ["#12", "NA", "None"])
    made = mine(
        [("#12", "", "2024-01-20"), ("NA", "", "planned"), ("None", "", "planned")], solids=[{"file": "odd.dxf"}]
    )
    assert [entry.name for entry in made.excavations] == ["12", "NA", "None"]


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
