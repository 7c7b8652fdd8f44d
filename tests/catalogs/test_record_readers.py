import json
import subprocess
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import xarray as xr
from catalog_fixtures import FRAME, LAME, SETTINGS, SHEAR, made_up_catalog
from csv_fixtures import settings_of
from job_runs import run_job

from catalogs.compare.comparison import compare
from catalogs.records import READERS, read_record
from catalogs.records.times import parse_time
from catalogs.sources.geographic_frame import MineFrame
from catalogs.sources.quakeml import UP_SOUTH_EAST
from common.datasets import read_dataset, write_dataset
from common.errors import InputError

ROOT = Path(__file__).parents[2]
TABLE = """# a comment
date,time of day,x,y,z,log P,quality
2019-08-01,12:00:00,100,200,300,-1.0,5
2019-08-02,00:00:00.5,110,200,300,-2.0,50
2019-09-01,00:00:00,120,200,300,0.5,5
"""
COLUMNS = {"time": ["date", "time of day"], "x": "x", "y": "y", "z": "z", "log_potency": "log P"}


def settings_for(tmp_path, text=TABLE, columns=None, **other) -> dict:
    return settings_of(tmp_path, text, columns or COLUMNS, **other)


def test_csv_gives_times_places_and_sizes(tmp_path):
    record = read_record(settings_for(tmp_path))
    assert record["time"].values[1] == np.datetime64("2019-08-02T00:00:00.500", "ns")
    np.testing.assert_array_equal(record["location"][0], [100, 200, 300])
    np.testing.assert_allclose(record["potency"], [0.1, 0.01, 10**0.5])
    np.testing.assert_allclose(record["moment"], record["potency"] * SHEAR)
    np.testing.assert_allclose(record["mw"], 2 / 3 * (np.log10(record["moment"]) - 9.1))
    assert np.isnan(record["potency_tensor"]).all()
    assert record["resolved"].values.tolist() == [1, 1, 1]
    assert (record.attrs["location_error"], record.attrs["kind"]) == (10.0, "recorded")


def test_csv_in_degrees_with_moment_tensors_and_time_zones(tmp_path):
    """A tensor of moment with volume change comes back as M = lambda tr(P) I + 2 mu P says; 14:00+02:00 is noon UTC."""
    latitude, longitude, depth = (float(part[0]) for part in MineFrame(FRAME).to_globe([[10.0, 20.0, 30.0]]))
    potency = np.array([[2.0, 0.3, 0.1], [0.3, -1.0, 0.2], [0.1, 0.2, 0.5]])
    moment = LAME * np.trace(potency) * np.eye(3) + 2 * SHEAR * potency
    voigt = [moment[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))]
    names = ["xx", "yy", "zz", "yz", "xz", "xy"]
    text = "when,lat,lon,dep," + ",".join(names) + "\n"
    text += f"2019-08-01T14:00:00+02:00,{latitude!r},{longitude!r},{depth!r}," + ",".join(map(repr, map(float, voigt)))
    columns = {"time": "when", "latitude": "lat", "longitude": "lon", "depth": "dep"}
    columns |= {f"moment_{name}": name for name in names}
    record = read_record(settings_for(tmp_path, text, columns))
    assert record["time"].values[0] == np.datetime64("2019-08-01T12:00", "ns")
    np.testing.assert_allclose(record["location"][0], [10, 20, 30], atol=1e-6)
    np.testing.assert_allclose(record["potency_tensor"][0], potency, rtol=1e-12)
    np.testing.assert_allclose(record["potency"][0], np.sqrt(2 * np.sum(potency**2)))
    np.testing.assert_allclose(record["moment"][0], np.sqrt(np.sum(moment**2) / 2))


FRAMES = {"ENU": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "NED": [[0, 1, 0], [1, 0, 0], [0, 0, -1]]}
FRAMES |= {"USE": [[0, 0, 1], [0, -1, 0], [1, 0, 0]]}  # up, south, east in east, north, up


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("kind", ["potency", "moment"])
def test_one_tensor_in_three_frames_is_one_tensor(tmp_path, frame, kind):
    """Each file has the components along its own axes, i.T.j."""
    potency = np.array([[2.0, 0.3, 0.1], [0.3, -1.0, 0.2], [0.1, 0.2, 0.5]])
    tensor = potency if kind == "potency" else LAME * np.trace(potency) * np.eye(3) + 2 * SHEAR * potency
    axes, names = np.array(FRAMES[frame], float), ["xx", "yy", "zz", "yz", "xz", "xy"]
    there = [float(axes[i] @ tensor @ axes[j]) for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))]
    text = "when,x,y,z," + ",".join(names) + "\n2019-08-01,1,2,3," + ",".join(map(repr, there)) + "\n"
    columns = {"time": "when", "x": "x", "y": "y", "z": "z"} | {f"{kind}_{name}": name for name in names}
    record = read_record(settings_for(tmp_path, text, columns, tensor_frame=frame))
    np.testing.assert_allclose(record["potency_tensor"][0], potency, rtol=1e-12)


