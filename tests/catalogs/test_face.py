"""A face that moves: where it stands, places relative to it, and both catalogues against it."""

import numpy as np
import pytest
from catalog_fixtures import made_up_catalog
from hypothesis import given, settings
from hypothesis import strategies as st

from catalogs.compare.comparison import compare
from catalogs.compare.face import Face
from catalogs.compare.face_measures import MEASURES, UNIFORM_PLACES, WEIGHTS
from catalogs.compare.locations import UNIFORM_SHARE
from catalogs.settings import FacePosition, FaceSettings
from common.errors import InputErrors

# Panel a advances east by 120 m in 31 days, stands still for 30, and advances again. Panel b is mined later, northward.
LONGWALL = [
    {"date": "2019-08-01", "panel": "a", "ends": [[0.0, 0.0], [0.0, 200.0]]},
    {"date": "2019-09-01", "panel": "a", "ends": [[120.0, 0.0], [120.0, 200.0]]},
    {"date": "2019-10-01", "panel": "a", "ends": [[120.0, 0.0], [120.0, 200.0]]},
    {"date": "2019-10-11", "panel": "a", "ends": [[150.0, 0.0], [150.0, 200.0]]},
    {"date": "2019-12-01", "panel": "b", "ends": [[300.0, 50.0], [500.0, 50.0]]},
    {"date": "2020-01-01", "panel": "b", "ends": [[300.0, 80.0], [500.0, 80.0]]},
]
MONTHLY = [
    {"date": date, "ends": [[x, 0.0], [x, 200.0]]}
    for date, x in (("2019-08-01", 0.0), ("2019-09-01", 120.0), ("2019-10-01", 300.0))
]
TUNNEL = [
    {"date": "2019-08-01", "ends": [0.0, 0.0]},
    {"date": "2019-09-01", "ends": [0.0, 30.0]},
    {"date": "2019-10-01", "ends": [40.0, 60.0]},
]


def face_of(positions) -> Face:
    return Face.of([FacePosition.of(one) for one in positions])


def times(*texts: str) -> np.ndarray:
    return np.array(texts, "datetime64[ns]")


def moved(positions, change) -> list[dict]:
    """The positions with every point changed."""
    return [one | {"ends": [list(change(np.array(end))) for end in one["ends"]]} for one in positions]


def test_ahead_and_across_of_a_longwall():
    """Half of the way after half of the time; ahead is east, across counts from the middle toward the second end."""
    frame = face_of(LONGWALL).at(times("2019-08-16T12:00", "2019-09-15"))
    np.testing.assert_allclose(frame.middle, [[60.0, 100.0], [120.0, 100.0]])
    places = np.array([[75.0, 190.0, -500.0], [100.0, 100.0, 0.0]])  # elevation does not count
    np.testing.assert_allclose(frame.coordinates(places), [[15.0, 90.0], [-20.0, 0.0]])


def test_a_face_that_begins_by_standing_still_looks_to_where_it_will_go():
    """Also one that stands still between two advances, which looks to where it went before."""
    still = [LONGWALL[0], LONGWALL[0] | {"date": "2019-08-15"}, *LONGWALL[1:4]]
    frame = face_of(still).at(times("2019-08-10", "2019-09-15"))
    np.testing.assert_allclose(frame.ahead, [[1.0, 0.0], [1.0, 0.0]])


