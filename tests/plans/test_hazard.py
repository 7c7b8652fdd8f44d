"""Chances and forecasts against known rates and laws, and in closed form where there is one."""

from types import SimpleNamespace

import numpy as np
import pytest
from plan_fixtures import STEPS
from scipy.stats import kstest, nbinom, poisson

from catalogs.run_numbers import run_dispersion, widened
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.sizes import LN10, estimate_b
from catalogs.sources.truncated_law import TruncatedLaw, draw_law
from plans.factors import DRIFT, STEP_SCATTER, Factors, draw_levels, find_factors, steps_of_plan
from plans.hazard import chance_of, chances, draw_expected, draw_numbers
from plans.record import MONTH, RecordedNumbers
from plans.runs import StepResult
from plans.size_law import independent_share, size_law
from verification.answers.statistics.samples import simulated_sizes

ONE = np.ones(1)


def exact_law(b: float, span: float, draws: int = 1) -> TruncatedLaw:
    """A law that is known: all draws are the same."""
    return TruncatedLaw(0.0, np.full(draws, b * LN10), np.full(draws, span))


def share(size: float, b: float, span: float) -> float:
    """Share of sizes above one, in closed form."""
    return float((10 ** (-b * size) - 10 ** (-b * span)) / (1.0 - 10 ** (-b * span)))


def test_share_above_a_size():
    law = exact_law(0.8, 2.0)
    assert law.share_above(0.0)[0] == pytest.approx(1.0)
    assert np.isnan(law.share_above([-1.0, -1e-6])).all()  # below the cut
    assert law.share_above(1.0)[0] == pytest.approx(share(1.0, 0.8, 2.0))
    assert law.share_above([2.0, 3.0])[:, 0].tolist() == [0.0, 0.0]


def test_drawn_sizes_follow_the_law():
    """All sizes of one draw each: Kolmogorov and Smirnov; their sum and their largest."""
    generator = np.random.default_rng(1)
    law = exact_law(0.8, 2.0, 4000)
    total, largest = law.sizes(np.ones(4000, int), generator)
    np.testing.assert_allclose(np.log10(total), largest)
    assert kstest(largest, lambda x: 1.0 - law.share_above(x)[:, 0]).pvalue > 1e-3
    total, largest = law.sizes(np.array([0, 3] * 2000), generator)
    assert (total[::2] == 0.0).all()
    assert np.isneginf(largest[::2]).all()
    assert kstest(largest[1::2], lambda x: (1.0 - law.share_above(x)[:, 0]) ** 3).pvalue > 1e-3


def test_many_sizes_are_as_if_each_were_drawn(monkeypatch):
    """Fifty events, of which ten are drawn one by one: mean of the sum, distribution of the largest."""
    law, number = exact_law(1.0, 1.5, 4000), np.full(4000, 50)
    known = law.sizes(number, np.random.default_rng(2))
    monkeypatch.setattr("catalogs.sources.truncated_law.MAX_DRAWN", 10)
    total, largest = law.sizes(number, np.random.default_rng(1))
    assert total.mean() == pytest.approx(known[0].mean(), rel=0.03)
    assert kstest(largest, lambda x: (1.0 - law.share_above(x)[:, 0]) ** 50).pvalue > 1e-3
    assert (np.log10(law.sizes(np.full(4000, 10**9), np.random.default_rng(3))[0]) > 8.0).all()


@pytest.mark.parametrize("width", [0.0, 0.15])
def test_many_sizes_fix_the_slope_as_maximum_likelihood_does(width):
    generator = np.random.default_rng(2)
    x = simulated_sizes(generator, 3000, 0.9, 3.0)
    x = np.floor(x / width) * width + 0.5 * width if width else x
    law = draw_law(x, 0.0, 4.0, 2000, generator, width)
    known = estimate_b(x, 0.5 * width, width, bound=3.0)
    assert np.median(law.rate) / LN10 == pytest.approx(known.b, abs=0.3 * known.error)
    assert np.std(law.rate) / LN10 == pytest.approx(known.error, rel=0.15)
    assert np.median(law.bound) == pytest.approx(3.0, abs=0.25)
    assert law.bound.min() >= x.max()


def test_the_end_of_the_law_has_the_posterior_of_its_formula():
    """The slope nearly fixed by many sizes, the end by n: its density is as (1 - exp(-beta M))^-n on [largest, cap]."""
    generator = np.random.default_rng(3)
    x = simulated_sizes(generator, 2000, 1.0, 2.0)
    law = draw_law(x, 0.0, 3.0, 20_000, generator)
    ends = np.linspace(x.max(), 3.0, 2000)
    density = (1.0 - np.exp(-np.median(law.rate) * ends)) ** -len(x)
    cumulative = np.cumsum(density) / density.sum()
    expected = np.interp([0.25, 0.5, 0.75], cumulative, ends)
    np.testing.assert_allclose(np.quantile(law.bound, [0.25, 0.5, 0.75]), expected, atol=0.02)