def test_up_south_east_is_what_quakeml_calls_so(tmp_path):
    """m_rt of QuakeML is minus north-up: the same sign as in catalogs.sources.quakeml."""
    for key, (sign, i, j) in UP_SOUTH_EAST.items():
        first, second = (FRAMES["USE"]["rtp".index(letter)] for letter in key[2:])
        assert (
            np.dot(first, np.eye(3)[i]) * np.dot(second, np.eye(3)[j])
            + np.dot(first, np.eye(3)[j]) * np.dot(second, np.eye(3)[i]) * (i != j)
            == sign
        )


WORDS = """date,x,y,z,log P,status
2019-08-01,100,200,300,-1.0,automatic
2019-08-02,110,200,300,-2.0, manual
2019-08-03,120,200,300,0.5,reviewed
2019-08-04,130,200,300,0.5,
"""


@pytest.mark.parametrize(
    ("chosen", "kept"),
    [
        ({"only": {"status": ["manual", "reviewed"]}}, [110, 120]),
        ({"only": {"status": "automatic"}}, [100]),
        ({"without": {"status": "automatic"}}, [110, 120, 130]),
        ({"without": {"status": ["automatic", "manual"]}, "only": {"status": "reviewed"}}, [120]),
    ],
)
def test_columns_of_text_are_filters_too(tmp_path, chosen, kept):
    """A tag of automatic locations; no tag is none of the tags."""
    columns = {key: COLUMNS[key] for key in ("x", "y", "z", "log_potency")} | {"time": "date"}
    record = read_record(settings_for(tmp_path, WORDS, columns, filter=chosen))
    assert record["location"].values[:, 0].tolist() == kept
    account = json.loads(record.attrs["filter"])
    assert account[-1]["filter"].split(".") == [*list(chosen)[:1], "status"] or len(chosen) == 2
    assert account[-1]["after"] == len(kept)


def test_filters_count_before_and_after(tmp_path):
    limits = {"lower": [0, 0, 0], "upper": [115, 999, 999], "end": "2019-09-01", "minimum_potency": 0.05}
    record = read_record(settings_for(tmp_path, filter=limits | {"maximum": {"quality": 10}}))
    account = [(one["filter"], one["before"], one["after"]) for one in json.loads(record.attrs["filter"])]
    assert account == [
        ("lower", 3, 3),
        ("upper", 3, 2),
        ("end", 2, 2),
        ("minimum_potency", 2, 1),
        ("maximum.quality", 1, 1),
    ]
    assert record.sizes["event"] == 1


def test_end_is_outside_the_window_and_start_inside(tmp_path):
    record = read_record(settings_for(tmp_path, filter={"start": "2019-08-02T00:00:00.5", "end": "2019-09-01"}))
    assert record["location"].values[:, 0].tolist() == [110]


DOMAIN = {"lower": [95, 100, 0], "upper": [115, 250, 400], "plane": None}


def test_events_outside_the_domain_are_left_out_and_counted_with_their_potency(tmp_path):
    """The third lies 5 m east of the domain; all three are counted before, and how far the farthest is."""
    record = read_record(settings_for(tmp_path, domain=DOMAIN))
    np.testing.assert_array_equal(record["location"][:, 0], [100, 110])
    account = json.loads(record.attrs["filter"])[-1]
    assert (account["filter"], account["before"], account["after"]) == ("domain", 3, 2)
    assert account["farthest"] == 5.0
    assert account["potency_before"] == pytest.approx(0.11 + 10**0.5)
    assert account["potency_after"] == pytest.approx(0.11)


def test_much_of_a_record_outside_or_none_inside_is_told_on_the_terminal(tmp_path, caplog):
    """A third outside is worth a line, and months without an event are; a record all inside is not."""
    read_record(settings_for(tmp_path, domain=DOMAIN | {"upper": [200, 250, 400]}))
    assert "domain" not in caplog.text
    read_record(settings_for(tmp_path, domain=DOMAIN))
    assert "1 of 3 events lie outside the domain, up to 5 m away, and are not compared" in caplog.text
    with pytest.raises(InputError, match="no event in the domain in the modelled months"):
        read_record(settings_for(tmp_path, domain=DOMAIN, period={"start": "2019-08-10", "end": "2019-08-20"}))


