"""Outputs of a record: what chance does to them, clusters, and what is refused."""

import numpy as np
import pytest
import xarray as xr

from calibration.recorded import (
    as_of,
    check_record,
    clustered_numbers,
    complete_above,
    covered,
    mean_excess,
    read_record,
    size_dispersion,
    size_errors,
    slope,
)
from catalogs.compare.exposure import Exposure
from catalogs.settings import DatedStep
from common.errors import InputError

STEPS = tuple(
    DatedStep(name=name, start=start, end=end)
    for name, start, end in (("one", "2019-08-01", "2019-09-01"), ("two", "2019-09-01", "2019-10-01"))
)
EXPOSURE = Exposure.of(STEPS, None)


def record(days, sizes, location=None):
    """Recorded events at days of 2019-08 and later; without locations far apart, so that none belong together."""
    time = np.datetime64("2019-08-01", "ns") + (np.array(days) * 86400e9).astype("timedelta64[ns]")
    count = len(sizes)
    location = np.random.default_rng(9).uniform(0, 1e4, (count, 3)) if location is None else location
    return xr.Dataset(
        {
            "time": ("event", time),
            "potency": ("event", np.array(sizes, float)),
            "location": (("event", "xyz"), location),
            "resolved": ("event", np.ones(count, np.int8)),
        },
        attrs={"location_error": 1.0},
    )


def power_law(generator, count, b=0.67):
    """Sizes above 1 m3."""
    return 10.0 ** generator.exponential(1 / (b * np.log(10)), count)


def test_record_of_equal_and_of_unequal_sizes():
    """Equal events: the sum varies as their number alone, which is 1 / number. Where one event rules, it varies more.
    The law of sizes of the model counts where it varies more than the record."""
    generator = np.random.default_rng(3)
    days = np.concatenate([generator.uniform(0, 31, 100), generator.uniform(31, 61, 100)])
    equal = read_record(record(days, [0.1] * 200), EXPOSURE, -2.0, seed=1)
    np.testing.assert_allclose(np.exp(equal.log_potency), 10.0)
    np.testing.assert_array_equal(equal.number, 100)
    np.testing.assert_allclose(np.diag(equal.potency_covariance) / equal.dispersion_index, 0.01, rtol=1e-6)
    ruled = read_record(record(days, [10.0, *[0.1] * 199]), EXPOSURE, -2.0, seed=1)
    assert ruled.potency_covariance[0, 0] > 5.0 * equal.potency_covariance[0, 0]
    heavy = read_record(record(days, [0.1] * 200), EXPOSURE, -2.0, 1, np.log10(power_law(generator, 5000)))
    assert heavy.potency_covariance[0, 0] > 5.0 * equal.potency_covariance[0, 0]


def test_errors_of_sizes_are_those_of_so_many_events():
    """ln of the mean of n events varies by (s / mean)^2 / n; ln of the mean excess by 1 / n of a power law."""
    generator = np.random.default_rng(5)
    pool = generator.exponential(0.1, 20000)
    errors = size_errors(pool, np.array([100, 400]), generator)
    expected = (10.0**pool).var() / (10.0**pool).mean() ** 2
    np.testing.assert_allclose(errors.var(axis=0)[:2], expected / np.array([100, 400]), rtol=0.2)
    excess = size_errors(generator.exponential(1.0, 20000), np.array([100, 400]), generator)[:, -1]
    np.testing.assert_allclose(excess.var(), 1 / 500, rtol=0.15)
    assert np.corrcoef(errors.T)[0, 2] > 0.2  # potency and sizes of the same events


def test_clusters_are_found_within_a_step_and_raise_every_error():
    """Two steps whose rates and places differ: independent events stay so. Bursts of ten raise the dispersion index;
    events of one size in each burst raise the error of the sizes by as much."""
    generator = np.random.default_rng(7)
    days = np.concatenate([generator.uniform(0, 31, 400), generator.uniform(31, 61, 60)])
    places = np.concatenate([generator.normal(0, 20, (400, 3)), generator.normal(0, 20, (60, 3)) + 100.0])
    sizes = power_law(generator, 460)
    assert read_record(record(days, sizes, places), EXPOSURE, 0.0, 1).dispersion_index < 1.5
    burst = np.repeat(np.arange(40), 10)
    centre, day, size = generator.normal(0, 200, (40, 3)), generator.uniform(0, 61, 40), power_law(generator, 40)
    together = record(day[burst] + 0.01 * generator.random(400), size[burst], centre[burst])
    found = read_record(together, EXPOSURE, 0.0, 1)
    assert 7.0 < found.dispersion_index < 20.0
    assert size_dispersion(np.log10(size[burst]), burst) == pytest.approx(10.0)
    single = read_record(together, EXPOSURE, 0.0, 1).size_covariance[-1, -1]
    assert single > 5.0 / 400
    counted = read_record(together, EXPOSURE, np.log10(np.quantile(size, 0.75)), 1)
    assert counted.dispersion_index < found.dispersion_index


