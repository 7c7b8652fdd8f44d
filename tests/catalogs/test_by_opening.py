"""Events by opening: sums are kept, an event waits for its opening, and long tables end with all others."""

import numpy as np
import pytest
import xarray as xr
from report_fixtures import evidence_of, make_mine

from catalogs.report import by_opening
from catalogs.report.by_opening import Near, OpeningRow, nearest_mined, opening_rows, with_most_potency


@pytest.fixture(scope="module", params=[3, 2])
def evidence(request, tmp_path_factory):
    """Of a synthetic mine in three dimensions, and in a plane."""
    mine = make_mine(tmp_path_factory.mktemp("mine"), dimension=request.param)
    return evidence_of(**mine.arguments())


def all_of(events: xr.Dataset):
    """Every event counts."""
    return np.ones(events.sizes["event"], bool)


def test_every_event_with_a_step_is_counted_once(evidence):
    """Number, potency and shares add up to those of the catalogues."""
    catalogues = [evidence.resolved, evidence.record]
    rows = opening_rows(evidence, catalogues, [all_of(one) for one in catalogues])
    for side, events in enumerate(catalogues):
        found = nearest_mined(evidence, events)[0] >= 0
        assert found.any()
        assert sum(row.sides[side].number for row in rows) == found.sum()
        total = events["potency"].values[found].sum()
        assert sum(row.sides[side].potency for row in rows) == pytest.approx(total)
        assert np.nansum([row.sides[side].share for row in rows]) == pytest.approx(1.0)
    assert all(row.sides[0].per_volume == pytest.approx(1000 * row.sides[0].potency / row.mined) for row in rows)


def test_no_event_is_given_to_an_opening_that_is_mined_later(evidence):
    """Nor to a planned one. The drive of history is there in all steps."""
    names = [one.name for one in evidence.excavations]
    for events in (evidence.resolved, evidence.record):
        found, distance = nearest_mined(evidence, events)
        first = found[(events["time"].values < np.datetime64("2019-09-01")) & (found >= 0)]
        assert len(first)
        assert names.index("stope_2") not in first
        assert names.index("stope_9") not in found
        assert (distance[found >= 0] >= 0.0).all()


def test_the_step_of_a_recorded_event_is_that_of_its_time(evidence):
    """As in the comparison, whatever a column of its file says."""
    named = evidence.record.copy()
    named["step"] = ("event", np.full(named.sizes["event"], "2019-09", dtype=object))
    for one, other in zip(nearest_mined(evidence, evidence.record), nearest_mined(evidence, named), strict=True):
        np.testing.assert_array_equal(one, other)


def test_only_events_that_count_are_counted(evidence):
    """None of the record, half of the model."""
    half = np.arange(evidence.resolved.sizes["event"]) % 2 == 0
    nothing = np.zeros(evidence.record.sizes["event"], bool)
    rows = opening_rows(evidence, [evidence.resolved, evidence.record], [half, nothing])
    placed = nearest_mined(evidence, evidence.resolved)[0] >= 0
    assert sum(row.sides[0].number for row in rows) == (half & placed).sum()
    assert all(row.sides[1].number == 0 and np.isnan(row.sides[1].largest) for row in rows)


def test_many_openings_end_with_the_sum_of_the_others(monkeypatch):
    """No event and no potency is lost."""
    rows = [OpeningRow(f"drive {n}", "one", 100.0, (Near(n, 0.1 * n, n / 10, n, 2.0, -n),)) for n in (1, 4, 2, 3)]
    assert with_most_potency(rows) == rows
    monkeypatch.setattr(by_opening, "MAX_ROWS", 3)
    monkeypatch.setattr(by_opening, "ROWS_LISTED", 2)
    *most, others = with_most_potency(rows)
    assert [row.name for row in (*most, others)] == ["drive 4", "drive 3", "2 others"]
    (near,) = others.sides
    assert (near.number, near.largest, others.mined) == (3, -1, 200.0)
    assert [near.potency, near.share, near.per_volume] == pytest.approx([0.3, 0.3, 1.5])
