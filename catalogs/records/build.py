"""Catalogue (common.event_table) from the sizes that a file holds: potency, moment, magnitude or tensor.

A potency follows from a moment magnitude alone. What another type (local, body wave, duration) means in moment differs
from mine to mine by up to a unit, hence a factor of thirty in potency: the configuration says it, or it is refused.
"""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.records.settings import Conversion, EventFileSlice, is_moment_type, normalized
from common.errors import InputError
from common.event_table import new_catalog
from common.source_tensors import (
    clear_axes,
    moment_from_potency,
    moment_magnitude,
    moment_of_magnitude,
    scalar_moment,
    scalar_potency,
    source_shares,
)

UNTYPED = "untyped"


def is_convertible(kind: str, conversions: Mapping) -> bool:
    """True if magnitudes of this type are moment magnitudes or have a stated conversion to them.

    Raises InputError where two conversions of names that differ by upper and lower case only state different things.
    """
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
    """Numbers of magnitudes read by type, each with its conversion to Mw or "left out", in a list for a sentence.

    used: number of magnitudes of each type. Raises InputError where conversions of one type contradict each other.
    """
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


SIZE_NAMES = ("potency", "log_potency", "moment", "mw")
MIN_MW, MAX_MW = -12.0, 10.0  # below grains that break in a laboratory, above any earthquake


def build_record(
    settings: EventFileSlice,
    time: NDArray,
    location: NDArray,
    sizes: dict[str, NDArray],
    tensor: NDArray | None,
    source: str = "record",
    **other,
) -> xr.Dataset:
    """A recorded catalogue with every derived variable filled in.

    settings: of these mine, twin, location_error, lame_lambda, shear_modulus count. sizes: any of potency (m3),
    log_potency, moment (N m), mw, each (event,) with NaN where unknown; the first that an event has, in this order,
    counts, and the tensor where it has none. tensor (event, 3, 3): potency tensors m3, NaN where unknown. other:
    variables of the event table; time_uncertainty (event,) s stands for both sides of a time. A scalar moment alone is
    read as shear: potency = moment / mu. Raises InputError without the moduli it needs, and naming `source` for a size
    that no event can have.
    """
    count = len(time)
    if "time_uncertainty" in other:
        either = other.pop("time_uncertainty")
        other |= {"time_lower_uncertainty": either, "time_upper_uncertainty": either}
    check_sizes(np.asarray(sizes.get("mw", []), float), source)
    mu, lame = settings.shear_modulus, settings.lame_lambda
    if mu is None or not mu > 0:
        raise InputError("record: shear_modulus is missing; give the host rock's, in Pa")
    lame = np.nan if lame is None else lame
    potency, moment = np.full(count, np.nan), np.full(count, np.nan)
    tensor = np.full((count, 3, 3), np.nan) if tensor is None else np.asarray(tensor, float)
    derived = {}
    known = np.isfinite(tensor).all(axis=(1, 2))
    if known.any():
        if not np.isfinite(lame):
            raise InputError("record: lame_lambda is missing; tensors need it: give the host rock's, in Pa")
        moments = np.full_like(tensor, np.nan)
        moments[known] = moment_from_potency(tensor[known], lame, mu)
        from_tensor = scalar_potency(tensor[known])
        axes, shares = np.full((count, 3, 3), np.nan), np.full((count, 3), np.nan)
        axes[known], shares[known] = clear_axes(tensor[known]), source_shares(tensor[known])
        derived = {f"{name}_axis": axes[:, row] for row, name in enumerate("pbt")}
        derived |= {name: shares[:, column] for column, name in enumerate(("iso", "clvd", "dc"))}
        derived["moment_tensor"] = moments
        moment[known] = scalar_moment(moments[known])
    for name in SIZE_NAMES:
        if name in sizes:
            unknown = np.isnan(potency)
            potency[unknown] = _potency_from(name, np.asarray(sizes[name], float)[unknown], mu)
    if known.any():
        potency[known] = np.where(np.isnan(potency[known]), from_tensor, potency[known])
    if "moment" in sizes:
        moment = np.where(np.isnan(sizes["moment"]), moment, sizes["moment"])
    moment = np.where(np.isnan(moment), mu * potency, moment)
    values = {"potency": potency, "moment": moment, "mw": moment_magnitude(moment)} | derived | other
    check_sizes(values["mw"], source)
    attributes = {
        "mine": settings.mine,
        "kind": "twin" if settings.twin else "recorded",
        "lame_lambda": lame,
        "shear_modulus": mu,
        "location_error": settings.location_error,
    }
    return new_catalog(count, attributes, time=time, location=location, potency_tensor=tensor, **values)


def check_sizes(mw: NDArray, source: str) -> None:
    """Raise InputError for a moment magnitude (event,) that no event has: a number of another column or unit."""
    absurd = (mw < MIN_MW) | (mw > MAX_MW)  # NaN is neither
    if absurd.any():
        event = int(np.flatnonzero(absurd)[0])
        raise InputError(
            f"{source}: event {event + 1}: Mw {mw[event]:.4g} is no event's size ({int(absurd.sum())} such): Mw runs "
            f"from {MIN_MW:g} to {MAX_MW:g}; check the column, its unit, and record.missing"
        )


def _potency_from(name: str, values: NDArray, shear_modulus: float) -> NDArray:
    """Scalar potency (m3) from a size of the named kind; shear where only the moment is known."""
    if name == "potency":
        return values
    if name == "log_potency":
        with np.errstate(over="ignore"):
            return 10.0**values
    moment = values if name == "moment" else moment_of_magnitude(values)
    return moment / shear_modulus
