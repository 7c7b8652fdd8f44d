import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from catalogs.sources import sizes
from verification.answers.statistics.samples import simulated_sizes


@pytest.mark.parametrize(
    ("b", "count", "span", "bin_width", "bound"),
    [
        (0.7, 50, np.inf, 0.0, None),
        (1.2, 200, np.inf, 0.0, None),
        (0.7, 100, np.inf, 0.3, None),
        (0.7, 150, 2.0, 0.0, 2.0),
        (0.7, 150, 2.0, 0.0, "largest"),
        (0.4, 150, 2.0, 0.2, 1.8),
        (0.7, 60, 1.0, 0.25, "largest"),
    ],
)
def test_b_is_unbiased_and_its_interval_holds_the_truth_95_times_in_100(b, count, span, bin_width, bound):
    """400 catalogues of known b. Mean within 3 standard errors of the mean plus 1 %; coverage within 3 binomial
    standard errors (0.033) of 0.95; the stated error within 15 % of the scatter found."""
    generator = np.random.default_rng(count)
    found = [
        sizes.estimate_b(simulated_sizes(generator, count, b, span, bin_width), 0.0, bin_width, bound)
        for _ in range(400)
    ]
    values = np.array([one.b for one in found])
    scatter = values.std()
    assert abs(values.mean() - b) < 3 * scatter / 20 + 0.01 * b
    assert np.mean([one.lower <= b <= one.upper for one in found]) == pytest.approx(0.95, abs=0.033)
    assert np.mean([one.error for one in found]) == pytest.approx(scatter, rel=0.15)


def test_ignoring_the_bound_or_the_bins_shows():
    """What the corrections are for: b 0.7 cut off at 2 reads 0.77 or more without the bound; bins of 0.5 with the
    continuous formula read above 0.9."""
    generator = np.random.default_rng(1)
    assert sizes.estimate_b(simulated_sizes(generator, 20_000, 0.7, 2.0), 0.0).b > 0.77
    binned = simulated_sizes(generator, 20_000, 0.7, bin_width=0.5)
    assert sizes.estimate_b(binned, 0.0).b > 0.9
    assert sizes.estimate_b(binned, 0.0, bin_width=0.5).b == pytest.approx(0.7, abs=0.02)


def test_the_largest_event_is_the_bound_and_not_one_of_the_events():
    """Given the largest of n, the other n - 1 are independent below it: that conditional likelihood is exact."""
    x = simulated_sizes(np.random.default_rng(2), 40, 0.7)
    rest = np.sort(x)[:-1]
    assert sizes.estimate_b(x, 0.0, bound="largest") == sizes.estimate_b(rest, 0.0, bound=float(x.max()))


def test_binned_sizes_of_which_the_largest_is_the_bound_by_the_slow_likelihood():
    """P(sizes | largest in bin M) = r^(sum of bins) / (S_M^n - S_(M-1)^n), r = 10^(-b width), maximised on a grid."""
    x = simulated_sizes(np.random.default_rng(3), 30, 0.5, 1.0, 0.25)
    bins = np.round(x / 0.25).astype(int)
    grid = np.linspace(-2.0, 3.0, 500_001)
    powers = 10.0 ** (-grid[:, None] * 0.25 * np.arange(bins.max() + 1))
    possible = powers.sum(axis=1) ** 30 - powers[:, :-1].sum(axis=1) ** 30
    likelihood = -grid * np.log(10) * 0.25 * bins.sum() - np.log(possible)
    found = sizes.estimate_b(x, 0.0, 0.25, "largest")
    assert found.b == pytest.approx(grid[likelihood.argmax()], abs=2e-5)
    inside = grid[2 * (likelihood.max() - likelihood) <= 3.841459]
    assert [found.lower, found.upper] == pytest.approx([inside[0], inside[-1]], abs=2e-5)
    curvature = -np.diff(likelihood[likelihood.argmax() + np.array([-5000, 0, 5000])], 2).item() / 0.05**2
    assert found.error == pytest.approx(curvature**-0.5, rel=1e-3)
    assert found.events == 30


def test_all_in_the_lowest_bin_but_the_largest_give_no_b():
    """The likelihood then climbs without end."""
    assert np.isnan(sizes.estimate_b(np.array([0.0] * 19 + [0.6]), 0.0, 0.2, "largest").b)
    assert 0 < sizes.estimate_b(np.array([0.0] * 18 + [0.2, 0.6]), 0.0, 0.2, "largest").b < np.inf


NEARLY_ONE_SIZE = {  # sizes in one to three bins, of which nearly all are in one
    "one larger": [0.0] * 39 + [1.7],
    "one of the next bin": [0.0] * 39 + [0.1],
    "one smaller": [0.8] * 39 + [0.0],
    "two values": [0.0] * 20 + [1.7] * 20,
    "far larger": [0.0] * 10 + [30.0],
}


