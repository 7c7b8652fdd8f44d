"""Means of gains with intervals by clusters and runs, and the paired T test."""

import numpy as np
import pytest

from baselines.map_scores import MIN_CLUSTERS, Estimate, MapScores, adjusted, cluster_variance, run_variance


def scores_of(*gains: np.ndarray, cluster: np.ndarray) -> MapScores:
    """Scores of maps named 0, 1, ... at events of one step, gains (run, event)."""
    labels = tuple(str(number) for number in range(len(gains)))
    return MapScores(labels, gains, np.zeros(len(cluster), int), cluster)


def test_interval_holds_the_mean_of_clustered_events():
    """Events of a cluster gain alike: the interval of 20 clusters of 5 holds the true mean 19 times of 20, that of
    events as such does not."""
    generator, held = np.random.default_rng(9), {True: [], False: []}
    for _ in range(300):
        cluster = np.repeat(np.arange(20), 5)
        gain = generator.normal(size=20)[cluster][None] + 0.2 * generator.normal(size=(1, 100))
        for clustered in held:
            low, high = scores_of(gain, cluster=cluster if clustered else np.arange(100)).interval()[0]
            held[clustered].append(low <= 0.0 <= high)
    assert np.mean(held[True]) == pytest.approx(0.95, abs=0.03)
    assert np.mean(held[False]) < 0.75


def gain_at(place: np.ndarray) -> np.ndarray:
    """Gain of a narrow map beside the truth over a wide one, with the floor of a uniform share of a twentieth."""
    return np.logaddexp(np.log(0.05), np.log(0.95) - 0.5 * np.log(0.4) - (place - 0.5) ** 2 / 0.8 + 0.125 * place**2)


@pytest.mark.parametrize(("clusters", "mean_size"), [(8, 3.0), (12, 10.0), (40, 5.0)])
def test_the_interval_of_a_skewed_gain_holds_the_truth(clusters, mean_size):
    """In 93 of 100 catalogues at least, also of few clusters of very unequal size (geometric)."""
    generator, held = np.random.default_rng(3), []
    true = gain_at(np.sqrt(1.01) * generator.normal(size=1_000_000)).mean()
    for _ in range(400):
        size = generator.geometric(1.0 / mean_size, clusters)
        cluster = np.repeat(np.arange(clusters), size)
        gain = gain_at(generator.normal(size=clusters)[cluster] + 0.1 * generator.normal(size=size.sum()))
        low, high = Estimate.of(gain.mean(), cluster_variance(gain, cluster)).interval
        if np.isfinite(low):
            held.append(low <= true <= high)
    assert len(held) > 200
    assert np.mean(held) >= 0.93


def test_too_few_clusters_have_no_interval_and_no_p_value():
    """Nor has a record of which one cluster holds nearly all events."""
    gains = np.random.default_rng(1).normal(size=(2, 1, 100))
    for cluster in (np.repeat([0, 1, 2], [34, 33, 33]), np.r_[np.zeros(90, int), 1:11]):
        scores = scores_of(*gains, cluster=cluster)
        assert scores.effective_clusters < MIN_CLUSTERS
        assert not scores.has_intervals
        assert np.isnan(scores.interval()).all()
        assert np.isnan(scores.lead("0", "1").p_value)
    assert scores_of(*gains, cluster=np.repeat(np.arange(5), 20)).has_intervals


def test_lead_is_known_better_than_each_gain():
    """What models share, such as events far from all, drops out of their difference."""
    generator = np.random.default_rng(10)
    shared = generator.normal(size=(1, 60))
    scores = scores_of(shared + 0.3, shared + 0.1 * generator.normal(size=(1, 60)), cluster=np.arange(60))
    lead = scores.lead("0", "1")
    low, high = lead.interval
    assert lead.value == pytest.approx(scores.mean()[0] - scores.mean()[1])
    assert 0.0 < low < lead.value < high
    assert lead.p_value < 1e-6
    assert np.ptp(scores.interval()[0]) > 5.0 * (high - low)


@pytest.mark.parametrize("runs", [1, 8])
def test_equal_models_lead_by_chance_of_their_runs_alone(runs):
    """Runs of both scatter alike, and so do events: a lead is found in 5 of 100 records, also against a single run."""
    generator, found = np.random.default_rng(11), []
    for _ in range(400):
        maps = [0.5 * generator.normal(size=(count, 1)) + generator.normal(size=(count, 40)) for count in (runs, 10)]
        found.append(scores_of(*maps, cluster=np.arange(40)).lead("0", "1").p_value < 0.05)
    assert 0.01 <= np.mean(found) <= 0.07


def test_one_run_scatters_as_those_of_the_other_model():
    """Without any runs to compare there is no variance of runs; the mean of ten has a tenth of that of one."""
    ten = np.random.default_rng(12).normal(size=10)
    assert run_variance(np.zeros(1)).value == 0.0
    assert run_variance(np.zeros(1), ten).value == pytest.approx(ten.var(ddof=1))
    assert run_variance(ten).value == pytest.approx(0.1 * ten.var(ddof=1))


def test_many_tests_of_equal_maps_keep_their_level():
    """Of five uniform p-values the smallest is below 0.05 in 23 of 100 cases, adjusted in 5."""
    p_values = np.random.default_rng(13).uniform(size=(1000, 5))
    assert np.mean(p_values.min(axis=1) < 0.05) > 0.2
    assert np.mean([adjusted(row).min() < 0.05 for row in p_values]) == pytest.approx(0.05, abs=0.02)
