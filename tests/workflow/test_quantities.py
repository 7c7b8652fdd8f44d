"""Text with a unit to a number in SI."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workflow.quantities import parse_quantity, to_si

UNITS = {  # unit, its size in SI, the SI unit; by hand
    "m": [("m", 1.0), ("mm", 1e-3), ("km", 1e3), ("foot", 0.3048)],
    "Pa": [("Pa", 1.0), ("kPa", 1e3), ("MPa", 1e6), ("GPa", 1e9), ("bar", 1e5), ("psi", 6894.757293168361)],
    "Pa/m": [("MPa/m", 1e6), ("kPa/m", 1e3), ("bar/km", 1e2)],
    "kg/m^3": [("kg/m^3", 1.0), ("t/m^3", 1e3), ("g/cm^3", 1e3), ("g/cm**3", 1e3)],
    "deg": [("deg", 1.0), ("degree", 1.0), ("rad", 180 / math.pi)],
    "N": [("N", 1.0), ("MN", 1e6), ("kN", 1e3)],
    "m^3": [("m^3", 1.0), ("cm^3", 1e-6)],
    "s": [("s", 1.0), ("min", 60.0), ("day", 86400.0)],
}
CASES = [(si, unit, factor) for si, units in UNITS.items() for unit, factor in units]
FINITE = st.floats(-1e12, 1e12, allow_subnormal=False)


@settings(deadline=None)  # the first call builds the registry
@given(FINITE, st.sampled_from(CASES), st.sampled_from(["", " ", "  "]))
def test_a_quantity_is_its_number_times_the_size_of_its_unit(number, case, space):
    """Any number, any unit of the dimension, with or without a space; 1e-12 for the conversion's own rounding."""
    si, unit, factor = case
    assert parse_quantity(f"{number!r}{space}{unit}", si) == pytest.approx(number * factor, rel=1e-12, abs=1e-300)


@settings(deadline=None)
@given(FINITE, st.sampled_from(CASES), st.sampled_from(list(UNITS)))
def test_a_unit_of_another_dimension_is_refused_with_both_named(number, case, wanted):
    """ "57 m" is no stress, whatever the number."""
    si, unit, _ = case
    if si != wanted:
        with pytest.raises(ValueError, match=r"not convertible to|has no unit"):
            parse_quantity(f"{number!r} {unit}", wanted)


@pytest.mark.parametrize(
    "text", ["", "5", "m", "5 furlongs per", "5 m + 1 s", "inf m", "nan m", "1e999 m", "5 m m", "+", "[1] m"]
)
def test_what_is_no_length_is_refused(text):
    """One kind of error, whatever the text; nothing in it is evaluated."""
    with pytest.raises(ValueError, match=r"unit|finite|convertible"):
        parse_quantity(text, "m")


def test_bounds_of_the_schema_hold_in_si():
    """A bound is in the unit of the schema, whatever the text's own."""
    part = {"type": "string", "unit": "m", "exclusiveMinimum": 0, "maximum": 2}
    assert to_si("150 cm", part) == 1.5
    with pytest.raises(Exception, match="out of range"):
        to_si("2.1 m", part)
    with pytest.raises(Exception, match="out of range"):
        to_si("0 mm", part)
