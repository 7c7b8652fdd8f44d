"""Clusters of a record, found from the record itself."""

import numpy as np
import pytest
import xarray as xr

from catalogs.compare.blocks import cluster_labels, rounded_to
from catalogs.compare.comparison import record_clusters
from catalogs.compare.exposure import Exposure
from catalogs.sources.jackknife import effective_blocks
from verification.answers.statistics.samples import branching_events, burst_events, dated


def clusters_of(events):
    """Labels of a made-up record: times in days, locations (event, 3) m, true clusters."""
    days, location, _ = events
    return cluster_labels(dated(days), location, np.zeros(len(days), int), 1.0)


def test_independent_events_are_blocks_of_their_own():
    """In 18 of 20 records at least; the others, by chance, lose a part."""
    generator = np.random.default_rng(1)
    alone = 0
    for _ in range(20):
        days, location = np.sort(generator.uniform(0, 90, 100)), 30 * generator.normal(size=(100, 3))
        alone += len(np.unique(clusters_of((days, location, None)))) == 100
    assert alone >= 18


def test_bursts_are_found_whatever_days_they_fall_on():
    """Ten bursts of ten within an hour, each in its place, one of them about midnight."""
    generator = np.random.default_rng(2)
    start = np.array([4.999, 11.2, 23.4, 30.1, 39.8, 47.3, 58.2, 66.6, 71.5, 83.9])
    days = np.sort((start[:, None] + generator.uniform(0, 0.04, (10, 10))).ravel())
    burst = np.repeat(np.arange(10), 10)
    location = 100 * generator.normal(size=(10, 3))[burst] + 5 * generator.normal(size=(100, 3))
    labels = clusters_of((days, location, None))
    assert len(np.unique(labels)) == 10
    np.testing.assert_array_equal(labels, burst)


@pytest.mark.parametrize("sizes", [[20, 20], [30, 6, 4], [40, 3]])
def test_few_bursts_are_not_taken_for_independent_events(sizes):
    """Two bursts, or three of which one holds most events, are fewer than an interval needs, and they are found."""
    generator = np.random.default_rng(6)
    burst = np.repeat(np.arange(len(sizes)), sizes)
    days = np.sort(10.0 + 25.0 * burst + generator.uniform(0, 0.04, len(burst)))
    location = 100 * generator.normal(size=(len(sizes), 3))[burst] + 5 * generator.normal(size=(len(burst), 3))
    np.testing.assert_array_equal(clusters_of((days, location, None)), burst)


@pytest.mark.parametrize("branching", [0.5, 0.7])
def test_blocks_of_triggered_events_are_worth_about_what_their_clusters_are(branching):
    """Delays to 40 days, 90 days of record. More than twice as many blocks as clusters are worth would hide the
    variance of the record's mean; days are worth two and more times as many."""
    generator = np.random.default_rng(3)
    worth = []
    for _ in range(8):
        events = branching_events(generator, 90.0, 150, branching)
        found, truth, day = (
            effective_blocks(np.unique(one, return_counts=True)[1])
            for one in (clusters_of(events), events[2], np.floor(events[0]))
        )
        worth.append((found / truth, day / truth))
    found, day = np.median(worth, axis=0)
    assert found < 1.5
    assert found < day


def test_events_without_a_time_are_one_cluster_and_few_events_are_no_error():
    location = np.random.default_rng(4).normal(size=(6, 3))
    time = dated(np.arange(6.0))
    time[:3] = np.datetime64("NaT")
    labels = cluster_labels(time, location, np.zeros(6, int))
    assert len(np.unique(labels[:3])) == 1
    assert labels[0] not in labels[3:]
    for count in range(4):
        assert len(cluster_labels(time[:count], location[:count], np.zeros(count, int))) == count


UNITS = {"exact": 0, "minutes": 60, "ten minutes": 600, "hours": 3600, "days": 86400}


