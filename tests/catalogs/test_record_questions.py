"""What a CSV or QuakeML record leaves open or says twice: zones, offsets, units, missing values, words, conversions."""

import json

import numpy as np
import pytest
from csv_fixtures import COLUMNS, read, refused
from test_event_kinds import event, quakeml

from catalogs.records.times import ZONES_OF_ABBREVIATION, check_zone, parse_time
from common.errors import InputError
from workflow.dates import read_date

HEADER = "time,x,y,z,mw,q,kind,state\n"
PLAIN_HEADER = "time,x,y,z,mw\n"


def table(values=("1",) * 6, kinds=("",) * 6, states=("",) * 6, header: str = HEADER) -> str:
    """Six events; values: of column q."""
    rows = enumerate(zip(values, kinds, states, strict=True), 1)
    lines = [f"2019-08-0{n}T06:00:00,{n},2,3,{0.1 * n:g},{value},{kind},{state}" for n, (value, kind, state) in rows]
    return header + "\n".join(lines) + "\n"


# ---- zones ----


def named(name: str, other: str = "q") -> tuple[str, dict]:
    return table(header=HEADER.replace("time", name).replace("q", other)), COLUMNS | {"time": name}


def test_times_without_a_zone_are_told_on_the_terminal(tmp_path, caplog):
    read(tmp_path, table())
    assert "record.csv: 6 times have no zone: read as UTC; give record.time_zone if they are local" in caplog.text
    caplog.clear()
    read(tmp_path, table().splitlines()[0] + "\n" + table().splitlines()[1] + "\n")
    assert "record.csv: 1 time has no zone: read as UTC" in caplog.text
    caplog.clear()
    read(tmp_path, table(), time_zone="UTC")
    read(tmp_path, *named("Origin Time (UTC)"))
    read(tmp_path, table().replace("06:00:00", "06:00:00Z"))
    assert "zone" not in caplog.text


@pytest.mark.parametrize(
    "name",
    [
        "Local Time",
        "LocalDateTime",
        "time_local",
        "LOCALTIME",
        "Ortszeit",
        "heure locale",
        "Time (AEST)",
        "Origin Time (IST)",
        "time_CAT",
    ],
)
def test_a_name_that_says_local_asks_for_the_zone(tmp_path, name):
    """Six hours of Hobart are ten behind those of UTC."""
    text, columns = named(name)
    line = refused(tmp_path, text, columns)
    assert f"column {name!r}: local times of which zone (6 such)? say it with record.time_zone" in line
    there = read(tmp_path, text, columns, time_zone="Australia/Hobart")
    assert there["time"].values[0] == np.datetime64("2019-07-31T20:00", "ns")
    assert read(tmp_path, text, columns, time_zone="UTC")["time"].values[0] == np.datetime64("2019-08-01T06:00", "ns")
    assert read(tmp_path, text.replace("06:00:00", "06:00:00+10:00"), columns).sizes["event"] == 6


@pytest.mark.parametrize("other", ["Time UTC", "local_time"])
def test_another_column_of_time_makes_one_without_a_word_doubtful(tmp_path, other):
    text, columns = named("time", other)
    assert f"column 'time': are its times local or UTC? Column '{other}' is there, too" in refused(
        tmp_path, text, columns
    )
    assert read(tmp_path, text, columns, time_zone="UTC").sizes["event"] == 6


def test_an_offset_in_a_name_is_a_zone_that_the_key_must_not_contradict(tmp_path):
    text, columns = named("Time (UTC+8)")
    assert "say it with record.time_zone: '+08:00'" in refused(tmp_path, text, columns)
    assert "is of +08:00 by its name, and record.time_zone is +10:00" in refused(
        tmp_path, text, columns, time_zone="+10:00"
    )
    assert read(tmp_path, text, columns, time_zone="+08:00")["time"].values[0] == np.datetime64("2019-07-31T22", "ns")
    utc = named("UTC time")
    for zone in ("+10:00", "Etc/GMT-10", "Europe/London"):
        assert f"is in UTC by its name, and record.time_zone is {zone}" in refused(tmp_path, *utc, time_zone=zone)
    for zone in ("UTC", "Etc/GMT", "Etc/UCT", "GMT0", "Zulu", "+00:00"):  # all are UTC
        assert read(tmp_path, *utc, time_zone=zone)["time"].values[0] == np.datetime64("2019-08-01T06", "ns")
    assert "is of +08:00 by its name" in refused(tmp_path, text, columns, time_zone="Etc/GMT")
    assert read(tmp_path, text, columns, time_zone="Etc/GMT-8").sizes["event"] == 6


