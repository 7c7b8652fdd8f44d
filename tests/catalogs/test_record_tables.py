"""CSV files as mines export them: what can be found from the file is, what cannot is asked for, nothing is guessed."""

import datetime
import json

import numpy as np
import pandas as pd
import pytest
from catalog_fixtures import SHEAR
from csv_fixtures import COLUMNS, PLAIN, read, refused, settings_of
from workbooks import write_xlsx

from catalogs.records import read_record
from common.errors import InputError

EXPECTED = {
    "time": ["2019-08-01T12:00:00", "2019-08-13T00:00:00.500"],
    "location": [[100.5, 200, 300], [110, 1200, 300]],
    "mw": [-1.0, 0.5],
}


SEMICOLON = "time;x;y;z;mw\n01.08.2019 12:00;100,5;200;300;-1\n13.08.2019 00:00:00,5;110;1.200,0;300;0,5\n"
FORMS = {  # one table in many forms: text, how its columns are named if not as in COLUMNS, other settings
    "plain": (PLAIN, {}, {}),
    "semicolons, decimal commas, day first": (SEMICOLON, {}, {}),
    "byte order mark": (SEMICOLON.encode("utf-8-sig"), {}, {}),
    "UTF-16, tabs": (PLAIN.replace(",", "\t").encode("utf-16"), {}, {}),
    "bars and blanks": (PLAIN.replace(",", " | "), {}, {}),
    "Windows line ends": (PLAIN.replace("\n", "\r\n"), {}, {}),
    "lines before the header": ("Mine A; exported 2019-12-01\n\n" + SEMICOLON, {}, {}),
    "comments": ("# x, y, z in m\n" + PLAIN + "# end\n", {}, {}),
    "units below the header": (SEMICOLON.replace("mw\n", "mw\n;m;m;m;\n"), {}, {}),
    "thousands": (PLAIN.replace("1200", '"1,200.0"'), {}, {}),
    "latin-1 names": (PLAIN.replace("time,x", "durée é,x").encode("latin-1"), {"time": "durée é"}, {}),
    "two columns of time": (
        PLAIN.replace("time,x", "date,clock,x").replace("T12", ",12").replace("T00", ",00"),
        {"time": ["date", "clock"]},
        {},
    ),
    "local time with offset": (
        PLAIN.replace("01T12:00:00", "01 22:00:00 +10:00").replace("13T00:00:00.5", "13 10:00:00.5 +10:00"), {}, {},
    ),
    "local time of a zone": (
        PLAIN.replace("01T12:00:00", "01 22:00:00").replace("13T00:00:00.5", "13 10:00:00.5"), {},
        {"time_zone": "Australia/Hobart"},
    ),
    "month first": (
        PLAIN.replace("2019-08-01T12:00:00", "8/1/2019 12:00 PM").replace("2019-08-13T00:", "8/13/2019 12:")
        .replace(".5,", ".5 AM,", 2).replace("100.5 AM", "100.5"), {}, {},
    ),
    "order told": (SEMICOLON.replace("13.08.2019", "1.8.2019"), {}, {"date_order": "day"}),
    "months by name": (PLAIN.replace("2019-08-01T", "01-Aug-2019 ").replace("2019-08-13T", "13 AUG 19 "), {}, {}),
    "feet, from the header": (
        PLAIN.replace(",x,y,z", ",x (ft),y [m],z").replace("100.5", repr(100.5 / 0.3048))
        .replace("110,", f"{110 / 0.3048!r},"),
        {"x": "x (ft)", "y": "y [m]"}, {},
    ),
    "kilometres, told": (PLAIN.replace("1200", "1.2").replace(",200,", ",0.2,"), {}, {"units": {"y": "km"}}),
    "a row there twice": (PLAIN + PLAIN.splitlines()[1] + "\n", {}, {}),
    "names that begin as an archive does": (PLAIN.replace("time,x", "PK id,x"), {"time": "PK id"}, {}),
    "blanks between thousands": (SEMICOLON.replace("1.200,0", "1 200,0"), {}, {}),
    "one of ten columns": (PLAIN.replace("\n", ",,,a b;c,\n"), {}, {}),
    "a zip by name only": (PLAIN, {}, {"name": "record.csv.zip"}),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_one_table_in_many_forms_is_one_record(tmp_path, form):
    text, names, others = FORMS[form]
    record = read(tmp_path, text, COLUMNS | names, **others)
    times = EXPECTED["time"] if form != "order told" else [EXPECTED["time"][0], "2019-08-01T00:00:00.500"]
    np.testing.assert_array_equal(record["time"].values, np.array(times, "datetime64[ns]"))
    np.testing.assert_allclose(record["location"], EXPECTED["location"], rtol=1e-12)
    np.testing.assert_allclose(record["mw"], EXPECTED["mw"], rtol=1e-12)
    zone = others.get("time_zone", "UTC")
    said = f" without an offset, as {zone}"
    assert (form == "local time with offset") == ("times_text" not in record.attrs)
    assert said in record.attrs.get("times_text", said)


def test_hours_that_a_clock_showed_twice_are_counted_and_taken_as_the_later(tmp_path):
    """Hobart set its clocks back from 3 to 2 on 7 April 2019: 2:30 was 15:30 and 16:30 UTC. Nothing was said of it."""
    texts = ["2019-04-07T01:59:59", "2019-04-07T02:00:00", "2019-04-07T02:30:00", "2019-04-07T03:00:00", ""]
    rows = "".join(f"{text},{x},2,3,-1\n" for x, text in enumerate(texts))
    record = read(tmp_path, PLAIN.splitlines()[0] + "\n" + rows, COLUMNS, time_zone="Australia/Hobart")
    utc = ["2019-04-06T14:59:59", "2019-04-06T16:00:00", "2019-04-06T16:30:00", "2019-04-06T17:00:00"]
    np.testing.assert_array_equal(record["time"].values, np.array(utc, "datetime64[ns]"))
    assert record.attrs["times_text"] == (
        "4 without an offset, as Australia/Hobart; 2 in an hour that the clock showed twice, taken as the later: they "
        "may be an hour too late"
    )
    for zone in ("+10:00", "Australia/Brisbane"):  # no summer time
        record = read(tmp_path, PLAIN.splitlines()[0] + "\n" + rows, COLUMNS, time_zone=zone)
        assert record.attrs["times_text"] == f"4 without an offset, as {zone}"


def test_sizes_are_read_in_the_units_that_the_header_says(tmp_path):
    """A moment of 1e16 dyn cm is 1e9 N m."""
    text = PLAIN.replace("mw\n", "M0 (dyn.cm)\n").replace(",-1.0\n", ",1e16\n").replace(",0.5\n", ",1e17\n")
    columns = {key: COLUMNS[key] for key in ("time", "x", "y", "z")} | {"moment": "M0 (dyn.cm)"}
    np.testing.assert_allclose(read(tmp_path, text, columns)["moment"], [1e9, 1e10])
    assert "not convertible to N m" in refused(tmp_path, text, columns, units={"moment": "m"})
    assert "'parrot' is not a unit" in refused(tmp_path, text, columns, units={"moment": "parrot"})
    assert "record.units.mw: not a named column with a unit" in refused(tmp_path, text, columns, units={"mw": "m"})


ROW = "2019-08-02,{x},{y},{z},{mw}\n"


def test_what_has_no_time_place_or_size_is_left_out_and_counted(tmp_path):
    """-99, -999, empty and NaN; a moment of 0, which no event has; once each, for its first lack."""
    good = {"x": 1, "y": 2, "z": 3, "mw": -1}
    bad = [{"mw": -99}, {"mw": -999.0}, {"mw": ""}, {"mw": "NaN"}, {"x": -999, "y": -999, "z": -999}, {"z": ""}]
    text = PLAIN + "".join(ROW.format(**good | one) for one in bad) + ROW.format(**good).replace("2019-08-02", "")
    record = read(tmp_path, text)
    assert record.sizes["event"] == 2
    assert record.attrs["rows"] == 9
    dropped = {"without a time": 1, "without a place": 2, "without a size": 4}
    assert json.loads(record.attrs["dropped"]) == dropped
    moments = text.replace(",-1\n", ",0\n").replace(",-1.0\n", ",1e9\n").replace(",0.5\n", ",1e9\n")
    columns = {key: COLUMNS[key] for key in ("time", "x", "y", "z")} | {"moment": "mw"}
    assert read(tmp_path, moments, columns).sizes["event"] == 2


def test_a_row_that_is_there_twice_counts_once(tmp_path):
    record = read(tmp_path, PLAIN + PLAIN.split("\n", 1)[1])
    assert record.sizes["event"] == 2
    assert json.loads(record.attrs["dropped"]) == {"there twice": 2}


def test_a_code_that_may_be_a_place_is_asked_for(tmp_path):
    """z = -999 is an elevation in a domain from -1200 to -900 m, and a missing value in one from 0 to 400."""
    text = PLAIN + ROW.format(x=100, y=200, z=-999, mw=-1)
    shallow = {"lower": [0, 0, 0], "upper": [2000, 2000, 400], "plane": None}
    deep = {"lower": [0, 0, -1200], "upper": [2000, 2000, 400], "plane": None}
    assert json.loads(read(tmp_path, text, domain=shallow).attrs["dropped"]) == {"without a place": 1}
    assert "say it with record.missing" in refused(tmp_path, text, domain=deep)
    assert read(tmp_path, text, domain=deep, missing=[]).sizes["event"] == 3
    assert read(tmp_path, text, domain=deep, missing=[-999]).sizes["event"] == 2


POTENCY = {"time": "time", "x": "x", "y": "y", "z": "z", "potency": "mw"}
FAULTS = {  # text, settings, what the line says
    "day or month": (SEMICOLON.replace("13.08", "02.08"), {}, "record.date_order"),
    "both orders": (SEMICOLON.replace("01.08", "08.14"), {}, "both orders are in it"),
    "comma or thousands": (
        SEMICOLON.replace("100,5", "1,500").replace("0,5\n", "5\n").replace("1.200,0", "1200"), {}, "record.decimal",
    ),
    "a point among commas": (SEMICOLON.replace("110;", "110.25;"), {}, "write one kind"),
    "two numbers in a cell": (PLAIN.replace("110,", "1 10,"), {}, "'1 10' is not a number with a decimal point"),
    "both decimals": (SEMICOLON.replace("100,5", "1,500.25"), {}, "write one kind"),
    "year 3019": (PLAIN.replace("2019-08-13", "3019-08-13"), {}, "years run from 1678 to 2261"),
    "year 1": (PLAIN.replace("2019-08-13", "0001-08-13"), {}, "years run from 1678 to 2261"),
    "no such day": (PLAIN.replace("2019-08-13", "2019-02-30"), {}, "event 2 of 2: column 'time': '2019-02-30T"),
    "no such hour": (PLAIN.replace("T12:", "T25:"), {}, "is not a date and time"),
    "no such zone": (PLAIN, {"time_zone": "Mars/Olympus"}, "record.time_zone: 'Mars/Olympus'"),
    "Mw 400": (PLAIN.replace(",0.5\n", ",400\n"), {}, "event 2: Mw 400 "),
    "Mw 1e300": (PLAIN.replace(",0.5\n", ",1e300\n"), {}, "event 2: Mw"),
    "x of 1e300": (PLAIN.replace("100.5", "1e300"), {}, "event 1: x = 1e+300 m is no place on Earth"),
    "infinite x": (PLAIN.replace("100.5", "inf"), {}, "'inf' is not a number"),
    "a workbook": (b"PK\x03\x04 more", {}, "a zip archive or an Excel workbook"),
    "an old workbook": (b"\xd0\xcf\x11\xe0 more", {}, "an Excel workbook"),
    "zero bytes": (b"time,x,y,z,mw\n\0\0\0\n", {}, "zero bytes"),
    "no such column": (PLAIN.replace("y,z", "north,z"), {}, "column 'y' (record.columns.y) is missing; it has time"),
    "x twice": (PLAIN.replace("mw\n", "mw,x\n").replace("0\n", "0,1\n"), {}, "column 'x' is there 2 times"),
    "columns as a list": (PLAIN, {"columns": ["time", "x"]}, "record.columns"),
    "a column as a map": (PLAIN, {"columns": COLUMNS | {"x": {"name": "x"}}}, "record.columns.x: {'name': 'x'}"),
    "a column as a list": (PLAIN, {"columns": COLUMNS | {"x": ["x", "y"]}}, "record.columns.x: ['x', 'y']"),
    "a time of four columns": (PLAIN, {"columns": COLUMNS | {"time": ["x"] * 4}}, "record.columns.time"),
    "another magnitude": (PLAIN.replace("mw", "ML"), {"columns": COLUMNS | {"mw": "ML"}}, "'ML' is by its name"),
    "negative potency": (PLAIN, {"columns": POTENCY}, "name it in record.columns.log_potency"),
    "nothing whole": (PLAIN.replace(",300,", ",,"), {}, "has a time, a place and a size (2 without a place)"),
    "an open quote": (PLAIN.replace("100.5", '"100.5'), {}, "quotation marks open and do not close"),
    "more cells than names": (PLAIN.replace("0.5\n", "0.5,1,2,3\n"), {}, "not a readable CSV"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_what_cannot_be_told_or_cannot_be_is_one_line(tmp_path, fault):
    text, others, says = FAULTS[fault]
    columns = others.get("columns")
    line = refused(tmp_path, text, columns, **{key: value for key, value in others.items() if key != "columns"})
    assert says in line


@pytest.mark.parametrize(("column", "value"), [("latitude", 95), ("longitude", 181)])
def test_degrees_off_the_globe_are_one_line(tmp_path, column, value):
    row = {"latitude": -41.8, "longitude": 145.4, "depth": -950} | {column: value}
    text = "time,latitude,longitude,depth,mw\n2019-08-01," + ",".join(map(str, row.values())) + ",-1\n"
    columns = {name: name for name in ("time", "latitude", "longitude", "depth", "mw")}
    assert f"is no {column}, which ends at" in refused(tmp_path, text, columns)


# ---- magnitudes of other types ----

MIXED = "time,x,y,z,M,type\n2019-08-01,1,2,3,1.0,Mw\n2019-08-02,1,2,3,1.0,ML\n2019-08-03,1,2,3,0.0,ml\n"
MIXED += "2019-08-04,1,2,3,2.0,Md\n"
TYPED = {"time": "time", "x": "x", "y": "y", "z": "z", "magnitude": "M", "magnitude_type": "type"}


def test_foreign_magnitudes_are_refused_by_name(tmp_path):
    """Half a unit of magnitude between ML and Mw would be a factor of 5.6 in potency."""
    line = refused(tmp_path, MIXED, TYPED)
    assert "1 of 4 events are of type ML" in line
    assert "Md" in line
    assert "record.conversions: {ML: {slope: ..., offset: ...}}" in line
    assert "untyped" in refused(tmp_path, MIXED, {key: name for key, name in TYPED.items() if key != "magnitude_type"})


def test_a_stated_conversion_makes_them_moment_magnitudes_and_none_leaves_them_out(tmp_path):
    """Mw = 0.8 ML - 0.5; the potency is that of the converted magnitude."""
    record = read(tmp_path, MIXED, TYPED, conversions={"ML": {"slope": 0.8, "offset": -0.5}, "md": "none"})
    np.testing.assert_allclose(record["mw"], [1.0, 0.3, -0.5])
    np.testing.assert_allclose(record["potency"] * SHEAR, 10 ** (1.5 * np.array([1.0, 0.3, -0.5]) + 9.1))
    assert json.loads(record.attrs["dropped"]) == {"without a size": 1}
    assert record.attrs["sizes_text"] == "1 Mw, 1 ML as Mw = 0.8 ML - 0.5, 1 ml as Mw = 0.8 ml - 0.5, 1 Md left out"


def converted(slope: float) -> dict:
    return {"slope": slope, "offset": 0.0}


def test_a_type_is_converted_by_its_own_name_first(tmp_path):
    """ML and ml in one file are two types where both are stated, one where one is."""
    record = read(tmp_path, MIXED, TYPED, conversions={"ML": converted(0.5), "ml": "none", "Md": converted(1)})
    np.testing.assert_allclose(record["mw"], [1.0, 0.5, 2.0])
    other = read(tmp_path, MIXED, TYPED, conversions={"ml": "none", "ML": converted(0.5), "MD": converted(1)})
    np.testing.assert_array_equal(other["mw"], record["mw"])


def test_two_conversions_of_which_either_may_be_meant_are_asked_about(tmp_path):
    """Neither is the file's own name; where they say the same there is nothing to ask."""
    types = MIXED.replace(",ml", ",ML")
    line = refused(tmp_path, types, TYPED, conversions={"Ml": converted(0.5), "mL": "none", "Md": "none"})
    assert "record.conversions: Ml and mL state different things" in line
    assert "name ML itself" in line
    assert read(tmp_path, types, TYPED, conversions={"Ml": "none", "mL": "none", "Md": "none"}).sizes["event"] == 1
    twice = {"ML": converted(0.5), " ML": "none", "Md": "none"}
    assert "record.conversions.ML: this type stands there twice" in refused(tmp_path, types, TYPED, conversions=twice)


def test_mb_and_mB_are_two_magnitudes(tmp_path):
    """Short-period and broad-band body waves: a conversion of the one says nothing of the other."""
    text = MIXED.replace(",ml", ",mB").replace(",ML", ",mb")
    line = refused(tmp_path, text, TYPED, conversions={"mb": converted(0.5), "Md": "none"})
    assert "1 of 4 events are of type mB" in line
    record = read(tmp_path, text, TYPED, conversions={"mb": converted(0.5), "mB": converted(2), "Md": "none"})
    np.testing.assert_allclose(record["mw"], [1.0, 0.5, 0.0])


def test_a_foreign_magnitude_beside_a_known_potency_is_not_asked_for(tmp_path):
    """The potency is the size; the other column says nothing of it."""
    rows = [line + f",{0.1 * number}" for number, line in enumerate(MIXED.splitlines())]
    text = "\n".join([MIXED.splitlines()[0] + ",P", *rows[1:]])
    record = read(tmp_path, text, TYPED | {"potency": "P"})
    np.testing.assert_allclose(record["potency"], [0.1, 0.2, 0.3, 0.4])


# ---- workbooks ----


def workbook(folder, rows: list[list], **others) -> dict:
    """Settings of a record in the sheet `Events` of a workbook."""
    settings = settings_of(folder, b"", name="record.xlsx", **others)
    write_xlsx(folder / "record.xlsx", rows, "Events")
    return settings


ROWS = [
    ["Catalogue of a mine", "", "", "", ""],
    ["time", "x", "y", "z", "mw"],
    [pd.Timestamp("2019-08-01T12:00:00"), 100.5, 200.0, 300.125, -1.0],
    [pd.Timestamp("2019-08-13T00:00:30"), 1234.567, 1200.0, 300.0, 0.5],
]


@pytest.mark.parametrize("others", [{}, {"sheet": "Events"}])
def test_a_sheet_of_a_workbook_is_read_as_a_csv_file_is(tmp_path, others):
    """Numbers with three decimals are no thousands."""
    record = read_record(workbook(tmp_path, ROWS, **others))
    np.testing.assert_array_equal(record["location"], [[100.5, 200, 300.125], [1234.567, 1200, 300]])
    times = np.array(["2019-08-01T12:00:00", "2019-08-13T00:00:30"], "datetime64[ns]")
    assert np.abs(record["time"].values - times).max() < np.timedelta64(2, "ms")
    np.testing.assert_allclose(record["mw"], [-1.0, 0.5])


@pytest.mark.parametrize(
    ("rows", "others", "says"),
    [
        (ROWS, {"sheet": "No"}, "record.xlsx: not readable ("),
        ([*ROWS[:2], ["2019-08-01", "1,5", 2.0, 3.0, 1.0]], {}, "'1,5' is not a number with a decimal point"),
        ([["time", "x", "y", "mw"], ["2019-08-01", 1.0, 2.0, 0.0]], {}, "column 'z' (record.columns.z) is missing"),
        ([], {}, "record.xlsx: not a readable CSV file (it is empty)"),
        (ROWS, {"decimal": "comma"}, "record.decimal: an Excel file needs none"),
        (ROWS, {"encoding": "gbk"}, "record.encoding: an Excel file needs none"),
    ],
)
def test_a_workbook_that_is_not_as_named_is_one_line(tmp_path, rows, others, says):
    with pytest.raises(InputError) as caught:
        read_record(workbook(tmp_path, rows, **others))
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_sheet_may_have_dates_and_clocks_in_two_columns(tmp_path):
    """A date in a cell is midnight of it to the reader of workbooks."""
    rows = [["Date", "Clock", "x", "y", "z", "mw"]]
    rows += [[pd.Timestamp(f"2019-08-{day:02d}"), datetime.time(12, day), 1.0, 2.0, 3.0, -1.0] for day in (1, 2, 3)]
    columns = {key: name for key, name in COLUMNS.items() if key != "time"} | {"time": ["Date", "Clock"]}
    times = read_record(workbook(tmp_path, rows, columns=columns))["time"].values
    expected = [f"2019-08-{day:02d}T12:{day:02d}" for day in (1, 2, 3)]
    assert np.abs(times - np.array(expected, "datetime64[ns]")).max() < np.timedelta64(2, "ms")


def test_a_sheet_of_dates_and_texts_of_dates_is_one_line(tmp_path):
    """Excel makes dates of days up to 12, with day and month exchanged, and leaves the others."""
    rows = [["time", "x", "y", "z", "mw"], [pd.Timestamp("2019-02-01"), 1.0, 2.0, 3.0, -1.0]]
    rows += [["13/01/2019", 1.0, 2.0, 3.0, -1.0]]
    with pytest.raises(
        InputError, match=r"record.xlsx: a column has 1 dates \(2019-02-01\) and 1 texts \(13/01/2019\)"
    ):
        read_record(workbook(tmp_path, rows))


def test_a_damaged_workbook_and_a_sheet_of_a_csv_file_are_one_line(tmp_path):
    settings = workbook(tmp_path, ROWS)
    path = tmp_path / "record.xlsx"
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(InputError, match=r"record\.xlsx: not readable \("):
        read_record(settings)
    assert "record.sheet: a CSV file has no sheets" in refused(tmp_path, PLAIN, sheet="Events")
