"""The section of the record: what of it is compared, what was left out, and why a comparison is impossible."""

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr
from report_fixtures import Page, make_page

from catalogs.compare.comparison import compare
from catalogs.report.sections.record import _account
from common.datasets import read_dataset, write_dataset

pytestmark = pytest.mark.usefixtures("without_drawing")


def recorded(
    mine: fixtures.Mine, folder: Path, *, keep: slice = slice(None), tensors: bool = True, **attributes
) -> Page:
    """The report with another record: some of its events, with or without tensors, and what its reader tells of it."""
    record = read_dataset(mine.record).isel(event=keep).assign_attrs(attributes)
    if not tensors:
        for name in ("potency_tensor", "p_axis", "b_axis", "t_axis"):
            record[name][:] = np.nan
    write_dataset(record, folder / "record.nc")
    made = compare(read_dataset(mine.catalog), record, {"resamplings": 99})
    write_dataset(made, folder / "comparison.nc")
    return make_page(mine, folder, record=folder / "record.nc", comparison=folder / "comparison.nc", steps=[])


def test_result_counts_the_record_inside_and_outside_the_domain(mine, tmp_path):
    """300 of 565 events, a few without a size, and what their potency was: in the first section."""
    crop = {"filter": "domain", "before": 565, "after": 265, "potency_before": 4.0, "potency_after": 1.0}
    dates = {"filter": "start", "before": 580, "after": 565}
    content = recorded(
        mine, tmp_path, rows=595,
        dropped=json.dumps({"of type quarry blast": 2, "rejected": 1, "without a size": 8, "there twice": 4}),
        types_text="570 without a type, 10 rock burst",
        filter=json.dumps([dates, crop | {"farthest": 512.3}]), sizes_text="20 Mw, 560 ML as Mw = 0.9 ML - 0.2",
    )  # fmt: skip
    result = content.sections["record"]
    assert (
        "holds 595 events, of which 2 of type quarry blast, 1 rejected, 8 without a size, 4 there twice are" in result
    )
    assert "Event types of those that have a time, a place and a size: 570 without a type, 10 rock burst." in result
    assert "Of 565 events in the modelled months, 265 lie inside the model's domain and 300 outside, up to" in result
    assert "up to 512 m away, with 75 % of their potency" in result
    assert "560 ML as Mw = 0.9 ML − 0.2" in result


@pytest.mark.parametrize(
    ("keep", "tensors", "says"),
    [
        (
            slice(0, 0),
            True,
            (
                "Places, sizes and axes cannot be compared: the record has no event here. Events of log P ≥ ",
                "The record has no event. The expected number of recorded events is less than 3.69 (95 %). ",
            ),
        ),
        (slice(0, 7), True, ("b is not compared: 10 events are needed in each catalogue, and the record has ",)),
        (slice(0, 1), True, ("Locations cannot be compared: the comparison needs two modelled events",)),
        (slice(0, 40), False, ("The record has no tensors: axes cannot be compared.",)),
        (slice(0, 40), True, ("Most measures of places and axes have no interval and no p-value: fewer than 3 runs",)),
    ],
)
def test_a_comparison_that_is_impossible_is_said_in_the_result(mine, tmp_path, keep, tensors, says):
    """It was left out without a word; and no number is 'nan'."""
    content = recorded(mine, tmp_path, keep=keep, tensors=tensors)
    for sentence in says:
        assert sentence in content.sections["record"]
    assert not [name for name, section in content.sections.items() if re.search(r"\bnan\b", section)]


def test_an_ensemble_with_too_few_events_is_not_told_to_run_one(mine, tmp_path):
    """Nine runs, two of which have events: the report asked for an ensemble of 8."""
    catalog, record = read_dataset(mine.catalog), read_dataset(mine.record)
    members = [catalog] + [catalog.isel(event=slice(0))] * 7
    write_dataset(compare(catalog, record, {"resamplings": 99, "members": 8}, members), tmp_path / "comparison.nc")
    said = make_page(mine, tmp_path, comparison=tmp_path / "comparison.nc", steps=[]).sections["record"]
    assert "fewer than 3 of the model's 9 runs have events of such a size in a step that the record shares" in said
    assert "Set ensemble: 8" not in said


def test_a_record_beside_a_mine_without_dates_is_not_denied(mine, tmp_path):
    """The report said that no record was given."""
    config = fixtures.CONFIG | {"record": {"file": "record.csv"}}
    content = make_page(mine, tmp_path, config=config, catalog=None, record=None, comparison=None, events=[])
    assert "No recorded catalogue was given" not in content.sections["warnings"]
    assert "The record is not compared: no step of this mine has dates" in content.sections["record"]


def evidence_of(count: int, **attributes) -> SimpleNamespace:
    """What the report tells of a record by its attributes alone."""
    record = xr.Dataset({"x": ("event", np.zeros(count))}, attrs=attributes)
    return SimpleNamespace(is_twin=False, comparison=None, record=record, config={})


def test_result_says_so_when_all_of_the_record_lies_inside():
    """And nothing of an outside that there is not; none at all is said, too. Compared are those from the cut on."""
    domain = {
        "filter": "domain",
        "before": 60,
        "after": 60,
        "potency_before": 1.0,
        "potency_after": 1.0,
        "farthest": None,
    }
    record = evidence_of(60, rows=60, dropped="{}", filter=json.dumps([domain]))
    assert _account(record) == (
        "The record holds 60 events. All 60 events in the modelled months lie inside the model's domain."
    )
    counts = {"events_above_cut": ("catalogue", [12, 31])}
    record.comparison = xr.Dataset(counts, attrs={"cut_text": "log P >= -1.50, the record's completeness"})
    assert _account(record).endswith(
        "domain. Events of log P ≥ −1.50 are compared: 31 of the record and 12 of the model."
    )
    none = evidence_of(0, rows=60, filter=json.dumps([domain | {"before": 0, "after": 0}]))
    assert _account(none).endswith("No event lies in the modelled months.")
    record.config = {"record": {"filter": {"start": "2019-08-05"}}}
    assert "All 60 events in the dates compared lie inside" in _account(record)
