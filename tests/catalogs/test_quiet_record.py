"""A record without events is a result where the mine file states it: where nothing happens is what a mine asks."""

import json

import numpy as np
import pytest
from catalog_fixtures import SETTINGS
from obspy.core.event import Catalog
from test_record_readers import TABLE, settings_for

from catalogs.records import read_record
from catalogs.records.filters import MAX_WIDTHS_FROM_DOMAIN
from common.errors import InputError

MONTHS = {"start": "2019-08-01", "end": "2019-10-01"}
HEADER = "\n".join(TABLE.splitlines()[:2])


def domain(x: float) -> dict:
    """A cube of 100 m whose lower face lies at x."""
    return {"lower": [x, 150, 250], "upper": [x + 100, 250, 350], "plane": None}


def test_a_header_without_a_row_is_a_record_of_the_modelled_months(tmp_path):
    with pytest.raises(InputError, match=r"no event in the domain .*: it has no events; .* state record\.quiet: true"):
        read_record(settings_for(tmp_path, HEADER, period=MONTHS, domain=domain(0.0)))
    record = read_record(settings_for(tmp_path, HEADER, period=MONTHS, domain=domain(0.0), quiet=True))
    assert record.sizes["event"] == 0
    assert record.attrs["rows"] == 0
    assert json.loads(record.attrs["period"])["common"] == ["2019-08-01T00:00:00", "2019-10-01T00:00:00"]
    with pytest.raises(InputError, match=r"record\.filter: start and end leave nothing of the modelled months"):
        read_record(settings_for(tmp_path, HEADER, period=MONTHS, filter={"start": "2020-01-01"}))
    with pytest.raises(InputError, match="not a readable CSV"):
        read_record(settings_for(tmp_path, ""))


def test_a_quakeml_file_without_events_too(tmp_path):
    path = tmp_path / "quiet.xml"
    Catalog().write(str(path), format="QUAKEML")
    record = read_record(SETTINGS | {"reader": "quakeml", "file": str(path), "period": MONTHS, "quiet": True})
    assert record.sizes["event"] == 0


def test_none_in_the_domain_is_quiet_if_stated_and_not_far_from_it(tmp_path):
    """Events at x of 100 to 120 m, a domain of 100 m: quiet to ten times that beyond them, then other ground."""
    near = domain(110.0 + 0.99 * MAX_WIDTHS_FROM_DOMAIN * 100.0)
    line = (
        r"no event in the domain .*; the nearest lies 980 m away; check record\.columns.* or state record\.quiet: true"
    )
    with pytest.raises(InputError, match=line):
        read_record(settings_for(tmp_path, period=MONTHS, domain=near))
    record = read_record(settings_for(tmp_path, period=MONTHS, domain=near, quiet=True))
    assert record.sizes["event"] == 0
    crop = json.loads(record.attrs["filter"])[-1]
    assert (crop["before"], crop["after"]) == (3, 0)
    np.testing.assert_allclose([crop["nearest"], crop["farthest"]], [980.0, 1000.0])
    far = domain(130.0 + MAX_WIDTHS_FROM_DOMAIN * 100.0)
    with pytest.raises(InputError, match=r"no event of 3 lies in the model's domain .*check record.columns"):
        read_record(settings_for(tmp_path, period=MONTHS, domain=far, quiet=True))


NUMBERED = {"time": "time", "x": "x", "y": "y", "z": "z", "mw": "mw"}


def numbered(first: float, step: float) -> str:
    """Twenty events within 100 m, whose times are numbers."""
    rows = [f"{first + step * n!r},{100 + n},200,300,{-1 - 0.05 * n:g}" for n in range(20)]
    return "\n".join([",".join(NUMBERED), *rows])


@pytest.mark.parametrize(
    ("form", "first", "step", "day"),
    [("unix_ms", 1564639200, 86400, "1970-01-19"), ("unix", 737638.25, 1, "1970-01-09")],
)
def test_times_that_collapse_to_one_day_are_no_quiet_mine(tmp_path, form, first, step, day):
    """Seconds read as milliseconds, and days of MATLAB as seconds, lie in one day, of which no silence is known."""
    settings = settings_for(
        tmp_path, numbered(first, step), NUMBERED, period=MONTHS, domain=domain(90.0), time_format=form
    )
    with pytest.raises(InputError) as error:
        read_record(settings)
    assert f"modelled months, 2019-08-01 to 2019-10-01: 20 events run from {day} to {day}; check" in str(error.value)
    right = {"unix_ms": "unix", "unix": "matlab"}[form]
    assert read_record(settings | {"time_format": right}).sizes["event"] == 20


def test_a_record_that_ended_before_the_modelled_months_may_be_stated_as_quiet(tmp_path):
    """Its silence is longer than chance makes it; the mine file says that the network was on."""
    months = {"start": "2021-08-01", "end": "2021-10-01"}
    with pytest.raises(InputError, match="nothing of the modelled months"):
        read_record(settings_for(tmp_path, period=months))
    record = read_record(settings_for(tmp_path, period=months, quiet=True))
    assert json.loads(record.attrs["period"])["common"] == ["2021-08-01T00:00:00", "2021-10-01T00:00:00"]


def test_a_record_of_which_nearly_all_lies_in_other_months_is_told_with_its_dates(tmp_path, caplog):
    settings = settings_for(tmp_path, numbered(737638.25, 20), NUMBERED, time_format="matlab")
    read_record(settings | {"period": {"start": "2019-08-01", "end": "2019-08-15"}})
    line = (
        "19 of 20 events lie outside of the modelled months, 2019-08-01 to 2019-08-15: 20 events run from 2019-08-01 to"
    )
    assert line in caplog.text
    caplog.clear()
    read_record(settings | {"period": {"start": "2019-08-01", "end": "2019-11-15"}})
    assert "modelled months" not in caplog.text


def test_a_statement_that_events_contradict_is_told(tmp_path, caplog):
    read_record(settings_for(tmp_path, period=MONTHS, quiet=True))
    assert "record.quiet is stated, and 3 events are compared: leave it out" in caplog.text