def test_numbers_drawn_by_clusters_vary_by_their_dispersion_index():
    """Means as asked for; variance over mean as asked for, and as the clusters show."""
    generator = np.random.default_rng(2)
    drawn = [clustered_numbers(np.array([20.0, 60.0]), 5.0, generator) for _ in range(3000)]
    numbers = np.array([one for one, _ in drawn])
    np.testing.assert_allclose(numbers.mean(axis=0), [20.0, 60.0], rtol=0.04)
    np.testing.assert_allclose(numbers.var(axis=0) / numbers.mean(axis=0), 5.0, rtol=0.12)
    np.testing.assert_allclose(np.average([index for _, index in drawn], weights=numbers.sum(axis=1)), 5.0, rtol=0.1)
    independent = [clustered_numbers(np.array([20.0]), 1.0, generator) for _ in range(2000)]
    np.testing.assert_allclose(np.var([number[0] for number, _ in independent]), 20.0, rtol=0.15)
    assert {index for _, index in independent} == {1.0}


def test_completeness_is_estimated_or_asked_for():
    """Of many events that fade out it is estimated, above where they do; of few it is asked for, in one line that names
    the key. What is given counts."""
    generator = np.random.default_rng(4)
    x = generator.exponential(1 / (0.8 * np.log(10)), 20000) - 2.0
    seen = x[generator.random(len(x)) < 1.0 / (1.0 + np.exp(-8.0 * x))]
    estimated = complete_above(record(np.linspace(0, 60, len(seen)), 10.0**seen), None)
    assert 0.0 < estimated < 1.2
    few = record([1.0, 2.0], [1.0, 3.0])
    with pytest.raises(
        InputError, match=r"^calibration.complete_above: missing; the record \(2 events\) .* m\^3"
    ) as refused:
        complete_above(few, None)
    assert "\n" not in str(refused.value)
    assert complete_above(few, 0.1) == pytest.approx(-1.0)


def test_a_step_without_recorded_events_is_refused():
    """In one line that says what to do, and what it says helps."""
    few = record([1.0, 2.0], [1.0, 1.0])
    with pytest.raises(InputError, match=r"no potency in step two.*leave potency out"):
        check_record(few, STEPS, EXPOSURE, ("potency",))
    check_record(few, STEPS, EXPOSURE, ("number",))
    read = read_record(few, EXPOSURE, -2.0, seed=1)
    np.testing.assert_array_equal(read.number, [2, 0])


def test_steps_count_for_the_time_that_the_record_covers():
    """A record that begins in mid-August covers half of that step; a step before it is refused."""
    exposure = Exposure.of(STEPS, ("2019-08-16T12:00:00", "2019-10-01"))
    np.testing.assert_allclose(covered(exposure, STEPS), [0.5, 1.0])
    with pytest.raises(InputError, match="covers nothing of step one"):
        covered(Exposure.of(STEPS, ("2019-09-02", "2019-10-01")), STEPS)


@pytest.mark.parametrize(("count", "other"), [(200, 3), (200, 30), (3, 2), (30, 30)])
def test_a_mean_size_is_that_of_another_number_of_events(count, other):
    """Beside few events the one more counts for more: what they show on average is not what many do."""
    generator = np.random.default_rng(8)
    of_count = mean_excess(np.full(count, 0.36))
    of_other = [mean_excess(generator.exponential(0.36, other)) for _ in range(4000)]
    shown = np.log(np.mean(np.exp(of_other)))
    assert as_of(np.array(of_count), np.array(float(count)), other) == pytest.approx(shown, abs=0.01)
    assert slope(of_count, count) == pytest.approx(1.0 / (0.36 * np.log(10.0)))
    assert slope(-2.0, 1) == np.inf  # nothing but the one more


def test_a_run_without_events_has_a_mean_size_too():
    assert as_of(0.0, 0.0, 0.0) == pytest.approx(0.0)
    assert as_of(0.0, 0.4, 0.4) == pytest.approx(0.0)
    assert as_of(-0.5, 20.0, 0.0) == pytest.approx(0.0)  # of no event nothing is known