def rounded(days, unit):
    """Times in days, rounded down to whole units, s."""
    return np.floor(days * 86400 / unit) * unit / 86400 if unit else days


@pytest.mark.parametrize("unit", UNITS.values(), ids=UNITS)
def test_independent_events_stay_apart_however_their_times_are_rounded(unit):
    """Events of one hour, or of one day, seemed simultaneous, and were linked at any distance."""
    generator = np.random.default_rng(5)
    days = rounded(np.sort(generator.uniform(0, 30, 1000)), unit)
    labels = clusters_of((days, 100 * generator.normal(size=(1000, 3)), None))
    assert len(np.unique(labels)) > 950
    start = np.array(["2019-12-25"], "datetime64[ns]")
    exposure = Exposure(start, start + np.timedelta64(60, "D"))
    assert exposure.dispersion_index(dated(generator.integers(-7, 53, 1000)), np.arange(1000)) == 1.0


def test_some_dates_without_a_time_among_exact_times_and_local_midnights_are_no_clusters():
    """A third of the events have only a date, of a place with daylight saving from the middle on."""
    generator = np.random.default_rng(6)
    days = np.sort(generator.uniform(0, 30, 1000))
    dates = generator.random(1000) < 1 / 3
    days[dates] = np.floor(days[dates]) + np.where(days[dates] < 15, 16, 15) / 24
    labels = clusters_of((np.sort(days), 100 * generator.normal(size=(1000, 3)), None))
    assert len(np.unique(labels)) > 950


@pytest.mark.parametrize("unit", [0, 60], ids=["exact", "minutes"])
def test_clusters_are_found_in_times_rounded_to_minutes(unit):
    """Effective blocks are fewer than one and a half times those of the true clusters, as with exact times."""
    generator = np.random.default_rng(7)
    worth = []
    for _ in range(8):
        days, location, truth = branching_events(generator, 90.0, 150, 0.6)
        found = clusters_of((rounded(days, unit), location, None))
        sizes = [effective_blocks(np.unique(one, return_counts=True)[1]) for one in (found, truth)]
        worth.append(sizes[0] / sizes[1])
    assert np.median(worth) < 1.5


def test_what_times_are_rounded_to_is_told_from_the_times():
    generator = np.random.default_rng(8)
    days = np.sort(generator.uniform(0, 30, 500))
    for unit in (60, 600, 3600, 86400):
        assert np.median(rounded_to(dated(rounded(days, unit)))) * 86400 == pytest.approx(unit)
    assert np.median(rounded_to(dated(days))) * 86400 < 1
    assert (rounded_to(dated(np.full(5, 3.2))) * 86400 < 1).all()


@pytest.mark.parametrize("unit", UNITS.values(), ids=UNITS)
def test_clusters_do_not_depend_on_the_order_of_the_rows(unit):
    generator = np.random.default_rng(9)
    days, location, _ = branching_events(generator, 30.0, 200, 0.6)
    time, step = dated(rounded(days, unit)), np.zeros(len(days), int)
    labels = cluster_labels(time, location, step, 1.0)
    order = generator.permutation(len(days))
    moved = cluster_labels(time[order], location[order], step, 1.0)
    np.testing.assert_array_equal(moved, labels[order])


def test_pairs_closer_than_any_event_of_the_sample_of_places_are_linked():
    """Of more than a thousand events places are counted among a sample. A pair that is closer than all of it took the
    share of all places, as if it were as far apart as can be."""
    generator = np.random.default_rng(10)
    start, place = generator.uniform(0, 90, 2000), 1000 * generator.normal(size=(2000, 3))
    days = np.concatenate([start, start + 0.02])
    order = np.argsort(days)
    location = np.concatenate([place, place + generator.normal(size=(2000, 3))])
    pair = np.tile(np.arange(2000), 2)[order]
    labels = clusters_of((days[order], location[order], None))
    together = labels[np.argsort(pair, kind="stable")].reshape(2000, 2)
    assert np.mean(together[:, 0] == together[:, 1]) > 0.95


