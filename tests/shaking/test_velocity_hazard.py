"""The velocity that is exceeded with a chance: closed forms, quadrature, Monte Carlo, and what must not change it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import ndtr, ndtri
from scipy.stats import nbinom

from catalogs.compare.exposure import total_interval
from plans.hazard import chance_of
from shaking.hazard import Shaking, disaggregate, expected_interval
from shaking.relations import GroundMotion

CHANCES = np.array([0.5, 0.1, 0.02])


def shaking(log_median, deviation=0.3, runs=1, **others) -> Shaking:
    median = np.asarray(log_median, float)
    expected = others.pop("expected", len(median) / runs)
    return Shaking(median, np.full(len(median), deviation), runs, expected, **others)


def test_one_source_in_closed_form():
    """One event expected, of median v0: chance 1 - exp(-p), p = 1 - Phi(log10(v / v0) / sigma)."""
    one = shaking([np.log10(0.2)], 0.25)
    velocity = one.velocity(CHANCES)[:, 0]
    share = -np.log1p(-CHANCES)  # p that the chance asks for
    np.testing.assert_allclose(velocity, 0.2 * 10.0 ** (-0.25 * ndtri(share)), rtol=1e-5)
    np.testing.assert_allclose(one.chance(one.rates(np.log10(velocity))[:, 0]), CHANCES, rtol=1e-4)


def test_one_source_without_scatter_is_its_median_or_nothing():
    """A chance above 1 - 1/e asks for more events than the one that is expected."""
    np.testing.assert_allclose(
        shaking([np.log10(0.2)], 0.0).velocity(np.array([0.9, 0.63, 0.01]))[:, 0], [0.0, 0.2, 0.2], rtol=1e-5
    )


def line(spacing: float, density: float, offset: float, reach: float, relation: GroundMotion, size: float) -> Shaking:
    """Events along a line that passes at a distance (m), `density` of them by metre."""
    along = np.arange(-reach + 0.5 * spacing, reach, spacing)
    distance = np.hypot(along, offset)
    runs = round(1.0 / (density * spacing))  # each counts as so much less than one event
    return Shaking(
        relation.log_median(size, distance), relation.deviation(size, distance), runs, 2.0 * reach * density
    )  # fmt: skip


def test_a_line_of_sources_in_closed_form():
    """Without scatter v is exceeded by events nearer than R(v): 2 density sqrt(R^2 - offset^2) of them on average."""
    relation = GroundMotion("site", "mw", -1.0, 0.5, 1.0, 0.0, nearest=1.0)
    many = line(0.05, 0.01, 20.0, 1000.0, relation, 2.0)
    velocity = np.array([0.002, 0.003, 0.0045])
    radius = 10.0 ** ((-1.0 + 0.5 * 2.0 - np.log10(velocity)) / 1.0)
    expected = 2.0 * 0.01 * np.sqrt(radius**2 - 20.0**2)
    np.testing.assert_allclose(many.rates(np.log10(velocity))[:, 0], expected, rtol=1e-3)
    # and the velocity of a chance, from the radius that has so many events within
    decay = -np.log1p(-CHANCES)
    at = 1.0 / np.hypot(decay / 0.02, 20.0)
    np.testing.assert_allclose(many.velocity(CHANCES)[:, 0], at, rtol=2e-3)


def test_a_line_of_sources_with_scatter_is_the_integral():
    """The sum over events against the integral over the line, of a relation that saturates."""
    relation = GroundMotion("site", "mw", -0.5, 0.4, 1.3, 0.35, length=4.0, exponent=0.5)
    many = line(0.1, 0.02, 15.0, 2000.0, relation, 1.2)

    def density(along: float, velocity: float) -> float:
        median = relation.log_median(1.2, np.hypot(along, 15.0))
        return 0.02 * float(ndtr((median - np.log10(velocity)) / 0.35))

    for velocity in (0.002, 0.01, 0.05):
        expected = 2.0 * quad(density, 0.0, 2000.0, args=(velocity,), limit=200)[0]
        assert many.rates(np.log10([velocity]))[0, 0] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("dispersion", [1.0, 3.0])
def test_steps_that_are_drawn_exceed_the_velocity_as_often_as_it_says(dispersion):
    """Numbers of events Poisson or negative binomial, events drawn with replacement, each with its own scatter."""
    generator = np.random.default_rng(7)
    median = np.log10(0.05) + 0.5 * generator.standard_normal(60)
    step = shaking(median, 0.3, runs=5, dispersion=dispersion)
    velocity = np.log10(step.velocity(CHANCES)[:, 0])
    steps, mean = 20_000, step.expected
    if dispersion > 1.0:
        number = nbinom.rvs(mean / (dispersion - 1.0), 1.0 / dispersion, size=steps, random_state=generator)
    else:
        number = generator.poisson(mean, steps)
    of_step = np.repeat(np.arange(steps), number)
    felt = generator.choice(median, len(of_step)) + 0.3 * generator.standard_normal(len(of_step))
    largest = np.full(steps, -np.inf)
    np.maximum.at(largest, of_step, felt)
    for at, chance in zip(velocity, CHANCES, strict=True):
        assert np.mean(largest > at) == pytest.approx(chance, abs=4.0 * np.sqrt(chance * (1.0 - chance) / steps))


@given(st.floats(0.001, 0.99), st.floats(1.0, 20.0), st.floats(0.01, 1e4))
def test_the_rate_of_a_chance_is_the_inverse_of_the_chance(chance, dispersion, expected):
    one = shaking([0.0], dispersion=dispersion, expected=expected)
    rate = float(one.rate_of(chance))
    if rate < 1e100:  # more is asked for than so few events can give
        assert one.chance(rate) == pytest.approx(chance, rel=1e-6)


def test_chances_are_those_of_the_plans():
    one = shaking([0.0], dispersion=2.5, expected=30.0)
    assert one.chance(1.2) == pytest.approx(float(chance_of(np.array(30.0), np.array(1.2 / 30.0), 2.5)), rel=1e-12)


@given(st.lists(st.floats(1e-6, 1.0), min_size=1, max_size=40), st.floats(1.0, 5.0))
def test_the_interval_is_that_of_any_sum_of_sizes(sizes, dispersion):
    weight = np.array(sizes)
    found = expected_interval(weight.sum(), np.sum(weight**2), weight.max(), dispersion)
    np.testing.assert_allclose(found, total_interval(weight, dispersion), rtol=1e-9)


def test_the_interval_holds_the_truth_as_often_as_it_says():
    """Catalogues of a known process, each with its own interval of the velocity."""
    generator = np.random.default_rng(11)
    law = np.log10(0.05) + 0.4 * generator.standard_normal(4000)  # events that the process draws from
    truth = Shaking(law, np.full(len(law), 0.3), 100, 40.0).velocity(CHANCES[1:2])[0, 0]
    held, alone = 0, 0
    for _ in range(300):
        drawn = generator.choice(law, generator.poisson(40.0))
        low, high = shaking(drawn, 0.3, strongest=(float(law.max()), 0.3)).velocity(CHANCES[1:2])[0, 1:]
        held += low <= truth <= high
        low, high = shaking(drawn, 0.3).velocity(CHANCES[1:2])[0, 1:]
        alone += low <= truth <= high
    assert held / 300 >= 0.95
    assert alone / 300 < 0.8  # the largest and nearest events are often lacking: what `strongest` is for


@hypothesis_settings(deadline=None)
@given(st.lists(st.floats(-3.0, -0.5), min_size=1, max_size=30), st.randoms(), st.floats(0.2, 5.0))
def test_order_copies_and_units_change_nothing(medians, random, factor):
    """Events in another order; members that repeat the run; all velocities times a factor."""
    first = shaking(medians).velocity(CHANCES)
    shuffled = list(medians)
    random.shuffle(shuffled)
    np.testing.assert_allclose(shaking(shuffled).velocity(CHANCES)[:, 0], first[:, 0], rtol=1e-4)
    twice = shaking([*medians, *medians], runs=2).velocity(CHANCES)
    np.testing.assert_allclose(twice[:, 0], first[:, 0], rtol=1e-4)
    assert np.all(twice[:, 2] <= first[:, 2] * (1.0 + 1e-4))  # two runs say more than one
    scaled = shaking(np.array(medians) + np.log10(factor)).velocity(CHANCES)
    np.testing.assert_allclose(scaled, factor * first, rtol=1e-3, atol=2e-5)
    assert np.all(first[:, 1] <= first[:, 0] * (1.0 + 1e-9))
    assert np.all(first[:, 2] >= first[:, 0] * (1.0 - 1e-9))


def test_more_events_clustering_and_a_cap():
    """More events shake more; clustering at one rate shakes less often; no velocity is above the largest."""
    medians = np.linspace(-2.0, -1.0, 20)
    base = shaking(medians).velocity(CHANCES)[:, 0]
    assert np.all(shaking(np.tile(medians, 3)).velocity(CHANCES)[:, 0] > base)
    assert np.all(shaking(medians, dispersion=6.0).velocity(CHANCES)[:, 0] < base)
    capped = shaking(medians, log_largest=np.log10(0.1)).velocity(CHANCES)
    assert capped[1:, 2] == pytest.approx(0.1, rel=1e-4)
    assert np.all(capped <= 0.1 * (1.0 + 1e-6))


def test_no_event_is_no_velocity():
    found = shaking([], expected=0.0).velocity(CHANCES)
    assert found[:, :2].tolist() == [[0.0, 0.0]] * 3
    assert np.isnan(found[:, 2]).all()
    quiet = shaking([], expected=0.0, strongest=(-1.0, 0.3)).velocity(CHANCES)  # other steps have events
    assert quiet[:, :2].tolist() == [[0.0, 0.0]] * 3
    assert np.all(np.diff(quiet[:, 2]) > 0.0)


def test_classes_share_all_of_the_weight():
    """Values beyond the edges count in the outer classes."""
    weight = np.array([1.0, 2.0, 3.0, 4.0])
    edges = np.array([0.0, 1.0, 2.0]), np.array([0.0, 10.0, np.inf])
    shares = disaggregate(weight, np.array([-0.5, 0.5, 1.0, 5.0]), np.array([1.0, 20.0, 9.0, 1e6]), edges)
    np.testing.assert_allclose(shares, [[0.1, 0.2], [0.3, 0.4]])
    assert disaggregate(np.zeros(1), np.zeros(1), np.zeros(1), edges).sum() == 0.0
