"""Numbers, signs and phrases as the report writes them, and the rows of its tables of comparison."""

import re
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Decimal
from functools import partial

import numpy as np

from common.source_tensors import moment_magnitude

DASH = "–"  # Stands for a value that is not known.
NEAREST, DOWN, UP = ROUND_HALF_EVEN, ROUND_FLOOR, ROUND_CEILING
EXACT_DIGITS = 12  # Digits of a number that are no round-off.
MIN_RATIO_AS_DECIMAL = 0.2  # Smaller ratios are written as 1/n.
LEAST_OF_LAST_DIGIT = 3.5  # Units of the last digit that half an interval has at least.
MAX_NAMED = 5  # Excavations that one sentence names.
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def _rounded(value: float, place: int, rounding: str) -> Decimal:
    """A finite number to multiples of 10^place; away from the nearest only what is no round-off."""
    exact = Decimal(value) if rounding == NEAREST else Decimal(f"{value:.{EXACT_DIGITS}g}")
    return exact.quantize(Decimal(1).scaleb(place), rounding)


def number(value, digits: int = 3, rounding: str = NEAREST, more: int = 0) -> str:
    """A number for a reader: significant digits, a true minus sign, thousands apart; a dash where there is none.

    rounding: NEAREST, DOWN or UP; more: further digits.
    """
    value, digits = float(value) if value is not None else np.nan, digits + more
    if not np.isfinite(value):
        return DASH
    if value == 0:
        return "0"
    power = int(np.floor(np.log10(abs(value))))
    if 1e-3 <= abs(value) < 1e6:
        decimals = max(digits - 1 - power, 0)
        text = f"{_rounded(value, -decimals, rounding):,.{decimals}f}"
        return text.replace(",", "\u202f").replace("-", "−")
    mantissa, exponent = f"{_rounded(value, power - digits + 1, rounding):.{digits - 1}e}".split("e")
    return f"{mantissa}·10".replace("-", "−") + str(int(exponent)).translate(SUPERSCRIPT)


def whole(value) -> str:
    """A count with its thousands apart."""
    return f"{int(value):,}".replace(",", "\u202f")


def fixed(value, decimals: int, rounding: str = NEAREST, more: int = 0) -> str:
    """A number with so many decimals; a dash where there is none. rounding, more: as in `number`."""
    if not np.isfinite(value):
        return DASH
    decimals += more
    return f"{_rounded(float(value), -decimals, rounding) + 0:.{decimals}f}".replace("-", "−")


def hundredths(value, rounding: str = NEAREST, more: int = 0) -> str:
    """A number with two decimals: logarithms and b."""
    return fixed(value, 2, rounding, more)


def percent(share, rounding: str = NEAREST, more: int = 0) -> str:
    """A share as per cent."""
    share = float(share)
    return f"{number(100 * share, 2, rounding, more)} %" if np.isfinite(share) else DASH


def as_ratio(value: float, rounding: str = NEAREST, more: int = 0) -> str:
    """A ratio as a reader says it: 1.2, 0.43, 1/29."""
    if 0 < value < MIN_RATIO_AS_DECIMAL:
        return f"1/{number(1 / value, 2, {DOWN: UP, UP: DOWN}.get(rounding, NEAREST), more)}"
    return number(value, 2, rounding, more)


def between(interval, form=number) -> str:
    """An interval as text, its ends rounded outwards, so that it holds all that it holds unrounded; a dash if it is not
    known.

    form: `number`, `fixed`, ... or a partial of them: a function of a value, with the keyword `rounding`.

    >>> between((0.4321, 3.6661))
    '0.432 to 3.67'
    """
    low, high = (float(value) for value in interval)
    if np.isfinite(low) and high == np.inf:
        return f"{form(low, rounding=DOWN)} or more"
    return f"{form(low, rounding=DOWN)} to {form(high, rounding=UP)}" if np.isfinite([low, high]).all() else DASH


def rounded_by(value: float, interval) -> tuple[str, str]:
    """A value and its 95 % interval, which holds it, to the digits that the interval leaves: half its width has 4 to 35
    of the last one (as the Particle Data Group rounds). The ends are rounded outwards.

    >>> rounded_by(6.04, (0.0, 204.3)), rounded_by(6.04, (0.0, 14.4))
    (('10', '0 to 210'), ('6', '0 to 15'))
    """
    low, high = (float(end) for end in interval)
    if not (np.isfinite([value, low, high]).all() and high > low):
        return number(value, 2), between(interval, partial(number, digits=2))
    place = int(np.floor(np.log10((high - low) / (2.0 * LEAST_OF_LAST_DIGIT))))

    def form(one: float, rounding: str = NEAREST) -> str:
        return f"{_rounded(one, place, rounding) + 0:,.{max(-place, 0)}f}".replace(",", "\u202f").replace("-", "−")

    return form(float(value)), between(interval, form)


def beside(value: float, interval, form=number) -> tuple[str, str]:
    """A value and an interval that need not hold it, as texts that tell whether it does.

    Inside, the ends are rounded outwards. Outside, all three get as many digits as keep the value off the end.
    form: as of `between`, with the keyword `more`, too.

    >>> beside(3.6663, (0.4321, 3.6658))
    ('3.6663', '0.43210 to 3.6658')
    """
    low, high = (float(end) for end in interval)
    if not np.isfinite([value, low]).all() or np.isnan(high) or low <= value <= high:
        return form(value), between(interval, form)
    near = high if value > high else low
    shown = ((more, *(_bare(form(one, more=more)) for one in (value, near))) for more in range(EXACT_DIGITS))
    more = next((more for more, first, second in shown if first != second), 0)
    upper = "or more" if high == np.inf else f"to {form(high, more=more)}"
    return form(value, more=more), f"{form(low, more=more)} {upper}"


def _bare(text: str) -> str:
    """A number as text without the zeros at the end of its decimals."""
    return text.rstrip("0").rstrip(".") if "." in text else text


def typeset(text: str) -> str:
    """Plain text of a dataset with true minus and comparison signs."""
    return re.sub(r"(?<![\w-])-(?=\d)", "−", text.replace(">=", "≥"))


def with_unit(text: str, unit: str) -> str:
    """A number as text with its unit; a dash stays a dash."""
    return text if text == DASH else f"{text}{unit}"


def magnitude(potency: float, shear_modulus: float) -> float:
    """Mw of shear of this potency (m3) in rock of this shear modulus (Pa); NaN for none."""
    return float(moment_magnitude(np.array(shear_modulus * potency))) if potency > 0 else np.nan


def plural(count: int, name: str) -> str:
    return f"{whole(count)} {name}" + ("" if count == 1 else "s")


def as_sentence(text: str) -> str:
    """A phrase of the comparison with a capital and a full stop."""
    return typeset(text[:1].upper() + text[1:].rstrip(".")) + "." if text else ""


def comparison_row(name: str, modelled: str, recorded: str, value: str, interval: str) -> dict[str, str]:
    return {"name": name, "modelled": modelled, "recorded": recorded, "value": value, "interval": interval}
