"""The number of events of steps ahead from modelled measures: one more way to a rate, beside the runs' own events.

In the recorded steps the mine's own run has measures: failed volume, plastic work, released energy. A law of each
(baselines.rate_law) expects the recorded number from the measure and the days. The plan's own run has the measures of
the steps ahead. Laws count by the probability that they gave to the recorded numbers, each forecast from the steps
before it.
"""

import json
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from baselines.measures import OF_ATTRIBUTES
from baselines.rate_law import MIN_PERIODS, NumberForecast, RateLaw
from catalogs.compare.exposure import DAY, window
from catalogs.settings import DatedStep
from common.datasets import read_dataset
from common.errors import InputError
from plans.layout import MeasuredRate
from plans.record import RecordedNumbers, middles


def read_amounts(states: Sequence[str], steps: Sequence[DatedStep], mine: str) -> dict[str, NDArray]:
    """Measures (step,) of a run by label, from the attributes of its states; NaN from a collapse on.

    Raises InputError for states of another mine, of other steps, or too few.
    """
    if len(states) != len(steps):
        raise InputError(f"plans: a run has states of {len(states)} steps, and {len(steps)} are dated")
    rows = []
    for path, step in zip(states, steps, strict=True):
        attributes = read_dataset(path, names=()).attrs
        if (attributes.get("mine"), attributes.get("step")) != (mine, step.name):
            raise InputError(
                f"{path}: state of step {attributes.get('step')} of mine {attributes.get('mine')}, not of "
                f"{step.name} of {mine}"
            )
        stands = not attributes.get("collapsed") and bool(attributes.get("computed", 1))
        rows.append({label: float(attributes.get(name, np.nan)) if stands else np.nan
                     for label, name in OF_ATTRIBUTES.items()})  # fmt: skip
    return {label: np.array([row[label] for row in rows]).clip(min=0.0) for label in OF_ATTRIBUTES}


def rates_by_measures(
    recorded: RecordedNumbers,
    recorded_steps: Sequence[DatedStep],
    recorded_amounts: Mapping[str, NDArray],
    steps: Sequence[DatedStep],
    amounts: Mapping[str, NDArray],
    ahead: NDArray,
) -> tuple[dict[str, MeasuredRate], dict[str, float]]:
    """Number of each step ahead by name, and the weight of each measure in it; empty where the record says too little.

    recorded_steps: those that `recorded` counts; recorded_amounts: measures of the mine in these, amounts: of the plan
    in its steps, by label; ahead (step,) bool.
    """
    days, all_days = _days(recorded_steps), _days(steps)
    time, evidence, laws = middles(steps), {}, {}
    for label, own in recorded_amounts.items():
        if len(own) < MIN_PERIODS or not (np.isfinite(own).all() and np.any(own > 0.0)):
            continue
        known = recorded.recorded, own, days, recorded.middles
        laws[label] = known
        evidence[label] = RateLaw.fit(*known, recorded.dispersion_bounds).evidence
    found: dict[str, MeasuredRate] = {}
    for place in np.flatnonzero(ahead).tolist():
        parts: dict[str, NumberForecast] = {}
        for label, known in laws.items():
            amount = float(amounts[label][place])
            if np.isfinite(amount):
                law = RateLaw.fit(*known, recorded.dispersion_bounds, (amount, float(all_days[place])))
                one = law.forecast(amount, float(all_days[place]), float(time[place]))
                parts |= {label: one} if one else {}
        if parts:
            logs = np.array([evidence[label] for label in parts])
            together = NumberForecast.together(list(parts.values()), logs)
            lower, upper = together.interval
            found[steps[place].name] = MeasuredRate(together.value, float(lower), float(upper))
    weights = np.exp(np.array(list(evidence.values())) - max(evidence.values(), default=0.0))
    return found, dict(zip(evidence, (weights / weights.sum()).tolist(), strict=True)) if len(weights) else {}


def _days(steps: Sequence[DatedStep]) -> NDArray:
    """Days of dated steps (step,)."""
    return np.array([(end - start) / DAY for start, end in (window(step.model_dump()) for step in steps)], float)


def to_attribute(rates: Mapping[str, MeasuredRate], weights: Mapping[str, float]) -> str:
    """Rates and weights as JSON, for an attribute of the outcome (plans.layout)."""
    return json.dumps({"steps": {name: vars(rate) for name, rate in rates.items()}, "weights": dict(weights)})
