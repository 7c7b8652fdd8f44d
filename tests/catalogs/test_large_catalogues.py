"""Large catalogues: the report is small and says what its view leaves out; results do not depend on parts and order."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr
from catalog_fixtures import made_up_catalog
from hypothesis import given
from hypothesis import strategies as st
from large_catalogues import write_large_mine

from catalogs.compare.exposure import Exposure
from catalogs.report.by_opening import nearest_mined, opening_rows
from catalogs.report.evidence import Evidence
from catalogs.report.sections import convergence, view
from catalogs.report.sections.steps import step_lines
from catalogs.sources import quakeml
from catalogs.sources.openings import NEVER, NOTHING, ROCK, Mining, latest_first, nearest_opening

EVENTS, OPENINGS, STEPS = 4000, 60, 105
MAX_PAGE_BYTES = 8e6


@pytest.fixture(scope="module")
def large(tmp_path_factory) -> fixtures.Mine:
    return write_large_mine(tmp_path_factory.mktemp("large"), EVENTS, OPENINGS, STEPS)


@pytest.fixture(scope="module")
def arguments(large) -> dict:
    return large.arguments(comparison=None, config=json.loads((large.folder / "config.json").read_text()))


@pytest.fixture(scope="module")
def evidence(arguments) -> Evidence:
    return fixtures.evidence_of(**arguments)


def test_the_page_of_many_events_and_steps_is_small_and_says_what_it_leaves_out(arguments, tmp_path, monkeypatch):
    monkeypatch.setattr(view, "MAX_EVENTS", 1000)
    fixtures.write_page(**arguments | {"output": tmp_path / "report.html", "figures": tmp_path / "figures"})
    content = (tmp_path / "report.html").read_text()
    assert len(content.encode()) < MAX_PAGE_BYTES
    sections = fixtures.Page(content).sections
    assert re.findall(r"(\w+): the view leaves out the ([\d\u202f]+) smallest", sections["view"]) == [
        ("Modelled", "3\u202f000"),
        ("Recorded", "3\u202f000"),
    ]
    assert f"{convergence.MAX_PANELS} of {STEPS + 2} stages that took the most iterations" in sections["convergence"]
    assert sections["convergence"].count("multigrid") == STEPS + 2  # the table has all
    assert "4\u202f000 events" in sections["steps"]  # as have the sums


def test_the_order_of_events_does_not_matter(evidence, monkeypatch):
    """The largest events, which the view draws, lines of steps and rows of openings."""
    monkeypatch.setattr(view, "MAX_EVENTS", 1000)
    order = np.random.default_rng(5).permutation(EVENTS)
    shuffled = evidence.record.isel(event=order)
    chosen = view.shown_events(evidence, shuffled)
    assert set(order[chosen]) == set(view.shown_events(evidence, evidence.record))
    assert len(chosen) == 1000
    potency = evidence.record["potency"].values
    assert potency[order[chosen]].min() >= np.sort(potency)[-1000]
    first, other = (opening_rows(evidence, [one], [np.ones(EVENTS, bool)]) for one in (evidence.record, shuffled))
    assert [(row.name, row.sides[0].number) for row in first] == [(row.name, row.sides[0].number) for row in other]
    np.testing.assert_allclose([row.sides[0].potency for row in first], [row.sides[0].potency for row in other])
    assert sum(row.sides[0].number for row in first) == EVENTS


def test_every_event_counts_in_one_step(evidence):
    lines = step_lines(evidence)
    assert [sum(line.sides[side].number for line in lines) for side in (0, 1)] == [EVENTS, EVENTS]
    potency = [sum(line.sides[side].potency for line in lines) for side in (0, 1)]
    np.testing.assert_allclose(potency, [one["potency"].values.sum() for one in (evidence.catalog, evidence.record)])


def test_the_nearest_opening_is_one_that_is_mined_by_then(evidence):
    """As a search of each step of its own finds."""
    events = evidence.resolved.isel(event=slice(None, None, 40))
    found, distance = nearest_mined(evidence, events)
    place = {step["step"]: number for number, step in enumerate(evidence.steps)}
    edge, all_open = float(evidence.grid.attrs["fine_cell"]), np.ones(OPENINGS, bool)
    mined = np.full(OPENINGS, -1)
    mined[evidence.mining.excavation] = evidence.mining.step
    rank = latest_first(mined)
    for name in np.unique(events["step"].values):
        here = events["step"].values == name
        cells, opening = evidence.mining.cells_open(place[name])
        own, apart = nearest_opening(events["location"].values[here], cells, edge, opening, all_open, rank)
        np.testing.assert_allclose(distance[here], apart, atol=1e-9)
        np.testing.assert_array_equal(found[here], own)


@given(seed=st.integers(0, 10_000), steps=st.integers(1, 30))
def test_openings_that_are_mined_again_are_nearest_while_they_stand_open(seed, steps):
    """Against all cells that are open in the step of the point; NaN where none is."""
    random = np.random.default_rng(seed)
    count, points, when = 40, 100 * random.random((25, 3)), random.integers(0, steps, 25)
    step = random.integers(-1, steps, count)
    until = np.where(random.random(count) < 0.5, step + random.integers(1, steps + 2, count), NEVER)
    takes = np.where(random.random(count) < 0.8, ROCK, NOTHING)
    origin = 2.0 * random.integers(0, 50, (count, 3))
    mining = Mining(origin, np.arange(count), step, takes, until, np.ones(count), count)
    found, distance = mining.nearest_open(points, when, 2.0, [0, 1, 2])
    outside = np.maximum(np.maximum(origin - points[:, None], points[:, None] - origin - 2.0), 0.0)
    is_open = (takes != NOTHING) & (step <= when[:, None]) & (until > when[:, None])
    exact = np.where(is_open, np.linalg.norm(outside, axis=2), np.inf)
    best = exact.min(axis=1)
    np.testing.assert_allclose(distance, np.where(np.isfinite(best), best, np.nan), atol=1e-9)
    assert ((found >= 0) == np.isfinite(best)).all()
    assert is_open[found >= 0, found[found >= 0]].all()


@given(seed=st.integers(0, 10_000))
def test_the_step_of_an_event_is_that_whose_window_holds_it(seed):
    """Against a search of all windows: with gaps, with some that are empty, outside of all, without a time."""
    random = np.random.default_rng(seed)
    edges = np.sort(random.integers(0, 60, 20)).astype("M8[h]").astype("M8[ns]")
    time = np.append(random.integers(-5, 65, 50).astype("M8[h]").astype("M8[ns]"), np.datetime64("NaT"))
    exposure = Exposure(edges[::2], edges[1::2])
    inside = (time[:, None] >= exposure.start) & (time[:, None] < exposure.end)
    assert (exposure.step(time) == np.where(inside.any(axis=1), inside.argmax(axis=1), -1)).all()
    assert [int(one.sum()) for one in exposure.counts(time)] == inside.sum(axis=0).tolist()


def test_quakeml_has_the_same_bytes_however_many_events_are_written_at_once(tmp_path, monkeypatch):
    for count in (0, 1, 23):
        catalog = made_up_catalog(23).isel(event=slice(count))
        catalog["step"] = xr.where(catalog["step"] == "", "", "a </event>\n    <event b")
        written: list[bytes] = []
        for at_once in (1000, 5):
            monkeypatch.setattr(quakeml, "EVENTS_AT_ONCE", at_once)
            quakeml.write_quakeml(catalog, Path(tmp_path / "catalog.xml"))
            written.append((tmp_path / "catalog.xml").read_bytes())
        assert written[0] == written[1]
