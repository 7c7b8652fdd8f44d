"""A record without events is a result, not an error: where nothing happens is what a mine asks."""

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
    record = read_record(settings_for(tmp_path, HEADER, period=MONTHS, domain=domain(0.0)))
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
    record = read_record(SETTINGS | {"reader": "quakeml", "file": str(path), "period": MONTHS})
    assert record.sizes["event"] == 0


def test_none_in_the_domain_is_quiet_unless_all_are_far_from_it(tmp_path, caplog):
    """Events at x of 100 to 120 m, a domain of 100 m: quiet to ten times that beyond them, then other ground."""
    record = read_record(
        settings_for(tmp_path, period=MONTHS, domain=domain(110.0 + 0.99 * MAX_WIDTHS_FROM_DOMAIN * 100.0))
    )
    assert record.sizes["event"] == 0
    assert "it counts as quiet; the nearest lies 980 m away" in caplog.text
    crop = json.loads(record.attrs["filter"])[-1]
    assert (crop["before"], crop["after"]) == (3, 0)
    np.testing.assert_allclose([crop["nearest"], crop["farthest"]], [980.0, 1000.0])
    with pytest.raises(InputError, match=r"no event of 3 lies in the model's domain .*check record.columns"):
        read_record(settings_for(tmp_path, period=MONTHS, domain=domain(130.0 + MAX_WIDTHS_FROM_DOMAIN * 100.0)))
