"""The end of a law of sizes: its interval holds the truth as often as stated, in simulated catalogues."""

import numpy as np
import pytest

from catalogs.sources.largest_possible import largest_possible, mean_shortfall, upper_end

CUT = -2.0


def drawn(generator, count: int, b: float, span: float) -> np.ndarray:
    """Sizes of the law of slope b that ends `span` above the cut."""
    share = generator.random(count) * -np.expm1(-b * np.log(10) * span)
    return CUT - np.log1p(-share) / (b * np.log(10))


@pytest.mark.parametrize("width", [0.0, 0.15])
@pytest.mark.parametrize(("count", "span"), [(60, 1.0), (60, 2.0), (400, 1.5), (400, 3.0)])
def test_the_interval_holds_the_end_of_the_law(count, span, width):
    """200 catalogues of known truth: 0.95 less three Monte Carlo errors. b is estimated, too; of rounded sizes the cut
    is the centre of the lowest bin."""
    generator = np.random.default_rng(1)
    held = []
    for _ in range(200):
        sizes = drawn(generator, count, 0.7, span)
        centres = CUT + width * (np.floor((sizes - CUT) / width) + 0.5) if width else sizes
        found = largest_possible(centres, CUT + 0.5 * width, width)
        held.append(found.seen - width <= CUT + span <= found.upper)
    assert np.mean(held) >= 0.95 - 3 * np.sqrt(0.95 * 0.05 / 200)


def test_a_short_law_is_bounded_and_a_long_one_is_not():
    """A thousand events fill a law that ends one decade up; none of them tells the end of one ten decades up."""
    generator = np.random.default_rng(2)
    short = largest_possible(drawn(generator, 1000, 0.7, 1.0), CUT)
    assert short.upper < CUT + 1.1
    assert short.estimate == pytest.approx(CUT + 1.0, abs=0.02)
    long = largest_possible(drawn(generator, 1000, 0.7, 10.0), CUT)
    assert long.upper == np.inf


def test_the_interval_for_a_known_slope_is_exact():
    """Of 20,000 largest events of n, those that refuse the true end are 1 - confidence, to Monte Carlo error."""
    generator = np.random.default_rng(3)
    beta, span, count = 1.6, 1.2, 30
    share = generator.random((20_000, count)) * -np.expm1(-beta * span)
    largest = (-np.log1p(-share) / beta).max(axis=1)
    held = np.mean([upper_end(one, 0.0, beta, count, 0.9) >= span for one in largest])
    assert held == pytest.approx(0.9, abs=3 * np.sqrt(0.09 / 20_000))


def test_the_mean_shortfall_is_that_of_samples():
    generator = np.random.default_rng(4)
    sizes = drawn(generator, 50 * 20_000, 0.7, 1.5).reshape(20_000, 50)
    short = CUT + 1.5 - sizes.max(axis=1)
    error = 4 * short.std() / np.sqrt(len(short))
    assert mean_shortfall(CUT + 1.5, CUT, 0.7 * np.log(10), 50) == pytest.approx(short.mean(), abs=error)


@pytest.mark.parametrize("count", [0, 1, 5])
def test_too_few_events_say_nothing(count):
    found = largest_possible(np.linspace(-1.5, -1.0, count), CUT)
    assert np.isnan(found.upper)
    assert found.count == count


def test_sizes_are_those_of_potency_whatever_their_unit():
    """Shifted sizes have a shifted end."""
    sizes = drawn(np.random.default_rng(5), 200, 0.7, 1.0)
    one, two = largest_possible(sizes, CUT), largest_possible(sizes + 3.0, CUT + 3.0)
    for name in ("estimate", "seen", "upper"):
        assert getattr(two, name) - 3.0 == pytest.approx(getattr(one, name))
