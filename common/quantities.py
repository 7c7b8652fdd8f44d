"""Physical quantities as a user writes them: a number, then its unit, "57 GPa"."""

import math
import re
from functools import cache

QUANTITY_PATTERN = re.compile(r"(?P<number>[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?)\s*(?P<unit>[^\d\s].*)?")
POWER_PATTERN = r"(?:[^\W\d]\w*|°|%)(?:(?:\^|\*\*)[-+]?\d)?"  # m, m^3, s**-1
# Only what matches is handed to pint, which would also evaluate 9**9**9.
UNIT_PATTERN = re.compile(rf"{POWER_PATTERN}(?:(?:\s*[*/·]\s*|\s+){POWER_PATTERN})*")
MAX_QUANTITY_LENGTH = 100  # Characters of a quantity.


@cache
def units():
    """The registry of units (imported and built once: that takes most of a second)."""
    import pint

    registry = pint.UnitRegistry()
    registry.define("@alias survey_foot = us_ft")  # as the keys of units call it
    return registry


def pint_quantity(text: str):
    """Quantity (pint) of 1 in the unit `text`. Raises ValueError with pint's reason if it is none."""
    try:
        return units().Quantity(1.0, text)
    except Exception as error:  # pint raises a dozen kinds for text that is not a unit
        raise ValueError(str(error)) from error


@cache
def factor(text: str, unit: str) -> float:
    """Factor that converts a number in the unit `text` to `unit`. Raises ValueError if there is none."""
    if text == unit:
        return 1.0
    import pint

    try:
        return float(pint_quantity(text).to(unit).magnitude)
    except pint.DimensionalityError as error:
        raise ValueError(f"is not convertible to {unit}") from error
    except (ValueError, pint.PintError) as error:
        raise ValueError(f"has no unit that is known; expected one like {unit} ({error})") from error


def parse_quantity(text: str, unit: str) -> float:
    """The value of `text` ("57 GPa": a number, then its unit) in `unit`. Raises ValueError with the reason.

    >>> parse_quantity("57 GPa", "Pa")
    57000000000.0
    >>> parse_quantity("57", "Pa")
    Traceback (most recent call last):
    ValueError: '57' has no unit; write it as text with one, for example '57 Pa'
    """
    if len(text) > MAX_QUANTITY_LENGTH:
        raise ValueError(f"{text[:30]!r}... is not a number with a unit: it has {len(text):,} characters")
    parts = QUANTITY_PATTERN.fullmatch(text.strip())
    if not parts:
        raise ValueError(f"{text!r} is not a number with a unit, for example '1.5 {unit}'")
    if not parts["unit"]:
        raise ValueError(f"{text!r} has no unit; write it as text with one, for example '{text} {unit}'")
    if not UNIT_PATTERN.fullmatch(parts["unit"]):
        raise ValueError(f"{text!r} has no unit that is known; expected one like {unit}, without arithmetic")
    try:
        number = float(parts["number"]) * factor(parts["unit"], unit)
    except ValueError as error:
        raise ValueError(f"{text!r} {error}") from error
    if not math.isfinite(number):
        raise ValueError(f"{text!r} is not a finite number")
    return number
