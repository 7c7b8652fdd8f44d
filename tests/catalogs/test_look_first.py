"""Where to look first in the mine: the opening and the step with most potency, of the model and of the record."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from report_fixtures import evidence_of, make_mine

from catalogs.report.by_opening import nearest_mined, step_of_events
from catalogs.report.evidence import Evidence
from catalogs.report.look_first import MAX_PLACES, look_first


@pytest.fixture(scope="module")
def evidence(tmp_path_factory) -> Evidence:
    """Of a synthetic mine without a comparison: all events count."""
    found = evidence_of(**make_mine(tmp_path_factory.mktemp("mine"), coarse=16.0).arguments())
    return replace(found, comparison=None)


def is_near(evidence: Evidence, events: xr.Dataset, opening: str, step: str) -> np.ndarray:
    """Events (event,) bool that are nearest to an opening in a step."""
    names, steps = [one.name for one in evidence.excavations], [one["step"] for one in evidence.steps]
    near = nearest_mined(evidence, events)[0] == names.index(opening)
    return near & (step_of_events(evidence, events) == steps.index(step))


def loud(evidence: Evidence, events: xr.Dataset, opening: str, step: str) -> xr.Dataset:
    """The catalogue with one cubic metre in the first event near an opening in a step, and little in the others."""
    potency = np.full(events.sizes["event"], 1e-3)
    potency[np.flatnonzero(is_near(evidence, events, opening, step))[0]] = 1.0
    return events.assign(potency=("event", potency, events["potency"].attrs))


def test_it_is_where_most_potency_is(evidence):
    """An event of 1 m3 among others of 0.001 m3, near one opening in the model and near another in the record."""
    found = replace(
        evidence,
        catalog=loud(evidence, evidence.catalog, "stope_2", "2019-09"),
        record=loud(evidence, evidence.record, "stope_1", "2019-08"),
    )
    first, *others = look_first(found)
    assert (first.opening, first.step) == ("stope_2", "2019-09")
    potency = found.resolved["potency"].values
    here = is_near(found, found.resolved, "stope_2", "2019-09")
    share = 100 * potency[here].sum() / potency.sum()
    assert float(first.text.split()[0]) == pytest.approx(share, abs=0.5)  # two digits
    assert "largest event Mw 0.8" in first.text.split(";")[0]  # 22.8 GPa times 1 m3
    assert (first.source, first.mined) == ("most in the model", "2019-09")
    (recorded,) = [one for one in others if (one.opening, one.step) == ("stope_1", "2019-08")]
    assert "most in the record" in recorded.source
    assert recorded.mined == "2019-08"
    assert 1 + len(others) <= MAX_PLACES


def test_it_does_not_depend_on_the_order_of_events(evidence):
    turned = replace(
        evidence,
        catalog=evidence.catalog.isel(event=slice(None, None, -1)),
        record=evidence.record[{"event": slice(None, None, -1)}],
    )
    assert look_first(turned) == look_first(evidence)


def test_history_is_no_place_to_look_at_and_nothing_is_none(evidence):
    assert all(one.step != "history" for one in look_first(evidence))
    silent = replace(evidence, catalog=evidence.catalog.isel(event=slice(0)), record=None)
    assert look_first(silent) == []
    alone = look_first(replace(evidence, record=None))
    assert alone
    assert all("recorded" not in one.text for one in alone)
