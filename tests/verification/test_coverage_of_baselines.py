"""Cases of the coverage study of baselines, with few records."""

import numpy as np
import pytest
import yaml

from verification.answers.coverage.baselines import place_scores, rate_alarms
from workflow import BASE

SETTINGS = yaml.safe_load((BASE / "config/verification/coverage.yaml").read_text())["settings"]["baselines"]
FEW = SETTINGS | {"catalogues": 25, "truth_runs": 4}


@pytest.mark.parametrize("runs", [1, 9])
def test_equal_models_are_not_told_apart_by_few_bursts(runs):
    """Intervals hold the truth, and hardly a record tells one run from ten of the same law."""
    case = {"events": 60, "bursts": 12, "shift": 0.0, "runs": runs}
    found = place_scores(case, FEW, np.random.default_rng(1))
    assert found.given > 0.6
    assert found.held["lead"] >= 0.88
    assert found.held["gain"] >= 0.85
    assert found.told_apart <= 0.12


def test_a_model_that_lies_elsewhere_is_told_apart():
    """Twice the spread of the record away, by forty independent events."""
    case = {"events": 40, "branching": 0.0, "shift": 60.0, "runs": 9}
    found = place_scores(case, FEW, np.random.default_rng(2))
    assert found.told_apart > 0.8


def test_one_burst_gives_no_verdict():
    """Of eighty events, in most records; a few hold three and more bursts."""
    case = {"events": 80, "bursts": 1, "shift": 0.0, "runs": 1}
    assert place_scores(case, FEW, np.random.default_rng(3)).given <= 0.1


def test_a_rate_that_stays_fits():
    """In bursts and in triggered sequences, whose numbers vary more than those of independent events."""
    for case in ({"events": 120, "bursts": 12, "months": 3}, {"events": 60, "branching": 0.7, "months": 3}):
        share, count = rate_alarms(case, FEW, np.random.default_rng(4))
        assert share <= 0.12
        assert 0 < count <= FEW["catalogues"]