def test_events_of_other_ground_change_nothing_of_a_comparison(tmp_path):
    """300 of 565 events 400 m and more away: every number stays what it is without them.

    It was a ratio of potency of 0.91 instead of 2.7, and 269 m between the centroids instead of 4 m.
    """
    catalog, near = made_up_catalog(200), made_up_catalog(265, seed=1, kind="recorded")
    far = made_up_catalog(300, seed=2, kind="recorded", shift=(500, 0, 0))
    columns = {name: name for name in ("time", "x", "y", "z", "log_potency")}
    domain = {"lower": [-200, -200, -200], "upper": [200, 200, 200], "plane": None}
    made = []
    for parts in ([near], [near, far]):
        rows = [
            f"{time},{x!r},{y!r},{z!r},{float(np.log10(size))!r}"
            for part in parts
            for time, (x, y, z), size in zip(
                part["time"].values, part["location"].values.tolist(), part["potency"].values.tolist(), strict=True
            )
        ]
        text = "\n".join([",".join(columns), *rows])
        record = read_record(settings_for(tmp_path, text, columns, domain=domain))
        assert record.sizes["event"] == 265
        made.append(compare(catalog, record, {"resamplings": 99}))
    xr.testing.assert_identical(*made)


@pytest.mark.parametrize(("plane", "count"), [("xz", 2), ("xy", 2)])
def test_a_section_reaches_through_the_direction_that_it_has_not(tmp_path, plane, count):
    """An x-z section takes every y, a plan every z."""
    other = {"xz": 400, "xy": 250}[plane]
    domain = {"lower": [95, 0], "upper": [115, other], "plane": plane}
    assert read_record(settings_for(tmp_path, domain=domain)).sizes["event"] == count


def test_a_record_of_other_ground_is_refused_with_both_places(tmp_path):
    """No event of the whole file inside: a wrong frame, column or unit, told with what lies where."""
    domain = {"lower": [500_000, 100, 0], "upper": [500_100, 250, 400], "plane": None}
    with pytest.raises(InputError, match=r"no event of 3 .*x 500000 to 500100.* x 100 to 120, .* frame"):
        read_record(settings_for(tmp_path, domain=domain))


def test_a_quiet_domain_is_a_record_without_events(tmp_path):
    """Nobody asked for this filter: the report says that there is nothing to compare."""
    record = read_record(settings_for(tmp_path, filter={"start": "2019-09-01"}, domain=DOMAIN, quiet=True))
    assert record.sizes["event"] == 0
    assert json.loads(record.attrs["filter"])[-1]["after"] == 0
    write_dataset(record, tmp_path / "record.nc")
    assert read_dataset(tmp_path / "record.nc").sizes["event"] == 0


def test_a_record_of_another_year_is_refused_with_both_times(tmp_path):
    period = {"start": "2030-01-01", "end": "2030-02-01"}
    with pytest.raises(InputError, match=r"nothing of the modelled months, 2030-01-01 to 2030-02-01.* 2019-08-01 to"):
        read_record(settings_for(tmp_path, period=period))
    months = {"start": "2019-08-02", "end": "2019-09-01"}
    with pytest.raises(InputError, match=r"record\.filter: start and end leave nothing of the modelled months"):
        read_record(settings_for(tmp_path, period=months, filter={"end": "2019-08-02"}))


