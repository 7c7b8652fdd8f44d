"""Tables of others: encodings, times that are numbers, sizes that are logarithms or energies, what services write."""

import json

import numpy as np
import pytest
from catalog_fixtures import SHEAR
from csv_fixtures import COLUMNS, PLAIN, read, refused

from common.errors import InputError

TIMES = np.array(["2019-08-01T12:00:00", "2019-08-13T00:00:00.500"], "datetime64[ns]")


# ---- encodings ----

CHINESE = PLAIN.replace("time,x", "时间,东").replace("mw\n", "mw,类型,remark\n").replace("-1.0\n", "-1.0,爆破,无\n")
CHINESE = CHINESE.replace(",0.5\n", ",0.5,地震,无\n")
NAMED = COLUMNS | {"time": "时间", "x": "东"}


@pytest.mark.parametrize("encoding", ["gbk", "gb18030"])
def test_a_file_that_is_not_utf8_is_read_in_the_encoding_that_a_key_names(tmp_path, encoding):
    """It was read as that of western Europe: the columns were not found, or a filter found nothing."""
    record = read(tmp_path, CHINESE.encode(encoding), NAMED, encoding=encoding)
    np.testing.assert_array_equal(record["location"][:, 0], [100.5, 110])
    without = read(tmp_path, CHINESE.encode(encoding), NAMED, encoding=encoding, filter={"without": {"类型": "爆破"}})
    assert without.sizes["event"] == 1


def test_an_encoding_that_counts_and_is_not_known_is_asked_for(tmp_path):
    """In the names of columns, and in texts that a filter, an event type or a magnitude's type reads."""
    assert "say its encoding with record.encoding" in refused(tmp_path, CHINESE.encode("gbk"), NAMED)
    ascii_names = CHINESE.replace("时间,东", "time,x").replace("类型", "kind").encode("gbk")
    assert read(tmp_path, ascii_names).sizes["event"] == 2  # what is not read does not count
    wanting = [{"filter": {"without": {"kind": "爆破"}}}, {"columns": COLUMNS | {"event_type": "kind"}}]
    for others in wanting:
        line = refused(tmp_path, ascii_names, **others)
        assert "column 'kind'" in line
        assert "say its encoding with record.encoding" in line


def test_an_encoding_that_is_none_or_another_is_one_line(tmp_path):
    assert "record.encoding: 'klingon' is no encoding" in refused(tmp_path, PLAIN, encoding="klingon")
    assert "record.encoding: 'base64' is no encoding" in refused(tmp_path, PLAIN, encoding="base64")
    assert "not in record.encoding: utf-8" in refused(tmp_path, CHINESE.encode("gbk"), NAMED, encoding="utf-8")
    assert "record.encoding: utf-16-le" in refused(tmp_path, PLAIN.encode("utf-16-le"))
    assert read(tmp_path, PLAIN.encode("utf-16-le"), encoding="utf-16-le").sizes["event"] == 2
    assert read(tmp_path, PLAIN.encode("utf-32")).sizes["event"] == 2
    assert read(tmp_path, PLAIN.encode("utf-8-sig"), encoding="utf-8").sizes["event"] == 2


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"MATLAB 5.0 MAT-file Platform: posix".ljust(124) + b"\0\1IM", "a file of MATLAB, not a CSV file; export it"),
        (b"MATLAB 7.3 MAT-file Platform: posix".ljust(124) + b"\0\2IM", "a file of MATLAB"),
        (b"\x89HDF\r\n\x1a\n\0\0", "an HDF5 file"),
        (b"PAR1\x15\x04\0", "a Parquet file"),
        (b"SQLite format 3\0\x10\0", "a database of SQLite"),
        (b"time,x\n" + bytes(range(256)), "it holds zero bytes"),
    ],
)
def test_a_file_that_is_no_text_is_named_and_no_encoding_is_offered(tmp_path, content, what):
    line = refused(tmp_path, content)
    assert what in line
    assert "utf-16" not in line
    if "zero bytes" not in what:
        assert "zero bytes" not in line


