"""Units of the columns of a CSV file: what a key, the column's name and a line below the header say of them.

Where two of them say different things, one is wrong, and nobody but the user knows which: the column is refused.
"""

import re

from common.errors import InputError
from common.quantities import pint_quantity, units

UNIT_PATTERN = r"[^\W\d_]+(?:\^?-?\d)?(?:[ */.\u00b7]+[^\W\d_]+(?:\^?-?\d)?)*"  # m, m3, N m, dyn.cm
MAX_UNIT_LENGTH = 30  # characters
SPELLINGS = {  # in lower case: as pint has them
    "ftus": "survey_foot", "usft": "survey_foot", "us-ft": "survey_foot", "us ft": "survey_foot",
    "dyncm": "dyn cm", "dynecm": "dyn cm", "dynes cm": "dyn cm", "°": "degree",
}  # fmt: skip
LOOSE_SPELLINGS = {  # the same, of what has no other meaning that is a size: Nm is a unit of yarn to pint
    "nm": "N m", "knm": "kN m", "mnm": "MN m", "gnm": "GN m", "tnm": "TN m",
    "kj": "kJ", "kpa": "kPa", "mpa": "MPa", "gpa": "GPa",
}  # fmt: skip
USUAL_UNITS = {  # of columns; others are as likely to be words of another meaning, such as E, P or point
    "m", "metre", "metres", "meter", "meters", "km", "mm", "cm", "ft", "feet", "foot", "inch", "yd", "mi",
    "kilometre", "kilometres", "kilometer", "kilometers", *SPELLINGS, *LOOSE_SPELLINGS,
    "deg", "degree", "degrees", "rad", "s", "sec", "seconds", "ms", "min", "minutes", "h", "hr", "hours",
    "j", "kj", "mj", "gj", "n m", "nm", "n.m", "kn m", "mn m", "gn m", "dyn cm", "dyne cm", "m3", "m^3", "ft3",
}  # fmt: skip
IN_BRACKETS = re.compile(r"[\[({<]\s*([^\])}>]+?)\s*[\])}>]")
AFTER_STROKE = re.compile(r".*/\s*([^/]+?)\s*")
AT_END = re.compile(r".*(?:[^\W_][_ ,-]+|[a-z](?=[A-Z]))([A-Za-z]+)")  # depth_km, Easting, ft; depthKm
LOGARITHM = re.compile(r"(?:log|lg)(?:_?10)?\s*(?:of\s+)?", re.IGNORECASE)


def unit_quantity(text: str):
    """Quantity (pint) of 1 in the unit that a text names; None if it names none. Arithmetic (9**9**9) is no unit."""
    if len(text) > MAX_UNIT_LENGTH or not re.fullmatch(UNIT_PATTERN, text):
        return None
    plain = re.sub(r"(?<=[^\W\d_])\^?(-?\d)", r"**\1", re.sub(r"[.\u00b7]", "*", text))
    try:
        return pint_quantity(plain)
    except ValueError:
        return None


def unit_factor(
    source: str, key: str, name: str, unit: str, given: str | None, below: str | None, usual: float = 1.0
) -> float:
    """Factor that converts the numbers of a column of kind `key` to `unit`.

    Its unit is `given` (record.units), or stands in brackets or after a stroke in its name ("Depth/km"), or in a line
    `below` the header; where none does the factor is `usual`. Raises InputError, naming the file `source`, for units
    that contradict each other or are of another kind, and for a name that ends as another unit (depth_km).
    """
    found = {}
    if given:
        found[f"record.units.{key}"] = given, known_unit(given, unit)
        if found[f"record.units.{key}"][1] is None and unit_quantity(given) is None:
            raise InputError(f"record.units: {given!r} is not a unit; expected one like {unit}")
    if below and (quantity := known_unit(below, unit) or unit_quantity(below)):
        found["the line below the header"] = below, quantity
    for text in _texts(name):
        if quantity := _in_name(source, key, name, text, unit):
            found["its name"] = text, quantity
            break
    for text, quantity in found.values():
        if quantity is None or not quantity.check(unit):
            raise InputError(
                f"{source}: column {name!r} is in {text}, which is not convertible to {unit}; name another column, or "
                "its unit in record.units"
            )
    factors = {place: float(quantity.to(unit).magnitude) for place, (_, quantity) in found.items()}
    first = next(iter(factors), "")
    end = None if key.startswith("log_") else _at_end(name, unit)  # the P of "log P" is no unit
    if end and "its name" not in factors:
        text, factor = end
        if not first and not _alike(factor, usual):
            remedy = "; if it is not, rename it" if _is_usual(text) else f", or {{{key}: {unit}}}"
            raise InputError(
                f"{source}: column {name!r}: is it in {text}? Say it with record.units: {{{key}: {text}}}{remedy}"
            )
        if _is_usual(text):
            found["its name"], factors["its name"] = (text, None), factor
    if other := next((place for place in factors if first and not _alike(factors[place], factors[first])), None):
        raise InputError(
            f"{source}: column {name!r} is in {found[other][0]} by {other}, and in {found[first][0]} by {first}; "
            "correct the one that is wrong"
        )
    return factors[first] if first else usual


