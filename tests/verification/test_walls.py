"""The study of walls that lie anywhere: its rows and figure, from potencies that are made up."""

from pathlib import Path

import pytest
import yaml
from running import DEFAULT, STUDIES

from verification.answers import walls
from verification.results import Results
from verification.studies import load_study


def test_limit_spread_and_extrapolation_are_those_of_the_potencies(monkeypatch):
    """Potency 2 (1 + h / 10 m) on faces, h the cell: the limit is 2. Moved by a half: a tenth less."""
    study = load_study(Path(STUDIES / "walls.yaml"), DEFAULT)
    size = {"4": 2.5, "8": 1.25, "16": 0.625}

    def potency(name):
        part = next(part for part in name.split("_") if part in size)
        return 2.0 * (1.0 + size[part] / 10.0) * (0.9 if "half" in name else 1.0)

    monkeypatch.setattr(walls, "released", potency)
    names = yaml.safe_load((STUDIES / "walls.yaml").read_text())["variants"]
    rows, figure = walls.answer(Results(study, {name: name for name in names}))
    found = {row.quantity: row for row in rows}
    assert len(found) == len(rows) == 2 + 3 + 6 * 7 + 3 + 2  # the last: runs with other fill
    assert found["filled: limit of the potency of ever smaller cells, m3"].obtained == pytest.approx(2.0)
    assert found["filled, 8 cells across, mean, half: potency, m3"].error == pytest.approx(0.0125)
    assert found["filled, 8 cells across, mean, quarter: potency, m3"].passed is False
    assert found["filled, 8 cells across, whole, half: potency, m3"].passed is None
    assert found["filled, 4 cells across, mean, unturned: spread of potency over placements"].error == pytest.approx(
        0.1 / 0.975
    )
    assert found["filled, 4 cells across, mean, turned: spread of potency over placements"].error == 0.0
    assert found["filled, half, mean: potency extrapolated, m3"].obtained == pytest.approx(1.8)
    assert len(figure.axes) == 3