@pytest.mark.parametrize(
    ("zone", "place"),
    [("EST", "Australia/Sydney"), ("CST", "Asia/Shanghai"), ("IST", "Europe/Dublin"), ("BST", "Europe/London"),
     ("CET", "Africa/Algiers"), ("MST", "America/Phoenix"), ("est", "America/Toronto"), ("AEST", "Australia/Brisbane")],
)  # fmt: skip
def test_an_abbreviation_of_a_zone_is_asked_about(tmp_path, zone, place):
    """In the key, and at the end of times. Eastern Standard Time is five hours behind UTC, or ten ahead."""
    line = refused(tmp_path, table(), time_zone=zone)
    assert "record.time_zone" in line
    assert f"'{zone}' is an abbreviation" in line
    assert place in line
    line = refused(tmp_path, table().replace("06:00:00", f"06:00:00 {zone}"))
    assert "column 'time'" in line
    assert "name a place with record.time_zone: " in line
    assert place in line


def test_places_named_for_an_abbreviation_are_zones():
    for places in ZONES_OF_ABBREVIATION.values():
        for place in places.split(", "):
            assert check_zone(place)
    for zone in ("GB", "NZ", "Japan", "UTC", "Etc/GMT+5", "EST5EDT"):
        assert check_zone(zone)


@pytest.mark.parametrize("zone", ["localtime", "posixrules", "Factory"])
def test_the_zone_of_the_computer_is_none_of_a_record(tmp_path, zone):
    assert f"record.time_zone: '{zone}' is no zone" in refused(tmp_path, table(), time_zone=zone)


def test_localities_and_results_are_not_local_times(tmp_path, caplog):
    text, columns = named("Result time", "Localisation date")
    assert read(tmp_path, text, columns).sizes["event"] == 6


# ---- offsets ----

NO_OFFSETS = ["+99:00", "+10:75", "-30:00", "+14:15", "-12:15", "+05:20", "+1475", "-13"]


@pytest.mark.parametrize("offset", NO_OFFSETS)
def test_offsets_that_no_clock_has_are_refused_wherever_times_come_in(tmp_path, offset):
    """In the text of a time, in a column of its own, in the key, in dates of the mine file and in QuakeML."""
    says = "no clock has this offset from UTC; they run from -12:00 to +14:00"
    assert says in refused(tmp_path, table().replace("06:00:00", f"06:00:00{offset}"))
    apart = COLUMNS | {"time": ["time", "q"]}
    assert says in refused(tmp_path, table(values=[offset] * 6), apart)
    assert says in refused(tmp_path, table(), time_zone=offset)
    for function in (parse_time, lambda text, where: read_date(where, text)):
        with pytest.raises(InputError, match=r"key: .*no clock has this offset"):
            function(f"2019-08-01T06:00:00{offset}", "key")
    with pytest.raises(InputError, match=r"record\.xml: event 1: .*no clock has this offset"):
        quakeml(tmp_path, event("a", "earthquake"), change=lambda text: text.replace(":00Z<", f":00{offset}<"))


@pytest.mark.parametrize("text", ["2019-W10-1", "2019W101", "2019-060", "20190801", "01/02/2019", "2019-08", "2019"])
@pytest.mark.parametrize("key", ["start", "end"])
def test_dates_of_a_filter_are_written_as_those_of_steps(tmp_path, key, text):
    """Weeks and numbered days of ISO 8601 were read as dates."""
    says = rf"record\.filter\.{key}: '{text}' does not match: expected a date such as 2019-08-31"
    with pytest.raises(InputError, match=says):
        read(tmp_path, table(), filter={key: text})


@pytest.mark.parametrize("text", ["2019-08-01", "2019-08-01 06:00", "2019-08-01T16:00:00.5+10:00", "2019-08-01T06:00Z"])
def test_dates_of_a_filter_may_have_a_time_and_an_offset(tmp_path, text):
    assert read(tmp_path, table(), filter={"start": text}).sizes["event"] > 0


@pytest.mark.parametrize("text", ["01/02/2019", "2019-02-30T00:00:00Z", "now", "2019-08-01T25:00:00Z"])
def test_a_time_of_quakeml_that_is_none_is_refused(tmp_path, text):
    """Its event was left out as one without a time."""
    with pytest.raises(InputError, match=r"record\.xml: event 1: .* is not a date and time of QuakeML"):
        quakeml(tmp_path, event("a", "earthquake"), change=lambda file: file.replace("2019-08-01T00:00:00Z", text))


