"""Numbers of a month by metres and days, and the test of the rate of earlier months."""

import numpy as np
import pytest
from scipy.stats import kstest

from baselines.month_maps import Periods, Places
from baselines.months import n_test, step_rates
from catalogs.compare.face import Face
from catalogs.settings import FacePosition

START = np.array(["2019-08-01", "2019-09-01", "2019-10-01"], "datetime64[ns]")
END = np.array(["2019-09-01", "2019-10-01", "2019-11-01"], "datetime64[ns]")
DAY = 86_400 * 10**9  # ns
FACE = Face.of(
    [
        FacePosition.of({"date": date, "ends": [[x, -100.0], [x, 100.0]]})
        for date, x in (("2019-08-01", 0.0), ("2019-09-01", 100.0), ("2019-10-01", 300.0), ("2019-11-01", 350.0))
    ]
)


def record(*numbers: int) -> Places:
    """So many events in each month, evenly."""
    time = np.concatenate(
        [
            start + (end - start) // count * np.arange(count)
            for start, end, count in zip(START, END, numbers, strict=True)
        ]
    )
    return Places(time, np.zeros((len(time), 2)), np.full(len(time), 2.0))


def test_numbers_follow_metres_or_days():
    """The second month has twice the metres and twice the events of the first: the rate by metres holds."""
    first, second, third = step_rates(record(310, 620, 155), Periods.of(START, END, None), FACE)
    assert np.isnan(first.all_earlier["metres"].expected)
    assert second.all_earlier["metres"].expected == pytest.approx(620.0)
    assert second.all_earlier["metres"].p_value > 0.9
    assert second.all_earlier["days"].expected == pytest.approx(300.0)
    assert second.all_earlier["days"].p_value < 1e-6
    assert third.all_earlier["metres"].expected == pytest.approx(155.0)
    assert third.last["days"].expected == pytest.approx(620.0 * 31 / 30)
    assert (second.amount["metres"], second.number, second.potency) == (pytest.approx(200.0), 620, 1240.0)


def test_without_a_face_there_are_days_alone():
    """And metres that are not known."""
    _, second, _ = step_rates(record(31, 30, 31), Periods.of(START, END, None), None)
    assert np.isnan(second.amount["metres"])
    assert np.isnan(second.all_earlier["metres"].p_value)
    assert second.all_earlier["days"].expected == pytest.approx(30.0)


def test_time_without_a_face_does_not_count():
    """Nor do its events: a record that begins a month before the face."""
    face = Face.of(
        [FacePosition.of({"date": date, "ends": [x, 0.0]}) for date, x in (("2019-09-01", 0.0), ("2019-11-01", 61.0))]
    )
    _, second, third = step_rates(record(3100, 300, 310), Periods.of(START, END, None), face)
    assert np.isnan(second.all_earlier["days"].expected)
    assert third.all_earlier["days"].expected == pytest.approx(310.0, rel=0.01)
    assert third.all_earlier["metres"].expected == pytest.approx(310.0, rel=0.01)


@pytest.mark.parametrize("gap", [(75.0, 75.0), (68.0, 84.0)])
def test_days_without_a_face_are_no_days_without_events(gap):
    """A panel that ends in the midst of the last month, or days between two panels, made independent events look
    clustered."""
    begins, days = np.datetime64("2019-08-01"), [("a", 0.0), ("a", gap[0]), ("b", gap[1]), ("b", 92.0)]
    at = [(panel, str(begins + np.timedelta64(round(day), "D")), day) for panel, day in days]
    if gap[0] == gap[1]:
        at = at[:2]
    positions = [{"date": date, "panel": panel, "ends": [[x, -100.0], [x, 100.0]]} for panel, date, x in at]
    face = Face.of([FacePosition.of(one) for one in positions])
    generator = np.random.default_rng(3)
    day = np.sort(generator.random(220) * 92.0)
    day = day[(day < gap[0]) | ((day >= gap[1]) & (len(at) > 2))]
    events = Places(
        START[0] + (day * DAY).astype("timedelta64[ns]"), 1e4 * generator.random((len(day), 2)), np.ones(len(day))
    )
    third = step_rates(events, Periods.of(START, END, None), face)[-1]
    independent = n_test(third.number, third.amount["days"], len(day) - third.number, 61.0)
    assert third.all_earlier["days"].p_value == pytest.approx(independent.p_value, rel=0.05)


def simulated(generator, rate: float, days: int, size: float) -> int:
    """Events of so many days in groups at random, of `size` each on average (geometric)."""
    return int(generator.geometric(1.0 / size, generator.poisson(rate * days / size)).sum())


@pytest.mark.parametrize(("rate", "size", "earlier_days"), [(5.0, 1.0, 30), (5.0, 1.0, 300), (8.0, 4.0, 120)])
def test_p_values_of_one_rate_are_uniform(rate, size, earlier_days):
    """Of Poisson numbers and of groups of geometric size s, whose variance over mean is 2 s - 1."""
    generator = np.random.default_rng(2)
    clustering = 2.0 * size - 1.0
    p_values = []
    for _ in range(800):
        now, before = (simulated(generator, rate, days, size) for days in (30, earlier_days))
        p_values.append(n_test(now, 30.0, before, float(earlier_days), clustering).p_value)
    assert kstest(p_values, "uniform").pvalue > 0.01
    assert np.mean(np.array(p_values) < 0.05) == pytest.approx(0.05, abs=0.02)


def test_a_rate_that_doubles_is_found():
    """With the power that the numbers have."""
    assert n_test(300, 30.0, 1500, 300.0).p_value < 1e-6
    assert n_test(300, 30.0, 1500, 300.0, 100.0).p_value > 0.05


@pytest.mark.parametrize(
    ("amount", "earlier", "earlier_amount"), [(0.0, 10, 5.0), (5.0, 0, 5.0), (5.0, 10, 0.0), (5.0, 10, np.nan)]
)
def test_without_an_earlier_rate_nothing_is_expected(amount, earlier, earlier_amount):
    """Nor of a month without metres."""
    assert np.isnan(n_test(3, amount, earlier, earlier_amount).expected)


def bursts(generator, count: int, each: int) -> Places:
    """Bursts of so many events within an hour at random times of the three months, apart from each other."""
    days = np.sort(generator.uniform(0.0, 92.0, count))
    time = START[0] + ((days[:, None] + generator.uniform(0.0, 0.04, (count, each))) * DAY).astype("timedelta64[ns]")
    place = 100.0 * generator.normal(size=(count, 1, 2)) + 5.0 * generator.normal(size=(count, each, 2))
    order = np.argsort(time.ravel(), kind="stable")
    return Places(time.ravel()[order], place.reshape(-1, 2)[order], np.ones(count * each))


def test_bursts_of_one_rate_fit():
    """Twelve bursts of ten in three months: at most 7 in 100 records have a p-value below 0.05."""
    generator = np.random.default_rng(3)
    rates = [step_rates(bursts(generator, 12, 10), Periods.of(START, END, None), None)[2] for _ in range(60)]
    p_values = np.array([one.all_earlier["days"].p_value for one in rates])
    assert np.isfinite(p_values).mean() > 0.8
    assert np.mean(p_values < 0.05) <= 0.07


@pytest.mark.parametrize("count", [1, 2, 3])
def test_too_few_bursts_have_no_p_value(count):
    """Some bursts of twenty events tell nothing of a rate, though they are many events."""
    _, _, third = step_rates(bursts(np.random.default_rng(4), count, 20), Periods.of(START, END, None), None)
    assert np.isnan(third.all_earlier["days"].p_value)
