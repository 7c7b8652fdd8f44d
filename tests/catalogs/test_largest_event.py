"""Interval of the largest event of another run: of the law of sizes of one run, or of the runs of an ensemble."""

from dataclasses import replace

import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr
from report_fixtures import compared, said

from catalogs.report.text import magnitude
from catalogs.report.verdict import another_run, expected_range
from catalogs.sources.size_law import POWER, TRUNCATED
from catalogs.sources.truncated_law import largest_interval
from verification.answers.statistics.samples import simulated_sizes


@pytest.mark.parametrize(("law", "span"), [(POWER, np.inf), (TRUNCATED, 2.0)])
def test_the_interval_of_the_largest_event_holds_that_of_another_catalogue(law, span):
    """Sixty pairs of catalogues, of 80 events on average: 0.95 less three Monte Carlo errors."""
    generator = np.random.default_rng(2)
    held = []
    for _ in range(60):
        first, second = (simulated_sizes(generator, generator.poisson(80), 0.67, span) for _ in range(2))
        low, high = largest_interval(first, 0.0, law, 1.0, generator)
        held.append(low <= second.max() <= high)
    assert np.mean(held) >= 0.86


def test_the_largest_event_of_clustered_events_is_less_certain():
    x = simulated_sizes(np.random.default_rng(1), 60, 0.67)
    low, high = largest_interval(x, 0.0, POWER, 1.0, np.random.default_rng(1))
    lower, higher = largest_interval(x, 0.0, POWER, 8.0, np.random.default_rng(1))
    assert lower < low < high
    assert higher > lower


def test_another_run_is_as_far_off_as_student_says():
    """Of 3 runs t with two degrees of freedom, 4.303, times sqrt(4 / 3) of their standard deviation, 1."""
    np.testing.assert_allclose(
        another_run(np.array([0.0, 1.0, 2.0]), 0.05), 1.0 + np.array([-1, 1]) * 5.0185, atol=1e-3
    )


def test_the_range_of_the_largest_is_of_the_law_or_of_the_runs(known):
    law = compared(known, law_model="power law")
    low, high = (magnitude(10.0**end, fixtures.SHEAR) for end in expected_range(law))
    words = f"the largest event of another run would have Mw {np.floor(10 * low) / 10:.1f} to "
    words += f"{np.ceil(10 * high) / 10:.1f} (95 %)."
    assert words.replace("-", "−") in said(law)
    assert expected_range(compared(known, law_model="no power law")) is None
    edges = np.array([-3.0, -2.9, -2.8])
    counts = np.array([[9, 4, 0], [9, 4, 1], [3, 1, 0], [8, 0, 0]])
    runs = xr.Dataset({"size_bin_lower": ("size_bin", edges), "cumulative": (("run", "size_bin"), counts)})
    bounds = expected_range(replace(law, spread=runs.assign_attrs(members=3)))
    np.testing.assert_allclose(bounds, another_run(np.array([-2.85, -2.75, -2.85, -2.95]), 0.05))
    np.testing.assert_allclose(expected_range(replace(law, spread=runs.assign_attrs(members=2))), expected_range(law))
