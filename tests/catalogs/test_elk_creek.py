"""The record of the Elk Creek mine: two catalogues, what is taken of each, and the location error between them.

Tests marked `elk_creek` read the recorded data (folder ELK_CREEK_DATA, else data/elk_creek) and skip without them; the
others read a tiny folder of the same layout whose answers are known.
"""

import itertools
import json

import numpy as np
import pandas as pd
import pytest
from elk_creek_fixtures import recorded_data, write_tiny_mine
from hypothesis import given
from hypothesis import strategies as st

from catalogs.records import elk_creek_reader as record
from catalogs.records import read_record
from common.errors import InputError
from common.event_table import read_events, write_events

BOX = {"lower": [9800.0, 4200.0, 1400.0], "upper": [12800.0, 6500.0, 2100.0]}
MONTHS = {"start": "2010-09-01", "end": "2011-01-01"}
SEPTEMBER = {"max_location_error": 80.0, "start": "2010-09-01", "end": "2010-10-01"}
NEAR_PANEL_2 = {"lower": [9790.0, 4840.0, 1400.0], "upper": [10710.0, 5670.0, 2100.0]}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.delenv(record.ENVIRONMENT_VARIABLE, raising=False)
    write_tiny_mine(tmp_path)
    return tmp_path


def settings(folder, **changes):
    common = {"mine": "elk_creek", "reader": "elk_creek", "file": str(folder), "filter": BOX | MONTHS}
    chosen = common | {"orientations": SEPTEMBER} | changes
    return record.RecordSlice.of({key: value for key, value in chosen.items() if value is not None}, "record")


def replace_column(folder, name, value, catalogue="ims_events", month="2010-09_ims"):
    path = folder / catalogue / f"{month}.parquet"
    frame = pd.read_parquet(path)
    frame[name] = value
    frame.to_parquet(path)


def test_sizes_are_moment_total_over_rigidity_and_no_residual_filter_applies(folder):
    """40 events in the window, residuals up to 83 m; potency 1, 10, 100, ... m3 at 33 GPa."""
    events = read_record(settings(folder))
    assert events.sizes["event"] == 40
    assert np.allclose(np.log10(events["potency"]), np.arange(40))
    assert np.allclose(events["mw"], 2 / 3 * (np.log10(33e9) + np.arange(40) - 9.1))
    assert (np.diff(events["time"].values) > np.timedelta64(0)).all()
    assert np.isnan(events["potency_tensor"]).all()
    assert np.isnan(events["p_axis"]).all()
    halved = read_record(settings(folder, rigidity=66e9))
    assert np.allclose(halved["potency"], events["potency"] / 2)
    assert np.allclose(halved["moment"], events["moment"])


def test_columns_of_the_file_can_filter_when_asked(folder):
    events = read_record(
        settings(folder, filter=BOX | MONTHS | {"maximum": {"Location Residual": 30.0}}, location_error=1.0)
    )
    assert events.sizes["event"] == 13  # residuals 5, 7, ..., 29


def test_orientations_are_unit_tensors_of_well_located_events_apart_from_the_events(folder):
    """30 of 40 twins pass 80 m; tensor xy = 3, zz = -4 has norm sqrt(34)."""
    events = read_record(settings(folder))
    expected = np.array([[0, 3, 0], [3, 0, 0], [0, 0, -4.0]]) / np.sqrt(34)
    assert events["orientation_tensor"].shape == (30, 3, 3)
    assert np.allclose(events["orientation_tensor"], expected)
    assert np.allclose(events["orientation_location"][:, 1], 5100)
    short = read_record(settings(folder, orientations=SEPTEMBER | {"end": "2010-09-03"}, location_error=1.0))
    assert (short["orientation_time"] < np.datetime64("2010-09-03")).all()
    assert short.sizes["event"] == 40
    boxed = SEPTEMBER | {"lower": [10000, 5000, 1000], "upper": [10019, 6000, 2000]}
    chosen = read_record(settings(folder, orientations=boxed, location_error=1.0))
    assert chosen.sizes["orientation"] == 15  # of 20 in the box three in four pass 80 m
    assert chosen.sizes["event"] == 40
    without = record.read(settings(folder, orientations=None, location_error=50.0))
    assert "orientation_time" not in without


