"""Declustered numbers of simulated records of known truth: background alone, and with aftershocks."""

import numpy as np
import pytest

from catalogs.sources.declustering import decluster, nearest_proximity

START = np.datetime64("2019-01-01", "ns")


def record(generator, background: int, clusters: int, size: int):
    """Events at random in a cubic kilometre and a year, and `size` more within an hour and 20 m of some of them."""
    days = np.sort(generator.uniform(0, 365, background))
    place = generator.uniform(0, 1000, (background, 3))
    magnitude = -1 - np.log10(generator.random(background))
    parents = generator.choice(background, clusters, replace=False)
    magnitude[parents] += 1.0
    lag = 10 ** generator.uniform(-4, -1.5, (clusters, size))  # days
    days = np.concatenate([days, (days[parents, None] + lag).ravel()])
    near = place[parents, None] + generator.normal(0, 10, (clusters, size, 3))
    place = np.concatenate([place, near.reshape(-1, 3)])
    magnitude = np.concatenate([magnitude, -1 - np.log10(generator.random(clusters * size))])
    truth = np.arange(len(days)) < background
    return START + (days * 86400e9).astype("timedelta64[ns]"), place, magnitude, truth


@pytest.mark.parametrize("seed", range(3))
def test_clusters_are_found(seed):
    """600 independent events and 40 clusters of 12: the number to 5 %, and nearly every event rightly."""
    time, place, magnitude, truth = record(np.random.default_rng(seed), 600, 40, 12)
    found = decluster(time, place, magnitude)
    assert found.count == 1080
    assert found.declustered == pytest.approx(600, rel=0.05)
    assert np.mean(found.independent == truth) > 0.97


@pytest.mark.parametrize("seed", range(3))
def test_events_that_know_nothing_of_each_other_stay(seed):
    """Without clusters at most one in twenty is taken for an aftershock."""
    time, place, magnitude, _ = record(np.random.default_rng(seed), 800, 1, 0)
    assert decluster(time, place, magnitude).declustered >= 0.95 * 800


def test_the_order_and_the_place_of_events_do_not_count():
    time, place, magnitude, _ = record(np.random.default_rng(4), 300, 20, 10)
    order = np.random.default_rng(5).permutation(len(time))
    one, two = decluster(time, place, magnitude), decluster(time[order], place[order] + 5e6, magnitude[order])
    np.testing.assert_array_equal(one.independent[order], two.independent)


def test_proximity_is_that_of_the_slow_twin():
    generator = np.random.default_rng(6)
    time, place, magnitude = np.sort(generator.random(30)), generator.random((30, 3)), generator.normal(size=30)
    found = nearest_proximity(time, place, magnitude)
    for later in range(1, 30):
        eta = [
            (time[later] - time[i]) * np.linalg.norm(place[later] - place[i]) ** 1.6 * 10 ** -magnitude[i]
            for i in range(later)
        ]
        assert found[later] == pytest.approx(np.log10(min(eta)))
    assert found[0] == np.inf


@pytest.mark.parametrize("count", [0, 1, 49])
def test_few_events_are_all_kept(count):
    time, place, magnitude, _ = record(np.random.default_rng(7), 60, 1, 0)
    found = decluster(time[:count], place[:count], magnitude[:count])
    assert (found.count, found.declustered) == (count, count)
    assert np.isnan(found.limit)


def test_events_without_time_place_or_size_are_left_out():
    time, place, magnitude, _ = record(np.random.default_rng(8), 200, 1, 0)
    time[3], place[5, 0], magnitude[7] = np.datetime64("NaT"), np.nan, np.nan
    found = decluster(time, place, magnitude)
    assert found.count == 197
    assert not found.independent[[3, 5, 7]].any()
