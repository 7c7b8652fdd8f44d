"""Numbers, signs and phrases as the report writes them, and the rows of its tables of comparison."""

import re

import numpy as np

from common.source_tensors import moment_magnitude

DASH = "–"  # Stands for a value that is not known.
MAX_NAMED = 5  # Excavations that one sentence names.
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value, digits: int = 3) -> str:
    """A number for a reader: significant digits, a true minus sign, thousands apart; a dash where there is none."""
    value = float(value) if value is not None else np.nan
    if not np.isfinite(value):
        return DASH
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e6:
        decimals = max(digits - 1 - int(np.floor(np.log10(abs(value)))), 0)
        return f"{value:,.{decimals}f}".replace(",", "\u202f").replace("-", "−")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}·10".replace("-", "−") + str(int(exponent)).translate(SUPERSCRIPT)


def whole(value) -> str:
    """A count with its thousands apart."""
    return f"{int(value):,}".replace(",", "\u202f")


def fixed(value, decimals: int) -> str:
    """A number with so many decimals; a dash where there is none."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}".replace("-", "−") if np.isfinite(value) else DASH


def percent(share) -> str:
    """A share as per cent."""
    return f"{number(100 * float(share), 2)} %" if np.isfinite(float(share)) else DASH


def between(interval, form=number) -> str:
    """An interval as text; a dash if it is not known."""
    low, high = (float(value) for value in interval)
    if np.isfinite(low) and high == np.inf:
        return f"{form(low)} or more"
    return f"{form(low)} to {form(high)}" if np.isfinite([low, high]).all() else DASH


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