def test_location_error_is_the_median_distance_of_matched_pairs_unless_given(folder):
    events = read_record(settings(folder))
    assert events.attrs["location_error"] == pytest.approx(100)
    assert events.attrs["location_error_pairs"] == 30
    assert "30 pairs" in events.attrs["location_error_from"]
    assert read_record(settings(folder, location_error=77.0)).attrs["location_error"] == 77
    with pytest.raises(InputError, match="only 1 events"):
        read_record(settings(folder, orientations=SEPTEMBER | {"end": "2010-09-01T18:00"}))
    with pytest.raises(InputError, match=r"record\.location_error: missing"):
        read_record(settings(folder, orientations=None))


@given(
    st.lists(st.integers(0, 60), max_size=12, unique=True),
    st.lists(st.integers(0, 60), max_size=12, unique=True),
    st.integers(0, 4),
)
def test_matched_pairs_are_mutual_nearest(first, second, within):
    """Slow twin: all pairs; kept where neither has a nearer partner. Times in shuffled order, odd and even: no ties."""
    first, second = np.array(first, int) * 10, np.array(second, int) * 10 + 3
    as_time = [values.astype("datetime64[s]").astype("datetime64[ns]") for values in (first, second)]
    ours, theirs = record.matched_pairs(*as_time, within=10.0 * within)
    expected = set()
    for i, j in itertools.product(range(first.size), range(second.size)):
        apart = abs(first[i] - second[j])
        nearest = apart == np.abs(first - second[j]).min() and apart == np.abs(second - first[i]).min()
        if nearest and apart <= 10 * within:
            expected.add((i, j))
    assert set(zip(ours.tolist(), theirs.tolist(), strict=True)) == expected


def test_record_survives_the_disk(folder, tmp_path):
    events = read_record(settings(folder))
    write_events(events, tmp_path / "record.nc")
    again = read_events(tmp_path / "record.nc")
    assert (again["orientation_time"].values == events["orientation_time"].values).all()
    assert (again["time"].values == events["time"].values).all()


def test_missing_folder_says_where_the_data_are(tmp_path, monkeypatch):
    monkeypatch.delenv(record.ENVIRONMENT_VARIABLE, raising=False)
    with pytest.raises(InputError) as error:
        read_record({"reader": "elk_creek", "file": str(tmp_path / "nowhere"), "location_error": 1.0})
    for word in ("niosh-mining/elkcreek", "ELK_CREEK_DATA", "record.file", "nowhere"):
        assert word in str(error.value)


def test_environment_variable_overrides_the_configuration(folder, monkeypatch):
    monkeypatch.setenv(record.ENVIRONMENT_VARIABLE, str(folder))
    assert read_record(settings("elsewhere")).sizes["event"] == 40
    monkeypatch.setenv(record.ENVIRONMENT_VARIABLE, str(folder / "nowhere"))
    with pytest.raises(InputError, match="environment variable ELK_CREEK_DATA"):
        read_record(settings(folder))


def test_layout_of_the_repository_is_read_as_well(folder):
    (folder / "events").mkdir()
    for name in ("ims_events", "rocksigma_events"):
        (folder / name).rename(folder / "events" / name)
    assert read_record(settings(folder)).sizes["event"] == 40