def test_chance_in_intervals_of_known_rates_and_laws():
    """600 mines, of five runs or nine, whose law's end lies anywhere up to 1.5 above what is seen at least: 0.93 on
    average, less three standard errors of 600 and three classes, 0.018."""
    generator = np.random.default_rng(4)
    held = []
    while len(held) < 600:
        runs, rate = generator.choice([5, 9]), generator.choice([20.0, 80.0])
        b, span = generator.uniform(0.6, 1.2), generator.uniform(1.5, 3.0)
        made = [simulated_sizes(generator, generator.poisson(rate), b, span) for _ in range(runs)]
        x = np.concatenate(made)
        if len(x) < 10:
            continue
        number = np.array([len(one) for one in made], float)
        near = generator.binomial(number.astype(int), 0.3).astype(float)[:, None, None]
        sizes = np.array([0.3, 0.5, 0.8]) * span
        law = draw_law(x, 0.0, max(span + generator.uniform(0.0, 1.5), x.max() + 1.0), 400, generator)
        ratio = widened(run_dispersion(number), runs - 1)
        found = chances(near, ratio, np.ones(400), law.share_above(sizes), 12.0, generator)
        truth = [-np.expm1(-0.3 * rate * share(size, b, span)) for size in sizes]
        low, high = found["chance_interval"][0, 0].T
        held.append((low <= truth) & (truth <= high))
    assert np.mean(held) >= 0.93 - 0.018


def test_disjoint_volumes_add_up_and_each_event_counts_once():
    """1 - prod(1 - p_i) over volumes that share no event is the chance of all; of openings that do it is more."""
    law = exact_law(0.7, 2.0)
    apart = np.array([4.0, 2.0, 5.0, 11.0])[None, :, None]  # the last is all of them together
    found = chances(apart, 1.0, ONE, law.share_above(np.array([0.8])), 1.0, np.random.default_rng(0))["chance"][:, 0, 0]
    assert 1.0 - np.prod(1.0 - found[:-1]) == pytest.approx(found[-1])
    overlapping = np.array([9.0, 9.0, 11.0])[None, :, None]
    found = chances(overlapping, 1.0, ONE, law.share_above(np.array([0.8])), 1.0, np.random.default_rng(0))["chance"]
    assert 1.0 - np.prod(1.0 - found[:-1, 0, 0]) > found[-1, 0, 0] + 0.05


def test_two_halves_have_the_yearly_chance_of_the_whole():
    """Half the events in half the time; both halves together are the whole."""
    shares = exact_law(0.7, 2.0).share_above(np.array([0.5, 1.5]))

    def of(number: float, days: float) -> dict:
        counted = np.array([[[number]]])
        return chances(counted, 1.0, ONE, shares, 365.25 / days, np.random.default_rng(0))

    half, whole = of(12.0, 15.0), of(24.0, 30.0)
    np.testing.assert_allclose(half["yearly_chance"], whole["yearly_chance"])
    np.testing.assert_allclose(half["yearly_number"], whole["yearly_number"])
    np.testing.assert_allclose(1.0 - (1.0 - half["chance"]) ** 2, whole["chance"])
    rate = 24.0 * 365.25 / 30.0 * shares[:, 0]
    np.testing.assert_allclose(whole["yearly_chance"][0, 0], -np.expm1(-rate))


def test_openings_without_an_event_are_not_free_of_hazard():
    """No event in one run: the estimate is 0, and the interval reaches to that of Jeffreys, half a chi-square of 1."""
    found = chances(
        np.zeros((1, 1, 1)),
        1.0,
        np.ones(200_000),
        np.ones((1, 200_000)),
        1.0,
        np.random.default_rng(0),
    )
    assert found["chance"][0, 0, 0] == 0.0
    assert found["expected_interval"][0, 0, 1] == pytest.approx(2.512, rel=0.02)  # chi2.ppf(0.975, 1) / 2


def test_interval_of_a_poisson_number_is_that_of_jeffreys():
    """Nine events in three runs: gamma of 9.5 over 3 (Brown, Cai and DasGupta 2003)."""
    drawn = draw_expected(np.array(9.0), 3, 1.0, 200_000, np.random.default_rng(1))
    np.testing.assert_allclose(np.quantile(drawn, INTERVAL_95), [1.484, 5.475], rtol=0.01)
    assert drawn.mean() == pytest.approx(9.5 / 3.0, rel=0.01)