# ---- times that are numbers, or stand in columns of their parts ----

EXCEL_DAYS = (43678.5, 43690.0 + 0.5 / 86400)  # days since 1899-12-30
UNIX = (1564660800, 1565654400.5)  # seconds since 1970
NUMBERED = {  # time_format: the two times of PLAIN
    "excel": EXCEL_DAYS,
    "excel_1904": [day - 1462 for day in EXCEL_DAYS],
    "matlab": [day + 693_960 for day in EXCEL_DAYS],
    "unix": UNIX,
    "unix_ms": [1000 * second for second in UNIX],
}


@pytest.mark.parametrize("form", NUMBERED)
@pytest.mark.parametrize("comma", [False, True])
def test_times_that_are_numbers_are_read_where_a_key_says_what_they_are(tmp_path, form, comma):
    """Days of a worksheet to milliseconds, seconds to microseconds; with a decimal comma, too."""
    text = PLAIN
    for date, value in zip(("2019-08-01T12:00:00", "2019-08-13T00:00:00.5"), NUMBERED[form], strict=True):
        text = text.replace(date, repr(value))
    if comma:
        text = text.replace(",", ";").replace(".", ",")
    record = read(tmp_path, text, time_format=form)
    np.testing.assert_array_equal(record["time"].values, TIMES)
    assert ("times_text" in record.attrs) == (not form.startswith("unix"))
    assert f"{form} (2019-08-01)" in refused(tmp_path, text).partition("say record.time_format: ")[2]


def test_days_of_a_worksheet_are_local_times_and_may_stand_in_two_columns(tmp_path):
    """A date of whole days and a time of day as its part; Hobart is ten hours ahead in August."""
    text = "date,clock,x,y,z,mw\n43678,0.5,1,2,3,-1\n43690,,1,2,3,-1\n,,1,2,3,-1\n"
    columns = COLUMNS | {"time": ["date", "clock"]}
    record = read(tmp_path, text, columns, time_format="excel", time_zone="Australia/Hobart")
    assert record["time"].values.tolist() == [np.datetime64("2019-08-01T02:00", "ns").astype(int)]
    assert json.loads(record.attrs["dropped"]) == {"without a time": 2}


PARTS = "Y,M,D,h,m,s,x,y,z,mw\n2019,8,1,12,0,0,100.5,200,300,-1.0\n2019,8,13,0,0,0.5,110,1200,300,0.5\n"
PART_NAMES = {"year": "Y", "month": "M", "day": "D", "hour": "h", "minute": "m", "second": "s"}
PLACES = {key: COLUMNS[key] for key in ("x", "y", "z", "mw")}
IN_PARTS = PLACES | PART_NAMES


def test_a_time_in_columns_of_its_parts(tmp_path):
    """To the last that is there: without hours an event lies at midnight."""
    record = read(tmp_path, PARTS, IN_PARTS)
    np.testing.assert_array_equal(record["time"].values, TIMES)
    days = read(tmp_path, PARTS, PLACES | {key: PART_NAMES[key] for key in ("year", "month", "day")})
    np.testing.assert_array_equal(days["time"].values, np.array(["2019-08-01", "2019-08-13"], "datetime64[ns]"))
    ahead = read(tmp_path, PARTS, IN_PARTS, time_zone="+10:00")
    assert np.all(record["time"].values - ahead["time"].values == np.timedelta64(10, "h"))
    missing = read(tmp_path, PARTS.replace("2019,8,13", "2019,,13"), IN_PARTS)
    assert json.loads(missing.attrs["dropped"]) == {"without a time": 1}