def check_angle(source: str, key: str, name: str) -> None:
    """Raise InputError for a column of latitude or longitude whose name states a unit that is not degrees."""
    for text in _texts(name):
        if text.casefold() in USUAL_UNITS and not text.casefold().startswith(("deg", "°")):
            raise InputError(f"{source}: column {name!r} is in {text}; a {key} is in degrees: name another column")


def _alike(one: float, other: float) -> bool:
    return abs(one - other) <= 1e-9 * abs(other)


def _texts(name: str) -> list[str]:
    """Texts of a name that may state a unit: in brackets, last ones first, else after a stroke."""
    texts = IN_BRACKETS.findall(name)[::-1]
    if not texts and (after := AFTER_STROKE.fullmatch(name)):
        texts = [after[1]]
    return [LOGARITHM.sub("", text, count=1) for text in texts]


def known_unit(text: str, unit: str):
    """Quantity of 1 in the unit that a text names in any usual spelling, if it is convertible to `unit`, else None."""
    hyphens = re.sub(r"(?<=[^\W\d_])-(?=[^\W\d_])", " ", text)
    form = text.casefold()
    for spelling in (SPELLINGS.get(form), text, hyphens, LOOSE_SPELLINGS.get(form), text.lower(), hyphens.lower()):
        quantity = unit_quantity(spelling) if spelling else None
        if spelling in SPELLINGS.values():
            quantity = units().Quantity(1.0, spelling)
        if quantity is not None and quantity.check(unit):
            return quantity
    return None


def _in_name(source: str, key: str, name: str, text: str, unit: str):
    """Quantity of 1 in the unit that a text of the column's name states; None if it states none.

    Raises InputError for a unit with a number before it, which is not read.
    """
    if quantity := known_unit(text, unit):
        return quantity
    words = re.split(r"[\s,;:]+", text)
    parts = [(word, known_unit(word, unit)) for word in (*words, " ".join(words[-2:]))]
    usual = [quantity for word, quantity in parts if quantity is not None and _is_usual(word)]
    if usual and re.match(r"[x*]?\s*\d", text):
        raise InputError(
            f"{source}: column {name!r}: {text!r} is not a unit that can be read; convert the column to {unit} and "
            f"name it so, or rename it and give record.units.{key}"
        )
    if usual:  # m below sea level
        return usual[0]
    if text.casefold() in USUAL_UNITS:
        return unit_quantity(text) or unit_quantity(text.lower())
    return None


def _is_usual(text: str) -> bool:
    return text.casefold().replace("-", " ") in USUAL_UNITS


def _at_end(name: str, unit: str) -> tuple[str, float] | None:
    """The unit that a name ends as (depth_km), and its factor to `unit`; None if it ends as none of that kind."""
    end = AT_END.fullmatch(name)
    if not end:
        return None
    quantity = known_unit(end[1], unit) if _is_usual(end[1]) else unit_quantity(end[1])
    return (end[1], float(quantity.to(unit).magnitude)) if quantity is not None and quantity.check(unit) else None
