"""The sentence of the first page on the openings in which rock fails deepest."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from catalogs.report.sections import openings as page
from catalogs.report.sections.openings import OpeningLine


def line(name: str, roof: float, walls: float, filled: bool = False, closure: float = np.nan) -> OpeningLine:
    rest = [np.nan] * 3
    return OpeningLine(
        name, filled, (roof, walls, 0.0, 0.0), max(roof, walls), 1.0, 1.0, 0.0, closure, *rest, 0.0, 0, 0.0
    )


@pytest.fixture
def worst(monkeypatch):
    """The sentence for lines that are given from the deepest on."""

    def found(*lines: OpeningLine) -> str:
        monkeypatch.setattr(page, "opening_lines", lambda evidence: list(lines))
        monkeypatch.setattr(page, "deepest_stretch", lambda evidence, name, side: None)
        return page.worst(None)

    return found


def test_openings_that_are_filled_give_way_to_open_ones(worst):
    """Nobody goes there any more. Where all are filled or all stand open, nothing is said of it."""
    old, new = line("old", 20.0, 9.0, filled=True), line("new", 2.0, 5.0, closure=0.012)
    assert worst(old, new) == "Of what stands open, rock has failed deepest at new, walls 5.0 m, closure 12 mm."
    assert worst(old) == "Rock has failed deepest at old, roof 20 m."
    assert worst(new, line("next", 1.0, 0.0)) == (
        "Rock has failed deepest at new, walls 5.0 m, closure 12 mm; next, roof 1.0 m."
    )


def test_rock_that_fails_in_no_open_wall_is_not_named(worst):
    assert worst(line("old", 20.0, 9.0, filled=True), line("new", 0.0, 0.0)) == ""
    assert worst() == ""


def table(rows: list[tuple], drive: str = "drive") -> SimpleNamespace:
    """Evidence with a table of a drive: rows (step, side, from, to, depth of nine tenths), chainage in m."""
    columns = {
        "excavation": np.array([drive] * len(rows), object),
        "step": np.array([row[0] for row in rows], object),
        "side": np.array([row[1] for row in rows], object),
        "chainage_from": np.array([row[2] for row in rows]),
        "chainage_to": np.array([row[3] for row in rows]),
        "depth_p90": np.array([row[4] for row in rows]),
    }
    others = (
        "depth_largest", "failed_volume", "failed_volume_step", "fallen_volume", "closure_median", "major_stress",
        "major_stress_change", "strength_factor", "through_share", "events_modelled", "events_recorded", "filled",
    )  # fmt: skip
    columns |= {name: np.zeros(len(rows)) for name in others}
    data = xr.Dataset({name: ("row", values) for name, values in columns.items()})
    return SimpleNamespace(openings=data, steps=[{"step": "a"}, {"step": "b"}])


ENDS = [("b", "all", np.nan, np.nan, 4.0), ("b", "roof", np.nan, np.nan, 4.0), ("b", "walls", np.nan, np.nan, 1.0)]


def test_a_drive_says_where_along_it_failure_is_deepest():
    """Neighbouring stretches of the same depth are one; a gap, another side or an earlier step does not count."""
    roof = [("b", "roof", 5.0 * i, 5.0 * i + 5.0, depth) for i, depth in enumerate([1.0, 6.0, 6.0, 2.0, 6.0])]
    others = [("a", "roof", 0.0, 5.0, 9.0), ("b", "walls", 0.0, 5.0, 8.0)]
    for rows in (roof, roof[::-1]):
        said = page.worst(table([*ENDS, *others, *rows]))
        assert said == "Rock has failed deepest at drive, roof 4.0 m (deepest 5 to 15 m along it), closure 0 mm."
    apart = [row for row in roof if row[2] != 10.0]
    assert "deepest 5 to 10 m along it" in page.worst(table([*ENDS, *apart]))


def test_steps_after_a_collapse_leave_the_last_that_is_computed():
    evidence = table([("a", *row[1:]) for row in ENDS])
    assert page.worst(evidence) == ""
    evidence.steps[1]["computed"] = 0
    assert page.worst(evidence) == "Rock has failed deepest at drive, roof 4.0 m, closure 0 mm."


def test_what_is_no_drive_has_no_chainage():
    assert page.worst(table(ENDS)) == "Rock has failed deepest at drive, roof 4.0 m, closure 0 mm."
    sound = [("b", "roof", 0.0, 5.0, 0.0), ("b", "roof", 5.0, 10.0, np.nan)]
    assert "along it" not in page.worst(table([*ENDS, *sound]))