@pytest.mark.parametrize("ratio", [1.0, 4.0])
def test_numbers_are_poisson_or_negative_binomial(ratio):
    """Closed form of the distribution: chi-square over its classes."""
    count, mean = 40_000, 6.0
    drawn = draw_numbers(np.full(count, mean), ratio, np.random.default_rng(2))
    law = poisson(mean) if ratio == 1.0 else nbinom(mean / (ratio - 1.0), 1.0 / ratio)
    values = np.arange(12)
    expected = count * law.pmf(values)
    found = np.bincount(drawn, minlength=12)[:12]
    assert np.sum((found - expected) ** 2 / expected) < 33.0  # 12 degrees of freedom, one in a thousand
    assert drawn.var() / drawn.mean() == pytest.approx(ratio, rel=0.05)


def test_predicted_number_of_a_gamma_rate_is_negative_binomial():
    """Of 12 events in 3 runs one more run has the numbers of a negative binomial with r = 12.5, p = 3 / 4."""
    generator = np.random.default_rng(3)
    drawn = draw_numbers(draw_expected(np.array(12.0), 3, 1.0, 40_000, generator), 1.0, generator)
    expected = 40_000 * nbinom(12.5, 0.75).pmf(np.arange(11))
    assert np.sum((np.bincount(drawn, minlength=11)[:11] - expected) ** 2 / expected) < 32.0


def test_dispersion_needs_runs_and_is_never_less_than_that_of_independent_events():
    assert run_dispersion(np.array([10.0, 30.0])) == 1.0
    assert run_dispersion(np.full(9, 20.0)) == 1.0
    number = np.array([10.0, 30.0, 20.0, 25.0, 12.0, 18.0])
    assert run_dispersion(number) == pytest.approx(number.var(ddof=1) / number.mean())
    both = np.column_stack([number, number[::-1]])  # two steps, whose sums vary less than they do
    assert run_dispersion(both) == pytest.approx(run_dispersion(number))
    assert widened(2.0, 4) == pytest.approx(2.0 * (2.7764 / 1.96) ** 2, rel=1e-3)


def recorded_numbers(generator, levels, modelled: float, scatter: float = 0.0, clustering: float = 1.0, runs: int = 5):
    """Numbers of recorded steps about these levels (step + 1,), the last of a step ahead, and its expected number."""
    level = np.asarray(levels) + scatter * generator.normal(size=len(levels))
    made = generator.poisson(modelled, (runs, len(level) - 1)).astype(float)
    recorded = draw_numbers(modelled * np.exp(level[:-1]), clustering, generator).astype(float)
    nothing = np.empty(0)
    numbers = RecordedNumbers(recorded, made, np.empty((0, len(made[0]))), 0.0, clustering, nothing, 0.0, 1.0)
    return numbers, modelled * np.exp(level[-1])


def forecast_range(numbers: RecordedNumbers, modelled: float, generator) -> np.ndarray:
    """95 % range of the number of the step that follows the recorded ones."""
    levels = draw_levels(numbers, 800, generator)
    after = numbers.middles[-1:] + MONTH
    expected = modelled * np.exp(steps_of_plan(levels, numbers.middles, after, generator)[0])
    return np.quantile(draw_numbers(expected, levels.dispersion, generator), INTERVAL_95, method="nearest")


@pytest.mark.slow
@pytest.mark.parametrize("clustering", [1.0, 4.0])
@pytest.mark.parametrize("steps", [1, 3, 8])
def test_the_number_of_one_more_step_is_held_by_its_range(steps, clustering):
    """300 records whose steps scatter and drift as the prior has it: 0.93 less three standard errors, 0.044."""
    generator = np.random.default_rng(6)
    held = []
    for _ in range(300):
        scatter, drift = (abs(one * generator.normal()) * (generator.random() < 0.5) for one in (STEP_SCATTER, DRIFT))
        walk = np.log(0.6) + np.cumsum(drift * generator.normal(size=steps + 1))
        numbers, expected = recorded_numbers(generator, walk, 40.0, scatter, clustering)
        low, high = forecast_range(numbers, 40.0, generator)
        held.append(low <= draw_numbers(np.array([expected]), clustering, generator)[0] <= high)
    assert np.mean(held) >= 0.93 - 0.044


