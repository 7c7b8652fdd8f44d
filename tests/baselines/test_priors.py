"""Places of the record and of a model together: a model's map as a prior worth a number of recorded events."""

import numpy as np
import pytest

from baselines.models import Counted
from baselines.month_maps import (
    FIRST_PRIOR_EVENTS,
    PRIOR_EVENTS,
    PRIOR_LINE,
    PRIOR_MODEL,
    MonthMaps,
    Periods,
    Places,
    prior_share,
)
from catalogs.compare.face import Face
from catalogs.settings import FacePosition

BOX = np.array([[-1000.0, -1000.0], [1000.0, 1000.0]])
MONTHS = 6
START = np.datetime64("2019-01-01", "ns") + 30 * np.timedelta64(86_400 * 10**9, "ns") * np.arange(MONTHS)
END = START + 30 * np.timedelta64(86_400 * 10**9, "ns")
FACE = Face.of(
    [
        FacePosition.of({"date": date, "ends": [[x, -50.0], [x, 50.0]]})
        for date, x in (("2019-01-01", 0.0), ("2019-08-01", 200.0))
    ]
)


def maps_of(count: int, model_shift: float, seed: int = 0, face: Face | None = None) -> MonthMaps:
    """So many events a month about a point, and a model of 500 events a month whose point is shifted, m."""
    generator = np.random.default_rng(seed)
    step = np.repeat(np.arange(MONTHS), count)
    time = START[step] + (generator.random(len(step)) * 29.0 * 86_400e9).astype("timedelta64[ns]")
    place = 150.0 * generator.normal(size=(len(step), 2))
    record = Places(time, place, np.ones(len(step)))
    model_step = np.repeat(np.arange(MONTHS), 500)
    model_place = np.column_stack([150.0 * generator.normal(size=(len(model_step), 2)), np.zeros(len(model_step))])
    model = Counted(model_place + model_shift, model_step, np.ones(len(model_step)), np.zeros(len(model_step), int))
    periods = Periods.of(START, END, None)
    deviation = np.full(len(step), 30.0)
    maps = MonthMaps(record, step, np.arange(len(step)), deviation, record, periods, face, BOX, {"Pipeline": model})
    return maps.with_learned_priors()


def means(maps: MonthMaps) -> dict[str, float]:
    """Mean gain of each map over all steps that all of them forecast."""
    scores = maps.scores()
    return dict(zip(scores.labels, scores.mean(), strict=True))


def test_a_right_model_helps_a_sparse_record_and_hardly_a_rich_one():
    """Of three events a month the record alone knows little; of four hundred it knows all."""
    sparse, rich = ([means(maps_of(count, 0.0, seed)) for seed in range(seeds)] for count, seeds in ((3, 8), (400, 1)))
    gain = np.mean([one[PRIOR_MODEL] - one["all_earlier"] for one in sparse])
    assert gain > 0.3
    assert 0.0 <= rich[0][PRIOR_MODEL] - rich[0]["all_earlier"] < 0.1


def test_a_wrong_model_is_given_little_weight():
    """Its map lies elsewhere; after some steps it is worth the fewest events, and costs little."""
    maps = maps_of(60, 800.0)
    assert maps.prior_events[PRIOR_MODEL][-1] == PRIOR_EVENTS[0]
    found = means(maps)
    assert found[PRIOR_MODEL] > found["all_earlier"] - 0.2
    assert found["mixed"] < found["all_earlier"] - 0.4  # half and half it costs ln 2


def test_what_a_prior_is_worth_follows_from_earlier_steps_alone():
    """A wrong model whose places later events have: before these it is worth nothing, in the step after them much."""
    maps = maps_of(40, 800.0)
    worth = maps.prior_events[PRIOR_MODEL]
    assert (worth[:2] == FIRST_PRIOR_EVENTS).all()  # the first step has no record before it
    late = maps.step >= 4
    place = np.where(late[:, None], maps.record.place + 800.0, maps.record.place)
    moved = Places(maps.record.time, place, maps.record.potency)
    spoiled = MonthMaps(
        moved, maps.step, maps.cluster, maps.deviation, moved, maps.periods, None, BOX, maps.models
    ).with_learned_priors()
    np.testing.assert_array_equal(spoiled.prior_events[PRIOR_MODEL][:5], worth[:5])
    assert spoiled.prior_events[PRIOR_MODEL][5] > worth[4]


def test_the_worth_is_that_of_the_largest_probability_of_earlier_events():
    """Slow twin: the gains of the mixture, one worth after the other."""
    maps = maps_of(30, 120.0)
    scores = maps.scores()
    gains = dict(zip(scores.labels, scores.gains, strict=True))
    totals = []
    for worth in PRIOR_EVENTS:
        total = 0.0
        for event in np.flatnonzero((maps.step > 0) & (maps.step < 5)):
            share = worth / (worth + 30.0 * maps.step[event])
            model, record = gains["Pipeline"][0, event], gains["all_earlier"][0, event]
            total += np.log(share * np.exp(model) + (1.0 - share) * np.exp(record))
        totals.append(total)
    assert maps.prior_events[PRIOR_MODEL][5] == PRIOR_EVENTS[np.argmax(totals)]


def test_the_line_of_the_face_is_a_prior_where_there_is_a_face():
    """Beside the model; without a face the model alone."""
    assert list(maps_of(10, 0.0).prior_events) == [PRIOR_MODEL]
    maps = maps_of(10, 0.0, face=FACE)
    assert list(maps.prior_events) == [PRIOR_MODEL, PRIOR_LINE]
    found = means(maps)
    assert np.isfinite([found[PRIOR_MODEL], found[PRIOR_LINE]]).all()
    assert list(maps.labels)[-1] == "ceiling"


def test_a_mixture_lies_between_its_parts():
    """Its probability is the weighted mean of both."""
    maps = maps_of(20, 50.0)
    scores = maps.scores()
    gains = dict(zip(scores.labels, scores.gains, strict=True))
    own = maps.step == 3
    share = prior_share(maps.prior_events[PRIOR_MODEL][3], 60)
    mixed = np.log(share * np.exp(gains["Pipeline"][:, own]) + (1.0 - share) * np.exp(gains["all_earlier"][:, own]))
    np.testing.assert_allclose(gains[PRIOR_MODEL][:, own], mixed, rtol=1e-9)
    assert prior_share(50.0, 50) == pytest.approx(0.5)


def test_a_record_of_one_step_has_no_such_map():
    """Nothing precedes it, and nothing fails."""
    maps = maps_of(20, 0.0)
    own = maps.step == 0
    first = Places(maps.record.time[own], maps.record.place[own], maps.record.potency[own])
    periods = Periods.of(START[:1], END[:1], None)
    alone = MonthMaps(
        first, maps.step[own], maps.cluster[own], maps.deviation[own], first, periods, None, BOX, maps.models
    ).with_learned_priors()
    assert np.isnan(alone.scores().gains[alone.scores().labels.index(PRIOR_MODEL)]).all()
