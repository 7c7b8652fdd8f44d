"""Numbers forecast from earlier steps: laws and rules on twins, scores with intervals, and what a step may not know."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from baselines.measures import OF_STATES, read_measures
from baselines.month_maps import Periods, Places
from baselines.number_forecasts import (
    ALL_BY_METRES,
    ALL_LAWS,
    LAST,
    LAST_BY_DAYS,
    LAST_BY_METRES,
    NumberScores,
    RecordedSteps,
    control_rules,
    expected_by_rule,
    laws_of_all,
    moving_days,
    score_numbers,
    score_potency,
)
from baselines.number_report import (
    draw_numbers,
    law_rows,
    number_columns,
    number_sentences,
    score_rows,
    step_rows,
)
from baselines.rate_law import NumberForecast, control_forecasts
from catalogs.compare.face import Face
from catalogs.settings import FacePosition
from common.datasets import write_dataset

DAY = np.timedelta64(86_400 * 10**9, "ns")
FACE = Face.of(
    [
        FacePosition.of({"date": date, "ends": [[x, -100.0], [x, 100.0]]})
        for date, x in (("2019-08-01", 0.0), ("2019-09-01", 100.0), ("2019-09-16", 100.0), ("2019-10-01", 130.0))
    ]
)


def twin(generator, months: int = 14) -> tuple[RecordedSteps, dict, dict]:
    """Months that follow a law of metres, two without mining; a second measure has nothing to do with them."""
    metres = generator.uniform(20.0, 300.0, months)
    metres[months // 2 : months // 2 + 2] = 0.0
    days = np.full(months, 30.0)
    number = generator.poisson(5.0 * days + 2.0 * metres).astype(float)
    ones = np.ones(months)
    time, bounds = 15.0 + 30.0 * np.arange(months), np.ones((months, 2))
    recorded = RecordedSteps(number, 0.5 * number, days, time, ones, bounds, 0.5 * ones, bounds)
    measures = {"metres": metres, "failed_volume": generator.uniform(20.0, 300.0, months)}
    rules = {LAST: ones, LAST_BY_METRES: metres, ALL_BY_METRES: metres, LAST_BY_DAYS: days * (metres > 0.0)}
    return recorded, measures, rules


def test_on_a_twin_the_right_measure_is_chosen_and_beats_the_rules():
    """The weight goes to metres, the lead over the last step is more than chance, errors are small."""
    for seed in range(3):
        scores = score_numbers(*twin(np.random.default_rng(seed)))
        steps = scores.common
        assert list(np.flatnonzero(steps)) == list(range(2, 14))
        assert scores.weights["metres"][-1] > 0.99
        parts = {label: scores.forecasts[label][4].probability(400.0) for label in scores.weights}
        mixed = sum(scores.weights[label][4] * parts[label] for label in parts)
        assert scores.forecasts[ALL_LAWS][4].probability(400.0) == pytest.approx(mixed)
        assert scores.weights["metres"][-1] + scores.weights["failed_volume"][-1] == pytest.approx(1.0)
        missed, (low, high) = scores.misses(ALL_LAWS, steps & (np.arange(14) > 4))
        assert low < missed < high
        assert missed < 0.15
        for rule in (LAST, LAST_BY_METRES, ALL_BY_METRES, LAST_BY_DAYS):
            assert scores.misses(rule, steps)[0] > 0.3
            lead = scores.lead(ALL_LAWS, rule, steps)
            assert lead.interval[0] < lead.value < lead.interval[1]
            assert lead.value > 0.5
        assert scores.lead(ALL_LAWS, LAST, steps).interval[0] > 0.0
        assert scores.inside(ALL_LAWS, steps) >= 10


def test_a_forecast_knows_earlier_steps_only():
    """With other numbers, potencies and measures of later steps, forecasts and weights of earlier ones are the same."""
    recorded, measures, rules = twin(np.random.default_rng(4))
    later = np.arange(14) >= 9
    spoiled = replace(
        recorded,
        number=np.where(later, 5000.0, recorded.number),
        potency=np.where(later, 9e9, recorded.potency),
        dispersion=np.where(np.arange(14)[:, None] > 9, 77.0, recorded.dispersion),
        potency_dispersion=np.where(np.arange(14)[:, None] > 9, 77.0, recorded.potency_dispersion),
        scale=np.where(np.arange(14) > 9, 77.0, recorded.scale),
    )
    other = {label: np.where(np.arange(14) > 9, 1e6, amount) for label, amount in measures.items()}
    for scored in (score_numbers, score_potency):
        one, two = scored(recorded, measures, rules), scored(spoiled, other, rules)
        for label in one.forecasts:
            np.testing.assert_array_equal(one.values(label)[:10], two.values(label)[:10])
            np.testing.assert_array_equal(one.intervals(label)[:10], two.intervals(label)[:10])
        for label, weight in one.weights.items():
            np.testing.assert_array_equal(weight[:10], two.weights[label][:10])


def test_a_rule_after_a_step_without_events_does_not_rule_them_out():
    """It states 0 and has an interval; a measure that is constant has no lead over it by months without events."""
    number = np.array([0.0, 12.0, 0.0, 9.0, 0.0, 11.0, 10.0, 0.0, 8.0])
    stated, expected, spread = expected_by_rule(LAST, number, np.ones(9))
    assert stated[1] == 0.0
    assert expected[1] == 0.5
    dispersion = np.tile([1.0, 4.0], (9, 1))
    forecasts = control_forecasts(number, stated, expected, spread, dispersion)
    assert forecasts[1].value == 0.0
    assert forecasts[1].interval[1] > 0.0
    assert forecasts[5].score(11.0) > -8.0


def test_rules_expect_what_they_say():
    """Last step, by metres, all earlier by metres; after a step without metres the last one with some."""
    number, metres = np.array([100.0, 50.0, 40.0, 90.0]), np.array([50.0, 100.0, 0.0, 30.0])
    np.testing.assert_allclose(expected_by_rule(LAST, number, np.ones(4))[0], [np.nan, 100.0, 50.0, 40.0])
    np.testing.assert_allclose(expected_by_rule(LAST_BY_METRES, number, metres)[0], [np.nan, 200.0, 0.0, 15.0])
    np.testing.assert_allclose(
        expected_by_rule(ALL_BY_METRES, number, metres)[0], [np.nan, 200.0, 0.0, 190.0 * 30 / 150]
    )
    recorded, measures, rules = twin(np.random.default_rng(5))
    scores = score_numbers(recorded, measures, rules)
    np.testing.assert_allclose(scores.values(LAST)[1:], recorded.number[:-1])


def test_a_rule_that_says_no_event_is_scored_as_one_in_a_million():
    """Metres alone, in a month without metres."""
    recorded, measures, rules = twin(np.random.default_rng(6))
    scores = score_numbers(recorded, measures, rules)
    alone = np.arange(14) == 7
    assert scores.values(ALL_BY_METRES)[7] == 0.0
    assert scores.scores(ALL_BY_METRES, alone)[0] == pytest.approx(np.log(1e-6))
    assert scores.mined[7]  # the other measure goes on
    assert not score_numbers(recorded, {"metres": measures["metres"]}, rules).mined[7]


def test_intervals_of_misses_and_leads_hold_the_truth():
    """Normal errors of ln, and of differences of scores: 93 to 97 % of 95 % intervals, from twelve steps."""
    generator, held = np.random.default_rng(7), []
    for _ in range(600):
        number = 1e6 * np.exp(0.4 * generator.normal(size=12))
        forecasts = [NumberForecast(np.array([1e6]), np.array([1e6]), np.ones(1), 1e6)] * 12
        scores = NumberScores(number, {"rule": forecasts}, {}, np.ones(12), np.ones(12, bool))
        low, high = scores.misses("rule", scores.common)[1]
        held.append(low <= 0.4 <= high)
    assert 0.92 <= np.mean(held) <= 0.98


def test_leads_of_equal_forecasts_are_told_apart_as_often_as_stated():
    """Two rules whose errors are alike: the interval of the lead excludes 0 in 5 % of records."""
    generator, excluded = np.random.default_rng(8), []

    def around(mean: float) -> NumberForecast:
        return NumberForecast(np.array([mean]), np.array([mean + (0.3 * mean) ** 2]), np.ones(1), mean)

    for _ in range(400):
        number = generator.poisson(300.0, 14).astype(float)
        one, two = ([around(300.0 * np.exp(0.3 * generator.normal())) for _ in range(14)] for _ in "12")
        scores = NumberScores(number, {"one": one, "two": two}, {}, np.ones(14), np.ones(14, bool))
        low, high = scores.lead("one", "two", scores.common).interval
        excluded.append(not low <= 0.0 <= high)
    assert np.mean(excluded) <= 0.08


def test_numbers_days_and_chance_of_a_record_are_counted_by_step():
    """Partly recorded steps, bursts before a step, a first step without anything before it."""
    start = np.array(["2019-08-11", "2019-09-01", "2019-10-01"], "datetime64[ns]")
    end = np.array(["2019-09-01", "2019-10-01", "2019-11-01"], "datetime64[ns]")
    time = np.concatenate([one + DAY // 24 * np.arange(20) for one in start])
    record = Places(time, np.random.default_rng(9).normal(size=(60, 2)), np.full(60, 2.0))
    recorded = RecordedSteps.of(record, Periods.of(start, end, None), np.array([31.0, 30.0, 31.0]))
    assert recorded.number.tolist() == [20.0, 20.0, 20.0]
    assert recorded.potency.tolist() == [40.0, 40.0, 40.0]
    assert recorded.days.tolist() == [21.0, 30.0, 31.0]
    assert recorded.share == pytest.approx([21 / 31, 1.0, 1.0])
    assert recorded.dispersion[0].tolist() == [1.0, 1.0]
    assert (recorded.dispersion[2] > 3.0).all()  # all events of a month within a day
    assert (recorded.potency_dispersion[2] >= 1.0).all()
    assert np.isnan(recorded.scale[0])
    assert recorded.scale[2] >= 2.0
    nothing = RecordedSteps.of(record.between(end[-1], end[-1]), Periods.of(start, end, None), np.full(3, 30.0))
    assert score_numbers(nothing, {"metres": np.ones(3)}, {LAST: np.ones(3)}).values(LAST)[2] == 0.0
    potency = score_potency(nothing, {"metres": np.ones(3)}, {LAST: np.ones(3)})
    assert not potency.common.any()


def test_a_face_that_stands_has_days_but_does_not_move():
    """Half of September; before and after its positions there is none."""
    start, end = np.datetime64("2019-09-01", "ns"), np.datetime64("2019-10-01", "ns")
    assert moving_days(FACE, start, end) == pytest.approx(15.0, abs=0.05)
    assert moving_days(FACE, end, end + 30 * DAY) == 0.0
    record = Places(np.array([start + DAY]), np.zeros((1, 2)), np.ones(1))
    periods = Periods.of(np.array([start - 31 * DAY, start]), np.array([start, end]), None)
    recorded = RecordedSteps.of(record, periods, np.array([31.0, 30.0]))
    rules = control_rules(recorded, FACE, periods)
    assert rules[LAST_BY_METRES] == pytest.approx([100.0, 30.0])
    assert rules[LAST_BY_DAYS] == pytest.approx([31.0, 15.0], abs=0.05)
    assert list(control_rules(recorded, None, periods)) == [LAST, "all_by_days"]


def test_too_few_steps_and_a_measure_of_nothing_have_no_law():
    """One or two steps, a measure that is 0 everywhere, no measure at all."""
    recorded, measures, rules = twin(np.random.default_rng(10), 6)
    zero = score_numbers(recorded, {"failed_volume": np.zeros(6)}, rules)
    assert list(zero.weights) == []
    assert np.isnan(zero.values(ALL_LAWS)).all()
    assert np.isfinite(zero.values(LAST)[1:]).all()
    assert np.isnan(score_numbers(recorded, measures, rules).values(ALL_LAWS)[:2]).all()
    assert laws_of_all(recorded, {"failed_volume": np.zeros(6)}) == {}
    collapsed = measures["metres"].copy()
    collapsed[3:] = np.nan
    values = score_numbers(recorded, {"metres": collapsed}, rules).values(ALL_LAWS)
    assert np.isfinite(values[2])
    assert np.isnan(values[3:]).all()


def state(path, volume, excavation, strain, **attributes) -> None:
    """A state with these particles."""
    values = {
        "volume": ("particle", np.asarray(volume, float)),
        "excavation": ("particle", np.asarray(excavation, np.int16)),
        "plastic_strain_step": (("particle", "voigt"), np.asarray(strain, float)),
    }
    facts = {"failed_volume": 5.0, "energy_dissipated": 7.0, "energy_released": 9.0, "falls": "[]"}
    write_dataset(xr.Dataset(values, attrs=facts | attributes), path)


def test_measures_follow_from_states(tmp_path):
    """Rock mined without what fell and without fill; potency of pure shear is twice the tensor strain times volume."""
    shear = np.zeros((3, 6))
    shear[1, 5] = 1e-3  # xy
    state(tmp_path / "before.nc", [10.0, 20.0, 0.0], [-1, -1, 0], np.zeros((3, 6)))
    state(tmp_path / "a.nc", [10.0, 12.0, 4.0], [-1, -1, 0], shear, falls='[{"volume": 3.0}]')
    state(tmp_path / "b.nc", [10.0, 12.0, 4.0], [-1, -1, 0], np.zeros((3, 6)), collapsed=1)
    found = read_measures([tmp_path / f"{name}.nc" for name in ("before", "a", "b")], 2)
    assert list(found) == [measure.label for measure in OF_STATES]
    assert [found[label][0] for label in found] == pytest.approx([5.0, 5.0, 2.0 * 1e-3 * 12.0, 7.0, 9.0])
    assert all(np.isnan(found[label][1]) for label in found)
    assert read_measures([], 0)["plastic_work"].shape == (0,)


def test_the_page_states_errors_leads_and_the_law():
    """Sentences, rows, columns of the file and the figure of a twin; of a single step, that there are too few."""
    recorded, measures, rules = twin(np.random.default_rng(11))
    months = SimpleNamespace(
        steps=tuple(f"2019-{month:02d}" for month in range(1, 15)),
        numbers=score_numbers(recorded, measures, rules),
        potencies=score_potency(recorded, measures, rules),
        laws=laws_of_all(recorded, measures),
        amounts=measures,
        recorded_potency=recorded.potency,
    )
    off, rule, law = number_sentences(months)
    assert re.fullmatch(
        r"In 12 steps the number of events is forecast from earlier steps by modelled measures\. It is off by a factor "
        r"of 1\.\d \(r\.m\.s\. of ln 0\.\d\d; 95 % interval 0\.\d\d to 0\.\d\d\)\.",
        off,
    )
    assert "which is more than chance explains (p" in rule
    assert law.startswith("Of the measures, metres advanced has forecast earlier steps best (weight ")
    rows = score_rows(months)
    assert [row["name"] for row in rows[:2]] == ["laws of all measures together", "law of metres advanced"]
    assert [row["name"] for row in law_rows(months)] == ["metres advanced", "failed volume"]
    assert step_rows(months)[1]["law"] == "–"
    columns = number_columns(months)
    assert columns[13]["forecast events, last step"] == recorded.number[12]
    assert columns[13]["weight, law of metres advanced"] > 0.99
    assert columns[3]["failed volume, m3"] == measures["failed_volume"][3]
    axes = draw_numbers(months).axes[0]
    assert axes.get_ylabel() == "events in the step"
    alone, one_measure, one_rule = twin(np.random.default_rng(12), 1)
    few = SimpleNamespace(numbers=score_numbers(alone, one_measure, one_rule))
    assert number_sentences(few) == [
        "There are too few steps with a modelled measure to forecast the number of another one."
    ]
