"""The time that both catalogues share, and rates in it."""

import json

import numpy as np
import pytest
from catalog_fixtures import made_up_catalog

from catalogs.compare.comparison import compare
from catalogs.compare.exposure import Exposure, Total, total_interval, total_ratio
from catalogs.records.times import recorded_period
from catalogs.settings import DatedStep
from verification.answers.statistics.samples import simulated_sizes

STEPS = (
    DatedStep(name="a", start="2019-08-01", end="2019-09-01"),
    DatedStep(name="b", start="2019-09-11", end="2019-10-01"),
)


def days(*offsets) -> np.ndarray:
    return np.datetime64("2019-08-01", "ns") + np.array([round(one * 86400e9) for one in offsets], "m8[ns]")


def test_steps_are_cut_to_the_common_period_and_gaps_do_not_count():
    assert Exposure.of(STEPS, None).days == 31 + 20
    cut = Exposure.of(STEPS, ("2019-08-21T00:00:00", "2019-09-12T12:00:00"))
    assert cut.days == 11 + 1.5
    assert cut.step(days(0, 20, 35, 42, 43)).tolist() == [-1, 0, -1, 1, -1]
    assert np.isnan(Exposure.of((), None).days)
    assert Exposure.of((), None).step(days(0, 300)).tolist() == [0, 0]


def test_days_without_events_count():
    first, second = Exposure.of(STEPS, None).counts(days(0.5, 0.7, 20.5, 35, 50.9))
    assert (len(first), len(second)) == (31, 20)
    assert {index: value for index, value in enumerate(first) if value} == {0: 2, 20: 1}
    assert {index: value for index, value in enumerate(second) if value} == {9: 1}


def test_a_record_begins_with_its_first_event_only_where_the_silence_before_is_no_chance():
    """An event every other day: a fortnight of silence is likely enough, a month is not."""
    begun, ended = recorded_period(days(*range(0, 40, 2)))
    assert begun == np.datetime64("2019-08-01") - np.timedelta64(14, "D")
    assert ended == np.datetime64("2019-09-09") + np.timedelta64(14, "D")
    assert recorded_period(days(3))[0] < np.datetime64("1700-01-01")


@pytest.mark.parametrize(
    ("count", "lower", "upper"), [(0, 0.0, 3.689), (1, 0.0253, 5.572), (9, 4.115, 17.085), (100, 81.36, 121.63)]
)
def test_few_events_have_the_exact_limits_of_poisson(count, lower, upper):
    """Garwood 1936, as in any table."""
    np.testing.assert_allclose(total_interval(np.ones(count), largest=1.0), [lower, upper], rtol=1e-3)


def test_one_large_event_among_small_ones_bounds_a_sum_as_one_event_does():
    """One of 5 and nine of 0.01: the interval reached from 0 to 1e40. A single event is expected 0.025 to 5.6 times."""
    low, high = total_interval(np.array([0.01] * 9 + [5.0] + [0.0] * 82))
    assert 5 * 0.025 < low < 5 * 0.05
    assert 5 * 5.0 < high < 5 * 5.6
    assert np.isnan(total_interval(np.empty(0))).all()


def sizes(generator, count: int, b: float, span: float) -> np.ndarray:
    return 10.0 ** simulated_sizes(generator, count, b, span)


@pytest.mark.parametrize("span", [2.0, np.inf])
@pytest.mark.parametrize("count", [10, 137])
def test_the_interval_of_a_sum_holds_what_events_up_to_the_largest_make(span, count):
    """b 0.67 with an end two decades up and without one, 600 records: 0.93 less three standard errors, 0.027. With no
    end the upper limit was above 100 times the estimate in half of the records."""
    generator = np.random.default_rng(1)
    rate, held, widest = 0.67 * np.log(10), [], 0.0
    for _ in range(600):
        potency = sizes(generator, max(generator.poisson(count), 1), 0.67, span)
        end = np.log10(potency.max())
        expected = count * rate / (np.log(10) - rate) * (10 ** (0.33 * end) - 1) / -np.expm1(-rate * span)
        low, high = total_interval(potency)
        held.append(low <= expected <= high)
        widest = max(widest, high / potency.sum())
    assert np.mean(held) >= 0.93 - 0.027
    assert widest < 5.6


