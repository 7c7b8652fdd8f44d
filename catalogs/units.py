"""Units as tables of events name them: m3, N m, dyn.cm."""

import re

from common.quantities import units

UNIT_PATTERN = r"[^\W\d_]+(?:\^?-?\d)?(?:[ */.\u00b7]+[^\W\d_]+(?:\^?-?\d)?)*"  # m, m3, N m, dyn.cm
MAX_UNIT_LENGTH = 30  # characters


def unit_quantity(text: str):
    """One of the unit that a text names, as pint has it; None if it names none. Arithmetic (9**9**9) is no unit."""
    if len(text) > MAX_UNIT_LENGTH or not re.fullmatch(UNIT_PATTERN, text):
        return None
    plain = re.sub(r"(?<=[^\W\d_])\^?(-?\d)", r"**\1", re.sub(r"[.\u00b7]", "*", text))
    try:
        return units().Quantity(1.0, plain)
    except Exception:  # pint raises a dozen kinds for text that is not a unit
        return None