def test_a_record_that_drifts_from_the_model_is_followed():
    """From 1 to 6 times the model in twelve months: the next month is expected where the last ones are."""
    generator = np.random.default_rng(7)
    numbers, expected = recorded_numbers(generator, np.log(np.linspace(1.0, 6.5, 13)), 100.0)
    low, high = forecast_range(numbers, 100.0, generator)
    assert low > 0.5 * expected
    assert low <= expected <= high
    constant, _ = recorded_numbers(generator, np.full(13, np.log(3.5)), 100.0)
    assert np.diff(forecast_range(constant, 100.0, generator)) < 0.5 * (high - low)


def test_a_jump_between_months_is_scatter_or_drift():
    """20 events in the first month and 2000 in each later one, of 1000 modelled: without scatter and drift such a
    record has a probability that no double holds. The level is where the last months are, and no warning is given."""
    nothing = np.empty(0)
    for later in (1, 2, 9):
        number = np.append(20.0, np.full(later, 2000.0))
        made = np.full((5, len(number)), 1000.0)
        numbers = RecordedNumbers(number, made, np.empty((0, len(number))), 0.0, 1.0, nothing, 0.0, 1.0)
        with np.errstate(all="raise", under="ignore"):
            levels = draw_levels(numbers, 2000, np.random.default_rng(8))
        assert (np.maximum(levels.scatter, levels.drift) > 0.0).all()
        if later == 9:
            assert np.exp(np.median(levels.level[-1])) == pytest.approx(2.0, rel=0.3)


def test_many_equal_steps_leave_the_chance_of_the_counts():
    """No scatter, no drift: the level is known as well as all counts together say."""
    generator = np.random.default_rng(7)
    numbers, _ = recorded_numbers(generator, np.full(25, np.log(0.6)), 200.0, runs=9)
    levels = draw_levels(numbers, 20_000, generator)
    exact = np.sqrt(1.0 / numbers.recorded.sum() + 1.0 / numbers.modelled.sum())
    total = np.log(numbers.recorded.sum() / (numbers.modelled.sum() / 9))
    last = levels.level[-1]
    assert np.median(last) == pytest.approx(total, abs=exact)
    assert exact < last.std() < 2.0 * exact
    assert np.median(levels.scatter) == np.median(levels.drift) == 0.0


def test_the_dispersion_lies_between_its_bounds_where_the_steps_decide():
    """Forty steps of independent events, of which clusters may have been joined: kappa is close to 1, not to 20."""
    generator = np.random.default_rng(9)
    made, number = np.full((5, 40), 50.0), generator.poisson(50.0, 40).astype(float)
    nothing = np.empty(0)
    numbers = RecordedNumbers(number, made, nothing, 0.0, 20.0, nothing, 0.0, 1.0, least_dispersion=1.0)
    assert np.median(draw_levels(numbers, 2000, generator).dispersion) < 2.5


def test_the_scatter_of_steps_averages_out_over_a_plan():
    """Sixteen steps of equal numbers: the scatter of their sum is a quarter of that of one."""
    generator = np.random.default_rng(8)
    factors = Factors(0.2 * generator.normal(size=(16, 20_000)), None, (), ())
    number = np.full(16, 10.0)
    one = np.log(factors.of(np.arange(16) == 3, number)).std()
    every = np.log(factors.of(np.ones(16, bool), number)).std()
    assert one == pytest.approx(0.2, rel=0.03)
    assert every == pytest.approx(0.05, rel=0.1)


def test_a_chance_of_clustered_numbers_is_that_of_the_negative_binomial():
    """1 - P(no event that is large enough) of a thinned negative binomial number, in closed form and drawn."""
    generator = np.random.default_rng(10)
    expected, share, ratio = 6.0, 0.2, 5.0
    drawn = generator.binomial(draw_numbers(np.full(200_000, expected), ratio, generator), share)
    assert float(chance_of(np.array(expected), np.array(share), ratio)) == pytest.approx(np.mean(drawn > 0), abs=0.005)


def test_chance_of_small_rates_is_the_rate():
    assert chance_of(np.array(1e-9), np.array(0.5)) == pytest.approx(5e-10)


def runs_that_share(generator, share_of: float, runs: int = 9, mean: float = 60.0) -> list[list[StepResult]]:
    """Two steps, each by run, b = 0.8, that have a part of their events in common."""
    steps = []
    for _ in range(2):
        common = simulated_sizes(generator, generator.poisson(share_of * mean), 0.8, 3.0)
        own = [simulated_sizes(generator, generator.poisson((1.0 - share_of) * mean), 0.8, 3.0) for _ in range(runs)]
        steps.append([10.0 ** np.concatenate([common, one]) for one in own])
    return [[StepResult(one, np.zeros((len(one), 3)), 0.0, one.sum()) for one in step] for step in steps]


