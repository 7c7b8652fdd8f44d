"""The time that both catalogues share, and rates in it."""

import json

import numpy as np
import pytest
from catalog_fixtures import made_up_catalog

from catalogs.comparison import compare
from catalogs.exposure import LEAST_DAYS, Exposure, total_interval
from catalogs.periods import recorded_period
from catalogs.settings import DatedStep

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
    sums = Exposure.of(STEPS, None).sums(days(0.5, 0.7, 20.5, 35, 50.9), np.array([1.0, 2.0, 4.0, 8.0, 16.0]))
    assert len(sums) == 51
    assert {index: value for index, value in enumerate(sums) if value} == {0: 3.0, 20: 4.0, 40: 16.0}


def test_a_record_begins_with_its_first_event_only_where_the_silence_before_is_no_chance():
    """An event every other day: a fortnight of silence is likely enough, a month is not."""
    begun, ended = recorded_period(days(*range(0, 40, 2)))
    assert begun == np.datetime64("2019-08-01") - np.timedelta64(14, "D")
    assert ended == np.datetime64("2019-09-09") + np.timedelta64(14, "D")
    assert recorded_period(days(3))[0] < np.datetime64("1700-01-01")


def test_the_interval_of_a_sum_holds_it_as_often_as_it_says():
    """Bursts of ten equal events on a fifth of 90 days: 200 records; 0.046 are three standard errors."""
    generator = np.random.default_rng(1)
    held = []
    for _ in range(200):
        low, high = total_interval(10.0 * generator.poisson(0.2, 90), 199, generator)
        held.append(low <= 180.0 <= high)
    assert np.mean(held) >= 0.93 - 0.046
    assert np.isnan(total_interval(np.eye(1, 90)[0], 199, generator)).all()
    assert np.isfinite(total_interval(np.arange(90) < LEAST_DAYS, 199, generator)).all()


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
    np.testing.assert_allclose(
        result["potency_ratio_interval"], float(result["potency_rate"][0]) / np.array([high, low])
    )


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
    result = compare(catalog, record, {"resamplings": 199}).sel(axis_name="P")
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