def test_a_filter_of_the_configuration_narrows_the_modelled_months_and_never_widens_them(tmp_path):
    period = {"start": "2019-08-02", "end": "2019-09-01"}
    assert read_record(settings_for(tmp_path, period=period)).sizes["event"] == 1
    wider = read_record(settings_for(tmp_path, period=period, filter={"end": "2019-09-02"}))
    assert wider.sizes["event"] == 1
    narrow = read_record(settings_for(tmp_path, period=period, filter={"end": "2019-08-20"}))
    assert json.loads(narrow.attrs["period"])["common"] == ["2019-08-02T00:00:00", "2019-08-20T00:00:00"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"columns": COLUMNS | {"x": "east"}}, "record.csv: column 'east' .record.columns.x. is missing"),
        ({"columns": {"time": "date", "x": "x", "y": "y", "log_potency": "log P"}}, "name the columns x, y and z"),
        ({"columns": {key: COLUMNS[key] for key in "xyz"} | {"mw": "log P"}}, "record.columns.time: missing"),
        ({"columns": {key: COLUMNS[key] for key in ("time", "x", "y", "z")}}, "name a column of sizes"),
        ({"columns": COLUMNS | {"colour": "x"}}, "record.columns.colour: unknown key"),
        ({"columns": COLUMNS | {"potency_xx": "x"}}, "all six of potency_xx"),
        ({"text": TABLE.replace("110,200", "far,200")}, "event 2 of 3: column 'x': 'far' is not a number"),
        (
            {"text": TABLE.replace("2019-08-02", "2 August")},
            "event 2 of 3: column 'date': '2 August' .2 August 00.*is not a date and time",
        ),
        ({"text": ""}, "not a readable CSV"),
        ({"filter": {"minimum_potency": 100.0}}, "record.filter.minimum_potency: no event left .3 before"),
        ({"filter": {"start": "2020-01-01"}}, "record.filter.start: no event left"),
        ({"filter": {"start": "0001-01-01"}}, "record.filter.start: '0001-01-01': years run from 1678 to 2261"),
        ({"filter": {"start": "soon"}}, "record.filter.start: 'soon' does not match: expected a date such as"),
        ({"filter": {"maximum": {"residual": 1}}}, r"column 'residual' \(record.filter.maximum.residual\) is missing"),
        ({"filter": {"box": 1}}, "record.filter.box: unknown key"),
        (
            {"filter": {"only": {"tag": "a"}}},
            r"column 'tag' \(record.filter.only.tag\) is missing",
        ),
        ({"filter": {"without": {"quality": []}}}, "record.filter.without.quality: "),
        ({"tensor_frame": "NED"}, "record.tensor_frame: of which tensor"),
        ({"tensor_frame": "XYZ"}, "record.tensor_frame: 'XYZ' is not one of ENU, NED, USE"),
        ({"location_error": None}, "record.location_error: missing"),
        ({"shear_modulus": None}, "shear_modulus is missing"),
        ({"reader": "excel"}, "record.reader: 'excel' is not one of quakeml, csv, elk_creek"),
    ],
)
def test_every_fault_of_a_record_is_one_line_that_says_where(tmp_path, change, message):
    settings = settings_for(tmp_path, **({"text": change["text"]} if "text" in change else {}))
    changed = settings | {key: value for key, value in change.items() if key != "text"}
    with pytest.raises(InputError, match=message) as caught:
        read_record({key: value for key, value in changed.items() if value is not None})
    assert "\n" not in str(caught.value)


def test_missing_files_are_named(tmp_path):
    for reader in ({"reader": "csv", "columns": COLUMNS}, {"reader": "quakeml"}):
        with pytest.raises(InputError, match="nowhere"):
            read_record(SETTINGS | reader | {"file": str(tmp_path / "nowhere")})
    (tmp_path / "not.xml").write_text("<a/>")
    with pytest.raises(InputError, match=r"not.xml"):
        read_record(SETTINGS | {"reader": "quakeml", "file": str(tmp_path / "not.xml")})


def test_slow_libraries_are_imported_only_when_a_record_is_read():
    """A mine file is checked before each run, whichever readers there are."""
    slow = "import sys, workflow.configuration; assert not {'obspy', 'pyproj', 'matplotlib'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", slow], cwd=ROOT, check=True, timeout=300)


@pytest.mark.parametrize("reader", READERS.values(), ids=list(READERS))
def test_each_reader_offers_what_the_others_do(reader):
    """Its settings name it, and its slice has their keys, with what the model adds."""
    assert get_args(reader.Record.model_fields["reader"].annotation) == (reader.NAME,)
    assert issubclass(reader.RecordSlice, reader.Record)
    assert {"mine", "frame", "period", "domain"} <= reader.RecordSlice.model_fields.keys()
    assert isinstance(reader.READS_FOLDER, bool)
    assert callable(reader.read)


def test_time_of_another_zone_is_utc():
    assert parse_time("2019-08-01T02:00+02:00", "key") == np.datetime64("2019-08-01", "ns")


def test_the_stage_writes_the_record_or_one_line(tmp_path):
    settings = settings_for(tmp_path, time_zone="UTC")
    done = run_job(tmp_path, "record", settings, [tmp_path / "record.nc"])
    assert done.returncode == 0, done.stderr
    record = read_dataset(tmp_path / "record.nc")
    assert record.sizes["event"] == 3
    assert {"config_hash", "source_hash", "versions", "frame"} <= set(record.attrs)
    before = (tmp_path / "record.nc").read_bytes()
    failed = run_job(tmp_path, "record", settings | {"filter": {"start": "2030"}}, [tmp_path / "record.nc"])
    assert failed.returncode != 0
    (said,) = [row for row in failed.stderr.splitlines() if "; log: " not in row]  # which a slow stage says, too
    assert "record.filter.start" in said
    assert (tmp_path / "record.nc").read_bytes() == before