@pytest.mark.parametrize("name", NEARLY_ONE_SIZE)
@pytest.mark.parametrize("end", [0.0, 1.0, 1e6])
@pytest.mark.parametrize("bin_width", [0.0, 0.1])
def test_b_of_nearly_equal_sizes_is_the_maximum_of_the_likelihood(name, end, bin_width):
    """However steep or flat the law, and however far its upper end lies; on a grid of beta by direct sums.

    The search had fixed ends, and stopped with "f(a) and f(b) must have different signs".
    """
    x = np.array(NEARLY_ONE_SIZE[name])
    bound = x.max() + end
    found = sizes.estimate_b(x, 0.0, bin_width, float(bound))
    assert found.lower < found.b < found.upper
    beta = found.b * np.log(10) + np.linspace(-0.05, 0.05, 1001) * found.error * np.log(10)
    if bin_width:
        steps = np.arange(min(round(bound / bin_width), 10_000) + 1) * bin_width
        exponent = -beta[:, None] * steps
        shift = exponent.max(axis=1)
        normaliser = shift + np.log(np.exp(exponent - shift[:, None]).sum(axis=1))
    else:
        normaliser = np.log(np.expm1(-beta * bound) / -beta) if bound < 100 else -np.log(beta)
    likelihood = -beta * x.mean() - normaliser
    assert abs(beta[likelihood.argmax()] / np.log(10) - found.b) < 1e-3 * found.error


@pytest.mark.parametrize("bin_width", [0.0, 0.1])
def test_sizes_that_differ_by_what_arithmetic_makes_are_one_size(bin_width):
    x = np.full(40, -1.2)
    x[-1] = np.nextafter(-1.2, 0)
    assert np.isnan(sizes.estimate_b(x, -1.2, bin_width).b)
    assert np.isnan(sizes.estimate_b(x, -1.2, bin_width, "largest").b)


def test_by_hand_mean_excess_of_a_half():
    """b = log10(e) / mean excess = 0.8686 for a mean excess of 0.5, times 19/20 for 20 events."""
    x = np.tile([0.25, 0.75], 10)
    found = sizes.estimate_b(x, 0.0)
    assert found.b == pytest.approx(np.log10(np.e) / 0.5 * 19 / 20)
    assert found.magnitude == pytest.approx(1.5 * found.b)
    assert found.a == pytest.approx(np.log10(20))


@given(some.floats(-5, 5), some.integers(0, 1000))
def test_b_does_not_depend_on_where_the_scale_begins(shift, seed):
    x = simulated_sizes(np.random.default_rng(seed), 60, 0.8)
    here, there = sizes.estimate_b(x, 0.0, bound="largest"), sizes.estimate_b(x + shift, shift, bound="largest")
    assert there.b == pytest.approx(here.b, rel=1e-6, abs=1e-9)


def test_flat_sizes_under_a_bound_have_no_slope():
    found = sizes.estimate_b(np.linspace(0.0, 2.0, 101), 0.0, bound=2.0)
    assert found.b == pytest.approx(0.0, abs=1e-6)
    assert found.lower < 0 < found.upper


@pytest.mark.parametrize("x", [[], [0.1] * 5, [0.0] * 50])
def test_too_few_or_equal_sizes_give_no_b(x):
    assert np.isnan(sizes.estimate_b(np.array(x, float), 0.0).b)
    assert np.isnan(sizes.estimate_b(np.array(x, float), 0.0, bound="largest").b)


def test_difference_of_b_errs_five_times_in_a_hundred():
    """600 pairs of one b: 5 % fall outside the interval, 5 % have p under 0.05 (3 standard errors: 2.7 %)."""
    generator = np.random.default_rng(3)
    found = []
    for _ in range(600):
        first, second = (sizes.estimate_b(simulated_sizes(generator, count, 0.8), 0.0) for count in (60, 250))
        found.append(sizes.difference_b(first, second))
    assert np.mean([not one.lower <= 0 <= one.upper for one in found]) == pytest.approx(0.05, abs=0.027)
    assert np.mean([one.p_value < 0.05 for one in found]) == pytest.approx(0.05, abs=0.027)


def test_counts_per_bin_and_above_on_the_edges():
    incremental, cumulative = sizes.counts(
        np.array([-1.0, -0.9, -0.8, -0.5, np.nan]), np.array([-1.0, -0.8, -0.6]), 0.2
    )
    assert incremental.tolist() == [2, 1, 1]
    assert cumulative.tolist() == [4, 2, 1]
    assert sizes.cut_grid(np.array([]), 0.1).size == 0
