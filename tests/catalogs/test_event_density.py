"""Smoothed events as a density: it integrates to one, equals a twin, and gains what theory says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from catalogs.compare.locations import UNIFORM_SHARE, box_around, information_gain

BOX = np.array([[0.0, 0.0, 0.0], [100.0, 80.0, 60.0]])
VOLUME = 100.0 * 80.0 * 60.0


@given(seed=st.integers(0, 1000), deviation=st.floats(1.0, 30.0))
def test_gain_equals_a_mixture_of_normal_distributions(seed, deviation):
    """Against scipy's densities, event by event."""
    generator = np.random.default_rng(seed)
    places, events = generator.uniform(*BOX, (7, 3)), generator.uniform(*BOX, (5, 3))
    smoothed = np.mean([multivariate_normal(event, deviation**2).pdf(places) for event in events], axis=0)
    expected = np.log(UNIFORM_SHARE + (1 - UNIFORM_SHARE) * smoothed * VOLUME)
    np.testing.assert_allclose(information_gain(places, events, deviation, BOX), expected, rtol=1e-9, atol=1e-9)


def test_density_of_events_well_inside_integrates_to_one():
    """Over the box, by random points; its standard error is 1 %."""
    generator = np.random.default_rng(1)
    events = generator.uniform([30.0, 30.0, 25.0], [70.0, 50.0, 35.0], (20, 3))
    points = generator.uniform(*BOX, (40_000, 3))
    assert np.exp(information_gain(points, events, 6.0, BOX)).mean() == pytest.approx(1.0, abs=0.03)


def test_own_deviation_of_each_place_counts():
    """Each place by its own error is as all places with that error."""
    generator = np.random.default_rng(2)
    places, events = generator.uniform(*BOX, (6, 3)), generator.uniform(*BOX, (9, 3))
    deviations = np.array([2.0, 3.0, 5.0, 8.0, 13.0, 21.0])
    each = [information_gain(places[[n]], events, deviations[n], BOX)[0] for n in range(6)]
    np.testing.assert_allclose(information_gain(places, events, deviations, BOX), each)


def test_true_density_gains_more_than_any_other():
    """Gibbs: places drawn from smoothed events score best with these events and this deviation."""
    generator = np.random.default_rng(3)
    events = generator.uniform([20.0, 20.0, 20.0], [80.0, 60.0, 40.0], (15, 3))
    places = events[generator.integers(15, size=4000)] + 5.0 * generator.standard_normal((4000, 3))
    gain = {width: information_gain(places, events, width, BOX).mean() for width in (2.5, 5.0, 10.0)}
    assert max(gain, key=gain.get) == 5.0
    moved = information_gain(places, events + 5.0 * np.eye(3)[0], 5.0, BOX).mean()
    assert moved < gain[5.0]


def test_no_event_gains_nothing_and_many_are_scored_in_parts(monkeypatch):
    """Without events the density is uniform. Parts make no difference."""
    generator = np.random.default_rng(4)
    places, events = generator.uniform(*BOX, (50, 3)), generator.uniform(*BOX, (30, 3))
    np.testing.assert_array_equal(information_gain(places, events[:0], 5.0, BOX), 0.0)
    whole = information_gain(places, events, 5.0, BOX)
    monkeypatch.setattr("catalogs.compare.locations.MAX_PAIRS", 100)
    np.testing.assert_allclose(information_gain(places, events, 5.0, BOX), whole)


def test_box_holds_all_places_with_a_margin():
    """Corners."""
    found = box_around(np.array([[0.0, 1, 2]]), np.array([[3.0, -1, 5]]), margin=10.0)
    np.testing.assert_array_equal(found, [[-10, -11, -8], [13, 11, 15]])
