import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some
from scipy.spatial.transform import Rotation

from catalogs.report.sections import axes as section
from catalogs.sources import mechanisms as m
from catalogs.sources.mechanisms import CLUSTER, GIRDLE, UNIFORM, MeanAxis, describe_axes
from common.source_tensors import clear_axes, point_down, principal_axes

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
    found = common(scattered(generator, mean, 4000, 15.0))
    assert m.angle_between_axes(found.mean, mean) < 1.0
    assert found.shape == CLUSTER
    assert 0.8 < found.values[0] < 0.95
    np.testing.assert_allclose(common(np.tile(mean, (5, 1))).values, [1.0, 0.0, 0.0], atol=1e-12)
    uniform = common(m.random_frames(2000, generator)[:, 0])
    np.testing.assert_allclose(uniform.values, 1 / 3, rtol=0.1)
    assert uniform.shape == UNIFORM
    assert np.isnan(uniform.mean).all()


def common(axes: np.ndarray, each: int = 1) -> MeanAxis:
    """What axes have in common, `each` of a block."""
    return describe_axes(axes, np.arange(len(axes)) // each, blocks_known=True)


def test_uniform_axes_are_taken_for_a_pattern_in_5_of_100_cases():
    """Of 400 samples of 40 axes; and no more often if axes come as twenty pairs of one direction."""
    generator = np.random.default_rng(7)
    alone = [common(m.random_frames(40, generator)[:, 0]).shape for _ in range(400)]
    pairs = [common(np.repeat(m.random_frames(20, generator)[:, 0], 2, axis=0), 2).shape for _ in range(400)]
    assert 0.02 <= np.mean(np.array(alone) != UNIFORM) <= 0.08
    assert np.mean(np.array(pairs) != UNIFORM) <= 0.08


def test_a_long_but_tight_cluster_has_a_mean():
    """Eigenvalues of 0.70, 0.25 and 0.06: K is 0.73, and the mean is well known all the same."""
    axes = np.random.default_rng(9).normal(size=(400, 3)) * np.sqrt([0.9, 0.15, 0.02])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    found = common(axes)
    assert found.woodcock < 1.0
    assert found.shape == CLUSTER
    assert m.angle_between_axes(found.mean, np.array([1.0, 0, 0])) < 5.0


def test_a_girdle_has_a_pole_and_no_mean():
    """Axes all round a horizontal line to the north-east, 10 degrees off its plane: Woodcock's K below 1, the pole
    found, no mean axis, no angle, and on the net a great circle instead of a star."""
    generator = np.random.default_rng(8)
    pole = m.axis_from_trend_plunge(45.0, 0.0)
    across = np.stack([np.cross(pole, [0, 0, 1.0]), [0, 0, 1.0]])
    turn = generator.uniform(0, np.pi, 200)
    axes = np.stack([np.cos(turn), np.sin(turn)], axis=1) @ across
    axes += np.radians(10) * generator.normal(size=(200, 1)) * pole
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    found = common(axes)
    assert found.shape == GIRDLE
    assert found.woodcock < 0.5
    assert m.angle_between_axes(found.pole, pole) < 3.0
    assert np.isnan(found.mean).all()
    frames = np.stack([axes, np.tile(pole, (200, 1)), np.cross(axes, pole)], axis=1)
    sample = m.AxesSample(frames, generator.normal(size=(200, 3)), np.arange(200))
    result = m.compare_axes(sample, sample, resamplings=99)
    assert np.isnan(result["mean_angle"][[0, 2]]).all()
    assert np.isfinite(result["mean_angle_interval"][1]).all()
    names = ("mean_trend", "mean_plunge", "mean_cone", "axis_shape", "pole_trend", "pole_plunge")
    net = section.Axes("m", "k", "Blues", frames.transpose(1, 0, 2), *(result[name][0] for name in names))
    legends = [axes.get_legend() for axes in section.stereonets([net]).axes]
    drawn = [legend.get_texts()[0].get_text() for legend in legends if legend is not None]
    assert [text.split()[0] for text in drawn] == ["girdle,", "mean", "girdle,"]
    assert drawn[0] == f"girdle, pole {m.direction(*m.trend_plunge(found.pole))}"


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


def crack_sample(generator, count, normal, spread=3.0):
    """Sources that merely open, their normals about one direction, as clear axes have them; far from each other."""
    normals = scattered(generator, normal, count, spread)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    axes = clear_axes(normals[:, :, None] * normals[:, None, :])
    return m.AxesSample(axes, generator.normal(size=(count, 3)), np.arange(count))


def test_cracks_of_one_direction_are_compared_by_their_clear_axis_alone():
    """T axes of two catalogues agree; what lies across them is no axis, so there is no Kagan angle and no mean P."""
    generator = np.random.default_rng(0)
    samples = [crack_sample(generator, 40, np.array([0.6, 0.0, 0.8])) for _ in range(2)]
    found = m.compare_axes(*samples, resamplings=99)
    assert found["mean_angle"][2] < 2.0
    assert found["mean_angle_interval"][2][0] == 0.0
    assert np.isnan(found["mean_angle"][:2]).all()
    assert np.isnan(found["mean_cone"][:, :2]).all()
    assert np.isnan(found["mean_angle_p_value"][:2]).all()
    assert np.isnan(found["kagan_median"][:3]).all()
    assert samples[0].clear_share(np.ones(40)).tolist() == [0.0, 0.0, 1.0]


def test_sources_without_clear_axes_change_nothing_for_the_others():
    """Twenty shear sources, with and without twenty explosions beside them: the same means and Kagan angles."""
    generator = np.random.default_rng(1)
    shear = m.AxesSample(m.random_frames(20, generator), generator.normal(size=(20, 3)), np.arange(20))
    none = np.full((20, 3, 3), np.nan)
    mixed = m.AxesSample(
        np.concatenate([shear.axes, none]), np.concatenate([shear.location, np.zeros((20, 3))]), np.arange(40)
    )
    record = m.AxesSample(m.random_frames(30, generator), generator.normal(size=(30, 3)), np.arange(30))
    alone, beside = (m.compare_axes(one, record, resamplings=99) for one in (shear, mixed))
    for name in ("mean_axis", "axis_eigenvalue", "mean_angle", "kagan_median", "kagan_share"):
        np.testing.assert_allclose(beside[name][:2], alone[name][:2], atol=1e-12)
    assert mixed.clear_share(np.ones(40)).tolist() == [0.5] * 3


@pytest.mark.parametrize(
    ("p", "t", "planes"),
    [
        (
            "north",
            "east",
            [(45, 90, 0), (315, 90, 180)],
        ),  # strike-slip: left-lateral on north-east, right on north-west
        ("down", "east", [(0, 45, -90), (180, 45, -90)]),  # normal
        ("east", "down", [(0, 45, 90), (180, 45, 90)]),  # reverse
    ],
)
def test_nodal_planes_of_textbook_faults(p, t, planes):
    """Strike, dip and rake as textbooks draw them; a plane whose dip is 90 is also the one of the opposite strike."""
    axis = {"north": [0.0, 1.0, 0.0], "east": [1.0, 0.0, 0.0], "down": [0.0, 0.0, -1.0]}
    found = m.nodal_planes(axis[p], axis[t])
    vertical = np.isclose(found[:, 1], 90.0)
    strike = np.where(vertical, found[:, 0] % 180.0, found[:, 0])
    wanted = np.array(planes, float)
    wanted[vertical, 0] %= 180.0
    order, expected = np.argsort(strike), np.argsort(wanted[:, 0])
    np.testing.assert_allclose(strike[order], wanted[expected, 0], atol=1e-9)
    np.testing.assert_allclose(found[order, 1], wanted[expected, 1], atol=1e-9)
    np.testing.assert_allclose(np.cos(np.radians(found[order, 2] - wanted[expected, 2])), 1.0, atol=1e-12)


def test_a_level_nodal_plane_strikes_north_by_convention():
    """Slip to the east on a level plane, the other one upright: P and T dip by 45 degrees."""
    found = m.nodal_planes(np.array([1.0, 0.0, -1.0]) / np.sqrt(2), np.array([-1.0, 0.0, -1.0]) / np.sqrt(2))
    level = found[np.argmin(found[:, 1])]
    np.testing.assert_allclose(level[:2] % 360.0, [0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(np.abs(level[2]), 90.0, atol=1e-9)
    np.testing.assert_allclose(np.max(found[:, 1]), 90.0, atol=1e-9)


def test_parallel_axes_have_a_mean_however_they_are_rounded():
    """As the B axes of a plane-strain scene: they were taken for axes without a direction."""
    generator = np.random.default_rng(4)
    angle = generator.uniform(0.0, np.pi, 200)
    p_axis = np.stack([np.cos(angle), np.zeros(200), np.sin(angle)], axis=1)
    t_axis = np.stack([-np.sin(angle), np.zeros(200), np.cos(angle)], axis=1)
    tensor = t_axis[:, :, None] * t_axis[:, None, :] - p_axis[:, :, None] * p_axis[:, None, :]
    for turn in (0.0, 30.0):
        turned = Rotation.from_euler("z", turn, degrees=True).as_matrix()
        b_axis = clear_axes(turned @ tensor @ turned.T)[:, 1]
        found = describe_axes(b_axis, np.arange(200), True)
        assert found.shape == CLUSTER
        assert abs(found.mean @ turned[:, 1]) == pytest.approx(1.0)
