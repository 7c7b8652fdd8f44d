"""Text with a unit to a number in SI."""

import math
from typing import Annotated

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import InputError
from common.quantities import parse_quantity, units
from common.setting_types import Settings, Unit

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


class Plank(Settings):
    """A key with bounds, one of them open."""

    length: Annotated[float, Unit("m", gt=0, le=2)]


@pytest.mark.parametrize(("text", "metres"), [("150 cm", 1.5), ("2 m", 2.0), ("2000.1 mm", None), ("0 mm", None)])
def test_bounds_hold_in_the_unit_of_the_model(text, metres):
    """Whatever the text's own; and for the numbers of a slice, which a user may not write."""
    if metres is not None:
        assert Plank.read({"length": text}).length == metres
        assert Plank.of(Plank.read({"length": text}).given()) == Plank.read({"length": text})
        with pytest.raises(InputError, match=r"length: .* has no unit"):
            Plank.read({"length": metres})
        return
    with pytest.raises(InputError, match=r"plank\.length: .* is out of range"):
        Plank.read({"length": text}, "plank")
    with pytest.raises(InputError, match="out of range"):
        Plank.of({"length": 2.0001})


@settings(deadline=None)
@given(FINITE, st.sampled_from(CASES))
def test_a_quantity_has_the_bits_that_pint_gives_it(number, case):
    """The size of a unit is looked up once; that changes no number."""
    si, unit, _ = case
    assert parse_quantity(f"{number!r} {unit}", si) == float(units().Quantity(number, unit).to(si).magnitude)