@pytest.mark.parametrize("offset", ["+14:00", "-12:00", "+05:45", "+12:45", "-09:30", "Z"])
def test_offsets_of_clocks_are_read(tmp_path, offset):
    record = read(tmp_path, table().replace("06:00:00", f"06:00:00{offset}"))
    assert record["time"].values[0] == np.datetime64(parse_time(f"2019-08-01T06:00:00{offset}", ""), "ns")
    if offset != "Z":
        assert check_zone(offset)


# ---- units ----


def unit_of(folder, header: str, **others) -> float:
    """The factor that x is read with, from a header for it and keys."""
    text = table(header=HEADER.replace("x,", f"{header},", 1))
    return float(read(folder, text, COLUMNS | {"x": header}, **others)["location"][0, 0])


@pytest.mark.parametrize(
    ("header", "factor"),
    [
        ("Easting (ft)", 0.3048), ("Easting [KM]", 1000.0), ("X (Feet)", 0.3048), ("X/km", 1000.0), ("X_m", 1.0),
        ("X (m ASL)", 1.0), ("X (ft below collar)", 0.3048), ("X {mm}", 1e-3), ("X (usft)", 1200 / 3937),
        ("X (E)", 1.0), ("X (mine grid)", 1.0), ("Easting", 1.0),
    ],
)  # fmt: skip
def test_a_unit_in_a_header_is_read_and_must_not_contradict_the_key(tmp_path, header, factor):
    assert unit_of(tmp_path, header) == pytest.approx(factor)
    silent = header in ("X (E)", "X (mine grid)", "Easting")
    for unit, size in (("m", 1.0), ("km", 1000.0), ("ft", 0.3048)):
        if silent or size == factor:
            assert unit_of(tmp_path, header, units={"x": unit}) == pytest.approx(size)
        else:
            text = table(header=HEADER.replace("x,", f"{header},", 1))
            line = refused(tmp_path, text, COLUMNS | {"x": header}, units={"x": unit})
            assert f"column {header!r} is in" in line
            assert f"by its name, and in {unit} by record.units.x; correct the one that is wrong" in line


@pytest.mark.parametrize("header", ["X, km", "DepthKm", "x ft", "X-ft"])
def test_a_name_that_ends_as_a_unit_is_asked_about_once(tmp_path, header):
    text = table(header=HEADER.replace("x,", f'"{header}",', 1))
    assert f"column {header!r}: is it in" in refused(tmp_path, text, COLUMNS | {"x": header})
    unit = header[-2:].lower()
    assert read(tmp_path, text, COLUMNS | {"x": header}, units={"x": unit})["location"][0, 0] != 1.0


@pytest.mark.parametrize("header", ["X (s)", "X [J]", "X (deg)", "X (MJ)"])
def test_a_column_of_another_kind_by_its_header_is_refused(tmp_path, header):
    text = table(header=HEADER.replace("x,", f"{header},", 1))
    assert "which is not convertible to m" in refused(tmp_path, text, COLUMNS | {"x": header})
    globe = {"time": "time", "latitude": "Latitude (m)", "longitude": "y", "depth": "z", "mw": "mw"}
    text = table(header=HEADER.replace("x,", "Latitude (m),", 1))
    assert "column 'Latitude (m)' is in m; a latitude is in degrees" in refused(tmp_path, text, globe)


@pytest.mark.parametrize("header", ["Log Mo (dyn cm)", "log M0 [dyne-cm]", "lgM0 (log10 dyn.cm)"])
def test_logarithms_of_moments_take_the_unit_of_their_header(tmp_path, header):
    """log10 of 0.1 dyn cm is -1, and 1e-8 N m."""
    columns = {key: COLUMNS[key] for key in ("time", "x", "y", "z")} | {"log_moment": header}
    text = table(header=HEADER.replace(",mw", f",{header}")).replace("2,3,0.", "2,3,10.")
    assert np.log10(read(tmp_path, text, columns)["moment"].values[0]) == pytest.approx(10.1 - 7)
    assert "by record.units.log_moment" in refused(tmp_path, text, columns, units={"log_moment": "N m"})
    scaled = text.replace(header, "M0 (10^12 N m)")
    columns = {key: COLUMNS[key] for key in ("time", "x", "y", "z")} | {"moment": "M0 (10^12 N m)"}
    assert "is not a unit that can be read" in refused(tmp_path, scaled, columns, units={"moment": "N m"})


# ---- filters of numbers ----