WRONG_TIMES = {  # text, columns, other settings, what the line says
    "month 13": (PARTS.replace("2019,8,13", "2019,13,8"), IN_PARTS, {}, "(2019, 13, 8, 0, 0, 0.5) is not a date"),
    "hour 24": (PARTS.replace("13,0,0,0.5", "13,24,0,0"), IN_PARTS, {}, "event 2 of 2: column 'Y'"),
    "half a day": (PARTS.replace("8,13,", "8,13.5,"), IN_PARTS, {}, "is not a date and time"),
    "a year of two figures": (PARTS.replace("2019,8,13", "19,8,13"), IN_PARTS, {}, "(19, 8, 13,"),
    "no month": (PARTS, PLACES | {"year": "Y", "day": "D"}, {}, "name the columns of all parts of the time"),
    "both": (PARTS, IN_PARTS | {"time": "D"}, {}, "record.columns.time: the time stands in columns of its parts"),
    "milliseconds as seconds": (PLAIN.replace("2019-08-01T12:00:00", "1564660800000").replace(
        "2019-08-13T00:00:00.5", "1565654400500"), COLUMNS, {"time_format": "unix"},
        "1564660800000 is no time of record.time_format: unix: years run from 1678 to 2261 here; it may be unix_ms ("),
    "a zone of Unix time": (PLAIN, COLUMNS, {"time_format": "unix", "time_zone": "+10:00"}, "Unix time is UTC"),
    "an order of a number": (PLAIN, COLUMNS, {"time_format": "excel", "date_order": "day"}, "has no order of day and"),
    "a date": (PLAIN, COLUMNS, {"time_format": "excel"}, "column 'time': '2019-08-01T12:00:00' is not a number"),
}  # fmt: skip


@pytest.mark.parametrize("fault", WRONG_TIMES)
def test_times_that_cannot_be_are_one_line(tmp_path, fault):
    text, columns, others, says = WRONG_TIMES[fault]
    assert says in refused(tmp_path, text, columns, **others)


# ---- sizes that are logarithms, and energies ----

SIZED = {key: COLUMNS[key] for key in ("time", "x", "y", "z")}
ENERGY = {"energy_conversion": {"slope": 0.9, "offset": 6.0}}


def sized(values, name: str = "size") -> str:
    rows = [f"2019-08-01T{number // 60:02d}:{number % 60:02d},1,2,3,{value}" for number, value in enumerate(values)]
    return f"time,x,y,z,{name}\n" + "\n".join(rows) + "\n"


def test_logarithms_of_moment_and_energy_are_read_as_such(tmp_path):
    """log10 M0 = 9.5 is Mw 0.27; and in dyn cm, as the header says, 16.5."""
    for text, name in ((sized([9.5]), "size"), (sized([16.5], "log M0 (dyn.cm)"), "log M0 (dyn.cm)")):
        record = read(tmp_path, text, SIZED | {"log_moment": name})
        np.testing.assert_allclose(record["mw"], 2 / 3 * (9.5 - 9.1), rtol=1e-9)
        np.testing.assert_allclose(record["potency"], 10**9.5 / SHEAR)
    record = read(tmp_path, sized([4.0]), SIZED | {"log_energy": "size"}, **ENERGY)
    np.testing.assert_allclose(np.log10(record["moment"]), 0.9 * 4 + 6)


def test_an_energy_is_a_size_by_the_conversion_that_is_stated(tmp_path):
    """log10 M0 = 0.9 log10 E + 6: 10 kJ are 10^9.6 N m. Without one it is asked for; 0 was never computed."""
    record = read(tmp_path, sized([10, 1, 0], "E (kJ)"), SIZED | {"energy": "E (kJ)"}, **ENERGY)
    np.testing.assert_allclose(record["moment"], [10**9.6, 10**8.7])
    assert json.loads(record.attrs["dropped"]) == {"without a size": 1}
    assert record.attrs["sizes_text"] == "2 of energy as log10 M0 = 0.9 log10 E + 6"
    line = refused(tmp_path, sized([1e4]), SIZED | {"energy": "size"})
    assert "record.energy_conversion: missing; an energy is no moment" in line
    assert "of which energy?" in refused(tmp_path, PLAIN, **ENERGY)


