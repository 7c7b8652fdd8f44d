"""Scores of forecasts in sentences, for the report of the mine."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import xarray as xr

from catalogs.report.text import fixed, number, plural, typeset, whole
from plans.scores import KNOWN, MINED_OTHERWISE, NO_FLOOR, NOT_YET, QUANTITIES, SCORED, brier, log_score


def sentences(scores: xr.Dataset) -> list[str]:
    """What each forecast said, what was recorded, and whether that is within the range; forecast_scores.nc."""
    found = []
    for row in range(scores.sizes["row"]):
        part = scores.isel(row=row)
        if str(part["status"].values) == SCORED:
            found.append(" ".join(_scored(scores, part, row)))
    for place in np.unique(scores["forecast"].values):
        own = scores.isel(row=np.flatnonzero(scores["forecast"].values == place))
        found += _others(own, _named(own.isel(row=0)))
    return found


def _named(row: xr.Dataset) -> str:
    """A forecast by its plan and file."""
    return f"plan {row['plan'].values}, {Path(str(row['file'].values)).name}"


def _others(own: xr.Dataset, name: str) -> Iterator[str]:
    """Why steps of a forecast are not scored."""
    status, steps = own["status"].values, own["step"].values
    known, waiting, without = (steps[status == one] for one in (KNOWN, NOT_YET, NO_FLOOR))
    if len(waiting):
        verb = "is" if len(waiting) == 1 else "are"
        yield f"Forecast of {name}: {', '.join(waiting)} {verb} not recorded to the end yet."
    for row in np.flatnonzero(status == MINED_OTHERWISE):
        yield f"Forecast of {name}: {steps[row]} is not scored, since {own['difference'].values[row]}."
    if len(without):
        yield (
            f"Forecast of {name}: {', '.join(without)} cannot be scored. Runs of the plan make no event, so nothing "
            "says from which size on events count."
        )
    if len(known):
        yield (
            f"Forecast of {name}: steps up to {known[-1]} are no forecasts, since the record had reached them when it "
            "was made."
        )


def _scored(scores: xr.Dataset, part: xr.Dataset, row: int) -> Iterator[str]:
    """The sentences of one row."""
    told = {
        name: (*part["range"].values[place], part["median"].values[place], part["recorded"].values[place])
        for place, name in enumerate(QUANTITIES)
    }
    within = ["within the range" if one else "outside of the range" for one in part["inside"].values]
    low, high, middle, recorded = told["number"]
    floor = typeset(f"log P {float(part['floor']):.1f}")
    verb = "was" if recorded == 1 else "were"
    yield (
        f"Forecast for {part['step'].values} ({_named(part)}): {whole(low)} to {whole(high)} events from "
        f"{floor} on (median {whole(middle)}); {whole(recorded)} {verb} recorded, {within[0]}."
    )
    low, high, middle, recorded = told["potency"]
    if np.isfinite(middle):
        yield (
            f"Potency: {number(low)} to {number(high)} m³ (median {number(middle)}); {number(recorded)} m³ recorded, "
            f"{within[1]}."
        )
        low, high, middle, recorded = told["largest"]
        ends = f"{_size(low)} to {_size(high)} (median {_size(middle)})"
        yield f"Largest event: {ends}; {_size(recorded)} recorded, {within[2]}."
    gain = float(part["gain"])
    if np.isfinite(gain):
        yield (
            f"Recorded places are {number(np.exp(gain), 2)} times as probable as under a uniform rate (information "
            f"gain {fixed(gain, 2)} nats per event)."
        )
    own = scores["said_row"].values == row
    if own.any():
        yield _chances(*(scores[name].values[own] for name in ("said_chance", "happened", "rate_chance")))


def _size(size: float) -> str:
    return typeset(f"log P {size:.1f}") if np.isfinite(size) else "none"


def _chances(chance, happened, rate) -> str:
    """How good the chances were, and those of a constant rate."""
    said = (
        f"Of {plural(len(chance), 'chance')} of an event near an opening, {number(chance.sum(), 2)} were expected to "
        f"happen and {int(happened.sum())} did. Their Brier score is {fixed(brier(chance, happened), 3)}, their "
        f"logarithmic score {fixed(log_score(chance, happened), 2)} (0 is best for both)"
    )
    if np.isfinite(rate).all():
        said += (
            f"; at the constant rate of the record before, {fixed(brier(rate, happened), 3)} and "
            f"{fixed(log_score(rate, happened), 2)}"
        )
    return said + "."
