"""Rows of shares: out of their bound beyond their own Monte Carlo error only."""

import numpy as np
import pytest
from scipy.stats import binomtest

from verification.answers.coverage.shares import share_at_least, share_at_most
from verification.page_tables import CELL_TEXTS


@pytest.mark.parametrize("count", [40, 150, 400])
@pytest.mark.parametrize("bound", [0.05, 0.85, 0.93])
def test_a_share_misses_its_bound_where_its_binomial_interval_leaves_it_out(bound, count):
    """Two standard errors are the 95.45 % interval of Wilson."""
    for held in range(count + 1):
        interval = binomtest(held, count).proportion_ci(0.9545, "wilson")
        least = share_at_least("coverage", 0.95, held / count, bound, count, "intervals")
        most = share_at_most("alarms", 0.05, held / count, bound, count, "pairs")
        if abs(interval.high - bound) > 1e-4:
            assert least.passed == (interval.high >= bound)
        if abs(interval.low - bound) > 1e-4:
            assert most.passed == (interval.low <= bound)


def test_a_share_that_is_unknown_does_not_pass():
    assert share_at_least("coverage", 0.95, np.nan, 0.93, 0, "intervals").passed is False


def test_a_page_states_the_error_of_a_share():
    row = share_at_least("coverage", 0.95, 0.97, 0.93, 400, "intervals").texts("coverage")
    assert CELL_TEXTS["share"](row) == "0.970 ± 0.026"
    assert row["remark"] == "400 intervals, Monte Carlo standard error 0.0128"
