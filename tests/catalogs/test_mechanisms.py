import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some
from scipy.spatial.transform import Rotation

from catalogs import mechanisms as m
from pipeline.source_tensors import point_down, principal_axes

UNIT = some.integers(0, 2**32 - 1).map(np.random.default_rng)


def test_axes_of_a_known_strike_slip():
    """East-west extension, north-south shortening: P trends north, T east, B vertical."""
    trend, plunge = m.trend_plunge(principal_axes(np.diag([2.0, -2.0, 0.0])))
    assert trend[0] == pytest.approx(0.0)
    assert trend[2] == pytest.approx(90.0)
    np.testing.assert_allclose(plunge, [0.0, 90.0, 0.0], atol=1e-12)


@given(UNIT)
def test_trend_and_plunge_of_an_axis_give_it_back(generator):
    axes = point_down(m.random_frames(5, generator))
    np.testing.assert_allclose(m.axis_from_trend_plunge(*m.trend_plunge(axes)), axes, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-5, 30.0, 60.0, 90.0])
@pytest.mark.parametrize("about", [0, 1, 2])
def test_kagan_angle_of_a_turn_about_one_axis(angle, about):
    """About P, B or T a turn of up to 90 degrees is the least there is; a half turn changes nothing."""
    start = Rotation.random(random_state=1).as_matrix()
    turned = start @ Rotation.from_rotvec(np.radians(angle) * start[about]).as_matrix().T
    assert m.kagan_angle(start, turned) == pytest.approx(angle, abs=1e-6)
    half = start @ Rotation.from_rotvec(np.pi * start[about]).as_matrix().T
    assert m.kagan_angle(half, turned) == pytest.approx(angle, abs=1e-6)


def test_kagan_angle_is_120_at_most_for_axes_exchanged_in_a_ring():
    """P -> B -> T -> P is a third of a turn about (1, 1, 1): 120 degrees, the largest there is."""
    assert m.kagan_angle(np.eye(3), np.eye(3)[[1, 2, 0]]) == pytest.approx(120.0)
    angles = m.kagan_angle(m.random_frames(20_000, np.random.default_rng(0)), np.eye(3))
    assert angles.max() <= 120.0
    assert angles.mean() == pytest.approx(75.2, abs=0.5)  # Kagan (1991): uniformly random double couples


@given(UNIT)
def test_kagan_angle_is_symmetric_blind_to_sense_and_as_slow_search_says(generator):
    first, second = m.random_frames(2, generator)
    angle = m.kagan_angle(first, second)
    assert m.kagan_angle(second, first) == pytest.approx(angle, abs=1e-6)
    assert m.kagan_angle(-first, second * np.array([[1.0], [-1.0], [1.0]])) == pytest.approx(angle, abs=1e-6)
    search = []
    for turn in (np.eye(3), *(Rotation.from_rotvec(np.pi * axis).as_matrix() for axis in second)):
        search.append(np.degrees(Rotation.from_matrix((second @ turn.T).T @ first).magnitude()))
    assert angle == pytest.approx(min(search), abs=1e-5)


def scattered(generator, mean, count, spread):
    """Axes around `mean` with a normal scatter of `spread` degrees in each direction, of random sense."""
    axes = mean + np.radians(spread) * generator.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return axes * generator.choice([-1, 1], size=(count, 1))


def test_mean_axis_ignores_sense_and_measures_concentration():
    generator = np.random.default_rng(2)
    mean = m.axis_from_trend_plunge(160.0, 10.0)
    found, strength = m.mean_axis(scattered(generator, mean, 4000, 15.0))
    assert m.angle_between_axes(found, mean) < 1.0
    assert 0.8 < strength < 0.95
    assert m.mean_axis(np.tile(mean, (5, 1)))[1] == pytest.approx(1.0)
    assert m.mean_axis(m.random_frames(20_000, generator)[:, 0])[1] == pytest.approx(1 / 3, rel=0.05)


def test_cone_holds_the_true_axis_95_times_in_100():
    """120 catalogues of 60 events in 20 blocks: the 95 % bootstrap cone of the mean P axis holds the truth in 95 %
    (3 standard errors: 6 %; 20 blocks make a bootstrap a little small, so up to 2 % more may be missed)."""
    generator = np.random.default_rng(3)
    truth = Rotation.random(random_state=5).as_matrix()
    held = 0
    for index in range(120):
        turns = Rotation.from_rotvec(np.radians(15) * generator.normal(size=(60, 3))).as_matrix()
        axes = point_down(np.einsum("ai,eji->eaj", truth, turns))
        sample = m.AxesSample(axes, generator.normal(size=(60, 3)), np.arange(60) // 3)
        found = m.compare_axes(sample, sample, seed=index, resamplings=150)
        held += m.angle_between_axes(found["mean_axis"][0, 0], truth[0]) <= found["mean_cone"][0, 0]
    assert 0.87 <= held / 120 <= 1.0


def test_turned_catalogue_shows_its_turn():
    """The same events turned by 40 degrees about the vertical: mean P and T axes 40 degrees apart, B (vertical to
    half a degree, the scatter of 80 events) where it was."""
    generator = np.random.default_rng(4)
    turns = Rotation.from_rotvec(np.radians(5) * generator.normal(size=(80, 3))).as_matrix()
    axes = np.einsum("ai,eji->eaj", np.array([[0, 1.0, 0], [0, 0, 1.0], [1.0, 0, 0]]), turns)
    whole = Rotation.from_euler("z", 40, degrees=True).as_matrix()
    first = m.AxesSample(point_down(axes), generator.normal(size=(80, 3)), np.arange(80) // 4)
    second = m.AxesSample(point_down(axes @ whole.T), first.location, first.blocks)
    found = m.compare_axes(first, second, seed=1, resamplings=200)
    np.testing.assert_allclose(found["mean_angle"], [40, 0, 40], atol=0.6)
    assert found["kagan_median"][1] == pytest.approx(40, abs=1.0)  # nearest: each event with itself, turned
    assert found["kagan_median"][2] < 15
    np.testing.assert_allclose(found["kagan_share"].sum(axis=1), 1.0)
    low, high = found["mean_angle_interval"][0]
    assert low < 40 < high < 46
