"""The distributions are those of scipy.stats, to the last bit."""

import numpy as np
import pytest
from scipy import stats

from catalogs import distributions as ours

SHARES = np.array([1e-12, 0.025, 0.3, 0.5, 0.95, 0.975, 1 - 1e-9])
VALUES = np.array([0.0, 1e-9, 0.5, 1.0, 7.5, 300.0])
FREEDOM = np.array([[0.03], [1], [4], [5.5], [200], [2e7]])

CASES = {
    "normal_quantile": (ours.normal_quantile(SHARES), stats.norm.ppf(SHARES)),
    "normal_tail": (ours.normal_tail(VALUES), stats.norm.sf(VALUES)),
    "t_quantile": (ours.t_quantile(SHARES, FREEDOM), stats.t.ppf(SHARES, FREEDOM)),
    "chi_square_quantile": (ours.chi_square_quantile(SHARES, FREEDOM), stats.chi2.ppf(SHARES, FREEDOM)),
    "chi_square_tail": (ours.chi_square_tail(VALUES, FREEDOM), stats.chi2.sf(VALUES, FREEDOM)),
    "f_quantile": (ours.f_quantile(SHARES, FREEDOM, 3.0), stats.f.ppf(SHARES, FREEDOM, 3.0)),
    "f_share": (ours.f_share(VALUES, FREEDOM, 3.0), stats.f.cdf(VALUES, FREEDOM, 3.0)),
    "f_tail": (ours.f_tail(VALUES, FREEDOM, 3.0), stats.f.sf(VALUES, FREEDOM, 3.0)),
}


@pytest.mark.parametrize("name", CASES)
def test_a_function_is_that_of_scipy_stats(name):
    found, expected = CASES[name]
    assert np.array_equal(found, expected)
    assert np.ptp(found) > 0