def test_an_energy_beside_another_size_is_no_size(tmp_path):
    """It fills where the other is missing, magnitudes included."""
    text = "time,x,y,z,E,M,type\n2019-08-01,1,2,3,1e4,0.5,Mw\n2019-08-02,1,2,3,1e4,,\n2019-08-03,1,2,3,1e4,1,Md\n"
    columns = SIZED | {"energy": "E", "magnitude": "M", "magnitude_type": "type"}
    record = read(tmp_path, text, columns, **ENERGY, conversions={"Md": "none"})
    expected = 2 / 3 * (9.6 - 9.1)
    np.testing.assert_allclose(record["mw"], [0.5, expected, expected])
    assert record.attrs["sizes_text"] == "1 Mw, 1 Md left out, 2 of energy as log10 M0 = 0.9 log10 E + 6"


@pytest.mark.parametrize("kind", ["moment", "potency", "energy"])
def test_sizes_that_can_only_be_logarithms_are_asked_for(tmp_path, kind):
    """Moments of 9.5 N m would be Mw -5.4; forty energies between 2 and 6 J, and none of 20, are no energies."""
    others = ENERGY if kind == "energy" else {}
    values = np.linspace(2.0, 6.0, 40) + (5 if kind == "moment" else 0)
    line = refused(tmp_path, sized(values), SIZED | {kind: "size"}, **others)
    assert f"name the column in record.columns.log_{kind} if it holds their logarithm" in line
    unit = {"moment": "N m", "potency": "m^3", "energy": "J"}[kind]
    told = read(tmp_path, sized(values), SIZED | {kind: "size"}, units={kind: unit}, **others)
    assert told.sizes["event"] == 40
    assert f"record.columns.log_{kind}" in refused(tmp_path, sized([-0.5, 2.0]), SIZED | {kind: "size"}, **others)
    named = refused(tmp_path, sized([2e9], "log10 size"), SIZED | {kind: "log10 size"}, **others)
    assert f"record.columns.{kind}: column 'log10 size' is by its name a logarithm" in named


def test_a_unit_in_the_header_makes_small_numbers_moments(tmp_path):
    """0.5 to 20 GN m are moments of small events."""
    record = read(tmp_path, sized([0.5, 3.0, 20.0], "Moment [GN m]"), SIZED | {"moment": "Moment [GN m]"})
    np.testing.assert_allclose(record["moment"], [5e8, 3e9, 2e10])


def test_a_single_moment_of_9_5_is_asked_for(tmp_path):
    assert "record.columns.log_moment" in refused(tmp_path, sized([9.5]), SIZED | {"moment": "size"})


@pytest.mark.parametrize("name", ["logM0", "lgE", "log10(E)", "LOG_P", "log M", "Log10 E", "lg M0"])
def test_names_of_logarithms_are_known(tmp_path, name):
    assert "is by its name a logarithm" in refused(tmp_path, sized([1e9], name), SIZED | {"moment": name})


@pytest.mark.parametrize("name", ["logger moment", "Moment", "M0", "lgt", "logmean"])
def test_other_names_are_not(tmp_path, name):
    assert read(tmp_path, sized([1e9], name), SIZED | {"moment": name}).sizes["event"] == 1


@pytest.mark.parametrize(("seed", "kind", "b"), [(1, "potency", 1.0), (2, "potency", 0.5), (3, "energy", 0.67)])
def test_small_sizes_are_no_logarithms(tmp_path, seed, kind, b):
    """A hundred catalogues of ten to a hundred sizes of a power law above 0.01: few, if any, are asked about."""
    generator, asked = np.random.default_rng(seed), 0
    for _ in range(100):
        values = 10 ** (generator.exponential(1 / (b * np.log(10)), generator.integers(10, 100)) - 2)
        try:
            read(tmp_path, sized(values), SIZED | {kind: "size"}, **(ENERGY if kind == "energy" else {}))
        except InputError as error:
            asked += "logarithm" in str(error)
    assert asked <= 3


