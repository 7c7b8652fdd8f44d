import tracemalloc

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from catalogs.compare.locations import compare_locations, smear
from catalogs.sources.significance import TEST_LEVEL
from verification.answers.statistics.samples import clustered_locations

QUICK = {"resamplings": 199, "distances": np.array([20.0, 40.0])}


def rejections(make, repeats):
    """Share of catalogue pairs with p <= 0.05."""
    return np.mean([compare_locations(*make(), seed=index, **QUICK).energy_p_value <= 0.05 for index in range(repeats)])


@pytest.mark.parametrize(
    ("first", "second"),
    [((20, [10]), (20, [10])), ((20, [30]), (60, [5])), ((6, [25]), (30, [8])), ((30, [1, 4, 40]), (40, [1, 4, 40]))],
    ids=["alike", "unequal blocks", "few blocks", "heavy-tailed blocks"],
)
def test_false_alarms_on_clustered_catalogues_of_one_process(first, second):
    """Nominal 5 %; 200 pairs have a standard error of 1.5 %. Resampling events would reject most of these."""
    generator = np.random.default_rng(1)

    def make():
        x, x_blocks = clustered_locations(generator, *first)
        y, y_blocks = clustered_locations(generator, *second)
        return x, y, x_blocks, y_blocks

    assert 0.005 <= rejections(make, 200) <= 0.095


def test_taking_events_for_independent_would_reject_what_is_one_process():
    generator = np.random.default_rng(2)

    def make():
        x, y = clustered_locations(generator, 20, [10])[0], clustered_locations(generator, 20, [10])[0]
        return x, y, np.arange(len(x)), np.arange(len(y))

    assert rejections(make, 40) > 0.5


def test_a_shift_of_10_m_is_found_with_power_0_8():
    """200 events spread 30 m in each catalogue, 60 days. The best test there is finds 80.4 %; 200 pairs: +-8.5 %."""
    generator = np.random.default_rng(3)
    days = np.arange(200) * 60 // 200
    shift = np.array([10.0, 0, 0])

    def make():
        x, y = 30 * generator.normal(size=(2, 200, 3))
        return x, y + shift, days, days

    assert rejections(make, 200) >= 0.715


@pytest.mark.parametrize("apart", [0.0, 500.0])
def test_a_shift_is_found_however_far_steps_lie_apart(apart):
    """Three steps of 50 events spread 15 m, one catalogue moved 6 m: 80 % are found; all events together, 500 m apart,
    would find none. Offset and energy distance are those within steps, to round-off whatever the distance."""
    generator = np.random.default_rng(11)
    steps, days = np.repeat([0, 1, 2], 50), np.arange(150) // 2
    centre, shift = apart * np.eye(3)[steps], np.array([6.0, 0, 0])
    found = []
    for index in range(40):
        x, y = 15 * generator.normal(size=(2, 150, 3))
        chosen = {"model_steps": steps, "record_steps": steps, "seed": index}
        one = compare_locations(x + centre, y + centre + shift, days, days, **chosen, **QUICK)
        near = compare_locations(x, y + shift, days, days, **chosen, **QUICK)
        assert one.energy_distance == pytest.approx(near.energy_distance, abs=1e-9)
        np.testing.assert_allclose(one.offset, near.offset, atol=1e-9)
        found.append(one.energy_p_value <= 0.05)
    assert np.mean(found) >= 0.6


def test_steps_that_one_catalogue_lacks_do_not_count():
    """Its offset is that of the step both have, weighed alike; without a common step nothing is compared."""
    generator = np.random.default_rng(12)
    x, y = generator.normal(size=(2, 40, 3))
    steps, blocks = np.repeat([0, 1], 20), np.arange(40)
    found = compare_locations(x, y, blocks, blocks, model_steps=steps, record_steps=steps + 1, **QUICK)
    np.testing.assert_allclose(found.offset, x[20:].mean(axis=0) - y[:20].mean(axis=0))
    assert found.steps == 1
    assert compare_locations(x, y, blocks, blocks, model_steps=steps, record_steps=steps + 2, **QUICK) is None


def test_energy_distance_and_cross_k_as_the_slow_sums_say():
    """Blocks of one event: the estimates are plain means over all pairs of different events."""
    generator = np.random.default_rng(4)
    x, y = generator.normal(size=(25, 3)), generator.normal(size=(40, 3)) + 1
    found = compare_locations(x, y, np.arange(25), np.arange(40), resamplings=20, distances=np.array([1.0, 2.0]))
    inside_x, inside_y = cdist(x, x)[np.triu_indices(25, 1)], cdist(y, y)[np.triu_indices(40, 1)]
    assert found.energy_distance == pytest.approx(2 * cdist(x, y).mean() - inside_x.mean() - inside_y.mean())
    volume = np.prod(np.ptp(np.concatenate([x, y]), axis=0))
    np.testing.assert_allclose(found.cross_k / volume, [(cdist(x, y) < r).mean() for r in (1, 2)])
    np.testing.assert_allclose(found.record_k / volume, [(inside_y < r).mean() for r in (1, 2)])
    assert found.nearest[0] == pytest.approx(np.median(cdist(x, y).min(axis=1)))
    np.testing.assert_allclose(found.offset, x.mean(axis=0) - y.mean(axis=0))


