"""Where the view writes the names of openings, and what it says of each: against brute force and a table by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as some

from catalogs.report.opening_names import MAX_PLACES, _spread, opening_places, responses
from catalogs.report.sections import view
from catalogs.report.sections.view import by_number
from common.opening_table import ALL, FIELDS, SIDES

STEPS = ["history", "2019-08", "2019-09"]


@pytest.fixture(scope="module")
def evidence(mine):
    return fixtures.evidence_of(**mine.arguments())


def table_of(*rows: tuple) -> xr.Dataset:
    """A table of openings of rows (step, excavation, side, chainage_from, depth_p90, closure_median)."""
    names = ("step", "excavation", "side", "chainage_from", "depth_p90", "closure_median")
    columns = dict(zip(names, zip(*rows, strict=True), strict=True))
    return xr.Dataset(
        {
            field.name: (field.dims, np.array(columns.get(field.name, [0] * len(rows)), field.dtype), field.attributes)
            for field in FIELDS
        }
    )


ROWS = [
    ("2019-08", "stope_1", ALL, np.nan, 9.0, 0.03),
    ("2019-08", "stope_1", "roof", np.nan, 2.0, 0.9),
    ("2019-08", "stope_1", "walls", np.nan, 3.5, 0.9),
    ("2019-09", "stope_1", ALL, np.nan, 9.0, np.nan),
    ("2019-09", "stope_1", "floor", np.nan, 1.0, 0.9),
    ("2019-09", "drive", "walls", 5.0, 8.0, 0.8),  # a stretch
    ("2019-09", "elsewhere", "walls", np.nan, 8.0, 0.8),
    ("2020-01", "stope_1", "walls", np.nan, 8.0, 0.8),
]


@settings(max_examples=20, deadline=None)
@given(some.permutations(ROWS))
def test_the_side_with_the_deepest_failure_counts_in_any_order_of_rows(rows):
    """Neither all sides together, nor stretches, nor openings and steps that the view lacks."""
    depth, side, closure = responses(table_of(*rows), ["drive", "stope_1"], STEPS)
    np.testing.assert_array_equal(depth, [[np.nan] * 3, [np.nan, 3.5, 1.0]])
    np.testing.assert_array_equal(side, [[-1] * 3, [-1, SIDES.index("walls"), SIDES.index("floor")]])
    np.testing.assert_array_equal(closure, [[np.nan] * 3, [np.nan, 0.03, np.nan]])


def test_without_a_table_nothing_is_known():
    depth, side, closure = responses(None, ["drive"], STEPS)
    assert np.isnan(depth).all()
    assert np.isnan(closure).all()
    assert (side == -1).all()
    assert [one.shape for one in responses(table_of(*ROWS), [], STEPS)] == [(0, 3)] * 3


def test_places_lie_in_their_openings_and_reach_all_of_them(evidence):
    """By brute force over the cells that each opening mines."""
    mining, edge = evidence.mining, float(evidence.grid.attrs["fine_cell"])
    found = opening_places(evidence)
    assert sorted(index for index, *_ in found) == [0, 1, 2, 3]
    volumes = []
    for index, places, reach in found:
        own = (mining.excavation == index) & (mining.takes > 0)
        corner = mining.origin[own]
        inside = ((places[:, None] > corner) & (places[:, None] < corner + edge)).all(axis=2)
        assert inside.any(axis=1).all()
        assert 1 <= len(places) <= MAX_PLACES
        ends = (corner[:, None] + edge * np.indices((2, 2, 2)).reshape(3, 8).T).reshape(-1, 3)
        assert np.linalg.norm(ends[:, None] - places, axis=2).min(axis=1).max() <= reach + 1e-9
        volumes.append(mining.volume[own].sum())
    assert volumes == sorted(volumes, reverse=True)


def test_the_name_of_a_bent_opening_lies_in_it():
    """The centroid of a ring is in its middle, which is rock."""
    angle = np.arange(40) * np.pi / 20
    ring = np.column_stack([30 * np.cos(angle), 30 * np.sin(angle), np.zeros(40)])
    places, reach = _spread(ring, np.ones(40))
    assert (np.linalg.norm(places[:, None] - ring, axis=2).min(axis=1) == 0.0).all()
    assert np.linalg.norm(places[0]) == pytest.approx(30.0)
    assert len(places) == MAX_PLACES
    assert reach <= 2 * 30 * np.sin(np.pi / 20) + 1e-9  # of the forty, two apart at most
    assert len(_spread(ring[:1], np.ones(1))[0]) == 1


def test_the_page_is_given_names_steps_and_responses(evidence):
    """Through JSON, as view.js reads it; a planned opening has no step."""
    shown = view.section(replace(evidence, openings=table_of(*ROWS)), None)
    data = json.loads(json.dumps(shown["data"]["names"]))
    steps = {one["name"]: (one["step"], one["filled"]) for one in data["openings"]}
    assert steps == {"drive": (0, -1), "stope_1": (1, 1), "stope_2": (2, -1), "stope_9": (-1, -1)}
    assert shown["openings"] == sorted(steps)
    assert data["measured"]
    assert data["sides"] == list(SIDES)
    assert not view.section(evidence, None)["data"]["names"]["measured"]


def test_names_are_listed_by_their_numbers():
    names = ["stope_10", "stope_2", "decline", "2", "10", "stope_2b", ""]
    assert sorted(names, key=by_number) == ["", "2", "10", "decline", "stope_2", "stope_2b", "stope_10"]
