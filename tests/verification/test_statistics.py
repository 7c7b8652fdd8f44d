"""The statistics study reduced to seconds, and its closed forms against independent ones."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from running import run_study

from verification.answers import statistics
from verification.answers.statistics import location_recovery as statistics_locations
from verification.answers.statistics import mechanism_recovery as statistics_mechanisms
from verification.answers.statistics import size_recovery as statistics_sizes
from verification.answers.statistics.samples import clustered_locations


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return run_study("statistics", tmp_path_factory.mktemp("statistics")).study


def test_the_reduced_study_holds_wider_bounds(study, tmp_path):
    """200 catalogues, 60 pairs: shares and biases to within four Monte Carlo errors, angles as exactly as ever."""
    chosen = copy.deepcopy(study.settings)
    chosen["sizes"] |= {"catalogues": 200}
    chosen["mechanisms"] |= {"pairs": 300, "random_pairs": 5000}
    chosen["mechanisms"]["cone"] |= {"catalogues": 10, "resamplings": 60}
    chosen["locations"] |= {"pairs": 60, "resamplings": 99}
    chosen["locations"]["shift"] |= {"pairs": 60, "resamplings": 99}
    chosen["locations"]["steps"] |= {"alike_pairs": 60, "shifted_pairs": 60}
    wider = {"bias": 0.1 + 4 * 200**-0.5, "coverage": 4 * 0.0155, "scatter": 0.05 + 4 * 0.05}
    wider |= {"random_angles": 4 * 0.0071, "cone": 4 * 0.07, "false_alarms": 4 * 0.0282, "energy": 0.25}
    results = run_study("statistics", tmp_path)
    results.study = replace(study, settings=chosen, allowed=study.allowed | wider)
    rows, figure = statistics.answer(results)
    assert isinstance(figure, Figure)
    assert [row.quantity for row in rows if row.passed is False] == []
    assert sum(row.passed is True for row in rows) == 3 * len(chosen["sizes"]["cases"]) + 30
    assert len({row.quantity for row in rows}) == len(rows)


def test_a_wrong_estimate_fails_its_rows(study):
    """Bins taken as continuous under the name of a case: mean, coverage and nothing hidden."""
    sizes = study.settings["sizes"] | {"catalogues": 100}
    wrong = statistics_sizes.estimate_cases(sizes | {"cases": [sizes["uncorrected"][1]]}, 1)
    rows = statistics_sizes.size_rows(wrong, [], 0.95, study.allowed)
    assert [row.passed for row in rows[:2]] == [False, False]


def test_fault_vectors_are_as_the_tensor_of_aki_and_richards_says():
    """Their Box 4.4: Mxx = -(sin d cos r sin 2s + sin 2d sin r sin^2 s), and so on, x north, y east, z down."""
    strike, dip, rake = np.array([20.0, 135.0, 310.0]), np.array([80.0, 35.0, 60.0]), np.array([-100.0, 30.0, 170.0])
    found = 2.0 * statistics_mechanisms.double_couple(*statistics_mechanisms.fault_vectors(strike, dip, rake))
    s, d, r = np.radians([strike, dip, rake])
    north = -(np.sin(d) * np.cos(r) * np.sin(2 * s) + np.sin(2 * d) * np.sin(r) * np.sin(s) ** 2)
    north_east = np.sin(d) * np.cos(r) * np.cos(2 * s) + 0.5 * np.sin(2 * d) * np.sin(r) * np.sin(2 * s)
    north_down = -(np.cos(d) * np.cos(r) * np.cos(s) + np.cos(2 * d) * np.sin(r) * np.sin(s))
    east = np.sin(d) * np.cos(r) * np.sin(2 * s) - np.sin(2 * d) * np.sin(r) * np.cos(s) ** 2
    east_down = -(np.cos(d) * np.cos(r) * np.sin(s) - np.cos(2 * d) * np.sin(r) * np.cos(s))
    down = np.sin(2 * d) * np.sin(r)
    np.testing.assert_allclose(found[:, 1, 1], north, atol=1e-14)
    np.testing.assert_allclose(found[:, 0, 1], north_east, atol=1e-14)
    np.testing.assert_allclose(found[:, 1, 2], -north_down, atol=1e-14)
    np.testing.assert_allclose(found[:, 0, 0], east, atol=1e-14)
    np.testing.assert_allclose(found[:, 0, 2], -east_down, atol=1e-14)
    np.testing.assert_allclose(found[:, 2, 2], down, atol=1e-14)


def test_share_of_near_double_couples_in_its_limits():
    """For small w the ball of turns, 2 w^3 / (3 pi), four times 1 / (6 pi) w^3; half a turn of one rotation is all."""
    assert statistics_mechanisms.share_closer(0.0) == 0.0
    small = np.radians(1.0)
    assert statistics_mechanisms.share_closer(1.0) == pytest.approx(2.0 * small**3 / (3.0 * np.pi), rel=1e-4)
    assert statistics_mechanisms.share_closer(180.0) == pytest.approx(4.0)  # four overlapping turns, each certain


def test_hotelling_has_its_level_and_its_power():
    """2000 pairs without and with a shift: 5 %, and the exact power (3 standard errors)."""
    generator = np.random.default_rng(0)
    x, y = generator.normal(size=(2, 2000, 20, 3))
    shift = np.array([0.8, 0.0, 0.0])
    alarms = np.mean([statistics_locations.hotelling_p_value(*pair) <= 0.05 for pair in zip(x, y, strict=True)])
    found = np.mean([statistics_locations.hotelling_p_value(*pair) <= 0.05 for pair in zip(x, y + shift, strict=True)])
    power = statistics_locations.hotelling_power(20, shift, 0.05)
    assert alarms == pytest.approx(0.05, abs=0.0147)
    assert found == pytest.approx(power, abs=3 * np.sqrt(power * (1 - power) / 2000))
    assert statistics_locations.hotelling_power(200, np.array([1 / 3, 0, 0]), 0.05) == pytest.approx(0.804, abs=5e-4)


def test_clustered_locations_scatter_as_they_say():
    """Variance of an event: 30^2 + 10^2; within its cluster 10^2."""
    location, cluster = clustered_locations(np.random.default_rng(1), 4000, [5])
    assert location.std(axis=0) == pytest.approx(np.hypot(30, 10), rel=0.05)
    counts = np.bincount(cluster)
    assert counts.mean() == pytest.approx(5.0, rel=0.03)
    means = np.stack([np.bincount(cluster, column) / counts for column in location.T], axis=1)
    within = np.sum((location - means[cluster]) ** 2, axis=0) / (len(location) - len(counts))
    assert np.sqrt(within) == pytest.approx(10.0, rel=0.03)