def test_pairs_within_a_block_do_not_count_within_a_catalogue():
    """Three tight clusters 100 m apart, one block each: within a catalogue only the 100 m between them are left."""
    corner = np.array([[0.0, 0, 0], [100.0, 0, 0], [50.0, np.sqrt(7500.0), 0]])
    x = np.repeat(corner, 5, axis=0) + np.random.default_rng(5).normal(size=(15, 3)) * 1e-6
    blocks = np.repeat([0, 1, 2], 5)
    found = compare_locations(x, x, blocks, blocks, resamplings=20, distances=np.array([50.0, 150.0]))
    assert found.energy_distance == pytest.approx(2 * 200 / 3 - 100 - 100, abs=1e-4)
    np.testing.assert_allclose(found.record_k[0], 0.0)


def test_intervals_hold_what_was_put_in():
    """A shift of (30, 0, -20) m: the centroid's interval holds it, energy distance is far from chance."""
    generator = np.random.default_rng(8)
    x, y = 30 * generator.normal(size=(2, 300, 3))
    days = np.arange(300) // 5
    shift = np.array([30.0, 0, -20])
    found = compare_locations(x + shift, y, days, days, seed=1)
    assert np.all(found.offset_interval[:, 0] <= shift)
    assert np.all(found.offset_interval[:, 1] >= shift)
    assert found.energy_interval[0] > found.energy_null[1]
    assert found.energy_p_value == pytest.approx(0.001)
    assert found.cross_ratio[0] < 1
    again = compare_locations(x + shift, y, days, days, seed=1)
    assert again.energy_interval.tobytes() == found.energy_interval.tobytes()


def test_a_record_of_fewer_than_three_blocks_says_nothing():
    x = np.random.default_rng(6).normal(size=(10, 3))
    for blocks, compared in ((1, False), (2, False), (3, True)):
        found = compare_locations(x, x, np.arange(10), np.arange(10) % blocks, **QUICK)
        assert (found is not None) == compared


@pytest.mark.parametrize("blocks", [None, np.arange(10) % 2])
def test_a_model_of_fewer_than_three_runs_is_tested_as_if_clustered_as_the_record(blocks):
    """Offset and p-value are known, other intervals with a run more."""
    x = np.random.default_rng(6).normal(size=(10, 3))
    found = compare_locations(x, x, blocks, np.arange(10), **QUICK)
    assert np.isfinite([found.energy_distance, found.offset_distance]).all()
    assert np.isfinite([found.energy_p_value, *found.offset_distance_interval]).all()
    assert np.isnan([*found.energy_interval, *np.ravel(found.nearest_interval)]).all()
    assert found.blocks == (0 if blocks is None else 2, 10)
    again = compare_locations(x, x, np.arange(10) % 3, np.arange(10), **QUICK)
    assert np.isfinite([again.energy_p_value, *again.offset_distance_interval, *again.energy_interval]).all()


@pytest.mark.parametrize(("count", "each"), [(60, 1), (12, 5)])
def test_a_model_that_ran_once_is_told_apart_as_seldom_as_chance_allows(count, each):
    """Forty pairs of one process, of independent events and of clusters of five. Shifted by what is said to be noticed,
    most are told apart."""
    generator = np.random.default_rng(3)

    def draw(shift=0.0):
        centre = 30.0 * generator.normal(size=(count, 3))
        return np.repeat(centre, each, axis=0) + 5.0 * generator.normal(size=(count * each, 3)) + [shift, 0.0, 0.0]

    blocks, same, shifted = np.repeat(np.arange(count), each), [], []
    for index in range(40):
        found = compare_locations(draw(), draw(), None, blocks, **QUICK | {"seed": index})
        same.append(found.energy_p_value <= TEST_LEVEL)
        found = compare_locations(draw(found.shift_noticed), draw(), None, blocks, **QUICK | {"seed": index})
        shifted.append(found.energy_p_value <= TEST_LEVEL)
    assert np.mean(same) <= 0.075
    assert np.mean(shifted) > 0.6


@pytest.mark.parametrize("runs", [None, 3])
def test_memory_is_that_of_a_few_matrices_of_blocks_however_many_distances(runs):
    """Twelve distances, each recorded event a block of its own. Their matrices all at once are twelve of them."""
    count = 800
    x, y = np.random.default_rng(8).normal(size=(2, count, 3))
    model_blocks = None if runs is None else np.arange(count) % runs
    blocks = count + (count if runs is None else runs)
    matrix = 8 * blocks**2
    tracemalloc.start()
    compare_locations(x, y, model_blocks, np.arange(count), resamplings=9)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 8 * matrix


def test_smeared_locations_lie_the_location_error_away():
    generator = np.random.default_rng(7)
    x = np.zeros((3000, 3))
    smeared, event = smear(x, 10.0, 4, generator)
    assert np.sqrt(np.mean(np.sum(smeared**2, axis=1))) == pytest.approx(10.0, rel=0.03)
    assert np.bincount(event).tolist() == [4] * 3000
    assert smear(x, 0.0, 4, generator)[0] is x


def test_each_copy_takes_the_error_of_a_recorded_event():
    """Of 10 m and 100 m, one in two: r.m.s. of 71 m, and half of the copies within 17 m, where one error has 68 m."""
    x = np.zeros((3000, 3))
    away = np.linalg.norm(smear(x, np.array([10.0, 100.0]), 4, np.random.default_rng(9))[0], axis=1)
    assert np.sqrt(np.mean(away**2)) == pytest.approx(np.sqrt((10**2 + 100**2) / 2), rel=0.05)
    assert 0.45 < np.mean(away < 17.0) < 0.56