def test_runs_that_share_events_are_worth_fewer():
    generator = np.random.default_rng(12)
    same = runs_that_share(generator, 1.0)
    assert independent_share(same) == pytest.approx(1.0 / 9.0)
    assert independent_share([step[:1] for step in same]) == 1.0
    found = [np.mean([independent_share(runs_that_share(generator, one)) for _ in range(60)]) for one in (0.0, 0.5)]
    assert found[0] > 0.7
    assert found[1] == pytest.approx(1.0 / (1.0 + 8 * 0.5), rel=0.15)


def test_the_slope_of_runs_that_share_events_is_held_by_its_interval():
    """300 plans of nine runs that share half of their events: 0.93 less three standard errors, 0.044."""
    generator = np.random.default_rng(13)
    held = []
    for _ in range(300):
        runs = runs_that_share(generator, 0.5)
        x = np.log10(np.concatenate([step.potency for run in runs for step in run]))
        law = draw_law(x, 0.0, x.max() + 1.0, 400, generator, weight=independent_share(runs))
        low, high = np.quantile(law.rate / LN10, INTERVAL_95)
        held.append(low <= 0.8 <= high)
    assert np.mean(held) >= 0.93 - 0.044


def test_rock_shifts_the_number_by_what_it_changes_beyond_the_recorded_steps():
    """Other rock makes twice the events of the plan. Where it makes twice those of the recorded steps too, the record's
    ratio has that in it already; else half of them is not."""
    settings = SimpleNamespace(runs=[SimpleNamespace(kind=kind) for kind in ("own", *["draw"] * 4)], steps=STEPS)
    values = {
        "shared_number": np.array([[1000.0, 1000.0], *[[2000.0, 2000.0]] * 4]),
        "number": np.array([[[1000.0]], *[[[np.nan]]] * 4]),
    }
    nothing = np.empty(0)

    def found(recorded_draw: float | None) -> Factors:
        recorded = None
        if recorded_draw is not None:
            draws = np.full((4, 1), recorded_draw)
            recorded = RecordedNumbers(ONE * 1e6, np.array([[1e6]]), draws, 1000.0, 1.0, nothing, 0.0, 1.0)
        return find_factors(settings, values, recorded, np.ones(2, bool), 4000, np.random.default_rng(1))

    for recorded_draw, times in ((None, 2.0), (2000.0, 1.0), (1000.0, 2.0)):
        assert np.median(found(recorded_draw).log[0]) == pytest.approx(np.log(times), abs=0.02)
        assert "rock" in found(recorded_draw).contains


def test_the_factor_of_the_cells_has_the_width_of_their_change():
    """200 events on own cells, 100 on doubled ones: the 95 % interval of ln is 1.25 ln(200.5 / 100.5) on either side.
    Equal numbers: ln 1.1."""
    settings = SimpleNamespace(runs=[SimpleNamespace(kind=kind) for kind in ("own", "coarse")], steps=STEPS)
    for coarse, half in ((100.0, 1.25 * np.log(200.5 / 100.5)), (200.0, np.log(1.1))):
        values = {
            "shared_number": np.array([[200.0, 0.0], [coarse, 0.0]]),
            "number": np.array([[[200.0]], [[np.nan]]]),
        }
        factors = find_factors(settings, values, None, np.ones(2, bool), 100_000, np.random.default_rng(1))
        np.testing.assert_allclose(np.quantile(factors.log[0], INTERVAL_95), [-half, half], rtol=0.03)
        assert factors.contains == ("chance", "cells")


def test_the_cap_of_the_law_is_all_potency_that_the_plan_releases():
    """Of the run that releases most, all sizes together; with a record that releases more, of the record. The law's end
    reaches up to it, and no farther."""
    size = 10.0 ** (simulated_sizes(np.random.default_rng(1), 30, 0.9) - 2.0)
    assert size.max() < 1.0
    runs = [[StepResult(size, np.zeros((30, 3)), -2.0, one) for one in run] for run in ((40.0, 60.0), (1.0, 2.0))]
    law, _ = size_law([runs], -2.0, None, 2000, np.random.default_rng(2))
    assert law.bound.max() == pytest.approx(2.0, abs=0.05)
    nothing = np.empty(0)
    recorded = RecordedNumbers(ONE, np.ones((1, 1)), np.empty((0, 1)), 0.0, 1.0, nothing, 0.0, 1e3)
    law, _ = size_law([runs], -2.0, recorded, 2000, np.random.default_rng(2))
    assert law.bound.max() == pytest.approx(3.0, abs=0.05)
