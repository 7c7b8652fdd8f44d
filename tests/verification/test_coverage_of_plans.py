"""Cases of the coverage study of mining plans, with few of them."""

import numpy as np
import yaml

from verification.answers.coverage.plans import calibration_rows, equal_plans, forecast_intervals, ratio_intervals
from workflow import BASE

SETTINGS = yaml.safe_load((BASE / "config/verification/coverage.yaml").read_text())["settings"]["plans"]
FEW = SETTINGS | {"catalogues": 40, "plans": 80, "fewest": 10}


def test_equal_plans_are_hardly_told_apart():
    """By numbers, potency, the page and classes of likelihood: 0.05 and three standard errors of 40 pairs, 0.10."""
    shares = equal_plans(SETTINGS["equal"][1], FEW, np.random.default_rng(1))
    assert set(shares) == {"number", "potency", "page", "class"}
    assert max(shares.values()) <= 0.05 + 0.10


def test_ratios_of_plans_are_held():
    """0.93 less three standard errors of 40 pairs, 0.12."""
    generator = np.random.default_rng(2)
    found = [ratio_intervals(SETTINGS["ratios"][0], FEW, generator, index) for index in range(40)]
    for name in found[0]:
        held = [low <= truth <= high for (low, high), truth in (one[name] for one in found if one[name][0])]
        assert np.mean(held) >= 0.93 - 0.12


def test_stated_chances_come_true():
    """Within a factor of two in each class of stated chances."""
    rows = calibration_rows(SETTINGS["chances"][0], FEW, {"calibration": np.log(2.0)}, np.random.default_rng(3))
    assert len(rows) >= 2
    assert all(row.passed for row in rows)


def test_a_month_after_a_record_that_drifts_is_held():
    """0.93 less three standard errors of 20 records, 0.17."""
    generator, case = np.random.default_rng(4), SETTINGS["forecasts"][2] | {"widths": []}
    found = [forecast_intervals(case, FEW, generator, index) for index in range(20)]
    for name in ("forecast number", "forecast largest"):
        held = [low <= truth <= high for (low, high), truth in (one[name] for one in found)]
        assert np.mean(held) >= 0.93 - 0.17