def test_there_is_no_face_outside_of_the_dates_of_panels():
    """Nor between two panels; the later panel looks north."""
    frame = face_of(LONGWALL).at(times("2019-07-31", "2019-11-01", "2019-12-16T12:00", "2020-01-02"))
    assert np.isnan(frame.ahead).any(axis=1).tolist() == [True, True, False, True]
    np.testing.assert_allclose(frame.ahead[2], [0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(frame.middle[2], [400.0, 65.0])


def test_a_tunnel_looks_along_its_centre_line():
    """Across is positive to the left of the advance."""
    frame = face_of(TUNNEL).at(times("2019-08-16T12:00", "2019-09-16"))
    np.testing.assert_allclose(frame.coordinates(np.array([[-3.0, 20.0], [20.0, 45.0]]))[0], [5.0, 3.0])
    np.testing.assert_allclose(frame.coordinates(np.array([[0.0, 0.0], [20.0, 45.0]]))[1], [0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(frame.ahead[1], [0.8, 0.6])


def test_metres_are_the_way_of_the_middle():
    """Over parts of intervals and standing faces; all panels together."""
    face = face_of(LONGWALL)
    assert face.metres(*times("2019-08-01", "2019-10-11")) == pytest.approx(150.0)
    assert face.metres(*times("2019-08-16T12:00", "2019-10-06")) == pytest.approx(60.0 + 15.0)
    assert face.metres(*times("2019-11-01", "2019-11-20")) == 0.0
    assert face.metres(*times("2019-01-01", "2021-01-01")) == pytest.approx(180.0)


@settings(deadline=None, max_examples=30)
@given(
    angle=st.floats(0.0, 2.0 * np.pi),
    shift=st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)),
    mirrored=st.booleans(),
)
def test_rotated_shifted_and_mirrored_mines_have_the_same_coordinates(angle, shift, mirrored):
    """A face with two ends names the side that across is positive on."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turn = turn @ np.diag([1.0, -1.0 if mirrored else 1.0])

    def change(place):
        return place @ turn.T + np.array(shift)

    when = times("2019-08-05", "2019-08-25", "2019-10-05", "2019-12-15")
    places = np.random.default_rng(1).uniform(-300.0, 600.0, (4, 2))
    own = face_of(LONGWALL).at(when).coordinates(places)
    other = face_of(moved(LONGWALL, change)).at(when)
    np.testing.assert_allclose(other.coordinates(change(places)), own, atol=1e-6)
    np.testing.assert_allclose(other.places(own), change(places), atol=1e-6)


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({}, "face: give either positions, or source and folder"),
        ({"source": "elk_creek"}, "face.folder: stands without the other of source and folder; give both"),
        (
            {"positions": [LONGWALL[1], LONGWALL[0]]},
            "face.positions: 2019-08-01 of panel 'a' does not come after the position before it; order them",
        ),
        (
            {"positions": [LONGWALL[1], LONGWALL[2]]},
            "face.positions: those of panel 'a' do not move; give two places at least, which tell what lies ahead",
        ),
        (
            {"positions": [TUNNEL[0], {"date": "2019-09-01", "ends": [[0.0, 0.0], [5.0, 0.0]]}]},
            "face.positions: some have two ends and some are one point; give all in one form",
        ),
        (
            {"positions": [{"date": "2019-02-30", "ends": [0.0, 0.0]}, TUNNEL[1]]},
            "face.positions[0].date: '2019-02-30' is no date; give one such as 2019-08-31",
        ),
        (
            {"positions": [{"date": "2019-08-01", "ends": [[1.0, 1.0], [1.0, 1.0]]}, TUNNEL[1]]},
            "face.positions[0].ends: both ends are one point; give different ones, or the point alone",
        ),
    ],
)
def test_mistakes_are_refused_in_a_line(values, line):
    """With the key, and what to do."""
    with pytest.raises(InputErrors) as refused:
        FaceSettings.of(values, "face")
    assert str(refused.value).splitlines() == [line]


STEPS = [
    {"name": "2019-08", "start": "2019-08-01", "end": "2019-09-01"},
    {"name": "2019-09", "start": "2019-09-01", "end": "2019-10-01"},
]


def against(positions, ahead: float, count: int = 400, shift=(0.0, 0.0), turn=None, members: int = 0, error=3.0):
    """Comparison of a model whose events cluster so far ahead of the face with a record 30 m behind it, both with
    a third of the number and most of the potency at the second end of the face (+50 m across)."""

    def catalogue(seed: int, offset: float, kind: str):
        events = made_up_catalog(count, seed, kind)
        generator = np.random.default_rng(seed)
        across = np.where(np.arange(count) % 3 == 0, 50.0, -50.0)
        end = times(*(step["end"] for step in STEPS))
        time = events["time"].values
        step = np.minimum(np.searchsorted(end, time, side="right"), 1)
        frame = face_of(MONTHLY).at(end[step])
        plan = frame.places(np.stack([offset + 5.0 * generator.normal(size=count), across], axis=1))
        if turn is not None:
            plan = plan @ turn.T + np.array(shift)
        events["location"].values[:] = np.column_stack([plan, generator.normal(size=count)])
        events["potency"].values[:] *= np.where(across > 0.0, 100.0, 1.0)
        events.attrs |= {"location_error": error}
        return events

    record = catalogue(1, -30.0, "twin")
    record.attrs.pop("potency_floor", None)
    asked = {"resamplings": 99, "steps": STEPS, "face": positions, "members": members}
    return compare(
        catalogue(0, ahead, "synthetic"), record, asked, [catalogue(9 + n, ahead, "synthetic") for n in range(members)]
    )


def measure(result, name: str, catalogue: str, weight: str = "number") -> float:
    return float(result["face_measure"].sel(catalogue=catalogue, measure=name, weight=weight))


def test_both_catalogues_are_measured_where_they_were_put():
    """Medians, share ahead and width are those of the events; potency weighs the heavier side."""
    result = against(MONTHLY, 20.0)
    assert measure(result, "median ahead", "record") == pytest.approx(-30.0, abs=1.0)
    assert measure(result, "median ahead", "model") == pytest.approx(20.0, abs=2.0)
    assert measure(result, "share ahead", "record") == 0.0
    assert measure(result, "share ahead", "model") > 0.95
    assert measure(result, "half width", "record") == pytest.approx(50.0)
    assert measure(result, "median across", "record") == pytest.approx(-50.0)
    assert measure(result, "median across", "record", "potency") == pytest.approx(50.0)
    assert result["face_events"].values.tolist() == result["events_above_cut"].values.tolist()
    assert result["record_face_weight"].sum("event_face_record").values == pytest.approx(1.0)
    assert result["model_face_weight"].sum("event_face_model").values == pytest.approx(1.0)


def test_modelled_events_have_the_location_error_and_a_uniform_share():
    """5 m of their own and 30 m / sqrt(3) along each axis; a twentieth of the weight lies anywhere."""
    result = against(MONTHLY, 20.0, error=30.0)
    weights = result["model_face_weight"].sel(weight="number").values
    is_uniform = np.arange(len(weights)) >= len(weights) - UNIFORM_PLACES
    assert weights[is_uniform].sum() == pytest.approx(UNIFORM_SHARE)
    ahead = result["model_face"].sel(face_axis="ahead").values[~is_uniform]
    assert ahead.std() == pytest.approx(np.hypot(5.0, 30.0 / np.sqrt(3.0)), rel=0.07)


def test_intervals_come_from_clusters_of_the_record_and_runs_of_the_model():
    """One run has no interval of the model; three have one that holds the value."""
    one, three = against(MONTHLY, 20.0), against(MONTHLY, 20.0, members=2)
    ends = one["face_measure_interval"]
    assert np.isfinite(ends.sel(catalogue="record")).all()
    assert np.isnan(ends.sel(catalogue="model")).all()
    low, high = three["face_measure_interval"].sel(catalogue="model", measure="median ahead", weight="number").values
    assert low <= measure(three, "median ahead", "model") <= high


def test_a_turned_and_mirrored_mine_has_the_same_measures():
    """Of the record to round-off; of the model but for the random errors and the box of its uniform share."""
    turn = np.array([[0.0, 1.0], [1.0, 0.0]])  # a mirror on the diagonal
    own = against(MONTHLY, 20.0)
    other = against(moved(MONTHLY, lambda place: place @ turn.T + 500.0), 20.0, shift=(500.0, 500.0), turn=turn)
    for name in MEASURES:
        for weight in WEIGHTS:
            assert measure(other, name, "record", weight) == pytest.approx(
                measure(own, name, "record", weight), abs=1e-6
            )
            assert measure(other, name, "model", weight) == pytest.approx(measure(own, name, "model", weight), abs=3.0)


def test_events_of_steps_without_a_face_do_not_count():
    """The panel ends with the first step."""
    result = against(MONTHLY[:2], 20.0)
    assert 0 < result["face_events"].sel(catalogue="record") < result["events_above_cut"].sel(catalogue="record")


def test_no_face_no_measure():
    """And none of its variables."""
    events = made_up_catalog(100)
    record = made_up_catalog(100, 1, "twin")
    assert not [name for name in compare(events, record, {"resamplings": 99}).variables if "face" in name]
