"""The sentence of the first page on the openings in which rock fails deepest."""

import numpy as np
import pytest

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