def test_a_filter_over_text_is_refused_with_the_texts_and_the_columns_there_are(tmp_path):
    """Half of the column was text and passed no filter, without a word."""
    half = table(values=["1", "bad", "2", "n/a", "<3", ""])
    line = refused(tmp_path, half, filter={"maximum": {"q": 100}})
    assert "record.filter.maximum.q: 2 of 6 values are no numbers ('bad', '<3')" in line
    assert "filter by another column: time, x, y, z, mw, kind" in line
    left = read(tmp_path, half, filter={"maximum": {"q": 100}, "without": {"q": ["bad", "<3"]}})
    assert left["location"].values[:, 0].tolist() == [1, 3]
    line = refused(tmp_path, half, filter={"maximum": {"Q": 1, "r": 2}, "only": {"s": "a"}})
    assert "columns 'Q' (record.filter.maximum.Q; did you mean q?), 'r' (record.filter.maximum.r), 's' (" in line
    assert "are missing; it has time, x, y, z, mw, q, kind, state" in line


@pytest.mark.parametrize("code", ["-999", "-99.0", "-9999", "", "NaN", "n/a"])
def test_events_without_a_value_are_left_out_by_a_filter_and_counted(tmp_path, caplog, code):
    """-999 is below every maximum."""
    record = read(tmp_path, table(values=["1", code, "2", code, "300", code]), filter={"maximum": {"q": 100}})
    assert record["location"].values[:, 0].tolist() == [1, 3]
    assert "record.filter.maximum.q: 3 of 6 events have no value in this column and are left out" in caplog.text


@pytest.mark.parametrize("code", ["9999", "99999", "-999.25", "9999.9"])
def test_other_codes_of_missing_values_are_asked_about(tmp_path, code):
    coded = table(values=["1", code, "2", code, "3", "4"])
    line = refused(tmp_path, coded, filter={"minimum": {"q": 0}})
    assert f"column 'q': is {code} a missing value (2 such; the others run from 1 to 4)?" in line
    answered = read(tmp_path, coded, filter={"minimum": {"q": 0}}, missing=[float(code)])
    assert answered.sizes["event"] == 4
    assert read(tmp_path, coded, missing=[]).sizes["event"] == 6  # no filter asks of it


@pytest.mark.parametrize(("column", "code"), [("x", "9999"), ("z", "99999"), ("mw", "-9.9"), ("mw", "9.9")])
def test_codes_in_coordinates_and_sizes_are_asked_about(tmp_path, column, code):
    lines = table().splitlines()
    place = HEADER.split(",").index(column)
    for number in (2, 3):
        cells = lines[number].split(",")
        cells[place] = code
        lines[number] = ",".join(cells)
    line = refused(tmp_path, "\n".join(lines))
    assert f"column {column!r}: is {code} a missing value (2 such" in line
    assert "record.missing" in line


def test_a_decimal_comma_in_the_column_of_a_filter_is_one(tmp_path):
    rows = [f"2019-08-0{n};{n};2;3;0,{n};{n},5;;" for n in range(1, 7)]
    text = "\n".join([HEADER.strip().replace(",", ";"), *rows])
    assert read(tmp_path, text, filter={"maximum": {"q": 3}}).sizes["event"] == 2


def test_a_word_that_no_event_has_is_told(tmp_path, caplog):
    states = ["manual", "automatic", "manual", "manual", "automatic", ""]
    read(tmp_path, table(states=states), filter={"without": {"state": ["automatik"]}})
    assert "record.filter.without.state: no event has 'automatik'; there are 'manual', 'automatic', ''" in caplog.text


# ---- words and conversions ----


def test_all_unknown_words_are_asked_about_at_once_with_the_lines_to_paste(tmp_path):
    kinds = ["Seismic", "microseismic", "Seismic", "E: a", "", "Seismic"]
    states = ["accepted", "processed", "accepted", "final", "", "accepted"]
    columns = COLUMNS | {"event_type": "kind", "evaluation_status": "state"}
    text = table(kinds=kinds, states=states)
    line = refused(tmp_path, text, columns, filter={"keep": "blast"})
    for words in ("3 of 6 events are of type 'Seismic'", "1 of 6 events are of type 'microseismic'",
                  "3 of 6 events are 'accepted'", "1 of 6 events are 'processed'"):  # fmt: skip
        assert words in line
    keep = "{keep: [blast, Seismic, microseismic, 'E: a', accepted, processed]}"
    without = "{without: {event_type: [Seismic, microseismic, 'E: a'], evaluation_status: [accepted, processed]}}"
    assert f"filter: {keep}" in line
    assert f"filter: {without}" in line
    assert read(tmp_path, text, columns, filter=_pasted(keep)).sizes["event"] == 6
    assert json.loads(read(tmp_path, text, columns, filter=_pasted(without)).attrs["filter"])[-1]["after"] == 1


def _pasted(text: str) -> dict:
    import yaml

    return yaml.safe_load(text)


