"""Catalogue (common.event_table) from the sizes that a file holds: potency, moment, magnitude or tensor."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.records.settings import EventFileSlice
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