def test_faults_are_told_in_one_line(folder):
    with pytest.raises(InputError, match="no event left"):
        read_record(settings(folder, filter=BOX | {"start": "2012-01-01"}))
    with pytest.raises(InputError, match=r"record\.orientations: none of 40 left"):
        read_record(settings(folder, orientations=SEPTEMBER | {"max_location_error": 1.0}))
    replace_column(folder, "Moment Total", 0.0)
    with pytest.raises(InputError, match="40 events without a positive Moment Total"):
        read_record(settings(folder))
    replace_column(folder, "Location Z", np.nan)
    with pytest.raises(InputError, match="NaN locations"):
        read_record(settings(folder))
    replace_column(folder, "Date", "the first of May")
    with pytest.raises(InputError, match="ISO 8601"):
        read_record(settings(folder))
    path = folder / "ims_events/2010-09_ims.parquet"
    pd.read_parquet(path).drop(columns="Moment Total").to_parquet(path)
    with pytest.raises(InputError, match="'Moment Total' is missing"):
        read_record(settings(folder))
    path.write_bytes(b"not parquet")
    with pytest.raises(InputError, match="not a readable parquet file"):
        read_record(settings(folder))


# -- the recorded data ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def data():
    return recorded_data()


@pytest.fixture(scope="module")
def recorded(data):
    return read_record(settings(data))


def by_month(events, values=None):
    series = pd.Series(np.ones(events.sizes["event"]) if values is None else values, index=events["time"].values)
    return series.groupby(series.index.to_period("M").astype(str)).sum().to_list()


@pytest.mark.elk_creek
def test_recorded_counts_are_those_of_the_source(data, recorded):
    """By the authors' residual filter 1198, 2668, 3995, 6770 events a month, and 43 % less moment than without it."""
    filtered = read_record(settings(data, filter=BOX | MONTHS | {"maximum": {"Location Residual": 30.0}}))
    assert by_month(filtered) == [1198, 2668, 3995, 6770]
    assert np.allclose(by_month(filtered, filtered["moment"].values), [4.86e13, 9.03e13, 1.36e14, 1.55e14], rtol=0.01)
    assert by_month(recorded) == [1862, 4183, 6241, 9218]
    lost = 1 - filtered["moment"].sum() / recorded["moment"].sum()
    assert lost == pytest.approx(0.43, abs=0.005)
    everything = read_record(settings(data, filter=BOX | {"maximum": {"Location Residual": 30.0}}))
    assert everything.sizes["event"] == 39971


@pytest.mark.elk_creek
def test_recorded_location_error_is_of_the_order_of_100_m(data, recorded):
    """131 m by the record's September events, 105 m near panel 2; the source's 123 m (n = 315): filtered, no box."""
    assert recorded.attrs["location_error"] == pytest.approx(131, abs=1)
    assert recorded.attrs["location_error_pairs"] == 168
    near = read_record(settings(data, orientations=SEPTEMBER | NEAR_PANEL_2))
    assert near.attrs["location_error_pairs"] == 47
    assert near.attrs["location_error"] == pytest.approx(105, abs=1)
    widest = {"filter": {"maximum": {"Location Residual": 30.0}}, "orientations": {"max_location_error": 80.0}}
    source = read_record(settings(data, **widest))
    assert source.attrs["location_error_pairs"] == 315
    assert source.attrs["location_error"] == pytest.approx(123, abs=1)


@pytest.mark.elk_creek
def test_recorded_orientations_are_september_only(recorded):
    assert recorded["orientation_tensor"].shape == (340, 3, 3)
    assert np.allclose((recorded["orientation_tensor"] ** 2).sum(["xyz", "axis"]), 1)
    assert np.unique(recorded["orientation_time"].values.astype("datetime64[M]")) == np.datetime64("2010-09")


@pytest.mark.elk_creek
def test_recorded_events_are_pinned_to_a_plane_as_the_caveat_says(recorded):
    """A fifth within 2 m of the plane found by least absolute residuals: the locator's, not the rock's."""
    x, y, z = recorded["location"].values.T
    plane = np.array([-0.0265, -0.06428, 1802.7])  # slopes east, north; elevation at (11243, 5344)
    above = z - (plane[0] * (x - 11243) + plane[1] * (y - 5344) + plane[2])
    assert (np.abs(above) < 2).mean() == pytest.approx(0.197, abs=0.002)
    assert (np.abs(above - 10) < 2).mean() < 0.03  # beside the plane
    assert "fifth" in json.loads(recorded.attrs["caveats"])[0]