@pytest.mark.parametrize(
    ("first", "second", "b", "span"), [(40, 80, 0.67, 2.0), (300, 20, 0.67, 2.0), (9, 12, 1.0, 3.0)]
)
def test_ratios_hold_the_ratio_of_expectations(first, second, b, span):
    """Of numbers and of potency, through compare, 200 pairs of catalogues of one law: 0.93 and three standard errors of
    0.0154. It left out the model's chance and held the ratio in 72 to 88 of 100."""
    generator = np.random.default_rng(3)
    held = []
    for _ in range(200):
        both = [generator.poisson(count) + 1 for count in (first, second)]
        potency = [sizes(generator, count, b, span) for count in both]
        scale = sum(np.sum(part**2) for part in potency) / sum(part.sum() for part in potency)
        own = [max(scale, np.sum(part**2) / part.sum()) for part in potency]
        ratios = [
            total_ratio(*(Total(float(count), 1.0) for count in both)),
            total_ratio(*(Total(part.sum(), one) for part, one in zip(potency, own, strict=True))),
        ]
        truth = (first + 1) / (second + 1)
        held.append([one.interval[0] <= truth <= one.interval[1] for one in ratios])
        for one in ratios:
            assert (one.p_value < 0.05) == (not one.interval[0] <= 1.0 <= one.interval[1])
    assert (np.mean(held, axis=0) >= 0.93 - 0.046).all()


def test_a_ratio_to_no_event_is_open_above():
    ratio = total_ratio(Total(20.0, 1.0), Total(0.0, 1.0))
    assert np.isnan(ratio.value)
    assert ratio.interval[0] > 4
    assert np.isinf(ratio.interval[1])
    assert ratio.p_value < 1e-4
    assert np.isnan(total_ratio(Total(0.0, 1.0), Total(0.0, 1.0)).p_value)


def test_clusters_widen_the_interval_and_independent_events_hardly_ever():
    """Bursts of ten on 90 days: the variance of their number is ten times its mean. Of 200 independent records at most
    7 % (and three standard errors, 4.6) are taken for clustered."""
    generator = np.random.default_rng(4)
    exposure = Exposure.of((DatedStep(name="a", start="2019-08-01", end="2019-10-30"),), None)
    apart = np.arange(200)  # from their times alone: no two events are of one cluster
    bursts = [exposure.dispersion_index(days(*np.repeat(generator.uniform(0, 90, 20), 10)), apart) for _ in range(100)]
    assert 8 < np.mean(bursts) < 14
    single = [exposure.dispersion_index(days(*generator.uniform(0, 90, 40)), apart[:40]) for _ in range(200)]
    assert np.mean(np.array(single) > 1) <= 0.07 + 0.046
    low, high = total_interval(np.ones(200), 10.0, 1.0)
    np.testing.assert_allclose([low, high], 10 * total_interval(np.ones(20), largest=1.0))


def test_clusters_count_where_the_time_is_too_short_for_windows_and_only_inside_it():
    """Four bursts of five events in six days leave too few windows. Their clusters say five, without those outside."""
    exposure = Exposure.of((DatedStep(name="a", start="2019-08-01", end="2019-08-07"),), None)
    times, clusters = days(*np.repeat([0.5, 2.1, 3.7, 5.2, 40.0], 5)), np.repeat([0, 1, 2, 3, 4], 5)
    assert exposure.dispersion_index(times, np.arange(25)) == 1.0
    assert exposure.dispersion_index(times, clusters) == 5.0
    clusters[20:] = 3
    assert exposure.dispersion_index(times, clusters) == 5.0


def test_both_catalogues_are_cut_to_the_time_they_share_and_the_head_says_so():
    """A record of August alone beside a model of August and September: counts, rates and words are of August."""
    catalog = made_up_catalog(400)
    record = made_up_catalog(400, seed=2)
    record = record.isel(event=np.flatnonzero(record["time"].values < np.datetime64("2019-09-01")))
    august = ["2019-08-01T00:00:00", "2019-09-01T00:00:00"]
    period = {"modelled": [august[0], "2019-09-30T00:00:00"], "recorded": [august[0], "2019-08-31T23:00:00"]}
    record.attrs |= {"kind": "recorded", "period": json.dumps(period | {"common": august})}
    steps = [dict(name="a", start="2019-08-01", end="2019-09-01"), dict(name="b", start="2019-09-01", end="2019-09-30")]
    result = compare(catalog, record, {"resamplings": 99, "steps": steps})
    here = (catalog["time"].values < np.datetime64("2019-09-01")) & (result["model_used"].values == 1)
    assert result["events_above_cut"][0] == here.sum() == result["model_used"].sum()
    assert result["exposure"] == 31.0
    np.testing.assert_allclose(result["event_rate"] * 31, result["events_above_cut"])
    assert result.attrs["period_text"].startswith("only 2019-08-01 to 2019-09-01, 31 days")
    low, high = result["potency_rate_interval"].values
    assert low < float(result["potency_rate"][1]) < high
    low, high = result["potency_ratio_interval"].values
    assert low < float(result["potency_ratio"]) < high


