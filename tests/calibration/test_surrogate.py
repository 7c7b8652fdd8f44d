"""Gaussian process of trials: known functions, known noise, and trials left out."""

import numpy as np
import pytest

from calibration.posterior import sobol_points
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
    return Surrogate(points, simulator(points, noise=0.1), np.arange(40))


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
        expected, own = _of_others(trained, left).predict(trained.points[left : left + 1])
        np.testing.assert_allclose(mean[left], expected[0], rtol=1e-6)
        np.testing.assert_allclose(deviation[left], np.hypot(own[0], trained.noise), rtol=1e-6)


def _of_others(trained, left):
    """The same processes without a trial, scaled as with it."""
    kept = trained.trials != left
    others = trained.of(trained.points[kept], trained.outputs[kept], trained.trials[kept])
    scaled = ((trained.outputs[kept] - trained._mean) / trained._scale).T
    rows = trained._rows(others.points, others.trials)
    for process, output in zip(others._processes, scaled, strict=True):
        process.fit(rows, output)
    others._mean, others._scale = trained._mean, trained._scale
    return others


def test_surrogate_of_other_rows_keeps_hyperparameters(trained):
    """The same rows give the same surrogate; doubled outputs double what it predicts."""
    unseen = sobol_points(16, 3, seed=9)
    same = trained.of(trained.points, trained.outputs, trained.trials)
    doubled = trained.of(trained.points, 2.0 * trained.outputs, trained.trials)
    for part, factor in zip(range(2), (2.0, 2.0), strict=True):
        np.testing.assert_allclose(same.predict(unseen)[part], trained.predict(unseen)[part])
        np.testing.assert_allclose(doubled.predict(unseen)[part], factor * trained.predict(unseen)[part])


def test_rows_of_one_trial_share_its_chance():
    """Four rows of each trial with chance of their own and a larger one in common: both are found, an unseen point is
    predicted as uncertain as the common one leaves it, and rows of a trial are left out together."""
    random = np.random.default_rng(2)
    trials = np.repeat(np.arange(40), 4)
    points = sobol_points(40, 3, seed=1)[trials]
    points[:, 2] = sobol_points(160, 1, seed=2)[:, 0]
    shared, own = 0.3 * random.normal(size=40)[trials], 0.02 * random.normal(size=160)
    made = (2.0 * points[:, 0] + points[:, 2] + shared + own)[:, None]
    found = Surrogate(points, made, trials)
    np.testing.assert_allclose(found.noise, np.hypot(0.3, 0.02), rtol=0.3)
    unseen = sobol_points(64, 3, seed=9)
    mean, deviation = found.predict(unseen)
    off = mean[:, 0] - 2.0 * unseen[:, 0] - unseen[:, 2]
    assert 0.8 < np.mean(np.abs(off) < 1.645 * deviation[:, 0]) <= 1.0
    assert np.sqrt(np.mean(off**2)) < 0.2
    left, spread = found.left_out()
    assert 0.8 < np.mean(np.abs(made - left) < 1.645 * spread) < 0.98
    blind = Surrogate(points, made, np.arange(160)).predict(unseen)[0][:, 0]  # takes rows as independent
    assert np.sqrt(np.mean((blind - 2.0 * unseen[:, 0] - unseen[:, 2]) ** 2)) > 2.0 * np.sqrt(np.mean(off**2))


def test_covariance_is_that_of_the_prediction(trained):
    """Its diagonal is the variance; an added trial lowers it as the closed form says."""
    unseen = sobol_points(8, 3, seed=9)
    for output in range(2):
        found = trained.covariance(unseen, output)
        np.testing.assert_allclose(np.sqrt(np.diag(found)), trained.predict(unseen)[1][:, output], rtol=1e-6)
        np.testing.assert_allclose(found, found.T, atol=1e-12)


def test_an_output_that_never_changes_is_kept():
    """All trials alike, as where rock never fails in a step: no division by its spread."""
    points = sobol_points(8, 2, seed=5)
    mean, deviation = Surrogate(points, np.full((8, 1), 3.0), np.arange(8)).predict(points)
    np.testing.assert_allclose(mean, 3.0)
    assert np.isfinite(deviation).all()
