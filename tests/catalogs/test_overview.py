"""The picture of a scene before anything is solved: what it shows of grid, solids and record."""

import json

import numpy as np
import pytest
from report_fixtures import NAMES, STEPS, make_catalog, make_grid, make_state

from catalogs.figures.overview import overview, write_overview
from catalogs.figures.style import MAX_STEPS_IN_KEY, thinned

MINED = [
    {"name": name, "dated": bool(dated), "excavations": [excavation]}
    for (name, *_, dated), excavation in zip(STEPS, NAMES, strict=False)
][:2]  # the last is planned


@pytest.fixture(scope="module")
def grid():
    return make_grid(dimension=3)


@pytest.fixture(scope="module")
def record(grid):
    """Events in the domain, and a note of others that lay outside."""
    events = make_catalog(make_state(grid, len(STEPS) - 1), 60, kind="twin", seed=4)
    events.attrs["filter"] = json.dumps([{"filter": "domain", "before": 66, "after": 60, "farthest": 172004.4}])
    return events


def labels(figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_key_names_cells_steps_and_events_outside_the_domain(grid, record):
    """What a user looks for before a run of hours: does all of it lie where it should?"""
    found = labels(overview(grid, MINED, record))
    assert found[0] == f"cells of {grid.attrs['coarse_cell']:g} m"
    assert [label for label in found if label in dict.fromkeys(name for name, *_ in STEPS)] == ["history", "2019-08"]
    assert "planned" in found
    assert found[-1] == "60 recorded events\n6 more outside the domain, up to 172,004 m away"


def test_a_section_and_a_scene_without_record_or_steps(tmp_path):
    """One panel in two dimensions; nothing but planned solids; the file is a picture, twice the same."""
    flat = make_grid(dimension=2)
    figure = overview(flat, [], None)
    assert len(figure.axes) == 1
    assert labels(figure)[-1] == "planned"
    for name in ("one.png", "two.png"):
        write_overview(flat, [], None, tmp_path / name)
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()
    assert (tmp_path / "one.png").read_bytes().startswith(b"\x89PNG")


def test_every_mined_solid_is_drawn_in_its_step_colour(grid):
    """A solid of a step has a filled silhouette in every view; what is planned has an outline only."""
    filled = [
        sum(np.isclose(collection.get_alpha() or 1.0, 0.55) for collection in axes.collections)
        for axes in overview(grid, MINED, None).axes
    ]
    assert filled == [len(MINED)] * 3


@pytest.mark.parametrize("count", [0, 1, MAX_STEPS_IN_KEY, MAX_STEPS_IN_KEY + 1, 200])
def test_the_key_of_many_steps_names_some_from_the_first_to_the_last(count):
    """In order, none twice, with gaps that differ by one at most."""
    named = thinned(list(range(count)))
    assert len(named) == min(count, MAX_STEPS_IN_KEY)
    assert named == sorted(set(named))
    if count:
        assert (named[0], named[-1]) == (0, count - 1)
        assert np.ptp(np.diff(named)) <= 1 if count > 1 else True
