"""Magnitudes of every type as moment magnitudes: a stated conversion, or none.

A potency follows from a moment magnitude alone. What another type (local, body wave, duration) means in moment differs
from mine to mine by up to a unit, hence a factor of thirty in potency: the configuration says it, or it is refused.
"""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from catalogs.records.settings import Conversion, normalized
from common.errors import InputError

UNTYPED = "untyped"
MOMENT_TYPES = ("mw", "mww", "mwc", "mwb", "mwr", "mwp")


def is_moment_type(kind: str) -> bool:
    """Whether a magnitude type is a moment magnitude, whichever way it was measured."""
    return kind.strip().lower() in MOMENT_TYPES


def is_convertible(kind: str, conversions: Mapping) -> bool:
    """Whether magnitudes of this type become moment magnitudes by themselves or by a stated conversion."""
    return is_moment_type(kind) or isinstance(_conversion(kind, conversions), Conversion)


def moment_magnitudes(
    values: NDArray, kinds: Sequence[str], conversions: Mapping, needed: NDArray, source: str
) -> tuple[NDArray, dict[str, int]]:
    """Moment magnitudes (event,) and how many are of each type; NaN where there is none or it is left out.

    values (event,): magnitudes, NaN where unknown; kinds: their types, "" where the file has none; conversions: {type:
    {slope, offset}} for Mw = slope M + offset, or {type: "none"} to leave events of that type out; "untyped" for those
    without a type. needed (event,) bool: events that have no other size. Raises InputError naming the types for which
    nothing is stated.
    """
    mw = np.full(len(values), np.nan)
    names = np.array([kind.strip() or UNTYPED for kind in kinds], dtype=object)
    known = np.isfinite(values)
    foreign: Counter = Counter()
    used: dict[str, int] = {}
    for name in dict.fromkeys(names[known & needed]):
        here = known & needed & (names == name)
        conversion = _conversion(name, conversions)
        if isinstance(conversion, Conversion):
            mw[here] = conversion.slope * values[here] + conversion.offset
        elif is_moment_type(name):
            mw[here] = values[here]
        elif conversion is None:
            foreign[name] += int(here.sum())
            continue
        used[name] = int(here.sum())
    if foreign:
        total = int(needed.sum())
        counts = ", ".join(f"{count} of {total} events are of type {name}" for name, count in foreign.items())
        first = next(iter(foreign))
        raise InputError(
            f"{source}: {counts}: only Mw is a moment; say how to convert, record.conversions: "
            f"{{{first}: {{slope: ..., offset: ...}}}} for Mw = slope {first} + offset, or {{{first}: none}} to leave "
            "them out"
        )
    return mw, used


def sizes_text(used: Mapping[str, int], conversions: Mapping) -> str:
    """How many magnitudes of each type were read, and their conversion."""
    texts = []
    for name, count in used.items():
        conversion = _conversion(name, conversions)
        if isinstance(conversion, Conversion):
            slope, offset = conversion.slope, conversion.offset
            how = f" as Mw = {slope:g} {name} {'-' if offset < 0 else '+'} {abs(offset):g}"
        else:
            how = "" if is_moment_type(name) else " left out"
        texts.append(f"{count} {name}{how}")
    return ", ".join(texts)


def _conversion(kind: str, conversions: Mapping) -> Conversion | str | None:
    """The conversion of a type: under its own name, else under one that differs by upper and lower case only.

    Raises InputError where two such names state different things.
    """
    sought = kind.strip() or UNTYPED
    stated = {normalized(name): value for name, value in conversions.items()}
    if sought in stated:
        return stated[sought]
    alike = {name: value for name, value in stated.items() if _folded(name) == _folded(sought)}
    first = next(iter(alike.values()), None)
    if any(value != first for value in alike.values()):
        raise InputError(
            f"record.conversions: {' and '.join(alike)} state different things, and both may be meant by type {sought} "
            f"of the file; name {sought} itself"
        )
    return first


def _folded(kind: str) -> str:
    """A type as it is compared: in lower case, but for mB (broad-band body waves), which is not mb (short-period)."""
    return kind if kind[:2] in ("mB", "MB") else kind.lower()