# ---- what services write ----

FDSN = """#EventID|Time|Latitude|Longitude|Depth/km|Author|MagType|Magnitude|EventLocationName|EventType
1|2019-08-01T12:00:00|-41.8|145.4|0.95|a|ML|0.5|Somewhere, Tasmania|induced or triggered event
2|2019-08-02T12:00:00|-41.8|145.4|0.96|a|ML|0.7|Somewhere, Tasmania|quarry blast
"""
COMCAT = """time,latitude,longitude,depth,mag,magType,nst,gap,dmin,rms,net,id,updated,place,type,status
2019-08-01T12:00:00.000Z,-41.8,145.4,0.95,0.5,ml,9,80,0.1,0.2,x,y,2019-08-05T12:00:00Z,"5 km N of ""X"", Y",earthquake,\
reviewed
2019-08-02T12:00:00.000Z,-41.8,145.4,0.95,0.5,ml,9,80,0.1,0.2,x,z,2019-08-05T12:00:00Z,"5 km N of X",quarry blast,\
automatic
2019-08-03T12:00:00.000Z,-41.8,145.4,0.95,0.5,ml,9,80,0.1,0.2,x,w,2019-08-05T12:00:00Z,"5 km N of X",earthquake,deleted
"""
ON_GLOBE = {"time": "time", "latitude": "latitude", "longitude": "longitude", "depth": "depth"}
ML = {"conversions": {"ML": {"slope": 1.0, "offset": 0.0}}}


def test_the_text_of_an_fdsn_service_is_read(tmp_path):
    """Its header begins as a comment does, and says kilometres."""
    columns = {"time": "Time", "latitude": "Latitude", "longitude": "Longitude", "depth": "Depth/km"}
    columns |= {"magnitude": "Magnitude", "magnitude_type": "MagType", "event_type": "EventType"}
    record = read(tmp_path, FDSN, columns, **ML)
    np.testing.assert_allclose(record["location"].values, [[0, 0, -950]], atol=1e-6)
    assert json.loads(record.attrs["dropped"]) == {"of type quarry blast": 1}


def test_the_table_of_comcat_is_read(tmp_path):
    """Quotes in quotes, types and states of events; kilometres stand in its documentation alone."""
    columns = ON_GLOBE | {"magnitude": "mag", "magnitude_type": "magType"}
    assert "record.columns.event_type: type" in refused(tmp_path, COMCAT, columns, **ML)
    columns |= {"event_type": "type", "evaluation_status": "status"}
    record = read(tmp_path, COMCAT, columns, units={"depth": "km"}, **ML)
    np.testing.assert_allclose(record["location"].values, [[0, 0, -950]], atol=1e-6)
    assert json.loads(record.attrs["dropped"]) == {"of type quarry blast": 1, "deleted": 1}


def test_a_name_that_ends_as_a_unit_is_asked_about(tmp_path):
    """depth_km was read as metres; x_m says nothing new."""
    text = PLAIN.replace(",x,y,z", ",x_m,y_km,z")
    columns = COLUMNS | {"x": "x_m", "y": "y_km"}
    assert "column 'y_km': is it in km? Say it with record.units: {y: km}" in refused(tmp_path, text, columns)
    assert "is in km by its name, and in m by record.units.y" in refused(tmp_path, text, columns, units={"y": "m"})
    assert read(tmp_path, text, columns, units={"y": "km"})["location"].values[0, 1] == 200_000


def test_one_column_is_not_two_coordinates(tmp_path):
    """A slip that puts all events on a diagonal."""
    line = refused(tmp_path, PLAIN, COLUMNS | {"y": "x"})
    assert "record.columns.y: column 'x' is named as x, too" in line


def test_a_footer_is_one_line(tmp_path):
    line = refused(tmp_path, PLAIN + "Total: 2 events,,,,\n")
    assert "event 3 of 3: column 'time': 'Total: 2 events'" in line
