"""Numbers and intervals as text: an interval printed beside a value tells whether it holds it."""

from functools import partial

import numpy as np
import pytest

from catalogs.report.text import DOWN, UP, as_ratio, beside, between, fixed, number, percent, rounded_by


@pytest.mark.parametrize(
    ("interval", "form", "text"),
    [
        ((0.4321, 3.661), partial(number, digits=2), "0.43 to 3.7"),
        ((-0.4321, 0.0), partial(number, digits=2), "−0.44 to 0"),
        ((0.3, 0.1 + 0.2), partial(number, digits=2), "0.30 to 0.30"),  # the second is 0.30000000000000004
        ((1.234e7, 1.234e7), number, "1.23·10⁷ to 1.24·10⁷"),
        ((12_345.2, 12_345.2), number, "12\u202f345 to 12\u202f346"),
        ((1 / 60.4, 1 / 12.4), as_ratio, "1/61 to 1/12"),
        ((0.051, 0.0549), percent, "5.1 % to 5.5 %"),
        ((-0.04, 1.04), partial(fixed, decimals=1), "−0.1 to 1.1"),
        ((1.04, np.inf), partial(fixed, decimals=1), "1.0 or more"),
        ((np.nan, 1.0), number, "–"),
    ],
)
def test_ends_of_an_interval_are_rounded_outwards(interval, form, text):
    assert between(interval, form) == text


def test_an_end_that_is_rounded_outwards_is_beyond_the_end():
    generator = np.random.default_rng(1)
    for value in 10.0 ** generator.uniform(-2.9, 5.9, 200):
        low, high = (float(number(value, 2, rounding).replace("\u202f", "")) for rounding in (DOWN, UP))
        assert low <= value * (1 + 1e-9)
        assert high >= value * (1 - 1e-9)


@pytest.mark.parametrize(
    ("value", "interval", "texts"),
    [
        (3.74, (0.432, 3.66), ("3.74", "0.432 to 3.66")),  # "3.7 recorded, outside of 0.4 to 3.7"
        (3.65, (0.432, 3.66), ("3.6", "0.43 to 3.7")),
        (1.0, (0.3, 0.996), ("1.00", "0.300 to 0.996")),
        (0.43, (0.4301, 2.0), ("0.4300", "0.4301 to 2.000")),
        (9.0, (0.432, 3.66), ("9.0", "0.43 to 3.7")),
        (0.4296, (0.4304, np.inf), ("0.4296", "0.4304 or more")),
        (0.4396, (0.4304, np.inf), ("0.44", "0.43 or more")),
    ],
)
def test_a_value_outside_of_an_interval_looks_so(value, interval, texts):
    assert beside(value, interval, partial(number, digits=2)) == texts


def test_values_are_rounded_by_their_interval():
    """Half an interval has 4 to 35 of the last digit; its ends are rounded outwards."""
    assert rounded_by(6.02, (0.0, 204.4)) == ("10", "0 to 210")
    assert rounded_by(6.02, (0.0, 14.4)) == ("6", "0 to 15")
    assert rounded_by(6.02, (4.61, 7.43)) == ("6.0", "4.6 to 7.5")
    assert rounded_by(1234.0, (0.0, 99_999.0)) == ("0", "0 to 100\u202f000")
    assert rounded_by(6.02, (np.nan, np.nan)) == ("6.0", "–")