def test_all_missing_columns_are_told_at_once(tmp_path):
    line = refused(tmp_path, table(header=HEADER.replace("x,y", "East,North")), COLUMNS | {"z": "elevation"})
    assert "columns 'x' (record.columns.x), 'y' (record.columns.y), 'elevation' (record.columns.z) are missing" in line


@pytest.mark.parametrize("kind", ["Mw", "MW", " mww", "Mwc"])
@pytest.mark.parametrize("conversion", [{"slope": 2.0, "offset": 0.0}, "none"])
def test_a_moment_magnitude_needs_no_conversion(tmp_path, kind, conversion):
    """It was left as it stands, and its conversion forgotten."""
    typed = {key: COLUMNS[key] for key in ("time", "x", "y", "z")} | {"magnitude": "mw", "magnitude_type": "kind"}
    line = refused(tmp_path, table(kinds=[kind.strip()] * 6), typed, conversions={kind: conversion})
    assert f"record.conversions.{kind.strip()}: is a moment magnitude already" in line
    ml = {"ML": {"slope": 2.0, "offset": 0.0}}
    assert "record.conversions: of which magnitude?" in refused(tmp_path, table(), conversions=ml)


@pytest.mark.parametrize("name", ["ML", "Magnitude (ML)", "mag_mb", "Md"])
def test_a_magnitude_of_another_type_by_its_name_is_no_mw(tmp_path, name):
    text = table(header=HEADER.replace("mw", name))
    assert "is by its name no Mw" in refused(tmp_path, text, COLUMNS | {"mw": name})
    text = table(header=HEADER.replace("mw", "Mw (from ML)"))
    assert read(tmp_path, text, COLUMNS | {"mw": "Mw (from ML)"}).sizes["event"] == 6


def test_events_that_lack_something_are_counted_on_the_terminal(tmp_path, caplog):
    read(tmp_path, table().replace("3,2,3,0.3", "-999,2,3,0.3").replace("4,2,3,0.4", "4,2,3,-99"))
    assert "of 6 events these are left out: 1 without a place, 1 without a size" in caplog.text


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("Nm", 1.0), ("kNm", 1e3), ("MNm", 1e6), ("GNm", 1e9), ("N m", 1.0), ("dyn cm", 1e-7), ("nm", 1.0)],
)
def test_moments_in_the_usual_spelling_of_their_unit(tmp_path, unit, factor):
    """Nm is a unit of yarn to the library of units, so that it was refused, and GNm was taken for N m."""
    text = PLAIN_HEADER.replace("mw", f"Moment ({unit})") + "".join(
        f"2019-08-{day:02d}T12:00:00Z,100,200,300,{day}e9\n" for day in range(1, 7)
    )
    columns = {key: name for key, name in COLUMNS.items() if key != "mw"} | {"moment": f"Moment ({unit})"}
    np.testing.assert_allclose(read(tmp_path, text, columns)["moment"], factor * 1e9 * np.arange(1, 7))
    plain = columns | {"moment": "M0"}
    text = text.replace(f"Moment ({unit})", "M0")
    found = read(tmp_path, text, plain, units={"moment": unit})["moment"]
    np.testing.assert_allclose(found, factor * 1e9 * np.arange(1, 7))


def test_years_of_two_digits_at_the_front_are_asked_about(tmp_path):
    """They were days, and events of one day of the month were left."""
    rows = "".join(f"19-08-{day:02d} 12:00,100,200,300,-1\n" for day in range(1, 8))
    line = refused(tmp_path, PLAIN_HEADER + rows)
    assert "'19-08-01 12:00': the first number is 19 to 19 and the last one varies: is the year first?" in line
    one_day = "".join(f"19-08-19 {hour:02d}:00,100,200,300,-1\n" for hour in range(7))
    assert read(tmp_path, PLAIN_HEADER + one_day).sizes["event"] == 7


def test_rows_that_begin_as_comments_are_counted(tmp_path, caplog):
    rows = "".join(f"{'#' * (day > 4)}2019-08-{day:02d}T12:00:00Z,100,200,300,-1\n" for day in range(1, 8))
    assert read(tmp_path, PLAIN_HEADER + rows).sizes["event"] == 4
    assert "3 rows begin with # and are left out as comments" in caplog.text


@pytest.mark.parametrize("text", ['{"events": [' + "1 2 3 " * 40_000 + "]}", " ###\n" + PLAIN_HEADER])
def test_what_is_no_table_is_one_line(tmp_path, text):
    """A field longer than any of a table, and a line of nothing but marks of comments, were tracebacks."""
    assert "record.csv" in refused(tmp_path, text)
