"""Scores of forecasts in sentences, for the report of the mine."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from catalogs.report.text import fixed, number, plural, typeset, whole
from plans.scores import KNOWN, NOT_YET, QUANTITIES, SCORED, brier, log_score


def sentences(scores: xr.Dataset) -> list[str]:
    """What each forecast said, what was recorded, and whether that is within the range; forecast_scores.nc."""
    found = []
    for row in range(scores.sizes["row"]):
        part = scores.isel(row=row)
        if str(part["status"].values) == SCORED:
            found.append(" ".join(_scored(scores, part, row)))
    for status, verb in (
        (NOT_YET, "not recorded to the end yet"),
        (KNOWN, "no forecast, since the record covered the beginning when it was made"),
    ):
        for plan in dict.fromkeys(scores["plan"].values):
            chosen = (scores["plan"].values == plan) & (scores["status"].values == status)
            if chosen.any():
                steps = ", ".join(map(str, scores["step"].values[chosen]))
                found.append(f"{steps} of the plan {plan}: {verb}.")
    return found


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
        f"Forecast for {part['step'].values} (plan {part['plan'].values}): {whole(low)} to {whole(high)} events from "
        f"{floor} on, most likely about {whole(middle)}; {whole(recorded)} {verb} recorded, {within[0]}."
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
