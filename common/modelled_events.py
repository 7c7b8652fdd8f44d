"""Size, axes and type of modelled events, and their times within a step, for every model that makes events."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from common.errors import InputError
from common.source_tensors import (
    clear_axes,
    moment_magnitude,
    scalar_moment,
    scalar_potency,
    source_shares,
)


def describe_sources(potency: NDArray, moment: NDArray) -> dict[str, NDArray]:
    """Variables of the event table: size, axes and type of sources from their potency tensors (event, 3, 3) m3 and
    moment tensors (event, 3, 3) N m."""
    scalar = scalar_moment(moment)
    values = {"potency_tensor": potency, "potency": scalar_potency(potency)}
    values |= {"moment_tensor": moment, "moment": scalar, "mw": moment_magnitude(scalar)}
    axes, shares = clear_axes(potency), source_shares(potency)
    values |= {f"{name}_axis": axes[:, row] for row, name in enumerate("pbt")}
    values |= {name: shares[:, column] for column, name in enumerate(("iso", "clvd", "dc"))}
    return values


def spread_in_time(dates: tuple[str, str] | None, events: int, where: str) -> dict[str, NDArray]:
    """Times of ranked events, evenly over their step: start + (rank - 1/2) / N of its length; NaT without dates.

    dates: ISO dates from which and to which the step is mined. The uncertainties of a time reach to the start and the
    end of the step, as a model dates no event within it. Raises InputError naming `where` for dates that are none, or
    out of order.
    """
    if dates is None:
        return {
            "time": np.full(events, np.datetime64("NaT"), "datetime64[ns]"),
            "time_lower_uncertainty": np.full(events, np.nan),
            "time_upper_uncertainty": np.full(events, np.nan),
        }
    start, end = (_microseconds(date, f"{where}: {name}") for name, date in zip(("start", "end"), dates, strict=True))
    if end <= start:
        raise InputError(f"{where}: end {dates[1]} is not after start {dates[0]}: correct the dates")
    offset = np.rint((np.arange(events) + 0.5) / max(events, 1) * (end - start)).astype(np.int64)
    return {
        "time": (start + offset).astype("datetime64[us]").astype("datetime64[ns]"),
        "time_lower_uncertainty": offset / 1e6,
        "time_upper_uncertainty": (end - start - offset) / 1e6,
    }


def _microseconds(date: str, where: str) -> int:
    """Microseconds since 1970 (UTC) of an ISO date; a date without a zone is UTC."""
    try:
        stamp = pd.Timestamp(date)
        if stamp is pd.NaT:
            raise ValueError("no date")
    except ValueError as error:
        raise InputError(f"{where}: '{date}' is not an ISO date such as 2019-08-01") from error
    stamp = stamp.tz_convert("UTC").tz_localize(None) if stamp.tzinfo else stamp
    return int(stamp.to_datetime64().astype("datetime64[us]").astype(np.int64))