def test_the_order_of_modelled_events_within_a_step_says_nothing():
    """It is no time: shuffled within a step it moves no number."""
    catalog, record = made_up_catalog(200), made_up_catalog(200, seed=2)
    record.attrs |= {"kind": "recorded"}
    steps = [{"name": "a", "start": "2019-08-01", "end": "2019-10-01"}]
    shuffled = catalog.copy(deep=True)
    shuffled["time"][:] = np.random.default_rng(0).permutation(catalog["time"].values)
    one, other = (compare(each, record, {"resamplings": 99, "steps": steps}) for each in (catalog, shuffled))
    for name in ("mean_cone", "mean_angle_interval", "energy_distance_interval", "potency_ratio_interval"):
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


@pytest.mark.parametrize("turn", [0.0, 20.0])
def test_the_interval_of_an_angle_reaches_0_if_the_axes_may_be_one(turn):
    catalog, record = made_up_catalog(150), made_up_catalog(150, seed=3)
    angle = np.radians(turn)
    matrix = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    record["potency_tensor"][:] = matrix @ record["potency_tensor"].values @ matrix.T
    record.attrs |= {"kind": "recorded"}
    members = [made_up_catalog(150, seed=seed) for seed in (4, 5)]
    result = compare(catalog, record, {"resamplings": 199, "members": 2}, members).sel(axis_name="P")
    low, high = result["mean_angle_interval"].values
    assert low <= turn <= high
    assert (low == 0.0) == (turn == 0.0)
    assert (result["mean_angle_p_value"] < 0.05) == (turn > 0)


def test_two_events_sixty_years_apart_leave_all_of_time_open():
    """Silence of centuries on either side, which nanoseconds cannot tell: it came round at the other end of time."""
    first, last = recorded_period(np.array(["1960-01-01", "2019-08-01"], "datetime64[ns]"))
    assert first <= np.datetime64("1700-01-01") < np.datetime64("2200-01-01") <= last


def test_dates_with_a_zone_are_those_of_utc():
    steps = (DatedStep(name="a", start="2019-08-01T00:00:00Z", end="2019-08-02 12:00"),)
    assert Exposure.of(steps, None).days == 1.5
    assert np.isnan(Exposure.of((), None).days)


def test_rates_of_the_steps_are_no_clustering():
    """Independent events of months with 5, 60 and 20 of them. The variance over the mean is that of the month with most
    events, and has fewer degrees of freedom than windows of equal rates: at most 7 % (and three standard errors) of the
    records are taken for clustered."""
    generator = np.random.default_rng(5)
    steps = tuple(DatedStep(name=f"{month}", start=f"2019-0{month}-01", end=f"2019-0{month}-28") for month in (7, 8, 9))
    exposure, found = Exposure.of(steps, None), []
    for _ in range(300):
        times = [
            one.start + generator.integers(0, 27 * 86400, generator.poisson(expected)).astype("timedelta64[s]")
            for one, expected in zip(windows_of(exposure), (5, 60, 20), strict=True)
        ]
        time = np.concatenate(times)
        found.append(exposure.dispersion_index(time, np.arange(len(time))))
    assert np.mean(np.array(found) > 1.0) <= 0.07 + 0.038


def windows_of(exposure):
    """The steps of an exposure, each by itself."""
    return [Exposure(start, end) for start, end in zip(exposure.start, exposure.end, strict=True)]


def test_events_left_out_at_random_take_clustering_with_them():
    """Of clusters of five half the events count: the index less 1 is half as large."""
    exposure = Exposure.of((DatedStep(name="a", start="2019-08-01", end="2019-08-07"),), None)
    times, clusters = days(*np.repeat([0.5, 2.1, 3.7, 5.2], 10)), np.repeat([0, 1, 2, 3, 4, 5, 6, 7], 5)
    assert exposure.dispersion_index(times, clusters) == 5.0
    assert exposure.dispersion_index(times, clusters, np.arange(40) % 2 == 0) == 3.0
