"""Gaussian process of trials: known functions, known noise, and trials left out."""

import numpy as np
import pytest

from calibration.design import sobol_points
from calibration.surrogate import Surrogate


def simulator(points, noise=0.0, seed=0):
    """Two outputs of three quantities, of which the third has no effect."""
    x, y, _ = points.T
    smooth = np.stack([2.0 * x + np.sin(3.0 * y), 1.0 - 3.0 * (x - y) ** 2], axis=1)
    return smooth + noise * np.random.default_rng(seed).normal(size=smooth.shape)


@pytest.fixture(scope="module")
def trained():
    """A surrogate of 40 noisy trials."""
    points = sobol_points(40, 3, seed=1)
    return Surrogate(points, simulator(points, noise=0.1))


def test_design_is_even_and_nested():
    """Every half of every quantity holds half of the points; a longer design begins with the shorter one."""
    points = sobol_points(64, 4, seed=3)
    assert ((points >= 0.0) & (points < 1.0)).all()
    np.testing.assert_array_equal((points < 0.5).sum(axis=0), 32)
    np.testing.assert_array_equal(sobol_points(40, 4, seed=3), points[:40])


def test_surrogate_finds_function_noise_and_what_has_no_effect(trained):
    """Unseen points within the stated deviation in nine of ten cases; noise to a third; the idle length is long."""
    unseen = sobol_points(256, 3, seed=9)
    mean, deviation = trained.predict(unseen)
    inside = np.abs(mean - simulator(unseen)) < 1.645 * deviation
    assert 0.8 < inside.mean() <= 1.0
    assert np.sqrt(np.mean((mean - simulator(unseen)) ** 2)) < 0.1
    np.testing.assert_allclose(trained.noise, 0.1, rtol=0.35)
    assert (trained.lengths[:, 2] > 3.0 * trained.lengths[:, :2].max(axis=1)).all()


def test_trials_left_out_are_as_a_surrogate_without_them_predicts_them(trained):
    """Closed form beside the same processes conditioned on 39 trials."""
    mean, deviation = trained.left_out()
    for left in (0, 17):
        others, place = trained.without(left), trained.points[left : left + 1]
        assert len(others.points) == 39
        expected, own = others.predict(place)
        np.testing.assert_allclose(mean[left], expected[0], rtol=1e-6)
        np.testing.assert_allclose(deviation[left], np.hypot(own[0], trained.noise), rtol=1e-6)


def test_an_output_that_never_changes_is_kept():
    """All trials alike, as where rock never fails in a step: no division by its spread."""
    points = sobol_points(8, 2, seed=5)
    mean, deviation = Surrogate(points, np.full((8, 1), 3.0)).predict(points)
    np.testing.assert_allclose(mean, 3.0)
    assert np.isfinite(deviation).all()
