"""Maps of a month from earlier months and the face, and how sure their gain is."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baselines.models import Counted
from baselines.month_maps import MonthMaps, Periods, Places, line_places, move, nuisances
from catalogs.compare.face import Face
from catalogs.compare.locations import UNIFORM_SHARE
from catalogs.settings import FacePosition

START = np.array(["2019-08-01", "2019-09-01", "2019-10-01"], "datetime64[ns]")
END = np.array(["2019-09-01", "2019-10-01", "2019-11-01"], "datetime64[ns]")
BOX = np.array([[-1000.0, -1000.0], [3000.0, 1000.0]])
DAY = np.timedelta64(86_400 * 10**9, "ns")
ADVANCE = 300.0  # m in a month


def face_at(*middles: float, panel: str = "a") -> list[FacePosition]:
    """A face 200 m long that advances east, at so many x at the ends of months."""
    dates = ("2019-08-01", "2019-09-01", "2019-10-01", "2019-11-01")
    return [
        FacePosition.of({"date": date, "panel": panel, "ends": [[x, -100.0], [x, 100.0]]})
        for date, x in zip(dates, middles, strict=False)
    ]


ADVANCING = Face.of(face_at(0.0, ADVANCE, 2 * ADVANCE, 3 * ADVANCE))


def events(count: int, seed: int = 0, face: Face = ADVANCING, ahead: float = -20.0, spread: float = 30.0) -> Places:
    """Events at even times of all three months, normally distributed about a point behind the face of their time."""
    generator = np.random.default_rng(seed)
    time = START[0] + (END[-1] - START[0]) // count * np.arange(count)
    coordinates = np.array([ahead, 0.0]) + spread * generator.normal(size=(count, 2))
    return Places(time, face.at(time).places(coordinates), np.ones(count))


def maps_of(record: Places, face: Face | None = ADVANCING, models: dict[str, Counted] | None = None) -> MonthMaps:
    """All three months are scored; nothing is known before them."""
    step = np.searchsorted(END, record.time, side="right")
    deviation = np.full(len(step), 10.0)
    return MonthMaps(
        record, step, np.arange(len(step)), deviation, record, Periods.of(START, END, None), face, BOX, models or {}
    )


def means(scores) -> dict[str, np.ndarray]:
    """Gain of each map by step."""
    return dict(zip(scores.labels, np.array([scores.mean(step) for step in range(3)]).T, strict=True))


def test_on_a_face_that_stands_the_moved_record_is_the_record_itself():
    """It moves in the last ten days of the third month only, which is not scored here."""
    positions = [
        *face_at(0.0, 0.0, 0.0),
        FacePosition.of({"date": "2019-12-01", "panel": "a", "ends": [[9.0, -100.0], [9.0, 100.0]]}),
    ]
    standing = Face.of(positions)
    record = events(900, face=standing)
    early = record.between(START[0], END[1])
    moved, still = (means(maps_of(early, face).scores()) for face in (standing, None))
    for label in ("all_earlier", "last"):
        np.testing.assert_allclose(moved[label][:2], still[label][:2], rtol=1e-12)


def test_each_moved_event_keeps_its_place_relative_to_a_face_of_the_month():
    """The distances ahead are those that the events had, from a face that was somewhere on its way."""
    record = events(60).between(START[0], END[0])
    places = move(record, ADVANCING, START[1], END[1])
    own = ADVANCING.at(record.time).coordinates(record.place)
    np.testing.assert_allclose(places[:, 1], record.place[:, 1])
    fronts = places[:, 0] - own[:, 0]
    assert (fronts >= ADVANCE - 1e-6).all()
    assert (fronts <= 2.0 * ADVANCE).all()
    # evenly over the month: as many on each third of the way
    assert np.histogram(fronts, np.linspace(ADVANCE, 2.0 * ADVANCE, 4))[0] == pytest.approx(len(fronts) / 3, abs=2)


def test_events_without_a_face_are_left_out_and_a_month_without_one_has_no_map():
    """Of another panel they are moved."""
    other = [
        FacePosition.of({"date": date, "panel": "b", "ends": [[x, 800.0], [x, 1000.0]]})
        for date, x in (("2019-09-10", 0.0), ("2019-10-01", 50.0))
    ]
    face = Face.of([*face_at(0.0, ADVANCE), *other])
    record = events(90).between(START[0], END[0])
    late = Places(record.time + 32 * DAY, record.place, record.potency)  # some before, some after the panel
    kept = int(np.sum((late.time >= np.datetime64("2019-09-10")) & (late.time <= END[1])))
    places = move(record, face, START[1], END[1])
    assert len(places) == len(record.time)
    assert (places[:, 1] > 600.0).all()
    assert len(move(late, face, START[0], END[0])) == kept
    assert len(move(record, face, START[2], END[2])) == 0
    assert len(line_places(face, START[2], END[2])) == 0


def test_the_line_of_the_face_is_all_along_its_way():
    """Its ends and its middle alike."""
    places = line_places(ADVANCING, START[1], END[1])
    assert places.min(axis=0) == pytest.approx([ADVANCE, -100.0], abs=2.0)
    assert places.max(axis=0) == pytest.approx([2.0 * ADVANCE, 100.0], abs=2.0)
    assert places.mean(axis=0) == pytest.approx([1.5 * ADVANCE, 0.0], abs=2.0)


def test_a_forecast_that_is_the_truth_gains_what_theory_says():
    """Events of a band swept by the face, uniform along the advance and normal across it: the gain is the logarithm of
    the box's area over that of the band, exp(entropy). The smoothing of 10 m widens the band, and a twentieth of the
    map is uniform."""
    spread = 60.0
    generator = np.random.default_rng(4)
    count = 6000
    time = START[0] + (END[-1] - START[0]) // count * np.arange(count)
    across = spread * generator.normal(size=count)
    ahead = generator.uniform(-150.0, 150.0, count)
    record = Places(time, ADVANCING.at(time).places(np.column_stack([ahead, across])), np.ones(count))
    gain = means(maps_of(record).scores())["all_earlier"][1:]
    # along the advance: the sum of two uniform variables, 300 m wide each, has the entropy ln 300 + 1/2
    wide = np.hypot(spread, 10.0)
    across_part = 0.5 * np.log(2.0 * np.pi * wide**2) + 0.5 * spread**2 / wide**2
    area = np.prod(BOX[1] - BOX[0])
    expected = np.log(1.0 - UNIFORM_SHARE) + np.log(area) - (np.log(300.0) + 0.5) - across_part
    assert gain == pytest.approx(expected, abs=0.06)


@settings(deadline=None, max_examples=10)
@given(angle=st.sampled_from([0.5 * np.pi, np.pi, 1.5 * np.pi]), mirrored=st.booleans())
def test_turned_and_mirrored_mines_have_the_same_gain(angle, mirrored):
    """By right angles, as the box of the uniform rate is along the axes."""
    turn = np.round([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turn = turn @ np.diag([1.0, -1.0 if mirrored else 1.0])
    positions = [
        FacePosition.of({"date": one.date, "ends": (np.array(one.ends) @ turn.T).tolist()})
        for one in face_at(0.0, ADVANCE, 2 * ADVANCE, 3 * ADVANCE)
    ]
    record = events(300)
    own = maps_of(record)
    other = maps_of(Places(record.time, record.place @ turn.T, record.potency), Face.of(positions))
    other = replace(other, box=np.sort(BOX @ turn.T, axis=0))
    np.testing.assert_allclose(other.scores().gain, own.scores().gain, rtol=1e-6, atol=1e-9)


def test_nothing_of_a_month_or_later_is_in_its_map():
    """Later events moved far away change no forecast; the ceiling, which is none, they do."""
    record = events(600)
    late = record.time >= START[1]
    spoiled = Places(record.time, np.where(late[:, None], record.place + 5000.0, record.place), record.potency)
    own, other = maps_of(record), replace(maps_of(record), record=spoiled)
    first, second = means(own.scores()), means(other.scores())
    for label in ("all_earlier", "last", "line"):
        np.testing.assert_array_equal(first[label][:2], second[label][:2])
    assert second["last"][2] < first["last"][2] - 1.0


def test_the_first_month_has_a_map_if_the_record_begins_before_it():
    """The time before it is cut into pieces as long as the month, the last of which is the last month."""
    since = np.datetime64("2019-05-15", "ns")
    periods = Periods.of(START, END, since)
    assert periods.before == 2  # 31 days each
    assert periods.start[1] == np.datetime64("2019-07-01")
    assert np.isnan(means(maps_of(events(90)).scores())["last"][0])
    early = Places(START[:1] - 5 * DAY, np.array([[0.0, 0.0]]), np.ones(1))
    record = events(90)
    joined = Places(
        *(np.concatenate([getattr(one, name) for one in (early, record)]) for name in ("time", "place", "potency"))
    )
    known = replace(maps_of(record, None), record=joined, periods=periods)
    assert np.isfinite(means(known.scores())["last"][0])


def test_all_months_together_are_those_that_every_map_forecasts():
    """The first has no earlier one; maps that never have a forecast do not count."""
    scores = maps_of(events(300)).scores()
    np.testing.assert_array_equal(scores.common, scores.step > 0)
    own = scores.gain[:, scores.common].mean(axis=1)
    np.testing.assert_allclose(scores.mean(), own)


def test_a_month_whose_events_fall_on_odd_days_alone_counts():
    """The ceiling, which is no forecast, has no value there; such months were in no verdict."""
    record = events(900)
    day = (record.time - START[np.searchsorted(END, record.time, side="right")]) // DAY
    kept = (record.time < END[1]) | (day % 2 == 0)
    scores = maps_of(Places(record.time[kept], record.place[kept], record.potency[kept])).scores()
    np.testing.assert_array_equal(scores.common, scores.step > 0)
    mean = dict(zip(scores.labels, scores.mean(), strict=True))
    assert mean["ceiling"] == pytest.approx(scores.gain[scores.labels.index("ceiling")][scores.step == 1].mean())
    assert np.isfinite(list(mean.values())).all()


def test_models_are_scored_in_plan_and_mixed_half_with_the_record():
    """A model that is the record of the month gains more than the ceiling; the mixture lies above half of either."""
    record = events(300)
    maps = maps_of(record)
    model = Counted(np.column_stack([record.place, 1e4 * np.ones(300)]), maps.step, record.potency, np.zeros(300, int))
    scores = maps_of(record, models={"Pipeline": model}).scores()
    gain = means(scores)
    assert (gain["Pipeline"] > gain["ceiling"]).all()
    best = np.maximum(scores.gain[scores.labels.index("Pipeline")], scores.gain[scores.labels.index("all_earlier")])
    mixed = scores.gain[scores.labels.index("mixed")]
    known = np.isfinite(mixed)
    assert (mixed[known] >= best[known] - np.log(2.0) - 1e-9).all()
    assert (mixed[known] <= best[known] + 1e-9).all()
    lead = scores.lead("Pipeline", "all_earlier")
    assert lead.interval[0] < lead.value < lead.interval[1]


def test_nuisances_begin_with_the_gain_as_stated_and_change_it():
    """A wider smoothing lowers the gain of a record in a narrow band."""
    maps = maps_of(events(300))
    found = dict(nuisances(maps))
    np.testing.assert_allclose(found["as stated"], maps.scores().mean())
    assert found["uniform share 20 %"][0] < found["as stated"][0]
    assert found["twice the location error"][0] != found["as stated"][0]
