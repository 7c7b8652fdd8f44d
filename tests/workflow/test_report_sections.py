"""Planes of the report that cannot be shown are refused in one line that names the key."""

import re

import pytest
from tiny_mines import FLAT, TINY, merged, write_mine

from common.errors import InputError
from workflow.configuration import load

BAD = {
    "two_kinds": ({"name": "a", "excavation": "x", "dip": "4 deg"}, "stands beside excavation"),
    "half": ({"name": "a", "point": ["1 m", "2 m", "3 m"], "dip": "4 deg"}, "give point, strike and dip"),
    "steep": ({"name": "a", "point": ["1 m", "2 m", "3 m"], "strike": "1 deg", "dip": "91 deg"}, "dip"),
    "negative": ({"name": "a", "point": ["1 m", "2 m", "3 m"], "strike": "1 deg", "dip": "-1 deg"}, "dip"),
    "plan": ({"name": "a", "point": ["1 m", "2 m"], "strike": "1 deg", "dip": "9 deg"}, "point"),
    "unitless": ({"name": "a", "point": ["1 m", "2 m", "3 m"], "strike": 1, "dip": "9 deg"}, "unit"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_planes_are_refused_in_one_line(case, tmp_path):
    values, said = BAD[case]
    file = write_mine(TINY, tmp_path / "tiny.yaml")
    with pytest.raises(InputError) as refused:
        load(merged(TINY | {"report": {"sections": [values]}}), file)
    (line,) = refused.value.lines
    assert said in line
    assert re.search(r"report\.sections", line)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"excavation": "stop_1"}, "report.sections[0].excavation: no excavation 'stop_1'; did you mean stope_1?"),
        (
            {"point": ["40 m", "40 m", "5000 m"], "strike": "0 deg", "dip": "0 deg"},
            "report.sections[0].point: the plane passes the domain at a distance of",
        ),
    ],
)
def test_planes_that_fit_no_mine_are_refused_in_one_line(values, said, tmp_path):
    file = write_mine(TINY, tmp_path / "tiny.yaml")
    with pytest.raises(InputError) as refused:
        load(merged(TINY | {"report": {"sections": [{"name": "a"} | values]}}), file)
    (line,) = refused.value.lines
    assert said in line


def test_a_scene_in_a_plane_has_no_further_sections(tmp_path):
    values = {"name": "a", "point": ["1 m", "2 m", "3 m"], "strike": "1 deg", "dip": "9 deg"}
    file = write_mine(FLAT, tmp_path / "flat.yaml")
    with pytest.raises(InputError) as refused:
        load(merged(FLAT | {"report": {"sections": [values]}}), file)
    assert any("is a section itself; leave it out" in line for line in refused.value.lines)


def test_points_are_in_the_mines_own_grid(tmp_path):
    """A point is shifted with the grid of the mine file, as its solids are."""
    same = {"axes": ["east", "north"], "origin": {"grid": ["0 m", "0 m"], "map": ["0 m", "0 m"]}}
    section = {"name": "a", "point": ["40 m", "30 m", "40 m"], "strike": "10 deg", "dip": "80 deg"}
    moved = {"axes": ["east", "north"], "origin": {"grid": ["0 m", "0 m", "0 m"], "map": ["0 m", "0 m", "7 m"]}}
    found = []
    for grid in (same, moved):
        values = TINY | {"frame": TINY["frame"] | {"grid": grid}, "report": {"sections": [section]}}
        mine = load(merged(values), write_mine(values, tmp_path / "tiny.yaml"))
        found.append(mine.report_slice()["sections"][0]["point"])
    assert list(found[0]) == [40.0, 30.0, 40.0]
    assert list(found[1]) == [40.0, 30.0, 47.0]