@pytest.mark.parametrize("steps", [[5, 60, 20], [100, 10, 300, 30], [8, 40, 3, 12, 90, 2, 30, 15, 5, 60]])
def test_independent_events_stay_apart_whatever_their_steps_mine(steps):
    """Steps of a month differ in rate and place: in all of them together, events would look clustered. A true
    dispersion index is 1. Of 20 records one may lose a part by chance."""
    generator = np.random.default_rng(11)
    indices = []
    for _ in range(20):
        days, location, step = independent_steps(generator, steps)
        labels = cluster_labels(dated(days), location, step, 10.0)
        indices.append(months(len(steps)).dispersion_index(dated(days), labels))
    assert np.mean(np.array(indices) > 1.0) <= 0.1
    assert np.mean(indices) < 1.1


def test_bursts_in_steps_of_unequal_rates_keep_their_dispersion_index():
    """Bursts of five on average vary by 6. Where they stand close, some are joined; a whole step is not."""
    generator = np.random.default_rng(12)
    indices = []
    for _ in range(8):
        parts = [burst_events(generator, 30.0, count, 5.0, spread=100.0) for count in (4, 20, 8)]
        days, location, step = joined([(days, location) for days, location, _ in parts])
        labels = cluster_labels(dated(days), location, step, 1.0)
        indices.append(months(3).dispersion_index(dated(days), labels))
    assert 4.5 < np.median(indices) < 9.0


def test_a_sequence_goes_on_in_the_next_step():
    """A burst about the end of a step is one cluster."""
    generator = np.random.default_rng(13)
    start = np.array([4.0, 11.2, 23.4, 29.98, 39.8, 47.3, 56.2])
    days = np.sort((start[:, None] + np.linspace(0.0, 0.04, 10)).ravel())
    burst = np.repeat(np.arange(7), 10)
    location = 100 * generator.normal(size=(7, 3))[burst] + 5 * generator.normal(size=(70, 3))
    np.testing.assert_array_equal(cluster_labels(dated(days), location, (days // 30).astype(int), 1.0), burst)


def test_events_of_all_sizes_show_which_of_the_large_ones_belong_together():
    """Triggered events, of which the cut leaves a third. Those alone make more than twice as many clusters."""
    generator = np.random.default_rng(3)
    days, location, _ = branching_events(generator, 60.0, 300, 0.7)
    size, step = generator.exponential(1.0, len(days)), (days // 30).astype(int)
    record = xr.Dataset(
        {"time": ("event", dated(days)), "location": (("event", "xyz"), location)}, attrs={"location_error": 5.0}
    )
    large = size > np.quantile(size, 2 / 3)
    found = record_clusters(record, np.ones(len(days), bool), step)
    alone = record_clusters(record, large, step)
    assert (alone[~large] == -1).all()
    worth = [effective_blocks(np.unique(one[large], return_counts=True)[1]) for one in (found, alone)]
    assert worth[1] > 2.0 * worth[0]


def independent_steps(generator, numbers):
    """Events of months with these numbers expected, each 60 m from the last: as `joined`."""
    counts = generator.poisson(numbers)
    return joined([(np.sort(generator.uniform(0, 30, n)), 30 * generator.normal(size=(n, 3))) for n in counts])


def joined(parts):
    """Times in days, locations (event, 3) m and month (event,) of events given month by month, each 60 m on."""
    step = np.repeat(np.arange(len(parts)), [len(days) for days, _ in parts])
    days = np.concatenate([days for days, _ in parts]) + 30.0 * step
    return days, np.concatenate([location for _, location in parts]) + 60.0 * step[:, None], step


def months(count):
    """Exposure to so many months of 30 days."""
    start = dated(30.0 * np.arange(count))
    return Exposure(start, start + np.timedelta64(30, "D"))
